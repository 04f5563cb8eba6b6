"""A position estimate that has lost its source is noticed before it drifts."""

from types import SimpleNamespace

import numpy as np
import pytest

from netsp import Problem, solve
from netsp.execute.log import ExecutionOptions
from netsp.fly import flight
from netsp.fly.flight import fly
from netsp.fly.standby import stand_by
from netsp.link.position_source import PositionSources
from tests.simulated_session import SimulatedSession

SITE = Problem(base=(0, 0), goals=[(9, 2, -1), (9, -2, -1)], tether_length=15)
OPTIONS = ExecutionOptions(speed=0.5, reach=0.3)


@pytest.fixture(scope="module")
def tour():
    return solve(SITE)


@pytest.fixture(autouse=True)
def rehearsed(monkeypatch):
    monkeypatch.setattr(flight, "rehearse", lambda: None)


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
    sources = PositionSources()
    for k, message in enumerate(told):
        sources.take(message, 10.0 + 0.1 * k)
    end = 10.0 + 0.1 * (len(told) - 1)
    assert sources.lost(end + 0.1, 0.5, 1.5) is None
    found = sources.lost(end + 0.6, 0.5, 1.5)
    assert (found is None) if why is None else (why in found)


@pytest.mark.parametrize(("period", "silence"), [(0.2, 1.2), (1.0, 3.0)])
def test_a_gps_is_silent_after_a_second_or_three_of_its_intervals(period, silence):
    sources = PositionSources()
    for k in range(20):
        sources.take(gps(3), period * k)
    last = 19 * period
    assert sources.lost(last + silence - 0.05, 0.5, 1.2) is None
    assert "silent" in sources.lost(last + silence + 0.05, 0.5, 1.2)
