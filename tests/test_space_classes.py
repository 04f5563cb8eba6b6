"""Bounds on tours by how they wind around bars: no tour is shorter than they say."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.plan.space.class_bound import add_windings, packed_windings
from netsp.plan.space.core_detours import DetourEffort, detour_lengths
from netsp.plan.space.mission_policy import ClassPolicy, PotentialPolicy, StatePolicy
from netsp.plan.space.path_bound import bound_all_tours
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.reduced_leg_costs import reduced_leg_costs
from netsp.plan.space.solid_cores import closest_points, solid_cores
from netsp.plan.space.space_legs import RobotPaths
from netsp.plan.space.winding_numbers import Crossings, Loops, costliest_loop, piercings
from netsp.plan.space.wound_loops import WoundLoops
from netsp.world import Scene
from netsp.world.mission.mission import Mission

DIP = 0.015
CORNERS = [(-2.0, 0.0, -2.0), (2.0, 0.5, -2.0), (2.0, -0.5, 2.0), (-2.0, 0.0, 2.0)]
RING = {"center": [0, 0, 0], "axis": [0, 1, 0], "major_radius": 2.0, "minor_radius": 0.2}


def capsule(a, b, radius=0.15):
    return {"capsule": {"a": list(a), "b": list(b), "radius": radius}}


def window(extra=()):
    """Four bars about a window, with a fifth one across it, and other solids."""
    sides = [capsule(a, b) for a, b in zip(CORNERS, CORNERS[1:] + CORNERS[:1], strict=True)]
    return Scene(solids=[*sides, capsule(CORNERS[0], CORNERS[2]), *extra])


def linking_number(one, other):
    """Gauss's integral over two closed polygons, exact for each pair of edges."""
    total = 0.0
    for a, b in zip(one, np.roll(one, -1, axis=0), strict=True):
        for c, d in zip(other, np.roll(other, -1, axis=0), strict=True):
            corners = [c - a, d - a, d - b, c - b]
            normals = [
                np.cross(p, q) for p, q in zip(corners, corners[1:] + corners[:1], strict=True)
            ]
            normals = [n / np.linalg.norm(n) for n in normals]
            turns = zip(normals, normals[1:] + normals[:1], strict=True)
            angle = sum(math.asin(max(-1.0, min(1.0, float(p @ q)))) for p, q in turns)
            total += math.copysign(angle, float(np.cross(d - c, b - a) @ (c - a)))
    return round(total / (4.0 * math.pi), 6)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_crossings_of_a_closed_path_are_its_linking_numbers(seed):
    loops = Loops.of_cores(solid_cores(window().field(), DIP).loops())
    path = np.random.default_rng(seed).uniform(-4.0, 4.0, (5, 3))
    pairs = np.column_stack([np.arange(5), np.roll(np.arange(5), -1)])
    crossings = Crossings(loops, path, pairs, ClassPolicy())
    assert len(crossings.used) == 2
    for loop, total in zip(crossings.used, crossings.counts.sum(0), strict=True):
        begins, ends = loops.polygon(loop)
        after = {tuple(a): b for a, b in zip(begins, ends, strict=True)}
        polygon = [begins[0]]
        while len(polygon) < len(begins):
            polygon.append(after[tuple(polygon[-1])])
        assert total == linking_number(path, np.array(polygon))


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_the_costliest_loop_is_one_that_the_path_winds_around(seed):
    cores = solid_cores(window().field(), DIP).loops()
    loops, rng = Loops.of_cores(cores), np.random.default_rng(seed)
    path = rng.uniform(-4.0, 4.0, (5, 3))
    pairs = np.column_stack([np.arange(5), np.roll(np.arange(5), -1)])
    pierced = piercings(cores, path, pairs, ClassPolicy()).sum(0)
    counts = Crossings(loops, path, pairs, ClassPolicy()).counts.sum(0)
    assert (pierced @ loops.incidence == counts).all()
    costs = rng.uniform(0.0, 1.0, len(cores.edges))
    found = costliest_loop(cores, pierced, costs)
    # the window has three loops: its halves and its rim
    every = [loops.incidence @ np.array(c) for c in ((1, 0), (0, 1), (1, 1), (1, -1))]
    rims = [costs[loop != 0].min() for loop in every if abs(loop).max() == 1 and pierced @ loop]
    if found is None:
        assert (counts == 0).all()
    else:
        assert pierced @ found[0] != 0
        assert found[1] == max(rims) == costs[found[0] != 0].min()


