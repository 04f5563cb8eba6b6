"""The tables of docs/notebook/reproduction.md from the rows of the papers' studies.

    python benchmarks/studies.py [--keep]
    python benchmarks/studies.py --take STUDY ROWS     ROWS (JSONL) become studies/results/STUDY

`netsp compare studies/STUDY.toml -o ROWS` makes the rows. They are kept gzipped, their histories
thinned, and `commits.json` says of which commit they are.
"""

from __future__ import annotations

import gzip
import json
import statistics
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from table import ROOT, head, row, source

from netsp.exchange.maps.path_file import read_paths
from netsp.model.problem import Problem
from netsp.study.compare.path_comparison import PathComparison, compare_paths
from netsp.study.compare.path_study import PathStudy
from netsp.view.report.stats import is_proven

KEPT = ROOT / "studies" / "results"
POINTS = 12
"""Of a history, first and last among them."""

Row = dict[str, Any]

TABLE_ONE = (
    ("0.16", 10), ("0.66", 10), ("2.43", 10), ("8.47", 10),
    ("0.65", 10), ("12.73", 10), ("47.86", 7), ("74.73", 8),
    ("8.07", 8), ("4.69", 2), ("186.48", 3), ("115.28", 3),
    ("16.20", 9), ("40.08", 2), ("0.80", 1), ("65.57", 1),
)  # fmt: skip
"""McCammon & Hollinger 2017, Table I, by goals, then tether: mean seconds, worlds proven."""

TABLE_TWO = ROOT / "studies" / "paths" / "icra2017-table2.toml"

FIG_FIVE = {
    "mip": "0, up to 12,000 s",
    "reduced-mip (paper)": "within 5 % on average",
    "anneal": "worse than MIP, and worse than greedy in the largest worlds",
    "greedy": "worse than the MIPs",
}
"""What the paper says of its Fig. 5."""


def take(study: str, rows: Path) -> None:
    """Keep the rows of a run of a study."""
    with gzip.GzipFile(KEPT / f"{study}.jsonl.gz", "wb", mtime=0) as out:
        for line in rows.read_text(encoding="utf-8").splitlines():
            trial = json.loads(line)
            history = trial.get("history") or []
            if len(history) > POINTS:
                chosen = np.unique(np.linspace(0, len(history) - 1, POINTS).astype(int))
                trial["history"] = [history[k] for k in chosen]
            out.write(json.dumps(trial, separators=(",", ":")).encode() + b"\n")
    commits = KEPT / "commits.json"
    known = json.loads(commits.read_text(encoding="utf-8"))
    known[study] = source()["commit"]
    commits.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def load(study: str) -> tuple[list[Row], dict[str, str]]:
    """Kept rows, and where they come from."""
    with gzip.open(KEPT / f"{study}.jsonl.gz", "rt", encoding="utf-8") as file:
        rows = [json.loads(line) for line in file]
    last = max(rows, key=lambda r: r["finished"])
    commit = json.loads((KEPT / "commits.json").read_text(encoding="utf-8"))[study]
    python = next(r["versions"]["python"] for r in rows if "versions" in r)
    machine = f"{last['machine'].split(', ')[-1]}, Python {python}"
    return rows, {"date": last["finished"][:10], "commit": commit, "machine": machine}


def chosen(
    rows: Iterable[Row], solver: str, roadmap: str | None = None, **world: float
) -> list[Row]:
    """The rows of a solver, a roadmap and a cell."""
    return [
        r for r in rows
        if r["solver"]["label"] == solver and roadmap in (None, r["roadmap"]["label"])
        and all(r["world"][k] == v for k, v in world.items())
    ]  # fmt: skip


def over(
    rows: list[Row], solver: str, roadmap: str | None = None, **world: float
) -> list[float]:  # fmt: skip
    """Per cent above the proven optimum of the same world, where there is a tour."""
    best = {
        r["problem_sha256"]: r["length"]
        for r in chosen(rows, "auto", roadmap, **world) if "length" in r
    }  # fmt: skip
    found = [r for r in chosen(rows, solver, roadmap, **world) if r.get("length")]
    return [100.0 * (r["length"] / best[r["problem_sha256"]] - 1.0) for r in found]


