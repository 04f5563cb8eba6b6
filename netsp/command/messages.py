"""Errors, warnings and notes of commands on standard error; only an error ends a command."""

from __future__ import annotations

import contextlib
import sys
import warnings
from collections.abc import Iterator
from typing import Any

from netsp.base.errors import LeftOutWarning


def error(text: str) -> None:
    """Print an error in one line."""
    print(f"netsp: {text}", file=sys.stderr)


def warning(text: str) -> None:
    """Print a warning of what may go wrong."""
    print(f"netsp: warning: {text}", file=sys.stderr)


def note(text: str) -> None:
    """Print a note of what was assumed, or done without being asked for."""
    print(f"netsp: note: {text}", file=sys.stderr)


@contextlib.contextmanager
def warnings_in_one_line() -> Iterator[None]:
    """Print each `LeftOutWarning` once, in one line."""
    shown_before: set[str] = set()
    with warnings.catch_warnings():
        warnings.simplefilter("always", LeftOutWarning)
        show_other = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *details: Any) -> None:
            if not issubclass(category, LeftOutWarning):
                show_other(message, category, *details)
            elif str(message) not in shown_before:
                shown_before.add(str(message))
                warning(str(message))

        warnings.showwarning = show  # type: ignore[assignment]
        yield
