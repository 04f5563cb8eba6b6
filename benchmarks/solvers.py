"""The papers' solvers on the papers' worlds: Table I of 2017, and how far the heuristics are off.

    python benchmarks/solvers.py              Table I by both backends, heuristics, anneal's speed
    python benchmarks/solvers.py --no-cbc     without the slow backend

Worlds: 500 x 500, 20 circles of radius 10 to 30, seeds 0 to 9 (`netsp.plan.random_worlds`), exact
roadmap. Every tour is verified.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import statistics
import time
from collections.abc import Iterable

import numpy as np
from table import head, heading, row

from netsp import Problem, Status, TravelGraph, solve_graph, travel_graph, verify
from netsp.gtsp.travel.result import Result
from netsp.plan.answer import to_solution
from netsp.plan.random_worlds import random_world
from netsp.plan.solver_table import SOLVERS

GOALS = (5, 10, 15, 20)
TETHERS = (200.0, 250.0, 300.0, 350.0)
WORLDS = range(10)
LIMIT = 300.0


@functools.cache
def world(seed: int, goals: int, tether: float) -> tuple[Problem, TravelGraph, float]:
    """A problem, its travel graph with all legs, and the seconds both took."""
    problem = random_world(seed, goals=goals, tether_length=tether)
    begin = time.perf_counter()
    graph = travel_graph(problem)
    graph.costs  # noqa: B018
    return problem, graph, time.perf_counter() - begin


def run(
    problem: Problem, graph: TravelGraph, solver: str, **kwargs: object
) -> tuple[Result, float, bool]:
    """Result, seconds, and whether the tour is verified."""
    begin = time.perf_counter()
    result = solve_graph(graph, solver, **kwargs)  # type: ignore[arg-type]
    seconds = time.perf_counter() - begin
    if result.length is None:
        return result, seconds, False
    return result, seconds, bool(verify(problem, to_solution(problem, graph, result, solver, 0)))


def table_one(backends: Iterable[str]) -> None:
    """Seconds and proofs by cell: roadmap and matrix included."""
    print("\n### Table I by `mip`\n")
    columns = [c for b in backends for c in (f"{b}: proven", "median s", "worst s")]
    head("goals", "tether", "vertices", *columns, "verified", "paper: proven", name="table-one")
    paper = iter((10, 10, 10, 10, 10, 10, 7, 8, 8, 2, 3, 3, 9, 2, 1, 1))
    """Proven within 300 s of 10 by the paper's commercial solver."""
    every: dict[str, list[float]] = {b: [] for b in backends}
    proofs = dict.fromkeys(backends, 0)
    for goals, tether in itertools.product(GOALS, TETHERS):
        cells: list[str] = []
        sizes, verified = [], 0
        for backend in backends:
            times, proven = [], 0
            for seed in WORLDS:
                problem, graph, built = world(seed, goals, tether)
                result, seconds, good = run(
                    problem, graph, "mip", time_limit=LIMIT, params={"backend": backend}
                )
                times.append(built + seconds)
                proven += result.status is Status.OPTIMAL
                verified += good
                sizes.append(len(graph))
            every[backend] += times
            proofs[backend] += proven
            cells += [f"{proven}/10", *spread(times)]
        row(
            goals, f"{tether:g}", f"{min(sizes)} to {max(sizes)}", *cells,
            f"{verified}/{len(sizes)}", f"{next(paper)}/10",
        )  # fmt: skip
    whole = [c for b in backends for c in (f"{proofs[b]}/160", *spread(every[b]))]
    row("all", "", "", *whole, "", "104/160")


def spread(times: list[float]) -> tuple[str, str]:
    """Median and worst."""
    return f"{statistics.median(times):.3f}", f"{max(times):.3f}"


def over_optimum(solver: str, worlds: Iterable[int], **kwargs: object) -> list[float]:
    """Per cent above the proven optimum at the paper's largest cell, of every world."""
    out = []
    for seed in worlds:
        problem, graph, _ = world(seed, 20, 350.0)
        best = run(problem, graph, "mip")[0].length
        result, _, good = run(problem, graph, solver, **kwargs)
        out.append(100.0 * (result.length / best - 1.0) if good else np.inf)
    return out


def heuristics(goals: int = 20, tether: float = 350.0) -> None:
    """Per cent above the proven optimum at the paper's largest cell."""
    print(f"\n### Heuristics, {goals} goals, tether {tether:g}, per cent above the optimum\n")
    head("solver", "limit", "mean %", "median %", "worst %", "optimal", "median s", "worst s",
         "verified", name="heuristics")  # fmt: skip
    ten = {"time_limit": 10.0}
    cases = [
        ("reduced-mip", "none", {}),
        (
            "reduced-mip, classes=1 polish=0 (the paper's)",
            "none",
            {"params": {"classes": 1, "polish": 0}},
        ),
        ("anneal", "20 M proposals", {}),
        ("anneal", "10 s", ten),
        ("anneal-2016", "10 s", ten),
        ("greedy", "none", {}),
        ("greedy, retrace=tether", "none", {"params": {"retrace": "tether"}}),
        ("greedy-2016", "none", {}),
        ("greedy-tsp", "none", {}),
    ]
    run(*world(0, 5, 200.0)[:2], "anneal-2016", iteration_limit=10)  # compiled before it counts
    for name, limit, kwargs in cases:
        solver = name.split(",")[0]
        over, times, verified, none, held = [], [], 0, 0, []
        for seed in WORLDS:
            problem, graph, _ = world(seed, goals, tether)
            best = run(problem, graph, "mip")[0].length
            result, seconds, good = run(problem, graph, solver, **kwargs)
            times.append(seconds)
            verified += good
            if result.length is None:
                none += 1
                continue
            over.append(100.0 * (result.length / best - 1.0))
            if result.trajectory is not None:
                held.append(len(to_solution(problem, graph, result, solver, 0).entangled))
        note = f" ({none} without a tour)" if none else ""
        if SOLVERS[solver].blind:
            note = f" (entangles {np.mean(held):.1f} obstacles on average)"
        row(
            name, limit, f"{np.mean(over):.2f}", f"{np.median(over):.2f}", f"{max(over):.2f}",
            f"{sum(abs(x) < 1e-4 for x in over)}/10", f"{statistics.median(times):.3f}",
            f"{max(times):.3f}", f"{verified}/10{note}",
        )  # fmt: skip


def anneal_speed() -> None:
    """Measure proposals per second of CPU at 20 goals."""
    print("\n### Proposals per second of CPU, 20 goals, tether 350\n")
    head("solver", "median", "min", "max", "worlds", name="proposals")
    for solver, count in (("anneal", 5_000_000), ("anneal-2016", 100_000)):
        rates = []
        for seed in WORLDS:
            _, graph, _ = world(seed, 20, 350.0)
            solve_graph(graph, solver, iteration_limit=100)  # tables made before it counts
            begin = time.process_time()
            solve_graph(graph, solver, iteration_limit=count)
            rates.append(count / (time.process_time() - begin))
        low, high = min(rates), max(rates)
        row(solver, f"{statistics.median(rates):,.0f}", f"{low:,.0f}", f"{high:,.0f}", len(rates))


def main() -> None:
    """Run everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--no-cbc", action="store_true", help="leave out the slow backend")
    args = parser.parse_args()
    heading("Solvers")
    run(*world(0, 5, 200.0)[:2], "mip")  # compiled before it counts
    table_one(["highs"] if args.no_cbc else ["highs", "cbc"])
    heuristics()
    anneal_speed()


if __name__ == "__main__":
    main()
