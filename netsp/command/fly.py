"""`netsp fly`: a tour carried out by a vehicle, over MAVLink."""

from __future__ import annotations

import argparse
import contextlib
import queue
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from netsp.base.errors import InputError
from netsp.command.clearance_warning import warn_of_problem
from netsp.command.types import load_verified_pair

if TYPE_CHECKING:
    from netsp.base.clock import Clock
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution
    from netsp.online.execute.events import Event, Surprises
    from netsp.online.execute.execution_log import Execution, ExecutionRow
    from netsp.online.fly.flight_policy import FlightPolicy
    from netsp.online.fly.flight_time import FlightTime
    from netsp.online.fly.resume import BeginsAt
    from netsp.online.guard.guard_page import Page
    from netsp.online.link.geo_frame import Frame
    from netsp.online.link.session import Session


def run(args: argparse.Namespace) -> int:
    """Fly the tour, write what happened, and return the exit code."""
    if args.dry_run and args.json:
        raise InputError("--json: a dry run prints its targets as a table; expected no --json")
    if args.link is None and not args.dry_run:
        raise InputError("--link: missing; expected the vehicle's address, or --dry-run")
    from netsp.command.execute import checked_surprises
    from netsp.command.flight import exit_code
    from netsp.online.link.address import Address
    from netsp.online.link.geo_frame import Frame

    if args.link is not None:
        Address.parse(args.link)
    problem, solution, begins = _inputs(args)
    surprises = checked_surprises(args, problem)
    if problem.units != "m":
        raise InputError(f"units: vehicles use metres; expected m, got {problem.units!r}")
    frame = Frame(problem, args.frame)
    if not args.quiet:
        warn_of_problem(args, problem, solution.margin)
    predicted = None
    if begins is None and args.speed > 0.0:
        from netsp.online.fly.flight_time import predicted_flight

        predicted = predicted_flight(problem, solution, args.speed, args.reach)
    if args.dry_run:
        print_targets(problem, solution, frame)
    if predicted is not None and not args.quiet:
        print(
            f"about {predicted.total_s:.0f} s at {args.speed:g} m/s in still water", file=sys.stderr
        )
    if args.dry_run:
        return 0
    with ExitStack() as stack:
        done, session, clock = _flown(
            args, problem, solution, frame, surprises, begins, stack, predicted
        )
        if isinstance(done, BaseException):
            failure: BaseException | None = done
            has_pressed_again = isinstance(done, KeyboardInterrupt)
        else:
            failure, has_pressed_again = _report_failure(args, done)
        if isinstance(failure, Exception):
            complain(f"{type(failure).__name__}: {failure}; the flight ends here")
        _stand_by(args, session, clock, has_pressed_again)
    if failure is not None:
        raise failure
    assert not isinstance(done, BaseException)
    return exit_code(done.summary, done.summary["home"], done.summary["tether_free"])


def _inputs(args: argparse.Namespace) -> tuple[Problem, Solution, BeginsAt | None]:
    """Return problem and tour, and how the flight begins if not at the start of the tour."""
    from netsp.online.fly.resume import (
        from_guard,
        from_record,
        from_word,
        parse_class,
        read_run,
        whole_tour,
    )

    if args.word is not None and args.class_from is not None:
        raise InputError("--class, --class-from: expected one of them")
    word = None if args.word is None else parse_class(args.word)
    begins_elsewhere = any(x is not None for x in (args.resume, word, args.class_from))
    if args.dry_run and begins_elsewhere:
        raise InputError(
            "--dry-run: --resume, --class and --class-from plan from where the vehicle is; "
            "expected none of them"
        )
    if args.resume is None:
        if args.problem is None or args.solution is None:
            raise InputError("PROBLEM, TOUR: missing; expected two files, or --resume RUN")
        problem, solution = load_verified_pair(args.problem, args.solution)
        state = None
    else:
        if args.problem is not None:
            raise InputError("--resume: RUN has problem and tour; expected no PROBLEM and TOUR")
        problem, solution, state = read_run(args.resume)
        args.output = args.output or _next_folder(args.resume)
        if Path(args.output).resolve() == Path(args.resume).resolve():
            raise InputError("-o: is the folder of the resumed flight; expected another one")
    if not begins_elsewhere:
        return problem, solution, None
    remaining = state or whole_tour(problem, solution)
    if word is not None:
        return problem, solution, from_word(problem, word, remaining)
    if args.class_from is not None:
        return problem, solution, from_guard(problem, args.class_from, remaining)
    return problem, solution, from_record(problem, remaining)


