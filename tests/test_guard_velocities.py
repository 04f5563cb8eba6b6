"""Velocities that a vehicle tells: used once it has gone as it said, and never otherwise."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, Problem
from netsp.model.problem import Origin
from netsp.online.guard.position_track import Track
from netsp.online.guard.replay import read_fixes
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard
from netsp.online.guard.velocities import VelocityCheck
from netsp.online.link.dialect import dialect, parser
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import Listener
from netsp.online.link.udp import messages_in

SITE = Problem(
    base=(0, 0), goals=[(9, 0, -1)], tether_length=30,
    obstacles=[Circle(center=(5, 0), radius=0.5, name="A")],
)  # fmt: skip


def drive(seconds, noise=0.3, wide=2.0, seed=0):
    """Times, true places and velocities, and noisy estimates of both: straight on, then round a
    circle."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, seconds, 0.1)
    courses = np.where(times < 10.0, 0.0, 0.5 * (times - 10.0) / wide)
    speeds = 0.5 * np.column_stack([np.cos(courses), np.sin(courses), np.zeros(len(times))])
    places = np.cumsum(0.1 * speeds, axis=0) - (1.0, 2.0, 0.0)
    return (
        times, places, speeds, places + rng.normal(0.0, noise, places.shape),
        speeds + rng.normal(0.0, 0.1, speeds.shape),
    )  # fmt: skip


@given(seed=st.integers(0, 10**6), wide=st.floats(1.0, 20.0), course=st.floats(0.0, 6.3))
@settings(max_examples=40, deadline=None)
def test_true_velocities_are_believed_after_some_metres_and_stay_so(seed, wide, course):
    times, _, _, places, speeds = drive(40.0, wide=wide, seed=seed)
    c, s = math.cos(course), math.sin(course)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    velocities, since = VelocityCheck(0.3, 0.5), None
    for t, place, speed in zip(times, places @ turn, speeds @ turn, strict=True):
        velocities.observe(t, place[:2], speed[:2])
        if velocities.is_believed and since is None:
            since = t
        assert since is None or velocities.is_believed
    assert since is not None
    assert since < 10.0


@pytest.mark.parametrize(
    "wrong",
    [lambda v: 0.0 * v, lambda v: -v, lambda v: 2.5 * v, lambda v: v[:, [1, 0, 2]] * (1, -1, 1)],
)
def test_velocities_by_which_the_vehicle_did_not_go_are_not_believed(wrong):
    for seed in range(20):
        times, _, _, places, speeds = drive(40.0, seed=seed)
        velocities = VelocityCheck(0.3, 0.5)
        for t, place, speed in zip(times, places, wrong(speeds), strict=True):
            velocities.observe(t, place[:2], speed[:2])
            assert not velocities.is_believed


def test_belief_is_lost_when_the_vehicle_goes_otherwise_and_comes_back():
    times, _, _, places, speeds = drive(60.0)
    velocities, believed = VelocityCheck(0.3, 0.5), {}
    for t, place, speed in zip(times, places, speeds, strict=True):
        velocities.observe(t, place[:2], np.zeros(2) if 20.0 <= t < 35.0 else speed[:2])
        believed[round(t)] = velocities.is_believed
    assert believed[19]
    assert not believed[26]
    assert not believed[34]
    assert believed[59]


def test_a_vehicle_that_says_zero_whatever_it_does_is_one_that_says_nothing():
    times, _, _, places, _ = drive(30.0)
    silent, zero = Guard(SITE), Guard(SITE)
    for t, place in zip(times, places, strict=True):
        one = silent.update(Fix(t, tuple(place), estimate=True))
        other = zero.update(Fix(t, tuple(place), estimate=True, velocity=(0.0, 0.0, 0.0)))
        assert one.as_row() == other.as_row()


@pytest.mark.parametrize("noise", [0.0, 0.3, 1.0, 3.0])
@pytest.mark.parametrize("speed", [0.05, 0.3, 0.5, 2.0])
def test_zero_is_never_believed_whatever_the_noise_and_the_speed(noise, speed):
    for seed in range(5):
        times, _, _, places, _ = drive(60.0, noise=noise, seed=seed)
        velocities = VelocityCheck(noise, speed)
        for t, place in zip(times, places, strict=True):
            velocities.observe(t, place[:2], np.zeros(2))
            assert not velocities.is_believed


def test_one_that_freezes_at_zero_is_found_out_before_the_place_is_off_by_a_metre():
    for seed in range(10):
        times, true, _, places, speeds = drive(30.0, seed=seed)
        track = Track(0.3, 0.5)
        for t, place, speed, real in zip(times, places, speeds, true, strict=True):
            said = np.zeros(3) if t > 20.0 else speed
            motion = track.observe(Fix(t, tuple(place), velocity=tuple(said)))
            if 19.0 < t < 20.0:
                assert track.velocities.is_believed
            if t > 20.0:
                assert np.linalg.norm((motion.after - real)[:2]) < 1.0
        assert not track.velocities.is_believed


