"""Interpreted and compiled kernels: the same to the last bit, so it never matters which ran."""

from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from netsp.compiled import tiers
from netsp.problem import Problem
from netsp.roadmap import outline, tangents
from netsp.worlds import FAMILIES, random_world

PROBLEMS = sorted((Path(__file__).parent.parent / "problems").glob("*.json"))


def _arrays(value):
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, tuple):
        return [a for part in value for a in _arrays(part)]
    return [np.array(value)]


def _built(problem):
    free = outline.build_outline(problem)
    graph = tangents.build_tangents(free, problem.tether_length)
    return [a.tobytes() for a in _arrays(astuple(free)) + _arrays(astuple(graph))]


def _both(problem):
    with pytest.MonkeyPatch.context() as patch:
        for module in (outline, tangents):
            patch.setattr(module, "choose", lambda kernel, steps: tiers.interpreted(kernel))
        by_interpreter = _built(problem)
    with tiers.everything_compiled():
        return by_interpreter, _built(problem)


@pytest.mark.parametrize("path", PROBLEMS, ids=lambda p: p.stem)
def test_shipped_problems_have_the_same_tangents_interpreted_and_compiled(path):
    problem = Problem.load(path)
    if len(problem.obstacles) > 12:
        pytest.skip("never interpreted")
    by_interpreter, by_compiler = _both(problem)
    assert by_interpreter == by_compiler


@given(st.integers(0, 10_000), st.sampled_from(sorted(FAMILIES)), st.integers(1, 6))
@settings(max_examples=30, deadline=None)
def test_random_worlds_have_the_same_tangents_interpreted_and_compiled(seed, family, goals):
    problem = random_world(seed, family=family, goals=goals, obstacles=5, tether_length=300.0)
    by_interpreter, by_compiler = _both(problem)
    assert by_interpreter == by_compiler


def test_a_kernel_is_interpreted_until_its_allowance_is_spent_then_compiled():
    @njit
    def twice(x):
        return 2 * x

    small = tiers.ALLOWANCE // 2
    first, second, third = (tiers.choose(twice, small) for _ in range(3))
    assert first is second is tiers.interpreted(twice)
    assert third is twice
    assert first(3) == third(3) == 6


def test_work_beyond_the_allowance_and_loaded_kernels_are_compiled_at_once():
    @njit
    def twice(x):
        return 2 * x

    assert tiers.choose(twice, tiers.ALLOWANCE + 1) is twice
    twice(1)
    assert tiers.choose(twice, 1) is twice


def test_while_compiling_ahead_nothing_is_interpreted():
    @njit
    def twice(x):
        return 2 * x

    with tiers.everything_compiled():
        assert tiers.choose(twice, 0) is twice
    assert tiers.choose(twice, 0) is tiers.interpreted(twice)
