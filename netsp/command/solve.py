"""`netsp solve`: from a problem file to its solution, or from a mission to its plan."""

from __future__ import annotations

import argparse
import contextlib
import sys
from typing import TYPE_CHECKING

from netsp.base.errors import EXIT_NOT_ALL, EXIT_NOT_VERIFIED, InfeasibleError, InputError
from netsp.command import json_output, messages
from netsp.command.clearance_flags import clearance_flags, warn_of_problem
from netsp.command.command_clock import command_clock
from netsp.command.types import (
    check_writable,
    choices,
    friction,
    length,
    natural,
    option,
    positive,
    roadmap_options,
    seconds,
)

if TYPE_CHECKING:
    from netsp.gtsp.travel.result import Progress

EXAMPLE = "netsp solve problems/wharf.json -o solution.json --plot wharf.png"


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    for_all(p)
    _for_problems(p.add_argument_group("for problems only"))


def for_all(p: argparse.ArgumentParser) -> None:
    """Add the arguments of problems and missions."""
    p.add_argument(
        "problem",
        metavar="PROBLEM",
        help="problem file or mission file (JSON); a mission is written with its tour",
    )
    p.add_argument(
        "--solver",
        default="auto",
        metavar="NAME",
        help=choices(
            "auto (default), mip, dp, reduced-mip, mip-2017, lns, anneal, anneal-2016, greedy, "
            "greedy-2016 or greedy-tsp",
            "netsp.solvers",
        ),
    )
    p.add_argument(
        "--option",
        action="append",
        default=[],
        type=option,
        metavar="NAME=VALUE",
        help="an option of the solver, as docs/solvers.md lists them; may be repeated",
    )
    p.add_argument(
        "--mip-backend", metavar="NAME", help="highs (default) or cbc, for the solvers built on mip"
    )
    p.add_argument(
        "--time-limit",
        type=seconds,
        metavar="S",
        help="seconds for reading, roadmap, legs and solver together; default no limit, for "
        "missions 60",
    )
    p.add_argument(
        "--iteration-limit",
        type=positive,
        metavar="N",
        help="iterations of the solver; default no limit",
    )
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="random seed; default 0")
    p.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="write the solution (the planned mission) to this file (default: stdout)",
    )
    p.add_argument("--plot", metavar="FILE", help="draw the solution (png, svg or pdf)")
    clearance_flags(p)
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")
    json_output.json_flag(p)


def _for_problems(p: argparse._ArgumentGroup) -> None:
    """Add the arguments that do not apply to missions."""
    p.add_argument(
        "--roadmap",
        default="taut",
        metavar="NAME",
        help=choices("taut (default) or prm", "netsp.roadmaps"),
    )
    p.add_argument(
        "--classes",
        metavar="RULE",
        dest="classes_rule",
        help="taut: all homotopy classes (default), or non-looping as in the 2017 paper",
    )
    p.add_argument("--samples", type=positive, metavar="N", help="prm: milestones; default 1000")
    p.add_argument(
        "--shortcut", action="store_true", help="prm: pull every leg taut within its class"
    )
    p.add_argument(
        "--max-classes",
        type=positive,
        metavar="N",
        help="taut: upper limit on the classes of all goals together",
    )
    p.add_argument(
        "--keep-order",
        action="store_true",
        help="visit the goals in the order of the file; only their homotopy classes are chosen",
    )
    p.add_argument(
        "--slack",
        type=length,
        default=0.0,
        metavar="S",
        help="share of the taut length that must fit beyond it, as 0.05; default 0",
    )
    p.add_argument(
        "--friction",
        type=friction,
        default=0.0,
        metavar="MU",
        help="coefficient of friction of tether on obstacle, 0 to 10; default 0",
    )
    p.add_argument(
        "--max-tension-ratio",
        type=length,
        metavar="K",
        help="use only classes in which friction multiplies the tension by at most K",
    )
    p.add_argument(
        "--margin",
        type=length,
        default=0.0,
        metavar="R",
        help="plan so that every obstacle may be off by R; default 0 (docs/sizing.md)",
    )
    p.add_argument(
        "--warm-start",
        metavar="SOLUTION",
        help="start from this solution's tour, also one of an older version of the problem",
    )
    p.add_argument(
        "--plot-trace",
        metavar="FILE",
        help="plot length, bound and entanglement against iterations (png, svg or pdf)",
    )


