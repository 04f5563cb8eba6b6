"""What commands say on standard error besides progress: an error ends them, a warning does not."""

from __future__ import annotations

import sys


def error(text: str) -> None:
    """In one line."""
    print(f"netsp: {text}", file=sys.stderr)


def warning(text: str) -> None:
    """Of what may go wrong with what was asked."""
    print(f"netsp: warning: {text}", file=sys.stderr)


def note(text: str) -> None:
    """Of what was assumed or done that was not asked."""
    print(f"netsp: note: {text}", file=sys.stderr)
