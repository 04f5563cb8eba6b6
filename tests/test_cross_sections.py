"""Cross-sections of upright solids: certain at every height of a range, and only of solids that
stand through it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.clock import Clock
from netsp.model.problem import Circle
from netsp.plan.space.cross_sections import Depths, cross_sections
from netsp.plan.space.places import Places
from netsp.plan.space.space_plan import prepare_context
from netsp.plan.space.upright import bound_by_upright_solids, upright_obstacles
from netsp.world import Scene
from netsp.world.mission.mission import Mission

DIP = 0.02
ANCHOR = np.array([4.0, 0.0, -1.0])
DEPTHS = Depths(-3.0, 0.0, ANCHOR, 12.0)


def leaning(kind: str, lean: float, turn: float, size: tuple[float, float]) -> dict:
    """A solid of a kind through the depths from -4 to 1, with a leaning axis."""
    foot, top = [-2.5 * lean, 0.0, -4.0], [2.5 * lean, 0.0, 1.0]
    angle = math.degrees(math.atan(lean))
    return {
        "post": {"center": [0, 0], "radius": size[0]},
        "prism": {"polygon": [[0, 0], [size[0], 0.1], [0.2, size[1]]], "grow": 0.05},
        "cylinder": {"a": foot, "b": top, "radius": size[0]},
        "capsule": {"a": top, "b": foot, "radius": size[0]},
        "box": {"center": [0, 0, -1.5], "size": [*size, 5.0], "rotation": [0, angle, turn]},
        "half_space": {"point": [-1, 0, 0], "normal": [math.cos(turn), math.sin(turn), lean]},
    }[kind]


def corners_of(obstacle) -> np.ndarray:
    if isinstance(obstacle, Circle):
        t = np.linspace(0.0, 2.0 * math.pi, 24)
        return obstacle.center + obstacle.radius * np.c_[np.cos(t), np.sin(t)]
    return np.array(obstacle.polygon)


@settings(max_examples=60, deadline=None)
@given(
    kind=st.sampled_from(["post", "prism", "cylinder", "capsule", "box", "half_space"]),
    lean=st.sampled_from([0.0, 1e-4, 9e-4]), turn=st.floats(0.0, 90.0),
    size=st.tuples(st.floats(0.2, 1.5), st.floats(0.2, 1.5)),
    radius=st.sampled_from([0.0, 0.03]),
)  # fmt: skip
def test_a_cross_section_is_deeper_in_its_solid_than_paths_and_tethers_dip_at_all_heights(
    kind, lean, turn, size, radius
):
    scene = Scene(solids=[{kind: leaning(kind, lean, turn, size)}], tether_radius=radius)
    field = scene.field()
    (obstacle,), all_upright = cross_sections(field, DEPTHS, DIP)
    assert all_upright
    flat = corners_of(obstacle)
    middle = flat.mean(axis=0)
    for share in (1.0, 0.5):
        for z in np.linspace(DEPTHS.low, DEPTHS.high, 5):
            points = np.column_stack([middle + share * (flat - middle), np.full(len(flat), z)])
            assert field.distance(points).max() <= -DIP * (1.0 - 1e-9)


@pytest.mark.parametrize(
    ("kind", "solid"),
    [
        ("cylinder", {"a": [0, 0, -4], "b": [0, 0, 0], "radius": 0.5}),  # flush with the surface
        ("cylinder", {"a": [0, 0, -2.9], "b": [0, 0, 1], "radius": 0.5}),  # above the floor
        ("box", {"center": [0, 0, -2], "size": [1, 1, 3.9]}),
        ("box", {"center": [0, 0, -1.5], "size": [1, 1, 5], "rotation": [0, 2, 0]}),  # leaning
        ("capsule", {"a": [0, 0, -2.5], "b": [0, 0, -0.5], "radius": 0.5}),  # its caps end there
        ("torus", {"center": [0, 0, -1], "major_radius": 1, "minor_radius": 0.2}),
    ],
)
def test_a_solid_that_a_tether_may_pass_over_or_under_has_no_cross_section(kind, solid):
    obstacles, all_upright = cross_sections(Scene(solids=[{kind: solid}]).field(), DEPTHS, DIP)
    assert obstacles == []
    assert not all_upright
    # and far off it does not matter
    far = Depths(-3.0, 0.0, np.array([40.0, 0.0, -1.0]), 12.0)
    assert cross_sections(Scene(solids=[{kind: solid}]).field(), far, DIP) == ([], True)


@settings(max_examples=60, deadline=None)
@given(
    foot=st.floats(-4.0, -2.2), top=st.floats(-0.8, 1.0), radius=st.floats(0.1, 1.5),
    lean=st.sampled_from([0.0, 9e-4]),
)  # fmt: skip
def test_a_capsule_whose_caps_reach_beyond_the_range_stands_through_it(foot, top, radius, lean):
    capsule = {"a": [0, 0, foot], "b": [lean * (top - foot), 0, top], "radius": radius}
    field = Scene(solids=[{"capsule": capsule}]).field()
    obstacles, all_upright = cross_sections(field, DEPTHS, DIP)
    beyond = max(foot - DEPTHS.low, DEPTHS.high - top, 0.0)
    assert all_upright == bool(obstacles) or radius <= 0.05
    if beyond + 0.01 < radius - DIP:
        assert all_upright
    if beyond > radius - DIP:
        assert not obstacles
    for obstacle in obstacles:
        flat = corners_of(obstacle)
        for z in np.linspace(DEPTHS.low, DEPTHS.high, 7):
            points = np.column_stack([flat, np.full(len(flat), z)])
            assert field.distance(points).max() <= -DIP * (1.0 - 1e-9)


BOX = {"box": {"center": [0, 0, 0], "size": [1.0, 6.0, 4.0]}}
LOW = {"box": {"center": [-3, 2, -1], "size": [0.5, 0.5, 1.0]}}
BOUNDS = [-5, -5, -1.5, 5, 5, 1.5]


def water(*solids, bounds=BOUNDS, **more):
    mission = Mission.model_validate({
        "scene": "-", "anchor": (-3, 0, 0), "start": (-3, 0, 0), "clearance": 0.1, "cell": 0.5,
        "waypoints": [(3, 0, 0), (0, 4, 0)], "tether_length": 9.0, **more,
    })  # fmt: skip
    return prepare_context(mission, Clock(), scene=Scene(bounds=bounds, solids=list(solids)))


def bound(made) -> float | None:
    places = Places.for_mission(made.mission, made.field)
    return bound_by_upright_solids(made.mission, made, [0, 1], places, Clock())


def test_the_tether_is_in_the_bound_of_boxes_as_in_that_of_prisms_through_all_depths():
    corners = [[-0.5, -3], [0.5, -3], [0.5, 3], [-0.5, 3]]
    of_box, of_prism = bound(water(BOX)), bound(water({"prism": {"polygon": corners}}))
    assert of_box == pytest.approx(of_prism, rel=1e-4)
    # round one side of the box and home along the other would wind the tether about it
    longer = 2.0 * (math.hypot(2.5, 3.0) + 1.0 + math.hypot(2.5, 3.0))
    assert longer - 0.2 <= of_box <= longer + 2.0 * 1.5


def test_a_box_counts_beside_solids_that_do_not_stand_upright_only_if_no_tether_reaches_over_it():
    tall = {"box": {"center": [0, 0, 0], "size": [1.0, 6.0, 20.0]}}
    assert len(upright_obstacles(water(BOX), 0.015)) == 1
    assert upright_obstacles(water(BOX, LOW), 0.015) == []
    assert len(upright_obstacles(water(tall, LOW), 0.015)) == 1
    assert upright_obstacles(water(tall, LOW, tether_length=12.0), 0.015) == []
    # and without bounds the cells of the grid go over it
    assert upright_obstacles(water(BOX, bounds=None), 0.015) == []


def test_a_thin_post_with_many_classes_does_not_weaken_the_bound_around_a_wall():
    """The robot's clearance is in the bound only if all classes fit into the list."""
    wall = {"prism": {"polygon": [[-0.5, -3], [0.5, -3], [0.5, 3], [-0.5, 3]]}}
    rope = {"post": {"center": [-2.5, 2.5], "radius": 0.05}}

    def bound_of_few_classes(*solids) -> float:
        made = water(*solids, clearance=0.4)
        few = replace(made.policy, bound=replace(made.policy.bound, max_classes=8))
        return bound(replace(made, policy=few))

    assert bound_of_few_classes(wall, rope) >= bound_of_few_classes(wall) * (1.0 - 1e-6)
    assert bound_of_few_classes(wall) > bound(water(wall, clearance=0.1))
