"""`netsp verify`: an independent judgement of a solution, or measures of a path."""

from __future__ import annotations

import argparse
import contextlib
import sys
from typing import TYPE_CHECKING

from netsp.base.errors import EXIT_NOT_VERIFIED, InputError
from netsp.command import json_output, messages
from netsp.command.command_options import refuse
from netsp.command.types import load_pair

if TYPE_CHECKING:
    from netsp.judge import Verification
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution


def run(args: argparse.Namespace) -> int:
    """Judge, print, and return the exit code."""
    if args.json:
        refuse(args, "--measures --margins", "has no JSON output; expected no --json")
    from netsp.base.files import is_mission_file, read_text
    from netsp.command.plot import is_scene

    if is_mission_file(args.problem):
        return _mission(args)
    if args.problem_output is not None:
        from netsp.model.problem import Problem

        Problem.load(args.problem).save(args.problem_output)
    if args.measures and args.solution is not None and is_scene(args.problem):
        return _path_in_scene(args)
    if args.solution is None and (args.proof or args.problem_output):
        return _proof_alone(args)
    if args.solution is None:
        read_text(args.problem)  # a missing file is reported as usual
        raise InputError(f"SOLUTION: {args.problem} is not a mission; expected a solution, too")
    if args.measures:
        from netsp.model.problem import Problem

        if _is_path(args.solution):
            refuse(args, "--proof", f"is for solutions, and {args.solution} is a path")
            _measure_paths(Problem.load(args.problem), args)
            return 0
    elif _is_path(args.solution):
        raise InputError(
            f"{args.solution}: this is a path; expected a solution, or --measures to measure a path"
        )
    problem, solution = load_pair(args.problem, args.solution)
    from netsp.judge import verify

    verdict = verify(problem, solution)
    if args.proof:
        verdict = _with_proof(args, verdict, problem, solution)
    else:
        from netsp.judge.proof_judgement import with_claim

        verdict = with_claim(verdict, solution)
    _print_verdict(args, verdict)
    if args.measures and solution.path and not args.quiet:
        if solution.problem.sha256 != problem.sha256:
            return EXIT_NOT_VERIFIED
        from netsp.command.measures import describe_path, describe_tethers

        print(f"\n{describe_path(problem, solution.path)}\n\n{describe_tethers(problem, solution)}")
    if args.margins and verdict and not args.quiet:
        from netsp.command.margins import describe
        from netsp.plan.sizing.tether_margins import margins

        print(f"\n{describe(problem, margins(problem, solution))}")
    return 0 if verdict else EXIT_NOT_VERIFIED


def _print_verdict(args: argparse.Namespace, verdict: Verification) -> None:
    """Print a verdict in words or as JSON, unless the command is quiet."""
    if args.json:
        json_output.tell(json_output.of_verdict(verdict))
    elif not args.quiet:
        print(verdict)
        open_checks = [c.name for c in verdict.checks if not c.was_made]
        unchecked = f"; not checked: that {', '.join(open_checks)}" if open_checks else ""
        print(f"verified{unchecked}" if verdict else "NOT VERIFIED")


def _with_proof(
    args: argparse.Namespace, verdict: Verification, problem: Problem, solution: Solution | None
) -> Verification:
    """Return a verdict with the check of the proof file."""
    from netsp.base.files import read_bytes
    from netsp.command.interrupts import until_interrupted
    from netsp.command.patience import Patience
    from netsp.judge.proof_judgement import with_proof

    data = read_bytes(args.proof)
    waiting = Patience(sys.stderr, "checking the proof", args.policy)
    with contextlib.nullcontext() if args.quiet else waiting:
        return until_interrupted(
            "checking the proof", lambda: with_proof(verdict, problem, solution, data)
        )


def _proof_alone(args: argparse.Namespace) -> int:
    """Check a proof without a tour and return the exit code; do nothing if no proof is given."""
    from netsp.judge import Verification
    from netsp.model.problem import Problem

    if args.proof is None:
        return 0
    problem = Problem.load(args.problem)
    verdict = _with_proof(args, Verification(()), problem, None)
    _print_verdict(args, verdict)
    return 0 if verdict else EXIT_NOT_VERIFIED


def _path_in_scene(args: argparse.Namespace) -> int:
    """Measure a path in a scene."""
    from netsp.command.interrupts import until_interrupted
    from netsp.command.plot_scene import points_of
    from netsp.plan.space.mission_measures import measure_path
    from netsp.world.scene.scene import Scene

    scene = Scene.load(args.problem)
    points = points_of(args.solution)
    m = until_interrupted("measuring the path", lambda: measure_path(scene, points))
    if not args.quiet:
        kind = "loop" if m.closed else "path; for its word, a shortest path joins its ends"
        print(f"length    {m.length:.6g} {scene.units} ({kind})")
        print(f"word      {list(m.signature) if m.signature else 'empty: nothing holds it'}")
        turns = "all zero" if not any(m.windings) else list(m.windings)
        print(f"windings  {turns}")
        if not m.exact:
            print("          other words may be of the same class, too: the group is not completed")
        print(f"cell      {m.cell:.3g} {scene.units}: narrower gaps may count as closed")
    return 0


def _mission(args: argparse.Namespace) -> int:
    """Judge a planned mission."""
    refuse(args, "SOLUTION", f"{args.problem} is a mission; expected nothing beside it")
    names = "--measures --margins --proof --problem-output"
    refuse(args, names, f"is for problems, and {args.problem} is a mission")
    from netsp.command.interrupts import until_interrupted
    from netsp.plan.space.judge import verify_mission
    from netsp.world.mission.mission import Mission

    mission = Mission.load(args.problem)
    verdict = until_interrupted("judging the tour", lambda: verify_mission(mission))
    _print_verdict(args, verdict)
    return 0 if verdict else EXIT_NOT_VERIFIED


PATH_ENDINGS = (".csv", ".csv.gz", ".gpx", ".geojson", ".tlog", ".bin")
"""File-name extensions of files that hold only paths."""


def _is_path(file: str) -> bool:
    """Return whether a file holds a path; any other is left to the reader of solutions."""
    from netsp.base.files import read_text
    from netsp.base.validated import parse_json_object

    if file.lower().endswith(PATH_ENDINGS):
        return True
    text = read_text(file).lstrip("\ufeff \t\r\n")
    if not text.startswith("{"):
        return bool(text)
    return "tour" not in parse_json_object(text, file) and '"coordinates"' in text


def _measure_paths(problem: Problem, args: argparse.Namespace) -> None:
    """Print the measures of every path of a file."""
    from netsp.base.polyline_file import read_path
    from netsp.command.measures import describe_path, entered
    from netsp.exchange.maps.path_file import ENDINGS, FoundPath
    from netsp.online.guard.recorded_path import read_any_paths

    if args.solution.lower().endswith((*ENDINGS, *PATH_ENDINGS)):
        paths = read_any_paths(args.solution, problem, frame=args.frame, system=args.system)
    else:
        points = read_path(args.solution, messages.note)
        assert points is not None
        paths = [FoundPath("", points)]
    if not args.quiet:
        for note in dict.fromkeys(note for path in paths for note in path.notes):
            messages.note(note)
    for k, path in enumerate(paths):
        text = describe_path(problem, path.points, path.times)
        for name in entered(problem, path.points):
            messages.warning(
                f"{args.solution}: the path passes through {name}; it counts as going round on "
                "the shorter side"
            )
        if not args.quiet:
            head = f"path {path.name}\n" if len(paths) > 1 else ""
            print(("\n" if k else "") + head + text)
