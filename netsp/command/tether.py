"""`netsp tether`: how long a tether a problem needs, and what more of it would save."""

from __future__ import annotations

import argparse
import sys

from netsp.base.errors import EXIT_NOT_ALL
from netsp.command import messages
from netsp.command.command_clock import command_clock


def run(args: argparse.Namespace) -> int:
    """Print the table, write what is asked for, and return the exit code."""
    from netsp.model.problem import Problem
    from netsp.plan.sizing.tether_sizing import Step, tether_curve

    clock = command_clock(args.time_limit)
    problem = clock.bounded("reading the problem", lambda: Problem.load(args.problem))

    def show_step(step: Step) -> None:
        print(
            f"tether {step.tether:.6g}: tour {step.length:.6g}, {step.status.value}",
            file=sys.stderr,
        )

    curve = tether_curve(
        problem,
        args.longest,
        time_limit=clock,
        seed=args.seed,
        on_step=None if args.quiet else show_step,
    )
    print(f"{'tether from':>12} {'up to':>12} {'tour':>12} {'saves':>8}  status")
    first_length = curve.steps[0].length if curve.steps else 0.0
    for s in curve.steps:
        print(
            f"{s.tether:>12.6g} {s.until:>12.6g} {s.length:>12.6g} "
            f"{100.0 * (1.0 - s.length / first_length):>7.2f}%  {s.status.value}"
        )
    print(
        f"shortest sufficient tether {curve.shortest:.6f} {curve.units}, needed by "
        f"{problem.goal_label(curve.needs)}"
    )
    if not curve.whole:
        messages.warning("time ran out before the shortest sufficient tether was found")
    if args.output:
        curve.save(args.output)
    if args.plot:
        from netsp.view.pictures import style

        style.save(curve.plot().figure, args.plot)
        print(f"picture {args.plot}", file=sys.stderr)
    return 0 if curve.whole else EXIT_NOT_ALL
