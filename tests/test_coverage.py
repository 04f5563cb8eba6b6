"""What a camera sees: within range, in view, facing it, and with nothing in between."""

import math

import numpy as np
import pytest

from netsp import InputError
from netsp.world import Scene
from netsp.world.mission.equipment import Camera
from netsp.world.simulator.coverage import Coverage, divided_triangles, surface_patches

BALL = {"name": "ball", "sphere": {"center": [0, 0, 0], "radius": 1.0}}
PLACES = np.array([[-5.0, -5, -5], [5, 5, 5]])


def cover(solids, camera, **how):
    scene = Scene(solids=solids)
    field = scene.field()
    return Coverage(surface_patches(scene, field, camera.patch, PLACES, **how), field, camera)


@pytest.mark.parametrize("distance", [2.0, 3.0, 5.0])
def test_a_ball_shows_the_cap_that_faces_the_eye(distance):
    """Seen from d away, a unit ball shows (1 - 1/d) / 2 of its surface."""
    seen = cover([BALL], Camera(range=10.0, field_of_view=150.0))
    seen.look(np.array([distance, 0, 0]), math.pi)
    assert seen.share == pytest.approx(0.5 * (1 - 1 / distance), abs=0.03)
    assert seen.share_through == pytest.approx(seen.share, abs=0.02)


def test_what_is_behind_something_is_seen_only_if_nothing_stood_in_between():
    wall = {"name": "wall", "box": {"center": [2, 0, 0], "size": [0.2, 4, 4]}}
    seen = cover([BALL, wall], Camera(range=10.0, field_of_view=150.0), inspect=("ball",))
    seen.look(np.array([4.0, 0, 0]), math.pi)
    assert seen.share == 0.0
    assert seen.share_through > 0.3


def test_looking_away_shows_nothing_and_neither_does_too_great_a_distance():
    seen = cover([BALL], Camera(range=2.0))
    seen.look(np.array([2.5, 0, 0]), 0.0)
    assert seen.share_through == 0.0
    seen.look(np.array([3.5, 0, 0]), math.pi)
    assert seen.share_through == 0.0
    seen.look(np.array([2.5, 0, 0]), math.pi)
    assert seen.share_through > 0.0


def test_going_round_shows_all_and_shares_are_what_is_marked():
    seen = cover([BALL], Camera(range=4.0, field_of_view=120.0))
    for a in np.linspace(0, 2 * np.pi, 12):
        for z in (-2.0, 0.0, 2.0):
            eye = np.array([2 * math.cos(a), 2 * math.sin(a), z])
            seen.look(eye, seen.heading(eye, 0.0))
    assert seen.share > 0.99
    areas = seen.patches.areas
    assert seen.share == pytest.approx(areas[seen.seen].sum() / areas.sum())
    assert (seen.seen <= seen.seen_through).all()


def test_what_lies_inside_another_solid_need_not_be_seen():
    two = [BALL, {"sphere": {"center": [1, 0, 0], "radius": 1.0}}]
    seen = cover(two, Camera(patch=0.05))
    # two unit balls one apart: each loses a cap of height 1/2
    assert seen.patches.areas.sum() == pytest.approx(2 * (4 * math.pi - math.pi), rel=0.05)
    assert (seen.field.distance(seen.patches.centres + 0.02 * seen.patches.normals) > 0).all()


def test_dividing_keeps_the_area_and_bounds_the_sides():
    triangles = np.random.default_rng(0).normal(size=(20, 3, 3))
    small = divided_triangles(triangles, 0.3, 200_000)

    def area(t):
        return 0.5 * np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum()

    assert area(small) == pytest.approx(area(triangles))
    assert np.linalg.norm(small - np.roll(small, -1, axis=1), axis=2).max() <= 0.3


def test_names_of_nothing_are_refused():
    unnamed, keel = {"sphere": BALL["sphere"]}, {**BALL, "name": "keel"}
    expected = "inspect: expected names of solids, got 'hull'; there are none with a name"
    with pytest.raises(InputError, match=expected):
        cover([unnamed], Camera(), inspect=("hull",))
    with pytest.raises(InputError, match=r"got 'hull'; there are 'ball', 'keel'$"):
        cover([BALL, unnamed, keel], Camera(), inspect=("hull",))


def test_a_sheet_is_seen_from_either_side_and_its_patches_lie_on_it(tmp_path):
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, 50), np.linspace(-1, 1, 50)))
    np.savez(tmp_path / "sheet.npz", points=np.column_stack([u, 0 * u, v]))
    scene = Scene(cloud={"file": str(tmp_path / "sheet.npz"), "voxel": 0.05})
    field = scene.field()
    patches = surface_patches(scene, field, 0.3, np.array([[0.0, -2.0, 0.0]]))
    inner = np.abs(patches.centres[:, [0, 2]]).max(axis=1) < 0.8
    assert np.abs(np.abs(patches.centres[inner, 1]) - 0.1).max() < 0.01
    assert patches.areas.sum() == pytest.approx(2500, rel=0.01)
    camera = Camera(range=4.0, field_of_view=120.0)
    for y, yaw in ((-2.0, math.pi / 2), (2.0, -math.pi / 2)):
        coverage = Coverage(patches, field, camera)
        coverage.look(np.array([0.0, y, 0.0]), yaw)
        assert coverage.share > 0.9
        assert coverage.share <= coverage.share_through <= 1.0 + 1e-9
