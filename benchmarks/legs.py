"""How long the length of a leg takes, pulled along its word and searched for.

    python benchmarks/legs.py [--keep]

Legs between classes of different goals at random, 2000 of each problem; and all legs of random
worlds with 20 goals.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator

import numpy as np
from table import ROOT, head, heading, row

from netsp import Problem
from netsp.hsignature import Word
from netsp.plan.random_worlds import random_world
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.taut import TautRoadmap
from netsp.roadmap.taut_by_word import NOT_PULLED

SHIPPED = ("wharf", "pool", "oc4-jacket", "wec-array", "lillgrund-part")
FAMILIES = ("icra2017", "clustered", "array", "harbour")

Leg = tuple[int, int, Word]


def problems() -> Iterator[tuple[str, Problem]]:
    """Shipped ones and random ones, by name."""
    for name in SHIPPED:
        yield name, Problem.load(ROOT / "problems" / f"{name}.json")
    for family in FAMILIES:
        yield family, random_world(5, family=family, goals=15, obstacles=20, tether_length=350.0)
    yield "icra2017, tether 500", random_world(0, goals=20, tether_length=500.0)


def some_legs(roadmap: TautRoadmap, most: int, seed: int = 0) -> tuple[np.ndarray, list[Leg]]:
    """(k, 2) vertices at different goals, and the legs between them as goals and words."""
    u, v = np.nonzero(roadmap.cluster[:, None] < roadmap.cluster[None])
    chosen = np.random.default_rng(seed).permutation(len(u))[:most]
    pairs = np.column_stack([u[chosen], v[chosen]])
    cluster, legs = roadmap.cluster, roadmap.legs
    return pairs, [
        (int(cluster[a]), int(cluster[b]), legs.relative_word(int(a), int(b))) for a, b in pairs
    ]


def off(paths: TautPaths, legs: list[Leg]) -> tuple[float, float]:
    """Share that could not be pulled, and the largest relative difference of the others to what a
    search finds."""
    failed, worst = 0, 0.0
    for a, b, word in legs:
        length, _, _ = paths._pull(a, b, word)
        if length == NOT_PULLED:
            failed += 1
            continue
        found = paths._search_word(a, b, word)
        worst = max(worst, np.inf if found is None else abs(length - found[0]) / max(length, 1.0))
    return failed / len(legs), worst


def microseconds(run: Callable[[], object], count: int, repeats: int = 5) -> float:
    """Of each of so many, the median of some runs."""
    run()
    spent = []
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        spent.append(1e6 * (time.perf_counter() - begin) / count)
    return statistics.median(spent)


def one_by_one(run: Callable[..., object], legs: list[Leg]) -> float:
    """Median microseconds of single calls."""
    run(*legs[0])
    spent = []
    for leg in legs:
        begin = time.perf_counter()
        run(*leg)
        spent.append(1e6 * (time.perf_counter() - begin))
    return statistics.median(spent)


def all_legs(seed: int, goals: int, tether: float) -> tuple[int, float]:
    """Vertices of a random world, and seconds for the matrix of its legs."""
    roadmap = TautRoadmap(random_world(seed, goals=goals, tether_length=tether))
    roadmap.legs.lengths(np.arange(min(3, len(roadmap.cluster))))
    begin = time.perf_counter()
    roadmap.legs.lengths(np.arange(len(roadmap.cluster)))
    return len(roadmap.cluster), time.perf_counter() - begin


def measured(roadmap: TautRoadmap) -> list[str]:
    """A row of the table but for its name."""
    paths = roadmap.paths
    pairs, legs = some_legs(roadmap, 2000)
    failed, worst = off(paths, legs[:500])
    a, b, words = zip(*legs, strict=True)
    compiled = microseconds(lambda: roadmap.legs._pull_pairs(pairs[:, 0], pairs[:, 1]), len(legs))
    bulk = microseconds(lambda: paths.lengths(a, b, words), len(legs))
    single, search = one_by_one(paths._pull, legs), one_by_one(paths._search_word, legs[:300])
    return [
        str(len(roadmap.cluster)), f"{100.0 * failed:.1f}", f"{worst:.0e}", f"{compiled:.1f}",
        f"{bulk:.1f}", f"{single:.0f}", f"{search:.0f}",
    ]  # fmt: skip


def main() -> None:
    heading("The length of a leg")
    head("problem", "classes", "not pulled %", "worst off the search, relative", "µs, compiled",
         "µs, from Python in bulk", "µs, a single query", "µs, a search", name="legs")  # fmt: skip
    for name, problem in problems():
        roadmap = TautRoadmap(problem)
        row(name, *measured(roadmap))
    print()
    head("all legs of 20 goals", "seed", "classes", "pairs at different goals", "s",
         name="legs-all")  # fmt: skip
    for tether, seeds in ((350.0, range(3)), (500.0, range(5))):
        for seed in seeds:
            count, seconds = all_legs(seed, 20, tether)
            row(f"tether {tether:g}", seed, count, f"{count**2 // 2:,}", f"{seconds:.2f}")
    print()


if __name__ == "__main__":
    main()
