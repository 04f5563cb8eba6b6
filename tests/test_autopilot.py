"""The fake ArduSub behaves as the real one was measured to do; times are simulated ones."""

from __future__ import annotations

import math
import random
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.autopilot import (
    ALT_HOLD,
    AUTO,
    GUIDED,
    MANUAL,
    POSHOLD,
    STABILIZE,
    SURFACE,
    Autopilot,
    Body,
)

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
ARM, SET_MODE, CHANGE_SPEED = 400, 176, 178
POSITION, POSITION_YAW, POSITION_VELOCITY = 0x0DF8, 0x09F8, 0x0DC0
MISSION, FENCE = mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_MISSION_TYPE_FENCE
RELATIVE, MISSION_FRAME = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, mavlink.MAV_FRAME_MISSION
METRES = 0.011131884502145034
ORIGIN = (55.5, 12.7)

Item = tuple[int, int, float, float, float, float, int, int, float]


class Station:
    """A ground station: a thread that hears all, sends heartbeats and hands over lists.

    It answers every heartbeat with one of its own, and so keeps to simulated time.
    """

    def __init__(self, vehicle: Autopilot) -> None:
        self.vehicle = vehicle
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self.socket.bind(("127.0.0.1", vehicle.port))
        self.socket.settimeout(0.05)
        self.mav: Any = mavlink.MAVLink(self, srcSystem=255, srcComponent=190)
        self.got: list[Any] = []
        self.beating, self.steering, self.ended = True, False, False
        self.lists: dict[int, Sequence[Item]] = {}
        self.thread = threading.Thread(target=self._listen, daemon=True)
        self.thread.start()

    def write(self, data: bytes) -> None:
        self.socket.sendto(data, ("127.0.0.1", self.vehicle.own))

    def close(self) -> None:
        self.ended = True
        self.thread.join(5.0)
        self.socket.close()

    def _listen(self) -> None:
        parser = mavlink.MAVLink(None)
        parser.robust_parsing = True
        while not self.ended:
            try:
                data = self.socket.recv(65536)
            except TimeoutError:
                continue
            for m in parser.parse_buffer(data) or []:
                self._hear(m)

    def _hear(self, m: Any) -> None:
        self.got.append(m)
        if m.get_type() == "HEARTBEAT" and self.beating:
            self.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
            if self.steering:
                self.mav.manual_control_send(1, 0, 0, 500, 0, 0)
        elif m.get_type() == "MISSION_REQUEST_INT":
            frame, command, *rest = self.lists[m.mission_type][m.seq]
            self.mav.mission_item_int_send(1, 1, m.seq, frame, command, 0, 1, *rest, m.mission_type)

    def all(self, kind: str, since: int = 0) -> list[Any]:
        return [m for m in self.got[since:] if m.get_type() == kind]

    def next(self, kind: str, fits: Callable[[Any], bool] = bool, since: int | None = None) -> Any:
        """The next message of a kind, from now or from a place in what was heard."""
        begin = len(self.got) if since is None else since
        return self.vehicle.until(lambda: next((m for m in self.all(kind, begin) if fits(m)), None))

    def said(self, text: str) -> bool:
        return bool(self.next("STATUSTEXT", lambda m: text in m.text, 0))

    def command(self, command: int, *params: float) -> int:
        begin = len(self.got)
        self.mav.command_long_send(1, 1, command, 0, *params, *[0.0] * (7 - len(params)))
        return int(self.next("COMMAND_ACK", lambda m: m.command == command, begin).result)

    def mode(self, mode: int) -> int:
        return self.command(SET_MODE, 1, mode)

    def shows(self, mode: int) -> None:
        self.next("HEARTBEAT", lambda m: m.custom_mode == mode)

    def ready(self, mode: int = GUIDED) -> None:
        assert self.mode(mode) == ACCEPTED
        assert self.command(ARM, 1) == ACCEPTED

    def go(self, e: float, n: float, u: float, mask: int = POSITION) -> float:
        """Send a target; the simulated time of its arrival."""
        count = len(self.targets())
        frame = mavlink.MAV_FRAME_LOCAL_NED
        self.mav.set_position_target_local_ned_send(0, 1, 1, frame, mask, n, e, -u, *[0.0] * 8)
        self.vehicle.until(lambda: len(self.targets()) > count)
        return float(self.targets()[count]["t"])

    def targets(self) -> list[dict[str, Any]]:
        return [e for e in list(self.vehicle.events) if e["event"] in ("target", "target refused")]

    def upload(self, items: Sequence[Item], kind: int = MISSION) -> int:
        self.lists[kind] = items
        begin = len(self.got)
        self.mav.mission_count_send(1, 1, len(items), kind)
        return int(self.next("MISSION_ACK", lambda m: m.mission_type == kind, begin).type)


