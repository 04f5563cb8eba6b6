"""Standby after a flight: hold the vehicle until another ground station takes over.

Some seconds after the last heartbeat of a ground station (FS_GCS_TIMEOUT, 5 s by default), ArduSub
disarms and drifts, or does what its parameter FS_GCS_ENABLE says. So netsp keeps sending heartbeats
after the flight, and holds the vehicle in place.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

import numpy as np

from netsp.online.execute.tour_execution import StopsFlightError
from netsp.online.fly.flight_policy import FlightPolicy
from netsp.online.fly.vehicle import LinkedVehicle
from netsp.online.link.dialect import GROUND_STATION, dialect
from netsp.online.link.modes import Mode, mode_name
from netsp.online.link.session import Session

Ending = Literal["hold", "position-hold", "surface", "leave"]
"""Action of a vehicle after a flight: hold its place in GUIDED or in POSHOLD, come to the surface,
or stay as it is with no heartbeats from us."""

ENDINGS: tuple[Ending, ...] = get_args(Ending)

ENDING_MODES = {"position-hold": Mode.POSHOLD, "surface": Mode.SURFACE}
"""Mode of each ending but holding in GUIDED."""

FAILSAFE = "FS_GCS_ENABLE"
"""Parameter for what the vehicle does without a ground station."""

FAILSAFE_TIME = "FS_GCS_TIMEOUT"
"""Parameter for the seconds without a ground station after which it does so."""

CONSEQUENCES = {
    2: "disarms and drifts",
    3: "holds its depth (ALT_HOLD) and drifts",
    4: "comes to the surface",
}
"""Action of the vehicle without a ground station, by FS_GCS_ENABLE; none at 0 and 1."""


POSITION_MODES = (mode_name(Mode.GUIDED), mode_name(Mode.POSHOLD))
"""Modes in which a vehicle holds its place by its position estimate."""


def stand_by(
    session: Session,
    ending: Ending = "hold",
    *,
    on_note: Callable[[str], None] = lambda text: None,
    should_stop: Callable[[], bool] = lambda: False,
    policy: FlightPolicy = FlightPolicy(),
) -> str:
    """Hold a vehicle and keep its link alive until another ground station takes over.

    Parameters
    ----------
    session : Session
        The vehicle, after a flight.
    ending : {"hold", "position-hold", "surface", "leave"}
        Action of the vehicle.
    on_note : callable, optional
        Called with lines about the present and the next action of the vehicle.
    should_stop : callable, optional
        Polled; True ends standby, as does a KeyboardInterrupt.
    policy : FlightPolicy
        Limits.

    Returns
    -------
    str
        Reason why standby ended.
    """
    if ending == "leave":
        return "as asked for"
    if session.latest.position is None:
        return "the vehicle was never there"
    try:
        return _Standby(session, ending, on_note, policy).run(should_stop)
    except KeyboardInterrupt:
        return "Ctrl-C"


def do_without_estimate(session: Session, policy: FlightPolicy) -> None:
    """Put a vehicle that would follow a wrong estimate into ALT_HOLD; request it until it is."""
    waited, request_at = 0.0, 0.0
    while session.latest.mode in POSITION_MODES:
        if waited >= policy.max_answer_s or session.silent_s > policy.max_silence_s:
            return
        if waited >= request_at:
            request_at = waited + policy.retry_s
            session.command(dialect().MAV_CMD_DO_SET_MODE, 1, Mode.ALT_HOLD)
        session.sleep(policy.standby_poll_s)
        waited += policy.standby_poll_s


class _Standby:
    """Vehicle on standby.

    Attributes
    ----------
    is_held
        Whether it was commanded to stay since the link was last up.
    is_unaided
        Whether it was put into ALT_HOLD because it has no estimate.
    has_reported_loss
        Whether the loss of the estimate was reported.
    unaided_since
        Time by the vehicle's clock since which nothing corrects its estimate, s.
    request_mode_at
        Time by the vehicle's clock at which the mode is requested again, s.
    other_stations
        Ground stations that were heard, but that the vehicle does not count on.
    """

    def __init__(
        self, session: Session, ending: Ending, on_note: Callable[[str], None], policy: FlightPolicy
    ) -> None:
        self.session, self.ending, self.on_note = session, ending, on_note
        self.vehicle = LinkedVehicle(session, 1.0, policy)
        self.policy = policy
        self.is_held = self.is_unaided = self.has_reported_loss = False
        self.request_mode_at = -np.inf
        self.unaided_since: float | None = None
        self.other_stations: set[int] = set()

    def run(self, should_stop: Callable[[], bool]) -> str:
        """Stand by until a reason to end arises; return the reason."""
        policy = self.policy
        self._hold()
        waited, request_at, has_outlook = 0.0, 0.0, False
        while True:
            if waited >= request_at and waited < policy.max_answer_s:
                request_at = waited + policy.retry_s
                self._request_parameters()
            if should_stop():
                return "Ctrl-C"
            reason = self._reason_to_end()
            if reason is not None:
                return self._end(reason)
            if self.is_settled or waited >= policy.max_answer_s:
                if self.needs_nobody:
                    return self._end(
                        "the vehicle stays as it is without a ground station (FS_GCS_ENABLE)"
                    )
                if not has_outlook:
                    has_outlook = True
                    self.on_note(self._outlook())
            self._hold()
            self.session.sleep(policy.standby_poll_s)
            waited += policy.standby_poll_s

    def _request_parameters(self) -> None:
        """Request the parameters of the failsafe that are not known yet."""
        for name in (FAILSAFE, FAILSAFE_TIME):
            if self.session.parameter(name) is None:
                self.session.request_parameter(name)

    def _reason_to_end(self) -> str | None:
        """Return why nobody needs to stand by; None if somebody does."""
        session, policy = self.session, self.policy
        if session.latest.armed is False:
            return "the vehicle is disarmed: nothing is left to hold"
        station = session.ground_station(policy.max_silence_s)
        if station == GROUND_STATION:
            return f"a ground station (system {station}) has taken over"
        if station is not None and station not in self.other_stations:
            self.other_stations.add(station)
            self.on_note(
                f"ground station {station} is heard, but the vehicle needs system "
                f"{GROUND_STATION}: netsp keeps the link alive"
            )
        if session.silent_s > policy.max_standby_silence_s:
            return f"the vehicle was not heard for {session.silent_s:.0f} s"
        return None

    @property
    def is_settled(self) -> bool:
        """Return whether the parameters of the failsafe are known, and the vehicle has its mode."""
        mode = ENDING_MODES.get(self.ending)
        has_mode = mode is None or self.session.latest.mode == mode_name(mode)
        names = (FAILSAFE, FAILSAFE_TIME)
        return has_mode and all(self.session.parameter(name) is not None for name in names)

    @property
    def needs_nobody(self) -> bool:
        """Return whether the vehicle reports that it does nothing without a ground station."""
        enabled = self.session.parameter(FAILSAFE)
        return enabled is not None and round(enabled) not in CONSEQUENCES

    def _hold(self) -> None:
        """Command the ending, unless a pilot controls the vehicle or it has no estimate."""
        session = self.session
        try:
            self.vehicle.check()
        except StopsFlightError:
            self._do_without_estimate()
            if session.silent_s > self.policy.max_silence_s:
                self.is_held = False  # it may have gone on meanwhile
            return
        if not self.is_held:
            self.is_held = True
            self.vehicle.hold()
        else:
            self.vehicle.keep()
        if self.ending in ENDING_MODES and session.latest.time >= self.request_mode_at:
            self.request_mode_at = session.latest.time + self.policy.max_answer_s
            session.command(dialect().MAV_CMD_DO_SET_MODE, 1, ENDING_MODES[self.ending])

    def _do_without_estimate(self) -> None:
        """Put a vehicle whose estimate is lost, or drifts for some seconds, into ALT_HOLD."""
        now, fault = self.session.latest, self.vehicle.aiding_fault
        if now.estimate is not False and fault is None:
            self.unaided_since = None
            return
        if now.mode not in POSITION_MODES:
            return
        if self.unaided_since is None:
            self.unaided_since = now.time
        is_useless = now.estimate is False or self.session.is_distrusted
        wait_s = 0.0 if is_useless else self.policy.max_unaided_hold_s
        is_heard = self.session.silent_s <= self.policy.max_silence_s
        if is_heard and now.time - self.unaided_since >= wait_s and not self.is_unaided:
            if not self.has_reported_loss:
                self.has_reported_loss = True
                self.on_note(f"the position estimate is unusable ({fault or 'lost'}): ALT_HOLD")
            do_without_estimate(self.session, self.policy)
            self.is_unaided = self.session.latest.mode == mode_name(Mode.ALT_HOLD)

    def _outlook(self) -> str:
        """Return a line about what the vehicle does now, and what it will do without netsp."""
        session, mode = self.session, self.session.latest.mode
        doing = {
            "GUIDED": "the vehicle holds its place",
            "POSHOLD": "the vehicle holds its place in POSHOLD",
            "SURFACE": "the vehicle comes to the surface",
        }.get(mode or "", f"the vehicle is in {mode}, and netsp does not steer it")
        enabled = session.parameter(FAILSAFE)
        consequence = CONSEQUENCES.get(2 if enabled is None else round(enabled), "stays as it is")
        after = session.parameter(FAILSAFE_TIME)
        seconds = self.policy.failsafe_s if after is None or not np.isfinite(after) else after
        return (
            f"{doing}; netsp keeps its link alive until a ground station (system "
            f"{GROUND_STATION}) is heard. Ctrl-C ends that: the vehicle then {consequence} after "
            f"{seconds:g} s"
        )

    def _end(self, why: str) -> str:
        self.on_note(why)
        return why
