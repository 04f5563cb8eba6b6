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

from netsp.arrays import Floats
from netsp.fields import Point3
from netsp.guard.fix import Fix
from netsp.link.dialect import dialect
from netsp.link.frame import Frame
from netsp.link.messages import Listener
from netsp.link.statustext import status_texts
from netsp.link.udp import UdpLink
from netsp.link.vehicle_kind import VehicleKind

HEARTBEAT_S = 0.5
"""Seconds between heartbeats: ArduSub disarms when it hears none for about 3."""

BACKWARDS_S = 2.0
"""Seconds by which the vehicle's clock may go back when messages overtake one another."""

POSITION_US = 100_000
"""Microseconds between two positions that are asked for."""


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
        self._holds: Callable[[Fix], str | None] | None = None
        self._broken: str | None = None
        self._places: deque[tuple[float, Point3]] = deque(maxlen=2000)
        self._texts: deque[str] = deque(maxlen=200)
        self._acks: dict[int, int] = {}
        self._said = itertools.count()
        self._stop = threading.Event()
        self._threads = [
            threading.Thread(target=work, daemon=True) for work in (self._read, self._beat)
        ]
        for thread in self._threads:
            thread.start()

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
        return float("inf") if heard is None else (time.monotonic() - heard) * self.pace

    @property
    def unplaced_s(self) -> float:
        """Seconds of the vehicle since its last position came; infinite before the first."""
        with self._lock:
            placed = self._placed
        return float("inf") if placed is None else (time.monotonic() - placed) * self.pace

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

    def ask_for_positions(self) -> None:
        """Ten a second, whatever the vehicle sends of itself."""
        m = dialect()
        wanted = (
            m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT if self.frame.is_global
            else m.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        )  # fmt: skip
        self.command(m.MAV_CMD_SET_MESSAGE_INTERVAL, wanted, POSITION_US)
        self.command(
            m.MAV_CMD_SET_MESSAGE_INTERVAL, m.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 2 * POSITION_US
        )

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
                self._heard = time.monotonic()
            elif kind == "STATUSTEXT":
                self._texts.append(str(message.text))
            elif kind == "COMMAND_ACK":
                self._acks[int(message.command)] = int(message.result)
            if fix is None:
                return
            kept = {
                f.name: getattr(self._now, f.name)
                for f in fields(Fix) if getattr(fix, f.name) is None
            }  # fmt: skip
            before, self._now = self._now.time, replace(fix, **kept)
            if fix.position is not None:
                self._placed = time.monotonic()
                self._places.append((fix.time, fix.position))
            if self._holds is not None and self._broken is None:
                self._broken = self._holds(self._now)
                if self._now.time < before - BACKWARDS_S:
                    self._broken = "the vehicle has started anew"

    def _beat(self) -> None:
        m = dialect()
        beat = m.MAVLink_heartbeat_message(
            m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE, 3
        )
        while not self._stop.wait(HEARTBEAT_S / self.pace):
            self.link.send(beat)
