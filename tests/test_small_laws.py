"""Laws of small functions on which claims, alarms and exported missions rest, each stated exactly.

Every test here is quick and needs no solver, so that `benchmarks/mutants.py` can tell within a
second whether a sabotage of such a function is noticed.
"""

import itertools
import json
import math
import time
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InputError, Polygon, Problem, solve, verify
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.exchange.maps.contract import kind_of, parse_mappings
from netsp.exchange.maps.drawn_shapes import circle_of, simple_polygons
from netsp.exchange.maps.feature import Feature
from netsp.exchange.maps.projection import Projection
from netsp.exchange.missions.export_margins import warnings
from netsp.exchange.missions.leg_times import SmoothMove, VehicleMotion, leg_times
from netsp.exchange.missions.mission_export import pursued
from netsp.exchange.missions.mission_files import (
    ExportSettings,
    _counter_clockwise,
    _hold,
    altitude,
    format_of,
    predicted_s,
)
from netsp.exchange.missions.waypoints import (
    Waypoint,
    _check_class,
    _cuts,
    _meeting,
    _side,
    clearance_of,
    turn,
)
from netsp.gtsp.limits import Limits
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.kept import with_bound, with_classes_left_out
from netsp.gtsp.travel.result import Result, proven, relative_gap
from netsp.hsignature.words import concatenate, cyclically_reduced, entangled, invert, reduce
from netsp.model.bound_scope import LowerBound, Scope
from netsp.model.solution import Status
from netsp.online.execute.temporary_obstacles import lasting_problem, temporary_obstacles
from netsp.online.execute.tour_repair import free_position, plan_fault, split_reachable
from netsp.online.fly.preflight_checks import make_ready
from netsp.online.fly.stopped import RefusedError
from netsp.online.fly.vehicle import POSITION_ONLY, LinkedVehicle, _fault
from netsp.online.guard.alarms import Alarm, Alarms, Level
from netsp.online.guard.lookahead import LookaheadResult
from netsp.online.guard.position_track import Track
from netsp.online.guard.reasons import (
    Situation,
    in_doubt,
    little_slack,
    loop_ahead,
    loop_closed,
    names_of,
    off_plan,
    soon_short,
)
from netsp.online.guard.site import Loop
from netsp.online.guard.telemetry import Fix
from netsp.online.link.vehicle_kind import VehicleKind
from netsp.plan.cover.choose import choose_greedily, counting_bound, prune
from netsp.plan.tour_plan import HOME, Leg
from netsp.roadmap.travel_graph import TravelGraph

# words


words = st.lists(st.integers(-4, 4).filter(bool), max_size=12).map(tuple)


def test_a_word_that_cancels_around_its_ends_is_entangled_with_the_rest_only():
    """(1, 2, 3, -2, -3, -1) slides off its base as (2, 3, -2, -3), which has no 1."""
    assert entangled((1, 2, 3, -2, -3, -1)) == (2, 3)
    assert entangled((1, 2, -1)) == (2,)
    assert entangled((1, 2, -1, -2)) == (1, 2)


@given(word=words, around=words)
def test_a_loop_is_as_entangled_from_any_other_base(word, around):
    """Going out along a path first and back along it last changes no loop."""
    moved = concatenate(around, word, invert(around))
    assert len(cyclically_reduced(moved)) == len(cyclically_reduced(word))
    assert bool(entangled(moved)) == bool(entangled(word))


@given(word=words, letter=st.integers(1, 4))
def test_reduction_undoes_every_inserted_pair(word, letter):
    for k in range(len(word) + 1):
        assert reduce((*word[:k], letter, -letter, *word[k:])) == reduce(word)
    assert concatenate(word, invert(word)) == ()


# the clock


def test_a_part_takes_its_share_of_what_is_left_and_not_of_the_limit():
    clock = Clock(100.0)
    clock.start -= 60.0
    clock.deadline -= 60.0
    assert clock.left == pytest.approx(40.0, abs=1.0)
    assert clock.part(0.5).left == pytest.approx(20.0, abs=1.0)
    assert clock.elapsed == pytest.approx(60.0, abs=1.0)
    assert Clock().part(0.5).limit is None


def test_a_clock_within_another_never_outlasts_it():
    outer = Clock(1.0)
    assert Clock(50.0, within=outer).left <= 1.0
    assert Clock(0.5, within=outer).left <= 0.5
    assert Clock.from_limit(outer).deadline == outer.deadline
    outer.end()
    assert outer.is_up
    assert Clock(50.0, within=outer).is_up


