"""Bounds on tours in space: no tour is shorter than they say."""

import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.base.time_flags import NEVER
from netsp.plan.solve_problem import solve_graph
from netsp.plan.space.mission_policy import EdgePolicy, PotentialPolicy, StatePolicy
from netsp.plan.space.path_bound import LegBounds, bound_all_tours
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext, keeps_clearance
from netsp.plan.space.potential import (
    Ends,
    Region,
    corner_edges,
    fast_march,
    may_have_room,
    path_bound,
    steepest,
)  # fmt: skip
from netsp.plan.space.space_legs import RobotPaths
from netsp.plan.space.upright import bound_by_upright_solids, judged_room
from netsp.world import Scene
from netsp.world.mission.mission import Mission

BOUNDS = [-3, -4, -1.5, 3, 4, 1.5]
EVERYWHERE = np.array([[-math.inf] * 3, [math.inf] * 3])
CELLS = 8_000


def wall(y: float, width: float, *, thick: float = 0.4) -> Scene:
    """A wall with a slot from the floor to the top, and a way round one of its ends."""
    low, high = y - 0.5 * width, y + 0.5 * width
    boxes = [(-4.5, low), (high, 3.0)]
    return Scene(
        bounds=BOUNDS,
        solids=[
            {"box": {"center": [0, 0.5 * (a + b), 0], "size": [thick, b - a, 3.4]}}
            for a, b in boxes
        ],
    )


def through(a, b, y, width, thick, room):
    """The shortest path through the slot of a wall, at a distance from it: in the plane, straight
    from corner to corner."""
    best = math.inf
    low, high = y - 0.5 * width + room, y + 0.5 * width - room
    if low > high:
        return best
    half = 0.5 * thick + room
    for p in np.linspace(low, high, 41):
        for q in np.linspace(low, high, 41):
            flat = (
                math.hypot(a[0] + half, p - a[1]) + math.hypot(2 * half, q - p)
                + math.hypot(b[0] - half, b[1] - q)
            )  # fmt: skip
            best = min(best, math.hypot(flat, b[2] - a[2]))
    return best


def round_the_end(a, b, thick, room):
    """The shortest path round the end of a wall, with square corners at a distance from it."""
    half, y = 0.5 * thick + room, 3.0 + room
    flat = math.hypot(a[0] + half, y - a[1]) + 2 * half + math.hypot(b[0] - half, y - b[1])
    return math.hypot(flat, b[2] - a[2])


@settings(max_examples=12, deadline=None)
@given(
    y=st.floats(-2.0, 1.5), width=st.floats(0.02, 0.6), thick=st.floats(0.2, 0.8),
    room=st.floats(0.0, 0.15), from_y=st.floats(-2.0, 2.0), to_y=st.floats(-2.0, 2.0),
)  # fmt: skip
def test_no_path_through_a_slot_or_round_a_wall_is_shorter_than_its_bound(
    y, width, thick, room, from_y, to_y
):
    a, b = np.array([-2.0, from_y, -0.5]), np.array([2.0, to_y, 0.5])
    field = wall(y, width, thick=thick).field()
    region = Region(room, np.array(BOUNDS, dtype=float).reshape(2, 3), a, math.inf)
    around = round_the_end(a, b, thick, room)
    least = min(around, through(a, b, y, width, thick, room))
    bound = path_bound(field, Ends(a, b, 1.2 * around), region, CELLS)
    assert np.linalg.norm(b - a) <= bound <= least * (1.0 + 1e-9)


@pytest.mark.parametrize("cells", [4_000, 30_000])
def test_the_bound_round_a_wall_is_most_of_the_way(cells):
    a, b = np.array([-2.0, 0.2, -0.5]), np.array([2.0, -0.4, 0.5])
    field = wall(-4.0, 0.0, thick=0.8).field()
    region = Region(0.05, np.array(BOUNDS, dtype=float).reshape(2, 3), a, math.inf)
    around = round_the_end(a, b, 0.8, 0.05)
    bound = path_bound(field, Ends(a, b, 1.1 * around), region, cells)
    assert (0.75 if cells < 10_000 else 0.85) * around <= bound <= around
    assert np.linalg.norm(b - a) < 0.7 * around