CLOCKED = ("lns", "anneal")
"""Whose tours of Fig. 5 depend on how fast the machine is."""


def again(worlds: int, most_goals: int) -> tuple[int, list[str]]:
    """Run the trials of the first worlds with so few goals once more, but for those that a clock
    ends: how many are as kept, and those that are not."""
    from netsp.study.compare.study import Trial
    from netsp.study.compare.trial import run

    same, differs = 0, []
    for study in ("icra2017-table1", "icra2017-fig5", "rss2016-fig3", "rss2016-fig4"):
        for r in load(study)[0]:
            clocked = r["solver"]["label"] in CLOCKED and r["solver"]["iteration_limit"] is None
            beyond = r["world"]["seed"] >= worlds or r["world"]["goals"] > most_goals
            if beyond or clocked:
                continue
            found = run(Trial(r["world"], r["roadmap"], r["solver"], r["seed"]))
            kept, now = r.get("length"), found.get("length")
            equal = kept == now if None in (kept, now) else abs(now / kept - 1.0) <= 1e-6
            if is_as_kept(found, r) and equal:
                same += 1
            else:
                differs.append(
                    f"{study} {r['solver']['label']} {r['world']}: {found['status']} {now}, "
                    f"kept {r['status']} {kept}"
                )
    return same, differs


def is_as_kept(found: dict[str, Any], kept: dict[str, Any]) -> bool:
    """Return whether a trial ended with the status of a kept row.

    Rows kept before November 2026 say "optimal" for a tour that is shortest along a sampled roadmap
    or over the classes kept; rows say now which.
    """
    if "lower_bound_of" not in kept and kept["status"] == "optimal":
        scopes = {"optimal", "optimal_of_roadmap", "optimal_of_kept"}
        return found["status"] in scopes
    return bool(found["status"] == kept["status"])


def middle(values: list[float]) -> str:
    """Median, and mean in brackets; nothing is printed as minus zero."""
    return f"{statistics.median(values) + 1e-9:.1f} ({np.mean(values) + 1e-9:.1f})"


def table_one() -> None:
    """Seconds to the proven optimum."""
    rows, origin = load("icra2017-table1")
    kinds = [(s, r) for r in ("prm", "taut") for s in ("auto", "mip, cbc")]
    names = {"auto": "`auto`", "mip, cbc": "`mip` with CBC", "prm": "PRM*", "taut": "exact"}
    columns = [f"{names[s]}, {names[r]}" for s, r in kinds]
    head("goals", "tether", "paper", *columns, name="icra2017-table1", **origin)
    paper = iter(TABLE_ONE)
    for goals in (5, 10, 15, 20):
        for tether in (200, 250, 300, 350):
            seconds, proven = next(paper)
            cells = []
            for solver, roadmap in kinds:
                trials = chosen(rows, solver, roadmap, goals=goals, tether_length=tether)
                done = [r.get("cpu_s", r["total_s"]) for r in trials if is_proven(r)]
                cells.append(f"{statistics.median(done):.2f} ({len(done)})")
            row(goals, tether, f"{seconds} ({proven})", *cells)


def fig_five() -> None:
    """Per cent over the optimum, and seconds."""
    rows, origin = load("icra2017-fig5")
    tethers = (200, 250, 300)
    head("method", *(f"tether {t}" for t in tethers), "the paper says",
         name="icra2017-fig5", **origin)  # fmt: skip
    for solver in ("mip", "reduced-mip", "reduced-mip (paper)", "anneal", "lns", "greedy"):
        cells = [middle(over(rows, solver, goals=20, tether_length=t)) for t in tethers]
        row(solver, *cells, FIG_FIVE.get(solver, ""))
    for solver in ("mip", "greedy"):
        cells = []
        for t in tethers:
            done = [r for r in chosen(rows, solver, goals=20, tether_length=t) if r.get("length")]
            cells.append(f"{statistics.median(r['matrix_s'] + r['solve_s'] for r in done):.2f}")
        row(f"seconds of {solver}, with all legs", *cells,
            "2 min limit, up to 12,000 s" if solver == "mip" else "")  # fmt: skip


