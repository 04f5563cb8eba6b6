"""Scenes: distances are those of the shapes, voxels are close to them, bad input is named."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError, Problem
from netsp.command.main import main
from netsp.world import DistanceField, Scene
from netsp.world.scene.packing import CELLS
from netsp.world.scene.readers import read_cloud_file, read_mesh_file
from netsp.world.scene.surfaces import surface_of
from netsp.world.scene.voxels import grid_of_cloud, grid_of_triangles

trimesh = pytest.importorskip("trimesh")

SHAPES = {
    "sphere": {"center": [0.2, -0.1, 0.3], "radius": 0.7},
    "capsule": {"a": [-1, 0, 0.2], "b": [1, 0.5, -0.4], "radius": 0.4},
    "cylinder": {"a": [-1, 0, 0.2], "b": [1, 0.5, -0.4], "radius": 0.5},
    "box": {"center": [0.1, 0.2, -0.3], "size": [1, 0.6, 1.4], "rotation": [20, -35, 70]},
    "torus": {"center": [0, 0.1, 0], "axis": [0.2, -0.3, 1], "major_radius": 1.0,
              "minor_radius": 0.3},
    "post": {"center": [0.3, -0.2], "radius": 0.6},
    "prism": {"polygon": [[-1, -1], [1, -1], [1, 1], [0, -0.2], [-1, 1]], "grow": 0.2},
    "half_space": {"point": [0, 0, -0.5], "normal": [0.1, 0.2, 1]},
}  # fmt: skip
ELBOW = {"center": [0, 0, 0], "axis": [0, 0, 1], "major_radius": 1.0, "minor_radius": 0.3,
         "start": [1, 0, 0], "angle": 100}  # fmt: skip


def field_of(*solids, **more):
    return Scene(solids=solids, **more).field()


ALL = [{k: v} for k, v in SHAPES.items()] + [{"torus": ELBOW}]
points = st.tuples(*[st.floats(-2, 2)] * 3).map(np.array)


@pytest.mark.parametrize("solid", ALL, ids=lambda s: next(iter(s)))
@settings(max_examples=40, deadline=None)
@given(p=points, q=points)
def test_distances_are_lipschitz_and_gradients_lead_to_the_surface(solid, p, q):
    field = field_of(solid)
    assert abs(field.distance(p) - field.distance(q)) <= np.linalg.norm(p - q) + 1e-9
    gradient = field.gradient(p)
    assert np.linalg.norm(gradient) == pytest.approx(1.0)
    d = field.distance(p)
    if d > 0:  # back along the gradient lies the closest point of the surface
        assert field.distance(p - d * gradient) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("solid", ALL, ids=lambda s: next(iter(s)))
def test_surfaces_that_are_drawn_are_where_the_distance_is_zero(solid):
    scene = Scene(solids=[solid])
    low, high = -2 * np.ones(3), 2 * np.ones(3)
    vertices, faces = surface_of(scene.solids[0].shape, low, high)
    corners = vertices[np.unique(faces)]
    d = scene.field().distance(corners)
    # ends of posts and prisms and centres of flat ends lie within the solid
    assert d.max() < 0.02
    assert np.mean(np.abs(d) < 0.02) > 0.5


def test_many_solids_give_the_same_distances_as_each_alone():
    rng = np.random.default_rng(0)
    solids = [
        {"capsule": {"a": list(rng.uniform(-3, 3, 3)), "b": list(rng.uniform(-3, 3, 3)),
                     "radius": 0.1 + 0.2 * rng.random()}}
        for _ in range(30)
    ]  # fmt: skip
    field, p = field_of(*solids), rng.uniform(-5, 5, (500, 3))
    each = np.array([field_of(s).distance(p) for s in solids])
    assert field.arrays.data[CELLS] > 0.0
    assert np.allclose(field.distance(p), each.min(0), atol=1e-12)
    assert np.array_equal(field.nearest(p), each.argmin(0))


def test_a_problem_and_its_scene_share_one_world():
    problem = Problem(
        base=(0, 0), goals=[(9, 0)], tether_length=20, clearance=0.3,
        obstacles=[{"center": (4, 1), "radius": 1}, {"polygon": [(5, -4), (7, -4), (6, -2)]}],
    )  # fmt: skip
    field = Scene.from_problem(problem).field()
    p = np.random.default_rng(1).uniform(-2, 10, (300, 3))
    expected = np.min([o.signed_distance(p[:, :2]) for o in problem.obstacles], axis=0)
    assert np.allclose(field.distance(p), expected - problem.clearance)


def test_the_tether_radius_grows_everything():
    field = field_of({"sphere": SHAPES["sphere"]}, tether_radius=0.1)
    assert field.distance([0.2, -0.1, 1.3]) == pytest.approx(0.2)


@pytest.mark.parametrize("kind", ["solids", "voxels"])
def test_a_field_reads_back_as_it_was_written(kind, tmp_path):
    field = field_of(*[{k: v} for k, v in SHAPES.items()])
    if kind == "voxels":
        ball = trimesh.creation.icosphere(subdivisions=2)
        field = DistanceField.build(
            [], [], [], [], grid_of_triangles(ball.vertices, ball.faces), 0.0
        )
    field.save(tmp_path / "field.npz")
    again = DistanceField.load(tmp_path / "field.npz")
    p = np.random.default_rng(2).uniform(-1.2, 1.2, (100, 3))
    assert np.array_equal(field.distance(p), again.distance(p))
    assert (field.voxel, field.notes, field.thickness) == (
        again.voxel, again.notes, again.thickness
    )  # fmt: skip
    (tmp_path / "other.npz").write_bytes(b"PK\x03\x04")
    with pytest.raises(InputError, match=r"other\.npz"):
        DistanceField.load(tmp_path / "other.npz")


def voxel_field(grid):
    return DistanceField.build([], [], [], [], grid, 0.0)


def test_voxels_of_a_closed_mesh_are_true_to_a_fraction_of_a_voxel():
    """Near a round surface, where linear interpolation errs by h^2 / (8 r) at most."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.8)
    field = voxel_field(grid_of_triangles(ball.vertices, ball.faces, voxel=0.05))
    rng = np.random.default_rng(3)
    p = rng.normal(size=(4000, 3))
    p *= (rng.uniform(0.7, 0.9, 4000) / np.linalg.norm(p, axis=1))[:, None]
    error = field.distance(p) - (np.linalg.norm(p, axis=1) - 0.8)
    assert np.abs(error).max() < 0.05 * 0.05
    assert field.notes == ()


