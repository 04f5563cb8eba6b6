"""`netsp execute`: a tour carried out, and repaired on the way."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from netsp.base.errors import EXIT_DEFECT, EXIT_NOT_ALL, EXIT_NOT_VERIFIED, InputError
from netsp.command import json_output
from netsp.command.types import length, natural, seconds, vector

if TYPE_CHECKING:
    from netsp.model.problem import Problem
    from netsp.online.execute.execution_log import ExecutionRow

SPEED = 0.5
"""Default speed of a robot in the plane; missions have a speed of their own."""

EXAMPLE = (
    "netsp execute problems/wharf.json solution.json --surprise examples/surprises.json -o run"
)


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument(
        "problem", metavar="PROBLEM", help="problem file (JSON), or a mission that was planned"
    )
    p.add_argument(
        "solution", metavar="SOLUTION", nargs="?", help="solution file (JSON) of a problem"
    )
    p.add_argument("--surprise", metavar="FILE", help="surprise file (JSON): events during the run")
    p.add_argument(
        "--speed",
        type=length,
        metavar="V",
        help="speed of the robot, in the problem's units per second; default 0.5",
    )
    p.add_argument(
        "--vehicle", default="kinematic", metavar="NAME", help="kinematic (default) or bluerov2"
    )
    p.add_argument("--current", metavar="X,Y,Z", help="current (m/s); default none")
    p.add_argument("--gusts", type=length, metavar="S", help="gusts added to the current (m/s)")
    p.add_argument(
        "--planner",
        default="repair",
        metavar="NAME",
        help="repair (default), or none: keep to the plan whatever happens; in space, find a way "
        "to one waypoint after the other",
    )
    p.add_argument(
        "--planning-limit",
        type=seconds,
        metavar="S",
        help="seconds that a repair may take, while the robot holds its position; default 2, in "
        "space 10",
    )
    p.add_argument(
        "--reserve",
        type=length,
        metavar="R",
        help="tether that repairs keep in reserve, in the problem's units; default: as the plan "
        "does, at most a tenth of the limit",
    )
    p.add_argument(
        "--delta",
        type=length,
        metavar="D",
        help="resolution of the tether model; default by the smallest obstacle",
    )
    p.add_argument(
        "--seed",
        type=natural,
        default=0,
        metavar="N",
        help="random seed of gusts and solvers; default 0",
    )
    p.add_argument("-o", "--output", metavar="RUN", help="folder for logs, summary and run.png")
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")
    json_output.json_flag(p)


def run(args: argparse.Namespace) -> int:
    """Carry the tour out, write what happened, and return the exit code."""
    from netsp.base.files import is_mission_file

    if args.planner not in ("repair", "none"):
        raise InputError(f"--planner: expected repair or none, got {args.planner!r}")
    return _mission(args) if is_mission_file(args.problem) else _problem(args)


def _mission(args: argparse.Namespace) -> int:
    """Carry out a planned mission in space."""
    from netsp.command.flight import fly
    from netsp.world.mission.mission import Mission
    from netsp.world.mission.mission_limits import check_names
    from netsp.world.planner import PlannerOptions
    from netsp.world.simulator.surprises import SceneSurprises

    for name, flag in (
        ("solution", "SOLUTION"),
        ("speed", "--speed"),
        ("delta", "--delta"),
        ("reserve", "--reserve"),
    ):
        if getattr(args, name) is not None:
            raise InputError(
                f"{flag}: is for problems, and {args.problem} is a mission, which has its own; "
                "expected none"
            )
    planner = "repair" if args.planner == "repair" else "predictive"
    check_names(planner, args.vehicle, "geodesic")
    changes: dict[str, object] = {}
    if args.current is not None:
        changes["current"] = vector(args.current, "--current")
    if args.gusts is not None:
        changes["gusts"] = args.gusts
    mission = Mission.load(args.problem).model_copy(update=changes)
    surprises = SceneSurprises.load(args.surprise) if args.surprise else None
    options = PlannerOptions(seed=args.seed)
    if args.planning_limit is not None:
        options = replace(options, planning_limit=args.planning_limit)
    (run,) = fly(
        mission,
        [planner],
        output=args.output,
        quiet=args.quiet,
        as_json=args.json,
        surprises=surprises,
        source=args.surprise,
        check=True,
        inputs=(args.problem, args.surprise),
        vehicle=args.vehicle,
        options=options,
        seed=args.seed,
    )
    home = run.summary["home"]
    return _exit_code(run.summary, home["reached"] and not home["tether_free"])


def _problem(args: argparse.Namespace) -> int:
    """Carry out a tour in the plane."""
    from netsp.base.files import output_folder
    from netsp.base.interrupt_signals import until_interrupt
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution
    from netsp.online.execute.events import Surprises
    from netsp.online.execute.execute_policy import RepairPolicy
    from netsp.online.execute.execution_files import write_execution
    from netsp.online.execute.execution_log import ExecutionOptions, describe_execution
    from netsp.online.execute.tether_reserve import ReservePolicy
    from netsp.online.execute.tour_execution import execute
    from netsp.view.pictures.execution import save_execution

    if args.solution is None:
        raise InputError(
            f"SOLUTION: missing; expected a solution file of {args.problem}, or a mission alone"
        )
    problem, solution = Problem.load(args.problem), Solution.load(args.solution)
    surprises = Surprises.load(args.surprise) if args.surprise else None
    if surprises is not None:
        surprises.check(problem, args.surprise)
    planning_limit = args.planning_limit
    if planning_limit is None:
        planning_limit = RepairPolicy.time_limit_s
    options = ExecutionOptions(
        speed=SPEED if args.speed is None else args.speed,
        vehicle=args.vehicle,
        delta=args.delta,
        repair=args.planner == "repair",
        current=vector(args.current, "--current") if args.current else (0.0, 0.0, 0.0),
        gusts=args.gusts or 0.0,
        seed=args.seed,
        planning_limit=planning_limit,
        reserve_policy=ReservePolicy(args.reserve),
    )
    show = not args.quiet and sys.stderr.isatty()
    on_step = show_execution(problem) if show else None
    with output_folder(args.output):
        done = execute(problem, solution, options, surprises=surprises, on_step=on_step)
    if show:
        print(file=sys.stderr)
    with until_interrupt(None):  # the run is over; only a second Ctrl-C breaks off writing it
        if args.output is not None:
            write_execution(done, args.output)
            save_execution(done, Path(args.output) / "run.png")
        if args.output is None or args.json:
            json_output.tell(done.summary)
        if not args.quiet:
            print(describe_execution(done), file=sys.stderr)
    return _exit_code(done.summary, done.summary["home"] and not done.summary["tether_free"])


def _exit_code(summary: dict[str, Any], is_caught_at_home: bool) -> int:
    """Return the exit code of a run, which may have ended at home with its tether caught."""
    if summary["defects"]:
        return EXIT_DEFECT
    if summary["exceedance_s"] > 0.0 or is_caught_at_home:
        return EXIT_NOT_VERIFIED
    return EXIT_NOT_ALL if summary["left_out"] or summary["status"] != "done" else 0


def show_execution(
    problem: Problem, total_s: Callable[[ExecutionRow], float | None] = lambda row: None
) -> Callable[[ExecutionRow], None]:
    """Return a callback that shows how a run goes, in one line.

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
            of = "" if total is None else f" of about {total:.0f}"
            print(
                f"\r{row.time:8.1f}{of} s  to {name:<9} tether {row.tether:8.2f} of {row.limit:g} "
                f"{problem.units}   ",
                end="",
                file=sys.stderr,
                flush=True,
            )

    return on_step
