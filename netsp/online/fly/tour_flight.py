"""A tour flown: `execute` with a vehicle at the other end of a link, and what stops it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from netsp.base.errors import InputError
from netsp.judge import verify
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.online.execute.events import Event, Surprises
from netsp.online.execute.execution_log import Execution, ExecutionOptions, ExecutionRow
from netsp.online.execute.run_record import RunRecord
from netsp.online.execute.tour_execution import StopsFlightError, execute
from netsp.online.fly.flight_policy import FlightPolicy
from netsp.online.fly.flight_rehearsal import rehearse
from netsp.online.fly.preflight_checks import ready
from netsp.online.fly.resume import BeginsAt
from netsp.online.fly.standby import do_without_estimate
from netsp.online.fly.vehicle import LOOK_S, LinkedVehicle
from netsp.online.link.modes import GUIDED, mode_name
from netsp.online.link.session import Session

NEAR_START = 2.0
"""Metres from the start at which a vehicle may be armed."""

LEAST_REACH = 0.15
"""Metres: targets are a decimetre deep where the tour is at the surface, and it holds to 0.13."""


def fly(
    problem: Problem,
    solution: Solution,
    session: Session,
    options: ExecutionOptions | None = None,
    *,
    surprises: Surprises | None = None,
    incoming: Callable[[], list[Event]] | None = None,
    on_step: Callable[[ExecutionRow], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    policy: FlightPolicy | None = None,
    any_vehicle: bool = False,
    record: RunRecord | None = None,
    begins: BeginsAt | None = None,
) -> Execution:
    """Carry a tour out with a vehicle.

    Parameters
    ----------
    problem : Problem
        What was solved.
    solution : Solution
        The plan.
    session : Session
        The vehicle. On a machine that never flew, call `netsp.online.fly.flight_rehearsal.rehearse`
        before it is there: it takes a minute or two, and a vehicle that is armed drifts meanwhile.
    options : ExecutionOptions, optional
        Reach, speed and planning limit count.
    surprises : Surprises, optional
        Events that are known to come.
    incoming : callable, optional
        Asked at every step for events that have come since.
    on_step : callable, optional
        Called with every row; a KeyboardInterrupt ends the flight.
    should_stop : callable, optional
        Asked while the vehicle is not ready yet; a KeyboardInterrupt is raised then.
    policy : FlightPolicy, optional
        Limits of the flight.
    any_vehicle : bool
        Command any vehicle; by default only a submarine with ArduPilot.
    record : RunRecord, optional
        Takes every row, and the state, as the flight goes on.
    begins : callable, optional
        Says how the tether lies, and what is left, where the vehicle is; by default the flight
        begins at the start of the tour.

    Returns
    -------
    Execution
        What came of it; `stopped` says why it ended before the tour did.

    Raises
    ------
    InputError
        As of `execute`.
    RefusedError
        As of `netsp.online.fly.preflight_checks.ready`.
    Exception
        Anything that a callable or netsp itself raises under way, once the vehicle was told to hold
        its place and the state was written.
    """
    options = options or ExecutionOptions(reach=0.3)
    judged = verify(problem, solution) if begins is None else None
    if judged is not None and not judged:
        failed = next(c for c in judged.checks if not c.passed)
        raise InputError(f"solution: fails its check {failed.name!r}: {failed.detail}")
    check_options(options, surprises)
    rehearse()
    start = np.array(problem.base if problem.state is None else problem.state.position)
    near = NEAR_START if begins is None else np.inf
    ready(session, start, near, should_stop, any_vehicle=any_vehicle)
    resume_point = begins and begins(np.array(session.now.position))
    session.places()  # of before the flight
    vehicle = LinkedVehicle(session, options.reach, policy)
    try:
        done = execute(
            problem,
            solution,
            replace(options, vehicle="linked"),
            surprises=surprises,
            on_step=on_step,
            vehicle=vehicle,
            incoming=incoming,
            record=record,
            resume_point=resume_point,
        )
    except (Exception, KeyboardInterrupt):
        if vehicle.sent:
            _leave(session, vehicle)
        raise
    if done.stopped or done.interrupted:
        _leave(session, vehicle)
    return done


def check_options(options: ExecutionOptions, surprises: Surprises | None) -> None:
    """Whether a vehicle can be flown so.

    Parameters
    ----------
    options : ExecutionOptions
        Reach counts.
    surprises : Surprises or None
        Events that are known to come.

    Raises
    ------
    InputError
        It cannot.
    """
    if surprises is not None and any(e.kind == "push" for e in surprises.events):
        raise InputError("surprises: push: a real vehicle says itself where it is; expected none")
    if options.reach < LEAST_REACH:
        raise InputError(f"reach: expected at least {LEAST_REACH:g}, got {options.reach:g}")


def _leave(session: Session, vehicle: LinkedVehicle) -> None:
    """Have the vehicle stay where it is, unless somebody else has it by now."""
    try:
        vehicle.check()
    except StopsFlightError:
        if session.now.mode != mode_name(GUIDED) or session.now.armed is not True:
            return
        if session.now.estimate is not False and not session.is_distrusted:
            if vehicle.source_lost is None:
                return
            # stop by the estimate while it is good for that, then do without it
            vehicle.halt()
            until = vehicle.time + vehicle.policy.max_unaided_hold_s
            while vehicle.time < until and session.silent_s <= vehicle.policy.max_silence_s:
                session.sleep(LOOK_S)
            if vehicle.source_lost is None:
                return
        do_without_estimate(session, vehicle.policy)
        return
    vehicle.halt()