def reduced() -> None:
    """Print how far the paper's reduced MIP is from the optimum, over both roadmaps."""
    rows, origin = load("icra2017-reduced")
    head("tether", "worlds, PRM*", "% over the optimum, PRM*: median (mean)", "worlds, exact",
         "% over the optimum, exact: median (mean)", name="icra2017-reduced", **origin)  # fmt: skip
    for tether in (200, 250, 300, 350):
        found = [
            over(rows, "reduced-mip (paper)", r, tether_length=tether) for r in ("prm", "taut")
        ]  # fmt: skip
        row(tether, *(cell for f in found for cell in (len(f), middle(f))))


def fig_three() -> None:
    """Annealing for 200,000 iterations."""
    rows, origin = load("rss2016-fig3")
    head("goals", "solver", "trials", "% over the optimum: median (mean)", "entangled",
         name="rss2016-fig3", **origin)  # fmt: skip
    for goals in (5, 10):
        for solver in ("anneal-2016", "anneal"):
            trials = chosen(rows, solver, goals=goals)
            row(goals, solver, len(trials), middle(over(rows, solver, goals=goals)),
                sum(bool(r.get("entangled")) for r in trials))  # fmt: skip


def fig_four() -> None:
    """Against the blind and the backtracking baseline."""
    rows, origin = load("rss2016-fig4")
    head("goals", "`anneal-2016` % over the optimum, mean", "without a tour", "`greedy-tsp`",
         "entangled by it, mean", "its tours that entangle", "`greedy-2016`",
         name="rss2016-fig4", **origin)  # fmt: skip
    for goals in range(5, 11):

        def mean(solver: str, goals: int = goals) -> str:
            return f"{np.mean(over(rows, solver, goals=goals)):.1f}"

        blind = [r["entangled"] for r in chosen(rows, "greedy-tsp", goals=goals)]
        annealed = chosen(rows, "anneal-2016", goals=goals)
        row(goals, mean("anneal-2016"), sum(not r.get("length") for r in annealed),
            mean("greedy-tsp"), f"{np.mean(blind):.1f}",
            f"{sum(b > 0 for b in blind)} of {len(blind)}", mean("greedy-2016"))  # fmt: skip


def compared_paths() -> PathComparison:
    """Compare the paths of the study of Table II, as `netsp compare-path` does."""
    study, place = PathStudy.load(TABLE_TWO), TABLE_TWO.parent
    problem = Problem.load(place / study.problem)
    paths = [
        replace(read_paths(place / p.file, problem)[0], name=p.label) for p in study.paths
    ]  # fmt: skip
    return compare_paths(problem, paths)


def table_two() -> None:
    """Print McCammon & Hollinger 2017, Table II, beside ours."""
    study, found = PathStudy.load(TABLE_TWO), compared_paths()
    published = {p.label: (p.published, study.published_percent(k))
                 for k, p in enumerate(study.paths)}  # fmt: skip
    published["planned tour"] = (study.published_tour, 0.0)
    head("path", "paper m", "% over its tour", "ours m", "% over our tour", "tether m of 20",
         "home", "order at best m", "order: % over our tour", name="icra2017-table2")  # fmt: skip
    for r in found.rows():
        length, percent = published[r["path"]]
        row(r["path"], f"{length:.1f}", f"{percent:.1f}", f"{r['length']:.2f}",
            f"{r['longer_by_percent']:.1f}", f"{r['longest_tether']:.2f}",
            "free" if r["free"] else "entangled", f"{r['order_length']:.2f}",
            f"{r['order_longer_by_percent']:.1f}")  # fmt: skip


TABLES: tuple[Callable[[], None], ...] = (
    table_one, table_two, fig_five, reduced, fig_three, fig_four,
)  # fmt: skip


def main() -> None:
    """Take rows, or print all tables."""
    if sys.argv[1:2] == ["--take"]:
        take(sys.argv[2], Path(sys.argv[3]))
        return
    for table in TABLES:
        table()
        print()


if __name__ == "__main__":
    main()