def test_bars_rings_and_the_floor_that_they_stand_on_have_cores_in_depth():
    feet = [capsule((x, 5.0, -6.0), (x, 5.0, 0.0), 0.2) for x in (-1.0, 1.0)]
    beam = {"cylinder": {"a": [-1.5, 5.0, 0.0], "b": [1.5, 5.0, 0.0], "radius": 0.2}}
    floor = {"half_space": {"point": [0, 0, -5], "normal": [0, 0, 1]}}
    field = window([{"torus": {**RING, "center": [0, 3, 0]}}, *feet, beam, floor]).field()
    cores = solid_cores(field, DIP).loops()
    # two halves of the window, the ring, and the opening below the beam
    assert Loops.of_cores(cores).incidence.shape[1] == 4
    t = np.linspace(0.0, 1.0, 9)[:, None]
    for (a, b), depth in zip(cores.points[cores.edges], cores.depth, strict=True):
        assert depth > DIP
        assert (field.distance(a + t * (b - a)) <= -depth + 1e-9).all()


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_closest_points_of_segments_are_closest(seed):
    a, b, c, d = np.random.default_rng(seed).normal(size=(4, 1, 3))
    p, q, gap = closest_points(a, b, c, d)
    at = np.linspace(0.0, 1.0, 41)[:, None]
    every = np.linalg.norm((a + at * (b - a))[:, None] - (c + at * (d - c))[None], axis=2)
    assert gap[0] <= every.min() + 1e-12
    assert gap[0] == pytest.approx(np.linalg.norm(a + p * (b - a) - c - q * (d - c)))


