"""Tests of the checks of the numbers in policies."""

import math
from dataclasses import dataclass, field

import pytest

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_not_negative, check_positive


@dataclass(frozen=True)
class Inner:
    gain: float = -1.0


@dataclass(frozen=True)
class Policy:
    wait_s: float = 1.0
    n_tries: int = 2
    is_strict: bool = False
    name: str = ""
    inner: Inner = field(default_factory=Inner)


@pytest.mark.parametrize("check", [check_not_negative, check_positive])
def test_flags_names_and_policies_within_a_policy_are_not_checked(check):
    check(Policy())


@pytest.mark.parametrize("name", ["wait_s", "n_tries"])
@pytest.mark.parametrize("value", [-1, -5e-324, math.nan, -math.inf, "1", None])
@pytest.mark.parametrize("check", [check_not_negative, check_positive])
def test_the_field_and_the_value_of_a_wrong_number_are_told(check, value, name):
    with pytest.raises(InputError, match=f"{name}: expected a .*number.*, got {value!r}"):
        check(Policy(**{name: value}))


@pytest.mark.parametrize("value", [0, 0.0, -0.0])
def test_zero_is_not_negative_and_not_positive(value):
    check_not_negative(Policy(wait_s=value))
    with pytest.raises(InputError, match="wait_s: expected a positive number, got"):
        check_positive(Policy(wait_s=value))


def test_the_smallest_and_the_largest_numbers_are_positive():
    check_positive(Policy(wait_s=5e-324))
    check_positive(Policy(wait_s=math.inf))
