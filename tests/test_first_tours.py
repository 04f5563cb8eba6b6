"""The first tours of a mission: there before any words are known, free, and judged."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.gtsp.travel.result import Result
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE
from netsp.model.solution import Status
from netsp.plan.space.board import DrivenTour, with_status
from netsp.plan.space.driven_legs import with_words
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.mission_solver import solve_mission
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.spoke_tours import Spokes, drive_spoke_orders
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.mission.planned_tour import status_of_tour
from netsp.world.simulator.mission_run import mission_grid


def frame(seed: int) -> tuple[Mission, Scene]:
    """Return four bars between random joints, and five waypoints beside them."""
    rng = np.random.default_rng(seed)
    joints = rng.uniform(-2.0, 2.0, (5, 3)).round(2)
    bars = [
        {"capsule": {"a": a.tolist(), "b": b.tolist(), "radius": 0.1}}
        for a, b in itertools.pairwise(joints)
    ]
    scene = Scene(solids=bars, bounds=[-4, -4, -4, 4, 4, 4])
    field, waypoints = scene.field(), []
    while len(waypoints) < 5:
        p = rng.uniform(-2.5, 2.5, 3).round(2)
        if 0.3 <= float(field.distance(p)) <= 1.5:
            waypoints.append(p.tolist())
    mission = Mission(
        scene="-", anchor=(3.6, 3.6, 3.6), start=(3.4, 3.4, 3.4), waypoints=waypoints,
        tether_length=13.0, clearance=0.25, cell=0.25,
    )  # fmt: skip
    return mission, scene


def spokes_of(mission: Mission, scene: Scene) -> Spokes:
    field = scene.field()
    grid = mission_grid(mission, scene, field)
    context = PlanningContext.without_words(mission, field, grid, scene.bounds)
    return Spokes(context, Places.for_mission(mission, field))


@given(st.integers(0, 10**6), st.permutations(range(5)))
@settings(max_examples=4, deadline=None)
def test_a_tour_along_spokes_has_an_empty_word_and_is_no_longer_than_out_and_back(seed, order):
    spokes = spokes_of(*frame(seed))
    driven = spokes.drive(order)
    assert not spokes.context.has_words
    assert driven is not None
    out_and_back = sum(
        2.0 * polylines.length(spokes.to_place(visit.waypoint).path) for visit in driven.visits
    )
    assert driven.length <= out_and_back * (1.0 + 1e-9)
    # words, found afterwards, agree that the tether is free
    named = with_words(spokes.context, driven)
    assert named is not None
    assert [v.word for v in driven.visits] == [None] * len(driven.visits)
    assert all(visit.word is not None for visit in named.visits)


def test_short_orders_along_spokes_get_shorter_and_visit_all():
    spokes = spokes_of(*frame(3))
    tours = list(drive_spoke_orders(spokes, Clock()))
    lengths = [tour.length for tour in tours]
    assert lengths == sorted(lengths, reverse=True)
    assert {visit.waypoint for visit in tours[-1].visits} == set(range(5))
    assert lengths[-1] <= spokes.drive(range(5)).length
    assert list(drive_spoke_orders(spokes, Clock(0.0))) == []


def test_a_tour_that_the_time_left_without_words_is_verified_from_its_file():
    mission, scene = frame(1)
    found = solve_mission(mission, scene=scene, time_limit=1e-3)
    assert found.plan is None
    assert found.tour.exact is None
    assert {stop.signature for stop in found.tour.stops} == {None}
    written = Mission.from_json(found.mission.model_dump_json(exclude_none=True))
    assert written.tour == found.tour
    verdict = verify_mission(written, scene=scene)
    assert verdict, str(verdict)
    assert all(check.was_made for check in verdict.checks)
    detail = {check.name: check.detail for check in verdict.checks}
    assert detail["words at the visits"].startswith("5 not stated")
    assert detail["empty word at the end"] == "contractible"


def test_bad_rounds_are_refused():
    for field in ({"round_s": 0.0}, {"round_growth": 1.0}, {"given_order_s": -1.0}):
        with pytest.raises(InputError, match=next(iter(field))):
            MissionPolicy(**field)


def test_shares_of_a_paced_clock_do_not_depend_on_the_limit():
    plans = []
    for limit in (3.0, 1000.0, None):
        paced = Clock(limit).paced(100.0)
        part = paced.part(0.5).part(0.5)
        plans.append(part.planned_left)
        assert part.left <= (limit or np.inf)
        assert not paced.has_run_out
    assert plans == pytest.approx([25.0] * 3, abs=0.1)
    over = Clock(0.0).paced(100.0)
    assert over.is_up
    assert over.has_run_out
    assert over.planned_left > 99.0


lengths = st.floats(1e-3, 1e6)
ratios = st.one_of(
    st.none(), st.floats(0.0, 1.0), st.floats(0.0, 3.0).map(lambda k: 1.0 - k * 1e-6)
)


@given(lengths, ratios, ratios, st.booleans())
def test_no_tour_is_called_feasible_where_a_bound_equals_its_length(length, states, all_, is_whole):
    bounds = [None if r is None else r * length for r in (states, all_)]
    status = status_of_tour(length, *bounds, is_complete=is_whole)
    proves = [b is not None and length - b <= OPTIMALITY_TOLERANCE * length for b in bounds]
    proven_of_all = proves[1] and is_whole
    assert (status is Status.OPTIMAL) == proven_of_all
    assert (status is Status.FEASIBLE) == (not proves[0] and not proven_of_all)
    driven = DrivenTour([], [], np.zeros((2, 3)), length, True, None)
    result = with_status(Result((0,), length, bounds[0], Status.FEASIBLE), driven)
    assert (result.status is Status.FEASIBLE) == (not proves[0])
