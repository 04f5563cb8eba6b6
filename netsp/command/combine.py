"""`netsp combine`: shards of one study joined."""

from __future__ import annotations

import argparse
import sys

from netsp.command import json_output
from netsp.command.command_options import check_stdout


def run(args: argparse.Namespace) -> int:
    """Write the rows, and return the exit code."""
    check_stdout(args)
    from netsp.study.compare.rows import combine

    count = combine(args.results, args.output)
    if args.json:
        json_output.tell({"trials": count, "file": args.output})
        return 0
    print(f"{count} trials in {args.output}", file=sys.stderr)
    return 0
