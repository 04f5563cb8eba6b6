"""`mip-2017` is the published program: an optimum where it ends, else a bound alone."""

import itertools

import numpy as np
import pytest

from netsp import InputError, solve_graph
from netsp.mip.cbc_program import CbcInteger
from netsp.model.solution import Status
from netsp.roadmap.travel_graph import TravelGraph
from tests.brute import brute_tour
from tests.travel_graphs import random_graph


def two_groups():
    """Return a graph of two distant groups of three goals with two classes each, in which subtours
    are cheap."""
    rng = np.random.default_rng(1)
    at = np.vstack([[0, 0], *(c + rng.uniform(0, 1, (6, 2)) for c in ((20, 0), (-20, 0)))])
    costs = np.linalg.norm(at[:, None] - at[None, :], axis=2)
    return TravelGraph.from_costs(costs, [0, *np.repeat(np.arange(1, 7), 2).tolist()])


@pytest.mark.parametrize("cuts", ["goals", "vertices"])
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_with_either_cut_it_ends_at_the_optimum(cuts, seed):
    graph = two_groups() if seed is None else random_graph(seed, goals=5, most=3)
    result = solve_graph(graph, "mip-2017", params={"cuts": cuts})
    assert result.status is Status.OPTIMAL
    assert result.length == pytest.approx(brute_tour(graph), rel=1e-6)
    assert result.lower_bound <= brute_tour(graph) * (1 + 1e-9)
    bounds = [row.bound.length for row in result.trace]
    assert bounds == sorted(bounds)


def test_stopped_before_its_first_tour_it_has_a_bound_and_no_tour_not_even_one_it_was_given():
    graph = two_groups()
    best = solve_graph(graph, "mip-2017")
    stopped = solve_graph(graph, "mip-2017", iteration_limit=1, warm_start=best.tour)
    assert best.trace[-1].iteration > 1
    assert stopped.tour is None
    assert stopped.status is Status.NO_SOLUTION_FOUND
    assert 0.0 < stopped.lower_bound < best.length
    assert all(row.tour is None for row in stopped.trace)


def test_it_cuts_at_integer_points_only(monkeypatch):
    """Every program that CBC is given is the integer one, and the first has no cut."""
    from netsp.mip import cbc_program

    programs = []
    run = cbc_program.run_cbc

    def watched(model, *, integer, limit, policy):
        programs.append((integer, [name for name in model.constraints if "subtour" in name]))
        return run(model, integer=integer, limit=limit, policy=policy)

    monkeypatch.setattr(cbc_program, "run_cbc", watched)
    solve_graph(two_groups(), "mip-2017")
    assert all(integer for integer, _ in programs)
    assert programs[0][1] == []
    counts = [len(names) for _, names in programs]
    assert all(a < b for a, b in itertools.pairwise(counts))


def test_a_program_of_too_many_legs_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"72 legs; expected at most 71 \(option max_legs\)"):
        solve_graph(two_groups(), "mip-2017", params={"max_legs": 71})
    assert solve_graph(two_groups(), "mip-2017", params={"max_legs": 72}).tour is not None


def test_a_set_of_goals_keeps_one_leg_fewer_than_goals():
    """Within the six classes of one group a subtour of three legs is cheapest until it is cut."""
    graph = two_groups()
    legs = np.argwhere(np.triu(np.isfinite(graph.costs), 1))
    model = CbcInteger(
        graph.cluster, np.arange(len(graph)), legs, graph.costs[legs[:, 0], legs[:, 1]], []
    )
    group = np.arange(1, 7)
    for cut, most in ((False, 3.0), (True, 2.0)):
        if cut:
            model.forbid_subtour(group, 3)
        y = model.solve(None).point.y
        assert y[np.isin(legs, group).all(axis=1)].sum() == pytest.approx(most)
