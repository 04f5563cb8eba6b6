"""`netsp plot`: pictures of problems, roadmaps, solutions and scenes."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from netsp.base.errors import InputError
from netsp.command.command_options import refuse
from netsp.command.patience import Patience
from netsp.command.types import load_pair

if TYPE_CHECKING:
    from netsp.model.problem import Problem


def run(args: argparse.Namespace) -> int:
    """Draw, and return the exit code."""
    with Patience(sys.stderr, f"drawing {args.output}", args.policy):
        return _draw(args)


def _draw(args: argparse.Namespace) -> int:
    """Draw what the file holds, and return the exit code."""
    from netsp.base.files import is_mission_file

    if is_mission_file(args.problem):
        return _mission(args)
    if is_scene(args.problem):
        from netsp.command.plot_scene import plot_scene

        return plot_scene(args)
    from netsp.model.problem import Problem
    from netsp.view.pictures import problem_picture as plotting
    from netsp.view.pictures import style

    style.check_format(args.output)
    if args.tethers_to is not None:
        if args.solution or args.roadmap:
            raise InputError(
                "--tethers-to: draws a problem alone; give neither a solution nor --roadmap"
            )
        problem = Problem.load(args.problem)
        plotting.save_classes(problem, _goal_number(problem, args.tethers_to), args.output)
    elif args.roadmap:
        if args.solution:
            raise InputError("--roadmap: draws a problem alone; give no solution")
        options = {} if args.samples is None else {"samples": args.samples}
        if args.roadmap == "prm":
            options["seed"] = args.seed
        plotting.save_roadmap(Problem.load(args.problem), args.roadmap, options, args.output)
    elif args.solution:
        if args.solution.lower().endswith(".csv"):
            raise InputError(
                f"{args.solution}: a path is drawn over a scene; of a problem, netsp verify "
                f"{args.problem} {args.solution} --measures tells its word"
            )
        problem, solution = load_pair(args.problem, args.solution)
        if solution.problem.sha256 != problem.sha256:
            raise InputError(
                f"{args.solution}: is the solution of another problem (sha256 differs)"
            )
        plotting.save(problem, solution, args.output)
    else:
        plotting.save(Problem.load(args.problem), None, args.output)
    return 0


def _mission(args: argparse.Namespace) -> int:
    """Draw a mission: its waypoints in their order, and its tour if it has one."""
    reason = f"{args.problem} is a mission; expected nothing beside it"
    refuse(args, "SOLUTION --roadmap --tethers-to", reason)
    from netsp.view.pictures import style
    from netsp.view.pictures.mission_picture import save_mission
    from netsp.view.pictures.scene_picture import INTERACTIVE
    from netsp.world.mission.mission import Mission

    style.check_format(args.output, INTERACTIVE)
    mission = Mission.load(args.problem)
    save_mission(mission, mission.load_scene(), args.output)
    return 0


def is_scene(path: str) -> bool:
    """Return whether a file's fields are those of a scene, rather than of a problem."""
    from netsp.base.files import read_text
    from netsp.base.validated import kind_of, parse_json_object

    data = parse_json_object(read_text(path), path)
    if kind_of(data) not in (None, "problem", "scene"):
        raise InputError(
            f"{path}: this is a {kind_of(data)}; expected a problem, a scene or a mission"
        )
    return "goals" not in data and bool(
        {"solids", "mesh", "cloud", "floor", "problem"} & data.keys()
    )


def _goal_number(problem: Problem, text: str) -> int:
    names = [g.name for g in problem.goals]
    if text in names:
        return names.index(text)
    number = text.removeprefix("#")
    if number.isdecimal() and len(number) < 10 and int(number) < len(names):
        return int(number)
    raise InputError(
        f"--tethers-to: no goal {text!r}; expected #0 to #{len(names) - 1}"
        + (f" or a name such as {next(n for n in names if n)!r}" if any(names) else "")
    )
