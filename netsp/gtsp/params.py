"""A solver's options: read by name, checked by type."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from netsp.base.errors import InputError
from netsp.model.validated import shown

P = TypeVar("P")


def read_params(kind: type[P], solver: str, params: Mapping[str, Any] | None) -> P:
    """A solver's options as its dataclass; InputError for an unknown name or a wrong type, naming
    the choices."""
    if params is not None and not isinstance(params, Mapping):
        raise InputError(f"solver {solver!r}: params: expected names with values, got {params!r}")
    known = {f.name: f for f in fields(kind) if f.init}  # type: ignore[arg-type]
    try:
        types = get_type_hints(kind)
    except Exception:  # annotations that only a type checker can read
        types = {}
    values: dict[str, Any] = {}
    for name, value in (params or {}).items():
        if name not in known:
            choices = f"expected one of {', '.join(sorted(known))}" if known else "it takes none"
            raise InputError(f"solver {solver!r}: unknown option {name!r}; {choices}")
        values[name] = _typed(f"solver {solver!r}: option {name!r}", value, types.get(name))
    for name, f in known.items():
        if name not in values and f.default is MISSING and f.default_factory is MISSING:
            raise InputError(f"solver {solver!r}: option {name!r}: missing")
    try:
        return kind(**values)
    except (TypeError, ValueError) as error:
        raise InputError(f"solver {solver!r}: {error}") from None


def _typed(what: str, value: Any, kind: Any) -> Any:
    """The value as its annotated type, where that is a plain one; text (from the command line) is
    read as that type."""
    if get_origin(kind) in (Union, UnionType):
        if value is None and type(None) in get_args(kind):
            return None
        kinds = [k for k in get_args(kind) if k is not type(None)]
        return _typed(what, value, kinds[0]) if len(kinds) == 1 else value
    if get_origin(kind) is Literal:
        if value not in get_args(kind):
            choices = ", ".join(map(str, get_args(kind)))
            raise InputError(f"{what}: expected one of {choices}, got {shown(value)}")
        return value
    if kind is bool:
        named = {"true": True, "1": True, "false": False, "0": False}
        if isinstance(value, str) and value.lower() in named:
            return named[value.lower()]
        if value in (True, False):
            return bool(value)
        raise InputError(f"{what}: expected true or false, got {shown(value)}")
    if kind is str:
        return str(value)
    if kind is int:
        return _whole(what, value)
    if kind is not float:
        return value
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what}: expected a number, got {shown(value)}") from None
    if not math.isfinite(number):
        raise InputError(f"{what}: expected a finite number, got {shown(value)}")
    return number


def _whole(what: str, value: Any) -> int:
    """A whole number, also as text or as a float (``1e4``)."""
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, str):
        with suppress(ValueError):
            return int(value)  # not by way of a float, which has but 53 bits
    with suppress(TypeError, ValueError, OverflowError):
        if float(value).is_integer():
            return int(float(value))
    raise InputError(f"{what}: expected a whole number, got {shown(value)}")


@dataclass(frozen=True)
class NoParams:
    """This solver takes no options."""