def test_far_from_the_grid_distances_are_lower_bounds_that_grow():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.8)
    field = voxel_field(grid_of_triangles(ball.vertices, ball.faces, voxel=0.05))
    p = np.outer(np.linspace(1.5, 9, 20), [0.6, 0.64, 0.48])
    d = field.distance(p)
    assert (d <= np.linalg.norm(p, axis=1) - 0.8 + 0.01).all()
    assert (np.diff(d) > 0).all()


def test_overlapping_parts_unite_and_cavities_are_solid():
    a = trimesh.creation.box((1, 1, 1))
    b = trimesh.creation.box((1, 1, 1)).apply_translation((0.6, 0, 0))
    both = trimesh.util.concatenate([a, b])
    grid = grid_of_triangles(both.vertices, both.faces, voxel=0.04)
    assert any("overlap" in n for n in grid.notes)
    assert voxel_field(grid).distance([0.3, 0.0, 0.0]) < -0.15
    shell = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    inner = trimesh.creation.icosphere(subdivisions=3, radius=0.8)
    inner.invert()
    hollow = trimesh.util.concatenate([shell, inner])
    grid = grid_of_triangles(hollow.vertices, hollow.faces, voxel=0.05)
    assert any("a cavity" in n for n in grid.notes)
    assert voxel_field(grid).distance([0.0, 0.0, 0.0]) < 0


def test_parts_turned_against_each_other_do_not_cancel():
    box = trimesh.creation.box((2, 1, 1))
    other = box.copy().apply_translation((1, 0, 0))
    other.invert()
    both = trimesh.util.concatenate([box, other])
    grid = grid_of_triangles(both.vertices, both.faces, voxel=0.04)
    assert any("inside out" in n for n in grid.notes)
    assert voxel_field(grid).distance([0.5, 0.0, 0.0]) < -0.4


