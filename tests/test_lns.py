"""`lns`: searches that share what time or rounds there are."""

import numpy as np
import pytest

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
