"""What `netsp export` and `netsp import` do."""

from __future__ import annotations

import argparse
import os
import sys

from netsp.errors import InputError
from netsp.export.projection import Projection
from netsp.export.site import read_site
from netsp.export.waypoints import Waypoint, clearance_of
from netsp.export.write import (
    FORMATS,
    MOST_FENCE_POINTS,
    SHALLOWEST,
    Settings,
    export,
    fence_points,
    predicted_s,
)
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
    kind = format_of(args.output, args.format)
    slack, clearance = margins(args.margin)
    projection = Projection.parse(args.origin, problem.base[:2]) if args.origin else None
    settings = Settings(hold=args.hold, speed=args.speed, most=args.most)
    points = export(
        problem, solution, args.output, kind, projection, acceptance=args.acceptance,
        settings=settings,
    )  # fmt: skip
    goals = sum(p.goal is not None and p.goal >= 0 for p in points)
    seconds = predicted_s(points, settings)
    print(
        f"{args.output}: {len(points)} waypoints, {goals} of them goals, of the plan's class; "
        f"about {seconds:.0f} s at {settings.speed:g} {problem.units}/s, stops included",
        file=sys.stderr,
    )
    for line in warnings(problem, solution, points, slack, clearance):
        print(f"netsp: warning: {line}", file=sys.stderr)
    if kind in ("plan", "wpl"):
        if kind == "plan" and fence_points(problem) > MOST_FENCE_POINTS:
            print(
                f"netsp: warning: the obstacles take {fence_points(problem)} fence points; the "
                f"vehicle stores about {MOST_FENCE_POINTS} without a card",
                file=sys.stderr,
            )
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


EXTENSIONS = {
    ".plan": "plan", ".waypoints": "wpl", ".txt": "wpl", ".geojson": "geojson", ".json": "geojson",
    ".csv": "csv",
}  # fmt: skip
"""Which format a file's name asks for."""


def format_of(file: str, asked: str | None) -> str:
    """The format by the file's extension, or that asked for; InputError where they disagree or
    neither says."""
    extension = os.path.splitext(file)[1].lower()
    own = EXTENSIONS.get(extension)
    if asked is not None and asked not in FORMATS:
        raise InputError(f"--format: expected {', '.join(FORMATS)}, got {asked!r}")
    if asked is not None and own is not None and asked != own:
        raise InputError(f"--format: {asked}, but {file!r} ends like a file of format {own}")
    if asked is None and own is None:
        raise InputError(
            f"-o: expected a file that ends in {', '.join(EXTENSIONS)}, got {file!r}; or say "
            "--format"
        )
    return asked or own or ""


def margins(text: str) -> tuple[float, float]:
    """Least tether slack and clearance, from ``SLACK`` or ``SLACK,CLEARANCE``."""
    try:
        numbers = [float(v) for v in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 2) or not all(0.0 <= v < float("inf") for v in numbers):
        raise InputError(f"--margin: expected SLACK or SLACK,CLEARANCE from 0 on, got {text!r}")
    return numbers[0], numbers[-1] if len(numbers) == 2 else LEAST_CLEARANCE


LEAST_SLACK, LEAST_CLEARANCE = 0.3, 0.2
"""Metres: a vehicle that flew exported missions lost 0.13 m of clearance and took up to 0.16 m more
tether than planned."""


def warnings(
    problem: Problem, solution: Solution, points: list[Waypoint], slack: float, clearance: float
) -> list[str]:
    """What may go wrong because the plan is too tight."""
    out = []
    longest = max(solution.tour, key=lambda v: v.tether_length, default=None)
    if longest is not None and problem.tether_length - longest.tether_length < slack:
        left = problem.tether_length - longest.tether_length
        out.append(
            f"{left:.2f} {problem.units} of tether are left at {problem.goal_label(longest.goal)}; "
            f"expected {slack:g}: plan with a shorter tether_length, or set --margin"
        )
    near = clearance_of(problem, points)
    if near < clearance:
        out.append(
            f"the lines between waypoints come within {near:.2f} {problem.units} of an obstacle; "
            f"expected {clearance:g}: plan with a larger clearance, or set --margin"
        )
    return out


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