Fly = Callable[..., tuple[Autopilot, Station]]


@pytest.fixture
def fly() -> Iterator[Fly]:
    """Starts vehicles with a ground station; a busy machine is not to trip the failsafe."""
    with ExitStack() as stack:

        def start(**options: Any) -> tuple[Autopilot, Station]:
            params = {"FS_GCS_TIMEOUT": 600.0, **options.pop("params", {})}
            pace = options.pop("pace", 20)
            vehicle = stack.enter_context(Autopilot(pace=pace, params=params, **options))
            station = Station(vehicle)
            stack.callback(station.close)
            return vehicle, station

        yield start


def lat_lon(e: float, n: float) -> tuple[int, int]:
    north = n / METRES
    narrow = math.cos(math.radians(ORIGIN[0] + 0.5e-7 * north))
    return round(ORIGIN[0] * 1e7 + north), round(ORIGIN[1] * 1e7 + e / METRES / narrow)


def waypoint(e: float, n: float, u: float) -> Item:
    return (RELATIVE, 16, 0.0, 0.0, 0.0, 0.0, *lat_lon(e, n), u)


def speed(value: float, throttle: float) -> Item:
    return (MISSION_FRAME, CHANGE_SPEED, 1.0, value, throttle, 0.0, 0, 0, 0.0)


HOME = waypoint(0.0, 0.0, 0.0)


def between(rows: np.ndarray, begin: float, end: float) -> np.ndarray:
    return rows[(rows[:, 0] >= begin) & (rows[:, 0] <= end)]


def position(m: Any) -> np.ndarray:
    """East, north, up of a LOCAL_POSITION_NED."""
    return np.array([m.y, m.x, -m.z])


def far(m: Any, by: float) -> bool:
    """Whether a LOCAL_POSITION_NED is farther from the origin than so many metres."""
    return float(np.linalg.norm(position(m))) > by


def named(vehicle: Autopilot, name: str) -> list[dict[str, Any]]:
    return [e for e in list(vehicle.events) if e["event"] == name]


# telemetry


def test_it_is_an_ardusub_whose_telemetry_keeps_its_rates(fly: Fly) -> None:
    vehicle, station = fly()
    beat = station.next("HEARTBEAT")
    assert (beat.type, beat.autopilot) == (mavlink.MAV_TYPE_SUBMARINE, 3)
    assert (beat.custom_mode, beat.base_mode & 128) == (MANUAL, 0)
    vehicle.sleep(10.0)
    kinds = {"LOCAL_POSITION_NED": 100, "GLOBAL_POSITION_INT": 100, "ATTITUDE": 100}
    for kind, step in {**kinds, "SYSTEM_TIME": 1000}.items():
        times = np.array([m.time_boot_ms for m in station.all(kind)])
        assert np.median(np.diff(times)) == step
    seconds = len(station.all("SYSTEM_TIME"))
    counts = {"HEARTBEAT": 1, "SYS_STATUS": 1, "MISSION_CURRENT": 1, "EKF_STATUS_REPORT": 2}
    for kind, rate in counts.items():
        assert len(station.all(kind)) == pytest.approx(rate * seconds, abs=3)


@pytest.mark.parametrize("rate", [25, 50])
def test_positions_come_as_often_as_asked(fly: Fly, rate: int) -> None:
    vehicle, station = fly()
    assert station.command(511, 32, 1e6 / rate) == ACCEPTED
    vehicle.sleep(1.0)
    station.mav.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_EXTRA1, rate, 1)
    begin = len(station.got)
    vehicle.sleep(5.0)
    for kind in ("LOCAL_POSITION_NED", "ATTITUDE"):
        times = np.array([m.time_boot_ms for m in station.all(kind, begin)])
        assert np.median(np.diff(times)) == 1000 / rate
    assert station.command(511, 32, -1) == ACCEPTED
    begin = len(station.got)
    vehicle.sleep(2.0)
    assert not station.all("LOCAL_POSITION_NED", begin)
    assert station.command(511, 9999, 1e5) == mavlink.MAV_RESULT_FAILED


def test_positions_are_told_about_the_origin_from_the_start_point(fly: Fly) -> None:
    _, station = fly(origin=(-33.0, 151.0), start=(30.0, -20.0, -4.0), sysid=7)
    m = station.next("LOCAL_POSITION_NED")
    assert m.get_srcSystem() == 7
    np.testing.assert_allclose(position(m), [30.0, -20.0, -4.0], atol=1e-5)
    m = station.next("GLOBAL_POSITION_INT")
    assert m.lat == pytest.approx(-33.0e7 - 20.0 / METRES, abs=2)
    narrow = math.cos(math.radians(33.0))
    assert m.lon == pytest.approx(151.0e7 + 30.0 / METRES / narrow, abs=2)
    assert (m.alt, m.relative_alt) == (-4000, 0)