@given(
    seed=st.integers(0, 1000), wrong=st.tuples(st.floats(-100, 100), st.floats(-100, 100)),
    at=st.floats(8.0, 28.0),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_a_single_wrong_velocity_moves_a_robot_by_centimetres_at_most(seed, wrong, at):
    times, _, _, places, speeds = drive(30.0, seed=seed)
    good, bad = Track(0.3, 0.5), Track(0.3, 0.5)
    k = int(np.searchsorted(times, at))
    for i, (t, place, speed) in enumerate(zip(times, places, speeds, strict=True)):
        one = good.observe(Fix(t, tuple(place), velocity=tuple(speed)))
        said = (*wrong, 0.0) if i == k else tuple(speed)
        other = bad.observe(Fix(t, tuple(place), velocity=said))
        assert np.linalg.norm(one.after - other.after) < 0.1
        assert np.linalg.norm(one.velocity - other.velocity) < 0.35


def test_what_is_said_of_going_up_or_down_has_no_effect():
    times, _, _, places, speeds = drive(30.0)
    one, other = Track(0.3, 0.5), Track(0.3, 0.5)
    for t, place, speed in zip(times, places, speeds, strict=True):
        a = one.observe(Fix(t, tuple(place), velocity=tuple(speed)))
        b = other.observe(Fix(t, tuple(place), velocity=(*speed[:2], 9.0)))
        assert (a.after == b.after).all()
        assert (a.velocity == b.velocity).all()


@pytest.mark.parametrize("pause", ["gap", "silence", "restart"])
def test_after_a_pause_velocities_have_to_prove_themselves_again(pause):
    times, _, _, places, speeds = drive(60.0)
    track = Track(0.3, 0.5)
    for t, place, speed in zip(times, places, speeds, strict=True):
        if 20.0 <= t < 25.0 and pause == "gap":
            continue
        if pause == "restart" and abs(t - 20.0) < 0.05:
            track.invalidate(t)
        said = None if 20.0 <= t < 25.0 and pause == "silence" else tuple(speed)
        track.observe(Fix(t, tuple(place), velocity=said))
        if 19.0 < t < 19.5:
            assert track.velocities.is_believed
        if 23.0 < t < 24.0 or (25.0 <= t < 26.0 and pause != "restart"):
            assert not track.velocities.is_believed
    assert track.velocities.is_believed


def test_with_velocities_a_course_and_its_turning_are_known_better_and_sooner():
    off = {False: [], True: []}
    turning = {False: [], True: []}
    for seed in range(20):
        times, _, true, places, speeds = drive(30.0, seed=seed)
        for told, errors in off.items():
            track, seen = Track(0.3, 0.5), None
            for t, place, speed, real in zip(times, places, speeds, true, strict=True):
                motion = track.observe(
                    Fix(t, tuple(place), velocity=tuple(speed) if told else None)
                )
                if t > 12.0:
                    errors.append(np.linalg.norm(motion.velocity - real))
                if t > 10.0 and seen is None and motion.turn > 0.125:  # half of what it does
                    seen = t - 10.0
            turning[told].append(seen)
    assert np.mean(off[True]) < 0.6 * np.mean(off[False])
    assert np.median(turning[True]) < np.median(turning[False]) - 0.5


@given(
    heading=st.floats(0.0, 360.0), v=st.tuples(*[st.floats(-5.0, 5.0)] * 3),
    place=st.tuples(*[st.floats(-50.0, 50.0)] * 3),
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_a_velocity_is_by_how_much_a_place_changes_in_a_second(heading, v, place):
    frame = Frame(
        SITE.model_copy(update={"origin": Origin(latitude=55.5, longitude=12.7, heading=heading)}),
        "local",
    )
    after = tuple(a + b for a, b in zip(place, v, strict=True))
    went = np.subtract(frame.from_local(*after), frame.from_local(*place))
    assert frame.velocity(*v) == pytest.approx(tuple(went), abs=1e-9)


def test_messages_tell_velocities_with_places_and_nonsense_is_none():
    m, packs = dialect(), parser(1, 1)
    turned = SITE.model_copy(update={"origin": Origin(latitude=55.5, longitude=12.7, heading=30.0)})
    said = {}
    for kind, message in (
        ("local", m.MAVLink_local_position_ned_message(1000, 1, 2, 3, 0.3, -0.2, 0.1)),
        ("global", m.MAVLink_global_position_int_message(
            1000, 555000000, 127000000, 0, 0, 30, -20, 10, 0)),
    ):  # fmt: skip
        listener = Listener(Frame(turned, kind), 1)
        (read,) = messages_in(message.pack(packs))
        said[kind] = listener.read(read).velocity
        assert said[kind] == pytest.approx(Frame(turned, kind).velocity(0.3, -0.2, 0.1), abs=1e-6)
    assert said["local"] == pytest.approx(said["global"], abs=1e-6)
    for bad in (math.nan, math.inf, 1e9):
        (read,) = messages_in(
            m.MAVLink_local_position_ned_message(1000, 1, 2, 3, 0.3, bad, 0.1).pack(packs)
        )
        fix = Listener(Frame(SITE), 1).read(read)
        assert fix.position is not None
        assert fix.velocity is None


def test_tables_tell_velocities_in_the_frame_of_their_places(tmp_path):
    for columns, expected in (
        ("t,x,y,z,vx,vy,vz", (1.0, 2.0, 3.0)), ("t,north,east,down,vx,vy,vz", (2.0, 1.0, -3.0)),
        ("t,x,y,z,vx,vy", (1.0, 2.0, 0.0)), ("t,x,y,z,vx", None),
    ):  # fmt: skip
        file = tmp_path / "a.csv"
        row = ["0", "0", "0", "0", "1", "2", "3"][: columns.count(",") + 1]
        file.write_text(f"{columns}\n{','.join(row)}\n")
        (fix,) = read_fixes(file, Frame(SITE))
        assert fix.velocity == (None if expected is None else pytest.approx(expected))
