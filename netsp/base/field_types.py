"""Types of fields in all file formats: checked numbers, points and names, for pydantic models."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, TypeGuard

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema

from netsp.base.errors import InputError
from netsp.base.validated import shown, shown_names

LARGEST = 1e12
"""Format limit of all files: magnitude of a coordinate, radius or length."""

LARGEST_TOTAL = 1e6 * LARGEST
"""Format limit of all files: sum of lengths that a solution states."""

SMALLEST = 1e-100
"""Format limit of all files: smallest length or radius; squares of smaller ones underflow."""


def checked_number(value: Any, max_magnitude: float = LARGEST) -> Any:
    """Return a finite number of Python or NumPy as a float; raise ValueError for other values."""
    real = isinstance(value, int | float | np.integer | np.floating)
    if isinstance(value, bool | np.bool_ | np.timedelta64) or not real:
        raise ValueError(f"expected a number, got {shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"expected a finite number, got {shown(value)}")
    if abs(number) > max_magnitude:
        raise ValueError(f"expected a magnitude of at most {max_magnitude:g}, got {shown(value)}")
    return number


def checked_integer(value: Any) -> int:
    """Return an integer of Python or NumPy as an int; raise ValueError for other values."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise ValueError(f"expected a whole number, got {shown(value)}")
    return int(value)


def is_index(value: object, count: int) -> TypeGuard[int]:
    """Return whether a value is a whole number from 0 to count - 1, and no boolean."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    return whole and 0 <= int(value) < count  # type: ignore[call-overload]


def index_of(which: int | str, things: list, field: str) -> int:  # type: ignore[type-arg]
    """Return the index of the obstacle or goal that an event names; raise InputError if there is
    none."""
    if isinstance(which, str):
        found = [k for k, thing in enumerate(things) if thing.name == which]
        if len(found) == 1:
            return found[0]
        unnamed = [k for k, thing in enumerate(things) if thing.name is None]
        if not found and which in (f"#{k}" for k in unnamed):
            return int(which[1:])
        raise InputError(
            f"{field}: expected the name of one, got {which!r}, of which there are {len(found)}; "
            f"there are {shown_names(thing.name for thing in things)}"
        )
    if not is_index(which, len(things)):
        raise InputError(f"{field}: expected a number below {len(things)}, got {which!r}")
    return int(which)


def _size(value: Any) -> Any:
    """Return a length or radius; raise ValueError if it is too small to be squared."""
    number = checked_number(value)
    if 0.0 < number < SMALLEST:
        raise ValueError(f"expected at least {SMALLEST:g}, got {shown(value)}")
    return number


def checked_argument(name: str, value: Any, low: float, high: float = LARGEST) -> float:
    """Return an argument as a float; raise InputError, which names it, unless low ≤ value ≤
    high."""
    try:
        number = float(checked_number(value))
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    if not low <= number <= high:
        limits = f"at least {low:g}" if high == LARGEST else f"{low:g} to {high:g}"
        raise InputError(f"{name}: expected {limits}, got {shown(value)}")
    return number


def checked_instance(name: str, value: object, kind: type) -> None:
    """Raise InputError, which names the argument, unless a value is an instance of a class."""
    if not isinstance(value, kind):
        raise InputError(f"{name}: expected a {kind.__name__}, got {shown(value)}")


SPACES = dict.fromkeys(map(ord, "\u00a0\u3000\u200c\u200d"), " ")
"""Translation table for spaces and joiners of some scripts, which `str.isprintable` rejects."""


def _name(value: Any) -> Any:
    """Return a printable name of at most 200 characters; raise ValueError for other values."""
    plain = isinstance(value, str) and value.translate(SPACES).isprintable()
    if isinstance(value, str) and (len(value) > 200 or not plain):
        raise ValueError(f"expected a name of at most 200 printable characters, got {shown(value)}")
    return value


def _coordinates(
    value: Any, sizes: tuple[int, ...], max_magnitude: float = LARGEST
) -> tuple[float, ...]:
    text = " or ".join(("[x, y]" if k == 2 else "[x, y, z]") for k in sizes)
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) not in sizes:
        raise ValueError(f"expected {text}, got {shown(value)}")
    return tuple(checked_number(v, max_magnitude) for v in value)


def _point3(value: Any, max_magnitude: float = LARGEST) -> tuple[float, ...]:
    xyz = _coordinates(value, (2, 3), max_magnitude)
    return xyz if len(xyz) == 3 else (*xyz, 0.0)


def _track_point(value: Any) -> tuple[float, ...]:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 4:
        raise ValueError(f"expected [t, x, y, z], got {shown(value)}")
    return tuple(checked_number(v) for v in value)


Name = Annotated[str, BeforeValidator(_name)]

# A lambda wraps each validator that has a second parameter: pydantic would pass a `ValidationInfo`
# for it.


Number = Annotated[float, BeforeValidator(lambda v: checked_number(v))]


Total = Annotated[float, BeforeValidator(lambda v: checked_number(v, LARGEST_TOTAL))]
"""Sum of lengths."""


Integer = Annotated[int, BeforeValidator(checked_integer)]


Positive = Annotated[float, Field(gt=0), BeforeValidator(_size)]


NonNegative = Annotated[float, Field(ge=0), BeforeValidator(lambda v: checked_number(v))]


Point2 = Annotated[
    tuple[float, float],
    BeforeValidator(lambda v: _coordinates(v, (2,))),
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}),
]


POINT3_SCHEMA = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 3}


Point3 = Annotated[
    tuple[float, float, float], BeforeValidator(lambda v: _point3(v)), WithJsonSchema(POINT3_SCHEMA)
]


TrackPoint = Annotated[
    tuple[float, float, float, float],
    BeforeValidator(lambda v: _track_point(v)),
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 4, "maxItems": 4}),
]
"""Time in seconds, and the position at that time."""


PathPoint = Annotated[
    tuple[float, float, float],
    BeforeValidator(lambda v: _point3(v, LARGEST_TOTAL)),
    WithJsonSchema(POINT3_SCHEMA),
]
"""Point of a drawn path, which may pass beyond the outermost coordinate of a problem."""
