"""Meshes as people have them: what is solid, what is a sheet, and what a note says."""

import json
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError
from netsp.world import Scene
from netsp.world.mission.equipment import Camera
from netsp.world.scene.face_tree import FaceTree
from netsp.world.scene.mesh_body import body_of_mesh
from netsp.world.scene.mesh_edges import edges_of, open_loops, pieces_of
from netsp.world.scene.scene_policy import GridPolicy
from netsp.world.scene.voxels import grid_of_triangles
from netsp.world.simulator.coverage import Coverage, surface_patches
from tests.test_scene import voxel_field

trimesh = pytest.importorskip("trimesh")

BALL = trimesh.creation.icosphere(subdivisions=3)
ROOMY = st.tuples(*[st.floats(-1.5, 1.5)] * 3).map(np.array)


def ball_with_holes(rng, count, size=0.25):
    """Faces of a ball without those near some directions."""
    middles = BALL.triangles_center
    holes = rng.normal(size=(count, 3))
    holes /= np.linalg.norm(holes, axis=1)[:, None]
    return BALL.faces[np.linalg.norm(middles[:, None] - holes, axis=2).min(axis=1) > size], holes


@settings(max_examples=30, deadline=None)
@given(p=ROOMY)
def test_the_winding_number_of_a_closed_mesh_is_1_inside_and_0_outside(p):
    # the ball is convex: its inside is behind all faces
    beyond = np.einsum("md,md->m", p - BALL.triangles_center, BALL.face_normals).max()
    tree = FaceTree.build(np.asarray(BALL.triangles))
    if abs(beyond) > 1e-3:
        assert tree.windings(p[None])[0] == pytest.approx(float(beyond < 0), abs=0.03)
        # without dipoles, the solid angles add up exactly
        assert tree.windings(p[None], 1e9)[0] == pytest.approx(float(beyond < 0), abs=1e-9)


def test_the_winding_number_of_a_disc_is_its_solid_angle():
    """On the axis at height h, a disc of radius 1 takes up 2 pi (1 - h / sqrt(1 + h^2))."""
    disc = trimesh.creation.cylinder(1.0, 1.0, sections=400)
    faces = disc.faces[disc.face_normals[:, 2] > 0.9]
    tree = FaceTree.build(disc.vertices[faces])
    for h in (0.1, 1.0, 5.0):
        expected = 0.5 * (1.0 - h / np.hypot(1.0, h))
        places = np.array([[0.0, 0.0, 0.5 - h], [0.0, 0.0, 0.5 + h]])
        assert tree.windings(places) == pytest.approx([expected, -expected], abs=0.005)


def test_rays_go_as_far_as_the_nearest_face():
    rng = np.random.default_rng(0)
    triangles = rng.normal(size=(60, 3, 3))
    starts, ahead = rng.normal(size=(200, 3)), rng.normal(size=(200, 3))
    found = FaceTree.build(triangles).ray_lengths(starts, ahead)
    expected = np.full(200, np.inf)
    for a, b, c in triangles:  # s + t d = a + u (b - a) + v (c - a), one system for each ray
        sides = np.stack([np.broadcast_to(b - a, ahead.shape), np.broadcast_to(c - a, ahead.shape),
                          -ahead], axis=-1)  # fmt: skip
        u, v, t = np.linalg.solve(sides, (starts - a)[..., None])[..., 0].T
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        expected[hit] = np.minimum(expected[hit], t[hit])
    assert np.isfinite(expected).sum() > 50
    assert found == pytest.approx(expected)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10_000), share=st.floats(0.0, 0.4))
def test_loops_close_whatever_is_missing_and_pieces_agree_on_their_outside(seed, share):
    rng = np.random.default_rng(seed)
    faces = BALL.faces[rng.random(len(BALL.faces)) >= share].astype(np.int64)
    flip = rng.random(len(faces)) < 0.5
    faces[flip] = faces[flip][:, ::-1]
    _, turn, one_sided = pieces_of(faces)
    faces = np.where(turn[:, None], faces[:, ::-1], faces)
    assert not one_sided.any()
    assert edges_of(faces).uneven_count == 0
    fans = [
        (loop[k - 1], loop[k], 10_000 + n)
        for n, loop in enumerate(open_loops(faces)) for k in range(len(loop))
    ]  # fmt: skip
    closed = edges_of(np.vstack([faces, np.array(fans).reshape(-1, 3).astype(int)]))
    assert (closed.balance == 0).all()


