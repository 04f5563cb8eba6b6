"""Tours in space: judged whatever route made them, never worse than the order of the file."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import netsp.plan.space.mission_flights
import netsp.plan.space.space_legs
import netsp.plan.space.space_plan
from netsp import Problem, solve
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.base.geometry import polylines
from netsp.judge import Check, Verification
from netsp.plan.space.board import StateGraph
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_policy import PlanePolicy, StatePolicy
from netsp.plan.space.mission_solver import seconds_until_home, solve_mission
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.prisms import drive_plane_tours, floor_plan
from netsp.plan.space.space_plan import (
    AS_GIVEN,
    OUT_AND_BACK,
    PLANE,
    candidate_plans,
    plan,
    plan_given_order,
)
from netsp.plan.space.states import find_first_states
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from tests.worlds import FEW_CELLS

BOX = [-4, -4, -4, 4, 4, 4]


def bar(a, b, radius=0.08):
    return {"capsule": {"a": list(a), "b": list(b), "radius": radius}}


def square(half: float) -> list[dict]:
    """Four thin bars that close a square across the x axis."""
    corners = [(0, -half, -half), (0, half, -half), (0, half, half), (0, -half, half)]
    return [bar(a, b) for a, b in itertools.pairwise([*corners, corners[0]])]


def mission_about(waypoints, **more) -> Mission:
    return Mission(**{
        "scene": "-", "anchor": (-2.5, 0.3, 0.2), "start": (-2.5, 0.3, 0.2),
        "waypoints": waypoints, "tether_length": 9.0, "clearance": 0.25, "cell": 0.3, **more,
    })  # fmt: skip


SQUARE = Scene(solids=square(0.8), bounds=BOX)
BESIDE = [(1.5, 0.2, 0.1), (1.0, 1.9, 0.0), (0.6, -0.4, 1.8)]


@pytest.fixture(scope="module")
def square_water() -> PlanningContext:
    return PlanningContext.for_mission(mission_about(BESIDE), SQUARE, SQUARE.field())


@pytest.fixture(scope="module")
def square_board(square_water) -> StateGraph:
    places = Places.for_mission(square_water.mission, square_water.field)
    states = find_first_states(square_water, places, 8.9, StatePolicy().effort(3), Clock())
    board = StateGraph(square_water, states)
    board.update(netsp.plan.space.space_legs.StateGrowth(states, None).legs, Clock())
    return board


def test_the_way_along_a_tether_is_of_the_tethers_class(square_board):
    """Bars thinner than the clearance: a taut tether lies where a robot has no room."""
    context, found = square_board.context, 0
    for v, state in enumerate(square_board.states.entries):
        way = square_board.path_out(v)
        if way is not None:
            assert context.word_number(way) == state.word
            found += 1
    assert found > len(BESIDE)


def test_a_stop_has_the_word_of_the_path_to_it_and_not_that_of_its_state(square_board):
    tour = [of[-1] for of in square_board.states.at_place.values()]
    driven = square_board.drive(tour)
    walked = [square_board.context.present_tether.nodes]
    for stop in driven.visits:
        walked.append(stop.path)
        assert square_board.context.words.word(np.vstack(walked)) == stop.word


def test_a_tour_out_along_tethers_and_back_needs_no_legs(square_board):
    driven = square_board.drive_out_and_back()
    assert driven is not None
    assert [stop.waypoint for stop in driven.visits] == [0, 1, 2]
    assert driven.free
    shortest = sum(
        2.0
        * min(
            polylines.length(square_board.path_out(v))
            for v in of
            if square_board.path_out(v) is not None
        )
        for of in square_board.states.at_place.values()
    )
    assert driven.length >= shortest - 1e-6


def test_where_all_other_tours_are_refused_the_one_out_and_back_is_given(monkeypatch):
    judged = []

    def judge(mission, **how):
        judged.append(mission.tour.solver)
        if mission.tour.solver != OUT_AND_BACK:
            return Verification((Check("no", False, "refused"),))
        return verify_mission(mission, **how)

    monkeypatch.setattr(netsp.plan.space.space_plan, "verify_mission", judge)
    found = plan(mission_about(BESIDE), scene=SQUARE, time_limit=4.0)
    assert found.kind == OUT_AND_BACK
    assert verify_mission(found.to_mission(), scene=SQUARE)
    assert judged[-1] == OUT_AND_BACK


@pytest.mark.parametrize("seconds", [1e-3, 6.0])
def test_what_the_judge_refuses_is_never_given(seconds, monkeypatch):
    refuse = Verification((Check("no", False, "refused"),))
    for module in (netsp.plan.space.space_plan, netsp.plan.space.mission_flights):
        monkeypatch.setattr(module, "verify_mission", lambda *_, **__: refuse)
    with pytest.raises(LimitReachedError):
        solve_mission(mission_about(BESIDE[:2]), scene=SQUARE, time_limit=seconds)
    with pytest.raises(LimitReachedError):
        plan(mission_about(BESIDE[:2]), scene=SQUARE, time_limit=min(seconds, 1.0))


def random_bars(seed: int, count: int) -> tuple[Scene, Mission]:
    """Bars between random points, waypoints beside them."""
    rng = np.random.default_rng(seed)
    joints = rng.uniform(-2.0, 2.0, (count + 1, 3)).round(2)
    pairs = [(k, int(rng.integers(k))) for k in range(1, count + 1)]
    scene = Scene(solids=[bar(joints[a], joints[b]) for a, b in pairs], bounds=BOX)
    field, waypoints = scene.field(), []
    while len(waypoints) < 4:
        p = rng.uniform(-2.5, 2.5, 3).round(2)
        if 0.3 <= float(field.distance(p)) <= 1.0:
            waypoints.append(tuple(p.tolist()))
    corner = {"anchor": (3.6, 3.6, 3.6), "start": (3.3, 3.3, 3.3), "tether_length": 13.0}
    return scene, mission_about(waypoints, **corner)


@example(4, 4, 1e-3)  # the default cells close a passage beside two bars
@given(st.integers(0, 10**6), st.integers(3, 6), st.sampled_from([1e-3, 1.5]))
@settings(max_examples=5, deadline=None)
def test_no_tour_is_worse_than_the_order_given_and_all_are_verified(seed, count, seconds):
    scene, mission = random_bars(seed, count)
    first = plan_given_order(PlanningContext.for_mission(mission, scene, scene.field()))
    found = solve_mission(mission, scene=scene, time_limit=seconds)
    verdict = verify_mission(found.mission, scene=scene)
    assert verdict, str(verdict)
    # a tether may catch on bars, and the order given is a tour only where the judge passes it
    is_tour = first is not None and bool(verify_mission(first.to_mission(), scene=scene))
    if is_tour and len(first.visits) == len(found.tour.stops):
        assert found.tour.length <= first.length * (1.0 + 1e-6)
    flown = found.run is not None and found.given is not None
    if flown and found.given.summary["home"]["tether_free"]:
        assert seconds_until_home(found.run) <= 1.001 * seconds_until_home(found.given)


def test_the_order_of_the_file_is_flown_before_anything_is_sought():
    scene, mission = random_bars(1, 4)
    mission = mission.model_copy(update={"waypoints": mission.waypoints[:2]})
    told = []
    found = solve_mission(
        mission, scene=scene, time_limit=10.0, on_progress=told.append, policy=FEW_CELLS
    )
    first, sought = "flying the order as given", "shortest tethers to each waypoint"
    assert told.index("judging the tour") < told.index(first) < told.index(sought)
    assert found.given is not None
    # and where there is no time to seek any other, it is what is written
    at_once = solve_mission(mission, scene=scene, time_limit=1e-3)
    assert at_once.tour.solver == AS_GIVEN
    assert at_once.order == (0, 1)


def random_posts(seed: int) -> tuple[Problem, Scene, Mission]:
    """Posts of any size, a box and a grown prism, and goals beside them."""
    rng = np.random.default_rng(seed)
    solids, obstacles, clearance = [], [], 0.05
    for x, y in [(-4, 2), (1, -1), (4, 3), (0, 5)]:
        radius, centre = float(rng.uniform(0.3, 1.3)), (x + rng.uniform(-0.5, 0.5), float(y))
        solids.append({"post": {"center": centre, "radius": radius}})
        obstacles.append({"center": centre, "radius": radius})
    side, centre = float(rng.uniform(0.5, 1.5)), (5.0, -3.0)
    solids.append({"box": {"center": [*centre, 0.0], "size": [side, side, 9.0]}})
    corners = [(s * side / 2, t * side / 2) for s, t in [(-1, -1), (1, -1), (1, 1), (-1, 1)]]
    obstacles.append({"polygon": [(centre[0] + a, centre[1] + b) for a, b in corners]})
    scene = Scene(solids=solids, bounds=[-9, -9, -1, 9, 9, 1])
    field, goals = scene.field(), []
    while len(goals) < 4:
        p = (*rng.uniform(-7.0, 7.0, 2).round(3).tolist(), 0.0)
        if 0.1 <= float(field.distance(np.array(p))) <= 3.0:
            goals.append(p)
    base = (-8.0, 0.0, 0.0)
    far = max(math.dist(base, p) for p in goals)
    problem = Problem.model_validate({
        "base": base, "goals": goals, "obstacles": obstacles, "clearance": clearance,
        "tether_length": 1.15 * far, "bounds": [-9, -9, 9, 9],
    })  # fmt: skip
    mission = Mission(
        scene="-", anchor=base, start=base, waypoints=goals, clearance=clearance, cell=0.25,
        tether_length=1.15 * far,
    )  # fmt: skip
    return problem, scene, mission


PATIENT = PlanePolicy(max_s=300.0)


@pytest.mark.parametrize("seed", range(4))
def test_among_upright_prisms_the_tour_of_the_plane_is_found(seed):
    problem, scene, mission = random_posts(seed)
    best = solve(problem)
    assert best.status.value == "optimal"
    context = PlanningContext.for_mission(mission, scene, scene.field())
    found = next(
        drive_plane_tours(
            context, scene, Places.for_mission(mission, context.field), Clock(), policy=PATIENT
        )
    )
    assert len(found.visits) == 4
    assert found.length == pytest.approx(best.length, rel=5e-3)


def test_the_tour_of_the_plane_comes_before_anything_is_sought_and_is_verified():
    _, scene, mission = random_posts(0)
    first = next(candidate_plans(mission, scene=scene, clock=Clock(600.0)))
    assert first.kind == PLANE
    assert verify_mission(first.to_mission(), scene=scene)


def test_a_tour_of_the_plane_may_begin_beside_the_anchor():
    _, scene, mission = random_posts(1)
    beside = mission.model_copy(update={"start": (-8.0, 0.4, 0.3)})
    context = PlanningContext.for_mission(beside, scene, scene.field())
    found = next(
        drive_plane_tours(
            context, scene, Places.for_mission(beside, context.field), Clock(), policy=PATIENT
        )
    )
    assert found.visits[0].path[0] == pytest.approx(beside.start)
    assert found.home[-1] == pytest.approx(beside.start)


UP = [{"post": {"center": [0, 0], "radius": 1}}]
THROUGH = {
    "a box through all depths": (
        {"box": {"center": [3, 0, 0], "size": [1, 1, 2], "rotation": [0, 0, 30]}}, True
    ),
    "a box that lies on its side": (
        {"box": {"center": [3, 0, 0], "size": [2, 1, 1], "rotation": [0, 90, 0]}}, True
    ),
    "a box that ends under water": ({"box": {"center": [3, 0, -1], "size": [1, 1, 2]}}, False),
    "a box that leans": (
        {"box": {"center": [3, 0, 0], "size": [1, 1, 9], "rotation": [5, 0, 0]}}, False
    ),
    "a cylinder": ({"cylinder": {"a": [3, 0, -1], "b": [3, 0, 1], "radius": 0.5}}, True),
    "a capsule": ({"capsule": {"a": [3, 0, -2], "b": [3, 0, 2], "radius": 0.5}}, True),
    "a leaning capsule": ({"capsule": {"a": [3, 0, -2], "b": [3, 1, 2], "radius": 0.5}}, False),
    "a sphere": ({"sphere": {"center": [3, 0, 0], "radius": 0.5}}, False),
    "a sphere above the water": ({"sphere": {"center": [3, 0, 9], "radius": 0.5}}, True),
    "a ring": ({"torus": {"center": [3, 0, 0], "major_radius": 1, "minor_radius": 0.1}}, False),
    "the sea floor": ({"half_space": {"point": [0, 0, -0.9]}}, True),
    "a wall": ({"half_space": {"point": [6, 0, 0], "normal": [-1, 0, 0]}}, True),
    "a slope": ({"half_space": {"point": [0, 0, -5], "normal": [0.5, 0, 1]}}, False),
}  # fmt: skip


@pytest.mark.parametrize(("solid", "upright"), THROUGH.values(), ids=THROUGH)
def test_which_solids_are_upright_prisms_through_all_depths(solid, upright):
    scene = Scene(solids=[*UP, solid], bounds=[-9, -9, -1, 9, 9, 1])
    mission = mission_about([(0, 3, 0)], anchor=(-3, 0, 0), start=(-3, 0, 0))
    assert (floor_plan(scene, mission) is not None) == upright
