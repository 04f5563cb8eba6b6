"""Goals with alternatives and goals that come after others, beside brute force."""

import itertools
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import (
    InfeasibleError,
    InputError,
    Problem,
    Status,
    TravelGraph,
    solve,
    solve_graph,
    travel_graph,
    verify,
)
from netsp.command.main import main
from netsp.model.arrangement import transitive_closure
from tests.worlds import random_world

ORDERED = ("auto", "dp", "lns")


def arranged(problem: Problem, rng: np.random.Generator, ties: int, choices: bool) -> Problem:
    """The problem with random precedences, along a hidden order, and with pairs of alternatives."""
    goals = [g.model_dump() | {"name": f"g{k}"} for k, g in enumerate(problem.goals)]
    if choices and len(goals) > 2:
        for g in goals[:2]:
            g["choice"] = "either"
    units = list(dict.fromkeys(g.get("choice") or g["name"] for g in goals))
    hidden = rng.permutation(len(units))
    for _ in range(ties if len(units) > 1 else 0):
        a, b = sorted(rng.choice(len(units), 2, replace=False))
        first, then = units[hidden[a]], units[hidden[b]]
        for g in goals:
            if then in (g["name"], g["choice"]):
                g["after"] = (*g["after"], first)
    return Problem.model_validate(problem.model_dump() | {"goals": goals})


def brute(graph: TravelGraph) -> float:
    """The shortest tour, by all orders of clusters and, for each, a path through layers."""
    best = np.inf
    for order in itertools.permutations(range(1, graph.goal_count + 1)):
        if len(graph.before) and any(
            graph.before[b, a] for a, b in itertools.combinations(order, 2)
        ):
            continue
        reach, here = np.zeros(1), np.array([0])
        for c in (*order, 0):
            there = graph.members(c)
            reach = (reach[:, None] + graph.costs[np.ix_(here, there)]).min(axis=0)
            here = there
        best = min(best, float(reach[0]))
    return best


@settings(max_examples=10, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    goals=st.integers(1, 6),
    ties=st.integers(0, 6),
    choices=st.booleans(),
)
def test_every_solver_that_may_finds_the_best_of_the_orders_and_places_allowed(
    seed, goals, ties, choices
):
    rng = np.random.default_rng(seed)
    problem = arranged(random_world(seed, goals=goals, tether=300.0), rng, ties, choices)
    try:
        graph = travel_graph(problem)
    except InfeasibleError:
        return
    best = brute(graph)
    for solver in ORDERED:
        found = solve(problem, solver)
        assert verify(problem, found), str(verify(problem, found))
        assert found.length == pytest.approx(best), solver
        assert (found.lower_bound or 0.0) <= best * (1.0 + 1e-9)
        assert solver == "lns" or found.status is Status.OPTIMAL
    if not len(problem.precedences):
        for solver in ("mip", "reduced-mip", "greedy", "anneal"):
            found = solve(problem, solver)
            assert verify(problem, found)
            assert found.length >= best * (1.0 - 1e-9)
        assert solve(problem, "mip").length == pytest.approx(best)
        found = solve(problem, "anneal-2016", iteration_limit=200)
        # so few proposals may end entangled
        assert found.status is Status.NO_SOLUTION_FOUND or verify(problem, found)
        walked = solve(problem, "greedy-tsp")
        assert walked.status is Status.INVALID or verify(problem, walked)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(8, 10), ties=st.integers(1, 12))
def test_walks_with_precedences_prove_what_all_sets_prove(seed, n, ties):
    """Random costs with three classes each; the sets of goals are gone through independently."""
    rng = np.random.default_rng(seed)
    cluster = np.concatenate([[0], np.repeat(np.arange(1, n + 1), 3)])
    at = rng.random((len(cluster), 2))
    costs = np.hypot(*(at[:, None] - at[None]).T) + rng.random() * 0.2
    graph = TravelGraph.from_costs(np.maximum(costs, costs.T), cluster)
    direct = np.zeros((n + 1, n + 1), dtype=bool)
    hidden = 1 + rng.permutation(n)
    for _ in range(ties):
        a, b = sorted(rng.choice(n, 2, replace=False))
        direct[hidden[a], hidden[b]] = True
    graph.before = transitive_closure(direct)
    found = solve_graph(graph, "dp", seed=1)
    assert graph.is_tour(found.tour)
    assert found.lower_bound <= found.length * (1 + 1e-9)
    best = over_sets(graph)
    assert found.length == pytest.approx(best, rel=1e-6)
    assert found.lower_bound <= best * (1.0 + 1e-6)
    assert solve_graph(graph, "auto").status is Status.OPTIMAL


def over_sets(graph: TravelGraph) -> float:
    """Held and Karp's recursion, in plain words."""
    n = graph.goal_count
    needs = [sum(1 << (b - 1) for b in np.flatnonzero(graph.before[:, c])) for c in range(n + 1)]
    reach = {(0, 0): 0.0}
    for _ in range(n):
        nxt: dict[tuple[int, int], float] = {}
        for (s, u), d in reach.items():
            for c in range(1, n + 1):
                if s >> (c - 1) & 1 or needs[c] & ~s:
                    continue
                for v in graph.members(c):
                    key = (s | 1 << (c - 1), int(v))
                    nxt[key] = min(nxt.get(key, np.inf), d + graph.costs[u, v])
        reach = nxt
    return min(d + graph.costs[u, 0] for (_, u), d in reach.items())