def test_a_clock_is_up_from_its_deadline_on(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("netsp.base.clock.time.monotonic", lambda: now[0])
    clock = Clock(5.0)
    now[0] = 1004.999
    assert not clock.is_up
    now[0] = 1005.0
    assert clock.is_up


def test_a_clock_says_to_compiled_loops_that_it_is_up():
    clock = Clock(0.05)
    assert not clock.is_up
    flag = clock.flag
    assert flag[0] == 0
    time.sleep(0.2)
    assert clock.is_up
    assert flag[0] == 1
    assert Clock(0.0).flag[0] == 1
    assert Clock().flag[0] == 0
    with pytest.raises(LimitReachedError, match="time limit reached while counting"):
        clock.check("counting")


# bounds


def run_of(costs, clusters):
    return SolverRun(TravelGraph.from_costs(costs, clusters), Limits())


WHOLE = np.array([[0.0, 3.0, 4.0], [3.0, 0.0, 5.0], [4.0, 5.0, 0.0]])


@pytest.mark.parametrize(
    ("bound", "raised"),
    [(10.2, 11.0), (11.0, 11.0), (11.00001, 11.00001), (10.99999, 11.0), (11.5, 12.0), (3.0, 3.0)],
)
def test_a_bound_on_whole_numbers_is_the_next_whole_number_but_for_rounding(bound, raised):
    run = run_of(WHOLE, [0, 1, 2])
    run.raise_bound(bound)
    assert run.bound == raised


@given(bounds=st.lists(st.floats(0.0, 20.0), min_size=1, max_size=5))
def test_a_bound_never_falls_and_never_exceeds_the_incumbent(bounds):
    run = run_of(WHOLE + 0.25, [0, 1, 2])
    run.update_incumbent([0, 1, 2])
    before = 0.0
    for bound in bounds:
        run.raise_bound(bound)
        assert before <= run.bound <= run.length
        assert run.bound <= max(before, min(bound, run.length) + 0.25)
        before = run.bound


@given(length=st.floats(1e-3, 1e6), share=st.floats(0.0, 1.0))
def test_a_gap_is_the_share_of_the_tour_that_may_be_saved(length, share):
    bound = LowerBound(length * (1.0 - share), Scope.ALL_TOURS)
    assert bound.gap(length) == pytest.approx(share, abs=1e-12)
    assert bound.proves(length) == (length - bound.length <= 1e-6 * length)
    assert LowerBound(2.0 * length, Scope.ALL_TOURS).gap(length) == 0.0
    assert bound.capped_at(0.5 * length).length == min(bound.length, 0.5 * length)
    assert relative_gap(length, bound.length) == bound.gap(length)
    assert proven(length, bound.length) == bound.proves(length)
    assert relative_gap(None, 1.0) is relative_gap(1.0, None) is None


def test_a_bound_holds_for_parts_of_its_tours_and_for_no_more():
    whole, kept = LowerBound(9.0, Scope.ALL_TOURS), LowerBound(9.0, Scope.KEPT_CLASSES)
    assert whole.for_part(Scope.KEPT_CLASSES, "some of them").length == 9.0
    with pytest.raises(ValueError, match="not all of"):
        kept.for_part(Scope.ALL_TOURS, "wishful thinking")
    with pytest.raises(ValueError):
        kept.or_elsewhere(10.0, Scope.ALL_TOURS, "")
    assert kept.or_elsewhere(7.0, Scope.ALL_TOURS, "the others are longer") == LowerBound(
        7.0, Scope.ALL_TOURS
    )
    assert kept.or_elsewhere(12.0, Scope.ALL_TOURS, "the others are longer").length == 9.0
    assert "over the classes kept" in kept.above(10.0)
    assert kept.above(10.0).startswith("at most 11.1 % above")


def result(length, bound, status, scope=Scope.KEPT_CLASSES):
    return Result((0, 1), length, bound, status, lower_bound_of=scope)


def test_a_bound_over_the_classes_kept_is_no_more_than_the_rest_allows():
    kept, why = result(100.0, 100.0, Status.OPTIMAL), "the others have longer tethers"
    for rest, bound, status in (
        (90.0, 90.0, Status.OPTIMAL_OF_KEPT), (120.0, 100.0, Status.OPTIMAL),
        (100.0 - 1e-9, 100.0 - 1e-9, Status.OPTIMAL),
    ):  # fmt: skip
        found = with_classes_left_out(kept, rest, Scope.ALL_TOURS, why)
        assert found.lower_bound == bound
        assert found.lower_bound_of is Scope.ALL_TOURS
        assert found.status is status


def test_a_bound_proves_the_status_of_its_scope():
    found = result(100.0, 90.0, Status.FEASIBLE)
    assert with_bound(found, LowerBound(95.0, Scope.ALL_TOURS)).status is Status.FEASIBLE
    assert with_bound(found, LowerBound(100.0, Scope.ALL_TOURS)).status is Status.OPTIMAL
    assert with_bound(found, LowerBound(100.0, Scope.KEPT_CLASSES)).status is Status.OPTIMAL_OF_KEPT
    assert with_bound(found, LowerBound(150.0, Scope.ALL_TOURS)).lower_bound == 100.0
    assert Status.optimal_of(Scope.ROADMAP) is Status.OPTIMAL_OF_ROADMAP
    assert Status.optimal_of(Scope.STATES) is Status.OPTIMAL_OF_STATES


# viewpoints


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000))
def test_pruning_keeps_what_is_needed_and_takes_the_least_useful_first(seed):
    """The chosen viewpoints see enough, none is superfluous, and the best outlives a useless
    one."""
    rng = np.random.default_rng(seed)
    matrix = rng.random((6, 9)) < 0.4
    weights = rng.uniform(0.1, 1.0, 9)
    needed = 0.9 * float(weights[matrix.any(axis=0)].sum())
    taken = np.arange(6)
    kept = prune(matrix, weights, taken, needed)

    def seen(some):
        return float(weights[matrix[list(some)].any(axis=0)].sum()) if len(some) else 0.0

    assert seen(kept) >= needed * (1.0 - 1e-9)
    assert all(seen([j for j in kept if j != k]) < needed for k in kept)
    found = choose_greedily(matrix, weights, needed)
    assert seen(found) >= needed * (1.0 - 1e-9)
    fewest = next(
        n for n in range(7)
        if any(seen(c) >= needed * (1 - 1e-12) for c in itertools.combinations(range(6), n))
    )  # fmt: skip
    assert counting_bound(matrix, weights, needed) <= fewest <= len(kept)


def test_pruning_drops_the_viewpoint_that_alone_sees_least():
    """The first sees nearly all by itself; the others see single patches that it lacks."""
    matrix = np.array([[1, 1, 1, 1, 0, 0], [0, 0, 0, 1, 1, 0], [0, 0, 0, 0, 0, 1]], dtype=bool)
    weights = np.array([4.0, 3.0, 2.0, 1.0, 0.5, 0.2])
    assert prune(matrix, weights, np.arange(3), 10.0).tolist() == [0]


# exported missions


def test_turns_and_sides_of_bends():
    a, b = np.zeros(3), np.array([1.0, 0.0, 0.0])
    assert turn(a, b, np.array([2.0, 0.0, 0.0])) == 0.0
    assert turn(a, b, np.array([1.0, 1.0, 0.0])) == pytest.approx(math.pi / 2)
    assert turn(a, b, np.array([1.0, 0.0, -1.0])) == pytest.approx(math.pi / 2)
    assert turn(a, b, b) == math.pi
    assert _side(a, b, np.array([1.0, 1.0, 0.0])) == pytest.approx(math.pi / 2)
    assert _side(a, b, np.array([1.0, -1.0, 0.0])) == pytest.approx(-math.pi / 2)