def test_the_bound_of_an_arc_over_a_sphere_is_below_its_length():
    field = Scene(solids=[{"sphere": {"center": [0, 0, 0], "radius": 1.0}}]).field()
    a, b = np.array([-1.5, 0.0, 0.0]), np.array([1.5, 0.0, 0.0])
    touching = math.sqrt(1.5**2 - 1.0)
    exact = 2.0 * (touching + (0.5 * math.pi - math.acos(1.0 / 1.5)))
    region = Region(0.0, EVERYWHERE, a, math.inf)
    bound = path_bound(field, Ends(a, b, 1.2 * exact), region, 30_000)
    assert 3.0 <= bound <= exact
    # and no path leads farther from the anchor than the tether reaches
    short = path_bound(field, Ends(a, b, 1.2 * exact), region._replace(reach=1.2), 4_000)
    assert short >= 1.15 * exact


@given(
    x=st.floats(-1.5, 1.5), y=st.floats(-1.5, 1.5), z=st.floats(-1.5, 1.5),
    half=st.floats(0.01, 0.4), room=st.floats(-0.05, 0.3),
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_a_cell_is_left_out_only_where_none_of_its_points_has_room(x, y, z, half, room):
    scene = Scene(solids=[
        {"box": {"center": [0, 0, 0], "size": [1, 0.1, 1]}},
        {"sphere": {"center": [0.4, 0.5, 0], "radius": 0.3}},
    ])  # fmt: skip
    field = scene.field()
    centre, halves = np.array([x, y, z]), np.array([half, half, 0.5 * half])
    if not may_have_room(field.arrays, centre, halves, room, 1.0, 3):
        steps = np.linspace(-1.0, 1.0, 7)
        box = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3) * halves
        assert field.distance(box + centre).max() < room


def test_marching_without_correction_overshoots_and_is_no_bound():
    possible = np.ones((8, 8, 8), dtype=bool)
    start = np.zeros((9, 9, 9), dtype=bool)
    start[0, 0, 0] = True
    slow = np.ones((9, 9, 9), dtype=np.float32)
    u = fast_march(corner_edges(possible), start, 1.0, slow, 100.0, 0.25, NEVER)
    assert u[8, 8, 8] > math.sqrt(3.0) * 8.0
    assert steepest(u, possible, 1.0) > 1.05


def mission_by_a_slot(width: float, tmp_path) -> tuple[Mission, Scene]:
    scene = wall(0.0, width)
    mission = Mission(
        scene="-", anchor=(-2, 0, 0), start=(-2, 0, 0),
        waypoints=[(2, 0.5, 0), (2, -0.5, 0)], tether_length=20.0, clearance=0.1,
    )  # fmt: skip
    return mission, scene


@pytest.mark.parametrize("width", [0.22, 0.3])
def test_no_bound_of_all_tours_is_above_a_tour_through_a_slot_that_the_cells_close(width, tmp_path):
    mission, scene = mission_by_a_slot(width, tmp_path)
    context = PlanningContext.for_mission(mission, scene, scene.field())
    places = Places.for_mission(mission, context.field)
    # what was found goes round the wall, as it does where cells close the slot
    ways = RobotPaths(context, places, StatePolicy().effort(len(places)))
    round_ = np.array([[-2, 0, 0], [-0.3, 3.1, 0], [0.3, 3.1, 0], [2, 0, 0]], dtype=float)
    ways.tethers.update({0: [round_], 1: [round_]})
    bound = bound_all_tours(ways, [0, 1], None, potential=PotentialPolicy(2_000, 16_000))
    legs = [
        through((-2, 0, 0), (2, y, 0), 0.0, width, 0.4, 0.1) for y in (0.5, -0.5)
    ]  # fmt: skip
    assert bound is not None
    assert bound <= sum(legs) + 1.0


def test_a_path_that_was_measured_does_not_raise_the_bound(tmp_path):
    mission, scene = mission_by_a_slot(0.3, tmp_path)
    context = PlanningContext.for_mission(mission, scene, scene.field())
    places = Places.for_mission(mission, context.field)
    ways = RobotPaths(context, places, StatePolicy().effort(len(places)))
    legs = LegBounds(ways, [0, 1], PotentialPolicy(2_000, 16_000))
    straight = np.linalg.norm(legs.points[0] - legs.points[1])
    assert legs.costs[0, 1] == pytest.approx(straight)
    ways.tethers[0] = [np.array([[-2, 0, 0], [0, 3.5, 0], [2, 0.5, 0]], dtype=float)]
    while legs.raise_bound(0, 1, Clock()):
        pass
    assert legs.costs[0, 1] <= through((-2, 0, 0), (2, 0.5, 0), 0.0, 0.3, 0.4, 0.1)


