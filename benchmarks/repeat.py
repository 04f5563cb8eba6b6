"""Same seed, same result: pairs of runs in new processes, compared to the byte.

    python benchmarks/repeat.py [--pairs 200]

The second of a pair has another hash seed and another number of threads. What may differ, and is
left out, are times.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from table import ROOT, head, heading, row

SCRIPT = """
import json, sys
from netsp import solve
from netsp.plan.random_worlds import random_world
for task in json.loads(sys.argv[1]):
    seed, goals, tether, solver, limit = task
    problem = random_world(seed, goals=goals, tether_length=tether)
    data = json.loads(solve(problem, solver, seed=seed, iteration_limit=limit).to_json())
    data.pop("timings")
    print(json.dumps(data, sort_keys=True))
"""

SOLVERS = [("mip", 60), ("lns", 400), ("auto", 60), ("anneal", 200_000), ("dp", 12),
           ("reduced-mip", 40), ("mip", 1000), ("greedy", 1)]  # fmt: skip

BATCH = 5
"""Runs of one process."""


def tasks(count: int) -> list[list[object]]:
    """What is run: worlds of rising size, solvers in turn."""
    out = []
    for k in range(count):
        solver, limit = SOLVERS[k % len(SOLVERS)]
        out.append([k, 7 + k % 8, (250.0, 300.0, 350.0)[k % 3], solver, limit])
    return out


def outputs(batch: list[list[object]], hash_seed: int, threads: int) -> list[str]:
    """The solutions of a batch, run in one new process."""
    env = dict(os.environ) | {
        "PYTHONHASHSEED": str(hash_seed), "NUMBA_NUM_THREADS": str(threads),
        "OMP_NUM_THREADS": str(threads), "OPENBLAS_NUM_THREADS": str(threads),
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, json.dumps(batch)], env=env, cwd=ROOT, text=True,
        capture_output=True, check=True,
    )  # fmt: skip
    return done.stdout.splitlines()


def pairs(count: int) -> tuple[int, int]:
    """How many pairs of runs are the same, of how many."""
    every = tasks(count)
    batches = [every[k : k + BATCH] for k in range(0, count, BATCH)]
    with ThreadPoolExecutor(2) as pool:
        first = list(pool.map(lambda b: outputs(b, 1, 1), batches))
        second = list(pool.map(lambda b: outputs(b, 4242, 2), batches))
    a, b = ([line for lines in found for line in lines] for found in (first, second))
    return sum(x == y for x, y in zip(a, b, strict=True)), len(a)


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=200)
    args = parser.parse_args()
    heading("Same seed, same result")
    head("pairs", "the same to the byte", name="repeat")
    same, count = pairs(args.pairs)
    row(count, same)


if __name__ == "__main__":
    main()
