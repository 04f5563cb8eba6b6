"""Session with a vehicle: one thread reads, another sends heartbeats, so that planning delays
neither.

The latest values that the vehicle reports are available at any time. Its heartbeats tell whether it
is still there, and its clock tells the time.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.field_types import Point3
from netsp.online.guard.telemetry import Fix
from netsp.online.link.dialect import dialect
from netsp.online.link.geo_frame import Frame
from netsp.online.link.link_policy import LinkPolicy
from netsp.online.link.mavlink_messages import AUTOPILOT, Listener
from netsp.online.link.statustext import status_texts
from netsp.online.link.target_echo import TargetEcho
from netsp.online.link.udp import UdpLink
from netsp.online.link.vehicle_kind import GROUND_STATION_TYPE, VehicleKind


class Session:
    """Session with a vehicle at the other end of a link.

    Parameters
    ----------
    link : UdpLink
        Link to the vehicle.
    frame : Frame
        Frame of the site.
    system : int, optional
        System id of the vehicle; by default that of the first autopilot heard. From then on other
        systems and other addresses are not listened to.
    pace : float
        Seconds of the vehicle for each of ours: 1, except in simulations that run faster.
    policy : LinkPolicy
        Heartbeats, requests and limits.
    """

    def __init__(
        self,
        link: UdpLink,
        frame: Frame,
        system: int | None = None,
        pace: float = 1.0,
        policy: LinkPolicy = LinkPolicy(),
    ) -> None:
        self.link, self.frame, self.pace, self.policy = link, frame, pace, policy
        self._listener = Listener(frame, system, policy)
        self._lock = threading.Lock()
        self._latest = Fix(0.0)
        self._heartbeat_at: float | None = None
        self._position_at: float | None = None
        self._ticked: tuple[float, float] | None = None
        self._check: Callable[[Fix], str | None] | None = None
        self._fault: str | None = None
        self._places: deque[tuple[float, Point3]] = deque(maxlen=2000)
        self._texts: deque[str] = deque(maxlen=200)
        self._parameters: dict[str, float] = {}
        self._station: tuple[int, float] | None = None
        self._echoes = TargetEcho(frame)
        self._distrust: str | None = None
        self._echo: tuple[Point3, float] | None = None
        self._text_numbers = itertools.count()
        self._stop = threading.Event()
        self._threads: list[threading.Thread] = []
        self._start()

    def _start(self) -> None:
        """Start the threads that read and send heartbeats."""
        for loop in (self._receive_loop, self._heartbeat_loop):
            thread = threading.Thread(target=loop, daemon=True)
            self._threads.append(thread)
            thread.start()

    def _seconds(self) -> float:
        """Return the seconds of our clock, which is never set."""
        return time.monotonic()

    def close(self) -> None:
        """End both threads, and close the link."""
        self._stop.set()
        for thread in self._threads:
            thread.join(2.0)
        self.link.close()

    @property
    def system(self) -> int | None:
        """Return the system id of the vehicle; None until it was heard."""
        return self._listener.system

    @property
    def kind(self) -> VehicleKind | None:
        """Return the kind of the vehicle; None until it was heard."""
        return self._listener.kind

    @property
    def others(self) -> list[int]:
        """Return the system ids of other vehicles that were heard."""
        return sorted(self._listener.others.copy())

    @property
    def latest(self) -> Fix:
        """Return the latest value of every quantity that the vehicle reports."""
        with self._lock:
            return self._latest

    @property
    def silent_s(self) -> float:
        """Return the seconds of the vehicle since its last heartbeat; infinite before the first."""
        with self._lock:
            last = self._heartbeat_at
        return float("inf") if last is None else (self._seconds() - last) * self.pace

    @property
    def stalled_s(self) -> float:
        """Return the seconds since the vehicle's clock last changed; infinite before its first
        time."""
        with self._lock:
            ticked = self._ticked
        return float("inf") if ticked is None else (self._seconds() - ticked[1]) * self.pace

    @property
    def position_age_s(self) -> float:
        """Return the seconds of the vehicle since its last position; infinite before the first."""
        with self._lock:
            last = self._position_at
        return float("inf") if last is None else (self._seconds() - last) * self.pace

    def watch(self, check: Callable[[Fix], str | None]) -> None:
        """Check everything that the vehicle reports from now on, so that no fault is missed.

        Parameters
        ----------
        check : callable
            Called, from the thread that reads, with the latest values; returns a fault or None.
        """
        with self._lock:
            self._check, self._fault = check, None

    @property
    def fault(self) -> str | None:
        """Return the first fault that the check found; None if there was none."""
        with self._lock:
            return self._fault

    def new_places(self) -> list[Floats]:
        """Return the positions that came since the last call, each of shape (3,), m."""
        with self._lock:
            found = [np.array(p) for _, p in self._places]
            self._places.clear()
        return found

    def new_texts(self) -> list[str]:
        """Return the texts that the vehicle sent since the last call."""
        with self._lock:
            found = list(self._texts)
            self._texts.clear()
        return found

    def sleep(self, seconds: float) -> None:
        """Wait for some seconds of the vehicle."""
        time.sleep(seconds / self.pace)

    def command(self, number: int, *params: float) -> bool:
        """Send COMMAND_LONG; missing parameters are 0. Return whether it was sent."""
        if self.system is None:
            return False
        values = [*map(float, params), *[0.0] * (7 - len(params))]
        message = dialect().MAVLink_command_long_message(self.system, 1, number, 0, *values)
        return self.link.send(message)

    def request_parameter(self, name: str) -> None:
        """Request the value of a parameter of the vehicle, by its name of at most 16 letters."""
        if self.system is not None:
            m = dialect()
            self.link.send(m.MAVLink_param_request_read_message(self.system, 1, name.encode(), -1))

    def parameter(self, name: str) -> float | None:
        """Return the value of a parameter; None if the vehicle has not sent it."""
        with self._lock:
            return self._parameters.get(name)

    def ground_station(self, max_silence_s: float) -> int | None:
        """Return the system id of another ground station heard lately; None if there is none."""
        with self._lock:
            station = self._station
        if station is None or (self._seconds() - station[1]) * self.pace > max_silence_s:
            return None
        return station[0]

    def aiding_fault(self, min_fault_s: float, max_age_s: float) -> str | None:
        """Return why the position estimate is not to be trusted; None if it is.

        The parameters are those of `PositionAiding.confirmed_fault`.
        """
        with self._lock:
            time = self._listener.time
            if self._distrust is not None or time is None:
                return self._distrust
            return self._listener.aiding.confirmed_fault(time, min_fault_s, max_age_s)

    @property
    def is_distrusted(self) -> bool:
        """Return whether the positions are unusable, even to stop by."""
        with self._lock:
            return self._distrust is not None

    def distrust(self, why: str) -> None:
        """Treat the vehicle's positions as lost from now on, for a reason given in messages."""
        with self._lock:
            self._distrust = why

    @property
    def echo(self) -> tuple[Point3, float] | None:
        """Return the target that the vehicle echoed last, in the site, and the age of the echo, s
        of
                the vehicle; None before the first echo.
        """
        with self._lock:
            echo = self._echo
        return None if echo is None else (echo[0], (self._seconds() - echo[1]) * self.pace)

    def request_positions(self) -> None:
        """Request ten positions a second, and the other messages that a flight watches."""
        m = dialect()
        position_us = round(1e6 * self.policy.position_interval_s)
        echo_us = round(1e6 * self.policy.echo_interval_s)
        position = (
            m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
            if self.frame.is_global
            else m.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        )
        for message, interval_us in (
            (position, position_us),
            (m.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 2 * position_us),
            (m.MAVLINK_MSG_ID_GPS_RAW_INT, 2 * position_us),
            (m.MAVLINK_MSG_ID_SYS_STATUS, 5 * position_us),
            (m.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT, echo_us),
            (m.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED, echo_us),
        ):
            self.command(m.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval_us)
        # echoes are in degrees; positions may be in metres from where the estimate began
        self.command(m.MAV_CMD_REQUEST_MESSAGE, m.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)

    def send_text(self, text: str, is_urgent: bool = False) -> None:
        """Send a text to ground stations."""
        m = dialect()
        severity = m.MAV_SEVERITY_ALERT if is_urgent else m.MAV_SEVERITY_WARNING
        number, max_bytes = next(self._text_numbers), self.policy.max_text_bytes
        for part in status_texts(severity, f"netsp: {text}", number, max_bytes):
            self.link.send(part)

    def _receive_loop(self) -> None:
        while not self._stop.is_set():
            for message, peer in self.link.receive(0.05):
                self._receive(message, peer)

    def _receive(self, message: Any, peer: tuple[str, int]) -> None:
        """Note a message, if it is of the vehicle."""
        listener = self._listener
        known = listener.system
        if known is not None and self.link.peer is not None and peer != self.link.peer:
            return
        self._note_station(message)
        with self._lock:
            fix = listener.read(message)
        if listener.system is None or message.get_srcSystem() != listener.system:
            return
        if message.get_srcComponent() != AUTOPILOT:
            return
        if self.link.peer is None:
            self.link.set_peer(peer)
        with self._lock:
            self._note_message(message)
            if fix is not None:
                self._note_fix(fix)

    def _note_message(self, message: Any) -> None:
        """Note what a message says besides the quantities of a fix."""
        kind, time = message.get_type(), self._listener.time
        if kind == "HEARTBEAT":
            self._heartbeat_at = self._seconds()
        elif kind == "STATUSTEXT":
            self._texts.append(str(message.text))
        elif kind == "PARAM_VALUE":
            self._parameters[str(message.param_id)] = float(message.param_value)
        if time is not None and (self._ticked is None or self._ticked[0] != time):
            self._ticked = time, self._seconds()
        echo = self._echoes.read(message)
        if echo is not None:
            self._echo = echo, self._seconds()

    def _note_fix(self, fix: Fix) -> None:
        before, self._latest = self._latest.time, fix.completed_by(self._latest)
        if fix.position is not None:
            self._position_at = self._seconds()
            self._places.append((fix.time, fix.position))
        if self._check is not None and self._fault is None:
            self._fault = self._check(self._latest)
            if self._latest.time < before - self.policy.max_clock_step_s:
                self._fault = "the vehicle has restarted"

    def _note_station(self, message: Any) -> None:
        """Note the heartbeat of another ground station, which the vehicle or a router passes on."""
        if message.get_type() != "HEARTBEAT" or int(message.type) != GROUND_STATION_TYPE:
            return
        system = int(message.get_srcSystem())
        if (system, message.get_srcComponent()) == self.link.ids or self.link.peer is None:
            return
        with self._lock:
            before = self._station
            # the station whose id the vehicle counts on goes before others
            is_ours = before is not None and before[0] == self.link.ids[0]
            if system == self.link.ids[0] or not is_ours:
                self._station = system, self._seconds()

    def _heartbeat_loop(self) -> None:
        while not self._stop.wait(self.policy.heartbeat_s / self.pace):
            self._send_heartbeat()

    def _send_heartbeat(self) -> None:
        m = dialect()
        self.link.send(
            m.MAVLink_heartbeat_message(
                m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE, 3
            )
        )