def test_two_bends_meet_where_their_outer_lines_do():
    a, b, c, d = (np.array(p, float) for p in ([0, 0, 0], [1, 0, 2], [2, 1, 4], [2, 2, 0]))
    assert _meeting(a, b, c, d) == pytest.approx([2.0, 0.0, 3.0])
    assert _meeting(a, b, c, np.array([3.0, 1.0, 0.0])) is None
    beyond = np.array([2.0, -1.0, 0.0])
    assert _meeting(a, b, beyond, np.array([2.0, 1.0, 0.0])) is None
    assert _meeting(d, c, b, a) == pytest.approx([2.0, 0.0, 3.0])


def test_a_vehicle_may_cut_the_whole_triangle_of_its_acceptance_radius():
    """At a right angle with radius 1 the triangle is (0, 1), (0, 0), (1, 0): a post at (0.3, 0.3)
    is within it and one at (0.6, 0.6) is not."""
    line = np.array([[0.0, 5.0, 0.0], [0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])

    def cuts(x, y, radius):
        tree = shapely.STRtree([shapely.Point(x, y).buffer(0.05)])
        return _cuts(tree, line, 1, radius)

    assert cuts(0.3, 0.3, 1.0)
    assert cuts(0.44, 0.44, 1.0)
    assert not cuts(0.6, 0.6, 1.0)
    assert not cuts(0.3, 0.3, 0.4)
    assert cuts(2.0, 2.0, 100.0)


def test_a_pursuer_turns_at_its_radius_and_ends_at_the_last_waypoint():
    line = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 10.0, 0.0]])
    path = pursued(line, 1.0)
    assert path[1] == pytest.approx([9.0, 0.0, 0.0])
    assert path[-1] == pytest.approx(line[-1])
    assert len(path) == 3
    assert np.array_equal(pursued(line, 0.0), line)


@pytest.mark.parametrize(
    ("z", "told"), [(-5.0, -5.0), (0.0, -0.1), (0.5, -0.1), (-0.04, -0.1), (-1.23456, -1.235)]
)
def test_no_altitude_is_above_a_decimetre_below_the_surface(z, told):
    assert altitude(z) == told


def test_a_vehicle_stays_at_goals_and_shortly_at_bends():
    goal, bend, home = Waypoint((0, 0, 0), 2), Waypoint((0, 0, 0), None), Waypoint((0, 0, 0), HOME)
    plain = ExportSettings()
    assert [_hold(p, plain) for p in (goal, bend, home)] == [5, 1, 1]
    assert _hold(Waypoint((0, 0, 0), 0, stay=9), plain) == 9
    assert _hold(Waypoint((0, 0, 0), 0, stay=9), ExportSettings(goal_hold_s=3)) == 3


def test_predicted_seconds_are_those_of_legs_stops_and_holds():
    """Holds are added to the legs, and no leg is faster than its speed or its acceleration lets."""
    for length in (10.0, 1.0):
        points = [Waypoint((0, 0, 0), None), Waypoint((length, 0, 0), 0)]
        places = [(0.0, 0.0, altitude(0.0)), (length, 0.0, altitude(0.0))]
        moving = leg_times(places, [0.0, 0.0], 0.5)[0]
        assert moving > SmoothMove(length, 0.0, 0.5, VehicleMotion()).duration_s > length / 0.5
        assert predicted_s(points, ExportSettings(speed=0.5)) == pytest.approx(
            moving + 1 + 5, abs=0.1
        )
    assert predicted_s(points, ExportSettings(speed=None)) is None


def test_rings_run_counter_clockwise():
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    assert list(_counter_clockwise(square)) == square
    assert list(_counter_clockwise(square[::-1])) == square


@pytest.mark.parametrize(
    ("file", "asked", "kind"),
    [("a.plan", None, "plan"), ("a.txt", None, "wpl"), ("a.xyz", "csv", "csv"), ("A.PLAN", "plan",
     "plan"), ("a.csv", "plan", None), ("a.xyz", None, None), ("a.csv", "pdf", None)],
)  # fmt: skip
def test_a_format_is_that_of_the_name_or_the_one_asked_for(file, asked, kind):
    if kind is None:
        with pytest.raises(InputError):
            format_of(file, asked)
    else:
        assert format_of(file, asked) == kind


def check_lines(posts, over, word):
    """Check straight lines from the base over a place to goal 0, and back the same way."""
    line = np.array([(0, 0, 0), (*over, 0), (6, 1, 0), (*over, 0), (0, 0, 0)], dtype=float)
    marks = [(None, (), 0.0), (None, (), 0.0), (0, word, 6.1), (None, (), 0.0), (HOME, (), 0.0)]
    _check_class(posts, SimpleNamespace(start_tether=()), line, marks)


def test_exported_lines_are_of_the_planned_class_and_free(posts):
    """Lines that pass above the first post write its letter; those through it are refused."""
    check_lines(posts, (4.0, 2.5), (1,))
    check_lines(posts, (4.0, -2.5), ())
    with pytest.raises(InputError, match="homotopy class"):
        check_lines(posts, (4.0, 2.5), ())
    with pytest.raises(InputError, match="homotopy class"):
        check_lines(posts, (4.0, -2.5), (1,))
    with pytest.raises(InputError, match="enter an obstacle"):
        check_lines(posts, (4.0, 0.9), (1,))


def test_tight_plans_are_warned_of(posts):
    visit = SimpleNamespace(goal=0, tether_length=13.8)
    solution = SimpleNamespace(tour=[visit, SimpleNamespace(goal=1, tether_length=5.0)])
    far = [Waypoint((0, 9, 0), None), Waypoint((9, 9, 0), 0)]
    assert warnings(posts, solution, far, 0.1, 0.2) == []
    assert "0.20 m of tether is left" in warnings(posts, solution, far, 0.3, 0.2)[0]
    near = [Waypoint((0, 1.1, 0), None), Waypoint((9, 1.1, 0), 0)]
    assert clearance_of(posts, near) == pytest.approx(0.1)
    assert "within 0.10 m of an obstacle" in warnings(posts, solution, near, 0.1, 0.2)[0]


# alarms


def levels(alarms, now, *reasons):
    return [a.level for a in alarms.update(now, reasons)]