def _next_folder(run: str) -> str:
    """Return a folder for a resumed flight; it does not exist yet."""
    names = ("resumed", *(f"resumed-{k}" for k in range(2, 1000)))
    return str(next(f for name in names if not (f := Path(run) / name).exists()))


def complain(text: str) -> None:
    """Print a line to standard error; a failure is ignored, so that the flight goes on."""
    with contextlib.suppress(OSError, ValueError):
        print(f"\nnetsp: {text}", file=sys.stderr, flush=True)


def _report_failure(args: argparse.Namespace, done: Execution) -> tuple[Exception | None, bool]:
    """Write the files of the run and print its result; return an exception that this raised, and
    whether Ctrl-C was pressed meanwhile. The caller stands by the vehicle in either case."""
    from netsp.base.interrupt_signals import deferred_interrupts
    from netsp.command.execute import write_result

    failure = None
    try:
        with deferred_interrupts():
            try:
                write_result(args, done)
                if not args.quiet and (done.stopped or done.interrupted):
                    print(path_home(done), file=sys.stderr)
            except Exception as error:
                failure = error
    except KeyboardInterrupt:
        return failure, True
    return failure, False


def _stand_by(
    args: argparse.Namespace, session: Session, clock: Clock, has_pressed_again: bool
) -> None:
    """Stand by the vehicle until another ground station takes over, or Ctrl-C: the second one, if
    the first ended the flight. If the second one came before standby began, standby ends as soon
    as it has printed what the vehicle will do."""
    from netsp.online.fly.standby import stand_by

    has_stopped = clock.is_stopped
    messages_sent: list[str] = []

    def say(text: str) -> None:
        messages_sent.append(text)
        with contextlib.suppress(OSError, ValueError):  # the terminal may have gone
            for line in session.new_texts():
                print(f"the vehicle says: {line}", file=sys.stderr)
            print(f"netsp: {text}", file=sys.stderr, flush=True)

    def should_stop() -> bool:
        # where the first Ctrl-C has ended the flight, the next one interrupts
        return bool(messages_sent) if has_pressed_again else clock.is_stopped and not has_stopped

    stand_by(session, args.at_end, on_note=say, should_stop=should_stop)


def _flown(
    args: argparse.Namespace,
    problem: Problem,
    solution: Solution,
    frame: Frame,
    surprises: Surprises | None,
    begins: BeginsAt | None,
    stack: ExitStack,
    predicted: FlightTime | None,
) -> tuple[Execution | BaseException, Session, Clock]:
    """Fly the tour, or return what ended the flight under way; the link stays open until the stack
    is left."""
    from netsp.base.files import output_folder
    from netsp.base.interrupt_signals import until_interrupt
    from netsp.command.execute import show_execution
    from netsp.online.execute.execute_policy import RepairPolicy
    from netsp.online.execute.execution_log import ExecutionOptions
    from netsp.online.execute.run_record import RunRecord
    from netsp.online.execute.tether_reserve import ReservePolicy
    from netsp.online.fly.flight_rehearsal import rehearse
    from netsp.online.fly.flight_time import FlightClock
    from netsp.online.fly.tour_flight import check_options, fly
    from netsp.online.link.address import Address
    from netsp.online.link.session import Session
    from netsp.online.link.udp import UdpLink

    options = ExecutionOptions(
        speed=args.speed,
        reach=args.reach,
        seed=args.seed,
        planning_limit=args.planning_limit or RepairPolicy.time_limit_s,
        reserve_policy=ReservePolicy(args.reserve),
    )
    address = Address.parse(args.link)
    check_options(options, surprises)
    stack.enter_context(output_folder(args.output))
    rehearse()
    page, sources = None, []
    if args.events:
        from netsp.online.fly.inputs import read_events

        sources.append(read_events(getattr(sys.stdin, "buffer", sys.stdin), complain))
    if args.page is not None:
        from netsp.online.guard.guard_page import Page

        page = stack.enter_context(Page(problem, args.page, accepts_events=True))
        print(f"the page is {page.address}", file=sys.stderr)
        sources.append(_events_from(page, complain))
    shows = not args.quiet and sys.stderr.isatty()
    show_row = None
    if shows and predicted is not None:
        show_row = show_execution(problem, FlightClock(predicted).total_s)
    elif shows:
        show_row = show_execution(problem)
    guard_row = None if page is None else _guard_callback(problem, page, args.speed)
    # the link last: while it is open, the vehicle counts on our heartbeats
    session = Session(UdpLink(address), frame, args.system, args.pace)
    stack.callback(session.close)
    if not args.quiet:
        print(f"waiting for system {args.system} on {args.link}", file=sys.stderr)
    clock = stack.enter_context(until_interrupt(None))

    rows: list[ExecutionRow] = []

    def on_step(row: ExecutionRow) -> None:
        rows[:] = [row]
        if clock.is_stopped:
            raise KeyboardInterrupt
        for text in session.new_texts():
            if not args.quiet:
                print(f"\nthe vehicle says: {text}", file=sys.stderr)
        for call in (show_row, guard_row):
            if call is not None:
                call(row)

    try:
        done = fly(
            problem,
            solution,
            session,
            options,
            surprises=surprises,
            on_step=on_step,
            should_stop=lambda: clock.is_stopped,
            any_vehicle=args.any_vehicle,
            begins=begins,
            record=None if args.output is None else RunRecord(args.output, solution),
            incoming=(lambda: [e for s in sources for e in s()]) if sources else None,
        )
    except (Exception, KeyboardInterrupt) as error:
        if not rows:
            raise
        session.send_text(f"flight ended by {type(error).__name__}: {error}", is_urgent=True)
        return error, session, clock
    if done.stopped:
        session.send_text(f"flight stopped: {done.stopped}", is_urgent=True)
    return done, session, clock


