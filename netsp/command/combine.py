"""`netsp combine`: shards of one study joined."""

from __future__ import annotations

import argparse
import sys

from netsp.command import json_output

EXAMPLE = "netsp combine part-1.jsonl part-2.jsonl -o rows.jsonl"


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument("results", metavar="RESULTS", nargs="+", help="results of netsp compare")
    p.add_argument("-o", "--output", required=True, metavar="FILE", help="file for all rows")
    json_output.json_flag(p)


def run(args: argparse.Namespace) -> int:
    """Write the rows, and return the exit code."""
    json_output.check_stdout(args)
    from netsp.study.compare.rows import combine

    count = combine(args.results, args.output)
    if args.json:
        json_output.tell({"trials": count, "file": args.output})
        return 0
    print(f"{count} trials in {args.output}", file=sys.stderr)
    return 0
