"""What leaves a program in HiGHS, and comes in: the optimum is that of a new program, and where
nothing has changed it is there without a step."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.mip.highs import HighsRelaxation
from netsp.mip.mip_policy import LpPolicy, MipPolicy
from netsp.mip.subtours import fractional_cuts
from tests.cut_points import all_legs, some_cut
from tests.travel_graphs import random_graph


def steps(lp):
    """Of the last solution."""
    return lp._highs.getInfo().simplex_iteration_count


def with_cuts(seed):
    """A relaxation solved with the cuts of some rounds, and its last point."""
    graph = random_graph(seed, 12, most=4)
    legs, costs = all_legs(graph)
    lp = HighsRelaxation(graph.cluster, legs, costs)
    point = lp.solve(60.0)
    for _ in range(12):
        lp.add_cuts(fractional_cuts(point.x, point.legs, point.y, graph.cluster))
        point = lp.solve(60.0)
    return graph, lp, point


@pytest.mark.parametrize("seed", range(3))
def test_a_program_that_takes_too_many_steps_is_begun_anew(seed):
    graph, lp, before = with_cuts(seed)
    policy = MipPolicy(lp=LpPolicy(simplex_steps_per_row=0))
    again = HighsRelaxation(graph.cluster, *all_legs(graph), policy)
    again.add_cuts(lp.cuts)
    point = again.solve(60.0)
    assert point.objective == pytest.approx(before.objective, rel=1e-9)
    assert steps(again) > 0


@pytest.mark.parametrize("seed", range(6))
def test_legs_without_use_leave_at_no_cost(seed):
    _, lp, before = with_cuts(seed)
    lp.keep_legs(before.y > 1e-9)
    after = lp.solve(60.0)
    assert steps(lp) == 0
    assert after.objective == pytest.approx(before.objective, rel=1e-9)
    assert len(after.y) == len(lp.legs) < len(before.y)
    np.testing.assert_allclose(after.x, before.x, atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_cuts_leave_at_no_cost_and_those_that_the_basis_rests_on_stay(seed):
    _, lp, before = with_cuts(seed)
    cuts = len(lp.cuts)
    lp.keep_cuts(np.zeros(cuts, dtype=bool))
    after = lp.solve(60.0)
    assert steps(lp) == 0
    assert after.objective == pytest.approx(before.objective, rel=1e-9)
    assert len(after.duals.cut) == len(lp.cuts) < cuts


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.randoms(use_true_random=False))
def test_whatever_comes_and_goes_the_optimum_is_that_of_a_new_program(seed, chance):
    graph = random_graph(seed, 6, most=3)
    everything, costs = all_legs(graph)
    cost_of = {tuple(leg): c for leg, c in zip(everything.tolist(), costs.tolist(), strict=True)}
    lp = HighsRelaxation(graph.cluster, everything, costs)
    for _ in range(12):
        held = {tuple(leg) for leg in lp.legs.tolist()}
        what = chance.choice(["legs", "cuts", "-legs", "-cuts", "costs", "solve"])
        out = [leg for leg in cost_of if leg not in held]
        if what == "legs" and out:
            some = chance.sample(out, chance.randint(1, len(out)))
            lp.add_legs(np.array(some), np.array([cost_of[leg] for leg in some]))
        elif what == "cuts":
            lp.add_cuts([some_cut(chance, graph) for _ in range(3)])
        elif what == "-legs":
            lp.keep_legs(np.array([chance.random() < 0.8 for _ in lp.legs]))
        elif what == "-cuts":
            lp.keep_cuts(np.array([chance.random() < 0.5 for _ in lp.cuts], dtype=bool))
        elif what == "costs":
            cost_of = {leg: c * chance.uniform(0.9, 1.1) for leg, c in cost_of.items()}
            lp.set_costs(np.array([cost_of[tuple(leg)] for leg in lp.legs.tolist()]))
        else:
            lp.solve(60.0)
    found = lp.solve(60.0)
    new = HighsRelaxation(
        graph.cluster, lp.legs, np.array([cost_of[tuple(leg)] for leg in lp.legs.tolist()])
    )
    new.add_cuts(lp.cuts)
    expected = new.solve(60.0)
    assert (found is None) == (expected is None)
    if found is not None:
        assert found.objective == pytest.approx(expected.objective, rel=1e-7)
