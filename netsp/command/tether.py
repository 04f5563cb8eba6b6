"""`netsp tether`: how long a tether a problem needs, and what more of it would save."""

from __future__ import annotations

import argparse
import sys

from netsp.base.errors import EXIT_NOT_ALL
from netsp.command import messages
from netsp.command.command_clock import command_clock
from netsp.command.types import check_writable, length, natural, seconds

EXAMPLE = "netsp tether problems/wharf.json --longest 30 --plot tether.png"


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument("problem", metavar="PROBLEM", help="problem file (JSON)")
    p.add_argument(
        "--longest",
        type=length,
        metavar="L",
        help="longest tether to look at, in the problem's units; default: the problem's",
    )
    p.add_argument(
        "--time-limit",
        type=seconds,
        metavar="S",
        help="seconds; what is known by then is written; default none",
    )
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="default 0")
    p.add_argument("-o", "--output", metavar="FILE", help="write the curve: a table (.csv) or JSON")
    p.add_argument("--plot", metavar="FILE", help="draw the curve (.png, .svg or .pdf)")
    p.add_argument("--quiet", action="store_true", help="no progress")


def run(args: argparse.Namespace) -> int:
    """Print the table, write what is asked for, and return the exit code."""
    check_writable(args.output, args.plot, inputs=(args.problem,))
    from netsp.model.problem import Problem
    from netsp.plan.sizing.tether_sizing import Step, tether_curve
    from netsp.view.pictures import style

    if args.plot:
        style.check_format(args.plot)
    clock = command_clock(args.time_limit)
    problem = clock.bounded("reading the problem", lambda: Problem.load(args.problem))

    def tell(step: Step) -> None:
        print(
            f"tether {step.tether:.6g}: tour {step.length:.6g}, {step.status.value}",
            file=sys.stderr,
        )

    curve = tether_curve(
        problem,
        args.longest,
        time_limit=clock,
        seed=args.seed,
        on_step=None if args.quiet else tell,
    )
    print(f"{'tether from':>12} {'up to':>12} {'tour':>12} {'saves':>8}  status")
    first = curve.steps[0].length if curve.steps else 0.0
    for s in curve.steps:
        print(
            f"{s.tether:>12.6g} {s.until:>12.6g} {s.length:>12.6g} "
            f"{100.0 * (1.0 - s.length / first):>7.2f}%  {s.status.value}"
        )
    print(
        f"shortest sufficient tether {curve.shortest:.6f} {curve.units}, needed by "
        f"{problem.goal_label(curve.needs)}"
    )
    if not curve.whole:
        messages.warning("the time was up before the shortest sufficient tether was come to")
    if args.output:
        curve.save(args.output)
    if args.plot:
        style.save(curve.plot().figure, args.plot)
        print(f"picture {args.plot}", file=sys.stderr)
    return 0 if curve.whole else EXIT_NOT_ALL
