"""Checks before a vehicle is moved."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from netsp.base.arrays import Floats
from netsp.online.fly.flight_policy import FlightPolicy
from netsp.online.fly.stopped import RefusedError
from netsp.online.link.dialect import dialect
from netsp.online.link.modes import Mode, mode_name
from netsp.online.link.session import Session


def make_ready(
    session: Session,
    start: Floats,
    max_distance: float,
    should_stop: Callable[[], bool] = lambda: False,
    *,
    any_vehicle: bool = False,
    policy: FlightPolicy = FlightPolicy(),
) -> None:
    """Make a vehicle ready for its first target, or refuse.

    Parameters
    ----------
    session : Session
        The vehicle.
    start : ndarray, shape (3,)
        Start of the tour, m.
    max_distance : float
        Largest distance of the vehicle from the start, m.
    should_stop : callable, optional
        Polled while waiting; True raises a KeyboardInterrupt.
    any_vehicle : bool
        Command any vehicle; by default only an ArduPilot submarine, because others use the
        same numbers for other modes and targets.
    policy : FlightPolicy
        Longest waits.

    Raises
    ------
    RefusedError
        The vehicle is not heard, is no submarine with ArduPilot, has no position estimate, is away
        from the start or disarmed, or does not accept the mode GUIDED.
    """
    checks = _Checks(session, should_stop, policy)
    checks.require_heartbeat()
    if not any_vehicle:
        checks.require_submarine()
    session.request_positions()
    checks.require_place(start, max_distance)
    checks.require_guided()


class _Checks:
    """Checks of a vehicle before its flight; each raises RefusedError."""

    def __init__(
        self, session: Session, should_stop: Callable[[], bool], policy: FlightPolicy
    ) -> None:
        self.session, self.should_stop, self.policy = session, should_stop, policy

    def wait_for(self, condition: Callable[[], bool]) -> bool:
        """Wait until a condition holds, and return whether it does."""
        left = self.policy.max_ready_wait_s
        while left > 0.0:
            if self.should_stop():
                raise KeyboardInterrupt
            if condition():
                return True
            self.session.sleep(self.policy.standby_poll_s)
            left -= self.policy.standby_poll_s
        return condition()

    def require_heartbeat(self) -> None:
        """Wait for a heartbeat of the vehicle."""
        session, wait_s = self.session, self.policy.max_ready_wait_s
        if self.wait_for(lambda: session.silent_s < np.inf):
            return
        if session.others:
            raise RefusedError(
                f"heard from system {', '.join(map(str, session.others))}, but nothing from system "
                f"{session.system} for {wait_s:g} s: is that its id?"
            )
        if session.position_age_s < np.inf:
            raise RefusedError(
                f"positions come from system {session.system}, but no heartbeat for {wait_s:g} s: "
                "is the autopilot's stream forwarded whole?"
            )
        raise RefusedError(f"no vehicle has been heard for {wait_s:g} s: is the link right?")

    def require_submarine(self) -> None:
        """Refuse any vehicle but a submarine with ArduPilot."""
        session, kind = self.session, self.session.kind
        if kind is None or not kind.is_ardusub:
            raise RefusedError(
                f"system {session.system} is not a submarine with ArduPilot: it says that it is a "
                f"{kind}; choose another with --system, or command it anyway with --any-vehicle"
            )

    def require_place(self, start: Floats, max_distance: float) -> None:
        """Wait for position and arming; refuse a vehicle without position, far away or disarmed."""

        def is_known() -> bool:
            # a heartbeat tells whether the vehicle is armed, but not before its clock is known; the
            # next one may come a second after the first position
            now = self.session.latest
            return None not in (now.position, now.estimate, now.armed)

        self.wait_for(is_known)
        now = self.session.latest
        if now.position is None or not now.estimate:
            raise RefusedError("the vehicle has no position estimate")
        if now.armed is None:
            wait_s = self.policy.max_ready_wait_s
            raise RefusedError(f"the vehicle has not said for {wait_s:g} s whether it is armed")
        away = np.array(now.position) - start
        if float(np.hypot(*away[:2])) > max_distance:
            raise RefusedError(
                f"the vehicle is {float(np.hypot(*away[:2])):.1f} m from the start of the tour; "
                f"expected at most {max_distance:g} m: its first leg would be another"
            )
        if not now.armed:
            raise RefusedError("the vehicle is not armed: arm it when all is clear, and call again")

    def require_guided(self) -> None:
        """Put the vehicle into GUIDED."""
        session, guided = self.session, mode_name(Mode.GUIDED)
        if session.latest.mode == guided:
            return
        session.command(dialect().MAV_CMD_DO_SET_MODE, 1, Mode.GUIDED)
        if not self.wait_for(lambda: session.latest.mode == guided):
            raise RefusedError(
                f"the vehicle does not take the mode GUIDED: it is in {session.latest.mode}"
            )
