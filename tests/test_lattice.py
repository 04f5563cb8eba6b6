"""Grids with points near surfaces only say what full grids say."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from netsp import InputError
from netsp.world.scene import voxels
from netsp.world.scene.field import DistanceField
from netsp.world.scene.grid import SIDE
from netsp.world.scene.lattice import Dense
from netsp.world.scene.scene_policy import GridPolicy
from netsp.world.scene.sites import site_distance, triangle_sites
from netsp.world.tether import TETHERS

VOXEL = 0.07


def field(grid):
    return DistanceField.build([], [], np.empty((0, 4)), [], grid, 0.0)


def boxes(seed, count=5):
    """Boxes of any size and attitude, some across others."""
    rng = np.random.default_rng(seed)
    parts = []
    for _ in range(count):
        part = trimesh.creation.box(rng.uniform(0.3, 3.0, 3))
        part.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        part.apply_translation(rng.uniform(-2.5, 2.5, 3))
        parts.append(part)
    return trimesh.util.concatenate(parts)


def hollow():
    inner = trimesh.creation.icosphere(subdivisions=3, radius=1.2)
    inner.invert()
    return trimesh.util.concatenate([trimesh.creation.icosphere(subdivisions=3, radius=2.0), inner])


def torn(seed):
    mesh = boxes(seed)
    mesh.update_faces(np.arange(len(mesh.faces)) % 7 != 0)
    return mesh


SPARSE = GridPolicy(max_dense_points=0, slab_blocks=150 * GridPolicy().workers)
"""Policy of sparse grids that are built in slabs of a few blocks."""


def sparse(build):
    """Return what `build` makes with a sparse grid."""
    return build(SPARSE)


def on_mesh(mesh, **options):
    """Return a function that builds the grid of a mesh with a policy."""
    options.setdefault("voxel", VOXEL)

    def build(policy=None):
        return voxels.grid_of_triangles(mesh.vertices, mesh.faces, policy=policy, **options)

    return build


def around(mesh, count, seed=0):
    low, high = mesh.bounds
    return np.random.default_rng(seed).uniform(low - 1.0, high + 1.0, (count, 3))


@pytest.mark.parametrize(
    "mesh", [boxes(1), boxes(2), torn(3), hollow()], ids=["boxes", "more boxes", "torn", "hollow"]
)
def test_near_surfaces_a_sparse_grid_says_what_a_full_one_says(mesh):
    build = on_mesh(mesh)
    full, part = build(), sparse(build)
    assert full.table is None
    assert part.table is not None
    assert full.notes == part.notes
    assert part.voxel == pytest.approx(VOXEL)
    p = around(mesh, 50_000)
    a, b = field(full).distance(p), field(part).distance(p)
    near = (a > -2.0 * VOXEL) & (a < 0.6 * SIDE * VOXEL)
    assert near.sum() > 2_500
    assert np.abs(a - b)[near].max() < 0.01 * VOXEL
    assert ((a < 0.0) == (b < 0.0)).all()


def test_a_sparse_grid_of_a_cloud_has_the_surface_of_a_full_one():
    mesh = boxes(4)
    points = trimesh.sample.sample_surface(mesh, 15_000, seed=1)[0]

    def build(policy=None):
        return voxels.grid_of_cloud(points, voxel=VOXEL, policy=policy)

    p = around(mesh, 30_000)
    full, part = field(build()), field(sparse(build))
    a, b = full.distance(p), part.distance(p)
    near = np.abs(a) < 0.3
    assert np.abs(a - b)[near].max() < 0.2 * VOXEL
    assert np.abs(a - b)[near].mean() < 1e-3 * VOXEL


def test_a_sparse_sheet_of_points_is_as_thick_as_a_full_one():
    u, v = np.meshgrid(np.linspace(-1, 1, 60), np.linspace(-1, 1, 60))
    points = np.column_stack([u.ravel(), v.ravel(), 0 * u.ravel()])
    grid = sparse(lambda policy: voxels.grid_of_cloud(points, voxel=0.05, policy=policy))
    assert any("sheet" in n for n in grid.notes)
    assert field(grid).distance([[0, 0, 0.3], [0, 0, -0.3]]) == pytest.approx(0.2, abs=0.01)


def test_far_from_surfaces_a_sparse_grid_is_never_above_the_distance():
    # a small ball and a needle curve the distance as much as anything can
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.15)
    needle = trimesh.creation.box([0.1, 0.1, 6.0])
    needle.apply_translation([3.0, 0.0, 0.0])
    mesh = trimesh.util.concatenate([ball, needle])
    grid = sparse(on_mesh(mesh))
    sites = triangle_sites(np.asarray(mesh.triangles))
    p = around(mesh, 4000)
    true = np.array([min(site_distance(sites, s, *q) for s in range(len(sites))) for q in p])
    said = field(grid).distance(p)
    outside = said > 0.0
    # linear reading between voxels, too, is above a curved distance: by h² / (4 d)
    above = VOXEL**2 / (4.0 * np.maximum(true, VOXEL))
    assert (said <= true + above)[outside].all()
    inner = np.abs(p - mesh.bounds.mean(0)).max(1) < 3.0
    assert (true - said)[outside & inner].max() < 0.6 * SIDE * VOXEL
    assert np.median((true - said)[outside & inner]) < 0.1 * SIDE * VOXEL


def test_a_sparse_grid_does_not_jump_anywhere():
    mesh = boxes(5)
    grid = sparse(on_mesh(mesh))
    p = around(mesh, 60_000)
    for axis in range(3):
        # onto faces of cells, from both sides
        q = p.copy()
        steps = np.rint((q[:, axis] - grid.origin[axis]) / grid.size)
        q[:, axis] = grid.origin[axis] + grid.size * steps
        step = np.zeros(3)
        step[axis] = 1e-7
        low, high = grid.origin, grid.origin + grid.size * (np.array(grid.counts) - 1)
        q = q[((q > low + 1e-3) & (q < high - 1e-3)).all(1)]
        assert len(q) > 20_000
        jump = np.abs(field(grid).distance(q + step) - field(grid).distance(q - step))
        assert jump.max() < 1e-5


def test_a_tether_is_as_long_in_a_sparse_grid_as_in_a_full_one():
    mesh = boxes(6, 7)

    build = on_mesh(mesh)
    t = np.linspace(0.0, 1.0, 200)[:, None]
    ring = np.hstack([6.5 * np.cos(9.0 * t), 6.5 * np.sin(9.0 * t), 3.0 * np.sin(7.0 * t)])
    models = [TETHERS["geodesic"](field(g), delta=0.15) for g in (build(), sparse(build))]
    # the points of the two grids lie elsewhere: of two tethers driven, one may slip off a box on
    # the other side. So one is driven, and at its stops it is pulled taut in both
    tether = models[0].start(ring[0], ring[0])
    lengths = []
    for k in range(0, len(ring), 10):
        tether, _ = models[0].drive(tether, ring[k : k + 10])
        lengths.append([model.refine(tether).length for model in models])
    full, part = np.array(lengths).T
    assert (full > 1.1 * np.linalg.norm(ring[9::10] - ring[0], axis=1)).mean() > 0.3
    apart = np.abs(part / full - 1.0)
    assert np.median(apart) < 2e-4
    assert np.mean(apart < 0.01) >= 0.9


def test_a_thin_plate_is_told_in_a_sparse_grid_too():
    plate, block = trimesh.creation.box([4.0, 4.0, 0.2]), trimesh.creation.box([2.0, 2.0, 2.0])
    block.apply_translation([6.0, 0.0, 0.0])
    for mesh, thin in ((plate, True), (block, False)):
        grid = sparse(
            lambda policy, mesh=mesh: voxels.grid_of_triangles(
                mesh.vertices, mesh.faces, voxel=0.05, policy=policy
            )
        )
        assert bool(field(grid).thinner_than(0.5)) == thin


def test_blocks_are_only_where_they_are_wanted():
    mesh = trimesh.creation.box([4.0, 4.0, 4.0])
    region = np.array([[-9.0, -9.0, 0.0], [9.0, 9.0, 9.0]])
    grids = [
        sparse(
            lambda policy, r=r: voxels.grid_of_triangles(
                mesh.vertices, mesh.faces, voxel=VOXEL, region=r, policy=policy
            )
        )
        for r in (None, region)
    ]
    everywhere, above = (field(g) for g in grids)
    assert len(grids[1].values) < 0.75 * len(grids[0].values)
    p = around(mesh, 20_000)
    up = p[p[:, 2] > 0.1]
    assert np.abs(everywhere.distance(up) - above.distance(up)).max() < 0.01 * VOXEL
    # below it is coarser and right
    below = p[p[:, 2] < -0.1]
    deep = np.abs(everywhere.distance(below)) > 0.6 * SIDE * VOXEL
    a, b = everywhere.distance(below)[deep], above.distance(below)[deep]
    assert ((a < 0.0) == (b < 0.0)).all()


def test_a_sparse_field_is_kept_in_a_file(tmp_path):
    mesh = boxes(7)
    one = field(
        sparse(
            lambda policy: voxels.grid_of_triangles(
                mesh.vertices, mesh.faces, voxel=VOXEL, policy=policy
            )
        )
    )
    one.save(tmp_path / "field.npz")
    other = DistanceField.load(tmp_path / "field.npz")
    p = around(mesh, 1000)
    assert (one.distance(p) == other.distance(p)).all()
    assert other.voxel == one.voxel


def test_more_memory_than_allowed_is_refused_with_voxels_that_fit():
    ball = trimesh.creation.icosphere(subdivisions=2)

    with pytest.raises(InputError, match="GiB") as error:
        sparse(on_mesh(ball, voxel=0.004, memory_limit=0.02))
    better = float(str(error.value).split("voxels of ")[-1].split(" or")[0])
    assert 0.004 < better < 0.05
    assert sparse(on_mesh(ball, voxel=better, memory_limit=0.02)).table is not None


@pytest.mark.parametrize("kind", ["full", "sparse"])
def test_the_voxels_of_a_field_make_the_same_field_again(kind):
    mesh = boxes(5)

    build = on_mesh(mesh)
    grid = sparse(build) if kind == "sparse" else build()
    one = field(grid)
    again = one.voxels
    assert again.counts == tuple(grid.counts)
    assert again.voxel == pytest.approx(grid.voxel)
    p = around(mesh, 2000)
    assert np.array_equal(field(again).distance(p), one.distance(p))


@pytest.mark.parametrize("seed", range(5))
def test_distances_below_others_are_the_same_as_without_a_limit(seed):
    rng = np.random.default_rng(seed)
    far, near = rng.uniform(1.0, 5.0, (2, 3, 3, 3))
    lattice = Dense(np.zeros(3), 0.3, (21, 21, 21))
    others = lattice.closest(triangle_sites(far))[0] + np.float32(0.2)
    whole = lattice.closest(triangle_sites(near))[0]
    found = lattice.closest(triangle_sites(near), below=others)[0]
    is_below = whole < others
    assert is_below.any()
    assert np.array_equal(found[is_below], whole[is_below])
    assert (found[~is_below] >= others[~is_below]).all()
