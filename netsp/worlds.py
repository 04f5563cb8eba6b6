"""Random worlds by the papers' recipes, the same on every machine.

All draws come from `random.Random`, whose `random()` is guaranteed to give the same sequence for
the same seed in every version of Python, and nothing else is drawn from numpy; the only arithmetic
on them is scaling and comparing.
"""

from __future__ import annotations

import math
import random

import numpy as np

from netsp.errors import InputError
from netsp.problem import Circle, Goal, Problem

GIVE_UP = 20_000
"""Draws after which a world is called too full."""


def random_world(
    seed: int,
    *,
    goals: int = 20,
    obstacles: int = 20,
    tether_length: float = 300.0,
    side: float = 500.0,
    radii: tuple[float, float] = (10.0, 30.0),
) -> Problem:
    """A world as in McCammon & Hollinger 2017, section V-A: circles in a square, the base random,
    goals drawn among the places that the tether reaches.

    Circles are disjoint, with radii uniform between two limits (the paper gives none).

    Raises InputError if the circles, the base or the goals do not fit.
    """
    draw = random.Random(seed)

    def place() -> tuple[float, float]:
        x = draw.random() * side
        return x, draw.random() * side

    circles: list[tuple[float, float, float]] = []

    def free(x: float, y: float, radius: float = 0.0) -> bool:
        return all(math.hypot(x - a, y - b) > r + radius for a, b, r in circles)

    for _ in range(GIVE_UP):
        if len(circles) == obstacles:
            break
        (x, y), r = place(), radii[0] + draw.random() * (radii[1] - radii[0])
        if free(x, y, r + 1e-3 * side):
            circles.append((x, y, r))
    else:
        raise InputError(
            f"obstacles: {obstacles} circles do not fit into a square of side {side:g}"
        )
    base = next((p for _ in range(GIVE_UP) if free(*(p := place()))), None)
    if base is None:
        raise InputError("obstacles: no room for the base")

    def world(places: list[tuple[float, float]]) -> Problem:
        return Problem(
            name=f"random-{seed}",
            base=(*base, 0.0),
            goals=tuple(Goal(position=(x, y, 0.0)) for x, y in places),
            obstacles=tuple(Circle(center=(x, y), radius=r) for x, y, r in circles),
            tether_length=tether_length,
        )

    found: list[tuple[float, float]] = []
    for _ in range(GIVE_UP // 100):
        drawn = [place() for _ in range(4 * goals)]
        drawn = [p for p in drawn if free(*p) and math.dist(p, base) <= tether_length]
        if drawn:
            reach = _reach(world(drawn))
            found += [p for p, d in zip(drawn, reach, strict=True) if d <= tether_length]
        if len(found) >= goals:
            return world(found[:goals])
    raise InputError(f"goals: only {len(found)} of {goals} places in reach of the tether found")


def _reach(problem: Problem) -> list[float]:
    """Shortest tether that reaches each goal."""
    from netsp.roadmap.outline import build_outline
    from netsp.roadmap.shortest import ContactGraph

    planar = ContactGraph(build_outline(problem)).lengths([0])[0]
    dz = problem.points[:, 2] - problem.points[0, 2]
    return [float(d) for d in np.hypot(planar, dz)[1:]]