def _events_from(page: Page, complain: Callable[[str], None]) -> Callable[[], list[Event]]:
    """Return a function that returns the events that a page has sent since the last call."""
    from netsp.online.fly.inputs import parse_event

    def new_events() -> list[Event]:
        events = []
        while True:
            try:
                events.append(parse_event(page.events.get_nowait()))
            except queue.Empty:
                return events
            except InputError as error:
                complain(f"not understood: {error}")

    return new_events


def _guard_callback(problem: Problem, page: Page, speed: float) -> Callable[[ExecutionRow], None]:
    """Return a callback that shows on a page what a guard reports about the flight."""
    from netsp.online.guard.guard_rehearsal import rehearse
    from netsp.online.guard.telemetry import Fix
    from netsp.online.guard.tether_guard import Guard, GuardOptions

    rehearse(in_space=False)
    guard = Guard(problem, GuardOptions(noise=0.05, drift=0.05, speed=max(speed, 0.1)))

    def on_step(row: ExecutionRow) -> None:
        place = (row.x, row.y, row.z)
        page.send(guard.update(Fix(row.time, place, mode=row.mode, estimate=True)).as_row())

    return on_step


def print_targets(problem: Problem, solution: Solution, frame: Frame) -> None:
    """Print the targets that would be sent, in order."""
    from netsp.exchange.missions.mission_files import altitude
    from netsp.plan.tour_plan import HOME, legs_of

    head = ("latitude", "longitude", "above home") if frame.is_global else ("north", "east", "down")
    print(f"{'target':>6}  {head[0]:>12} {head[1]:>12} {head[2]:>10}  what")
    number = 0
    for leg in legs_of(problem, solution):
        for k, point in enumerate(leg.path[1:], 2):
            place = (float(point[0]), float(point[1]), altitude(float(point[2])))
            is_last = k == len(leg.path)
            name = "the base" if leg.goal == HOME else problem.goal_label(leg.goal)
            number += 1
            if frame.is_global:
                lat, lon, up = frame.to_global(place)
                cells = f"{lat * 1e-7:>12.7f} {lon * 1e-7:>12.7f} {up:>10.2f}"
            else:
                cells = " ".join(
                    f"{v:>{w}.2f}" for v, w in zip(frame.to_local(place), (12, 12, 10), strict=True)
                )
            print(f"{number:>6}  {cells}  {name if is_last else 'bend'}")


def path_home(done: Execution, policy: FlightPolicy | None = None) -> str:
    """Return the path home, in the tether's class, from the last position of the vehicle.

    Waypoints without which the path stays within a share of the clearance from the tether are left
    out.
    """
    import numpy as np

    from netsp.base.geometry import polylines
    from netsp.online.fly.flight_policy import FlightPolicy

    policy = policy or FlightPolicy()
    line = np.asarray(done.tethers[-1][1], dtype=float)[::-1]
    length = polylines.length(line)
    kept = polylines.essential(line, policy.max_home_offset * done.problem.clearance)
    bends = ", ".join(f"({x:.2f}, {y:.2f}, {z:.2f})" for x, y, z in line[kept][1:])
    return (
        f"home     back along the tether: {length:.1f} {done.problem.units}, "
        f"{length / done.options.speed:.0f} s, by {bends}"
    )
