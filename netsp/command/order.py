"""`netsp order`: another name of `netsp solve` for missions."""

from __future__ import annotations

import argparse

from netsp.command.solve_mission import TIME_LIMIT
from netsp.command.types import natural, seconds

EXAMPLE = "netsp order missions/basin.json -o better.json"


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument("mission", metavar="MISSION", help="mission file (JSON)")
    p.add_argument(
        "--time-limit", type=seconds, default=TIME_LIMIT, metavar="S",
        help=f"seconds for all; default {TIME_LIMIT:g}",
    )  # fmt: skip
    p.add_argument(
        "--seed", type=natural, default=0, metavar="N", help="random seed of the search; default 0"
    )
    p.add_argument(
        "-o", "--output", metavar="FILE", help="write the mission to this file (default: stdout)"
    )
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")


def run(args: argparse.Namespace) -> int:
    """Plan, write the mission, and return the exit code."""
    from netsp.command.solve_mission import solve

    return solve(
        args.mission, solver="auto", params={}, time_limit=args.time_limit, iteration_limit=None,
        seed=args.seed, output=args.output, plot=None, quiet=args.quiet,
    )  # fmt: skip
