"""How a vehicle is driven over a link, on a clock of the test's own: no socket and no waiting."""

from dataclasses import replace

import numpy as np
import pytest

from netsp import Problem
from netsp.execute.run import StopsFlightError
from netsp.fly.checks import ready
from netsp.fly.stopped import RefusedError
from netsp.fly.vehicle import LinkedVehicle
from netsp.guard.fix import Fix
from netsp.link.dialect import dialect, parser
from netsp.link.frame import Frame
from netsp.link.messages import Listener
from netsp.link.udp import messages_in
from netsp.link.vehicle_kind import VehicleKind

SITE = Problem(base=(0, 0), goals=[(6, 2, -1)], tether_length=40)


class Scripted:
    """A session whose vehicle goes where a function of time says, ten positions a second."""

    system, others, broken, silent_s, unplaced_s, pace = 1, (), None, 0.0, 0.0, 1.0
    kind = VehicleKind(12, 3)

    def __init__(self, motion):
        self.motion, self.frame, self.link = motion, Frame(SITE), self
        self.now = Fix(0.0, motion(0.0), armed=True, mode="GUIDED", estimate=True)
        self.sent, self.asked, self.fresh = [], [], []

    def watch(self, holds):
        self.holds = holds

    def ask_for_positions(self):
        self.asked.append("positions")

    def command(self, *numbers):
        self.asked.append(numbers)
        return True

    def send(self, message):
        self.sent.append((self.now.time, message))
        return True

    def sleep(self, seconds):
        time = self.now.time + seconds
        self.now = replace(self.now, time=time, position=self.motion(time))
        self.fresh.append(np.array(self.now.position))

    def places(self):
        found, self.fresh = self.fresh, []
        return found


def driven(motion, path, seconds):
    """Drive a vehicle along a path that it does not decide itself."""
    vehicle = LinkedVehicle(Scripted(motion), 0.3)
    vehicle.go(np.array(path, dtype=float), seconds, 0.0, np.zeros(3), True)
    return vehicle


@pytest.mark.parametrize("lag", [1.0, 3.0, 9.0])
def test_a_vehicle_that_lags_in_depth_on_a_sloping_leg_is_on_its_path(lag):
    """30 m out and 11 m down, on the line in the plan all the way."""

    def motion(t):
        return 0.5 * t, 0.0, -0.1 - max(11.0 * t / 60.0 - lag, 0.0)

    assert driven(motion, [(30.0, 0.0, -11.0)], 50.0).position[0] > 20.0


@pytest.mark.parametrize(
    ("motion", "why"),
    [
        (lambda t: (0.5 * t, 0.0, -1.0 + 0.1 * t), "above the depth"),
        (lambda t: (0.5 * t, 0.0, -1.0 - 0.1 * t), "below the depth"),
        (lambda t: (0.5 * t, 0.1 * t, -1.0), "1.0 m off its path"),
        (lambda t: (0.0, -0.1 * t, -1.0), "1.0 m off its path"),
    ],
)
def test_a_vehicle_that_leaves_its_path_in_the_plan_or_in_depth_is_stopped(motion, why):
    with pytest.raises(StopsFlightError, match=why):
        driven(motion, [(30.0, 0.0, -1.0)], 50.0)


@pytest.mark.parametrize("aside", [0.0, 0.8])
def test_a_leg_straight_down_is_measured_in_the_plan_from_where_it_began(aside):
    def motion(t):
        return aside * min(t, 1.0), 0.0, -1.0 - 0.2 * t

    driven(motion, [(0.0, 0.0, -9.0)], 30.0)


@pytest.mark.parametrize(
    ("kind", "named"),
    [
        ((2, 3), "quadrotor with autopilot ardupilotmega"),
        ((10, 3), "ground rover with autopilot ardupilotmega"),
        ((12, 12), "submarine with autopilot px4"),
        ((11, 3), "surface boat"),
        ((1, 18), "fixed wing"),
        ((200, 99), "MAV_TYPE 200 with autopilot MAV_AUTOPILOT 99"),
    ],
)
def test_only_a_submarine_with_ardupilot_is_commanded_unless_any_vehicle_is(kind, named):
    """Whatever another vehicle is, it gets no message: its numbers mean something else."""
    session = Scripted(lambda t: (0.0, 0.0, -0.1))
    session.kind = VehicleKind(*kind)
    with pytest.raises(RefusedError, match=named):
        ready(session, np.zeros(3), 2.0)
    assert session.asked == session.sent == []
    ready(session, np.zeros(3), 2.0, any_vehicle=True)


def test_the_kind_of_a_vehicle_is_that_of_its_heartbeat():
    """A gimbal, a camera or a ground station of the same system id does not count."""
    listener, m = Listener(Frame(SITE), 1), dialect()
    for component, kind, autopilot in ((1, 12, 3), (154, 26, 8), (190, 6, 8)):
        beat = m.MAVLink_heartbeat_message(kind, autopilot, 128, 4, 4, 3)
        (read,) = messages_in(beat.pack(parser(1, component)))
        listener.understand(read)
    assert listener.kind == VehicleKind(12, 3)
    assert listener.kind.is_ardusub
