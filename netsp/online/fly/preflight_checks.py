"""What must hold before a vehicle is moved."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from netsp.base.arrays import Floats
from netsp.online.fly.stopped import RefusedError
from netsp.online.link.dialect import dialect
from netsp.online.link.modes import GUIDED, mode_name
from netsp.online.link.session import Session

WAIT_S = 10.0
"""Seconds to wait for the vehicle to speak, and for all that is asked of it."""

LOOK_S = 0.1


def ready(
    session: Session, start: Floats, near: float, should_stop: Callable[[], bool] = lambda: False,
    *, any_vehicle: bool = False,
) -> None:  # fmt: skip
    """Have a vehicle ready to be told where to go, or refuse.

    Parameters
    ----------
    session : Session
        The vehicle.
    start : ndarray, shape (3,)
        Where the tour begins, metres.
    near : float
        Metres from there at most.
    should_stop : callable, optional
        Asked while it waits; a KeyboardInterrupt is raised then.
    any_vehicle : bool
        Command any vehicle; by default only an ArduPilot submarine, because others use the
        same numbers for other modes and targets.

    Raises
    ------
    RefusedError
        It does not speak, is no submarine with ArduPilot, has no position estimate, is away from
        the start or disarmed, or does not take the mode GUIDED.
    """

    def until(holds: Callable[[], bool]) -> bool:
        return _until(session, holds, should_stop)

    if not until(lambda: session.silent_s < np.inf):
        if session.others:
            raise RefusedError(
                f"heard from system {', '.join(map(str, session.others))}, but nothing from system "
                f"{session.system} for {WAIT_S:g} s: is that its id?"
            )
        if session.unplaced_s < np.inf:
            raise RefusedError(
                f"positions come from system {session.system}, but no heartbeat for {WAIT_S:g} s: "
                "is the autopilot's stream forwarded whole?"
            )
        raise RefusedError(f"no vehicle has been heard for {WAIT_S:g} s: is the link right?")
    kind = session.kind
    if not (any_vehicle or (kind is not None and kind.is_ardusub)):
        raise RefusedError(
            f"system {session.system} is no submarine with ArduPilot: it says that it is a "
            f"{kind}; choose another with --system, or command it anyway with --any-vehicle"
        )
    session.ask_for_positions()
    m = dialect()

    def told() -> bool:
        # a heartbeat says whether it is armed, but before the vehicle's clock is known it says
        # nothing yet; the next may come a second after the first position
        now = session.now
        return None not in (now.position, now.estimate, now.armed)

    until(told)
    now = session.now
    if now.position is None or not now.estimate:
        raise RefusedError("the vehicle has no position estimate")
    if now.armed is None:
        raise RefusedError(f"the vehicle has not said for {WAIT_S:g} s whether it is armed")
    away = np.array(now.position) - start
    if float(np.hypot(*away[:2])) > near:
        raise RefusedError(
            f"the vehicle is {float(np.hypot(*away[:2])):.1f} m from the start of the tour; "
            f"expected at most {near:g} m: its first leg would be another"
        )
    if not now.armed:
        raise RefusedError("the vehicle is not armed: arm it when all is clear, and call again")
    if now.mode != mode_name(GUIDED):
        session.command(m.MAV_CMD_DO_SET_MODE, 1, GUIDED)
        if not until(lambda: session.now.mode == mode_name(GUIDED)):
            raise RefusedError(
                f"the vehicle does not take the mode GUIDED: it is in {session.now.mode}"
            )


def _until(session: Session, holds: Callable[[], bool], should_stop: Callable[[], bool]) -> bool:
    left = WAIT_S
    while left > 0.0:
        if should_stop():
            raise KeyboardInterrupt
        if holds():
            return True
        session.sleep(LOOK_S)
        left -= LOOK_S
    return holds()
