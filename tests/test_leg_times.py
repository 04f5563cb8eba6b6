"""Predicted times of legs against closed forms, laws and recorded flights of ArduSub."""

import csv
import gzip
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Problem, Solution
from netsp.base.errors import InputError
from netsp.exchange.missions.leg_times import SmoothMove, VehicleMotion, leg_times, target_times
from netsp.exchange.missions.mission_files import ExportSettings, altitude, predicted_s, start_of
from netsp.exchange.missions.waypoints import Waypoint, waypoints_of
from netsp.online.execute.execution_log import ExecutionRow
from netsp.online.fly.flight_time import FlightClock, FlightTime, predicted_flight
from netsp.plan.tour_plan import HOME, legs_of
from tests.autopilot import Earth
from tests.recorded_flights import log, track

DATA = Path(__file__).parent / "data"
PROBLEMS = Path(__file__).parent.parent / "problems"
PLAIN = VehicleMotion()
lengths, speeds = st.floats(0.05, 30.0), st.floats(0.1, 2.0)


def leg_s(run: float, speed: float, rise: float = 0.0) -> float:
    return leg_times([(0.0, 0.0, -40.0), (run, 0.0, -40.0 + rise)], [0.0, 0.0], speed)[0]


# the move from rest to rest


def test_a_move_whose_jerk_has_no_limit_is_a_trapezoid_or_a_triangle():
    """Without a limit of jerk a move takes length / speed + speed / acceleration, or twice the root
    of length / acceleration where it never gets to its speed."""
    motion = VehicleMotion(max_jerk=1e9, input_time_s=1e-9)
    assert SmoothMove(10.0, 0.0, 2.0, motion).duration_s == pytest.approx(10 / 2 + 2 / 2.5)
    assert SmoothMove(1.0, 0.0, 2.0, motion).duration_s == pytest.approx(2 * math.sqrt(1 / 2.5))


def test_a_move_limited_by_jerk_takes_the_time_of_its_ramps():
    """With ramps alone a speed takes twice its root over the jerk, and the time of the jerk itself
    is added to each ramp."""
    quick = VehicleMotion(input_time_s=1e-9)
    assert SmoothMove(10.0, 0.0, 0.5, quick).duration_s == pytest.approx(20 + 2 * math.sqrt(0.5))
    peak = 0.5 * (math.sqrt(0.3**2 + 4 * 0.5) - 0.3)  # acceleration x (acceleration + 0.3) = speed
    usual = SmoothMove(10.0, 0.0, 0.5, PLAIN)
    assert usual.acceleration == pytest.approx(peak)
    assert usual.duration_s == pytest.approx(20 + 0.5 / peak + peak + 0.3)


def test_the_slower_of_plan_and_depth_decides():
    """Straight down a move has the speed of descent, up that of ascent, and on a slope neither the
    plan's nor the vertical limit is passed."""
    down, up = SmoothMove(0.0, -40.0, 0.5, PLAIN), SmoothMove(0.0, 40.0, 0.5, PLAIN)
    assert (down.top_speed, up.top_speed) == (1.5, 2.5)
    slope = SmoothMove(10.0, 10.0, 0.5, PLAIN)
    assert slope.top_speed == pytest.approx(0.5 * math.sqrt(2.0))
    steep = SmoothMove(1.0, -30.0, 2.0, PLAIN)
    assert steep.top_speed * 30.0 / steep.length == pytest.approx(1.5)


@settings(max_examples=30)
@given(lengths, st.floats(-20.0, 20.0), speeds)
def test_a_move_keeps_its_limits_and_ends_at_rest(run: float, rise: float, speed: float):
    """Distance is the integral of speed, and neither speed nor acceleration is above its limit."""
    move = SmoothMove(run, rise, speed, PLAIN)
    times = np.linspace(0.0, move.duration_s, 2001)
    far, fast = np.array([move.at(t) for t in times]).T
    step = times[1]
    assert far[0] == fast[0] == fast[-1] == 0.0
    assert far[-1] == pytest.approx(move.length)
    assert np.allclose(np.diff(far), 0.5 * step * (fast[1:] + fast[:-1]), atol=1e-4 * move.length)
    assert fast.max() * run / move.length <= speed * (1 + 1e-9)
    assert (np.abs(np.diff(fast)) / step).max() * run / move.length <= 2.5 * (1 + 1e-6)


# laws of legs


@settings(max_examples=15)
@given(lengths, lengths, speeds)
def test_a_leg_takes_longer_than_a_shorter_one_and_than_at_full_speed(a, b, speed):
    """Time grows with length, and is never below length / speed."""
    short, long = sorted((a, b))
    times = leg_s(short, speed), leg_s(long, speed)
    assert times[0] <= times[1] + 1.5 * PLAIN.step_s
    assert times[0] > short / speed


@settings(max_examples=15)
@given(lengths, lengths, speeds, st.floats(-1.0, 1.0))
def test_two_legs_in_line_are_never_faster_than_one(a, b, speed, slope):
    """A stop on the way costs time."""
    places = [(s, 0.0, -40.0 + slope * s) for s in (0.0, a, a + b)]
    two = sum(leg_times(places, [0.0] * 3, speed))
    assert two >= leg_times([places[0], places[2]], [0.0] * 2, speed)[0]