@given(
    x=st.floats(0.1, 3.9), height=st.floats(0.05, 2.0), away=st.floats(0.0, 0.6),
    lean=st.floats(-0.5, 0.5),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_the_bound_over_a_bar_across_is_the_path_at_its_distance(x, height, away, lean):
    a, b = np.zeros(3), np.array([4.0, 0.0, 0.0])
    begin, end = np.array([[x, height, -5.0]]), np.array([[x, height, 5.0]])
    tilt = np.array([[0.0, lean, 0.0]])
    bound = detour_lengths(a, b, begin, end, np.array([away]), DetourEffort(20.0, 1e-3, 20_000))[0]
    exact = math.hypot(x, height + away) + math.hypot(4.0 - x, height + away)
    assert exact - 1e-3 - 1e-9 <= bound <= exact + 1e-9
    lower = detour_lengths(
        a, b, begin - tilt, end + tilt, np.array([away]), DetourEffort(20.0, 1e-3, 20_000)
    )[0]
    assert 4.0 <= lower <= exact + 1e-9


@given(st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_no_path_that_winds_otherwise_is_shorter_than_its_bound(seed):
    rng = np.random.default_rng(seed)
    cores = solid_cores(window().field(), DIP).loops()
    loops = Loops.of_cores(cores)
    path = np.vstack(
        [rng.uniform(-3, 3, (1, 3)), rng.uniform(-4, 4, (2, 3)), rng.uniform(-3, 3, (1, 3))]
    )
    pairs = np.array([[0, 1], [1, 2], [2, 3], [0, 3]])
    counts = Crossings(loops, path, pairs, ClassPolicy()).counts
    if (counts[:3].sum(0) == counts[3]).all():
        return
    ends = cores.points[cores.edges]
    a, b = path[:-1].repeat(len(ends), axis=0), path[1:].repeat(len(ends), axis=0)
    gaps = closest_points(a, b, np.tile(ends[:, 0], (3, 1)), np.tile(ends[:, 1], (3, 1)))[2]
    away = gaps.reshape(3, -1).min(0)
    bounds = detour_lengths(
        path[0], path[3], ends[:, 0], ends[:, 1], away, DetourEffort(99.0, 1e-3, 20_000)
    )
    assert bounds.min() <= np.linalg.norm(np.diff(path, axis=0), axis=1).sum() + 1e-9


@given(st.lists(st.integers(-4, 4), min_size=1, max_size=20), st.integers(0, 100))
def test_packed_windings_add_modulo_three(numbers, seed):
    others = np.random.default_rng(seed).integers(-4, 5, len(numbers)).tolist()
    sums = [a + b for a, b in zip(numbers, others, strict=True)]
    added = add_windings(packed_windings(numbers), packed_windings(others), len(numbers))
    assert added == packed_windings(sums)


@given(st.integers(3, 9), st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_a_tour_is_longer_than_the_bound_by_its_reduced_costs(n, seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 10.0, (n, 3))
    costs = np.linalg.norm(points[:, None] - points[None], axis=2)
    bound, legs = reduced_leg_costs(costs, Clock())
    tour = rng.permutation(n)
    after = np.roll(tour, -1)
    assert costs[tour, after].sum() >= bound + legs[tour, after].sum() - 1e-6
    assert bound >= 0.5 * np.sort(costs, axis=1)[:, 1:3].sum() - 1e-6


def mission_at_a_ring():
    """A waypoint behind a ring that is seen through it, and one above, outside of it."""
    scene = Scene(bounds=[-6, -6, -6, 6, 6, 6], solids=[{"torus": RING}])
    mission = Mission(
        scene="-", anchor=(0, -3, 0), start=(0, -3, 0), waypoints=[(0, 1.0, 1.0), (0, 0.5, 3.0)],
        tether_length=15.0, clearance=0.2, cell=0.5,
    )  # fmt: skip
    context = PlanningContext.for_mission(mission, scene, scene.field())
    places = Places.for_mission(mission, context.field)
    return mission, RobotPaths(context, places, StatePolicy().effort(2))


def test_a_tour_may_not_thread_a_ring():
    mission, paths = mission_at_a_ring()
    points = np.array([mission.start, *(w.position for w in mission.waypoints)])
    triangle = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum()
    potential = PotentialPolicy(min_cells=2_000, max_cells=8_000)
    bound = bound_all_tours(paths, [0, 1], Clock(), potential=potential)
    # the shortest way is through the ring to the first, round its tube to the second, and back
    # above, if one of the three legs goes round the tube on its other side
    tube, legs = np.array([0.0, 0.0, 2.0]), [(0, 1), (1, 2), (2, 0)]
    detours = []
    for u, v in legs:
        a, b = points[u], points[v]
        grid = np.linspace(-math.pi, math.pi, 721)
        circle = tube + 0.4 * np.column_stack([0 * grid, np.cos(grid), np.sin(grid)])
        lengths = np.linalg.norm(circle - a, axis=1) + np.linalg.norm(circle - b, axis=1)
        detours.append(lengths.max() - np.linalg.norm(a - b))
    assert bound is not None
    assert triangle + 0.3 < bound <= triangle + min(detours)


def test_a_tether_that_winds_is_out_of_reach_if_it_would_be_too_long():
    _, paths = mission_at_a_ring()
    points = np.array([(0, -3, 0), (0, 1.0, 1.0), (0, 0.5, 3.0)], dtype=float)
    loops = WoundLoops.of_mission(paths.context, points, ClassPolicy())
    assert loops is not None
    loops.loops.append(Loops.of_cores(loops.cores).incidence[:, 0])
    costs = np.linalg.norm(points[:, None] - points[None], axis=2)
    legs = loops.graph(costs, np.zeros((3, 3)), Clock()).legs
    straight = float(np.linalg.norm(points[1] - points[0]))
    bounds, others = legs.other_windings(0, 1, straight, -DIP, 9.0, 27)
    # over the tube, whose core is two metres above the middle
    over = math.hypot(3.0, 2.0) + math.hypot(1.0, 1.0)
    assert set(bounds) == {0, 1, 2}
    assert others == 9.0
    assert over <= min(bounds[1].length, bounds[2].length) <= over + 0.3


@pytest.mark.parametrize("name", ["max_raise_ratio", "tolerance"])
def test_sizes_that_must_be_positive_are_checked(name):
    with pytest.raises(InputError, match=f"{name}: 0.0; expected more than 0"):
        ClassPolicy(**{name: 0.0})
