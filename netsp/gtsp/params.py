"""Options of a solver, read by name and checked by type."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields, is_dataclass
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from netsp.base.errors import InputError
from netsp.base.validated import shown

P = TypeVar("P")


def read_params(kind: type[P], solver: str, params: Mapping[str, Any] | None) -> P:
    """Return a solver's options as its dataclass.

    The value of an option that is itself a dataclass, such as a policy, is an instance of it or a
    mapping of its fields; ``{"policy.cuts.max_combs": 5}`` is short for
    ``{"policy": {"cuts": {"max_combs": 5}}}``.

    Parameters
    ----------
    kind : type
        Dataclass of the options.
    solver : str
        Name of the solver, for messages.
    params : mapping, optional
        Values by name, as from a study file or the command line.

    Raises
    ------
    InputError
        An unknown or missing option, a wrong type or a value out of range; says what is possible.
    """
    if params is not None and not isinstance(params, Mapping):
        raise InputError(f"solver {solver!r}: params: expected names with values, got {params!r}")
    return _read(kind, f"solver {solver!r}: ", "", params or {})


def _read(kind: type[P], where: str, prefix: str, params: Mapping[str, Any]) -> P:
    """Return the options below `prefix`, which is empty or the path of a policy with a dot."""
    known = {f.name: f for f in fields(kind) if f.init}  # type: ignore[arg-type]
    try:
        types = get_type_hints(kind)
    except Exception:  # annotations that only a type checker can read
        types = {}
    values: dict[str, Any] = {}
    for name, value in _nested(params).items():
        if name not in known:
            choices = f"expected one of {', '.join(sorted(known))}" if known else "it takes none"
            raise InputError(f"{where}unknown option {f'{prefix}{name}'!r}; {choices}")
        option = f"{prefix}{name}"
        if _is_dataclass(types.get(name)) and isinstance(value, Mapping):
            values[name] = _read(types[name], where, f"{option}.", value)
        else:
            values[name] = _typed(f"{where}option {option!r}", value, types.get(name))
    for name, f in known.items():
        if name not in values and f.default is MISSING and f.default_factory is MISSING:
            raise InputError(f"{where}option {f'{prefix}{name}'!r}: missing")
    try:
        return kind(**values)
    except InputError as error:
        if str(error).startswith(where):
            raise
        raise InputError(f"{where}{prefix}{error}") from None
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}{error}") from None


def _nested(params: Mapping[str, Any]) -> dict[str, Any]:
    """Return options with dotted names as mappings below the first part of their names."""
    out: dict[str, Any] = {}
    for name, value in params.items():
        first, dot, rest = str(name).partition(".")
        group = out.get(first, {})
        if dot and isinstance(group, Mapping):
            out[first] = {**group, rest: value}
        else:
            out[name] = value
    return out


def _is_dataclass(kind: Any) -> bool:
    return isinstance(kind, type) and is_dataclass(kind)


def _typed(what: str, value: Any, kind: Any) -> Any:
    """Return a value as its annotated type, if that is a plain type or a policy.

    Text, as from the command line, is parsed.
    """
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
    if _is_dataclass(kind) and not isinstance(value, kind):
        names = ", ".join(f.name for f in fields(kind))
        raise InputError(f"{what}: got {shown(value)}; expected a mapping of {names}")
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
    """Return a whole number, given as int, text or float (``1e4``)."""
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, str):
        with suppress(ValueError):
            return int(value)  # not through a float, which has only 53 bits
    with suppress(TypeError, ValueError, OverflowError):
        if float(value).is_integer():
            return int(float(value))
    raise InputError(f"{what}: expected a whole number, got {shown(value)}")


@dataclass(frozen=True)
class NoParams:
    """Options of a solver that has none."""