def run_mission(args: argparse.Namespace) -> int:
    """Solve a mission, and return the exit code."""
    json_output.check_stdout(args)
    from netsp.command import solve_mission

    return solve_mission.solve(
        args.problem,
        solver=args.solver,
        params=_params(args),
        time_limit=args.time_limit,
        iteration_limit=args.iteration_limit,
        seed=args.seed,
        output=args.output,
        plot=args.plot,
        quiet=args.quiet,
        as_json=args.json,
        position_error=args.position_error,
        current=args.current,
    )


def run(args: argparse.Namespace) -> int:
    """Solve, write, and return the exit code."""
    from netsp.base.files import is_mission_file
    from netsp.command import solve_mission

    if is_mission_file(args.problem):
        solve_mission.check_flags(args, _defaults())
        return run_mission(args)
    from netsp.base.files import write_text
    from netsp.command.progress_table import ProgressTable, summary
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution

    json_output.check_stdout(args)
    from netsp.base.interrupt_signals import deferred_interrupts
    from netsp.judge import checked
    from netsp.plan import warm_start as warm_starts
    from netsp.plan.solve_problem import solve

    clock = command_clock(args.time_limit)
    problem = clock.bounded("reading the problem", lambda: Problem.load(args.problem))
    warm = None
    if args.warm_start:
        warm = clock.bounded("reading --warm-start", lambda: Solution.load(args.warm_start))
    check_writable(args.output, args.plot, args.plot_trace, inputs=(args.problem, args.warm_start))
    if args.plot or args.plot_trace:
        from netsp.view.pictures import problem_picture as plotting
        from netsp.view.pictures import style

        for picture in filter(None, (args.plot, args.plot_trace)):
            style.check_format(picture)
    if warm is not None and (text := warm_starts.told(problem, warm)):
        messages.note(text)

    rows: list[Progress] = []

    table = None if args.quiet else ProgressTable(sys.stderr)

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
                params=_params(args),
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
        text = checked(problem, solution).to_json()
        if args.output:
            write_text(args.output, text)
        else:
            sys.stdout.write(text)
            sys.stdout.flush()
    if args.plot or args.plot_trace:
        style.load_matplotlib()
    if args.plot:
        plotting.save(problem, solution, args.plot)
    if args.plot_trace:
        plotting.save_trace(rows, f"{problem.name}: {args.solver}", problem.units, args.plot_trace)
    if table:
        table.end()
        text = summary(problem, solution, args.output, args.plot, args.plot_trace)
        print(text, file=sys.stderr)
        if solution.tour:
            warn_of_problem(args, problem, args.margin)
    if args.json:
        json_output.tell(json_output.of_solution(problem, solution))
    return _EXIT.get(solution.status.value, 0)


_EXIT = {"infeasible": 3, "no_solution_found": EXIT_NOT_ALL, "invalid": EXIT_NOT_VERIFIED}


def _defaults() -> dict[str, object]:
    parser = argparse.ArgumentParser()
    arguments(parser)
    return vars(parser.parse_args([""]))


def _params(args: argparse.Namespace) -> dict[str, str]:
    params = dict(args.option)
    if len(params) < len(args.option):
        raise InputError("--option: the same option is given twice")
    if args.mip_backend:
        if "backend" in params:
            raise InputError("--mip-backend: the backend is given by --option too")
        params["backend"] = args.mip_backend
    return params
