"""Standby after a flight: hold the vehicle until another ground station takes over.

A few seconds after the last heartbeat of a ground station, ArduSub disarms and drifts, or does what
its parameter FS_GCS_ENABLE says. So netsp keeps sending heartbeats after the flight, and holds the
vehicle where it is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

import numpy as np

from netsp.online.execute.tour_execution import StopsFlightError
from netsp.online.fly.flight_policy import FlightPolicy
from netsp.online.fly.vehicle import LinkedVehicle
from netsp.online.link.dialect import GROUND_STATION, dialect
from netsp.online.link.modes import ALT_HOLD, GUIDED, POSHOLD, SURFACE, mode_name
from netsp.online.link.session import Session

Ending = Literal["hold", "position-hold", "surface", "leave"]
"""Action of a vehicle after a flight: hold its place in GUIDED or in POSHOLD, come to the surface,
or stay as it is with no heartbeats from us."""

ENDINGS: tuple[Ending, ...] = get_args(Ending)

ASKED = {"position-hold": POSHOLD, "surface": SURFACE}
"""Mode that each ending asks for."""

FAILSAFE, FAILSAFE_TIME = "FS_GCS_ENABLE", "FS_GCS_TIMEOUT"
"""Parameters: what the vehicle does without a ground station, and after how many seconds."""

FAILSAFE_S = 5.0
"""Seconds that ArduSub waits where FS_GCS_TIMEOUT is not known."""

CONSEQUENCES = {
    2: "disarms and drifts",
    3: "holds its depth (ALT_HOLD) and drifts",
    4: "comes to the surface",
}
"""Action of the vehicle without a ground station, by FS_GCS_ENABLE; none at 0 and 1."""

LOOK_S = 0.1
"""Period of standby, s: messages are read and conditions checked this often."""


def stand_by(
    session: Session,
    ending: Ending = "hold",
    *,
    say: Callable[[str], None] = lambda text: None,
    should_stop: Callable[[], bool] = lambda: False,
    policy: FlightPolicy | None = None,
) -> str:
    """Hold a vehicle and keep its link alive until another ground station takes over.

    Parameters
    ----------
    session : Session
        The vehicle, after a flight.
    ending : {"hold", "position-hold", "surface", "leave"}
        Action of the vehicle.
    say : callable, optional
        Called with lines about the present and the next action of the vehicle.
    should_stop : callable, optional
        Polled; True ends standby, as does a KeyboardInterrupt.
    policy : FlightPolicy, optional
        Limits.

    Returns
    -------
    str
        Reason why it ended.
    """
    if ending == "leave":
        return "as asked for"
    if session.now.position is None:
        return "the vehicle was never there"
    try:
        return _Standby(session, ending, say, policy).run(should_stop)
    except KeyboardInterrupt:
        return "Ctrl-C"


def do_without_estimate(session: Session, policy: FlightPolicy) -> None:
    """Put a vehicle that would follow a wrong estimate into ALT_HOLD; ask again until it is.

    Parameters
    ----------
    session : Session
        The vehicle.
    policy : FlightPolicy
        Limits.
    """
    waited, ask_at = 0.0, 0.0
    while session.now.mode in (mode_name(GUIDED), mode_name(POSHOLD)):
        if waited >= policy.max_answer_s or session.silent_s > policy.max_silence_s:
            return
        if waited >= ask_at:
            ask_at = waited + policy.retry_s
            session.command(dialect().MAV_CMD_DO_SET_MODE, 1, ALT_HOLD)
        session.sleep(LOOK_S)
        waited += LOOK_S


class _Standby:
    """Vehicle on standby.

    Attributes
    ----------
    is_held
        True once it was commanded where to stay, since the link was last up.
    is_unaided
        True once it was put into ALT_HOLD because it has no estimate.
    has_told
        True once the loss of the estimate was reported.
    unaided_since
        Time by the vehicle's clock since which it has no source of its estimate.
    ask_again
        Time by the vehicle's clock at which the mode is asked for again.
    strangers
        Ground stations that were heard, but that the vehicle does not count on.
    """

    def __init__(
        self, session: Session, ending: Ending, say: Callable[[str], None],
        policy: FlightPolicy | None,
    ) -> None:  # fmt: skip
        self.session, self.ending, self.say = session, ending, say
        self.vehicle = LinkedVehicle(session, 1.0, policy)
        self.policy = self.vehicle.policy
        self.is_held = self.is_unaided = self.has_told = False
        self.ask_again = -np.inf
        self.unaided_since: float | None = None
        self.strangers: set[int] = set()

    def run(self, should_stop: Callable[[], bool]) -> str:
        """Stand by until a reason to end arises; return the reason."""
        session = self.session
        self._hold()
        waited, ask_at, told = 0.0, 0.0, False
        while True:
            if waited >= ask_at and waited < self.policy.max_answer_s:
                ask_at = waited + self.policy.retry_s
                for name in (FAILSAFE, FAILSAFE_TIME):
                    if session.parameter(name) is None:
                        session.ask_parameter(name)
            if should_stop():
                return "Ctrl-C"
            if session.now.armed is False:
                return self._ended("the vehicle is disarmed: nothing is left to hold")
            station = session.ground_station(self.policy.max_silence_s)
            if station == GROUND_STATION:
                return self._ended(f"a ground station (system {station}) has taken over")
            if station is not None and station not in self.strangers:
                self.strangers.add(station)
                self.say(
                    f"ground station {station} is heard, but the vehicle counts on system "
                    f"{GROUND_STATION}: netsp goes on"
                )
            if session.silent_s > self.policy.max_standby_silence_s:
                return self._ended(f"the vehicle was not heard for {session.silent_s:.0f} s")
            if not self.is_settled and waited < self.policy.max_answer_s:
                pass
            elif self.needs_nobody:
                return self._ended("the vehicle stays so without a ground station (FS_GCS_ENABLE)")
            elif not told:
                told = True
                self.say(self._outlook())
            self._hold()
            session.sleep(LOOK_S)
            waited += LOOK_S

    @property
    def is_settled(self) -> bool:
        """Return whether the vehicle has told what it does without a ground station, and has the
        mode that it is to have."""
        asked = ASKED.get(self.ending)
        is_so = asked is None or self.session.now.mode == mode_name(asked)
        names = (FAILSAFE, FAILSAFE_TIME)
        return is_so and all(self.session.parameter(name) is not None for name in names)

    @property
    def needs_nobody(self) -> bool:
        """Return whether the vehicle has said that it does nothing without a ground station."""
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
        if self.ending in ASKED and session.now.time >= self.ask_again:
            self.ask_again = session.now.time + self.policy.max_answer_s
            session.command(dialect().MAV_CMD_DO_SET_MODE, 1, ASKED[self.ending])

    def _do_without_estimate(self) -> None:
        """Put a vehicle whose estimate is lost, or drifts for some seconds, into ALT_HOLD."""
        now, lost = self.session.now, self.vehicle.source_lost
        if now.estimate is not False and lost is None:
            self.unaided_since = None
            return
        if now.mode not in (mode_name(GUIDED), mode_name(POSHOLD)):
            return
        if self.unaided_since is None:
            self.unaided_since = now.time
        is_useless = now.estimate is False or self.session.is_distrusted
        wait = 0.0 if is_useless else self.policy.max_unaided_hold_s
        is_heard = self.session.silent_s <= self.policy.max_silence_s
        if is_heard and now.time - self.unaided_since >= wait and not self.is_unaided:
            if not self.has_told:
                self.has_told = True
                self.say(f"the position estimate is unusable ({lost or 'lost'}): ALT_HOLD")
            do_without_estimate(self.session, self.policy)
            self.is_unaided = self.session.now.mode == mode_name(ALT_HOLD)

    def _outlook(self) -> str:
        """Return a line about what the vehicle does now, and what it will do without netsp."""
        session, mode = self.session, self.session.now.mode
        doing = {
            "GUIDED": "the vehicle holds its place",
            "POSHOLD": "the vehicle holds its place in POSHOLD",
            "SURFACE": "the vehicle comes to the surface",
        }.get(mode or "", f"the vehicle is in {mode}, and netsp does not steer it")
        enabled = session.parameter(FAILSAFE)
        consequence = CONSEQUENCES.get(2 if enabled is None else round(enabled), "stays as it is")
        after = session.parameter(FAILSAFE_TIME)
        seconds = FAILSAFE_S if after is None or not np.isfinite(after) else after
        return (
            f"{doing}; netsp keeps its link alive until a ground station (system "
            f"{GROUND_STATION}) is heard. Ctrl-C ends that: the vehicle then {consequence} after "
            f"{seconds:g} s"
        )

    def _ended(self, why: str) -> str:
        self.say(why)
        return why
