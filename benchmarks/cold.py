"""Measure the CPU seconds of first uses: all processes of a command, with an empty cache.

    python benchmarks/cold.py [--runs 3] [WORDS …]

Only rows whose names contain one of the words are measured. Each run has a cache folder of its own
(`NUMBA_CACHE_DIR`), and the table shows medians. Processes that go on in the background after a
command has ended are turned off; they compile what the next command may need.

The demo is measured in the environment of this script; the time to install is not counted.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from table import head, row

ROOT = Path(__file__).resolve().parent.parent

WORLDS = 5
"""Random worlds of each number of goals that are solved from cold."""

GOALS = (5, 10, 15, 20)
"""Numbers of goals of the random worlds."""


def cpu_s(folder: Path, cache: Path, *words: str | Path) -> float:
    """Return the CPU seconds of a netsp command and of the processes that it waits for."""
    env = dict(os.environ) | {
        "NUMBA_CACHE_DIR": str(cache), "NETSP_BACKGROUND": "0", "PYTHONPATH": str(ROOT),
    }  # fmt: skip
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-m", "netsp", *map(str, words)], env=env, cwd=folder,
        capture_output=True, text=True,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(f"netsp {' '.join(map(str, words))}: {done.stderr}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def solved(problem: Path, folder: Path, cache: Path) -> float:
    """Solve a problem."""
    return cpu_s(folder, cache, "solve", problem, "-o", "tour.json", "--time-limit", "120")


def demo(folder: Path, cache: Path) -> float:
    """Solve, draw and verify the wharf."""
    wharf = ROOT / "problems" / "wharf.json"
    return cpu_s(
        folder, cache, "solve", wharf, "-o", "tour.json", "--plot", "tour.png"
    ) + cpu_s(folder, cache, "verify", wharf, "tour.json")  # fmt: skip


def executed(folder: Path, cache: Path) -> float:
    """Carry out the tour of the wharf with the documented surprises, which is solved before, in a
    cache of its own."""
    wharf = ROOT / "problems" / "wharf.json"
    with tempfile.TemporaryDirectory() as other:
        solved(wharf, folder, Path(other))
    surprises = ROOT / "examples" / "surprises.json"
    return cpu_s(
        folder, cache, "execute", wharf, "tour.json", "--surprise", surprises, "-o", "run"
    )  # fmt: skip


def simulated(folder: Path, cache: Path) -> float:
    """Simulate the mission of the basin."""
    return cpu_s(folder, cache, "simulate", ROOT / "missions" / "basin.json")


def warmed_up(folder: Path, cache: Path) -> float:
    """Compile everything."""
    return cpu_s(folder, cache, "warm-up", "--quiet")


def random_problem(goals: int, seed: int, folder: Path, cache: Path) -> float:
    """Solve a random world."""
    from netsp.worlds import random_world

    problem = folder / "world.json"
    world = random_world(seed, goals=goals, tether_length=250.0)
    problem.write_text(json.dumps(json.loads(world.to_json())), encoding="utf-8")
    return solved(problem, folder, cache)


def rows() -> Iterator[tuple[str, float, Callable[[Path, Path], float]]]:
    """Yield the name of each row, the CPU seconds asked, and what measures it."""
    yield "demo, without installing", 45.0, demo
    for problem in sorted((ROOT / "problems").glob("*.json")):
        yield f"solve {problem.name}", 4.0, partial(solved, problem)
    for goals in GOALS:
        for seed in range(1, WORLDS + 1):
            yield (
                f"solve a random world, {goals} goals, seed {seed}", 4.0,
                partial(random_problem, goals, seed),
            )  # fmt: skip
    yield "execute with surprises", 15.0, executed
    yield "simulate missions/basin.json", 8.0, simulated
    yield "warm-up", 90.0, warmed_up


def main() -> int:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("words", nargs="*")
    args = parser.parse_args()
    head("command, from cold", "CPU s", "asked")
    is_good = True
    for name, asked_s, measure in rows():
        if args.words and not any(word in name for word in args.words):
            continue
        spent = []
        for _ in range(args.runs):
            with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as cache:
                spent.append(measure(Path(folder), Path(cache)))
        middle = statistics.median(spent)
        is_good = is_good and middle <= asked_s
        row(name, f"{middle:.1f}", f"{asked_s:g}")
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
