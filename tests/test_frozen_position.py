"""A position that repeats while the robot moves is noticed at once, and widened; one that repeats
because the robot is at rest is not."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InputError, Problem
from netsp.online.guard.guard_policy import FreezePolicy
from netsp.online.guard.position_track import Track
from netsp.online.guard.stream import replay_fixes
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard, GuardOptions
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import Listener

pytest.importorskip("pymavlink")

from tests.autopilot import Simulation

SITE = Problem(
    base=(0, 0), goals=[(9, 0, -1)], tether_length=30,
    obstacles=[Circle(center=(6, 1.5), radius=0.3, name="pile")],
)  # fmt: skip


def watched(fixes):
    """Reports of a guard."""
    return list(replay_fixes(Guard(SITE, GuardOptions(noise=0.05, drift=0.1)), fixes))


def told(reports, kind):
    """Seconds at which an alarm of a kind was raised."""
    return [r.time for r in reports for a in r.raised if a.kind == kind]


def fixes_of(simulation, seconds, until=lambda: None):
    """Return the fixes that come from a vehicle in some seconds."""
    listener, out, end = Listener(Frame(SITE, "local"), 1), [], simulation.now + seconds
    while simulation.now < end:
        until()
        simulation.step()
        for message in simulation.wire.messages():
            fix = listener.read(message)
            if fix is not None:
                out.append(fix)
    return out


def flown(to=(9.0, 0.0, -1.0)):
    """A fake ArduSub that is on its way along the x axis."""
    simulation = Simulation(start=(0.0, 0.0, -1.0), seed=3)
    simulation.fly()
    simulation.go(to)
    return simulation


def test_an_estimate_that_freezes_on_the_way_is_told_within_two_seconds_and_widened():
    simulation = flown()
    fixes = fixes_of(simulation, 10.0)
    frozen_at = simulation.now
    simulation.do(do="freeze")  # its messages have a velocity of 0 from here on
    fixes += fixes_of(simulation, 8.0)
    reports = watched(fixes)
    (first,) = told(reports, "position")
    assert frozen_at < first < frozen_at + 2.0
    at_once = next(r for r in reports if r.time >= first)
    assert at_once.drift > 0.4
    assert at_once.claims
    assert not reports[-1].claims
    assert told(reports, "estimate")[0] < frozen_at + 3.0
    simulation.do(do="restore_estimate")
    again = watched(fixes + fixes_of(simulation, 5.0))
    assert again[-1].claims
    assert again[-1].drift == 0.1


def test_a_vehicle_that_stops_at_its_goal_and_rests_there_is_not_frozen():
    simulation = flown(to=(4.0, 0.0, -1.0))
    reports = watched(fixes_of(simulation, 30.0))
    assert simulation.vehicle.body.arrived
    assert not told(reports, "position") + told(reports, "estimate")
    assert {r.drift for r in reports} == {0.1}


def row(t, x, v=None, z=-1.0):
    velocity = None if v is None else (v, 0.0, 0.0)
    return Fix(t, (x, 0.0, z), velocity=velocity, estimate=True)


@pytest.mark.parametrize(
    ("after", "within"),
    [
        (lambda t: row(t, 2.0, 0.4), 1.2),  # the velocity says that it moves
        (lambda t: row(t, 2.0, 0.4, z=-1.0 - 0.01 * t), 1.2),  # depth comes from pressure
        (lambda t: row(t, 2.0), 3.2),  # no velocity: it stopped dead
        (lambda t: row(t, 2.0, 0.0), 3.2),
    ],
    ids=["moves", "moves, depth changes", "no velocity", "stopped dead"],
)
def test_every_frozen_position_is_told_and_later_nothing_is_claimed(after, within):
    velocity = after(0.0).velocity
    before = [row(0.1 * k, 0.04 * k, None if velocity is None else 0.4) for k in range(51)]
    reports = watched(before + [after(5.1 + 0.1 * k) for k in range(60)])
    first = min(told(reports, "position") + told(reports, "estimate"))
    assert 5.0 < first < 5.0 + within
    assert not reports[-1].claims


def test_a_position_that_never_changes_while_the_velocity_does_not_is_frozen_from_the_beginning():
    moving = watched([row(0.1 * k, 2.0, 0.3) for k in range(40)])
    assert told(moving, "position")[0] < 1.5
    resting = watched([row(0.1 * k, 2.0, 0.0) for k in range(80)])
    assert not told(resting, "position") + told(resting, "estimate")


@given(st.integers(0, 10_000), st.sampled_from([0.001, 0.011, 0.1]))
@settings(max_examples=15, deadline=None)
def test_a_robot_that_slows_down_and_rests_is_not_frozen_however_its_position_is_rounded(
    seed, step
):
    import random

    chance, track, x, v = random.Random(seed), Track(0.05, 0.5), 0.0, 0.4
    for k in range(250):
        v = 0.4 if k < 60 else 0.95 * v
        x += 0.1 * v
        told = v + chance.gauss(0.0, 0.02)
        track.observe(row(0.1 * k, round(x / step) * step, told))
        assert not track.is_frozen, k


def test_a_slow_sensor_repeats_its_position_between_two_measurements():
    track = Track(0.05, 0.5)
    frozen = []
    for k in range(300):
        t = 0.1 * k
        track.observe(row(t, 0.4 * (t // 0.9) * 0.9, 0.4))
        frozen.append(track.is_frozen)
    assert not any(frozen)


def test_a_policy_out_of_range_is_refused():
    nan = float("nan")
    for wrong in ({"min_repeat_s": 0.0}, {"max_periods": 0.5}, {"min_reported_travel": nan}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            FreezePolicy(**wrong)
