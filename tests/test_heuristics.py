"""The heuristics of the two papers do what their papers say, and count as they say."""

import functools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, NetspError, Polygon, Problem, solve_graph
from netsp.anneal import icra2017
from netsp.base.compiled.rng import seeded, uniform
from netsp.gtsp.gtsp_policy import CostPolicy
from netsp.gtsp.search import LayeredInstance
from netsp.hsignature import concatenate, entangled, signature
from netsp.plan import rss2016
from netsp.plan.random_worlds import random_world as papers_world
from netsp.plan.solve_problem import travel_graph
from netsp.plan.solver_table import ROADMAPS
from tests.brute import brute_tour
from tests.travel_graphs import random_graph
from tests.worlds import random_world, small_worlds


@functools.cache
def world():
    return random_world(5, circles=10, goals=6, tether=280.0)


@functools.cache
def graph(roadmap="taut"):
    return travel_graph(world(), roadmap)


@pytest.mark.parametrize("roadmap", ROADMAPS)
def test_greedy_goes_to_the_nearest_vertex_and_retraces(roadmap):
    g = graph(roadmap)
    result = solve_graph(g, "greedy")
    here, seen = 0, {0}
    for v in result.tour[1:]:
        left = [w for w in range(len(g)) if int(g.cluster[w]) not in seen]
        assert g.costs[here, v] == min(g.costs[here, w] for w in left)
        here = v
        seen.add(int(g.cluster[v]))
    out = sum(g.costs[a, b] for a, b in zip(result.tour, result.tour[1:], strict=False))
    assert result.length == pytest.approx(2.0 * out)
    home = solve_graph(g, "greedy", params={"retrace": "tether"})
    assert home.length == pytest.approx(out + g.costs[result.tour[-1], 0])
    assert home.length <= result.length * (1 + 1e-12)


@pytest.mark.parametrize("roadmap", ROADMAPS)
def test_greedy_2016_is_twice_the_shortest_tethers(roadmap):
    g = graph(roadmap)
    shortest = [g.costs[0, g.members(c)].min() for c in range(1, g.goal_count + 1)]
    assert solve_graph(g, "greedy-2016").length == pytest.approx(2.0 * sum(shortest))


@pytest.mark.parametrize("roadmap", ROADMAPS)
def test_by_its_other_reading_greedy_2016_retraces_once_as_greedy_does(roadmap):
    g = graph(roadmap)
    other = solve_graph(g, "greedy-2016", params={"retrace": "end"})
    assert other.tour == solve_graph(g, "greedy").tour
    assert other.length == pytest.approx(solve_graph(g, "greedy").length)
    assert other.length != pytest.approx(solve_graph(g, "greedy-2016").length)


@pytest.mark.parametrize("seed", range(4))
def test_reduced_mip_is_optimal_over_the_classes_of_least_tether(seed):
    g = random_graph(seed, goals=5)
    least = [0, *(int(m[np.argmin(g.costs[0, m])]) for m in map(g.members, range(1, 6)))]
    literal = solve_graph(g, "reduced-mip", params={"classes": 1, "polish": 0})
    assert set(literal.tour) == set(least)
    assert literal.length == pytest.approx(brute_tour(g.subgraph(np.sort(least))), rel=1e-6)
    assert solve_graph(g, "reduced-mip").length <= literal.length * (1 + 1e-12)
    every = solve_graph(g, "reduced-mip", params={"classes": 99})
    assert every.status == "optimal"
    assert every.length == pytest.approx(brute_tour(g), rel=1e-6)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 7), st.floats(0.01, 10.0))
