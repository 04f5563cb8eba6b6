"""A solver's options: read by name, checked by type."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, TypeVar

from netsp.errors import InputError

P = TypeVar("P")


def read_params(kind: type[P], solver: str, params: Mapping[str, Any] | None) -> P:
    """A solver's options as its dataclass; InputError for an unknown name or a wrong type, naming
    the choices."""
    if params is not None and not isinstance(params, Mapping):
        raise InputError(f"solver {solver!r}: params: expected names with values, got {params!r}")
    known = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for name, value in (params or {}).items():
        if name not in known:
            choices = f"expected one of {', '.join(sorted(known))}" if known else "it takes none"
            raise InputError(f"solver {solver!r}: unknown option {name!r}; {choices}")
        values[name] = _typed(f"solver {solver!r}: option {name!r}", value, known[name].default)
    try:
        return kind(**values)
    except ValueError as error:
        raise InputError(f"solver {solver!r}: {error}") from None


def _typed(what: str, value: Any, default: Any) -> Any:
    """The value as the type of its default; text (from the command line) is read as that type."""
    try:
        if isinstance(default, str):
            return str(value)
        if isinstance(default, int):
            if not float(value) == int(float(value)):
                raise ValueError
            return int(float(value))
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        expected = "a whole number" if isinstance(default, int) else "a number"
        raise InputError(f"{what}: expected {expected}, got {value!r}") from None
    if not math.isfinite(number):
        raise InputError(f"{what}: expected a finite number, got {value!r}")
    return number


@dataclass(frozen=True)
class NoParams:
    """This solver takes no options."""
