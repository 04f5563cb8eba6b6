"""A position estimate that has lost its source is noticed before it drifts."""

from types import SimpleNamespace

import numpy as np
import pytest

from netsp import Problem, solve
from netsp.online.execute.execution_log import ExecutionOptions
from netsp.online.execute.tour_execution import StopsFlightError
from netsp.online.fly import tour_flight
from netsp.online.fly.standby import stand_by
from netsp.online.fly.tour_flight import fly
from netsp.online.fly.vehicle import LinkedVehicle
from netsp.online.link.position_aiding import PositionAiding
from tests.scripted_vehicle import Scripted, driven
from tests.simulated_session import SimulatedSession

SITE = Problem(base=(0, 0), goals=[(9, 2, -1), (9, -2, -1)], tether_length=15)
OPTIONS = ExecutionOptions(speed=0.5, reach=0.3)


@pytest.fixture(scope="module")
def tour():
    return solve(SITE)


@pytest.fixture(autouse=True)
def rehearsed(monkeypatch):
    monkeypatch.setattr(tour_flight, "rehearse", lambda: None)


@pytest.mark.parametrize(
    ("what", "why"),
    [
        ({"do": "lose_estimate"}, "the GPS has no fix"),
        ({"do": "lose_estimate", "silent": True}, "the GPS is silent"),
        ({"do": "gps_jump", "by": [0, 5.6]}, "rejects its position"),
    ],
)
@pytest.mark.parametrize("when", [4.0, 13.0])
def test_a_lost_gps_stops_the_flight_within_two_seconds_and_then_nothing_follows_the_estimate(
    tour, what, why, when
):
    session, begun = SimulatedSession(SITE).arm(), []

    def befall(row):
        if row.time >= when and not begun:
            begun.append(session.simulation.now)
            session.simulation.do(**what)

    done = fly(SITE, tour, session, OPTIONS, on_step=befall)
    assert why in done.stopped
    assert done.rows[-1].time - when < 2.0
    at = session.truth[-1, 1:3]
    end = session.simulation.now
    stand_by(session, should_stop=lambda: session._seconds() > end + 30.0)
    assert session.simulation.vehicle.mode == 2  # ALT_HOLD
    assert session.heard("disarmed") == []
    assert np.linalg.norm(session.truth[-1, 1:3] - at) < 1.0


def test_a_gps_that_is_back_in_time_leaves_the_vehicle_held(tour):
    session, begun = SimulatedSession(SITE).arm(), []

    def befall(row):
        if row.time >= 6.0 and not begun:
            begun.append(session.simulation.now)
            session.simulation.do(do="lose_estimate")
            flown = session.sleep

            def restoring(seconds):
                flown(seconds)
                if session.simulation.now > begun[0] + 2.0 and len(begun) == 1:
                    begun.append(0.0)
                    session.simulation.do(do="restore_estimate")

            session.sleep = restoring

    done = fly(SITE, tour, session, OPTIONS, on_step=befall)
    assert "the GPS has no fix" in done.stopped
    end = session.simulation.now
    stand_by(session, should_stop=lambda: session._seconds() > end + 20.0)
    assert session.simulation.vehicle.mode == 4


def gps(fix):
    return SimpleNamespace(get_type=lambda: "GPS_RAW_INT", fix_type=fix)


def status(works, enabled=0x80 | 0x20):
    return SimpleNamespace(
        get_type=lambda: "SYS_STATUS", onboard_control_sensors_enabled=enabled,
        onboard_control_sensors_health=works,
    )  # fmt: skip


def ekf(position, velocity=0.01):
    return SimpleNamespace(
        get_type=lambda: "EKF_STATUS_REPORT", pos_horiz_variance=position,
        velocity_variance=velocity,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("told", "why"),
    [
        ([gps(1)], None),  # never had a fix: it goes by something else
        ([gps(3), gps(6)], None),
        ([gps(3), gps(2)], "no fix"),
        ([status(0x80), gps(3), gps(1)], None),  # with a DVL it may dive away from its GPS
        ([status(0x80), status(0x80)], None),
        ([status(0x80), status(0x20)], "DVL"),
        ([status(0x80), gps(3), status(0x20)], None),
        ([status(0x20)], None),
        ([gps(3), ekf(0.9)], None),
        ([gps(3), ekf(1.4)], "rejects its position"),
        ([status(0x80), ekf(0.1, 1.4)], "rejects its velocity"),
        ([ekf(1.4), ekf(0.2)], None),
    ],
)
def test_a_source_counts_from_when_it_worked_and_while_no_other_does(told, why):
    sources = PositionAiding()
    for k, message in enumerate(told):
        sources.observe(message, 10.0 + 0.1 * k)
    end = 10.0 + 0.1 * (len(told) - 1)
    assert sources.confirmed_fault(end + 0.1, 0.5, 1.5) is None
    found = sources.confirmed_fault(end + 0.6, 0.5, 1.5)
    assert (found is None) if why is None else (why in found)


