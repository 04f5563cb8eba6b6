"""A session with the fake autopilot in one process, on the autopilot's own clock: no socket, no
thread and no waiting, so that a flight is the same on every machine."""

from __future__ import annotations

from typing import Any

from netsp.online.link.dialect import GROUND_STATION, ONBOARD_COMPUTER, parser
from netsp.online.link.geo_frame import Frame
from netsp.online.link.session import Session
from tests.autopilot import STEP, Simulation

VEHICLE = ("vehicle", 1)


class SimulatedLink:
    """A link that hands messages to a simulation at once; what is sent is kept in `sent`."""

    ids = GROUND_STATION, ONBOARD_COMPUTER

    def __init__(self, simulation: Simulation) -> None:
        self.simulation, self.peer = simulation, VEHICLE
        self.sent: list[tuple[float, Any]] = []
        self.is_cut = False

    def send(self, message: Any) -> bool:
        message.pack(parser(*self.ids))
        self.sent.append((self.simulation.now, message))
        if not self.is_cut and not self.simulation.wire.silent:
            self.simulation.vehicle.receive(message)
        return True

    def close(self) -> None:
        pass


class SimulatedSession(Session):
    """A session whose time is that of the simulation; it goes by in `sleep` alone.

    Other ground stations are those in `stations`: (system, component) to the seconds from which on
    the vehicle passes their heartbeats on.
    """

    def __init__(self, site: Any, simulation: Simulation | None = None, **options: Any) -> None:
        self.simulation = simulation or Simulation(**options)
        self.simulation.beating = False
        self.stations: dict[tuple[int, int], float] = {}
        self._beat_due = self.simulation.now
        super().__init__(SimulatedLink(self.simulation), Frame(site, "local"), 1)  # type: ignore[arg-type]

    def _start(self) -> None:
        pass

    def _seconds(self) -> float:
        return self.simulation.now

    def sleep(self, seconds: float) -> None:
        for _ in range(max(1, round(seconds / STEP))):
            if self.simulation.now >= self._beat_due:
                self._beat_due = self.simulation.now + self.policy.heartbeat_s
                if not self._stop.is_set():
                    self._send_heartbeat()
                self._pass_on_stations()
            self.simulation.step()
            if not self.link.is_cut:
                for message in self.simulation.wire.messages():
                    self._receive(message, VEHICLE)

    def _pass_on_stations(self) -> None:
        from netsp.online.link.dialect import dialect

        for ids, begin in self.stations.items():
            if self.simulation.now >= begin:
                beat = dialect().MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
                beat.pack(parser(*ids))
                self.simulation.vehicle.receive(beat)
                self._receive(beat, VEHICLE)

    def arm(self) -> SimulatedSession:
        """Have the vehicle armed, and heard."""
        self.simulation.vehicle.arm("pilot")
        self.sleep(1.5)
        return self

    def begin_at(self, seconds: float) -> SimulatedSession:
        """Let time go by until a time of the vehicle."""
        while self.simulation.now < seconds:
            self.sleep(0.1)
        return self

    @property
    def truth(self) -> Any:
        return self.simulation.truth()

    def heard(self, name: str) -> list[dict[str, Any]]:
        """Return the vehicle's events of a name."""
        return [e for e in self.simulation.events if e["event"] == name]