def test_a_reason_may_be_away_for_less_than_a_second():
    """Away for 0.6 s a reason counts as there all along; away for 0.8 s it begins anew."""
    reason = Alarm("loop", Level.CAUTION, "x")  # a notice at once, a caution after 1 s
    for away, raised in ((0.6, [Level.CAUTION]), (0.8, [])):
        alarms = Alarms()
        assert levels(alarms, 0.0, reason) == [Level.NOTICE]
        assert levels(alarms, away) == []
        assert levels(alarms, 0.9, reason) == []
        assert levels(alarms, 1.05, reason) == raised


def test_alarms_are_raised_in_time_and_lowered_late():
    alarms = Alarms()
    loop = Alarm("loop", Level.ALARM, "a loop")
    assert levels(alarms, 0.0, loop) == [Level.NOTICE]
    assert levels(alarms, 0.2, loop) == []
    assert levels(alarms, 0.35, loop) == [Level.ALARM]
    assert levels(alarms, 0.5, loop) == []
    assert levels(alarms, 4.4) == []
    assert alarms.active["loop"].level is Level.ALARM
    assert levels(alarms, 4.6) == []
    assert alarms.active == {}


def test_the_gravest_alarm_is_told_first():
    alarms = Alarms()
    notice, alarm = Alarm("class", Level.NOTICE, "n"), Alarm("loop", Level.ALARM, "a")
    alarms.update(0.0, [notice, alarm])
    alarms = Alarms()
    alarms.update(0.0, [alarm])
    told = alarms.update(0.4, [notice, alarm])
    assert [a.level for a in told] == [Level.ALARM, Level.NOTICE]


# reasons


@pytest.fixture
def posts():
    return Problem(
        base=(0, 0), goals=[(6, 1), (6, -1)], tether_length=14, clearance=0.2,
        obstacles=[Circle(center=(4, 0), radius=1), Circle(center=(7, 2), radius=0.5)],
    )  # fmt: skip


class Place:
    """A site of four posts, east of each of which the robot is."""

    tether_length, units = 20.0, "m"

    def name_of(self, i):
        return f"P{i}"

    def nearest(self, around, place):
        return around[0]

    def side_of(self, obstacle, place):
        return "east"


def class_now(slack=10.0, likely=1.0, taut=10.0):
    return SimpleNamespace(slack=slack, likely=likely, taut=taut, passes="east of P0")


@pytest.mark.parametrize(
    ("slack", "level"),
    [(3.0, None), (1.9, Level.CAUTION), (0.5, Level.WARNING), (-0.1, Level.ALARM)],
)
def test_little_tether_is_told_by_what_is_left(slack, level):
    told = little_slack(Place(), class_now(slack, taut=20.0 - slack))
    assert [a.level for a in told] == ([] if level is None else [level])


@pytest.mark.parametrize(
    ("seconds", "level"), [(None, None), (11.0, None), (9.0, Level.CAUTION), (3.0, Level.WARNING)]
)
def test_a_tether_that_gets_short_is_told_by_when(seconds, level):
    told = soon_short(Place(), LookaheadResult(short_s=seconds))
    assert [a.level for a in told] == ([] if level is None else [level])


LOOP = Loop((0,), np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]]))


@pytest.mark.parametrize(
    ("seconds", "share", "turning", "on_plan", "level"),
    [
        (15.0, 1.0, False, False, Level.WARNING), (25.0, 1.0, False, False, Level.CAUTION),
        (31.0, 1.0, False, False, None), (16.0, 1.0, True, False, Level.CAUTION),
        (13.0, 1.0, True, False, Level.WARNING), (15.0, 0.5, False, False, Level.CAUTION),
        (15.0, 0.04, False, False, None), (15.0, 1.0, False, True, Level.CAUTION),
    ],
)  # fmt: skip
def test_a_loop_ahead_is_told_by_when_and_how_likely(seconds, share, turning, on_plan, level):
    ahead = LookaheadResult(loop_s=seconds, loop=LOOP, is_turning=turning)
    situation = Situation(Place(), np.zeros(3), is_on_plan=on_plan)
    told = loop_ahead(ahead, situation, share)
    assert [a.level for a in told] == ([] if level is None else [level])
    assert all("keep east of P0" in a.text for a in told)


def test_a_loop_in_a_class_that_is_not_clear_is_no_warning():
    ahead = LookaheadResult(loop_s=15.0, loop=LOOP)
    (told,) = loop_ahead(ahead, Situation(Place(), np.zeros(3), 0.4), 0.9)
    assert told.level is Level.CAUTION
    (told,) = loop_ahead(ahead, Situation(Place(), np.zeros(3), 0.4), 0.96)
    assert told.level is Level.WARNING


@pytest.mark.parametrize(
    ("share", "on_plan", "level"),
    [(1.0, False, Level.ALARM), (0.5, False, Level.ALARM), (0.4, False, Level.CAUTION),
     (0.04, False, None), (1.0, True, Level.NOTICE)],
)  # fmt: skip
def test_a_closed_loop_is_told_by_how_likely_it_is(share, on_plan, level):
    told = loop_closed([LOOP], Situation(Place(), np.zeros(3), is_on_plan=on_plan), share)
    assert [a.level for a in told] == ([] if level is None else [level])


def test_doubts_and_departures_from_the_plan_are_told():
    sure, rest = class_now(likely=0.96), class_now(likely=0.04)
    assert in_doubt([sure, rest]) == []
    assert len(in_doubt([class_now(likely=0.9), class_now(likely=0.1)])) == 1
    assert off_plan(False, class_now(likely=0.9))[0].level is Level.CAUTION
    assert off_plan(False, class_now(likely=0.5)) == []
    assert off_plan(True, class_now()) == off_plan(None, class_now()) == []
    assert names_of(Place(), [0]) == "P0"
    assert names_of(Place(), [0, 1, 2]) == "P0, P1 and P2"
    assert names_of(Place(), [0, 1, 2, 3]) == "P0, P1, P2 and 1 more"


# the track of a vehicle


def fix(t, x, y=0.0):
    return Fix(t, (x, y, -1.0))


def track_at(speed=0.5):
    """A track that has gone 5 s along the x axis."""
    track = Track(0.01, 1.0)
    for k in range(51):
        track.observe(fix(0.1 * k, speed * 0.1 * k))
    return track


