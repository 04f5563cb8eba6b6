"""Orders given in part: random worlds with random precedences, in a table.

python benchmarks/arranged.py [--seconds 60] [--keep]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from table import head, heading, row

from netsp import Problem, solve, verify
from netsp.plan.random_worlds import reachable_world

CASES = ((12, 1, 6), (16, 2, 8), (20, 3, 10), (20, 4, 40), (30, 5, 20), (50, 6, 40))
"""Goals, seed, precedences."""


def arranged(goals: int, seed: int, ties: int) -> tuple[Problem, Problem]:
    """A random world of as many circles as goals, without precedences and with random ones, all of
    which some order keeps."""
    free = reachable_world(seed, goals=goals, obstacles=goals, tether_length=300.0)[0]
    rng = np.random.default_rng(seed)
    hidden = rng.permutation(goals)
    bound = [g.model_dump() | {"name": f"g{k}"} for k, g in enumerate(free.goals)]
    for _ in range(ties):
        a, b = sorted(rng.choice(goals, 2, replace=False))
        bound[hidden[b]]["after"] = (*bound[hidden[b]]["after"], f"g{hidden[a]}")
    return free, Problem.model_validate(free.model_dump() | {"goals": bound})


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    args = parser.parse_args()
    heading("Orders given in part")
    solve(arranged(12, 0, 6)[1])  # compiled, or loaded
    head("goals", "precedences", "shortest in any order", "in theirs", "status", "gap %", "s",
         "verified", name="arranged")  # fmt: skip
    for goals, seed, ties in CASES:
        free, bound = arranged(goals, seed, ties)
        least = solve(free, time_limit=args.seconds).length
        begin = time.perf_counter()
        found = solve(bound, time_limit=args.seconds)
        took = time.perf_counter() - begin
        row(goals, ties, f"{least:.1f}", f"{found.length:.1f}", found.status.value,
            f"{100.0 * found.gap:.2f}", f"{took:.1f}",
            "yes" if verify(bound, found) else "NO")  # fmt: skip


if __name__ == "__main__":
    main()
