"""Tests of the handover of a proof from walks to cutting planes."""

from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netsp import solve_graph, travel_graph
from netsp.base.errors import InputError
from netsp.gtsp.dp.handover import Handover
from netsp.gtsp.limits import Limits
from netsp.mip.mip_policy import MipPolicy
from netsp.mip.mip_solver import MipRun
from tests.worlds import random_world


@given(st.integers(1, 200), st.integers(0, 10**6))
def test_cuts_take_over_at_few_legs_or_many_labels(vertices, labels):
    handover = Handover(max_legs=600, max_legs_of_slow_walks=10_000, max_labels=40_000)
    legs = vertices * (vertices - 1) // 2
    assert handover.is_due(vertices, labels) == (
        legs <= 600 or (legs <= 10_000 and labels > 40_000)
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(2))
def test_walks_and_cuts_that_take_over_at_once_prove_the_same_tour(seed):
    graph = travel_graph(random_world(seed, circles=10, goals=13, tether=300.0))
    by_walks = solve_graph(graph, "auto")
    policy = MipPolicy(handover=Handover(max_legs_of_slow_walks=10**6))
    stages = []
    limits = Limits(on_progress=lambda p: stages.append(p.stage))
    by_cuts = MipRun(graph, limits, policy=policy).solve("highs", None, walks=True)
    assert stages.count("walks") == 1
    assert "root" in stages
    assert by_cuts.status == by_walks.status == "optimal"
    assert by_cuts.length == pytest.approx(by_walks.length, rel=1e-9)


@pytest.mark.parametrize("field", [f.name for f in fields(Handover)])
def test_a_handover_has_no_negative_numbers(field):
    with pytest.raises(InputError, match=f"{field}: expected a number that is not negative"):
        Handover(**{field: -1})
