"""Corridors of legs hold vehicles that brake into bends, and no vehicle that is carried off."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netsp import Problem, solve
from netsp.base.geometry import polylines
from netsp.online.execute.execution_log import ExecutionOptions
from netsp.online.execute.tour_execution import StopsFlightError
from netsp.online.fly import tour_flight
from netsp.online.fly.flight_policy import FlightPolicy
from netsp.online.fly.leg_corridor import LegCorridor
from netsp.online.fly.tour_flight import fly
from tests.scripted_vehicle import driven
from tests.simulated_session import SimulatedSession

SQUARE = Problem(
    base=(0, 0), goals=[(14, 0, -2), (14, 14, -2), (0, 14, -2), (1, 1, -2)], tether_length=60
)
POLICY = FlightPolicy()
places = st.tuples(*[st.integers(-2000, 2000)] * 3).map(lambda p: np.array(p) / 100.0)
velocities = st.tuples(*[st.integers(-10, 10)] * 3).map(lambda p: np.array(p) / 10.0)


@pytest.mark.parametrize(
    ("speed", "current"), [(1.0, (0.8, 0.0)), (1.5, (0.0, 0.0)), (1.5, (0.8, 0.0)),
                           (1.5, (-0.57, 0.57))],
)  # fmt: skip
def test_bends_at_full_speed_end_no_flight(monkeypatch, speed, current):
    """Goals are only seen in passing: the vehicle turns at full speed."""
    monkeypatch.setattr(tour_flight, "rehearse", lambda: None)
    session = SimulatedSession(SQUARE, speed=speed, current=current, noise=0.02, smooth=1.0).arm()
    done = fly(SQUARE, solve(SQUARE), session, ExecutionOptions(speed=speed, reach=3.0))
    assert (done.summary["status"], done.summary["home"]) == ("done", True), done.stopped


@given(begin=places, velocity=velocities, end=places, brake=st.floats(0.0, 1.0))
def test_a_vehicle_may_stop_beyond_a_bend_and_go_on_straight_from_there(
    begin, velocity, end, brake
):
    corridor = LegCorridor(begin, velocity, end, POLICY)
    stop = begin + brake * POLICY.stopping_s * velocity
    for place in polylines.dense(np.array([begin, stop, end]), 0.5):
        corridor.observe(place)
        assert corridor.distance(place) < POLICY.min_return + 1e-6
        assert corridor.depth_error(place)[0] < POLICY.min_return + 1e-6


@given(begin=places, velocity=velocities, end=places, place=places)
def test_a_corridor_is_never_narrower_than_its_leg_nor_wider_than_it_takes_to_stop(
    begin, velocity, end, place
):
    corridor = LegCorridor(begin, velocity, end, POLICY)
    share = np.linspace(0.0, 1.0, 400)[:, None]
    leg = (begin + share * (end - begin))[:, :2]
    off = float(np.linalg.norm(leg - place[:2], axis=1).min())
    way = POLICY.stopping_s * float(np.linalg.norm(velocity))
    assert off - way - 0.1 <= corridor.distance(place) <= off + 1e-6


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("speed", [0.3, 1.0, 2.5])
def test_a_vehicle_that_is_carried_off_a_straight_leg_is_stopped_at_any_speed(speed, side):
    def motion(t):
        return speed * t, side * 0.1 * max(t - 10.0, 0.0), -1.0

    with pytest.raises(StopsFlightError, match=r"1\.0 m off its path"):
        driven(motion, [(100.0, 0.0, -1.0)], 30.0, velocity=lambda t: (speed, 0.0, 0.0))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("speed", [0.5, 1.0, 1.5])
def test_once_a_bend_is_behind_a_vehicle_that_is_carried_off_is_stopped(speed, side):
    """Overshoot of 1.2 s of its speed at a right angle, and 30 of 40 m on a push of 1.6 m."""
    far = 1.2 * speed

    def motion(t, push=0.0):
        if t < 4.0:
            return 0.0, -far * np.sin(np.pi * t / 8.0), -1.0
        along = speed * (t - 4.0)
        return along, -far * (1.0 - along / 40.0) + push * (along > 30.0), -1.0

    def velocity(t):
        return (0.0, -speed, 0.0) if t < 1.0 else (speed, 0.0, 0.0)

    goal, seconds = [(40.0, 0.0, -1.0)], 4.0 + 35.0 / speed
    driven(motion, goal, seconds, velocity=velocity)
    with pytest.raises(StopsFlightError, match="off its path"):
        driven(lambda t: motion(t, 1.6 * side), goal, seconds, velocity=velocity)
