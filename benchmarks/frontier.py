"""How far proofs reach: from problem file to proof, random worlds with up to 200 goals.

    python benchmarks/frontier.py                     every cell, 10 worlds, 300 s each: many hours
    python benchmarks/frontier.py --worlds 3 --limit 60
    python benchmarks/frontier.py --cells 60:300,60:350
    python benchmarks/frontier.py --outcomes FILE     each world is kept as it comes
    python benchmarks/frontier.py --rules             all classes, and the non-looping ones
    python benchmarks/frontier.py --heuristic         `lns` against the best known
    python benchmarks/frontier.py --peers             other people's solvers on the same graphs

Worlds: 500 x 500, 20 circles of radius 10 to 30 (`--many`: 50 of radius 10 to 20), seeds from 0
(`netsp.plan.random_worlds`). A time is that of `netsp.solve` with `auto`: roadmap, legs and proof.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from peak import highest
from peers import EXACT, HEURISTIC
from resumed import outcomes
from table import head, heading, row

from netsp import Problem, Status, solve, solve_graph, travel_graph, verify
from netsp.base.errors import NetspError
from netsp.plan.random_worlds import random_world
from netsp.view.report.figures import performance

CELLS = [
    *[(n, t) for n in (5, 10, 15, 20) for t in (200, 250, 300, 350, 500)],
    *[(40, t) for t in (250, 300, 350, 500)],
    *[(60, t) for t in (300, 350, 500)],
    *[(100, t) for t in (300, 350, 500)],
    *[(200, t) for t in (300, 350, 500)],
]


def world(seed: int, goals: int, tether: float, many: bool) -> Problem:
    """A problem of a cell."""
    if many:
        return random_world(
            seed, goals=goals, tether_length=tether, obstacles=50, radii=(10.0, 20.0)
        )
    return random_world(seed, goals=goals, tether_length=tether)


@dataclass(frozen=True)
class Outcome:
    """Of one world: seconds, classes, gap in per cent, GiB, why it failed."""

    seconds: float
    classes: int = 0
    gap: float = 100.0
    proven: bool = False
    verified: bool = False
    peak: float = 0.0
    failed: str = ""

    @property
    def shown(self) -> str:
        """Seconds if it was proven, else the gap."""
        if self.failed:
            return "failed"
        return f"{self.seconds:.0f} s" if self.proven else f"{self.gap:.2g} %"


def warmed() -> None:
    """Compile before it counts."""
    solve(world(0, 5, 200.0, many=False))
    solve_graph(travel_graph(world(0, 5, 200.0, many=False)), "lns", iteration_limit=10)


def of_job(job: tuple[int, float, bool, str, float, int]) -> Outcome:
    """What `proof` gives in a process of its own."""
    goals, tether, many, classes, limit, seed = job
    warmed()
    return proof(world(seed, goals, tether, many), limit, classes)


def proof(problem: Problem, limit: float, classes: str = "all") -> Outcome:
    """From problem to proof, and the tour judged."""
    begin = time.perf_counter()
    try:
        solution = solve(problem, time_limit=limit, roadmap_options={"classes": classes})
    except NetspError as error:
        return Outcome(time.perf_counter() - begin, failed=f" ({str(error)[:40]}…)")
    seconds = time.perf_counter() - begin
    peak = highest()
    return Outcome(
        seconds, len(travel_graph(problem, classes=classes)),
        100.0 * (solution.gap if solution.gap is not None else 1.0),
        # by the rule non-looping the shortest over the classes kept is optimal_of_kept
        solution.bound is not None and solution.bound.proves(solution.length or 0.0),
        bool(verify(problem, solution)), peak,
    )  # fmt: skip


def proofs(
    cells: list[tuple[int, float, int]], limit: float, many: bool, rules: list[str],
    table: str, workers: int, kept: Path | None,
) -> None:  # fmt: skip
    """One row a cell and rule of classes. table : its name among those that are kept."""
    head("goals", "tether", "rule", "classes", "proven", "median s", "worst s", "mean gap %",
         "worst gap %", "verified", "peak GiB", "each world: proven after, or gap",
         name=table)  # fmt: skip
    for goals, tether, worlds in cells:
        for rule in rules:
            jobs = [(goals, tether, many, rule, limit, s) for s in range(worlds)]
            found = outcomes(jobs, of_job, Outcome, workers=workers, file=kept)
            times, gaps = [f.seconds for f in found], [f.gap for f in found]
            sizes = [f.classes for f in found if f.classes] or [0]
            failed = next((f.failed for f in found if f.failed), "")
            row(
                goals, f"{tether:g}", rule, f"{min(sizes)} to {max(sizes)}",
                f"{sum(f.proven for f in found)}/{worlds}{failed}",
                f"{statistics.median(times):.2f}", f"{max(times):.2f}", f"{np.mean(gaps):.3f}",
                f"{max(gaps):.3f}", f"{sum(f.verified for f in found)}/{worlds}",
                f"{max(f.peak for f in found):.2f}", ", ".join(f.shown for f in found),
            )  # fmt: skip


def heuristic(worlds: int) -> None:
    """`lns` after a stated time over the best known: the proven optimum, or the best of `auto` in
    150 s and of `lns` itself."""
    head("goals", "tether", "worlds", "lns s", "mean % over best known", "worst %",
         "best known is proven", name="lns-over-best")  # fmt: skip
    for goals, tether, limit in ((20, 350, 1.0), (60, 300, 10.0), (200, 300, 60.0)):
        over, proven = [], 0
        worlds = min(worlds, 5) if goals == 200 else worlds
        for seed in range(worlds):
            graph = travel_graph(world(seed, goals, tether, many=False))
            graph.costs  # noqa: B018
            found = solve_graph(graph, "lns", time_limit=limit, seed=seed)
            best = solve_graph(graph, "auto", time_limit=150.0)
            proven += best.status is Status.OPTIMAL
            known = min(best.length or np.inf, found.length or np.inf)
            over.append(100.0 * ((found.length or np.inf) / known - 1.0))
        row(
            goals,
            tether,
            worlds,
            limit,
            f"{np.mean(over):.3f}",
            f"{max(over):.3f}",
            f"{proven}/{worlds}",
        )


def peers(worlds: int, limit: float, plot: str | None) -> None:
    """The same travel graphs handed to others; seconds beside ours. Best known is the least of all
    lengths found."""
    head("goals", "tether", "solver", "proven", "median s", "mean gap %", "mean % over best known",
         "no tour", name="peers")  # fmt: skip
    trials: dict[str, list[dict]] = {name: [] for name in EXACT}
    for goals, tether in ((10, 300), (20, 300), (20, 350), (40, 300)):
        graphs = [travel_graph(world(s, goals, tether, many=False)) for s in range(worlds)]
        for graph in graphs:
            graph.costs  # noqa: B018
        found: dict[str, list[tuple[float, float, float]]] = {}
        for name, run in {**EXACT, **HEURISTIC}.items():
            rows = found[name] = []
            for graph in graphs:
                begin = time.perf_counter()
                try:
                    length, bound = run(graph, limit)
                except ImportError as error:
                    print(f"{name}: not installed: {error.name}", file=sys.stderr)
                    break
                rows.append((length, bound, time.perf_counter() - begin))
        best = [min(rows[k][0] for rows in found.values() if rows) for k in range(worlds)]
        for name, rows in found.items():
            if not rows:
                continue
            gaps = [100.0 * max(n - b, 0.0) / n if np.isfinite(n) else 100.0 for n, b, _ in rows]
            over = [100.0 * (n / k - 1.0) for (n, _, _), k in zip(rows, best, strict=True)]
            proofs = [g < 1e-3 for g in gaps]
            if name in EXACT:
                trials[name] += [
                    {"problem_sha256": f"{goals} {tether} {k}", "seed": 0, "total_s": seconds,
                     "status": "optimal" if proof else "feasible"}
                    for k, ((_, _, seconds), proof) in enumerate(zip(rows, proofs, strict=True))
                ]  # fmt: skip
            finite = [o for o in over if np.isfinite(o)]
            row(goals, tether, name, f"{sum(proofs)}/{worlds}" if name in EXACT else "",
                f"{statistics.median(r[2] for r in rows):.2f}",
                f"{np.mean(gaps):.2f}" if name in EXACT else "",
                f"{np.mean(finite):.2f}" if finite else "", len(over) - len(finite))  # fmt: skip
    figure = performance(trials) if plot else None
    if figure is not None:
        figure.savefig(plot, dpi=130)


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", help="goals:tether[:worlds],… instead of all")
    parser.add_argument("--worlds", type=int, default=10)
    parser.add_argument("--limit", type=float, default=300.0, help="seconds a world")
    parser.add_argument("--many", action="store_true", help="50 circles of radius 10 to 20")
    parser.add_argument("--rules", action="store_true", help="both rules of classes side by side")
    parser.add_argument("--heuristic", action="store_true")
    parser.add_argument("--peers", action="store_true")
    parser.add_argument("--table", help="name of the table among those kept")
    parser.add_argument("--plot", help="of --peers, a performance profile")
    parser.add_argument("--jobs", type=int, default=1, help="worlds at a time")
    parser.add_argument("--outcomes", type=Path, help="JSON lines, one a world")
    args = parser.parse_args()
    heading(f"Frontier ({args.worlds} worlds a cell, limit {args.limit:g} s)")
    warmed()
    if args.heuristic:
        heuristic(args.worlds)
    elif args.peers:
        peers(args.worlds, args.limit, args.plot)
    else:
        cells = [(n, float(t), args.worlds) for n, t in CELLS]
        if args.cells:
            asked = [c.split(":") for c in args.cells.split(",")]
            cells = [
                (int(n), float(t), int(worlds[0]) if worlds else args.worlds)
                for n, t, *worlds in asked
            ]
        rules = ["non-looping", "all"] if args.rules else ["all"]
        table = args.table or ("frontier-rules" if args.rules else "frontier")
        proofs(cells, args.limit, args.many, rules, table, args.jobs, args.outcomes)


if __name__ == "__main__":
    main()
