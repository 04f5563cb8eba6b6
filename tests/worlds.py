"""Worlds for tests: random ones, and Hypothesis strategies for hostile ones."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from netsp import Circle, Problem
from netsp.plan.space.mission_policy import MissionPolicy, PotentialPolicy

FEW_CELLS = MissionPolicy(potential=PotentialPolicy(max_cells=120_000))
"""Policy for missions: bounds with fewer cells than by default take a tenth of the time."""


def random_world(
    seed: int, *, circles: int = 20, goals: int = 20, tether: float = 300.0, side: float = 500.0,
    radii: tuple[float, float] = (10.0, 30.0),
) -> Problem:  # fmt: skip
    """The paper's world: disjoint circles, base and goals uniform, goals within easy reach."""
    rng = np.random.default_rng(seed)
    obstacles: list[tuple[np.ndarray, float]] = []
    while len(obstacles) < circles:
        c, r = rng.uniform(0, side, 2), rng.uniform(*radii)
        if all(np.hypot(*(c - o)) > r + q + 1.0 for o, q in obstacles):
            obstacles.append((c, r))

    def free() -> np.ndarray:
        while True:
            p = rng.uniform(0, side, 2)
            if all(np.hypot(*(p - c)) > r for c, r in obstacles):
                return p

    base = free()
    places: list[np.ndarray] = []
    while len(places) < goals:
        p = free()
        if np.hypot(*(p - base)) < 0.85 * tether:
            places.append(p)
    return Problem(
        base=base,
        goals=places,
        obstacles=[Circle(center=c, radius=r) for c, r in obstacles],
        tether_length=tether,
    )


@st.composite
def small_worlds(draw, max_circles: int = 4, goals: int = 3, grid: bool = False) -> Problem:
    """Up to four circles, apart, touching or overlapping, on a grid or anywhere."""
    if grid:
        coordinate = st.integers(-6, 6).map(float)
        radius = st.sampled_from([0.5, 1.0, 1.5])
    else:
        coordinate = st.floats(-6, 6, allow_nan=False).map(lambda v: round(v, 3))
        radius = st.floats(0.3, 2.0).map(lambda v: round(v, 3))
    obstacles = draw(
        st.lists(st.tuples(coordinate, coordinate, radius), min_size=1, max_size=max_circles)
    )

    def clear(p: tuple[float, float]) -> bool:
        return all(np.hypot(p[0] - x, p[1] - y) >= r + 1e-3 for x, y, r in obstacles)

    point = st.tuples(coordinate, coordinate).filter(clear)
    places = draw(st.lists(point, min_size=goals + 1, max_size=goals + 1, unique=True))
    return Problem(
        base=places[0],
        goals=places[1:],
        obstacles=[Circle(center=(x, y), radius=r) for x, y, r in obstacles],
        tether_length=draw(st.sampled_from([6.0, 9.0, 12.0])),
    )


def costs_of(graph):
    """Costs of legs, writable as solvers have them: read-only ones are of another type, for which
    kernels would be compiled anew."""
    return graph.costs.copy()