def test_a_gap_of_more_than_two_seconds_is_one():
    assert track_at().observe(fix(6.9, 3.45)).lost_s == 0.0
    motion = track_at().observe(fix(7.1, 3.55))
    assert motion.lost_s == pytest.approx(2.1)
    assert motion.reason == "no position came"


def test_a_jump_that_no_speed_explains_is_one():
    assert track_at().observe(fix(5.1, 3.0)).lost_s == 0.0
    assert track_at().observe(fix(5.1, 3.5)).reason == "the position jumped"


def test_a_moving_robot_whose_estimate_repeats_is_lost_since_it_did():
    track = track_at()
    for k in range(1, 32):
        motion = track.observe(fix(5.0 + 0.1 * k, 2.5))
    assert track.is_frozen
    assert motion is None
    assert track.silence_s(8.2) == pytest.approx(3.2)
    assert track.observe(fix(8.2, 2.6)).lost_s == pytest.approx(3.2)


def test_a_robot_at_rest_may_repeat_its_estimate():
    track = Track(0.01, 1.0)
    for k in range(100):
        track.observe(fix(0.1 * k, min(k, 5) * 1e-4))
    assert not track.is_frozen


def test_doubt_lasts_from_when_it_was_told():
    track = track_at()
    track.invalidate(5.0)
    track.invalidate(6.0)
    assert track.silence_s(7.0) == pytest.approx(2.0)
    assert track.observe(fix(7.0, 3.5)).reason == "the estimate was lost"
    assert track.silence_s(7.5) == pytest.approx(0.5)


def test_velocity_and_turn_are_those_of_the_motion():
    straight = track_at()
    assert straight.velocity == pytest.approx([0.5, 0.0, 0.0], abs=0.02)
    track, motion = Track(0.01, 1.0), None
    for k in range(150):  # a circle of radius 5, counter-clockwise, 0.1 rad/s
        a = 0.01 * k
        motion = track.observe(fix(0.1 * k, 5 * math.sin(a), 5 * (1 - math.cos(a))))
    assert motion.turn == pytest.approx(0.1, abs=0.02)
    assert track.observe(fix(10.0, 0.0)) is None  # older than the last


# before and during a flight


class Vehicle:
    """The part of a session that is used before a flight; it answers everything at once."""

    system, others, fault = 1, (), None
    silent_s = position_age_s = stalled_s = 0.0
    kind, echo = VehicleKind(12, 3), None

    def __init__(self, **told):
        kept = {"position": (0.0, 0.0, -1.0), "estimate": True, "armed": True, "mode": "GUIDED"}
        self.latest = SimpleNamespace(**{**kept, "time": 0.0, "heading": None, **told})

    def aiding_fault(self, *_):
        """Return that nothing is wrong."""

    def request_positions(self):
        """Send nothing."""

    def sleep(self, seconds):
        """Return without delay."""

    def command(self, *_):
        return True

    def watch(self, check):
        self.check = check


@pytest.mark.parametrize(
    ("told", "why"),
    [
        ({}, None), ({"armed": False}, "not armed"), ({"armed": None}, "whether it is armed"),
        ({"estimate": False}, "no position estimate"), ({"position": None}, "no position estimate"),
        ({"position": (1.9, 0.0, -9.0)}, None), ({"position": (2.1, 0.0, -1.0)}, "2.1 m from"),
        ({"mode": "MANUAL"}, "does not take the mode GUIDED"),
    ],
)  # fmt: skip
def test_a_vehicle_is_asked_for_all_that_a_flight_needs(told, why):
    if why is None:
        make_ready(Vehicle(**told), np.zeros(3), 2.0)
        return
    with pytest.raises(RefusedError, match=why):
        make_ready(Vehicle(**told), np.zeros(3), 2.0)


@pytest.mark.parametrize(
    ("told", "why"),
    [({}, None), ({"estimate": False}, "position estimate"), ({"armed": False}, "disarmed"),
     ({"mode": "ALT_HOLD"}, "pilot has taken over"), ({"estimate": None}, None),
     ({"armed": None}, None)],
)  # fmt: skip
def test_a_flight_ends_when_something_it_needs_is_gone(told, why):
    said = _fault(Vehicle(**told).latest)
    assert (said is None) if why is None else (why in said)


@pytest.mark.parametrize(
    ("silent", "unplaced", "why"),
    [(2.9, 0.0, None), (3.1, 0.0, "no heartbeat for 3 s"), (0.0, 1.9, None), (0.0, 2.1, "no pos")],
)
def test_a_link_is_lost_without_heartbeats_or_positions(silent, unplaced, why):
    session = Vehicle()
    vehicle = LinkedVehicle(session, 0.3)
    session.silent_s, session.position_age_s = silent, unplaced
    if why is None:
        vehicle.check()
        return
    with pytest.raises(Exception, match=why):
        vehicle.check()


def test_position_targets_ask_for_positions_alone():
    """MAVLink's POSITION_TARGET_TYPEMASK: bits 0 to 2 are x, y, z; 9 is force."""
    assert POSITION_ONLY & 0b111 == 0
    assert POSITION_ONLY & 0b111_111_000 == 0b111_111_000
    assert POSITION_ONLY & (1 << 9) == 0
    assert POSITION_ONLY & (1 << 10)
    assert POSITION_ONLY & (1 << 11)


def test_a_vertex_at_the_surface_is_reached_at_a_decimetre():
    vehicle = LinkedVehicle(Vehicle(position=(1.0, 0.0, -0.1)), 0.05)
    assert vehicle._is_at(np.array([1.0, 0.0, 0.0]))
    assert not vehicle._is_at(np.array([1.06, 0.0, 0.0]))
    assert vehicle.yaw == 0.0
    assert LinkedVehicle(Vehicle(heading=0.0), 0.1).yaw == pytest.approx(math.pi / 2)


# repair


