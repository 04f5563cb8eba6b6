"""Checks of the numbers in policies and params."""

from __future__ import annotations

import math
from dataclasses import fields
from numbers import Real
from typing import Any

from netsp.base.errors import InputError


def check_not_negative(policy: Any) -> None:
    """Raise InputError, which names the field, if a number of a policy is negative or NaN.

    Parameters
    ----------
    policy : dataclass
        The policy. Only fields that are declared as int or float are checked.
    """
    _check(policy, 0.0, "a number that is not negative")


def check_positive(policy: Any) -> None:
    """Raise InputError, which names the field, if a number of a policy is not positive.

    Parameters
    ----------
    policy : dataclass
        The policy. Only fields that are declared as int or float are checked.
    """
    _check(policy, math.nextafter(0.0, 1.0), "a positive number")


def check_shares(policy: Any, *names: str) -> None:
    """Raise InputError, which names the field, if one of the named fields is not from 0 to 1."""
    for name in names:
        value = getattr(policy, name)
        if not (isinstance(value, Real) and 0.0 <= float(value) <= 1.0):
            raise InputError(f"{name}: expected a number from 0 to 1, got {value!r}")


def _check(policy: Any, minimum: float, expected: str) -> None:
    for field in fields(policy):
        if field.type in ("int", "float", int, float):
            value = getattr(policy, field.name)
            # also refuses NaN, for which every comparison is false
            if not (isinstance(value, Real) and float(value) >= minimum):
                raise InputError(f"{field.name}: expected {expected}, got {value!r}")
