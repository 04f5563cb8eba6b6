"""What a vehicle is sent on a whole flight, and how it keeps to its legs."""

import numpy as np
import pytest

from netsp import Problem, solve
from netsp.online.execute.execution_log import ExecutionOptions
from netsp.online.fly import tour_flight
from netsp.online.fly.tour_flight import fly
from tests.simulated_session import SimulatedSession

DEEP = Problem(base=(0, 0), goals=[(30, 0, -11)], tether_length=40)
OPTIONS = ExecutionOptions(speed=0.5, reach=0.3)


@pytest.fixture(autouse=True)
def rehearsed(monkeypatch):
    monkeypatch.setattr(tour_flight, "rehearse", lambda: None)


def targets(session):
    return [
        (t, (m.x, m.y, m.z)) for t, m in session.link.sent
        if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    ]  # fmt: skip


def test_depth_follows_a_leg_that_slopes_and_no_target_is_sent_twice():
    """30 m out and 11 m down, and back."""
    session = SimulatedSession(DEEP).arm()
    done = fly(DEEP, solve(DEEP), session, OPTIONS)
    assert (done.summary["status"], done.summary["visited"]) == ("done", 1), done.stopped
    sent = [place for _, place in targets(session)]
    assert len(sent) == len(set(sent))
    assert session.echo is not None
    track = session.truth
    lag = track[:, 3] - np.interp(track[:, 1], [0.0, 30.0], [-0.1, -11.0])
    assert np.abs(lag[track[:, 1] > 0.5]).max() < 0.3


@pytest.mark.parametrize("echo", [True, False])
def test_a_target_that_got_lost_is_sent_again(echo):
    """A radio link that swallows every first datagram of a target."""
    session, seen = SimulatedSession(DEEP, echo=echo).arm(), set()
    receive = session.simulation.vehicle.receive

    def deaf(message):
        if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
            place = (message.x, message.y, message.z)
            if place not in seen:
                seen.add(place)
                return
        receive(message)

    session.simulation.vehicle.receive = deaf
    done = fly(DEEP, solve(DEEP), session, OPTIONS)
    assert (done.summary["status"], done.summary["visited"]) == ("done", 1), done.stopped
    assert len(targets(session)) == 2 * len(seen)
