"""The sampled roadmap: sound, repeatable, and never better than the exact one."""

import itertools

import numpy as np
import pytest
import shapely

from netsp import Circle, InfeasibleError, InputError, Problem, Status, solve, verify
from netsp.base.errors import LimitReachedError
from netsp.hsignature import concatenate, crossings, is_looping, signature
from netsp.model.bound_scope import Scope
from netsp.roadmap.prm import PrmRoadmap
from netsp.roadmap.taut import TautRoadmap
from tests.worlds import random_world

pytest.importorskip("ompl", reason="OMPL is not installed")


@pytest.fixture(scope="module")
def world():
    return random_world(1, circles=12, goals=5, tether=280.0)


@pytest.fixture(scope="module")
def prm(world):
    return PrmRoadmap(world, samples=500, seed=3)


def test_base_goals_and_the_asked_number_of_samples_are_milestones(world, prm):
    assert len(prm.milestones) == 1 + len(world.goals) + 500
    assert np.allclose(prm.milestones[: 1 + len(world.goals)], world.points, atol=1e-6)


def test_no_edge_enters_an_obstacle(world, prm):
    lines = shapely.linestrings(prm.milestones[prm.edges][:, :, :2])
    for o in world.obstacles:
        assert shapely.distance(lines, shapely.Point(o.center)).min() >= o.radius - 1e-9


def test_the_seed_decides_the_roadmap(world, prm):
    again = PrmRoadmap(world, samples=500, seed=3)
    other = PrmRoadmap(world, samples=500, seed=4)
    assert np.array_equal(prm.milestones, again.milestones)
    assert np.array_equal(prm.edges, again.edges)
    assert not np.array_equal(prm.milestones, other.milestones)


def test_an_augmented_edge_appends_the_crossings_of_its_segment(world, prm):
    g = prm.augmented
    rays = world.representative_points
    rng = np.random.default_rng(0)
    for v in rng.integers(0, len(g), 150):
        for e in range(g.start[v], g.start[v + 1]):
            w = int(g.target[e])
            segment = g.points[[g.milestone[v], g.milestone[w]]]
            assert g.word(w) == concatenate(g.word(int(v)), crossings(segment, rays))
            assert g.cost[e] == pytest.approx(np.linalg.norm(segment[0] - segment[1]))


def test_augmented_vertices_are_distinct_within_the_tether_and_do_not_loop(world, prm):
    g = prm.augmented
    keys = list(zip(g.milestone.tolist(), g.node.tolist(), strict=True))
    assert len(set(keys)) == len(keys)
    assert g.length.max() <= world.tether_length
    assert not any(is_looping(g.word(v)) for v in range(len(g)))
    assert np.allclose(g.distances(np.array([0]), np.arange(len(g)))[0], g.length)


def test_the_augmented_graph_is_undirected(prm):
    m = prm.augmented._matrix
    assert abs(m - m.T).max() < 1e-12


def test_a_star_dijkstra_and_networkx_find_the_same_length(prm):
    import networkx

    g = prm.augmented
    view = g.to_networkx()
    assert view.number_of_nodes() == len(g)
    rows = [int(v) for v in prm._vertex]
    for u, v in itertools.islice(itertools.combinations(rows, 2), 0, 60, 7):
        lengths = []
        for method in ("astar", "dijkstra"):
            p = g.path(u, v, method)
            d = np.linalg.norm(np.diff(g.points[g.milestone[p]], axis=0), axis=1).sum()
            lengths.append(float(d))
        ends = [(int(g.milestone[k]), g.word(k)) for k in (u, v)]
        lengths.append(networkx.dijkstra_path_length(view, *ends))
        lengths.append(float(g.distances(np.array([u]), np.array([v]))[0, 0]))
        assert lengths == pytest.approx([lengths[0]] * 4)


@pytest.mark.parametrize("seed", range(3))
def test_no_length_over_the_roadmap_beats_the_exact_one(seed):
    problem = random_world(seed, circles=10, goals=4, tether=250.0)
    exact = TautRoadmap(problem)
    sampled = PrmRoadmap(problem, samples=400, seed=seed)
    place = {
        (int(c), w): k for k, (c, w) in enumerate(zip(exact.cluster, exact.signatures, strict=True))
    }
    keys = [(int(c), w) for c, w in zip(sampled.cluster, sampled.signatures, strict=True)]
    assert set(keys) <= set(place)
    index = [place[k] for k in keys]
    true = exact.to_travel_graph().costs[np.ix_(index, index)]
    found = sampled.to_travel_graph().costs
    same = sampled.cluster[:, None] == sampled.cluster[None, :]
    assert (found[~same] >= true[~same] * (1 - 1e-9) - 1e-9).all()
    assert np.array_equal(found, found.T)
    short = PrmRoadmap(problem, samples=400, seed=seed, shortcut=True)
    assert np.allclose(short.to_travel_graph().costs[~same], true[~same], rtol=1e-9)


