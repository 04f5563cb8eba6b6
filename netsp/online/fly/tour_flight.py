"""Flight of a tour: `execute` with a vehicle at the other end of a link, and what stops it."""

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
from netsp.online.fly.preflight_checks import make_ready
from netsp.online.fly.resume import BeginsAt
from netsp.online.fly.standby import do_without_estimate
from netsp.online.fly.vehicle import LinkedVehicle
from netsp.online.link.modes import Mode, mode_name
from netsp.online.link.session import Session


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
    policy: FlightPolicy = FlightPolicy(),
    any_vehicle: bool = False,
    record: RunRecord | None = None,
    begins: BeginsAt | None = None,
) -> Execution:
    """Carry a tour out with a vehicle.

    Parameters
    ----------
    problem : Problem
        Problem that was solved.
    solution : Solution
        Tour to fly.
    session : Session
        The vehicle. On a machine that never flew, call
        `netsp.online.fly.flight_rehearsal.rehearse`
        before it is there: it takes a minute or two, and a vehicle that is armed drifts
        meanwhile.
    options : ExecutionOptions, optional
        Reach, speed and planning limit count.
    surprises : Surprises, optional
        Events that are known to come.
    incoming : callable, optional
        Called at every step for new events.
    on_step : callable, optional
        Called with every row; a KeyboardInterrupt ends the flight.
    should_stop : callable, optional
        Polled while the vehicle is not ready yet; True raises a KeyboardInterrupt.
    policy : FlightPolicy
        Limits of the flight.
    any_vehicle : bool
        Command any vehicle; by default only a submarine with ArduPilot.
    record : RunRecord, optional
        Record of every row, and of the state, as the flight goes on.
    begins : callable, optional
        Returns how the tether lies, and which goals are left, at the vehicle's place; by
        default
        the flight begins at the start of the tour.

    Returns
    -------
    Execution
        The flight; `stopped` says why it ended before the tour did.

    Raises
    ------
    InputError
        The options or events are not valid, as of `execute`.
    RefusedError
        The vehicle is not ready, as of `netsp.online.fly.preflight_checks.make_ready`.
    Exception
        Anything that a callable or netsp itself raises under way, once the vehicle was
        commanded to
        hold its place and the state was written.
    """
    options = options or ExecutionOptions(reach=0.3)
    judged = verify(problem, solution) if begins is None else None
    if judged is not None and not judged:
        failed = next(c for c in judged.checks if not c.passed)
        raise InputError(f"solution: fails its check {failed.name!r}: {failed.detail}")
    check_options(options, surprises, policy)
    rehearse()
    start = np.array(problem.base if problem.state is None else problem.state.position)
    max_distance = policy.max_start_distance if begins is None else np.inf
    make_ready(session, start, max_distance, should_stop, any_vehicle=any_vehicle, policy=policy)
    resume_point = begins and begins(np.array(session.latest.position))
    session.new_places()  # drops those from before the flight
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


def check_options(
    options: ExecutionOptions, surprises: Surprises | None, policy: FlightPolicy = FlightPolicy()
) -> None:
    """Raise InputError if a real vehicle cannot be flown with this reach and these events."""
    if surprises is not None and any(e.kind == "push" for e in surprises.events):
        raise InputError("surprises: push: a real vehicle reports its own position; expected none")
    if options.reach < policy.min_reach:
        raise InputError(f"reach: expected at least {policy.min_reach:g}, got {options.reach:g}")


def _leave(session: Session, vehicle: LinkedVehicle) -> None:
    """Have the vehicle hold its place, unless a pilot has taken over."""
    try:
        vehicle.check()
    except StopsFlightError:
        now = session.latest
        if now.mode != mode_name(Mode.GUIDED) or now.armed is not True:
            return
        if session.latest.estimate is not False and not session.is_distrusted:
            if vehicle.aiding_fault is None:
                return
            # stop by the estimate while it is good enough, then do without it
            vehicle.halt()
            until = vehicle.time + vehicle.policy.max_unaided_hold_s
            while vehicle.time < until and session.silent_s <= vehicle.policy.max_silence_s:
                session.sleep(vehicle.policy.poll_s)
            if vehicle.aiding_fault is None:
                return
        do_without_estimate(session, vehicle.policy)
        return
    vehicle.halt()