def test_a_hold_is_added_to_the_leg_before_it():
    """Holds add their seconds, and a mission begins with the hold at its first waypoint."""
    points = [Waypoint((0, 0, -1), None, start=True), Waypoint((0, 0, -1), None)]
    assert predicted_s(points, ExportSettings(bend_hold_s=9)) == pytest.approx(9 + 9, abs=0.5)
    assert predicted_s(points, ExportSettings(speed=None)) is None


@pytest.mark.parametrize("speed", [1e-3, 0.05, 20.0])
def test_legs_of_any_speed_and_length_are_predicted_soon(speed):
    """Times are finite for slow vehicles and for speeds above those that the thrust allows."""
    times = leg_times([(0, 0, -1), (1, 0, -1), (1e5, 0, -1)], [0.0] * 3, speed)
    fastest = math.sqrt(PLAIN.full_thrust / PLAIN.drag)
    assert times[1] == pytest.approx(1e5 / min(speed, fastest), rel=0.01)


@pytest.mark.parametrize("wrong", [{"drag": 0.0}, {"max_jerk": -1.0}, {"step_s": 0.5}])
def test_motion_out_of_range_is_refused(wrong):
    """Every number is positive and the step is short."""
    with pytest.raises(InputError, match=next(iter(wrong))):
        VehicleMotion(**wrong)


# recorded flights


def test_the_recorded_mission_in_space_takes_as_long_as_predicted():
    """127 waypoints, most 0.25 m apart: the total within 5 %, a leg within 1.5 s."""
    plan = json.loads(gzip.decompress((DATA / "ardusub47" / "e-m-basin.plan.gz").read_bytes()))
    earth = Earth(55.6, 12.95)
    said = [(m["t"], m["Message"]) for m in log("auto-space-basin")["MSG"]]
    reached = {int(text.split("#")[1]): t for t, text in said if text.startswith("Reached")}
    items = [(k, i["params"]) for k, i in enumerate(plan["mission"]["items"], 1)
             if i["command"] == 16]  # fmt: skip
    places = [
        (*earth.local(round(p[4] * 1e7), round(p[5] * 1e7)), p[6]) for _, p in items
    ]  # fmt: skip
    flown = np.diff([reached[k] for k, _ in items])
    predicted = np.array(leg_times(places, [p[0] for _, p in items], 0.5))
    assert predicted.sum() == pytest.approx(flown.sum(), rel=0.05)
    assert np.abs(predicted - flown).max() < 1.5


@pytest.mark.parametrize("name", ["wharf", "pool", "oc4-jacket", "r1", "r4"])
def test_recorded_missions_take_as_long_as_predicted(name):
    """The total within 5 %, and a leg within 2.5 s."""
    folder = DATA / "ardusub"
    own = folder / f"problem-{name}.json"
    problem = Problem.load(own if own.exists() else PROBLEMS / f"{name}.json")
    solution = Solution.load(folder / f"tour-{name}.json")
    points = waypoints_of(problem, solution)
    with gzip.open(folder / f"ardusub-{name}.csv.gz", "rt") as stream:
        rows = list(csv.DictReader(stream))
    flown = np.diff([float(r["t"]) for r in rows[:1] + [r for r in rows if r["reached"]]])
    # these missions began with the way to the first goal, without a held start
    places = [start_of(problem, solution).position] + [
        (*p.position[:2], altitude(p.position[2])) for p in points
    ]
    holds = [0] + [1 if p.goal in (None, HOME) else 5 for p in points]
    predicted = np.array(leg_times(places, holds, 0.5))
    assert predicted.sum() == pytest.approx(flown.sum(), rel=0.05)
    assert np.abs(predicted - flown).max() < 2.5


def test_the_recorded_flight_from_target_to_target_takes_as_long_as_predicted():
    """The tour of the wharf in GUIDED, with targets that were sent again every 2 s."""
    problem = Problem.load(PROBLEMS / "wharf.json")
    solution = Solution.load(DATA / "ardusub47" / "t-wharf.json")
    path = np.vstack([leg.path for leg in legs_of(problem, solution)])
    places = [(float(x), float(y), altitude(float(z))) for x, y, z in path]
    rows = track("fly-wharf")
    late = rows[rows[:, 0] > 150.0]
    home = late[np.linalg.norm(late[:, 4:7] - places[-1], axis=1) <= 0.3][0, 0]
    predicted = sum(target_times(places, 0.3, 0.5, notice_s=0.1, repeat_s=2.0))
    assert predicted == pytest.approx(home - 60.4, rel=0.05)
    assert predicted_flight(problem, solution, 0.5, 0.3).total_s > predicted


# a flight under way


def test_the_total_of_a_flight_follows_what_was_flown_until_the_plan_changes():
    """At each goal the total is the time flown and the legs that are left; a goal out of its turn
    ends it."""

    def row(time: float, goal: int) -> ExecutionRow:
        return ExecutionRow(time, 0.0, 0.0, 0.0, goal, "tour", 1.0, 9.0, False)

    clock = FlightClock(FlightTime((4, 2, HOME), (10.0, 20.0, 5.0)))
    seen = [(0, 4), (12, 2), (29, 2), (31, HOME), (40, HOME)]
    assert [clock.total_s(row(t, g)) for t, g in seen] == [35.0, 37.0, 37.0, 36.0, 40.0]
    clock = FlightClock(FlightTime((4, 2, HOME), (10.0, 20.0, 5.0)))
    assert [clock.total_s(row(t, g)) for t, g in [(0, 4), (3, HOME), (9, 2)]] == [35.0, None, None]
