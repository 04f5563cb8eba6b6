"""`gtsp/`, `mip/` and `anneal/` solve any generalised TSP, without a word about tethers."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from netsp import InputError, Status, TravelGraph, solve_graph, travel_graph
from netsp.gtsp.cost_oracle import CostOracle, Estimate
from netsp.gtsp.gtsp_policy import CostPolicy
from netsp.gtsp.instance import BaselessInstance, Instance
from netsp.roadmap.leg_provider import LegProvider, Legs
from tests.worlds import random_world

ROOT = Path(__file__).resolve().parent.parent

FORBIDDEN = {
    "tether", "signature", "hsignature", "word", "roadmap", "homotopy", "obstacle", "geometric",
    "geometry", "robot",
}  # fmt: skip
"""Parts of names that belong to the problem of the robot, without a plural's ending."""

OLD = {"obstacles", "BITS_PER_WORD"}
"""Old names that warn for one release."""

GENERIC = [
    path
    for room in ("gtsp", "mip", "anneal")
    for path in sorted((ROOT / "netsp" / room).rglob("*.py"))
]


def identifiers(tree):
    """Yield all names that a module defines, uses or imports."""
    for node in ast.walk(tree):
        for field in ("id", "attr", "name", "arg", "asname", "module"):
            if isinstance(name := getattr(node, field, None), str):
                yield name


def parts(name):
    """Return the words of an identifier, each without a plural's ending."""
    found = re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)
    return {p.lower().removesuffix("s") for p in found}


@pytest.mark.parametrize("path", GENERIC, ids=lambda p: str(p.relative_to(ROOT)))
def test_generic_rooms_have_no_name_of_the_robots_problem(path):
    tree = ast.parse(path.read_text())
    found = {n for n in identifiers(tree) if parts(n) & FORBIDDEN} - OLD
    assert not found


@pytest.mark.parametrize("name", ["min_tether", "Words", "roadmap_of", "tetherLength"])
def test_the_rule_of_names_finds_those_that_break_it(name):
    assert parts(name) & FORBIDDEN


EXAMPLE = """
import sys
from netsp.gtsp.instance import Instance
from netsp.mip import solve
from netsp.gtsp.dp import solve as solve_by_walks

costs = [[0, 1, 5, 4], [1, 0, 2, 9], [5, 2, 0, 2], [4, 9, 2, 0]]
instance = Instance.from_costs(costs, clusters=[0, 1, 2, 2])
assert solve(instance).length == solve_by_walks(instance).length == 8.0
loaded = {name.split(".")[1] for name in sys.modules if name.startswith("netsp.")}
assert loaded <= {"base", "model", "gtsp", "mip"}, loaded
"""


def test_an_example_of_operations_research_loads_no_other_room():
    subprocess.run([sys.executable, "-c", EXAMPLE], check=True, cwd=ROOT)


def random_instance(seed):
    """Return an instance of random points in the plane, with its matrix and clusters."""
    rng = np.random.default_rng(seed)
    clusters = np.repeat(np.arange(7), [1, *rng.integers(1, 4, 6)])
    at = rng.uniform(0, 1, (len(clusters), 2))
    costs = np.linalg.norm(at[:, None] - at[None, :], axis=2)
    return Instance.from_costs(costs, clusters), costs, clusters


class StraightLines(CostOracle):
    """Costs that are measured only when they are asked for, and counted."""

    def __init__(self, at, cluster):
        self.at, self.cluster, self.measured = at, cluster, 0

    def lengths(self, vertices, wanted=None, clock=None):
        out = np.linalg.norm(self.at[vertices, None] - self.at[None, vertices], axis=2)
        same = self.cluster[vertices, None] == self.cluster[None, vertices]
        self.measured += out.size
        return np.where(same, np.inf, out)

    def to_base(self):
        return np.linalg.norm(self.at - self.at[0], axis=1)

    def lower_bounds(self, vertices, rows=None, clock=None):
        at = self.at[vertices]
        out = np.abs(at[:, None] - at[None, :]).max(axis=2)
        return out if rows is None else out[rows]


@pytest.mark.parametrize("solver", ["auto", "mip", "dp", "lns", "anneal", "reduced-mip"])
def test_solvers_take_an_instance_as_they_take_a_travel_graph(solver):
    instance, costs, clusters = random_instance(3)
    graph = TravelGraph.from_costs(costs, clusters)
    mine, theirs = (solve_graph(g, solver, seed=2, iteration_limit=200) for g in (instance, graph))
    assert (mine.tour, mine.length, mine.lower_bound, mine.status) == (
        theirs.tour, theirs.length, theirs.lower_bound, theirs.status
    )  # fmt: skip
    assert instance.is_tour(mine.tour)


@pytest.mark.parametrize("solver", ["greedy-tsp", "anneal-2016"])
def test_solvers_over_paths_refuse_an_instance(solver):
    with pytest.raises(InputError, match="needs the geometry of a problem"):
        solve_graph(random_instance(0)[0], solver)


