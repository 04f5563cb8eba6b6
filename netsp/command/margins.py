"""`netsp margins`: how far the world may be off before a tour does not fit any more."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from netsp.command.types import load_pair

if TYPE_CHECKING:
    from netsp.model.problem import Problem
    from netsp.plan.sizing.tether_margins import Margins


def run(args: argparse.Namespace) -> int:
    """Print the margins, and return the exit code."""
    from netsp.base.files import write_text
    from netsp.plan.sizing.tether_margins import margins

    problem, solution = load_pair(args.problem, args.solution)
    found = margins(problem, solution, args.friction)
    print(describe(problem, found))
    if args.output:
        write_text(args.output, found.to_json())
    return 0


def describe(problem: Problem, found: Margins) -> str:
    """Return the margins, one line for each visit."""
    units = problem.units
    lines = [
        f"obstacles    may be off by {found.obstacles:.6g} {units}: then {found.limited_by}",
        f"tether       may shrink by {found.tether:.6g} {units} before a goal is out of reach",
        "cross-track  the tour holds if the robot is up to "
        f"{found.cross_track:.6g} {units} off its path",
        "",
        f"{'visit':>5}  {'goal':<14} {'tether':>10} {'slack':>10} {'turning':>9} {'tension':>8} "
        f"{'clearance':>9}",
    ]
    for k, s in enumerate(found.visits, 1):
        lines.append(
            f"{k:>5}  {s.name:<14.14} {s.tether:>10.6g} {s.slack:>10.6g} "
            f"{math.degrees(s.turning):>8.1f}° {s.tension_ratio:>8.3g} "
            f"{s.clearance:>9.4g}"
        )
    return "\n".join(lines)