def test_a_moebius_strip_is_a_sheet():
    angle = np.linspace(0.0, 2.0 * np.pi, 41)[:-1]
    out = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    lean = np.column_stack([np.cos(angle) * np.cos(angle / 2), np.sin(angle) * np.cos(angle / 2),
                            np.sin(angle / 2)])  # fmt: skip
    vertices = np.vstack([out - 0.3 * lean, out + 0.3 * lean])
    faces = []
    for k in range(40):
        a, b, c, d = k, 40 + k, k + 1, 40 + k + 1
        if k == 39:
            c, d = 40, 0
        faces += [(a, b, c), (b, d, c)]
    body = body_of_mesh(vertices, np.array(faces), surface="solid")
    assert not len(body.solid)
    assert len(body.sheet) == 80


@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 4))
def test_a_ball_with_holes_is_solid_and_right_but_near_its_holes(seed, count):
    rng = np.random.default_rng(seed)
    faces, holes = ball_with_holes(rng, count)
    grid = grid_of_triangles(BALL.vertices, faces, voxel=0.1)
    assert any("closed, the widest" in n for n in grid.notes)
    p = rng.uniform(-1.3, 1.3, (2000, 3))
    depth = 1.0 - np.linalg.norm(p, axis=1)
    far = np.linalg.norm(p[:, None] - holes, axis=2).min(axis=1) > 0.5
    p, depth = p[far & (np.abs(depth) > 0.03)], depth[far & (np.abs(depth) > 0.03)]
    assert (np.sign(voxel_field(grid).distance(p)) == -np.sign(depth)).all()


@pytest.mark.parametrize("how", ["inverted", "half turned", "faces apart", "twice"])
def test_spoiled_meshes_give_the_solid_of_the_sound_one(how):
    rng = np.random.default_rng(3)
    vertices, faces = np.asarray(BALL.vertices), np.asarray(BALL.faces)
    sound = grid_of_triangles(vertices, faces, voxel=0.08)
    if how == "inverted":
        faces = faces[:, ::-1]
    elif how == "half turned":
        faces = np.where((rng.random(len(faces)) < 0.5)[:, None], faces[:, ::-1], faces)
    elif how == "faces apart":
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    else:
        faces = np.vstack([faces, faces[:, ::-1]])
    spoiled = grid_of_triangles(vertices, faces, voxel=0.08)
    assert np.allclose(spoiled.values, sound.values, atol=1e-6)
    assert bool(spoiled.notes) == (how != "faces apart")


def soup_of_ball():
    """Faces of a ball, each shrunk to leave gaps, turned at random; and a flag far from it."""
    rng = np.random.default_rng(5)
    triangles = np.asarray(BALL.triangles)
    middles = triangles.mean(axis=1, keepdims=True)
    triangles = middles + rng.uniform(0.94, 1.0, (len(triangles), 1, 1)) * (triangles - middles)
    triangles += rng.normal(scale=1e-3, size=(len(triangles), 1, 3))
    flip = rng.random(len(triangles)) < 0.5
    triangles[flip] = triangles[flip][:, ::-1]
    flag = np.array([[[2.0, 0, 0], [3.0, 0, 0], [2.0, 1.0, 0]]])
    triangles = np.concatenate([triangles, flag])
    return triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)


@pytest.mark.parametrize("max_dense_points", [10**7, 10**3])
def test_a_soup_around_a_ball_is_solid_and_a_flag_beside_it_a_sheet(max_dense_points):
    policy = GridPolicy(max_dense_points=max_dense_points)
    grid = grid_of_triangles(*soup_of_ball(), voxel=0.05, policy=policy)
    assert (grid.table is None) == (max_dense_points > 10**6)
    assert any("by the winding number" in n for n in grid.notes)
    p = np.random.default_rng(1).uniform(-1.3, 1.3, (2000, 3))
    depth = 1.0 - np.linalg.norm(p, axis=1)
    p, depth = p[np.abs(depth) > 0.06], depth[np.abs(depth) > 0.06]
    field = voxel_field(grid)
    assert (np.sign(field.distance(p)) == -np.sign(depth)).all()
    assert field.distance([2.3, 0.3, 0.4]) == pytest.approx(0.3, abs=0.01)
    assert field.distance([2.3, 0.3, -0.4]) == pytest.approx(0.3, abs=0.01)


