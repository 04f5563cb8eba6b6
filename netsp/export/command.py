"""What `netsp export` and `netsp import` do."""

from __future__ import annotations

import argparse
import sys

from netsp.errors import InputError
from netsp.export.projection import Projection
from netsp.export.site import read_site
from netsp.export.write import SHALLOWEST, Settings, export
from netsp.files import write_text
from netsp.judge import verify
from netsp.problem import Problem
from netsp.solution import Solution


def run_export(args: argparse.Namespace) -> int:
    """`netsp export SOLUTION`: returns the exit code."""
    problem, solution = Problem.load(args.problem), Solution.load(args.solution)
    judged = verify(problem, solution)
    if not judged:
        failed = next(c for c in judged.checks if not c.passed)
        raise InputError(f"{args.solution}: fails its check {failed.name!r}: {failed.detail}")
    projection = Projection.parse(args.origin, problem.base[:2]) if args.origin else None
    settings = Settings(hold=args.hold, speed=args.speed, most=args.most)
    points = export(
        problem, solution, args.output, args.format, projection, acceptance=args.acceptance,
        settings=settings,
    )  # fmt: skip
    goals = sum(p.goal is not None and p.goal >= 0 for p in points)
    print(
        f"{args.output}: {len(points)} waypoints, {goals} of them goals, of the plan's class",
        file=sys.stderr,
    )
    if args.format in ("plan", "wpl"):
        shallow = sum(p.position[2] > -SHALLOWEST for p in points)
        if shallow:
            print(
                f"netsp: {shallow} waypoints lie above {SHALLOWEST} m of depth and were put there",
                file=sys.stderr,
            )
        print(
            "netsp: home is taken to be the water surface at the base: do not set it by hand",
            file=sys.stderr,
        )
    return 0


def run_import(args: argparse.Namespace) -> int:
    """`netsp import SITE`: returns the exit code."""
    projection = Projection.parse(args.base, name="--base") if args.base else None
    problem = read_site(
        args.site, projection, tether=args.tether, clearance=args.clearance, radius=args.radius
    )
    print(
        f"{problem.name}: {len(problem.goals)} goals, {len(problem.obstacles)} obstacles, tether "
        f"{problem.tether_length:g} m",
        file=sys.stderr,
    )
    if args.output is None:
        sys.stdout.write(problem.to_json())
    else:
        write_text(args.output, problem.to_json())
    return 0
