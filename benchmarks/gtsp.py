"""Generalised TSPs without a base: how far proofs reach.

    python benchmarks/gtsp.py [--worlds 5] [--limit 120] [--keep]
    python benchmarks/gtsp.py --files *.gtsp [--limit 600]
    python benchmarks/gtsp.py --tsplib FOLDER/*.tsp [--limit 600] [--keep]

Vertices lie on a square of 1000 x 1000, distances are rounded, five vertices to a cluster on
average. Clusters are made as those of GTSPLIB: the first centre is the vertex farthest from the
first vertex, the others are each farthest from those before, and every vertex goes to the nearest
centre. GTSPLIB's own files are not here; `--files` takes them, and `--tsplib` makes them from
TSPLIB's: 89pcb442 from pcb442.tsp. That these are they is seen from the optima, which Fischetti,
Salazar & Toth (1997) proved.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from table import head, heading, row

from netsp import Status, TravelGraph, solve_graph
from netsp.gtsp.gtsplib import load

SIZES = (10, 20, 30, 40, 60)

OPTIMA = {
    "eil51": 174, "st70": 316, "eil76": 209, "pr76": 64925, "rat99": 497, "kroA100": 9711,
    "kroB100": 10328, "kroC100": 9554, "kroD100": 9450, "kroE100": 9523, "rd100": 3650,
    "eil101": 249, "lin105": 8213, "pr107": 27898, "pr124": 36605, "bier127": 72418, "ch130": 2828,
    "pr136": 42570, "pr144": 45886, "ch150": 2750, "kroA150": 11018, "kroB150": 12196,
    "pr152": 51576, "u159": 22664, "rat195": 854, "d198": 10557, "kroA200": 13406,
    "kroB200": 13111, "ts225": 68340, "pr226": 64007, "gil262": 1013, "pr264": 29549, "a280": 1079,
    "pr299": 22615, "lin318": 20765, "rd400": 6361, "fl417": 9651, "pr439": 60099, "pcb442": 21657,
}  # fmt: skip
"""Of GTSPLIB's instances with Euclidean distances, by the name of TSPLIB's."""


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


def file(job: tuple[str, float, bool]) -> tuple[str, ...]:
    """A row for somebody's file, as it is or with clusters of five vertices on average."""
    path, limit, cluster = job
    given = load(path)
    of = clustered(given.costs, -(-len(given.costs) // 5)) if cluster else given.clusters
    graph = TravelGraph.from_costs(given.costs, of, base=None)
    quick = solve_graph(graph, "lns", time_limit=10.0)
    begin = time.perf_counter()
    found = solve_graph(graph, time_limit=limit)
    seconds = time.perf_counter() - begin
    known = str(OPTIMA.get(given.name, "")) if cluster else ""
    return (f"{int(of.max()) + 1}{given.name}" if cluster else given.name, str(len(of)), known,
            f"{quick.length:g}", f"{found.length:g}", f"{found.lower_bound:g}", found.status.value,
            f"{seconds:.1f}")  # fmt: skip


def files(paths: list[str], limit: float, jobs: int, *, cluster: bool) -> None:
    """Somebody's files, smallest first."""
    paths = sorted(paths, key=lambda path: (len(load(path).costs), path))
    head("instance", "vertices", "known", "lns, 10 s", "length", "bound", "status", "s",
         name="gtsplib" if cluster else None)  # fmt: skip
    with ProcessPoolExecutor(jobs) as pool:
        for cells in pool.map(file, [(path, limit, cluster) for path in paths]):
            row(*cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=5)
    parser.add_argument("--limit", type=float, default=120.0)
    parser.add_argument("--jobs", type=int, default=2, help="files at a time")
    parser.add_argument("--files", nargs="*")
    parser.add_argument("--tsplib", nargs="*")
    args = parser.parse_args()
    heading("Generalised TSPs without a base")
    if args.files or args.tsplib:
        files(args.files or args.tsplib, args.limit, args.jobs, cluster=not args.files)
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