def test_garbage_and_messages_to_others_are_passed_over(fly: Fly) -> None:
    _, station = fly()
    station.write(b"\xfd\xff\x00\x00 garbage")
    station.write(bytes(range(256)))
    station.mav.command_long_send(9, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
    assert station.command(31000) == mavlink.MAV_RESULT_UNSUPPORTED
    assert not station.next("HEARTBEAT").base_mode & 128


@pytest.mark.parametrize("smooth", [0.0, 1.0])
def test_the_estimate_is_noisy_as_asked_white_or_smooth(fly: Fly, smooth: float) -> None:
    vehicle, _ = fly(noise=0.2, smooth=smooth, start=(0.0, 0.0, -1.0), pace=80)
    vehicle.sleep(100.0)
    error = np.array([np.subtract(r["est"], r["true"]) for r in list(vehicle.rows)])
    assert error.std() == pytest.approx(0.2, rel=0.3)
    kept = math.exp(-0.2 / smooth) if smooth > 0.0 else 0.0  # from row to row
    jumps = np.diff(error, axis=0).std()
    assert jumps == pytest.approx(0.2 * math.sqrt(2.0 - 2.0 * kept), rel=0.3)


def test_the_estimate_drifts_slowly_and_not_in_depth(fly: Fly) -> None:
    vehicle, _ = fly(drift=0.3, seed=3, pace=80)
    vehicle.sleep(150.0)
    error = np.array([np.subtract(r["est"], r["true"]) for r in list(vehicle.rows)])
    assert 0.1 < np.abs(error[:, :2]).max() < 1.5
    assert np.abs(np.diff(error[:, :2], axis=0)).max() < 0.15
    assert not error[:, 2].any()


# modes and arming


def test_modes_are_entered_by_command_and_by_message(fly: Fly) -> None:
    _, station = fly()
    for mode in (STABILIZE, ALT_HOLD, GUIDED, SURFACE, POSHOLD, MANUAL):
        assert station.mode(mode) == ACCEPTED
        station.shows(mode)
    begin = len(station.got)
    station.mav.set_mode_send(1, 1, GUIDED)
    assert station.next("COMMAND_ACK", since=begin).result == ACCEPTED
    station.next("HEARTBEAT", lambda m: m.custom_mode == GUIDED)
    assert station.mode(99) == DENIED
    assert station.mode(AUTO) == DENIED  # there is no mission


def test_without_an_estimate_auto_and_guided_are_refused(fly: Fly) -> None:
    vehicle, station = fly(estimate=False)
    assert station.upload([HOME, waypoint(1.0, 0.0, 0.0)]) == 0
    assert [station.mode(AUTO), station.mode(GUIDED)] == [DENIED, DENIED]
    assert station.said("requires position")
    assert station.mode(ALT_HOLD) == ACCEPTED
    ekf = station.next("EKF_STATUS_REPORT")
    assert ekf.flags & mavlink.EKF_CONST_POS_MODE
    assert not station.all("LOCAL_POSITION_NED")
    vehicle.tell(do="restore_estimate")
    station.next("LOCAL_POSITION_NED")
    assert [station.mode(AUTO), station.mode(GUIDED)] == [ACCEPTED, ACCEPTED]


def test_it_arms_and_disarms_and_tells_where_home_is(fly: Fly) -> None:
    vehicle, station = fly(start=(3.0, 4.0, 0.0))
    begin = len(station.got)
    assert station.command(ARM, 1) == ACCEPTED
    home = station.next("HOME_POSITION", since=begin)
    assert (home.latitude, home.longitude) == lat_lon(3.0, 4.0)
    station.next("HEARTBEAT", lambda m: m.base_mode & 128)
    for request in ((410,), (512, 242)):
        begin = len(station.got)
        assert station.command(*request) == ACCEPTED
        station.next("HOME_POSITION", since=begin)
    assert station.command(ARM, 0) == ACCEPTED
    station.next("HEARTBEAT", lambda m: not m.base_mode & 128)
    vehicle.event("disarmed")


def test_disarmed_it_drifts_to_a_stop(fly: Fly) -> None:
    vehicle, station = fly()
    station.ready()
    station.go(20.0, 0.0, 0.0)
    station.next("LOCAL_POSITION_NED", lambda m: far(m, 3.0))
    vehicle.tell(do="disarm")
    t = vehicle.event("disarmed")["t"]
    vehicle.sleep(15.0)
    rows = between(vehicle.truth(), t, 1e9)
    assert 0.2 < rows[-1, 1] - rows[0, 1] < 1.5
    last = between(rows, t + 9.0, 1e9)[:, 1:]
    assert np.ptp(last, axis=0).max() < 0.05 * 6.0


# GUIDED


def test_steps_of_two_metres_take_their_time_and_keep_to_the_line(fly: Fly) -> None:
    vehicle, station = fly(seed=5, start=(0.0, 0.0, -1.0))
    station.ready()
    off: list[float] = []
    for i in range(8):
        a, b = ((0.0, 0.0, -1.0), (0.0, 2.0, -1.0))[:: 1 if i % 2 == 0 else -1]
        t = station.go(*b)
        arrived = vehicle.event("arrived", since=t)["t"]
        assert 6.4 <= arrived - t <= 9.4
        vehicle.sleep(arrived + 4.0 - vehicle.now)
        rows = vehicle.truth()
        early = between(rows, t, t + 0.7)[:, 1:]  # it takes its time to move
        assert np.linalg.norm(early - a, axis=1).max() < 0.2
        near = rows[(rows[:, 0] > t) & (np.linalg.norm(rows[:, 1:] - b, axis=1) < 0.2)]
        assert 5.0 < near[0, 0] - t < 7.6
        off += list(np.linalg.norm(between(rows, t, arrived)[:, [1, 3]] - [0.0, -1.0], axis=1))
        held = np.linalg.norm(between(rows, arrived + 0.2, arrived + 4.0)[:, 1:] - b, axis=1)
        assert held.max() <= 0.16
    assert max(off) <= 0.16


def test_over_many_legs_it_strays_at_most_a_tenth_of_a_metre() -> None:
    body = Body((0.0, 0.0, 0.0), random.Random(0))
    off: list[float] = []
    held: list[float] = []
    for i in range(100):
        body.goal = (0.0, 2.0 * (1 - i % 2), 0.0)
        while not body.arrived:
            body.follow(body.point, body.velocity)
            off.append(math.hypot(body.point[0], body.point[2]))
        for _ in range(150):
            body.follow(body.point, body.velocity)
            held.append(math.dist(body.point, body.goal))
    assert 0.01 <= np.percentile(off, 95) <= 0.10
    assert max(off) <= 0.16
    assert np.percentile(held, 95) <= 0.16


def test_a_global_target_leads_to_the_same_place(fly: Fly) -> None:
    vehicle, station = fly()
    station.ready()
    where = lat_lon(2.0, 3.0)
    station.mav.set_position_target_global_int_send(
        0, 1, 1, RELATIVE, POSITION, *where, -1.5, *[0.0] * 8
    )
    target = vehicle.event("target")
    np.testing.assert_allclose(target["at"], [2.0, 3.0, -1.5], atol=0.1)
    vehicle.event("arrived")
    np.testing.assert_allclose(vehicle.rows[-1]["true"], target["at"], atol=0.14)


def test_a_new_target_on_the_way_is_planned_for_from_where_it_would_stop(fly: Fly) -> None:
    vehicle, station = fly()
    station.ready()
    station.go(0.0, 30.0, 0.0)
    station.next("LOCAL_POSITION_NED", lambda m: far(m, 5.0))
    t = station.go(30.0, 6.0, 0.0)
    vehicle.sleep(8.0)
    rows = vehicle.truth()
    during = between(rows, t, t + 0.7)
    speeds = np.diff(during[:, 2]) / np.diff(during[:, 0])
    assert speeds.min() > 0.2  # it goes on as it went
    assert np.abs(np.diff(during[:, 1])).max() < 0.06
    assert between(rows, t + 7.0, 1e9)[0, 1] > 1.0
    assert vehicle.rows[-1]["target"] == [30.0, 6.0, 0.0]


def test_a_target_that_is_repeated_is_planned_for_anew(fly: Fly) -> None:
    vehicle, station = fly()
    station.ready()
    t = station.go(0.0, 2.0, 0.0)
    for _ in range(3):
        vehicle.sleep(1.0)
        station.go(0.0, 2.0, 0.0)
    assert vehicle.event("arrived")["t"] - t > 6.4
    assert len(named(vehicle, "under way")) == 1


def test_a_target_with_velocity_times_out_and_one_without_holds(fly: Fly) -> None:
    vehicle, station = fly(seed=2)
    station.ready()
    station.go(1.0, 0.0, 0.0)
    arrived = vehicle.event("arrived")["t"]
    vehicle.until(lambda: vehicle.now >= arrived + 15.0)
    held = between(vehicle.truth(), arrived + 0.2, 1e9)[:, 1:] - (1.0, 0.0, 0.0)
    assert np.linalg.norm(held, axis=1).max() <= 0.13
    t = station.go(1.0, 0.0, 0.0, POSITION_VELOCITY)
    assert vehicle.event("target timed out")["t"] - t == pytest.approx(3.0, abs=0.1)
    vehicle.until(lambda: vehicle.now >= t + 15.4)
    rows = vehicle.truth()
    drifted = between(rows, t + 14.9, 1e9)[0, 1:] - between(rows, t, 1e9)[0, 1:]
    assert 0.3 < np.linalg.norm(drifted) < 0.75
    station.go(1.0, 0.0, 0.0)  # and it comes back
    station.next("LOCAL_POSITION_NED", lambda m: abs(m.y - 1.0) < 0.13 and abs(m.x) < 0.13)


def test_a_target_may_set_the_heading_and_else_it_looks_ahead(fly: Fly) -> None:
    _, station = fly()
    station.ready()
    station.go(5.0, 0.0, 0.0)
    station.next("ATTITUDE", lambda m: abs(m.yaw - 0.5 * math.pi) < 0.05)
    station.go(6.0, 0.0, 0.0, POSITION_YAW)  # to the north
    station.next("ATTITUDE", lambda m: abs(m.yaw) < 0.05)


def test_targets_are_ignored_when_they_cannot_be_followed(fly: Fly) -> None:
    vehicle, station = fly()
    assert station.mode(GUIDED) == ACCEPTED
    station.go(1.0, 1.0, -1.0)
    assert station.command(ARM, 1) == ACCEPTED
    station.go(1.0, 3.0, -1.0, 0x0DFF)
    assert station.mode(POSHOLD) == ACCEPTED
    station.go(1.0, 4.0, -1.0)
    why = [e.get("why") for e in station.targets()]
    assert why == ["disarmed", "no position", "not in GUIDED"]
    vehicle.sleep(5.0)
    assert np.abs(vehicle.truth()[:, 1:]).max() < 0.13
    assert vehicle.rows[-1]["target"] is None


# AUTO


def test_it_takes_655_items_and_refuses_656(fly: Fly) -> None:
    _, station = fly()
    items = [HOME, *(waypoint(i, 0.0, -1.0) for i in range(655))]
    assert station.upload(items) == mavlink.MAV_MISSION_NO_SPACE
    assert station.upload(items[:655]) == mavlink.MAV_MISSION_ACCEPTED
    begin = len(station.got)
    station.mav.mission_request_list_send(1, 1)
    assert station.next("MISSION_COUNT", since=begin).count == 655


def test_a_mission_is_handed_back_as_it_was_sent_and_cleared(fly: Fly) -> None:
    _, station = fly()
    items = [HOME, waypoint(3.0, 4.0, -5.0), speed(0.4, -1.0)]
    assert station.upload(items) == mavlink.MAV_MISSION_ACCEPTED
    for seq, item in enumerate(items[1:], 1):
        begin = len(station.got)
        station.mav.mission_request_int_send(1, 1, seq)
        m = station.next("MISSION_ITEM_INT", since=begin)
        sent = (m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z)
        assert (m.seq, m.frame, m.command) == (seq, *item[:2])
        np.testing.assert_allclose(sent, item[2:], rtol=1e-6)
    begin = len(station.got)
    station.mav.mission_clear_all_send(1, 1)
    assert station.next("MISSION_ACK", since=begin).type == 0
    station.mav.mission_request_list_send(1, 1)
    assert station.next("MISSION_COUNT", since=begin).count == 0
    assert station.upload([HOME, (RELATIVE, 82, 0, 0, 0, 0, 0, 0, 0)]) == 3  # no splines


@pytest.mark.parametrize(("speed", "least", "most"), [(0.5, 2.5, 7.5), (2.0, 5.0, 9.5)])
def test_a_mission_stops_at_every_waypoint(
    fly: Fly, speed: float, least: float, most: float
) -> None:
    vehicle, station = fly(speed=speed)
    side = 6.0 * speed / 0.5
    corners = [(0.0, side), (side, side), (side, 0.0)]
    assert station.upload([HOME, *(waypoint(e, n, -1.0) for e, n in corners)]) == 0
    assert station.command(ARM, 1) == ACCEPTED
    assert station.mode(AUTO) == ACCEPTED
    vehicle.event("mission complete")
    vehicle.sleep(2.0)
    reached = named(vehicle, "item reached")
    assert [e["seq"] for e in reached] == [1, 2, 3]
    more = np.diff([e["t"] for e in reached]) - side / speed
    assert (least <= more).all()
    assert (more <= most).all()
    rows = vehicle.truth()
    for (e, n), event in zip(corners, reached, strict=True):
        there = between(rows, event["t"] - 0.1, event["t"] + 0.7)[:, 1:]
        assert np.linalg.norm(there - (e, n, -1.0), axis=1).max() < 0.25 + 0.25 * (speed - 0.5)
    assert [m.seq for m in station.all("MISSION_ITEM_REACHED")] == [1, 2, 3]
    assert vehicle.rows[-1]["armed"]


def test_the_first_leg_is_straight_from_wherever_it_was_armed(fly: Fly) -> None:
    vehicle, station = fly(start=(2.5, 0.0, 0.0))
    assert station.upload([HOME, waypoint(0.0, 4.0, 0.0)]) == 0
    assert station.command(ARM, 1) == ACCEPTED
    assert station.mode(AUTO) == ACCEPTED
    vehicle.event("mission complete")
    rows = vehicle.truth()[:, 1:3]
    along = np.array([-2.5, 4.0]) / math.hypot(2.5, 4.0)
    across = (rows - (2.5, 0.0)) @ (along[1], -along[0])
    assert np.abs(across).max() <= 0.16


def test_auto_while_disarmed_reaches_all_and_goes_nowhere(fly: Fly) -> None:
    vehicle, station = fly()
    assert station.upload([HOME, *(waypoint(9.0, i, -1.0) for i in range(4))]) == 0
    assert station.mode(AUTO) == ACCEPTED
    vehicle.event("mission complete")
    reached = named(vehicle, "item reached")
    assert [e["seq"] for e in reached] == [1, 2, 3, 4]
    np.testing.assert_allclose(np.diff([e["t"] for e in reached]), 1.0, atol=0.05)
    assert not vehicle.truth()[:, 1:].any()
    station.next("MISSION_ITEM_REACHED", lambda m: m.seq == 4, 0)


def test_items_above_home_are_refused_on_the_way(fly: Fly) -> None:
    vehicle, station = fly()
    absolute = (0, *waypoint(8.0, 0.0, -1.0)[1:])
    items = [HOME, waypoint(9.0, 0.0, 1.0), absolute, waypoint(0.0, 1.0, -1.0)]
    assert station.upload(items) == 0
    assert station.command(ARM, 1) == ACCEPTED
    assert station.mode(AUTO) == ACCEPTED
    vehicle.event("mission complete")
    assert station.said("Alt above home must be negative")
    assert station.said("Bad alt frame")
    assert [e["seq"] for e in named(vehicle, "item reached")] == [3]
    assert np.abs(vehicle.truth()[:, 1]).max() < 0.2


def test_rearming_under_water_moves_home(fly: Fly) -> None:
    vehicle, station = fly()
    station.ready()
    vehicle.tell(do="place", at=[0, 0, -3])
    assert station.command(ARM, 0) == ACCEPTED
    begin = len(station.got)
    assert station.command(ARM, 1) == ACCEPTED
    assert station.next("HOME_POSITION", since=begin).z == pytest.approx(3.0, abs=0.15)
    assert abs(station.next("GLOBAL_POSITION_INT").relative_alt) < 300
    assert station.upload([HOME, waypoint(0.0, 1.0, -1.0)]) == 0
    assert station.mode(AUTO) == ACCEPTED
    vehicle.event("mission complete")
    assert vehicle.rows[-1]["true"][2] == pytest.approx(-4.0, abs=0.3)


# speed


def test_a_change_of_speed_is_refused_unless_its_throttle_is_left_alone(fly: Fly) -> None:
    vehicle, station = fly()
    station.ready()
    assert station.command(CHANGE_SPEED, 1, 1.0, 0) == DENIED
    assert station.said("Alt above home must be negative")
    assert vehicle.event("command refused")["command"] == CHANGE_SPEED
    assert station.command(CHANGE_SPEED, 1, 1.0, -1) == ACCEPTED
    t = station.go(0.0, 10.0, 0.0)
    arrived = vehicle.event("arrived")["t"]
    assert 10.0 + 2.0 < arrived - t < 18.5  # at 0.5 m/s it takes 20 s and more


def test_a_mission_changes_speed_only_after_its_first_waypoint(fly: Fly) -> None:
    vehicle, station = fly()
    north = [waypoint(0.0, 8.0 * i, 0.0) for i in (1, 2, 3)]
    fast = speed(2.0, -1.0)
    items = [HOME, fast, north[0], speed(2.0, 0.0), north[1], fast, north[2]]
    assert station.upload(items) == 0
    assert station.command(ARM, 1) == ACCEPTED
    assert station.mode(AUTO) == ACCEPTED
    vehicle.event("mission complete")
    rows = vehicle.truth()
    swift = np.diff(rows[:, 2]) / np.diff(rows[:, 0])
    legs = [swift[(rows[1:, 2] > 8.0 * i + 0.5) & (rows[1:, 2] < 8.0 * i + 7.5)] for i in range(3)]
    assert legs[0].max() < 0.7
    assert legs[1].max() < 0.7
    assert legs[2].max() > 1.2
    assert named(vehicle, "command refused")[0]["command"] == CHANGE_SPEED


def test_the_speed_is_a_parameter_in_centimetres_per_second(fly: Fly) -> None:
    vehicle, station = fly(speed=0.8)
    begin = len(station.got)
    station.mav.param_request_read_send(1, 1, b"WPNAV_SPEED", -1)
    m = station.next("PARAM_VALUE", since=begin)
    assert (m.param_id, m.param_value) == ("WPNAV_SPEED", 80.0)
    begin = len(station.got)
    station.mav.param_set_send(1, 1, b"WPNAV_SPEED", 150.0, 9)
    assert station.next("PARAM_VALUE", since=begin).param_value == 150.0
    station.ready()
    station.go(0.0, 40.0, 0.0)
    vehicle.event("arrived")
    rows = vehicle.truth()
    assert np.percentile(np.diff(rows[:, 2]) / 0.2, 98) == pytest.approx(1.5, abs=0.25)


# failsafes and what befalls it


def test_without_heartbeats_it_disarms_and_its_mission_ticks_to_the_end(fly: Fly) -> None:
    vehicle, station = fly()
    assert station.upload([HOME, *(waypoint(0.0, 50.0, -1.0 - i) for i in range(5))]) == 0
    assert station.command(ARM, 1) == ACCEPTED
    assert station.mode(AUTO) == ACCEPTED
    vehicle.sleep(6.0)
    station.beating = False
    station.mav.param_set_send(1, 1, b"FS_GCS_TIMEOUT", 3.0, 9)
    vehicle.event("disarmed")
    assert station.said("heartbeat lost")
    vehicle.event("mission complete")
    reached = named(vehicle, "item reached")
    assert [e["seq"] for e in reached] == [1, 2, 3, 4, 5]
    assert not any(e["armed"] for e in reached)
    assert vehicle.rows[-1]["true"][1] < 10.0
    assert vehicle.rows[-1]["mode"] == AUTO


def test_a_vehicle_that_hears_of_no_ground_station_disarms_after_five_seconds() -> None:
    with Autopilot(pace=20) as vehicle:
        vehicle.tell(do="arm")
        armed = vehicle.event("armed")["t"]
        disarmed = vehicle.event("disarmed")
    assert disarmed["t"] - armed == pytest.approx(5.0, abs=0.05)
    assert "heartbeat" in disarmed["why"]


def test_without_a_pilots_input_it_disarms_if_it_is_set_to(fly: Fly) -> None:
    vehicle, station = fly(params={"FS_PILOT_INPUT": 2.0})
    station.ready()
    armed = vehicle.event("armed")["t"]
    disarmed = vehicle.event("disarmed")
    assert disarmed["t"] - armed == pytest.approx(3.0, abs=0.05)
    assert "pilot" in disarmed["why"]
    station.mav.param_set_send(1, 1, b"FS_PILOT_TIMEOUT", 15.0, 9)
    station.steering = True
    assert station.command(ARM, 1) == ACCEPTED
    vehicle.sleep(30.0)
    assert vehicle.rows[-1]["armed"]


def test_a_lost_estimate_drifts_then_ends_and_leaves_mode_and_arming(fly: Fly) -> None:
    vehicle, station = fly(noise=0.05)
    station.ready()
    station.go(0.0, 30.0, 0.0)
    station.next("LOCAL_POSITION_NED", lambda m: far(m, 3.0))
    well = station.next("EKF_STATUS_REPORT").flags
    vehicle.tell(do="lose_estimate")
    t = vehicle.event("estimate lost")["t"]
    assert station.next("GPS_RAW_INT", lambda m: m.fix_type < 2).time_usec / 1e6 < t + 1.5
    bits = mavlink.EKF_POS_HORIZ_ABS | mavlink.EKF_POS_HORIZ_REL
    ekf = station.next("EKF_STATUS_REPORT", lambda m: not m.flags & bits)
    assert well & bits == bits
    assert not (well | ekf.flags) & mavlink.EKF_CONST_POS_MODE
    station.next("EKF_STATUS_REPORT", lambda m: m.flags & mavlink.EKF_CONST_POS_MODE)
    begin = len(station.got)
    vehicle.sleep(5.0)
    assert not station.all("LOCAL_POSITION_NED", begin)
    assert len({(m.lat, m.lon) for m in station.all("GLOBAL_POSITION_INT", begin)}) == 1
    beat = station.next("HEARTBEAT")
    assert (beat.custom_mode, beat.base_mode & 128) == (GUIDED, 128)
    assert station.mode(MANUAL) == ACCEPTED
    assert station.mode(GUIDED) == DENIED
    vehicle.tell(do="restore_estimate")
    station.next("EKF_STATUS_REPORT", lambda m: m.flags & bits == bits)
    assert station.mode(GUIDED) == ACCEPTED


def test_the_pilot_takes_over_and_hands_back(fly: Fly) -> None:
    vehicle, station = fly()
    station.ready()
    station.go(0.0, 30.0, 0.0)
    station.next("LOCAL_POSITION_NED", lambda m: far(m, 2.0))
    vehicle.tell(do="mode", mode=MANUAL)
    station.next("HEARTBEAT", lambda m: m.custom_mode == MANUAL)
    vehicle.sleep(10.0)
    assert vehicle.truth()[-1, 2] < 6.0
    assert station.mode(GUIDED) == ACCEPTED
    vehicle.sleep(5.0)
    assert vehicle.rows[-1]["target"] is None  # what it was to do is forgotten
    assert vehicle.truth()[-1, 2] < 7.0
    assert [e["by"] for e in named(vehicle, "mode")] == ["command", "pilot", "command"]


def test_a_silent_link_neither_hears_nor_tells(fly: Fly) -> None:
    vehicle, station = fly(params={"FS_GCS_TIMEOUT": 20.0})
    station.ready()
    station.next("HEARTBEAT", lambda m: m.base_mode & 128)
    vehicle.tell(do="silence", seconds=25)
    t = vehicle.event("silence")["t"]
    vehicle.sleep(1.0)
    station.mav.command_long_send(1, 1, SET_MODE, 0, 1, MANUAL, 0, 0, 0, 0, 0)
    disarmed = vehicle.event("disarmed")["t"]
    assert 14.0 < disarmed - t <= 20.1
    station.next("SYSTEM_TIME", lambda m: m.time_boot_ms > 1000 * (t + 26.0))
    during = [m for m in station.all("ATTITUDE") if 0.1 < m.time_boot_ms / 1e3 - t < 24.9]
    assert not during
    assert station.next("HEARTBEAT").custom_mode == GUIDED


def test_a_jump_of_the_estimate_moves_the_vehicle_the_other_way(fly: Fly) -> None:
    vehicle, station = fly()
    station.ready()
    station.go(0.0, 2.0, 0.0)
    vehicle.event("arrived")
    vehicle.tell(do="jump", by=[1.5, 0])
    station.next("LOCAL_POSITION_NED", lambda m: m.y > 1.0)
    vehicle.sleep(10.0)
    np.testing.assert_allclose(vehicle.rows[-1]["true"], [-1.5, 2.0, 0.0], atol=0.14)
    np.testing.assert_allclose(vehicle.rows[-1]["est"], [0.0, 2.0, 0.0], atol=0.14)


def test_a_push_is_made_good_and_a_placed_vehicle_knows_where_it_is(fly: Fly) -> None:
    vehicle, station = fly()
    station.ready()
    station.go(0.0, 2.0, -1.0)
    vehicle.event("arrived")
    vehicle.tell(do="push", by=[0, 2, 0])
    np.testing.assert_allclose(vehicle.event("push")["true"], [0.0, 4.0, -1.0], atol=0.14)
    vehicle.sleep(12.0)
    np.testing.assert_allclose(vehicle.rows[-1]["true"], [0.0, 2.0, -1.0], atol=0.14)
    assert station.mode(MANUAL) == ACCEPTED
    vehicle.tell(do="place", at=[7, 8, -9])
    station.next("LOCAL_POSITION_NED", lambda m: np.allclose(position(m), [7, 8, -9], atol=0.2))


# fences


def test_fences_refuse_targets_in_guided_and_only_report_in_auto(fly: Fly) -> None:
    vehicle, station = fly()
    inclusion, circle = 5001, 5004
    square = [(-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)]
    points: list[Item] = [(0, inclusion, 4.0, 0, 0, 0, *lat_lon(e, n), 0.0) for e, n in square]
    points.append((0, circle, 1.0, 0, 0, 0, *lat_lon(0.0, 3.0), 0.0))
    assert station.upload(points * 15, FENCE) == mavlink.MAV_MISSION_NO_SPACE  # 710 bytes
    assert station.upload(points, FENCE) == mavlink.MAV_MISSION_ACCEPTED
    assert station.command(207, 1) == ACCEPTED
    station.ready()
    for e, n in ((6.0, 0.0), (0.0, 3.5), (4.0, 4.0)):
        station.go(e, n, 0.0)
    why = [e.get("why") for e in station.targets()]
    assert why == ["outside of the fence", "outside of the fence", None]
    assert station.upload([HOME, waypoint(0.0, -7.0, 0.0)]) == 0
    assert station.mode(AUTO) == ACCEPTED
    vehicle.event("mission complete")
    assert vehicle.truth()[:, 2].min() < -6.5
    assert station.said("Fence Breached")


# the process


def test_it_ends_when_told_when_its_input_ends_and_by_a_signal() -> None:
    with Autopilot() as vehicle:
        vehicle.tell(do="nonsense")
        vehicle.event("not understood")
        vehicle.tell(do="quit")
        assert vehicle.process.wait(20.0) == 0
    with Autopilot() as vehicle:
        vehicle.process.terminate()
        assert vehicle.process.wait(20.0) == 0
    with Autopilot() as vehicle:
        pass
    assert vehicle.process.returncode == 0
