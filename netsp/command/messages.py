"""What commands say on standard error besides progress: an error ends them, a warning does not."""

from __future__ import annotations

import contextlib
import sys
import warnings
from collections.abc import Iterator
from typing import Any

from netsp.errors import LeftOutWarning


def error(text: str) -> None:
    """In one line."""
    print(f"netsp: {text}", file=sys.stderr)


def warning(text: str) -> None:
    """Of what may go wrong with what was asked."""
    print(f"netsp: warning: {text}", file=sys.stderr)


def note(text: str) -> None:
    """Of what was assumed or done that was not asked."""
    print(f"netsp: note: {text}", file=sys.stderr)


@contextlib.contextmanager
def warnings_in_one_line() -> Iterator[None]:
    """Print each warning of something left out as a command says it, once."""
    said: set[str] = set()
    with warnings.catch_warnings():
        warnings.simplefilter("always", LeftOutWarning)
        otherwise = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *rest: Any) -> None:
            if not issubclass(category, LeftOutWarning):
                otherwise(message, category, *rest)
            elif str(message) not in said:
                said.add(str(message))
                warning(str(message))

        warnings.showwarning = show  # type: ignore[assignment]
        yield