def test_goals_out_of_reach_or_built_over_are_left_out_with_the_reason(posts):
    short = posts.model_copy(update={"tether_length": 6.3})
    order, left_out = split_reachable(short, [0, 1])
    assert (order, left_out) == ([0, 1], [])
    none, why = split_reachable(posts.model_copy(update={"tether_length": 6.0}), [0, 1])
    assert none == []
    assert [g for g, _ in why] == [0, 1]
    over = posts.model_copy(
        update={"obstacles": (*posts.obstacles, Circle(center=(6, 1.15), radius=0.1))}
    )
    order, left_out = split_reachable(over, [0, 1])
    assert order == [1]
    assert left_out[0][0] == 0
    assert "stands on it" in left_out[0][1]


def legs_through(problem, *places):
    """Straight legs to goals in the order given, and home."""
    points = [np.array([0.0, 0.0, 0.0]), *(np.array([*p, 0.0]) for p in places)]
    goals = [*range(len(places)), HOME]
    points.append(points[0])
    return [
        Leg(g, np.array([a, b]), (), 0.0)
        for g, a, b in zip(goals, points[:-1], points[1:], strict=True)
    ]


def test_a_plan_is_broken_by_what_stands_in_its_way_and_by_a_short_tether(posts):
    problem = posts.model_copy(
        update={"goals": Problem(base=(0, 0), goals=[(1, 3), (3, 3)], tether_length=9).goals}
    )
    legs = legs_through(problem, (1, 3), (3, 3))
    start = np.zeros((2, 3))
    why, now = plan_fault(problem, start, legs)
    assert why is None
    assert [leg.tether for leg in now[:-1]] == pytest.approx([math.hypot(1, 3), math.hypot(3, 3)])
    wall = Circle(center=(2, 3.25), radius=0.1)  # 0.15 from the leg, with a clearance of 0.2
    blocked = problem.model_copy(update={"obstacles": (*problem.obstacles, wall)})
    assert "blocks the path" in plan_fault(blocked, start, legs)[0]
    clear = problem.model_copy(
        update={"obstacles": (*problem.obstacles, Circle(center=(2, 3.35), radius=0.1))}
    )
    assert plan_fault(clear, start, legs)[0] is None
    short = problem.model_copy(update={"tether_length": 4.2})
    assert "over the limit" in plan_fault(short, start, legs)[0]


def test_a_plan_that_ends_wound_around_something_is_broken(posts):
    around = [
        Leg(0, np.array([[0, 0, 0], [4, 1.5, 0], [6, 1, 0]], float), (), 0.0),
        Leg(1, np.array([[6, 1, 0], [6, -1, 0]], float), (), 0.0),
        Leg(HOME, np.array([[6, -1, 0], [4, -1.5, 0], [0, 0, 0]], float), (), 0.0),
    ]
    assert (
        plan_fault(posts, np.zeros((2, 3)), around)[0] == "the tether would not be free at the base"
    )


def test_a_robot_within_the_clearance_is_placed_just_outside(posts):
    x, y, _ = free_position(posts, np.array([2.9, 0.0, -1.0]))
    assert math.hypot(x - 4.0, y) == pytest.approx(1.2, abs=1e-4)
    assert math.hypot(x - 4.0, y) > 1.2
    assert free_position(posts, np.array([0.0, 5.0, -1.0])) == (0.0, 5.0, -1.0)
    square = Problem(
        base=(0, 0), goals=[(9, 9)], tether_length=20,
        obstacles=[Polygon(polygon=[(4, -1), (6, -1), (6, 1), (4, 1)])],
    )  # fmt: skip
    x, y, _ = free_position(square, np.array([4.2, 0.0, 0.0]))
    assert (x, y) == pytest.approx((4.0, 0.0), abs=1e-4)
    assert x < 4.0


def test_what_passes_is_told_with_its_times(posts):
    visitor = Circle(center=(2, 2), radius=0.3)
    later = posts.model_copy(update={"obstacles": (*posts.obstacles, visitor)})
    fewer = posts.model_copy(update={"obstacles": posts.obstacles[:1]})
    maps = [(0.0, posts), (5.0, later), (9.0, fewer)]
    assert lasting_problem(maps).obstacles == posts.obstacles[:1]
    found = {p.obstacle: (p.begin, p.end, p.when) for p in temporary_obstacles(maps)}
    assert found[visitor] == (5.0, 9.0, "5 to 9 s")
    assert found[posts.obstacles[1]] == (0.0, 9.0, "until 9 s")


# maps


def feature(shape, layer="", **properties):
    return Feature("features[0]", layer, "", properties, shape)


POINT, LINE = shapely.Point(0, 0), shapely.LineString([(0, 0), (1, 1)])
RING = shapely.LineString([(0, 0), (1, 0), (1, 1), (0, 0)])
AREA = shapely.box(0, 0, 1, 1)


@pytest.mark.parametrize(
    ("what", "kinds", "chart", "kind"),
    [
        (feature(POINT), {}, False, "goal"),
        (feature(POINT, radius_m=2.0), {}, False, "obstacle"),
        (feature(POINT, **{"seamark:type": "pile"}), {}, False, "obstacle"),
        (feature(AREA), {}, False, "obstacle"),
        (feature(AREA, "Basin"), {}, False, "bounds"),
        (feature(AREA, kind="bounds"), {}, False, "bounds"),
        (feature(AREA, "Basin"), {"basin": "obstacle"}, False, "obstacle"),
        (feature(POINT, "goals", kind="base"), {}, False, "base"),
        (feature(POINT, "goals", kind="base"), {"goals": "ignore"}, False, "ignore"),
        (feature(AREA, "OBSTRN"), {}, True, "obstacle"),
        (feature(AREA, "DEPARE"), {}, True, "ignore"),
        (feature(RING, kind="obstacle"), {}, False, "obstacle"),
        (feature(RING), {}, False, "obstacle"),
        (feature(LINE), {}, False, "obstacle"),
        (feature(LINE, kind="obstacle"), {}, False, "obstacle"),
        (feature(LINE, "cables"), {}, False, "path"),
        (feature(LINE), {"lines": "path"}, False, "path"),
        (feature(LINE, man_made="pier"), {"polygons": "ignore"}, False, "obstacle"),
        (feature(LINE, route="ferry"), {}, False, "path"),
        (feature(AREA, natural="water"), {}, False, "ignore"),
        (feature(AREA, natural="water", man_made="pier"), {}, False, "obstacle"),
        (feature(LINE, "SLCONS"), {}, True, "obstacle"),
        (feature(LINE, "CBLSUB"), {}, True, "path"),
    ],
)
def test_the_first_rule_that_fits_decides_what_a_feature_is(what, kinds, chart, kind):
    decision = kind_of(what, kinds, is_chart=chart)
    assert decision.kind == kind
    assert bool(decision.reason) == (kind == "ignore")