def test_faces_that_enclose_nothing_together_are_sheets():
    rng = np.random.default_rng(2)
    triangles = rng.normal(size=(100, 3, 3))
    faces = np.arange(300).reshape(-1, 3)
    assert not len(body_of_mesh(triangles.reshape(-1, 3), faces).loose)
    assert not len(body_of_mesh(*soup_of_ball(), surface="sheet").loose)


def test_a_hollow_half_ball_is_a_sheet_unless_the_scene_says_solid():
    half = BALL.faces[BALL.triangles_center[:, 2] < 0.0]
    assert not len(body_of_mesh(BALL.vertices, half).solid)
    body = body_of_mesh(BALL.vertices, half, surface="solid")
    assert not len(body.sheet)
    volume = np.linalg.det(body.vertices[body.solid]).sum() / 6.0
    assert volume == pytest.approx(2.0 / 3.0 * np.pi, rel=0.05)


@pytest.mark.parametrize(
    ("size", "message"), [(1000.0, "in millimetres"), (0.01, "not in metres"), (1.0, None)]
)
def test_a_mesh_in_another_unit_is_named(tmp_path, size, message):
    notes = scene_of_file(tmp_path, BALL.copy().apply_scale(size)).reading_notes()
    assert [message] == [message for n in notes if message in n] if message else notes == []


def test_plates_thinner_than_a_voxel_stay_solid_wherever_they_are():
    plate = trimesh.creation.box((1.0, 1.0, 0.01))
    for degrees in (0.0, 20.0, 45.0):
        turn = trimesh.transformations.rotation_matrix(np.radians(degrees), [1, 2, 3])
        turned = plate.copy().apply_transform(turn)
        grid = grid_of_triangles(turned.vertices, turned.faces, voxel=0.05)
        assert any("thinner than a voxel" in n for n in grid.notes)
        up = turn[:3, 2]
        near = voxel_field(grid).distance([0.3 * up, -0.3 * up])
        assert near == pytest.approx(0.195, abs=0.01)
        assert not voxel_field(grid).line_of_sight(up, -up)
    thick = grid_of_triangles(plate.vertices, plate.faces, voxel=0.05, thickness=0.4)
    assert voxel_field(thick).distance([0, 0, 0.35]) == pytest.approx(0.145, abs=0.01)
    with pytest.raises(InputError, match="thickness"):
        grid_of_triangles(plate.vertices, plate.faces, voxel=0.05, thickness=0.1)


def scene_of_file(tmp_path, mesh, **more):
    mesh.export(tmp_path / "mesh.stl")
    return Scene.model_validate({"mesh": {"file": str(tmp_path / "mesh.stl"), **more}})


def test_a_stated_thickness_chooses_the_voxels(tmp_path):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    field = scene_of_file(tmp_path, sheet, thickness=0.06).field()
    assert field.voxel == pytest.approx(0.015)
    assert field.distance([0.5, 0.4, 0.2]) == pytest.approx(0.17, abs=1e-3)


SHEET = trimesh.Trimesh(BALL.vertices, BALL.faces[BALL.triangles_center[:, 2] < 0.0])
"""Lower half of a ball, 2 m across."""


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"thickness": 50}, "mesh.thickness: 50 is more than the mesh is across, 2; expected at"),
        ({"thickness": 1e-5}, "mesh.thickness: 1e-05 needs voxels of 2.5e-06"),
        ({"thickness": 0.1, "voxel": 0.05}, "mesh.thickness: 0.1 is less than 4 voxels of 0.05"),
        ({"voxel": 5}, "mesh.voxel: 5 is larger than the mesh, 2 across; expected at most 0.5"),
        ({"voxel": 0.7}, "mesh.voxel: 0.7 makes sheets and thin parts 2.8 thick"),
        ({"scale": 1e-4}, "mesh.scale: 0.0001 makes the mesh 0.0002 m across; expected 0.01 to"),
        ({"scale": 1e4}, "mesh.scale: 10000 makes the mesh 2e+04 m across; expected 0.01 to 5000"),
    ],
)
def test_sizes_that_make_no_sense_are_refused_by_name(tmp_path, more, message):
    scene = scene_of_file(tmp_path, SHEET, **more)
    with pytest.raises(InputError, match=re.escape(message)):
        scene.field()


