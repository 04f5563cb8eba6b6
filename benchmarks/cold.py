"""Measure the CPU seconds of first uses: all processes of a command, with an empty cache.

    python benchmarks/cold.py [--runs 3] [--worlds 5] [WORDS …]

Only rows whose names contain one of the words are measured. Each run has a cache folder of its own
(`NUMBA_CACHE_DIR`), and the table shows medians. The process in the background, which compiles what
the next command may need, is turned off. Bytecode of netsp is there, as pip leaves it; only the
demo on a fresh machine has none. `claims/first_use.py` measures the same rows in the gate.
"""

from __future__ import annotations

import argparse
import compileall
import functools
import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from table import head, row

ROOT = Path(__file__).resolve().parent.parent

GOALS = (5, 10, 15, 20)
"""Numbers of goals of the random worlds."""

OF_THIS_PROCESS = ("PYTHONPATH", "PYTHONDONTWRITEBYTECODE", "NUMBA_CACHE_DIR", "VIRTUAL_ENV")
"""Environment variables that a fresh machine does not set."""


@dataclass(frozen=True)
class FirstUse:
    """A command on a machine where nothing was compiled.

    Parameters
    ----------
    name : str
        Name of the row.
    asked_s : float
        CPU seconds that it may take.
    measure : callable
        Returns its CPU seconds, given a folder to work in and an empty cache folder.
    """

    name: str
    asked_s: float
    measure: Callable[[Path, Path], float]

    def cpu_s(self) -> float:
        """Return the CPU seconds of one run with a cache of its own."""
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as cache:
            return self.measure(Path(folder), Path(cache))


def spent_s(command: list[str], folder: Path, env: dict[str, str]) -> float:
    """Return the CPU seconds of a command and of the processes that it waits for."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, env=env, cwd=folder, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def environment(**more: str) -> dict[str, str]:
    """Return the environment variables of a first use."""
    kept = {name: value for name, value in os.environ.items() if name not in OF_THIS_PROCESS}
    return kept | {"NETSP_BACKGROUND": "0"} | more


@functools.cache
def write_bytecode() -> None:
    """Write the bytecode of netsp, as installing it does."""
    compileall.compile_dir(ROOT / "netsp", quiet=2)


def cpu_s(folder: Path, cache: Path, *words: str | Path) -> float:
    """Return the CPU seconds of a netsp command."""
    write_bytecode()
    return spent_s(
        [sys.executable, "-m", "netsp", *map(str, words)], folder,
        environment(NUMBA_CACHE_DIR=str(cache), PYTHONPATH=str(ROOT)),
    )  # fmt: skip


def solved(problem: Path, folder: Path, cache: Path) -> float:
    """Solve a problem."""
    return cpu_s(folder, cache, "solve", problem, "-o", "tour.json", "--time-limit", "120")


def fresh_demo(folder: Path, cache: Path) -> float:
    """Run `make demo` in a clean copy of the checkout: it makes an environment and installs netsp.

    Packages come from pip's cache where they were installed before.
    """
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in names.split("\0"):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
    python = getattr(sys, "_base_executable", sys.executable)
    return spent_s(
        ["make", "demo", f"PYTHON={python}"], folder, environment(NUMBA_CACHE_DIR=str(cache))
    )


def executed(folder: Path, cache: Path) -> float:
    """Carry out the tour of the wharf with the documented surprises; it is solved before, in a
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


def limited(folder: Path, cache: Path) -> float:
    """Solve a problem with 20,000 classes within two seconds, which compiling counts into."""
    maze = ROOT / "problems" / "library" / "maze-30-0.json"
    return cpu_s(folder, cache, "solve", maze, "-o", "tour.json", "--time-limit", "2")


def random_problem(goals: int, seed: int, folder: Path, cache: Path) -> float:
    """Solve a random world."""
    from netsp.worlds import random_world

    problem = folder / "world.json"
    world = random_world(seed, goals=goals, tether_length=250.0)
    problem.write_text(json.dumps(json.loads(world.to_json())), encoding="utf-8")
    return solved(problem, folder, cache)


def first_tours(worlds: int) -> Iterator[FirstUse]:
    """Yield the first uses of the gate, the longest first.

    Parameters
    ----------
    worlds : int
        Random worlds of each number of goals.
    """
    yield FirstUse("make demo, installing included", 45.0, fresh_demo)
    yield FirstUse("execute with surprises", 15.0, executed)
    yield FirstUse("simulate missions/basin.json", 8.0, simulated)
    yield FirstUse("solve library/maze-30-0.json, --time-limit 2", 4.0, limited)
    for problem in sorted((ROOT / "problems").glob("*.json")):
        yield FirstUse(f"solve {problem.name}", 4.0, partial(solved, problem))
    for goals in GOALS:
        for seed in range(1, worlds + 1):
            yield FirstUse(
                f"solve a random world, {goals} goals, seed {seed}", 4.0,
                partial(random_problem, goals, seed),
            )  # fmt: skip


def main() -> int:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--worlds", type=int, default=5)
    parser.add_argument("words", nargs="*")
    args = parser.parse_args()
    head("command, from cold", "CPU s", "asked")
    is_good = True
    for use in (*first_tours(args.worlds), FirstUse("warm-up", 90.0, warmed_up)):
        if args.words and not any(word in use.name for word in args.words):
            continue
        middle = statistics.median(use.cpu_s() for _ in range(args.runs))
        is_good = is_good and middle <= use.asked_s
        row(use.name, f"{middle:.1f}", f"{use.asked_s:g}")
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