@pytest.mark.parametrize(
    "what",
    [
        feature(AREA, kind="base"), feature(POINT, kind="bounds"), feature(POINT, kind="tree"),
        feature(AREA, kind="path"),
    ],
)  # fmt: skip
def test_a_feature_of_an_impossible_kind_is_refused(what):
    with pytest.raises(InputError, match=r"features\[0\]"):
        kind_of(what, {}, is_chart=False)


def test_what_the_user_says_of_layers_and_columns_is_kept_apart():
    assert parse_mappings([("obstacle", "TURBINES"), ("name", "TURB_ID")]) == (
        {"turbines": "obstacle"}, {"name": "turb_id"},
    )  # fmt: skip
    with pytest.raises(InputError, match="before the ="):
        parse_mappings([("tree", "x")])


def test_north_and_east_lie_where_the_heading_puts_them():
    """With the y axis to the east, a place east of the base lies along y and one south along x."""
    pytest.importorskip("pyproj")
    plane = Projection(50.0, 8.0, 90.0)
    (east,) = plane.to_plane([[50.0, 8.001]])
    assert east == pytest.approx([0.0, 71.7], abs=0.1)
    (south,) = plane.to_plane([[49.999, 8.0]])
    assert south == pytest.approx([111.2, 0.0], abs=0.1)
    shifted = Projection(50.0, 8.0, 0.0, base=(100.0, 200.0))
    assert shifted.to_plane([[50.0, 8.0]])[0] == pytest.approx([100.0, 200.0])
    xy = np.array([[120.0, 180.0], [90.0, 500.0]])
    for projection in (shifted, plane):
        assert projection.to_plane(projection.to_earth(xy)) == pytest.approx(xy, abs=1e-6)
    with pytest.raises(InputError, match="within"):
        shifted.to_earth([[2e7, 0.0]])


def test_a_ring_of_many_corners_on_a_circle_is_one_that_holds_them():
    angles = np.linspace(0, 2 * math.pi, 24, endpoint=False)
    ring = np.column_stack([3 + 2 * np.cos(angles), 1 + 2 * np.sin(angles)])
    (x, y), radius = circle_of(ring)
    assert (x, y, radius) == pytest.approx((3.0, 1.0, 2.0))
    assert circle_of(ring[:15]) is None
    assert circle_of(ring * [1.0, 1.05]) is None
    bump = ring.copy()
    bump[0] += [0.02, 0.0]
    assert circle_of(bump) is None or circle_of(bump)[1] >= 2.02 - 1e-3
    assert circle_of(np.array([[0, 0], [4, 0], [4, 4], [0, 4]], float)) is None


def test_holes_are_filled_unless_something_must_stay_free_in_them():
    frame = shapely.Polygon(AREA.exterior, [shapely.box(0.4, 0.4, 0.6, 0.6).exterior])
    filled, notes = simple_polygons(frame, lambda hole: False)
    assert sum(p.area for p in filled) == pytest.approx(1.0)
    assert notes == ["1 hole with nothing to visit inside: filled"]
    cut, notes = simple_polygons(frame, lambda hole: True)
    assert sum(p.area for p in cut) == pytest.approx(0.96)
    assert all(not p.interiors for p in cut)
    assert notes == ["has a pool inside: cut into parts that touch"]
    bow = shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)])
    parts, notes = simple_polygons(bow, lambda hole: False)
    assert sum(p.area for p in parts) == pytest.approx(0.5)
    assert "repaired" in notes[0]


def test_a_plan_file_is_json_with_every_obstacle_fenced_out(posts, tmp_path):
    """Circles and polygons are exclusion fences, at their true radius."""
    pytest.importorskip("pyproj")
    from netsp.exchange.missions.mission_files import FORMATS

    square = Polygon(polygon=[(9, 9), (10, 9), (10, 10)])
    problem = posts.model_copy(update={"obstacles": (*posts.obstacles, square)})
    points = [Waypoint((0, 0, 0), None, start=True), Waypoint((6, 1, -2), 0)]
    plan = json.loads(FORMATS["plan"](problem, points, Projection(50.0, 8.0), ExportSettings()))
    fences = plan["geoFence"]
    assert [c["circle"]["radius"] for c in fences["circles"]] == [1.0, 0.5]
    assert len(fences["polygons"][0]["polygon"]) == 3
    assert not any(f["inclusion"] for f in (*fences["circles"], *fences["polygons"]))
    items = plan["mission"]["items"]
    assert [i["command"] for i in items] == [16, 178, 16]
    assert [i["doJumpId"] for i in items] == [1, 2, 3]
    assert items[2]["Altitude"] == -2
    assert items[2]["params"][0] == 5


# the judge


@pytest.fixture(scope="module")
def toured():
    """A problem with a tour around a post and a block, the path of which bends at both."""
    problem = Problem(
        base=(0, 0), goals=[(6, 0.5, -1), (6, -0.5, -2), (3, 4)], tether_length=7.2,
        clearance=0.1, bounds=(-2, -3, 8, 6),
        obstacles=[
            Circle(center=(4, 0), radius=1),
            Polygon(polygon=[(1, 2), (2, 2), (2, 3), (1, 3)]),
        ],
    )  # fmt: skip
    return problem, solve(problem)


def bent(solution, k, by):
    """A solution with one vertex of its path moved."""
    path = np.array(solution.path)
    path[k] += by
    return solution.model_copy(update={"path": tuple(map(tuple, path.tolist()))})


def with_path(solution, path):
    return solution.model_copy(update={"path": tuple(map(tuple, np.array(path).tolist()))})


def revisit(solution, k, **change):
    """A solution with one visit changed."""
    visits = list(solution.tour)
    visits[k] = visits[k].model_copy(update=change)
    return solution.model_copy(update={"tour": tuple(visits)})


