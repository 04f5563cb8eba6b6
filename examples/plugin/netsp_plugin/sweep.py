"""`sweep`: goals in the order of their tethers, each in its class of least tether.

A poor tour and a good example: a solver sees a travel graph, whose vertex 0 is the base and whose
other vertices are (goal, homotopy class); a tour takes one vertex of every cluster.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Options:
    """netsp reads and checks these as it does those of its own solvers."""

    shuffle: int = 0
    """1 for a random order."""


def solve(graph, params: Options, rng):
    """A tour as vertices from 0 on."""
    nearest = [
        min(graph.members(goal), key=lambda v: graph.tethers[v])
        for goal in range(1, graph.goal_count + 1)
    ]
    order = sorted(nearest, key=lambda v: graph.tethers[v])
    if params.shuffle:
        order = list(np.array(order)[rng.permutation(len(order))])
    return [0, *order]