@pytest.mark.parametrize("max_measured", [0, 400])
def test_an_oracle_of_ones_own_is_asked_for_costs(max_measured):
    rng = np.random.default_rng(5)
    cluster = np.repeat(np.arange(6), [1, 3, 3, 3, 3, 3])
    oracle = StraightLines(rng.uniform(0, 1, (len(cluster), 2)), cluster)
    whole = Instance.from_costs(oracle.lengths(np.arange(len(cluster))), cluster)
    params = {"policy.gtsp.costs.max_measured_vertices": max_measured}
    found = solve_graph(Instance(cluster, oracle), "mip", params=params)
    best = solve_graph(whole, "mip")
    assert found.status is best.status is Status.OPTIMAL
    assert found.length == pytest.approx(best.length, rel=1e-6)
    part = Instance(cluster, oracle).subgraph([0, 1, 4, 7, 10, 13])
    assert part.tour_length(range(6)) == pytest.approx(whole.tour_length([0, 1, 4, 7, 10, 13]))


def test_an_oracle_has_all_costs_from_those_of_a_matrix():
    rng = np.random.default_rng(1)
    cluster = np.arange(8)
    oracle = StraightLines(rng.uniform(0, 1, (8, 2)), cluster)
    instance = Instance(cluster, oracle)
    every = oracle.lengths(np.arange(8))
    us, vs = np.array([1, 2, 5]), np.array([3, 7, 6])
    np.testing.assert_array_equal(instance.costs_of(us, vs), every[us, vs])
    rounded = instance.costs_rounded(np.arange(8))
    assert rounded.dtype == np.float32
    assert (rounded <= every).all()
    for positions, block in instance.costs_in_blocks(None, np.array([4, 2])):
        np.testing.assert_array_equal(block, rounded[positions])
    policy = CostPolicy()
    assert instance.estimate(8) == Estimate(policy.s_per_single_leg * 28, 8.0 * 64)
    instance.costs  # noqa: B018
    assert instance.estimate(8) == Estimate(0.0, 0.0)


def test_without_a_base_there_is_an_instance_too():
    _, costs, clusters = random_instance(4)
    free = Instance.from_costs(costs, clusters, base=None)
    assert isinstance(free, BaselessInstance)
    graph = TravelGraph.from_costs(costs, clusters, base=None)
    assert solve_graph(free).length == solve_graph(graph).length
    assert repr(free).startswith("<Instance: 7 clusters of ")
    assert repr(graph).startswith("<TravelGraph: 7 clusters of ")


def test_old_names_of_a_travel_graph_warn_and_give_the_same():
    graph = travel_graph(random_world(0, goals=4, tether=250.0))
    tour = solve_graph(graph).tour
    with pytest.deprecated_call():
        assert graph.complete is graph.is_complete
    with pytest.deprecated_call():
        assert graph.least_left_out == graph.min_tether_left_out
    with pytest.deprecated_call():
        assert graph.least_by_way_of(3.0) == graph.min_length_by_tether(3.0) == 6.0
    with pytest.deprecated_call():
        assert graph.knows_ways
    with pytest.deprecated_call():
        assert (graph.between_goals() == graph.distances_between_goals()).all()
    with pytest.deprecated_call():
        assert graph.ways_by_parity() == graph.parity_oracle(lambda: False)
    with pytest.deprecated_call():
        assert graph.roadmapped is not graph.has_cost_matrix
    with pytest.deprecated_call():
        assert graph.quick_legs
    with pytest.deprecated_call():
        assert graph.legs_at_once
    with pytest.deprecated_call():
        whole = graph.costs_among(tour, asked=None)
    np.testing.assert_array_equal(whole, graph.costs_among(tour))
    with pytest.deprecated_call():
        TravelGraph(graph.cluster, graph.signatures, graph.tethers, graph.oracle,
                    least_left_out=2.0)  # fmt: skip


class Provider:
    """Legs of another package: no subclass of `Legs`, and only what it must have."""

    def __init__(self, legs):
        self.legs = legs

    def lengths(self, vertices, wanted=None, clock=None):
        return self.legs.lengths(vertices, wanted, clock)

    def to_base(self):
        return self.legs.to_base()

    def lower_bounds(self, vertices, rows=None, clock=None):
        return self.legs.lower_bounds(vertices, rows, clock)

    def path(self, u, v):
        return self.legs.path(u, v)


@pytest.mark.parametrize(
    ("flags", "is_single", "is_all"),
    [({}, True, False), ({"at_once": True}, True, True), ({"quick": False}, False, False)],
)
def test_legs_of_other_packages_are_adapted(flags, is_single, is_all):
    graph = travel_graph(random_world(0, goals=4, tether=250.0))
    provider: LegProvider = Provider(graph.oracle)
    for name, value in flags.items():
        setattr(provider, name, value)
    other = TravelGraph(graph.cluster, graph.signatures, graph.tethers, provider)
    assert isinstance(other.oracle, Legs)
    policy, n = CostPolicy(), len(other)
    assert policy.allows_single(other.oracle.estimate(2).seconds) is is_single
    assert policy.allows_all(other.oracle.estimate(n).seconds, n) is is_all
    np.testing.assert_allclose(other.costs, graph.costs)
    np.testing.assert_array_equal(other.path(0, 1), graph.path(0, 1))
    assert other.legs_left_out == []
    assert other.bounds_of_left_out().shape == (0, 3)
