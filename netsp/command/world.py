"""`netsp world`: random problems."""

from __future__ import annotations

import argparse

from netsp.base.errors import counted
from netsp.command import messages


def run(args: argparse.Namespace) -> int:
    """Draw a world, write it, and return the exit code."""
    from netsp.base.files import STANDARD, write_text
    from netsp.plan.random_worlds import reachable_world

    problem, in_vain = reachable_world(
        args.seed,
        max_worlds=args.policy.max_worlds,
        family=args.family,
        goals=args.goals,
        obstacles=args.obstacles,
        tether_length=args.tether,
        side=args.side,
        radii=tuple(args.radii),
    )
    if in_vain:
        messages.note(f"{counted(in_vain, 'world')} of this seed did not fit and were redrawn")
    write_text(args.output or STANDARD, problem.to_json())
    if args.plot:
        from netsp.view.pictures import problem_picture

        problem_picture.save(problem, None, args.plot)
    return 0
