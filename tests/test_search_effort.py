"""Tests of the number of rounds of local search before a proof."""

from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netsp.base.errors import InputError
from netsp.plan.search_effort import SearchEffort

EFFORT = SearchEffort()


@given(st.integers(1, 600))
def test_small_problems_get_fewer_search_rounds(goals):
    rounds = EFFORT.rounds(goals)
    assert (rounds < EFFORT.min_rounds) == (goals <= EFFORT.max_proven_goals)
    assert rounds <= max(EFFORT.min_rounds, EFFORT.max_rounds_per_goal * goals)


@given(st.integers(1, 600))
def test_one_more_goal_never_means_fewer_rounds(goals):
    assert EFFORT.rounds(goals + 1) >= EFFORT.rounds(goals)


@pytest.mark.parametrize("field", [f.name for f in fields(SearchEffort)])
def test_an_effort_has_no_negative_numbers(field):
    with pytest.raises(InputError, match=f"{field}: expected a number that is not negative"):
        SearchEffort(**{field: -1})