def test_the_greatest_voxel_that_an_error_names_is_taken(tmp_path):
    scene = scene_of_file(tmp_path, SHEET, voxel=5)
    with pytest.raises(InputError) as error:
        scene.field()
    better = float(str(error.value).split("at most ")[-1])
    assert scene_of_file(tmp_path, SHEET, voxel=better).field().distance([0, 0, -1]) < 0


def test_a_mesh_in_millimetres_is_told_the_scale(tmp_path):
    scene = scene_of_file(tmp_path, SHEET.copy().apply_scale(8000.0))
    with pytest.raises(InputError, match=r'a file in millimetres needs "scale": 0\.001'):
        scene.reading_notes()


@pytest.mark.parametrize("size", [0.21, 2.0, 20.0, 199.0])
def test_millimetres_taken_for_metres_are_noted_at_each_size_of_a_structure(tmp_path, size):
    """A mesh of a size without a note in metres has one, or is refused, in millimetres."""
    path = tmp_path / "part.stl"
    trimesh.creation.box((1000.0 * size, 500.0 * size, 500.0 * size)).export(path)
    hint = "in millimetres"
    try:
        notes = Scene.model_validate({"mesh": {"file": str(path)}}).reading_notes()
    except InputError as error:
        notes = [str(error)]
    assert any(hint in n and '"scale": 0.001' in n for n in notes)
    scaled = Scene.model_validate({"mesh": {"file": str(path), "scale": 0.001}})
    assert scaled.reading_notes() == []


def seen_from_six_sides(scene, clearance=0.3):
    field = scene.field()
    camera = Camera(range=6.0, field_of_view=120.0, patch=0.15)
    patches = surface_patches(scene, field, 0.15, np.full((1, 3), 4.0), clearance=clearance)
    coverage = Coverage(patches, field, camera)
    for axis in range(3):
        for side in (-3.0, 3.0):
            eye = side * np.eye(3)[axis]
            coverage.look(eye, np.arctan2(-eye[1], -eye[0]))
    return float(patches.areas.sum()), coverage.share


def test_only_the_outside_of_a_scan_with_holes_counts(tmp_path):
    faces, _ = ball_with_holes(np.random.default_rng(1), 3)
    scan = trimesh.Trimesh(BALL.vertices, faces)
    area, share = seen_from_six_sides(scene_of_file(tmp_path, scan, voxel=0.05))
    assert area == pytest.approx(scan.area, rel=0.02)
    assert share > 0.97


def test_both_sides_of_a_sheet_count_and_neither_side_of_a_slit(tmp_path):
    sheet = trimesh.Trimesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]],
                            [[0, 1, 2], [0, 2, 3]])  # fmt: skip
    area, share = seen_from_six_sides(scene_of_file(tmp_path, sheet, voxel=0.03))
    assert area == pytest.approx(8.0, rel=0.02)
    assert share > 0.97
    # of the sides of a slit, 8 square metres, only the rims can be faced, at up to 75 degrees
    blocks = [trimesh.creation.box((1, 2, 2)).apply_translation((x, 0, 0)) for x in (-0.53, 0.53)]
    pair = trimesh.util.concatenate(blocks)
    area, _ = seen_from_six_sides(scene_of_file(tmp_path, pair, voxel=0.03))
    rim = 4.0 - (2.0 - 2.0 * 0.06 * np.tan(np.radians(75.0))) ** 2
    assert 23.5 < area < 24.0 + 2.0 * rim + 0.5


def scene_of_squares(folder, squares, **more):
    """Scene of a mesh of parallelograms, each by a corner and two sides, as sheets."""
    corners = [(a, np.add(a, u), np.add(np.add(a, u), v), np.add(a, v)) for a, u, v in squares]
    faces = [[4 * k + i for i in corner] for k in range(len(squares)) for corner in HALVES]
    mesh = trimesh.Trimesh(np.array(corners).reshape(-1, 3), faces, process=False)
    return scene_of_file(folder, mesh, surface="sheet", **more)