@pytest.mark.parametrize(("period", "silence"), [(0.2, 1.2), (1.0, 3.0)])
def test_a_gps_is_silent_after_a_second_or_three_of_its_intervals(period, silence):
    sources = PositionAiding()
    for k in range(20):
        sources.observe(gps(3), period * k)
    last = 19 * period
    assert sources.confirmed_fault(last + silence - 0.05, 0.5, 1.2) is None
    assert "silent" in sources.confirmed_fault(last + silence + 0.05, 0.5, 1.2)


@pytest.mark.parametrize("when", [0.0, 4.0, 7.3, 13.0])
@pytest.mark.parametrize("current", [(0.0, 0.0), (0.3, -0.4)])
def test_a_frozen_position_stops_the_flight_and_the_vehicle_follows_it_no_more(tour, when, current):
    """Positions go on coming in time, and the filter vouches for them."""
    session, begun = SimulatedSession(SITE, current=current, noise=0.02, smooth=1.0).arm(), []

    def befall(row):
        if row.time >= when and not begun:
            begun.append(session.simulation.now)
            session.simulation.do(do="freeze")

    done = fly(SITE, tour, session, OPTIONS, on_step=befall)
    assert "the position is frozen: its position is the same" in done.stopped
    assert done.rows[-1].time - when < 2.0
    assert session.simulation.vehicle.mode == 2  # ALT_HOLD
    end, sent = session.simulation.now, len(session.heard("target"))
    stand_by(session, should_stop=lambda: session._seconds() > end + 20.0)
    assert session.simulation.vehicle.mode == 2
    assert (session.heard("disarmed"), len(session.heard("target"))) == ([], sent)
    away = session.truth[-1, 1:3] - session.truth[session.truth[:, 0] <= end][-1, 1:3]
    drift = np.array(current) * (session.simulation.now - end)
    assert np.linalg.norm(away - drift) < 1.6  # it coasts from 0.5 m/s


def test_a_frozen_vehicle_is_asked_for_alt_hold_until_it_has_it(tour):
    session, begun = SimulatedSession(SITE).arm(), []
    receive, asked = session.simulation.vehicle.receive, []

    def deaf(message):
        if message.get_type() == "COMMAND_LONG" and message.command == 176:
            asked.append(message)
            if len(asked) < 3:
                return
        receive(message)

    def befall(row):
        if row.time >= 5.0 and not begun:
            begun.append(True)
            session.simulation.do(do="freeze")
            session.simulation.vehicle.receive = deaf

    fly(SITE, tour, session, OPTIONS, on_step=befall)
    assert session.simulation.vehicle.mode == 2


FAR = [(20.0, 0.0, -3.0)]


@pytest.mark.parametrize(
    ("motion", "velocity", "path", "what"),
    [
        (lambda t: (1.0, 0.0, -1.0 - 0.1 * t), None, FAR, "position"),  # stuck in the plan only
        (lambda t: (min(0.5 * t, 2.0), 0.0, -3.0), None, FAR, "position"),
        (lambda t: (min(0.5 * t, 2.0), 0.0, -3.0), (0.5, 0.0, 0.0), FAR, "position"),
        (lambda t: (0.0, 0.0, max(-0.5 * t, -2.0)), None, [(0.0, 0.0, -9.0)], "position"),
        (lambda t: (0.5 * t, 0.0, max(-0.2 * t, -1.0)), (0.5, 0.0, -0.2), FAR, "depth"),
        (lambda t: (19.9, 0.0, -3.25), None, FAR, "position"),  # within reach, and still under way
        # it says that it moves, and has only drifted past its target
        (lambda t: (19.9, 0.0, -3.0), (0.4, 0.0, 0.0), FAR, "position"),
        (lambda t: (19.9, 0.0, -3.0), (0.02, 0.02, 0.0), FAR, None),  # it waits there
        (lambda t: (19.95, 0.05, -2.95), None, FAR, None),
        (lambda t: (0.0, 0.0, max(-0.5 * t, -9.0)), None, [(0.0, 0.0, -9.0)], None),
        (lambda t: (0.4, 0.0, -0.5 * t), None, [(0.0, 0.0, -20.0)], None),  # dives beside it
    ],
)
def test_a_position_is_frozen_where_the_vehicle_moves_or_is_told_to(motion, velocity, path, what):
    given = velocity and (lambda t: velocity)
    if what is None:
        driven(motion, path, 30.0, lambda target: target, given)
        return
    with pytest.raises(StopsFlightError, match=f"frozen: its {what} is the same"):
        driven(motion, path, 8.0, lambda target: target, given)


def test_a_vehicle_that_may_have_missed_its_target_gets_it_again_before_it_is_called_frozen():
    session = Scripted(lambda t: (0.0, 0.0, -3.0))
    vehicle = LinkedVehicle(session, 0.3)
    with pytest.raises(StopsFlightError, match="frozen"):
        vehicle.go(np.array(FAR), 30.0, 0.0, np.zeros(3), True)
    assert [round(t) for t, _ in session.sent] == [0, 2]
    assert 3.0 < session.latest.time < 5.0
    assert "20.0 m away" in session.distrusted
