"""`netsp world`: random problems."""

from __future__ import annotations

import argparse
import sys

from netsp.base.errors import counted
from netsp.command import messages
from netsp.command.types import check_writable, count_or_range, length, natural, positive

EXAMPLE = "netsp world --goals 30 --tether 350 --seed 7 -o world.json"


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument(
        "--family",
        default="icra2017",
        metavar="NAME",
        help="icra2017 (default), rss2016, clustered, array or harbour",
    )
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="random seed; default 0")
    p.add_argument(
        "--goals", type=positive, metavar="N", help="number of goals; default 20, rss2016: 5 to 10"
    )
    p.add_argument(
        "--obstacles",
        type=count_or_range,
        metavar="N",
        help="number of obstacles, or a range such as 1-20 that it is drawn from; default 20, "
        "rss2016: 5 to 10",
    )
    p.add_argument(
        "--tether", type=length, default=300.0, metavar="L", help="tether length; default 300"
    )
    p.add_argument(
        "--side", type=length, default=500.0, metavar="L", help="side of the square; default 500"
    )
    p.add_argument(
        "--radii",
        type=length,
        nargs=2,
        default=(10.0, 30.0),
        metavar="R",
        help="minimum and maximum radius; default 10 30",
    )
    p.add_argument(
        "-o", "--output", metavar="FILE", help="write the problem to this file (default: stdout)"
    )
    p.add_argument("--plot", metavar="FILE", help="draw it (png, svg or pdf)")


def run(args: argparse.Namespace) -> int:
    """Draw a world, write it, and return the exit code."""
    from netsp.base.files import write_text
    from netsp.plan.random_worlds import reachable_world

    check_writable(args.output, args.plot)
    if args.plot:
        from netsp.view.pictures import problem_picture as plotting
        from netsp.view.pictures import style

        style.check_format(args.plot)
    problem, in_vain = reachable_world(
        args.seed,
        family=args.family,
        goals=args.goals,
        obstacles=args.obstacles,
        tether_length=args.tether,
        side=args.side,
        radii=tuple(args.radii),
    )
    if in_vain:
        messages.note(f"{counted(in_vain, 'world')} of this seed did not fit and were redrawn")
    if args.output:
        write_text(args.output, problem.to_json())
    else:
        sys.stdout.write(problem.to_json())
    if args.plot:
        plotting.save(problem, None, args.plot)
    return 0
