"""Effect of each mechanism of `auto`: solves without the mechanism, beside solves with all.

    python benchmarks/ablation.py                          the library and cells of the frontier
    python benchmarks/ablation.py --without combs parity   some mechanisms
    python benchmarks/ablation.py --with scheduler         tasks that share the time, no routes
    python benchmarks/ablation.py --file FILE              each solve is kept as it comes
    python benchmarks/ablation.py --cpu-limits             on a machine that also does other work
    python benchmarks/ablation.py --with scheduler --each  a row for each graph, medians over seeds

Each graph is solved with all mechanisms and then without each, in one process, from a new travel
graph. Times are CPU seconds of the solver, without the roadmap. Where both prove, times are
compared; where either does not, gaps are.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from library_worlds import FOLDER
from table import head, heading, row

from netsp import Problem, TravelGraph, solve_graph, travel_graph
from netsp.base.errors import NetspError
from netsp.mip.mip_policy import CUT_FAMILIES
from netsp.plan.random_worlds import random_world
from netsp.study.library import Library

CELLS = [
    *[(20, 500), (40, 500), (60, 300), (60, 350), (60, 500), (100, 300), (100, 350), (100, 500)],
    *[(200, 300), (200, 350), (200, 500)],
]
"""Goals and tether length of random worlds, seeds 0 to 2."""

MECHANISMS: dict[str, dict[str, Any]] = {
    **{
        f"cuts: {family}": {
            "policy.mip.cuts.families": tuple(f for f in CUT_FAMILIES if f != family)
        }
        for family in CUT_FAMILIES
    },
    "cuts near the incumbent": {"policy.mip.cuts.incumbent_weight": 0.0},
    "cuts leave when idle": {"policy.mip.cuts.max_kept_share": 0.0},
    "pricing before cuts in large LPs": {
        "policy.mip.schedule.settle_share": 1e9,
        "policy.mip.schedule.settled_share": 1e9,
    },
    "legs leave large LPs": {"policy.mip.lp.many_vertices": 10**9},
    "longer intervals of pricing": {"policy.mip.schedule.max_interval": 2},
    "strong branching": {
        "policy.mip.branching.pair_candidates": 1,
        "policy.mip.branching.vertex_candidates": 1,
    },
    "route: subsets": {"policy.subsets.max_sums": 0.0},
    "route: walks": {"policy.routes.max_walk_goals": 0},
    "walks with wider memory": {"policy.mip.gtsp.walks.max_widened_labels": 1},
    "handover to cuts": {
        "policy.mip.handover.max_legs": 0,
        "policy.mip.handover.max_legs_of_slow_walks": 0,
    },
    "route: core": {
        "policy.mip.gtsp.proof_search.min_core_ratio": 1e9,
        "policy.mip.gtsp.proof_search.min_core_ratio_many": 1e9,
    },
    "route: covers": {"policy.mip.covers.min_classes": 10**9},
    "bound over goals before the root": {"policy.mip.many_goals": 10**9},
    "merging": {"policy.mip.merging.min_goals": 10**9},
    "search again after no success": {"policy.mip.gtsp.proof_search.max_vain_searches": 1},
    "searches after the root": {"policy.mip.max_searches": 0},
}
"""Options of `auto` that leave a mechanism out."""

ALL = "all"
EXTRA = {"scheduler": {"scheduler": True}}
"""Options that put something in its place."""


@dataclass(frozen=True)
class Outcome:
    """One solve: CPU seconds, length, bound of the tours asked for, and what went wrong."""

    seconds: float
    length: float = math.inf
    bound: float = 0.0
    failed: str = ""

    @property
    def gap(self) -> float:
        """Relative gap."""
        return 1.0 - self.bound / self.length if self.length < math.inf else 1.0

    @property
    def proven(self) -> bool:
        """True if the gap is closed to the tolerance of a proof."""
        return self.gap <= 1e-6


def graphs(only: str) -> Iterator[tuple[str, Callable[[], TravelGraph]]]:
    """Names of graphs, and what builds each anew."""
    for seed in range(3):
        for goals, tether in CELLS:
            name = f"cell-{goals}-{tether}-{seed}"
            world = (seed, goals, float(tether))
            if fnmatch.fnmatchcase(name, only):
                yield (
                    name,
                    lambda w=world: travel_graph(  # type: ignore[misc]
                        random_world(w[0], goals=w[1], tether_length=w[2])
                    ),
                )
    for name in Library(FOLDER):
        if fnmatch.fnmatchcase(name, only):
            yield name, lambda n=name: travel_graph(Problem.load(FOLDER / f"{n}.json"))  # type: ignore[misc]


def solved(graph: TravelGraph, options: dict[str, Any], limit: float, seed: int) -> Outcome:
    """One solve."""
    begin = time.process_time()
    try:
        found = solve_graph(graph, seed=seed, params=options, time_limit=limit)
    except NetspError as error:
        return Outcome(time.process_time() - begin, failed=str(error))
    seconds = time.process_time() - begin
    if found.length is None:
        return Outcome(seconds)
    asked = graph.for_problem(found)
    return Outcome(seconds, found.length, asked.lower_bound or 0.0)


def recorded(file: Path | None) -> dict[tuple[str, str, int], Outcome]:
    """Outcomes that a file keeps."""
    lines = file.read_text().splitlines() if file is not None and file.exists() else []
    return {tuple(r["job"]): Outcome(**r["outcome"]) for r in map(json.loads, lines)}


def outcomes(
    variants: dict[str, dict[str, Any]],
    only: str,
    limit: float,
    seeds: list[int],
    file: Path | None,
) -> dict[tuple[str, str, int], Outcome]:
    """Outcomes by graph, variant and seed; those in the file are not measured again."""
    known = recorded(file)
    for name, build in graphs(only):
        for seed in seeds:
            for variant, options in variants.items():
                job = (name, variant, seed)
                if job in known:
                    continue
                known[job] = solved(build(), options, limit, seed)
                if file is not None:
                    with file.open("a") as end:
                        end.write(json.dumps({"job": job, "outcome": asdict(known[job])}) + "\n")
    return known


def table(
    variant: str, known: dict[tuple[str, str, int], Outcome], without: bool, min_seconds: float
) -> None:
    """One row: proofs, ratio of CPU seconds where both prove, gaps where either does not."""
    pairs = [
        (known[graph, ALL, seed], found)
        for (graph, v, seed), found in known.items()
        if v == variant and (graph, ALL, seed) in known
    ]
    both = [(a, b) for a, b in pairs if a.proven and b.proven]
    timed = [(a, b) for a, b in both if max(a.seconds, b.seconds) >= min_seconds]
    ratios = sorted(b.seconds / a.seconds for a, b in timed)
    gaps = [100.0 * (b.gap - a.gap) for a, b in pairs if not (a.proven and b.proven)]
    spent = [sum(o.seconds for o in side) for side in zip(*both, strict=True)] or [0.0, 0.0]
    row(("without " if without else "") + variant, len(pairs), sum(a.proven for a, _ in pairs),
        sum(b.proven for _, b in pairs), f"{spent[0]:.1f}", f"{spent[1]:.1f}",
        f"{statistics.median(ratios):.3f}" if ratios else "",
        f"{ratios[-1]:.2f}" if ratios else "",
        f"{statistics.fmean(gaps):+.3f}" if gaps else "", f"{max(gaps):+.2f}" if gaps else "",
        sum(bool(b.failed) for _, b in pairs))  # fmt: skip


def table_of_graphs(variant: str, known: dict[tuple[str, str, int], Outcome]) -> None:
    """One row for each graph: proofs, and medians over the seeds."""
    for graph in dict.fromkeys(g for g, v, _ in known if v == variant):
        sides = [
            [o for (g, v, _), o in known.items() if (g, v) == (graph, side)]
            for side in (ALL, variant)
        ]
        seconds = [statistics.median(o.seconds for o in side) for side in sides]
        gaps = [100.0 * max(statistics.median(o.gap for o in side), 0.0) for side in sides]
        lengths = [statistics.median(o.length for o in side) for side in sides]
        row(graph, *(sum(o.proven for o in side) for side in sides),
            *(f"{s:.2f}" for s in seconds), *(f"{g:.2f}" for g in gaps),
            f"{100.0 * (lengths[1] / lengths[0] - 1.0):+.2f}")  # fmt: skip


def main() -> None:
    """Measure, and show a row for each mechanism."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--without", nargs="*", default=None, help="parts of mechanisms' names")
    parser.add_argument("--with", nargs="*", default=[], choices=EXTRA, dest="extra")
    parser.add_argument("--only", default="*", help="pattern of graphs' names")
    parser.add_argument("--limit", type=float, default=10.0, help="seconds for each solve")
    parser.add_argument("--seeds", type=int, nargs="*", default=[0])
    parser.add_argument("--file", type=Path, help="file that keeps each solve")
    parser.add_argument("--min-seconds", type=float, default=0.1,
                        help="proofs that are quicker in both are not compared")  # fmt: skip
    parser.add_argument("--each", action="store_true", help="a row for each graph")
    parser.add_argument("--recorded", action="store_true", help="only show what the file keeps")
    parser.add_argument("--table", help="name of the table that --keep writes")
    args = parser.parse_args()
    wanted = args.without if args.without is not None else ([] if args.extra else [""])
    left_out = {m: o for m, o in MECHANISMS.items() if any(w in m for w in wanted)}
    variants = {ALL: {}, **left_out, **{name: EXTRA[name] for name in args.extra}}
    if args.recorded:
        known = recorded(args.file)
        variants = {v: o for v, o in variants.items() if any(v == w for _, w, _ in known)}
    else:
        for goals in (20, 60):  # compile
            solve_graph(travel_graph(random_world(1, goals=goals, tether_length=300.0)))
        known = outcomes(variants, args.only, args.limit, args.seeds, args.file)
    heading("Mechanisms of auto")
    name = args.table or ("scheduler" if args.extra and not left_out else "ablation")
    if args.each:
        head("graph", "proven with all", "proven", "CPU s with all", "CPU s", "gap % with all",
             "gap %", "length, % more", name=name)  # fmt: skip
        for variant in list(variants)[1:]:
            table_of_graphs(variant, known)
        return
    head("variant", "solves", "proven with all", "proven", "CPU s with all", "CPU s",
         "ratio, median", "worst", "gap, % more, mean", "worst", "failed", name=name)  # fmt: skip
    for variant in variants:
        if variant != ALL:
            table(variant, known, variant in left_out, args.min_seconds)


if __name__ == "__main__":
    main()
