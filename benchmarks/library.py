"""The library of problems: solves each, judges it, and keeps what is better as its record.

python benchmarks/library.py [--limit 30] [--only 'maze-*'] [--jobs 2]   solve
python benchmarks/library.py --table --keep                              the tables of the page
"""

from __future__ import annotations

import argparse
import fnmatch
import statistics
from concurrent.futures import ProcessPoolExecutor, as_completed

from library_worlds import FOLDER
from table import head, heading, row, source

from netsp import Problem, Solution, solve
from netsp.base.errors import NetspError
from netsp.study.library import Library
from netsp.study.library.rank import ranking, read_rows


def solved(job: tuple[str, float]) -> tuple[str, Solution | None, str]:
    """A problem's name, its solution, and what went wrong."""
    name, limit = job
    try:
        found = solve(Problem.load(FOLDER / f"{name}.json"), time_limit=limit)
    except NetspError as error:
        return name, None, str(error)
    return name, found, ""


def run(limit: float, only: str, jobs: int) -> None:
    """Solve what is not proven yet."""
    library = Library(FOLDER)
    commit = source()["commit"]
    names = [
        n for n in library
        if fnmatch.fnmatchcase(n, only) and not (n in library.records and library.records[n].proven)
    ]  # fmt: skip
    names.sort(key=lambda n: library.problem(n).visits)
    with ProcessPoolExecutor(jobs) as pool:
        for done in as_completed([pool.submit(solved, (n, limit)) for n in names]):
            name, found, wrong = done.result()
            if found is None or found.length is None:
                print(f"{name}: {wrong or 'no tour'}", flush=True)
                continue
            library.take(found, by="netsp", commit=commit, bound=found.bound)
            library.save()
            print(f"{name}: {found}, {found.timings.total_s:.1f} s", flush=True)


def tables() -> None:
    """By family, and the ranking."""
    library = Library(FOLDER)
    heading("The library of problems")
    head("family", "problems", "goals", "with a verified tour", "proven", "certified",
         "gap of the others, mean %", "worst %", "seconds, median", "worst",
         name="library")  # fmt: skip
    families: dict[str, list[str]] = {}
    for name in library:
        families.setdefault(name.split("-")[0], []).append(name)
    for family, names in (*families.items(), ("all", list(library))):
        goals = [library.problem(n).visits for n in names]
        records = [library.records[n] for n in names if n in library.records]
        gaps = [100.0 * (r.gap if r.gap is not None else 1.0) for r in records if not r.proven]
        times = [r.seconds for r in records]
        row(family, len(names), f"{min(goals)} to {max(goals)}", sum(r.verified for r in records),
            sum(r.proven for r in records), sum(r.certified == "optimal" for r in records),
            f"{statistics.fmean(gaps):.2f}" if gaps else "",
            f"{max(gaps):.2f}" if gaps else "", f"{statistics.median(times):.2f}",
            f"{max(times):.1f}")  # fmt: skip
    print()
    entries = ranking(library, read_rows(FOLDER / "ranking.jsonl"))
    if not entries:
        return
    head("solver", "limit s", "problems", "verified", "as short as the best", "above it, mean %",
         "worst %", "seconds, median", name="library-ranking")  # fmt: skip
    for e in entries:
        row(e["solver"], f"{e['limit']:g}", e["problems"], e["verified"], e["best"],
            f"{100 * e['above']:.3f}", f"{100 * e['worst']:.2f}",
            f"{e['seconds']:.2f}")  # fmt: skip
    print()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--limit", type=float, default=30.0)
    parser.add_argument("--only", default="*")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--table", action="store_true")
    args = parser.parse_args()
    if args.table:
        tables()
    else:
        run(args.limit, args.only, args.jobs)


if __name__ == "__main__":
    main()