def test_an_alternative_out_of_reach_is_no_alternative():
    near_or_far = {"name": "A", "any_of": [[3, 0], [300, 0]]}
    problem = Problem(base=(0, 0), goals=[near_or_far, (0, 2)], tether_length=5)
    found = solve(problem)
    assert [v.goal for v in found.tour] in ([0, 2], [2, 0])
    assert verify(problem, found)
    assert found.status is Status.OPTIMAL
    with pytest.raises(InfeasibleError, match="A/1"):
        solve(Problem(base=(0, 0), goals=[{"name": "A", "any_of": [[9, 0], [8, 0]]}],
                      tether_length=5))  # fmt: skip


def test_files_say_it_in_short_and_read_back_equal(tmp_path):
    data = {
        "schema_version": 1, "base": [0, 0], "tether_length": 40,
        "obstacles": [{"name": "pile", "center": [10, 0], "radius": 1}],
        "goals": [
            {"inspect": "pile", "viewpoints": 3, "standoff": 1, "after": ["valve"]},
            {"name": "valve", "any_of": [[5, 5], [5, -5, -1]]},
            {"name": "last", "position": [20, 0], "after": ["pile"]},
        ],
    }  # fmt: skip
    file = tmp_path / "p.json"
    file.write_text(json.dumps(data))
    problem = Problem.load(file)
    assert [g.name for g in problem.goals] == [
        "pile/1", "pile/2", "pile/3", "valve/1", "valve/2", "last"
    ]  # fmt: skip
    assert problem.clusters.tolist() == [1, 2, 3, 4, 4, 5]
    assert problem.goals[-1].after == ("pile/1", "pile/2", "pile/3")
    assert problem.precedences[4, 5]  # by way of the pile
    again = Problem.from_json(problem.to_json())
    assert again == problem
    assert again.sha256 == problem.sha256
    assert "5 goals of 6 places" in problem.summary
    out = tmp_path / "s.json"
    assert main(["solve", str(file), "-o", str(out), "--plot", str(tmp_path / "s.png"),
                 "--quiet"]) == 0  # fmt: skip
    names = [problem.goals[v["goal"]].name for v in json.loads(out.read_text())["tour"]]
    assert names[0].startswith("valve/")
    assert names[-1] == "last"
    assert main(["verify", str(file), str(out), "--quiet"]) == 0


def test_the_judge_sees_a_wrong_order_and_a_place_too_many():
    problem = Problem(base=(0, 0), tether_length=9, goals=[
        {"name": "a", "position": (3, 0)}, {"name": "b", "position": (3, 3), "after": ["a"]},
        {"name": "c", "any_of": [(0, 3), (0, 4)]},
    ])  # fmt: skip
    found = solve(problem)
    assert verify(problem, found)
    free = Problem(base=(0, 0), tether_length=9, goals=[g.position for g in problem.goals])
    every = solve(free)
    foreign = every.model_copy(update={"problem": found.problem})
    assert "several of one choice: goal c/1, goal c/2" in str(verify(problem, foreign))
    turned = solve(
        problem.model_copy(
            update={
                "goals": tuple(
                    g.model_copy(update={"after": ("b",) if g.name == "a" else ()})
                    for g in problem.goals
                )
            }
        )
    )
    assert turned.length == pytest.approx(found.length)
    wrong = turned.model_copy(update={"problem": found.problem})
    assert "goal b before goal a" in str(verify(problem, wrong))


@pytest.mark.parametrize(
    ("goals", "said"),
    [
        ([{"name": "a", "position": [1, 0], "after": ["b"]}], "goals[0].after[0]: expected"),
        ([{"name": "a", "position": [1, 0], "after": ["a"]}], "goals[0].after[0]: 'a' is the goal"),
        (
            [{"name": "a", "position": [1, 0], "after": ["b"]},
             {"name": "b", "position": [2, 0], "after": ["a"]}],
            "goals[0].after: a is to come before and after b",
        ),
        ([{"name": "a", "any_of": []}], "goals[0].any_of: expected places"),
        ([{"any_of": [[1, 0]], "z": 1}], "goals[0].z: unknown field"),
        ([{"any_of": [{"position": [1, 0], "depth": 3}]}], "goals[0].any_of[0].depth: unknown"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_said_in_one_line(goals, said):
    with pytest.raises(InputError) as error:
        Problem(base=(0, 0), goals=goals, tether_length=9)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_solvers_that_cannot_keep_an_order_say_so():
    problem = Problem(base=(0, 0), tether_length=9, goals=[
        {"name": "a", "position": (3, 0)}, {"name": "b", "position": (3, 3), "after": ["a"]},
    ])  # fmt: skip
    for solver in ("mip", "greedy-tsp", "anneal-2016"):
        with pytest.raises(InputError, match="expected one of auto, dp, lns"):
            solve(problem, solver)


def test_a_damaged_obstacle_is_blamed_and_not_the_goals_that_inspect_it():
    with pytest.raises(InputError, match=r"obstacles\[0\].center: expected a number, got 'a'"):
        Problem(
            base=(0, 0), goals=[{"inspect": "pile", "standoff": 1}], tether_length=20,
            obstacles=[{"name": "pile", "center": [5, "a"], "radius": 1}],
        )  # fmt: skip