HALVES = ([0, 1, 2], [0, 2, 3])
"""Corners of the two triangles of a parallelogram."""


def share_seen_from(scene, eyes):
    """Area of the patches of a scene, and the share that a camera sees that looks at the origin."""
    field, camera = scene.field(), Camera(range=9.0, field_of_view=120.0, patch=0.15)
    patches = surface_patches(scene, field, 0.15, np.array(eyes), clearance=0.1)
    coverage = Coverage(patches, field, camera)
    for eye in np.array(eyes):
        coverage.look(eye, np.arctan2(-eye[1], -eye[0]))
    return float(patches.areas.sum()), coverage.share


def test_a_sheet_is_seen_up_to_its_seam_with_another(tmp_path):
    """Between sheets that are 45 degrees apart and 0.2 m thick because of the voxels, the field is
    solid for a quarter of their length."""
    c, h = np.cos(np.pi / 8), np.sin(np.pi / 8)
    squares = [((0, -0.5, 0), (c, 0, s * h), (0, 1, 0)) for s in (-1, 1)]
    scene = scene_of_squares(tmp_path, squares, voxel=0.05)
    assert scene.field().distance([0.2, 0, 0]) < 0
    area, share = share_seen_from(scene, [(5.0, 0.0, 0.0), (-5.0, 0.0, 0.0)])
    assert area == pytest.approx(4.0, rel=0.02)
    assert share > 0.99


def test_what_is_seen_between_narrow_slats_counts_by_its_area(tmp_path):
    """Slats narrower than a patch hide 0.6 of one side of a plate; the backs of the slats, which
    cannot be faced, do not count."""
    slats = [((x, -0.5, 0.01), (0.03, 0, 0), (0, 1, 0)) for x in np.arange(20) * 0.05 - 0.49]
    plate = ((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))
    scene = scene_of_squares(tmp_path, [plate, *slats], voxel=0.02)
    _, share = share_seen_from(scene, [(0.3, 0.0, 4.0), (-0.3, 0.0, -4.0)])
    assert share == pytest.approx(2.0 / 2.6, abs=0.03)


def test_a_place_is_hidden_if_a_ray_to_it_ends_early():
    rng = np.random.default_rng(3)
    tree = FaceTree.build(rng.normal(size=(40, 3, 3)))
    eye, places = rng.normal(size=3) * 3.0, rng.normal(size=(500, 3)) * 2.0
    lengths = tree.ray_lengths(np.broadcast_to(eye, places.shape), places - eye)
    assert (tree.blocks(eye, places) == (lengths < 1.0)).all()
    assert 50 < tree.blocks(eye, places).sum() < 450


@pytest.mark.parametrize(("degrees", "voxel", "is_noted"), [(15, 0.02, True), (90, 0.005, False)])
def test_sheets_that_hide_one_another_are_noted(degrees, voxel, is_noted):
    """Two squares that share an edge hide one another near it, over a length of their thickness
    times the cotangent of half the angle."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    vertices = np.array([[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0], [c, 1, s], [c, 0, s]])
    grid = grid_of_triangles(vertices, [[0, 1, 2], [0, 2, 3], [0, 1, 4], [0, 4, 5]], voxel=voxel)
    noted = [n for n in grid.notes if "within the thickness of others" in n]
    assert bool(noted) == is_noted
    if noted:
        expected = 0.5 * 4 * voxel / np.tan(np.radians(0.5 * degrees))
        assert float(noted[0].split(" %")[0]) / 100 == pytest.approx(expected / 2, rel=0.5)


def test_scenes_name_the_defects_of_a_mesh(tmp_path):
    faces, _ = ball_with_holes(np.random.default_rng(1), 2)
    scene = scene_of_file(tmp_path, trimesh.Trimesh(BALL.vertices, faces))
    assert any("2 holes closed" in n for n in scene.reading_notes())
    data = {"schema_version": 1, "mesh": {"file": "scan.stl", "surface": "solids"}}
    with pytest.raises(InputError, match="surface"):
        Scene.from_json(json.dumps(data))
