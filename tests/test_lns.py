"""`lns`: searches that share what time or rounds there are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.compiled.chance import seeded
from netsp.lns.layers import Instance, best_classes
from netsp.lns.ruin import backward, forward, insert_best
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
    cluster = np.concatenate([[0], np.repeat(np.arange(1, goals + 1), rng.integers(1, 5, goals))])
    # few places for many vertices: ties
    where = rng.integers(0, places + 1, (len(cluster), 2)).astype(float)
    i = Instance(cluster, np.hypot(*(where[:, None] - where[None]).T))
    order, n = np.concatenate([[0], 1 + rng.permutation(goals)]), goals
    out = int(order[n])
    order[n] = -1
    width = int(np.diff(i.start).max())
    ahead, behind = np.zeros((goals + 3, width)), np.zeros((goals + 4, width))
    forward(order, n, 1, i.start, i.costs, ahead)
    backward(order, n, n - 1, 1, i.start, i.costs, behind)
    n, length = insert_best(
        out, order, n, i.start, i.costs, i.near, i.before, ahead, behind, 0.0, seeded(rng)
    )
    assert sorted(order.tolist()) == list(range(goals + 1))
    fresh, back = np.zeros_like(ahead), np.zeros_like(behind)
    forward(order, n, 1, i.start, i.costs, fresh)
    backward(order, n, n - 1, 1, i.start, i.costs, back)
    for k in range(1, n):
        own = int(np.diff(i.start)[order[k]])
        np.testing.assert_allclose(ahead[k, :own], fresh[k, :own], rtol=1e-10, atol=1e-9)
        np.testing.assert_allclose(behind[k, :own], back[k, :own], rtol=1e-10, atol=1e-9)
    assert length == pytest.approx(best_classes(order[1:], i.start, i.costs)[0], abs=1e-9)
