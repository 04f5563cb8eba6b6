"""How a vehicle is driven over a link, on a clock of the test's own: no socket and no waiting."""

import numpy as np
import pytest

from netsp.online.execute.tour_execution import StopsFlightError
from netsp.online.fly.preflight_checks import make_ready
from netsp.online.fly.stopped import RefusedError
from netsp.online.fly.vehicle import LinkedVehicle
from netsp.online.link.dialect import dialect, parser
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import Listener
from netsp.online.link.target_echo import TargetEcho
from netsp.online.link.udp import messages_in
from netsp.online.link.vehicle_kind import VehicleKind
from tests.scripted_vehicle import SITE, Scripted, driven


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
        make_ready(session, np.zeros(3), 2.0)
    assert session.asked == session.sent == []
    make_ready(session, np.zeros(3), 2.0, any_vehicle=True)


def test_the_kind_of_a_vehicle_is_that_of_its_heartbeat():
    """A gimbal, a camera or a ground station of the same system id does not count."""
    listener, m = Listener(Frame(SITE), 1), dialect()
    for component, kind, autopilot in ((1, 12, 3), (154, 26, 8), (190, 6, 8)):
        beat = m.MAVLink_heartbeat_message(kind, autopilot, 128, 4, 4, 3)
        (read,) = messages_in(beat.pack(parser(1, component)))
        listener.read(read)
    assert listener.kind == VehicleKind(12, 3)
    assert listener.kind.is_ardusub


def resting(t):
    return 1e-4 * np.sin(t), 0.0, -1.0  # to the last bit no real vehicle holds still


def moving(t):
    return 0.25 * t, 0.0, -1.0


FAR = [(20.0, 0.0, -1.0)]


@pytest.mark.parametrize(
    ("motion", "echo", "sent"),
    [
        (moving, lambda target: target, 1),
        (moving, lambda target: (target[0] + 0.1, *target[1:]), 1),
        (resting, lambda target: target, 1),  # it has it, whatever keeps it
        (moving, None, 1),  # it says nothing, but goes there
        (moving, lambda target: (*target[:2], target[2] - 30.0), 1),  # told from another level
        (resting, None, 15),  # every two seconds
        (resting, lambda target: (*target[:2], target[2] - 3.0), 15),
    ],
)
def test_a_target_is_sent_again_only_to_a_vehicle_that_does_not_have_it(motion, echo, sent):
    """A target that is sent again is planned for anew, and the vehicle falls behind in depth."""
    vehicle = driven(motion, FAR, 30.0, echo)
    assert len(vehicle.session.sent) == pytest.approx(sent, abs=1 if sent > 1 else 0)


def test_a_vehicle_that_goes_elsewhere_gets_its_target_three_times_more_and_is_then_stopped():
    session = Scripted(moving, lambda target: (target[0], target[1] + 4.0, target[2]))
    vehicle = LinkedVehicle(session, 0.3)
    with pytest.raises(StopsFlightError, match=r"does not accept its target.* 4\.0 m"):
        vehicle.go(np.array(FAR), 30.0, 0.0, np.zeros(3), True)
    assert len(session.sent) == 4


@pytest.mark.parametrize(
    ("vertex", "count"),
    [((30.0, 0.0, -12.0), 6), ((30.0, 0.0, -1.5), 1), ((0.2, 0.0, -9.0), 1), ((9.0, 0, -6.5), 3)],
)
def test_a_leg_that_slopes_has_targets_on_it(vertex, count):
    """From one to the next the depth changes by two metres at most, and so do they in the plan."""
    begin, place = np.array([0.0, 0.0, -1.0]), [np.array([0.0, 0.0, -1.0])]
    session = Scripted(lambda t: tuple(place[0]), lambda target: target)
    vehicle, passed = LinkedVehicle(session, 0.3), 0
    for _ in range(40):
        passed = vehicle.go(np.array([vertex]), 0.2, 0.0, np.zeros(3), True)[1]
        place[0] = np.array(session.targets[-1])
    assert passed == 1
    targets = np.array(session.targets)
    assert len(targets) == count
    assert np.allclose(targets[-1], vertex)
    assert np.allclose(targets, begin + np.outer(np.arange(1, count + 1) / count,
                                                 np.array(vertex) - begin), atol=1e-3)  # fmt: skip


def test_echoes_in_degrees_lead_to_the_site_by_the_origin_of_the_estimate():
    """ArduSub tells its target in degrees and above the sea."""
    m, echoes = dialect(), TargetEcho(Frame(SITE))
    told = m.MAVLink_position_target_global_int_message(
        0, 0, 0x0DF8, 556_000_898, 129_501_591, 2.5 - 3.0, *(0.0,) * 8
    )
    assert echoes.read(told) is None
    echoes.read(m.MAVLink_gps_global_origin_message(556_000_000, 129_500_000, 2500))
    assert np.allclose(echoes.read(told), (10.0, 10.0, -3.0), atol=0.02)
    local = m.MAVLink_position_target_local_ned_message(0, 1, 0x0DF8, 10.0, 5.0, 3.0, *(0.0,) * 8)
    assert np.allclose(echoes.read(local), (5.0, 10.0, -3.0))