def failed(problem, solution):
    return {c.name for c in verify(problem, solution).checks if not c.passed}


def test_the_judge_accepts_the_tour(toured):
    assert failed(*toured) == set()


def test_the_judge_sees_a_path_a_centimetre_inside_an_obstacle(toured):
    """The bend that lies on the post is moved towards its centre."""
    problem, solution = toured
    path = np.array(solution.path)
    rim = np.hypot(path[:, 0] - 4, path[:, 1]) - 1.1
    k = int(np.argmin(np.where(rim < 0.02, path[:, 0], np.inf)))
    inward = np.array([4.0 - path[k, 0], -path[k, 1], 0.0])
    inward *= 0.011 / np.linalg.norm(inward)
    assert "enters no obstacle" in failed(problem, bent(solution, k, inward + rim[k] * inward))


@pytest.mark.parametrize("clearance", [0.0, 0.1])
def test_the_judge_sees_a_path_through_the_edge_of_a_block(toured, clearance):
    """The distance to a polygon without clearance is 0 inside it as on its edge, so the judge has
    to look for paths inside it by other means."""
    problem, solution = toured
    if clearance != problem.clearance:
        problem = problem.model_copy(update={"clearance": clearance})
        solution = solve(problem)
    path = np.array(solution.path)
    home = len(path) - 1
    detour = [path[home], [0.8, 2.5, 0.0], [1.01, 2.5, 0.0], [0.8, 2.5, 0.0], path[home]]
    assert "enters no obstacle" in failed(problem, with_path(solution, [*path[:home], *detour]))


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("starts and ends at the base", lambda s: bent(s, 0, (0.01, 0, 0))),
        ("starts and ends at the base", lambda s: bent(s, -1, (0, 0.01, 0))),
        ("names every goal once", lambda s: s.model_copy(update={"tour": s.tour[:-1]})),
        ("names every goal once", lambda s: revisit(s, 0, goal=s.tour[1].goal, position=None)),
        ("visits every goal in order", lambda s: s.model_copy(update={"tour": s.tour[::-1]})),
        ("names every goal once", lambda s: s.model_copy(
            update={"tour": (*s.tour, s.tour[0])})),
        ("visits every goal in order", lambda s: revisit(
            s, 0, position=tuple(v + 0.1 for v in s.tour[0].position))),
        ("tether word at every goal", lambda s: revisit(s, 0, signature=(1, 2))),
        ("taut lengths as stated", lambda s: revisit(s, 1, tether_length=0.9
                                                     * s.tour[1].tether_length)),
        ("taut lengths as stated", lambda s: revisit(s, 1, tether_length=1.01
                                                     * s.tour[1].tether_length)),
        ("length is right", lambda s: s.model_copy(update={"length": 0.9995 * s.length})),
        ("length is right", lambda s: with_path(
            s, [s.path[0], (-0.2, 0.0, 0.0), *s.path])),
        ("length is right", lambda s: s.model_copy(update={"length": 1.01 * s.length})),
        ("stays within bounds", lambda s: with_path(s, [*s.path[:-1], (-2.1, 0.0, 0.0),
                                                        s.path[-1]])),
        ("bound, gap and status agree", lambda s: s.model_copy(update={"lower_bound": 1.1
                                                                       * s.length})),
        ("bound, gap and status agree", lambda s: s.model_copy(
            update={"status": Status.FEASIBLE, "lower_bound": 0.9 * s.length, "gap": 0.05})),
        ("bound, gap and status agree", lambda s: s.model_copy(
            update={"lower_bound_of": Scope.TRAVEL_GRAPH})),
        ("bound, gap and status agree", lambda s: s.model_copy(
            update={"lower_bound": 0.5 * s.length, "gap": 0.5})),
        ("bound, gap and status agree", lambda s: s.model_copy(
            update={"status": Status.INFEASIBLE})),
    ],
)  # fmt: skip
def test_the_judge_names_what_is_wrong(toured, name, change):
    problem, solution = toured
    assert name in failed(problem, change(solution))


def test_the_judge_sees_a_tether_that_is_too_short_at_a_goal(toured):
    problem, solution = toured
    longest = max(v.tether_length for v in solution.tour)
    short = problem.model_copy(update={"tether_length": longest - 1e-3})
    claimed = solution.model_copy(
        update={"problem": solution.problem.model_copy(update={"sha256": short.sha256})}
    )
    assert failed(short, claimed) == {"taut tether fits"}


def test_the_judge_sees_a_tether_that_is_too_short_between_goals(toured):
    """A spur out to the corner (7.9, -2.9) needs 8.4 m of 7.2; at the goals nothing changes."""
    problem, solution = toured
    path = np.array(solution.path)
    k = 1 + int(np.argmin(np.linalg.norm(path - problem.points[2], axis=1)))
    there = [[7.9, -2.9, -2.0], path[k - 1]]
    spur = with_path(solution, [*path[:k], *there, *path[k:]])
    assert "taut tether fits" in failed(problem, spur)


def test_the_judge_sees_a_path_that_comes_home_wound(toured):
    """A lap around the block at the end leaves its letter."""
    problem, solution = toured
    lap = [(0.5, 1.5, 0), (2.5, 1.5, 0), (2.5, 3.5, 0), (0.5, 3.5, 0), (0.5, 1.5, 0), (0, 0, 0)]
    assert "total word is empty" in failed(problem, with_path(solution, [*solution.path, *lap]))


def test_the_judge_takes_no_other_problem(toured):
    problem, solution = toured
    other = problem.model_copy(update={"tether_length": 9.0})
    assert "belongs to the problem" in failed(other, solution)


def test_every_mutant_of_the_list_still_applies():
    """`benchmarks/mutants.py` replaces text that stands exactly once in its file."""
    root = Path(__file__).parent.parent
    rows = tomllib.loads((root / "benchmarks" / "mutants.toml").read_text())["mutant"]
    assert len(rows) >= 68
    stale = [r["name"] for r in rows if (root / r["file"]).read_text().count(r["old"]) != 1]
    assert stale == []
    assert len({(r["file"], r["new"], r["old"]) for r in rows}) == len(rows)