def test_the_annealed_length_is_that_of_the_tour(seed, goals, theta):
    g = random_graph(seed, goals=goals)
    instance = LayeredInstance.of_graph(g)
    rng = np.random.default_rng(seed)
    tour = np.zeros(goals + 1, dtype=np.int64)
    for k, c in enumerate(rng.permutation(np.arange(1, goals + 1))):
        tour[k + 1] = rng.integers(instance.start[c], instance.start[c + 1])
    best = tour.copy()
    length = g.tour_length(instance.original(tour))
    of_vertex = np.repeat(np.arange(goals + 1), np.diff(instance.start))
    final, least = icra2017.anneal(
        tour, best, length, length, 500, theta, 0.5, instance.costs, instance.start, of_vertex,
        seeded(rng),
    )  # fmt: skip
    assert g.is_tour(instance.original(tour))
    assert final == pytest.approx(g.tour_length(instance.original(tour)))
    assert least == pytest.approx(g.tour_length(instance.original(best)))
    assert least <= final * (1 + 1e-9)


def test_the_random_numbers_are_even():
    state = seeded(np.random.default_rng(1))
    x = np.array([uniform(state) for _ in range(20_000)])
    assert 0.0 <= x.min() < x.max() < 1.0
    counts = np.histogram(x, bins=20, range=(0, 1))[0]
    assert ((counts - 1000) ** 2 / 1000).sum() < 45  # chi square, 19 degrees: p < 0.001


@pytest.mark.parametrize("solver", ["anneal", "anneal-2016"])
def test_annealing_finds_the_optimum_of_a_small_world(solver):
    g = graph()
    best = solve_graph(g, "mip").length
    found = solve_graph(g, solver, iteration_limit=200_000, seed=1)
    assert found.length <= best * (1.0 + (1e-9 if solver == "anneal" else 0.25))


def test_the_trace_of_2016_tells_length_and_entanglement():
    result = solve_graph(graph(), "anneal-2016", iteration_limit=5_000, seed=1)
    rows = [r for r in result.trace if r.stage == "anneal"]
    assert len(rows) > 100
    assert all(r.current > 0 and r.entangled >= 0 for r in rows)
    assert rows[-1].iteration == 5_000


@pytest.mark.parametrize("roadmap", ROADMAPS)
def test_ways_are_free_and_write_the_words_they_say(roadmap):
    p, g = world(), graph(roadmap)
    detours = g.detours(sub_goals=True)
    solid = shapely.union_all([o.shape(-1e-3) for o in p.obstacles])
    rng = np.random.default_rng(0)
    m, places, n = detours.far.shape
    for _ in range(60):
        a, b = rng.choice(m, 2, replace=False)
        via = int(rng.integers(m, places)) if rng.random() < 0.7 else -1
        path = detours.path(a, b, via)
        assert np.allclose(path[[0, -1]], p.points[[a, b]])
        assert not shapely.LineString(path[:, :2]).intersects(solid)
        assert signature(path, p.representative_points) == detours.word(a, b, via)
        drawn = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        assert drawn == pytest.approx(detours.length(a, b, via), rel=1e-3)
        if via < 0:
            assert (
                detours.length(a, b) <= g.costs[g.cluster == a][:, g.cluster == b].min() * 1.000001
            )
        o = int(rng.integers(n))
        far = detours.far_side(a, b, via, o)
        if far >= 0:
            # the sub-goal lies beyond the obstacle's middle, seen from where the way is nearest
            middle = p.representative_points[o]
            line = shapely.LineString(path[:, :2])
            nearest = np.array(line.interpolate(line.project(shapely.Point(middle))).coords[0])
            place = detours.path(a, 0 if a else 1, far)
            assert (
                np.linalg.norm(place[:, :2] - middle, axis=1).min() <= p.obstacles[o].radius * 1.2
            )
            if np.hypot(*(nearest - middle)) > p.obstacles[o].radius:
                turned = detours.word(a, b, far)
                assert signature(detours.path(a, b, far), p.representative_points) == turned


