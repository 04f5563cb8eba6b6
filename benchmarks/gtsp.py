"""Generalised TSPs without a base: how far proofs reach.

    python benchmarks/gtsp.py [--worlds 5] [--limit 120] [--keep]
    python benchmarks/gtsp.py --files *.gtsp [--limit 600]
    python benchmarks/gtsp.py --tsplib pcb442.tsp     TSPLIB's, with the clusters of GTSPLIB

Vertices lie on a square of 1000 x 1000, distances are rounded, five vertices to a cluster on
average. Clusters are made as those of GTSPLIB: of the two vertices farthest apart the earlier one
is the first centre, the others are each farthest from those before, and every vertex goes to the
nearest (Fischetti, Salazar & Toth 1997). Its own files are not here; `--files` takes them, and
`--tsplib` makes them from TSPLIB's: for pcb442 the sets are those of 89pcb442, in the same order.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import time

import numpy as np
from table import head, heading, row

from netsp import Status, TravelGraph, solve_graph
from netsp.gtsplib import load

SIZES = (10, 20, 30, 40, 60)


def instance(clusters: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Costs, and cluster of each vertex."""
    rng = np.random.default_rng([clusters, seed])
    places = rng.integers(0, 1000, (5 * clusters, 2))
    costs = np.floor(np.hypot(*(places[:, None] - places[None]).T) + 0.5)
    return costs, clustered(costs, clusters)


def clustered(costs: np.ndarray, clusters: int) -> np.ndarray:
    """Cluster of each vertex, by GTSPLIB's rule."""
    centres = [int(np.argmax(costs[0]))]
    while len(centres) < clusters:
        centres.append(int(np.argmax(costs[centres].min(axis=0))))
    of = np.argmin(costs[centres], axis=0)
    of[centres] = np.arange(clusters)
    return of


def against_brute_force(count: int) -> tuple[int, int]:
    """Small instances whose proven optimum is the shortest of all tours; of how many."""
    same = 0
    for seed in range(count):
        rng = np.random.default_rng(seed)
        m = int(rng.integers(3, 6))
        of = rng.permutation(np.r_[np.arange(m), np.arange(m), rng.integers(0, m, 2)])
        places = rng.random((len(of), 2))
        costs = np.hypot(*(places[:, None] - places[None]).T)
        groups = [np.flatnonzero(of == c) for c in range(m)]
        best = min(
            sum(costs[a, b] for a, b in zip(tour, (*tour[1:], tour[0]), strict=True))
            for order in itertools.permutations(range(1, m))
            for tour in itertools.product(*(groups[c] for c in (0, *order)))
        )
        found = solve_graph(TravelGraph.from_costs(costs, of, base=None))
        same += found.status is Status.OPTIMAL and abs((found.length or 0.0) - best) < 1e-9
    return same, count


def files(paths: list[str], limit: float, *, cluster: bool) -> None:
    """Somebody's files, as they are or with clusters of five vertices on average."""
    head("instance", "clusters", "vertices", "lns, 10 s", "length", "bound", "status", "s")
    for path in paths:
        given = load(path)
        of = clustered(given.costs, -(-len(given.costs) // 5)) if cluster else given.clusters
        graph = TravelGraph.from_costs(given.costs, of, base=None)
        quick = solve_graph(graph, "lns", time_limit=10.0)
        begin = time.perf_counter()
        found = solve_graph(graph, time_limit=limit)
        row(given.name, int(of.max()) + 1, len(of), f"{quick.length:g}", f"{found.length:g}",
            f"{found.lower_bound:g}", found.status.value,
            f"{time.perf_counter() - begin:.1f}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=5)
    parser.add_argument("--limit", type=float, default=120.0)
    parser.add_argument("--files", nargs="*")
    parser.add_argument("--tsplib", nargs="*")
    args = parser.parse_args()
    heading("Generalised TSPs without a base")
    if args.files or args.tsplib:
        files(args.files or args.tsplib, args.limit, cluster=not args.files)
        return
    head("clusters", "vertices", "proven", "s, median", "worst", "gap %, mean", "worst ",
         "lns over it %, 5 s", name="gtsp")  # fmt: skip
    for clusters in SIZES:
        times, gaps, over, proven = [], [], [], 0
        for seed in range(args.worlds):
            graph = TravelGraph.from_costs(*instance(clusters, seed), base=None)
            begin = time.perf_counter()
            found = solve_graph(graph, time_limit=args.limit)
            times.append(time.perf_counter() - begin)
            gaps.append(100.0 * (found.gap if found.gap is not None else 1.0))
            proven += found.status is Status.OPTIMAL
            quick = solve_graph(graph, "lns", time_limit=5.0)
            assert found.length is not None
            assert quick.length is not None
            over.append(100.0 * (quick.length / found.length - 1.0))
        row(clusters, 5 * clusters, f"{proven} of {args.worlds}", f"{statistics.median(times):.2f}",
            f"{max(times):.2f}", f"{statistics.fmean(gaps):.2f}", f"{max(gaps):.2f}",
            f"{statistics.fmean(over):.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
