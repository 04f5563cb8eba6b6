"""`netsp warm-up`: compiles everything ahead."""

from __future__ import annotations

import argparse
import contextlib
import sys

EXAMPLE = "netsp warm-up"


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument("--quiet", action="store_true", help="no progress")


def run(args: argparse.Namespace) -> int:
    """Compile, and return the exit code."""
    from netsp.command.compiling import compile_messages, steps
    from netsp.compiled.tiers import everything_compiled

    messages = contextlib.nullcontext() if args.quiet else compile_messages(sys.stderr)
    with messages, everything_compiled():
        for name, step in steps():
            if not args.quiet:
                print(f"warm-up: {name}", file=sys.stderr, flush=True)
            step()
    return 0