@settings(max_examples=15, deadline=None)
@given(small_worlds(), st.integers(0, 10_000))
def test_entanglement_and_vertices_of_2016_are_those_of_the_words(problem, seed):
    try:
        g = travel_graph(problem)
    except NetspError:  # a goal out of reach
        return
    detours = g.detours(sub_goals=True)
    rng = np.random.default_rng(seed)
    trie, vertex = rss2016._admissible(g)
    m, places, n = detours.far.shape
    goals = m - 1
    for _ in range(20):
        order = np.array([0, *rng.permutation(np.arange(1, m)), 0])
        via = np.where(rng.random(goals + 1) < 0.4, -1, rng.integers(m - 1, places, goals + 1))
        via = np.where(via < m, -1, via)
        legs = [(int(order[k]), int(order[k + 1]), int(via[k])) for k in range(goals + 1)]
        if any(not math.isfinite(detours.length(*leg)) for leg in legs):
            continue
        stops = np.zeros(goals + 1, dtype=np.int64)
        stack = np.zeros((3, 4 * (goals + 1) * len(detours.letters) + 4), dtype=np.int64)
        table = rss2016.Table(
            detours.planar, detours.height, detours.letters, detours.row, detours.far,
            detours.near, trie, vertex,
        )  # fmt: skip
        turns = np.zeros(n + 1, dtype=np.int64)
        state = rss2016.Configuration(order, via, stops, stack, turns, np.zeros_like(stops))
        length, held, missed = rss2016.evaluate(state, table)
        words = [()]
        for leg in legs:
            words.append(concatenate(words[-1], detours.word(*leg)))
        found = [g.vertices_of([int(order[k])], [words[k]]) for k in range(1, goals + 1)]
        assert length == pytest.approx(sum(detours.length(*leg) for leg in legs))
        assert held == len(entangled(words[-1]))
        assert missed == sum(f is None for f in found)
        assert stops[1:].tolist() == [-1 if f is None else f[0] for f in found]


def test_sub_goals_go_round_polygons_and_stay_within_bounds():
    p = Problem(
        base=(-4, 0),
        goals=[(4, 0), (4, 2)],
        obstacles=[
            Polygon(polygon=[(-1, -2), (1, -2), (1, 2), (-1, 2)]),
            Circle(center=(0, 5), radius=1),
        ],
        tether_length=30,
        bounds=(-6, -6, 6, 6.05),
    )
    detours = travel_graph(p).detours(sub_goals=True)
    direct = detours.path(0, 1)
    around = detours.path(0, 1, detours.far_side(0, 1, -1, 0))
    assert np.sign(direct[:, 1].sum()) == -np.sign(around[:, 1].sum())
    assert detours.word(0, 1) != detours.word(0, 1, detours.far_side(0, 1, -1, 0))
    assert around[:, 1].max() <= 6.05


def test_a_goal_on_a_boundary_does_not_make_a_path_of_thousands_of_points():
    p = Problem(
        base=(0, 0),
        goals=[(5, 0), (4, 1), (4, -1), (9, 0)],
        obstacles=[Circle(center=(4, 0), radius=1), Circle(center=(7, 0), radius=1)],
        tether_length=14,
    )
    detours = travel_graph(p).detours(sub_goals=True)
    for a in range(5):
        for b in range(5):
            if a != b:
                path = detours.path(a, b)
                assert len(path) < 500
                assert signature(path, p.representative_points) == detours.word(a, b)


def test_greedy_measures_few_legs_of_a_long_tether_and_goes_the_same_way():
    """Beyond `max_measured_vertices` it searches by lower bounds; the walk is that of the whole
    matrix."""
    problem = papers_world(0, goals=8, tether_length=500.0)
    graph, measured = travel_graph(problem), travel_graph(problem)
    assert len(graph) > CostPolicy().max_measured_vertices
    assert measured.costs.shape == (len(graph), len(graph))
    found = solve_graph(graph, "greedy")
    assert graph.estimate(len(graph)).seconds > 0
    assert found.tour == solve_graph(measured, "greedy").tour
