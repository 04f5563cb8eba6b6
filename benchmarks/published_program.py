"""Compare `mip-2017`, the program as published in 2017, with `mip` on the same travel graphs.

    python benchmarks/published_program.py [--worlds 2] [--limit 60] [--keep]

Worlds of the paper's recipe (1 to 20 obstacles), the exact roadmap with the paper's classes.
Seconds are of CPU, of this process and of CBC's; the limit is of wall-clock seconds.
"""

from __future__ import annotations

import argparse
import os

from table import head, heading, row

from netsp import TravelGraph, solve_graph
from netsp.plan.random_worlds import reachable_world
from netsp.plan.solve_problem import travel_graph

CELLS = ((5, 200.0), (5, 300.0), (10, 200.0), (10, 250.0), (10, 300.0), (20, 200.0), (20, 300.0))
"""Goals and tether."""


def cpu_s() -> float:
    """Return CPU seconds of this process and of the programs that it has run."""
    t = os.times()
    return t.user + t.system + t.children_user + t.children_system


def outcome(graph: TravelGraph, solver: str, limit: float):
    """Return a solver's result, and its CPU seconds."""
    begin = cpu_s()
    result = solve_graph(graph, solver, time_limit=limit)
    return result, cpu_s() - begin


def main() -> None:
    """Print one row a world."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=2)
    parser.add_argument("--limit", type=float, default=60.0, help="wall-clock seconds")
    args = parser.parse_args()
    heading("The published program")
    warm = travel_graph(reachable_world(0, goals=4, tether_length=200.0)[0])
    solve_graph(warm, "mip")  # compiled before it counts
    head(
        "goals", "tether", "obstacles", "classes", "optimum", "mip: CPU s", "mip-2017: status",
        "bound, % of the optimum", "programs", "CPU s", name="published-program",
    )  # fmt: skip
    for goals, tether in CELLS:
        for seed in range(args.worlds):
            world, _ = reachable_world(seed, goals=goals, tether_length=tether, obstacles=(1, 20))
            graph = travel_graph(world, classes="non-looping")
            _ = graph.costs  # measured for both
            ours, our_s = outcome(graph, "mip", args.limit)
            theirs, their_s = outcome(graph, "mip-2017", args.limit)
            optimum = ours.length if ours.status.is_optimal else None
            bound = "" if optimum is None else f"{100 * (theirs.lower_bound or 0) / optimum:.2f}"
            row(
                goals, f"{tether:g}", len(world.obstacles), len(graph),
                "not proven" if optimum is None else f"{optimum:.2f}", f"{our_s:.2f}",
                theirs.status.value, bound, theirs.trace[-1].iteration, f"{their_s:.2f}",
            )  # fmt: skip


if __name__ == "__main__":
    main()
