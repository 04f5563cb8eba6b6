"""`lns`: searches that share what time or rounds there are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.compiled.chance import seeded
from netsp.lns.layers import Instance, best_classes
from netsp.lns.ruin import Tables, fill, insert_best, ruin_and_recreate
from netsp.lns.solve import Params, solve
from netsp.solving.limits import Limits
from tests.test_contract import random_graph


@pytest.mark.parametrize("how", [{"time": 0.5}, {"iterations": 400}])
def test_every_restart_has_its_share_of_time_or_rounds(how):
    graph, rows = random_graph(0, 12), []
    solve(graph, limits=Limits(iterations=10))  # compiled code is read before time counts
    solve(
        graph,
        Params(restarts=4),
        Limits(**how, rng=np.random.default_rng(0), on_progress=rows.append),
    )
    stages = [r.stage for r in rows]
    began = [k for k, stage in enumerate(stages) if stage == "settled"]
    assert len(began) == 4
    # and each went on to search
    assert all(stages[k + 1] == "search" for k in began)


@given(st.integers(0, 10_000), st.integers(3, 14), st.sampled_from([1, 5, 1000]))
@settings(max_examples=60, deadline=None)
def test_after_an_insertion_the_tables_are_those_of_the_new_order(seed, goals, places):
    rng = np.random.default_rng(seed)
    i = _random_instance(rng, goals, places)
    order, n = np.concatenate([[0], 1 + rng.permutation(goals)]), goals
    out = int(order[n])
    order[n] = -1
    width = int(np.diff(i.start).max())
    ahead, behind = np.zeros((2, goals + 1, width))
    fill(order[:n], i.start, i.costs, ahead, behind)
    n, length = insert_best(
        out, order, n, i.start, i.costs, i.near, i.before, ahead, behind, 0.0, seeded(rng)
    )
    assert sorted(order.tolist()) == list(range(goals + 1))
    _same_tables(i, order, ahead, behind)
    assert length == pytest.approx(best_classes(order[1:], i.start, i.costs)[0], abs=1e-9)


@given(st.integers(0, 10_000), st.integers(3, 14), st.sampled_from([1, 5, 1000]))
@settings(max_examples=60, deadline=None)
def test_after_rounds_the_tables_are_those_of_the_order_however_they_were_counted_out(
    seed, goals, places
):
    rng = np.random.default_rng(seed)
    i = _random_instance(rng, goals, places)
    found = []
    for counts in ([200], [1, 1, 48, 150]):
        order, chance = np.arange(goals + 1), seeded(np.random.default_rng(seed))
        best, age = order.copy(), np.zeros(1, dtype=np.int64)
        ahead, behind = np.zeros((2, goals + 1, int(np.diff(i.start).max())))
        fill(order, i.start, i.costs, ahead, behind)
        tables = Tables(i.start, i.costs, i.cluster_costs, i.near, i.rank, i.before)
        length = shortest = best_classes(order[1:], i.start, i.costs)[0]
        for count in counts:
            length, shortest = ruin_and_recreate(
                order, best, length, shortest, count, 100.0, tables, ahead, behind, age, chance
            )
        _same_tables(i, order, ahead, behind)
        assert length == pytest.approx(best_classes(order[1:], i.start, i.costs)[0], abs=1e-9)
        assert shortest == pytest.approx(best_classes(best[1:], i.start, i.costs)[0], abs=1e-9)
        found.append((order.tolist(), length, shortest))
    assert found[0] == found[1]


def _random_instance(rng, goals, places):
    """Few places for many vertices: ties."""
    cluster = np.concatenate([[0], np.repeat(np.arange(1, goals + 1), rng.integers(1, 5, goals))])
    where = rng.integers(0, places + 1, (len(cluster), 2)).astype(float)
    return Instance(cluster, np.hypot(*(where[:, None] - where[None]).T))


def _same_tables(i, order, ahead, behind):
    fresh, back = np.zeros((2, *ahead.shape))
    fill(order, i.start, i.costs, fresh, back)
    for c in order:
        own = int(np.diff(i.start)[c])
        np.testing.assert_allclose(ahead[c, :own], fresh[c, :own], rtol=1e-10, atol=1e-9)
        np.testing.assert_allclose(behind[c, :own], back[c, :own], rtol=1e-10, atol=1e-9)
