"""`netsp solve`: from a problem file to its solution, or from a mission to its plan."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from netsp.base.errors import EXIT_NOT_ALL, EXIT_NOT_VERIFIED, InfeasibleError, LimitReachedError
from netsp.command import json_output, messages, proving
from netsp.command.clearance_warning import warn_of_problem
from netsp.command.command_clock import command_clock
from netsp.command.command_options import given_params, names_of, refuse
from netsp.command.command_table import FOR_PROBLEMS

if TYPE_CHECKING:
    from netsp.base.clock import Clock
    from netsp.gtsp.travel.result import Progress
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution


def run(args: argparse.Namespace) -> int:
    """Solve, write, and return the exit code."""
    from netsp.base.files import is_mission_file
    from netsp.command import solve_mission

    if is_mission_file(args.problem):
        reason = f"is for problems, and {args.problem} is a mission; expected none"
        refuse(args, names_of(FOR_PROBLEMS), reason)
        return solve_mission.run(args)
    from netsp.base.interrupt_signals import until_interrupt
    from netsp.command.progress_table import ProgressTable, proof_line, summary
    from netsp.judge import checked
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution
    from netsp.plan import warm_start as warm_starts
    from netsp.plan.solve_problem import solve

    clock = command_clock(args.time_limit)
    problem = clock.bounded("reading the problem", lambda: Problem.load(args.problem))
    proving.check_provable(args, problem)
    warm = None
    if args.warm_start:
        warm = clock.bounded("reading --warm-start", lambda: Solution.load(args.warm_start))
        if text := warm_starts.edit_message(problem, warm):
            messages.note(text)
    rows: list[Progress] = []
    table = None if args.quiet else ProgressTable(sys.stderr, args.policy)

    def listen(row: Progress) -> None:
        if table:
            table(row)
        if args.plot_trace:
            rows.append(row)

    def tell(text: str) -> None:
        if table:
            table.tell("proof", text)

    # Ctrl-C during the solve also cancels the proof
    solving = until_interrupt(clock) if args.proof else contextlib.nullcontext(clock)
    with table or contextlib.nullcontext():
        if table:
            table.begin(problem)
        try:
            with solving as rest:
                try:
                    solution = solve(
                        problem,
                        args.solver,
                        roadmap=args.roadmap,
                        roadmap_options=roadmap_options(args),
                        time_limit=rest,
                        iteration_limit=args.iteration_limit,
                        seed=args.seed,
                        params=given_params(args),
                        warm_start=warm,
                        margin=args.margin,
                        slack=args.slack,
                        friction=args.friction,
                        max_tension_ratio=args.max_tension_ratio,
                        keep_order=args.keep_order,
                        on_progress=listen,
                    )
                except LimitReachedError:
                    if args.proof and rest.is_stopped:  # by Ctrl-C
                        raise KeyboardInterrupt from None
                    raise
                is_interrupted = bool(args.proof) and rest.is_stopped
        except InfeasibleError as error:
            none = proving.infeasible_solution(problem, args)
            if args.proof:
                none = proving.with_proof(args.proof, problem, none, clock, tell, args.proof_vipr)
                if table and none.certified == "optimal":
                    print(proof_line(problem, none, args.proof), file=sys.stderr)
            if args.json:
                json_output.tell(json_output.of_infeasible(problem, error, none))
            raise
        solution = checked(problem, solution)
        if args.proof:
            solution = _proven(args, problem, solution, clock, is_interrupted, tell)
    _write(args, solution)
    if args.plot or args.plot_trace:
        from netsp.view.pictures import problem_picture, style

        style.load_matplotlib()
        if args.plot:
            problem_picture.save(problem, solution, args.plot)
        if args.plot_trace:
            title = f"{problem.name}: {args.solver}"
            problem_picture.save_trace(rows, title, problem.units, args.plot_trace)
    if table:
        table.end()
        text = summary(
            problem, solution, args.output, args.plot, args.plot_trace, args.policy, args.proof
        )
        print(text, file=sys.stderr)
        if solution.tour:
            warn_of_problem(args, problem, args.margin)
    if args.json:
        json_output.tell(json_output.of_solution(problem, solution))
    return _EXIT.get(solution.status.value, 0)


def _proven(
    args: argparse.Namespace,
    problem: Problem,
    solution: Solution,
    clock: Clock,
    is_interrupted: bool,
    tell: Callable[[str], None],
) -> Solution:
    """Write a proof, and return the solution with what it shows; the solution is never lost."""
    from netsp.base.files import STANDARD

    if args.output not in (None, STANDARD):
        _write(args, solution)  # the file is kept if the process is killed during the proof
    if is_interrupted:
        clock.end()
    try:
        return proving.with_proof(args.proof, problem, solution, clock, tell, args.proof_vipr)
    except Exception:
        _write(args, solution)
        raise


def _write(args: argparse.Namespace, solution: Solution) -> None:
    """Write the solution; Ctrl-C waits until the file is written."""
    from netsp.base.files import STANDARD, write_text
    from netsp.base.interrupt_signals import deferred_interrupts

    with deferred_interrupts():  # Ctrl-C loses no tour
        write_text(args.output or STANDARD, solution.to_json())


_EXIT = {"infeasible": 3, "no_solution_found": EXIT_NOT_ALL, "invalid": EXIT_NOT_VERIFIED}


def roadmap_options(args: argparse.Namespace) -> dict[str, object]:
    """Return the options of a roadmap that were given."""
    options = {
        "samples": args.samples,
        "shortcut": args.shortcut or None,
        "max_classes": args.max_classes,
        "classes": args.classes_rule,
    }
    return {name: value for name, value in options.items() if value is not None}
