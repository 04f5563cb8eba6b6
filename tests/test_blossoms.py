"""2-matching inequalities: valid for tours, violated where they should be, certified."""

import itertools
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.mip.blossoms import best_teeth, blossom_cuts, cluster_flows
from netsp.mip.cbc_program import CbcInteger, CbcRelaxation
from netsp.mip.cuts import Cut, cut_coefficients
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.highs import HighsRelaxation
from netsp.mip.highs_integer import HighsInteger
from netsp.mip.lagrangian_bound import exact_bound
from netsp.mip.prices import Prices
from netsp.mip.program import duals_of_relaxation
from tests.brute import brute_tour
from tests.cut_points import all_legs, some_cut, tours_as_points
from tests.travel_graphs import random_graph
from tests.worlds import costs_of

PRISM = np.array([(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5), (0, 3), (1, 4), (2, 5)])
HALVES = np.array([0.5] * 6 + [1.0] * 3)


def test_the_prism_of_halves_is_cut():
    cuts = blossom_cuts(cluster_flows(PRISM, HALVES, np.arange(6)), np.arange(6))
    assert cuts
    for cut in cuts:
        assert cut.teeth == ((0, 3), (1, 4), (2, 5))
        left = cut_coefficients([cut], np.arange(6), PRISM) @ HALVES
        assert left[0] == pytest.approx(-2.0 * cut.rhs - 1.0)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.randoms(use_true_random=False))
def test_no_tour_violates_a_two_matching_inequality(seed, chance):
    graph = random_graph(seed, 6, most=2)
    legs, _ = all_legs(graph)
    cuts = [some_cut(chance, graph) for _ in range(8)]
    rows = cut_coefficients(cuts, graph.cluster, legs)
    for _, y in tours_as_points(chance, graph, legs):
        assert (rows @ y >= [-2.0 * c.rhs - 1e-9 for c in cuts]).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(3, 7), st.integers(0, 10**6))
def test_the_teeth_chosen_are_the_best_odd_set(m, seed):
    rng = np.random.default_rng(seed)
    between = np.triu(rng.uniform(0, 1, (m, m)), 1)
    between += between.T
    handle = np.arange(m) < max(1, m // 2)
    violation, teeth = best_teeth(between, handle)
    across = [(g, h) for g in np.flatnonzero(handle) for h in np.flatnonzero(~handle)]
    best = max(
        1.0 - sum(1.0 - between[p] for p in f) - sum(between[p] for p in across if p not in f)
        for k in range(1, len(across) + 1, 2)
        for f in itertools.combinations(across, k)
    )
    assert violation == pytest.approx(best)
    assert len(teeth) % 2 == 1


@pytest.mark.parametrize("program", [HighsRelaxation, CbcRelaxation])
@pytest.mark.parametrize("seed", range(4))
def test_bounds_with_teeth_are_below_their_certificate_and_the_optimum(seed, program):
    graph = random_graph(seed, 6)
    legs, costs = all_legs(graph)

    lp = program(graph.cluster, legs, costs)
    lp.add_cuts([some_cut(random.Random(seed + k), graph) for k in range(25)])
    point = lp.solve(60.0)
    assert (point.slack > -1e-6).all()
    rng = np.random.default_rng(seed)
    best = brute_tour(graph)
    for scale in (0.0, 1e-3, 1.0):
        duals = duals_of_relaxation(
            point.duals.cluster / 2.0 + scale * rng.normal(size=len(point.duals.cluster)),
            -point.duals.cut / 2.0 + scale * np.abs(rng.normal(size=len(lp.cuts))),
            lp.cuts, graph.cluster,
        )  # fmt: skip
        dead = DeadLegs(~np.isfinite(graph.costs))
        claimed = Prices(costs_of(graph), dead, graph.cluster, lp.cuts, duals).bound
        exact = exact_bound(graph.costs, graph.cluster, lp.cuts, duals)
        assert claimed <= exact <= best * (1 + 1e-12)
        assert float(exact) - claimed <= 1e-9 * max(1.0, scale) * len(lp.cuts)
        if scale == 0.0:
            assert claimed >= point.objective * (1.0 - 1e-6)


@pytest.mark.parametrize("program", [HighsInteger, CbcInteger])
def test_integer_programs_keep_to_cuts_with_teeth(program):
    """On the prism alone, without subtour cuts, every integer point obeys them too."""
    costs = np.array([1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 9.0, 9.0, 9.0])
    cluster = np.arange(6)
    teeth = ((0, 3), (1, 4), (2, 5))
    at_most = Cut(np.isin(cluster, [0, 1, 2]), -1, teeth)
    free = program(cluster, cluster, PRISM, costs, []).solve(60.0)
    held = program(cluster, cluster, PRISM, costs, [at_most]).solve(60.0)
    y = held.point.y
    # y(E(H)) + y(F) <= |H| + (|F| - 1) / 2
    assert y[:3].sum() + y[6:].sum() <= 4.0 + 1e-6
    assert held.point.objective >= free.point.objective - 1e-9
