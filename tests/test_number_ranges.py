"""Tests of the checks of the numbers in policies."""

import math
from dataclasses import dataclass, field, fields, is_dataclass, replace

import pytest

from netsp.base.errors import InputError
from netsp.base.files import FilePolicy
from netsp.base.number_ranges import check_not_negative, check_positive
from netsp.base.ram import MemoryPolicy
from netsp.online.fly import flight_policy
from netsp.online.guard import guard_policy
from netsp.online.link import link_policy
from netsp.world.scene.scene_policy import FieldPolicy, FloorPolicy, GridPolicy, SeamPolicy
from netsp.world.scene.surfaces import SurfacePolicy
from netsp.world.tether.tether_policy import TetherPolicy, pull_settings


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


@pytest.mark.parametrize(
    "policy",
    [
        FilePolicy,
        MemoryPolicy,
        TetherPolicy,
        GridPolicy,
        FieldPolicy,
        SeamPolicy,
        FloorPolicy,
        SurfacePolicy,
    ],
)
def test_policies_of_base_and_world_refuse_negative_numbers(policy):
    for number in fields(policy):
        with pytest.raises(InputError, match=f"{number.name}: expected"):
            policy(**{number.name: -1})


def test_kernels_get_every_number_of_the_tether_policy():
    policy = TetherPolicy(max_sidesteps=3, min_gain=0.7)
    settings = pull_settings(
        policy, delta=0.1, spread=0.01, flat=1e-6, rounds=3, precision=5e-4
    )._asdict()
    assert settings["max_sidesteps"] == 3
    assert {f.name: getattr(policy, f.name) for f in fields(policy)}.items() <= settings.items()


def policies(*modules):
    """Default policies of all classes that modules define."""
    for module in modules:
        for kind in vars(module).values():
            if is_dataclass(kind) and kind.__module__ == module.__name__:
                has_defaults = kind is not guard_policy.CoursePolicy
                yield kind() if has_defaults else kind(1.0, 0.8, 0.6)


@pytest.mark.parametrize(
    "policy", [*policies(guard_policy, link_policy, flight_policy)], ids=lambda p: type(p).__name__
)
def test_no_number_of_a_guard_a_link_or_a_flight_is_negative(policy):
    for f in fields(policy):
        if f.type in ("int", "float"):
            with pytest.raises(InputError, match=f"{f.name}: expected"):
                replace(policy, **{f.name: -1})
