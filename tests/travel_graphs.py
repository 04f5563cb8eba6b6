"""Small travel graphs for tests of solvers."""

import numpy as np

from netsp import TravelGraph
from netsp.gtsp.cost_oracle import CostOracle
from netsp.roadmap.taut_legs import TautLegs


def random_graph(seed, goals, most=4):
    """A generalised TSP of random points; costs inf nowhere but within clusters."""
    rng = np.random.default_rng(seed)
    sizes = [1, *rng.integers(1, most + 1, goals)]
    cluster = np.repeat(np.arange(goals + 1), sizes)
    at = rng.uniform(0, 1, (len(cluster), 3))
    return TravelGraph.from_costs(np.linalg.norm(at[:, None] - at[None, :], axis=2), cluster)


def bound_legs_first(monkeypatch):
    """Make all legs of a taut roadmap seem slow to measure, so that solvers bound them first."""
    monkeypatch.setattr(TautLegs, "estimate", CostOracle.estimate)
