"""`netsp solve`: from a problem file to its solution, or from a mission to its plan."""

from __future__ import annotations

import argparse
import contextlib
import sys
from typing import TYPE_CHECKING

from netsp.base.errors import EXIT_NOT_ALL, EXIT_NOT_VERIFIED, InfeasibleError
from netsp.command import json_output, messages
from netsp.command.clearance_warning import warn_of_problem
from netsp.command.command_clock import command_clock
from netsp.command.command_options import given_params, names_of, refuse
from netsp.command.command_table import FOR_PROBLEMS

if TYPE_CHECKING:
    from netsp.gtsp.travel.result import Progress


def run(args: argparse.Namespace) -> int:
    """Solve, write, and return the exit code."""
    from netsp.base.files import STANDARD, is_mission_file, write_text
    from netsp.command import solve_mission

    if is_mission_file(args.problem):
        reason = f"is for problems, and {args.problem} is a mission; expected none"
        refuse(args, names_of(FOR_PROBLEMS), reason)
        return solve_mission.run(args)
    from netsp.base.interrupt_signals import deferred_interrupts
    from netsp.command.progress_table import ProgressTable, summary
    from netsp.judge import checked
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution
    from netsp.plan import warm_start as warm_starts
    from netsp.plan.solve_problem import solve

    clock = command_clock(args.time_limit)
    problem = clock.bounded("reading the problem", lambda: Problem.load(args.problem))
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

    with table or contextlib.nullcontext():
        if table:
            table.begin(problem)
        try:
            solution = solve(
                problem,
                args.solver,
                roadmap=args.roadmap,
                roadmap_options=roadmap_options(args),
                time_limit=clock,
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
        except InfeasibleError as error:
            if args.json:
                json_output.tell(json_output.of_infeasible(problem, error))
            raise
    with deferred_interrupts():  # Ctrl-C loses no tour
        write_text(args.output or STANDARD, checked(problem, solution).to_json())
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
        text = summary(problem, solution, args.output, args.plot, args.plot_trace, args.policy)
        print(text, file=sys.stderr)
        if solution.tour:
            warn_of_problem(args, problem, args.margin)
    if args.json:
        json_output.tell(json_output.of_solution(problem, solution))
    return _EXIT.get(solution.status.value, 0)


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