@pytest.mark.parametrize("roadmap", ["taut", "prm"])
def test_lower_bounds_of_legs_are_below_the_legs(world, roadmap):
    graph = (TautRoadmap(world) if roadmap == "taut" else PrmRoadmap(world)).to_travel_graph()
    bounds = graph.lower_bounds()
    costs = graph.costs
    finite = np.isfinite(costs)
    assert (bounds[finite] <= costs[finite] + 1e-9).all()
    assert np.isinf(bounds[~finite]).all()
    # worth having: at least 60 per cent of the legs' length on average
    assert (bounds[finite] / np.maximum(costs[finite], 1e-9)).mean() > 0.6
    some = np.array([0, 2, 5])
    assert np.allclose(graph.lower_bounds(some)[0, 1:], bounds[0, some[1:]])


def test_costs_among_some_vertices_are_those_of_the_whole(world):
    part, whole = (TautRoadmap(world).to_travel_graph() for _ in range(2))
    some = np.array([0, 1, 4, 7])
    assert np.array_equal(part.costs_among(some), whole.costs[np.ix_(some, some)])
    assert np.array_equal(whole.costs_among(some), whole.costs[np.ix_(some, some)])


@pytest.mark.parametrize("options", [{}, {"shortcut": True}])
def test_a_solution_over_the_roadmap_is_verified(world, options):
    solution = solve(world, roadmap="prm", roadmap_options={"samples": 400, **options})
    assert solution.status is Status.OPTIMAL_OF_ROADMAP
    assert solution.lower_bound_of is Scope.ROADMAP
    assert solution.roadmap == "prm"
    assert verify(world, solution), str(verify(world, solution))
    assert solution.length >= solve(world).length * (1 - 1e-9)


def test_different_depths_make_the_roadmap_three_dimensional():
    problem = Problem(
        base=(0, 0, 0), goals=[(8, 1, -6), (8, -1, -2)], tether_length=20,
        obstacles=[Circle(center=(4, 0), radius=1)],
    )  # fmt: skip
    roadmap = PrmRoadmap(problem, samples=300)
    assert np.ptp(roadmap.milestones[3:, 2]) > 3.0
    solution = solve(problem, roadmap="prm", roadmap_options={"samples": 300})
    assert verify(problem, solution), str(verify(problem, solution))
    path = np.array(solution.path)
    assert signature(path, problem.representative_points) == ()


def test_bounds_hold_the_samples():
    problem = Problem(
        base=(0, 0), goals=[(8, 0)], tether_length=12, bounds=(-1, -2, 9, 2),
        obstacles=[Circle(center=(4, 0), radius=1)],
    )  # fmt: skip
    m = PrmRoadmap(problem, samples=200).milestones
    assert m[:, 0].min() >= -1
    assert m[:, 0].max() <= 9
    assert np.abs(m[:, 1]).max() <= 2


def test_bad_options_are_named(world):
    with pytest.raises(InputError, match="samples: expected a positive whole number, got 0"):
        PrmRoadmap(world, samples=0)
    with pytest.raises(InputError, match="more than 100 vertices"):
        PrmRoadmap(world, samples=300, max_augmented=100)
    with pytest.raises(InputError, match="unknown option 'size'; expected one of"):
        solve(world, roadmap="prm", roadmap_options={"size": 3})


def test_a_goal_that_only_the_samples_miss_is_not_called_infeasible():
    problem = Problem(
        base=(0, 0),
        goals=[(10, 0)],
        tether_length=11.9,
        obstacles=[Circle(center=(5, 0), radius=3)],
    )
    assert solve(problem).length == pytest.approx(2 * 11.86, rel=1e-2)
    with pytest.raises(LimitReachedError, match=r"prm roadmap reaches goal #0.*more samples"):
        PrmRoadmap(problem, samples=60)


def test_a_goal_the_roadmap_cannot_reach_is_infeasible_with_the_reason():
    problem = Problem(
        base=(0, 0),
        goals=[(10, 0)],
        tether_length=11.0,
        obstacles=[Circle(center=(5, 0), radius=3)],
    )
    with pytest.raises(InfeasibleError, match=r"goal #0 is out of reach"):
        PrmRoadmap(problem, samples=200)