@pytest.mark.parametrize(
    ("vertices", "faces", "more", "message"),
    [
        (np.eye(3), [[0, 1, 7]], {}, "corner"),
        (np.eye(3)[:, :2], [[0, 1, 2]], {}, "vertices"),
        (np.eye(4)[:, :3], [[0, 1, 2, 3]], {}, "faces"),
        (np.eye(3), [[0, 1, 2]], {"voxel": float("nan")}, "voxel"),
        (np.eye(3), [[0, 1, 2]], {"voxel": -1.0}, "voxel"),
    ],
)
def test_meshes_of_no_use_are_refused(vertices, faces, more, message):
    with pytest.raises(InputError, match=message):
        grid_of_triangles(vertices, faces, **more)


def test_voxels_too_large_for_a_mesh_are_refused():
    box = trimesh.creation.box((1, 1, 1))
    with pytest.raises(InputError, match=r"mesh\.voxel: 50 is larger than the mesh"):
        grid_of_triangles(box.vertices, box.faces, voxel=50.0)


def test_an_open_mesh_is_a_shell_and_says_so():
    sheet = trimesh.creation.box((1, 1, 1))
    faces = sheet.faces[np.abs(sheet.face_normals[:, 2] - 1.0) > 1e-9]  # no lid
    grid = grid_of_triangles(sheet.vertices, faces, voxel=0.04)
    assert any("open" in n for n in grid.notes)
    field = voxel_field(grid)
    assert field.distance([0, 0, 0.2]) > 0.2  # water flows in from above
    assert field.distance([0.5, 0, 0]) < 0
    assert not field.line_of_sight([0, 0, 0], [1, 0, 0])


def test_a_cloud_on_a_surface_is_solid_within_and_passes_through_its_points():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    cloud, _ = trimesh.sample.sample_surface(ball, 12000, seed=1)
    field = voxel_field(grid_of_cloud(cloud, voxel=0.05))
    assert np.abs(field.distance(cloud)).mean() < 0.01
    p = np.random.default_rng(4).normal(size=(1000, 3))
    p *= (np.linspace(0.85, 1.25, 1000) / np.linalg.norm(p, axis=1))[:, None]
    assert np.abs(field.distance(p) - (np.linalg.norm(p, axis=1) - 1.0)).max() < 0.02
    assert field.distance([0.0, 0.0, 0.0]) < -0.7


def test_a_sheet_of_points_is_solid_two_voxels_to_either_side():
    u, v = np.meshgrid(np.linspace(-1, 1, 60), np.linspace(-1, 1, 60))
    grid = grid_of_cloud(np.column_stack([u.ravel(), v.ravel(), 0 * u.ravel()]), voxel=0.05)
    assert any("sheet" in n for n in grid.notes)
    field = voxel_field(grid)
    assert not field.line_of_sight([0, 0, 1], [0, 0, -1])
    assert field.distance([[0, 0, 0.3], [0, 0, -0.3]]) == pytest.approx(0.2, abs=0.01)


def test_clouds_and_meshes_are_read_from_files(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    ball.export(tmp_path / "ball.stl")
    np.savez(tmp_path / "cloud.npz", points=ball.vertices)
    np.savetxt(tmp_path / "cloud.csv", ball.vertices, delimiter=",", header="x,y,z", comments="")
    expected = grid_of_cloud(ball.vertices, voxel=0.1).values
    for name in ("cloud.npz", "cloud.csv"):
        found = grid_of_cloud(read_cloud_file(tmp_path / name).points, voxel=0.1).values
        assert np.allclose(found, expected, atol=1e-4)
    scene = {"schema_version": 1, "mesh": {"file": "ball.stl", "scale": 2.0, "voxel": 0.1}}
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    assert Scene.load(tmp_path / "scene.json").field().distance([0, 0, 3]) == pytest.approx(1, 0.05)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((0, 3)), "at least 4"),
        (np.full((9, 3), np.nan), "not finite"),
        (np.zeros((9, 3)), "the same"),
        (np.zeros((9, 2)), "three coordinates"),
    ],
)
def test_clouds_of_no_use_are_refused(points, message):
    with pytest.raises(InputError, match=message):
        grid_of_cloud(points)


