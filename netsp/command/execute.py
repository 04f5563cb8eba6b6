"""`netsp execute`: carry a tour out, and repair it on the way."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from netsp.base.errors import InputError
from netsp.command import json_output
from netsp.command.command_options import refuse
from netsp.command.types import load_pair, vector

if TYPE_CHECKING:
    from netsp.model.problem import Problem
    from netsp.online.execute.events import Surprises
    from netsp.online.execute.execution_log import Execution, ExecutionRow


def run(args: argparse.Namespace) -> int:
    """Carry the tour out, write what happened, and return the exit code."""
    from netsp.base.files import is_mission_file

    if args.planner not in ("repair", "none"):
        raise InputError(f"--planner: expected repair or none, got {args.planner!r}")
    return _mission(args) if is_mission_file(args.problem) else _problem(args)


def _mission(args: argparse.Namespace) -> int:
    """Carry out a planned mission in space."""
    from netsp.command.flight import exit_code, fly
    from netsp.world.mission.mission import Mission
    from netsp.world.mission.mission_limits import check_names
    from netsp.world.planner import PlannerOptions

    refuse(
        args,
        "SOLUTION --speed --delta --reserve",
        f"is for problems, and {args.problem} is a mission, which has its own; expected none",
    )
    planner = "repair" if args.planner == "repair" else "predictive"
    check_names(planner, args.vehicle, "geodesic")
    changes: dict[str, object] = {}
    if args.current is not None:
        changes["current"] = vector(args.current, "--current")
    if args.gusts is not None:
        changes["gusts"] = args.gusts
    mission = Mission.load(args.problem).model_copy(update=changes)
    options = PlannerOptions(seed=args.seed)
    if args.planning_limit is not None:
        options = replace(options, planning_limit=args.planning_limit)
    flight_options = {"vehicle": args.vehicle, "options": options, "seed": args.seed}
    (run,) = fly(mission, [planner], args, is_judged=True, **flight_options)
    home = run.summary["home"]
    return exit_code(run.summary, home["reached"], home["tether_free"])


def _problem(args: argparse.Namespace) -> int:
    """Carry out a tour in the plane."""
    from netsp.base.files import output_folder
    from netsp.base.interrupt_signals import until_interrupt
    from netsp.command.flight import exit_code
    from netsp.online.execute.execute_policy import RepairPolicy
    from netsp.online.execute.execution_log import ExecutionOptions
    from netsp.online.execute.tether_reserve import ReservePolicy
    from netsp.online.execute.tour_execution import execute

    if args.solution is None:
        raise InputError(
            f"SOLUTION: missing; expected a solution file of {args.problem}, or a mission alone"
        )
    problem, solution = load_pair(args.problem, args.solution)
    surprises = checked_surprises(args, problem)
    options = ExecutionOptions(
        speed=args.speed or ExecutionOptions.speed,
        vehicle=args.vehicle,
        delta=args.delta,
        repair=args.planner == "repair",
        current=vector(args.current, "--current") if args.current else (0.0, 0.0, 0.0),
        gusts=args.gusts or 0.0,
        seed=args.seed,
        planning_limit=args.planning_limit or RepairPolicy.time_limit_s,
        reserve_policy=ReservePolicy(args.reserve),
    )
    is_shown = not args.quiet and sys.stderr.isatty()
    on_step = show_execution(problem) if is_shown else None
    with output_folder(args.output):
        execution = execute(problem, solution, options, surprises=surprises, on_step=on_step)
    if is_shown:
        print(file=sys.stderr)
    with until_interrupt(None):  # the run is over; only a second Ctrl-C breaks off writing it
        write_result(args, execution)
    return exit_code(execution.summary, execution.summary["home"], execution.summary["tether_free"])


def write_result(args: argparse.Namespace, done: Execution) -> None:
    """Write the files of a run, and print its result."""
    from netsp.online.execute.execution_files import write_execution
    from netsp.online.execute.execution_log import describe_execution
    from netsp.view.pictures.execution import save_execution

    if args.output is not None:
        write_execution(done, args.output)
        save_execution(done, Path(args.output) / "run.png")
    if args.output is None or args.json:
        json_output.tell(done.summary)
    if not args.quiet:
        print(describe_execution(done), file=sys.stderr)


def checked_surprises(args: argparse.Namespace, problem: Problem) -> Surprises | None:
    """Return the surprises of a run, checked against its problem; None if there are none."""
    from netsp.online.execute.events import Surprises

    if not args.surprise:
        return None
    surprises = Surprises.load(args.surprise)
    surprises.check(problem, args.surprise)
    return surprises


def show_execution(
    problem: Problem, total_s: Callable[[ExecutionRow], float | None] = lambda row: None
) -> Callable[[ExecutionRow], None]:
    """Return a callback that shows the progress of a run in one line.

    Parameters
    ----------
    problem : Problem
        Problem that was solved.
    total_s : callable
        Returns the seconds that the whole run will take; None if that is not known.
    """
    count = [0]

    def on_step(row: ExecutionRow) -> None:
        count[0] += 1
        total = total_s(row)
        if count[0] % 20 == 1:
            name = "base" if row.goal < 0 else problem.goal_label(row.goal)
            of_total = "" if total is None else f" of about {total:.0f}"
            print(
                f"\r{row.time:8.1f}{of_total} s  to {name:<9} tether {row.tether:8.2f} of "
                f"{row.limit:g} {problem.units}   ",
                end="",
                file=sys.stderr,
                flush=True,
            )

    return on_step
