"""`sweep`: goals in the order of their tethers, each in its class of least tether.

A poor tour and a good example: a solver sees a travel graph, whose vertex 0 is the base and whose
other vertices are (goal, homotopy class); a tour takes one vertex of every cluster.
"""

from __future__ import annotations

import numpy as np


def solve(graph, params, rng):
    """A tour as vertices from 0 on. params : `shuffle`, a whole number: 1 for a random order."""
    nearest = [
        min(graph.members(goal), key=lambda v: graph.tethers[v])
        for goal in range(1, graph.goal_count + 1)
    ]
    order = sorted(nearest, key=lambda v: graph.tethers[v])
    if int(params.get("shuffle", 0)):
        order = list(np.array(order)[rng.permutation(len(order))])
    return [0, *order]
