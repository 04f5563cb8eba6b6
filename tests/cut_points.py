"""Points, cuts and tours of small programs, by enumeration."""

import itertools

import numpy as np

from netsp import travel_graph
from netsp.mip.cover_costs import ClassCovers, PathCovers
from netsp.mip.cuts import Cut
from netsp.mip.parity_cuts import odd_numbers
from netsp.plan.random_worlds import random_world


def all_legs(graph):
    legs = np.argwhere(np.triu(np.isfinite(graph.costs), 1))
    return legs, graph.costs[legs[:, 0], legs[:, 1]]


def some_cut(chance, graph):
    """A handle and an odd number of teeth across it."""
    m = graph.goal_count + 1
    handle = np.zeros(m, dtype=bool)
    handle[chance.sample(range(m), chance.randint(1, m - 1))] = True
    across = [p for p in itertools.combinations(range(m), 2) if handle[p[0]] != handle[p[1]]]
    odd = list(range(3, len(across) + 1, 2))
    teeth = chance.sample(across, chance.choice(odd)) if odd else []
    return Cut(handle[graph.cluster], -1, tuple(sorted(teeth)))


def tours_as_points(chance, graph, legs, count=30):
    """Random tours, and how each uses legs (k, 2)."""
    place = {tuple(e): k for k, e in enumerate(legs.tolist())}
    for _ in range(count):
        order = chance.sample(range(1, graph.goal_count + 1), graph.goal_count)
        tour = [0, *(chance.choice(graph.members(g).tolist()) for g in order)]
        y = np.zeros(len(legs))
        for u, v in zip(tour, [*tour[1:], 0], strict=True):
            y[place[min(u, v), max(u, v)]] = 1.0
        yield tour, y


def small(seed, **more):
    """A world of few goals and obstacles."""
    how = {"goals": 5, "obstacles": 4, "side": 60.0, "radii": (4.0, 8.0), "tether_length": 90.0}
    return random_world(seed, **{**how, **more})


def towers(seed):
    """Covers below the classes of a small world, and below its ways."""
    graph = travel_graph(small(seed, tether_length=150.0))
    odd = odd_numbers(graph.labels)
    classes = ClassCovers(graph.costs, graph.cluster, odd)
    return graph, odd, classes, PathCovers(graph.parity_oracle(lambda: False), np.inf)
