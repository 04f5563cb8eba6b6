"""`netsp warm-up`: compiles everything ahead."""

from __future__ import annotations

import argparse
import contextlib
import sys
import time

EXAMPLE = "netsp warm-up"


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument("--quiet", action="store_true", help="no progress")


def run(args: argparse.Namespace) -> int:
    """Compile, and return the exit code."""
    from netsp.command.compiling import compile_messages, steps
    from netsp.command.patience import span
    from netsp.compiled.tiers import everything_compiled

    messages = contextlib.nullcontext() if args.quiet else compile_messages(sys.stderr)
    with messages, everything_compiled():
        every, begin = list(steps()), time.monotonic()
        for done, (name, step) in enumerate(every):
            if not args.quiet:
                left = (time.monotonic() - begin) / max(done, 1) * (len(every) - done)
                more = f", about {span(left)} left" if done else ""
                print(
                    f"warm-up: {name} ({done + 1} of {len(every)}{more})",
                    file=sys.stderr, flush=True,
                )  # fmt: skip
            step()
    return 0