def context_beside(distance: float) -> tuple[PlanningContext, np.ndarray]:
    """Return a context with a bar, a clearance of 0.3 m and a delta of 0.1 m, and a straight path
    that passes the bar at a distance."""
    bar = {"capsule": {"a": [0, 0, -9], "b": [0, 0, 9], "radius": 0.2}}
    scene = Scene(bounds=BOUNDS, solids=[bar])
    path = np.array([[-2.0, 0.2 + distance, 0.0], [2.0, 0.2 + distance, 0.0]])
    mission = Mission(
        scene="-", anchor=tuple(path[0]), start=tuple(path[0]), tether_length=9.0, clearance=0.3,
        delta=0.1,
        waypoints=[{"position": tuple(path[1])}],
    )  # fmt: skip
    return PlanningContext.for_mission(mission, scene, scene.field()), path


def test_the_judge_lets_corners_dip_by_a_quarter_of_delta_and_the_bound_by_hardly_more():
    for distance, is_kept in ((0.276, True), (0.274, False)):
        context, path = context_beside(distance)
        assert keeps_clearance(context.field, path, context.mission) == is_kept
    assert 0.274 <= judged_room(0.3, context) <= 0.275


def test_without_potentials_a_leg_is_exhausted_once_it_is_bounded_around_edges(tmp_path):
    mission, scene = mission_by_a_slot(0.3, tmp_path)
    context = PlanningContext.for_mission(mission, scene, scene.field())
    places = Places.for_mission(mission, context.field)
    robot_paths = RobotPaths(context, places, StatePolicy().effort(len(places)))
    effort = PotentialPolicy(2_000, 16_000)
    edges = EdgePolicy(max_edges=1)  # leaves out all polytopes
    legs = LegBounds(robot_paths, [0, 1], effort, edges=edges, uses_potentials=False)
    while legs.raise_bound(0, 1, Clock()):
        pass
    assert legs.is_exhausted(0, 1)
    legs.uses_potentials = True
    assert not legs.is_exhausted(0, 1)


def test_a_bound_ends_with_its_clock_and_what_is_proven_by_then_is_a_bound():
    a, b = np.array([-2.0, 0.2, -0.5]), np.array([2.0, -0.4, 0.5])
    field = wall(-4.0, 0.0, thick=0.8).field()
    region = Region(0.05, np.array(BOUNDS, dtype=float).reshape(2, 3), a, math.inf)
    around = round_the_end(a, b, 0.8, 0.05)
    begin = time.process_time()
    for seconds in (0.0, 0.05):
        bound = path_bound(field, Ends(a, b, 1.1 * around), region, 2_000_000, clock=Clock(seconds))
        assert np.linalg.norm(b - a) <= bound <= around
    assert time.process_time() - begin < 1.0


def test_the_bound_among_upright_solids_ends_with_the_clock_of_the_run(monkeypatch):
    mission, scene = mission_by_a_slot(0.3, None)
    scene = Scene(bounds=BOUNDS, solids=[{"post": {"center": [0, 0], "radius": 0.5}}])
    context = PlanningContext.for_mission(mission, scene, scene.field())
    places, clock, heard = Places.for_mission(mission, context.field), Clock(), []

    def solve_until_stopped(graph, solver, time_limit):
        clock.end()  # as Ctrl-C and SIGTERM do
        heard.append(time_limit.is_up and bool(time_limit.flag[0]))
        return solve_graph(graph, solver, time_limit=time_limit)

    monkeypatch.setattr("netsp.plan.space.upright.solve_graph", solve_until_stopped)
    bound_by_upright_solids(mission, context, [0, 1], places, clock.part(0.5))
    assert heard == [True]


def test_parameters_out_of_range_are_refused():
    with pytest.raises(InputError, match="max_cells: 10; expected 15000 or more"):
        PotentialPolicy(max_cells=10)
