"""What a tour pays to get somewhere: no tour pays less, and sheets that are far away are ruled
out."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import travel_graph
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.gtsp_policy import CostPolicy, GtspPolicy
from netsp.gtsp.limits import Limits
from netsp.gtsp.solver_run import RunStopped
from netsp.mip import root
from netsp.mip.cuts import Cut
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.lp_warm_start import WarmStart
from netsp.mip.mip_policy import MipPolicy, PricingPolicy
from netsp.mip.mip_solver import MipRun
from netsp.mip.parity_paths import leg_excess, paths_from_base
from netsp.mip.prices import Prices
from netsp.mip.program import Duals, duals_of_relaxation
from netsp.mip.reducedcosts import reduced_costs
from netsp.model.solution import Status
from netsp.plan.random_worlds import random_world
from tests.cut_points import some_cut
from tests.travel_graphs import bound_legs_first, random_graph
from tests.worlds import costs_of


def tours_of(graph):
    """All tours, as vertices, base first."""
    for order in itertools.permutations(range(1, graph.goal_count + 1)):
        if order[0] < order[-1]:
            for rest in itertools.product(*(graph.members(c).tolist() for c in order)):
                yield (0, *rest)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.randoms(use_true_random=False), st.floats(0.0, 1.0))
def test_no_tour_pays_less_than_the_ways_to_its_vertices_and_along_its_legs(seed, chance, scale):
    graph = random_graph(seed, 4, most=3)
    rng = np.random.default_rng(seed)
    cuts = [some_cut(chance, graph) for _ in range(3)]
    duals = duals_of_relaxation(
        0.5 + scale * rng.normal(size=5), scale * np.abs(rng.normal(size=3)), cuts, graph.cluster
    )
    prices = Prices(costs_of(graph), DeadLegs.missing(graph.costs), graph.cluster, cuts, duals)
    terms, excess = prices._terms, prices._cost - prices._cheapest[graph.cluster]
    way, other, before = paths_from_base(terms, excess, np.inf)
    lengths, least = [], []
    for tour in tours_of(graph):
        legs = np.column_stack([tour, np.roll(tour, -1)])
        pays = []
        for (u, v), price in zip(legs.tolist(), reduced_costs(legs, terms), strict=True):
            there = other[u] if before[u] == v else way[u]
            home = other[v] if before[v] == u else way[v]
            pays.append(there + leg_excess(u, v, price, terms) + home)
        pays += [way[v] + other[v] - excess[v] for v in tour[1:]]
        lengths.append(graph.tour_length(tour))
        least.append(prices.bound + max(pays))
    assert (np.array(least) <= np.array(lengths) + 1e-9).all()


def two_sheets(apart):
    """Four goals at the corners of a square beside the base, and the same once more on a sheet that
    is far from there, though not from itself."""
    at = np.array([(0.0, 0.0), (1, 1), (1, 2), (2, 2), (2, 1)])
    near = np.linalg.norm(at[:, None] - at[None, :], axis=2)
    cluster = np.array([0, 1, 2, 3, 4, 1, 2, 3, 4])
    costs = near[np.ix_(cluster, cluster)].copy()
    sheet = np.array([0, 0, 0, 0, 0, 1, 1, 1, 1])
    costs += apart * (sheet[:, None] != sheet[None, :])
    costs[cluster[:, None] == cluster[None, :]] = np.inf
    return costs, cluster


@pytest.mark.parametrize(("apart", "gone"), [(4.0, True), (0.4, False)])
def test_a_sheet_far_away_is_ruled_out_though_its_legs_cost_nothing(apart, gone):
    costs, cluster = two_sheets(apart)
    half = np.where(cluster == 0, np.sqrt(2) - 0.5, 0.5)  # every vertex pays for half of its legs
    duals = Duals(2.0 * half[:5], half, np.zeros(0))
    marks = DeadLegs.missing(costs)
    prices = Prices(costs, marks, cluster, [], duals)
    local = prices._cost - prices._cheapest[cluster]
    assert (local[5:] < 1e-9).all()
    prices.fix_out(prices.bound + 2.0)
    dead = marks.matrix()
    assert dead[5:].all() == gone
    assert not dead[0, 1]
    assert not dead[1, 2]


def test_the_search_for_ways_can_be_stopped():
    costs, cluster = two_sheets(0.4)
    duals = Duals(np.zeros(5), np.zeros(9), np.zeros(0))
    asked, policy = [], PricingPolicy(vertices_per_check=1)

    def stop():
        asked.append(1)
        if len(asked) == 3:
            raise RunStopped

    prices = Prices(costs, DeadLegs.missing(costs), cluster, [], duals, stop, policy)
    with pytest.raises(RunStopped):
        prices.fix_out(prices.bound + 100.0)


@pytest.mark.parametrize("seed", range(4))
def test_once_few_legs_are_left_all_of_them_are_measured(seed, monkeypatch):
    problem = random_world(seed, goals=9, tether_length=400.0)
    known = MipRun(travel_graph(problem), Limits()).solve("highs", None)
    pricing = PricingPolicy(max_measured_legs=10**9)
    gtsp = GtspPolicy(costs=CostPolicy(max_measured_vertices=20))
    policy = MipPolicy(pricing=pricing, gtsp=gtsp)
    after = []
    measure = root.Root._measure_left

    def note(self):
        longer = measure(self)
        if self.costs.exact is not None:
            after.append(bool((self.costs.exact | self.dead.matrix()).all()))
            legs = self.lp.legs
            used = self.costs.vertices[legs]
            alive = ~self.dead[legs[:, 0], legs[:, 1]]
            lengths = self.costs.graph.costs_of(*used[alive].T)
            in_lp = np.array(self.lp._highs.getLp().col_cost_)[self.lp._column] / self.lp._scale
            np.testing.assert_allclose(in_lp[alive], lengths, rtol=1e-6)
        return longer

    monkeypatch.setattr(root.Root, "_measure_left", note)
    bound_legs_first(monkeypatch)
    found = MipRun(travel_graph(problem), Limits(), policy=policy).solve("highs", None)
    assert after
    assert all(after)
    assert found.status is known.status is Status.OPTIMAL
    assert found.length == pytest.approx(known.length, rel=2e-6)


def test_cuts_of_a_core_keep_their_sides_there_and_never_hold_the_base():
    graph = travel_graph(random_world(1, goals=12, tether_length=350.0))
    rng = np.random.default_rng(0)
    core = np.unique(np.concatenate([[0], *(graph.members(c)[:2] for c in range(1, 13))]))
    cuts = []
    for _ in range(30):
        c = int(rng.integers(1, 13))
        inside = (rng.random(len(core)) < 0.3) | (graph.cluster[core] == c)
        inside[0] = False
        cuts.append(Cut(inside, c))
        whole = np.isin(graph.cluster[core], rng.choice(12, 3, replace=False) + 1)
        cuts.append(replace(cuts[-1], inside=whole, cluster=-1, teeth=((1, 2), (3, 4), (5, 6))))
    wide = WarmStart(core, np.zeros((0, 2), np.int64), cuts, core).lifted_cuts(CostMatrix(graph))
    own = {(c.inside.tobytes(), c.cluster) for c in cuts}
    assert {(c.inside[core].tobytes(), c.cluster) for c in wide} == own
    assert len(own) < len(wide) < 2 * len(own)
    for c in wide:
        assert not c.inside[0]
        if c.teeth:
            for goal in range(1, 13):
                assert np.unique(c.inside[graph.cluster == goal]).size == 1
        else:
            assert c.inside[graph.cluster == c.cluster].all()