def test_a_grid_that_is_too_large_is_refused_with_one_that_is_not():
    ball = trimesh.creation.icosphere(subdivisions=2)
    with pytest.raises(InputError, match="GiB") as error:
        grid_of_triangles(ball.vertices, ball.faces, voxel=0.0005)
    better = float(str(error.value).split("voxels of ")[-1].split(" or")[0])
    assert 0.0005 < better < 0.005
    with pytest.raises(InputError, match=r"got none"):
        grid_of_triangles(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))
    with pytest.raises(InputError, match="no such file"):
        read_mesh_file("missing.stl")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"solids": [{"sphere": {"center": [0, 0], "radius": -1}}]}, r"radius: expected a number"),
        ({"solids": [{"sphere": {"center": [0, 0, 0], "radius": 1}, "post": {"center": [0, 0],
          "radius": 1}}]}, "expected one of"),
        ({"solids": [{}]}, "expected one of"),
        ({"solids": [{"torus": {"center": [0, 0, 0], "major_radius": 1, "minor_radius": 2}}]},
         "minor_radius"),
        ({"solids": [{"cylinder": {"a": [0, 0, 0], "b": [0, 0, 0], "radius": 2}}]}, "different"),
        ({"bounds": [0, 0, 0, 1, 1, -1]}, "bounds"),
        ({"colour": "red"}, "colour: unknown field"),
        ({}, "empty"),
    ],
)  # fmt: skip
def test_bad_scenes_are_named(data, message):
    with pytest.raises(InputError, match=message):
        Scene.from_json(json.dumps({"schema_version": 1, **data})).field()


def test_thin_parts_are_named():
    field = field_of({"name": "wire", "capsule": {"a": [0, 0, 0], "b": [1, 0, 0], "radius": 0.02}})
    assert "wire" in field.thinner_than(0.1)[0]
    assert field.thinner_than(0.03) == ()
    plate = trimesh.creation.box((1, 1, 0.2))
    field = voxel_field(grid_of_triangles(plate.vertices, plate.faces, voxel=0.02))
    assert field.thinner_than(0.1) == ()
    assert "thinner" in field.thinner_than(0.4)[0]


def test_plot_draws_a_scene_with_its_tether(tmp_path, capsys):
    scene = {"schema_version": 1, "name": "post", "solids": [{"capsule": {
        "a": [0, 0, -2], "b": [0, 0, 2], "radius": 0.5}}]}  # fmt: skip
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    (tmp_path / "path.csv").write_text("x,y,z\n-2,0,0\n0,1,0\n2,0,0\n")
    for name in ("a.png", "a.svg", "a.html"):
        picture = tmp_path / name
        files = [str(tmp_path / "scene.json"), str(tmp_path / "path.csv"), "-o", str(picture)]
        assert main(["plot", *files]) == 0
        assert picture.stat().st_size > 10_000
    assert "taut tether" in capsys.readouterr().err
    page = (tmp_path / "a.html").read_text()
    assert "taut tether" in page
    assert "<script src=" not in page


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("x,y,z\n-2,0,0\n2,0,0\n", "passes through a solid"),
        ("x,y,z\n0,0,0\n2,0,0\n", "inside a solid|through a solid"),
        ("x,y\n0,0\n2,0\n", "x, y, z"),
        ("x,y,z\n-2000,0,0\n-2000,1,0\n2000,1,0\n2000,1e4,0\n", "units"),
    ],
)
def test_paths_that_do_not_fit_the_scene_are_refused(path, message, tmp_path, capsys):
    scene = {"schema_version": 1, "solids": [{"post": {"center": [0, 0], "radius": 0.5}}]}
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    (tmp_path / "path.csv").write_text(path)
    out = tmp_path / "a.png"
    assert main(["plot", str(tmp_path / "scene.json"), str(tmp_path / "path.csv"), "-o",
                 str(out)]) == 2  # fmt: skip
    import re

    error = capsys.readouterr().err
    assert re.search(message, error)
    assert len(error.strip().splitlines()) == 1
    assert not out.exists()


def test_schema_of_scenes_is_printed(capsys):
    assert main(["schema", "scene"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "netsp scene"
