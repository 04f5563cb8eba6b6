"""How many legs are left once covers have come to the classes, and what memory a proof takes.

    python benchmarks/memory.py [--limit 60]

Problems with some 10,000 to 20,000 classes: one of the library, and random worlds. A matrix of all
legs in single precision is what a proof held before; nothing of that kind is held now.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from frontier import warmed, world
from library_worlds import FOLDER
from peak import highest
from resumed import outcomes
from table import head, heading, row

import netsp.mip.goal_relaxation as overgoals
from netsp import Problem, solve, travel_graph, verify

WORLDS = ((20, 600.0, 1), (60, 500.0, 4), (100, 500.0, 4), (200, 500.0, 9))
"""Goals, tether and seed."""

LIBRARY = "maze-30-0"


@dataclass(frozen=True)
class Outcome:
    """Of one problem: goals, classes, legs kept, of all, in per cent, GiB, and gap in per cent."""

    goals: int
    classes: int
    kept: float
    peak: float
    gap: float
    verified: bool


def measured(problem: Problem, limit: float, *, until_rows: bool = False) -> Outcome:
    """What `auto` does in so many seconds, or until it is known which legs are left."""
    legs = []
    find = overgoals.surviving_legs

    def noted(graph, *args):
        rows = find(graph, *args)
        legs.append(200.0 * rows.left / len(graph) ** 2)
        if until_rows:
            raise KeyboardInterrupt  # gives the best tour so far
        return rows

    overgoals.surviving_legs = noted
    try:
        found = solve(problem, time_limit=limit)
    finally:
        overgoals.surviving_legs = find
    peak = highest()
    return Outcome(
        len(problem.goals), len(travel_graph(problem)), legs[0] if legs else 100.0, peak,
        100.0 * (1.0 if found.gap is None else found.gap), bool(verify(problem, found)),
    )  # fmt: skip


def of_library(job: tuple[str, float]) -> Outcome:
    """Of a problem of the library until its legs are known, in a process of its own."""
    name, limit = job
    warmed()
    return measured(Problem.load(FOLDER / f"{name}.json"), limit, until_rows=True)


def of_job(job: tuple[str, int, float, int, float]) -> Outcome:
    """In a process of its own."""
    name, goals, tether, seed, limit = job
    warmed()
    if name:
        return measured(Problem.load(FOLDER / f"{name}.json"), limit)
    return measured(world(seed, goals, tether, many=False), limit)


def main() -> None:
    """All of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--limit", type=float, default=60.0)
    args = parser.parse_args()
    jobs = [(LIBRARY, 0, 0.0, 0, args.limit)]
    jobs += [("", *w, args.limit) for w in WORLDS]
    heading(f"Memory (auto, {args.limit:g} s)")
    head("problem", "goals", "classes", "legs kept %", "matrix of all GiB", "peak GiB", "gap %",
         "verified", name="memory")  # fmt: skip
    found = outcomes(jobs, of_job, Outcome, workers=1, file=None)
    for (name, _, tether, seed, _), f in zip(jobs, found, strict=True):
        row(
            f"`{name}`" if name else f"tether {tether:g}, world {seed}", f.goals, f.classes,
            f"{f.kept:.2f}", f"{4.0 * f.classes**2 / 2**30:.2f}", f"{f.peak:.2f}",
            f"{f.gap:.2g}", f.verified,
        )  # fmt: skip


if __name__ == "__main__":
    main()
