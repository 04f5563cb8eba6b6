"""A link that is kept alive: one thread reads, another sends heartbeats, nobody waits for planning.

What the vehicle says last is at hand at any time. Whether it still speaks is told by its own
heartbeats, and time by its own clock.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.field_types import Point3
from netsp.online.guard.telemetry import Fix
from netsp.online.link.dialect import dialect
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import Listener
from netsp.online.link.position_source import PositionSources
from netsp.online.link.statustext import status_texts
from netsp.online.link.target_echo import TargetEcho
from netsp.online.link.udp import UdpLink
from netsp.online.link.vehicle_kind import GROUND_STATION_TYPE, VehicleKind

HEARTBEAT_S = 0.5
"""Seconds between heartbeats: ArduSub disarms when it hears none for 5."""

BACKWARDS_S = 2.0
"""Seconds by which the vehicle's clock may go back when messages overtake one another."""

POSITION_US = 100_000
"""Microseconds between two positions that are asked for."""

ECHO_US = 500_000
"""Microseconds between two echoes of the target that are asked for."""


class Session:
    """A vehicle at the other end of a link.

    Parameters
    ----------
    link : UdpLink
        The socket.
    frame : Frame
        Of the site.
    system : int, optional
        Its system id; by default that of the first autopilot heard. From then on nobody else is
        listened to, nor any other address.
    pace : float
        Seconds of the vehicle for each of ours: 1, but in simulations that run faster.
    """

    def __init__(
        self, link: UdpLink, frame: Frame, system: int | None = None, pace: float = 1.0
    ) -> None:
        self.link, self.frame, self.pace = link, frame, pace
        self._listener = Listener(frame, system)
        self._lock = threading.Lock()
        self._now = Fix(0.0)
        self._heard: float | None = None
        self._placed: float | None = None
        self._ticked: tuple[float, float] | None = None
        self._holds: Callable[[Fix], str | None] | None = None
        self._broken: str | None = None
        self._places: deque[tuple[float, Point3]] = deque(maxlen=2000)
        self._texts: deque[str] = deque(maxlen=200)
        self._acks: dict[int, int] = {}
        self._parameters: dict[str, float] = {}
        self._station: tuple[int, float] | None = None
        self._echoes = TargetEcho(frame)
        self._sources = PositionSources()
        self._distrust: str | None = None
        self._echo: tuple[Point3, float] | None = None
        self._said = itertools.count()
        self._stop = threading.Event()
        self._threads: list[threading.Thread] = []
        self._start()

    def _start(self) -> None:
        """Start the threads that read and send heartbeats."""
        for work in (self._read, self._beat):
            thread = threading.Thread(target=work, daemon=True)
            self._threads.append(thread)
            thread.start()

    def _seconds(self) -> float:
        """Return the seconds of a clock of ours that is never set."""
        return time.monotonic()

    def close(self) -> None:
        """End both threads, and close the socket."""
        self._stop.set()
        for thread in self._threads:
            thread.join(2.0)
        self.link.close()

    @property
    def system(self) -> int | None:
        """System id of the vehicle; None until it was heard."""
        return self._listener.system

    @property
    def kind(self) -> VehicleKind | None:
        """Kind of the vehicle; None until it was heard."""
        return self._listener.kind

    @property
    def others(self) -> list[int]:
        """System ids of other vehicles that were heard."""
        return sorted(self._listener.others.copy())

    @property
    def now(self) -> Fix:
        """What the vehicle said last of everything."""
        with self._lock:
            return self._now

    @property
    def silent_s(self) -> float:
        """Seconds of the vehicle since its last heartbeat; infinite before the first."""
        with self._lock:
            heard = self._heard
        return float("inf") if heard is None else (self._seconds() - heard) * self.pace

    @property
    def stalled_s(self) -> float:
        """Seconds since the vehicle's clock last changed; infinite before its first time."""
        with self._lock:
            ticked = self._ticked
        return float("inf") if ticked is None else (self._seconds() - ticked[1]) * self.pace

    @property
    def unplaced_s(self) -> float:
        """Seconds of the vehicle since its last position came; infinite before the first."""
        with self._lock:
            placed = self._placed
        return float("inf") if placed is None else (self._seconds() - placed) * self.pace

    def watch(self, holds: Callable[[Fix], str | None]) -> None:
        """From now on, ask of all that the vehicle says whether something holds, so that nothing is
        missed while nobody looks.

        Parameters
        ----------
        holds : callable
            Called, from the thread that reads, with what is known; returns what is wrong.
        """
        with self._lock:
            self._holds, self._broken = holds, None

    @property
    def broken(self) -> str | None:
        """What did not hold, the first time; None if all did."""
        with self._lock:
            return self._broken

    def places(self) -> list[Floats]:
        """Positions that came since this was last asked, each of shape (3,), metres."""
        with self._lock:
            found = [np.array(p) for _, p in self._places]
            self._places.clear()
        return found

    def texts(self) -> list[str]:
        """What the vehicle has said in words since this was last asked."""
        with self._lock:
            found = list(self._texts)
            self._texts.clear()
        return found

    def ack(self, command: int) -> int | None:
        """The result of a command, None while there is none; it is told once."""
        with self._lock:
            return self._acks.pop(command, None)

    def sleep(self, seconds: float) -> None:
        """Wait for so many seconds of the vehicle."""
        time.sleep(seconds / self.pace)

    def command(self, number: int, *params: float) -> bool:
        """Send COMMAND_LONG; what is not given is 0."""
        if self.system is None:
            return False
        values = [*map(float, params), *[0.0] * (7 - len(params))]
        with self._lock:
            self._acks.pop(number, None)
        message = dialect().MAVLink_command_long_message(self.system, 1, number, 0, *values)
        return self.link.send(message)

    def ask_parameter(self, name: str) -> None:
        """Ask for the value of a parameter of the vehicle.

        Parameters
        ----------
        name : str
            Its name, 16 letters at most.
        """
        if self.system is not None:
            m = dialect()
            self.link.send(m.MAVLink_param_request_read_message(self.system, 1, name.encode(), -1))

    def parameter(self, name: str) -> float | None:
        """Return the value of a parameter; None if the vehicle has not told it."""
        with self._lock:
            return self._parameters.get(name)

    def ground_station(self, within_s: float) -> int | None:
        """Return the system id of another ground station that was heard lately; None without one.

        Parameters
        ----------
        within_s : float
            Seconds of the vehicle since its last heartbeat, at most.
        """
        with self._lock:
            station = self._station
        if station is None or (self._seconds() - station[1]) * self.pace > within_s:
            return None
        return station[0]

    def source_lost(self, confirm_s: float, max_age_s: float) -> str | None:
        """Return what is wrong with the sources of the position estimate; None if nothing is.

        Parameters
        ----------
        confirm_s, max_age_s : float
            As of `netsp.online.link.position_source.PositionSources.lost`.
        """
        with self._lock:
            time = self._listener.time
            if self._distrust is not None or time is None:
                return self._distrust
            return self._sources.lost(time, confirm_s, max_age_s)

    @property
    def is_distrusted(self) -> bool:
        """Return whether the positions are unusable, even to stop by."""
        with self._lock:
            return self._distrust is not None

    def distrust(self, why: str) -> None:
        """Treat the positions of the vehicle as lost from now on, whatever it reports.

        Parameters
        ----------
        why : str
            Reason, for messages.
        """
        with self._lock:
            self._distrust = why

    @property
    def echo(self) -> tuple[Point3, float] | None:
        """Target that the vehicle says it goes to, in the site, and the seconds of the vehicle
        since it said so; None if it has not."""
        with self._lock:
            echo = self._echo
        return None if echo is None else (echo[0], (self._seconds() - echo[1]) * self.pace)

    def ask_for_positions(self) -> None:
        """Ask for ten positions a second, and for the other messages that a flight watches."""
        m = dialect()
        wanted = (
            m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT if self.frame.is_global
            else m.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        )  # fmt: skip
        self.command(m.MAV_CMD_SET_MESSAGE_INTERVAL, wanted, POSITION_US)
        self.command(
            m.MAV_CMD_SET_MESSAGE_INTERVAL, m.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 2 * POSITION_US
        )
        for source, period in (
            (m.MAVLINK_MSG_ID_GPS_RAW_INT, 2 * POSITION_US),
            (m.MAVLINK_MSG_ID_SYS_STATUS, 5 * POSITION_US),
        ):  # fmt: skip
            self.command(m.MAV_CMD_SET_MESSAGE_INTERVAL, source, period)
        for echo in (
            m.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT, m.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED
        ):  # fmt: skip
            self.command(m.MAV_CMD_SET_MESSAGE_INTERVAL, echo, ECHO_US)
        # echoes are in degrees; positions may be in metres from where the estimate began
        self.command(m.MAV_CMD_REQUEST_MESSAGE, m.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)

    def say(self, text: str, urgent: bool = False) -> None:
        """Words for whoever looks at the ground station."""
        m = dialect()
        severity = m.MAV_SEVERITY_ALERT if urgent else m.MAV_SEVERITY_WARNING
        for part in status_texts(severity, f"netsp: {text}", next(self._said)):
            self.link.send(part)

    def _read(self) -> None:
        while not self._stop.is_set():
            for message, peer in self.link.hear(0.05):
                self._take(message, peer)

    def _take(self, message: Any, peer: tuple[str, int]) -> None:
        known = self._listener.system
        if known is not None and self.link.peer is not None and peer != self.link.peer:
            return
        self._note_station(message)
        fix = self._listener.understand(message)
        if self._listener.system is None or message.get_srcSystem() != self._listener.system:
            return
        if message.get_srcComponent() != 1:
            return
        if self.link.peer is None:
            self.link.answer(peer)
        kind = message.get_type()
        with self._lock:
            if kind == "HEARTBEAT":
                self._heard = self._seconds()
            elif kind == "STATUSTEXT":
                self._texts.append(str(message.text))
            elif kind == "COMMAND_ACK":
                self._acks[int(message.command)] = int(message.result)
            elif kind == "PARAM_VALUE":
                self._parameters[str(message.param_id)] = float(message.param_value)
            if self._listener.time is not None:
                if self._ticked is None or self._ticked[0] != self._listener.time:
                    self._ticked = self._listener.time, self._seconds()
                self._sources.take(message, self._listener.time)
            echo = self._echoes.understand(message)
            if echo is not None:
                self._echo = echo, self._seconds()
            if fix is None:
                return
            kept = {
                f.name: getattr(self._now, f.name)
                for f in fields(Fix) if getattr(fix, f.name) is None
            }  # fmt: skip
            before, self._now = self._now.time, replace(fix, **kept)
            if fix.position is not None:
                self._placed = self._seconds()
                self._places.append((fix.time, fix.position))
            if self._holds is not None and self._broken is None:
                self._broken = self._holds(self._now)
                if self._now.time < before - BACKWARDS_S:
                    self._broken = "the vehicle has started anew"

    def _note_station(self, message: Any) -> None:
        """Note the heartbeat of another ground station, which the vehicle or a router passes on."""
        if message.get_type() != "HEARTBEAT" or int(message.type) != GROUND_STATION_TYPE:
            return
        system = int(message.get_srcSystem())
        if (system, message.get_srcComponent()) == self.link.ids or self.link.peer is None:
            return
        with self._lock:
            before = self._station
            # the one that the vehicle counts on goes before others
            is_ours = before is not None and before[0] == self.link.ids[0]
            if system == self.link.ids[0] or not is_ours:
                self._station = system, self._seconds()

    def _beat(self) -> None:
        while not self._stop.wait(HEARTBEAT_S / self.pace):
            self._send_heartbeat()

    def _send_heartbeat(self) -> None:
        m = dialect()
        self.link.send(
            m.MAVLink_heartbeat_message(
                m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE, 3
            )
        )
