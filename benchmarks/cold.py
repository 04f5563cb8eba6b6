"""Measure the CPU seconds of first uses: all processes of a command, without compiled code.

    python benchmarks/cold.py [--runs 3] [--worlds 5] [WORDS …]

Only rows whose names contain one of the words are measured. Each run has its own cache folder
(`NUMBA_CACHE_DIR`), and the table shows medians. Limits refer to the reference machine
(`machine_speed.py`); on a slower one they are longer in proportion. The background process, which
compiles what the next command may need, is turned off. Bytecode of netsp exists, as after an
installation by pip; only the demo on a fresh machine starts without it. `claims/first_use.py`
measures the same rows for `make accept`.
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

from machine_speed import slowness
from table import head, row

ROOT = Path(__file__).resolve().parent.parent

GOAL_COUNTS = (5, 10, 15, 20)
"""Numbers of goals of the random worlds."""

DEVELOPER_VARIABLES = ("PYTHONPATH", "PYTHONDONTWRITEBYTECODE", "NUMBA_CACHE_DIR", "VIRTUAL_ENV")
"""Environment variables that a fresh machine does not set."""


@dataclass(frozen=True)
class FirstUse:
    """A command on a machine where nothing is compiled yet.

    Parameters
    ----------
    name : str
        Name of the row.
    max_cpu_s : float
        CPU seconds that the command may take on the reference machine.
    measure : callable
        Returns the CPU seconds of the command, given a folder to work in and an empty cache folder.
    """

    name: str
    max_cpu_s: float
    measure: Callable[[Path, Path], float]

    def cpu_s(self) -> float:
        """Return the CPU seconds of one run with its own cache folder."""
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as cache:
            return self.measure(Path(folder), Path(cache))


def spent_s(command: list[str], folder: Path, env: dict[str, str]) -> float:
    """Return the CPU seconds of a command, including processes that it waits for."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, env=env, cwd=folder, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def environment(**more: str) -> dict[str, str]:
    """Return the environment variables of a first use."""
    kept = {name: value for name, value in os.environ.items() if name not in DEVELOPER_VARIABLES}
    return kept | {"NETSP_BACKGROUND": "0"} | more


@functools.cache
def write_bytecode() -> None:
    """Write the bytecode of netsp, as an installation does."""
    compileall.compile_dir(ROOT / "netsp", quiet=2)


def cpu_s(folder: Path, cache: Path, *words: str | Path) -> float:
    """Return the CPU seconds of a netsp command."""
    write_bytecode()
    return spent_s(
        [sys.executable, "-m", "netsp", *map(str, words)], folder,
        environment(NUMBA_CACHE_DIR=str(cache), PYTHONPATH=str(ROOT)),
    )  # fmt: skip


def solve_cpu_s(problem: Path, folder: Path, cache: Path) -> float:
    """Return the CPU seconds of solving a problem."""
    return cpu_s(folder, cache, "solve", problem, "-o", "tour.json", "--time-limit", "120")


def demo_cpu_s(folder: Path, cache: Path) -> float:
    """Return the CPU seconds of `make demo` in a clean copy of the checkout.

    The demo creates an environment and installs netsp. Packages come from pip's cache where it has
    them.
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


def execute_cpu_s(folder: Path, cache: Path) -> float:
    """Return the CPU seconds of carrying out the tour of the wharf with the documented surprises.

    Solving the problem beforehand, with another cache folder, does not count.
    """
    wharf = ROOT / "problems" / "wharf.json"
    with tempfile.TemporaryDirectory() as other:
        solve_cpu_s(wharf, folder, Path(other))
    surprises = ROOT / "examples" / "surprises.json"
    return cpu_s(
        folder, cache, "execute", wharf, "tour.json", "--surprise", surprises, "-o", "run"
    )  # fmt: skip


def simulate_cpu_s(folder: Path, cache: Path) -> float:
    """Return the CPU seconds of simulating the mission of the basin."""
    return cpu_s(folder, cache, "simulate", ROOT / "missions" / "basin.json")


def warm_up_cpu_s(folder: Path, cache: Path) -> float:
    """Return the CPU seconds of compiling everything."""
    return cpu_s(folder, cache, "warm-up", "--quiet")


def limited_cpu_s(folder: Path, cache: Path) -> float:
    """Return the CPU seconds, compiling included, of a solve with 20,000 classes and a limit of two
    seconds on the reference machine."""
    maze, limit_s = ROOT / "problems" / "library" / "maze-30-0.json", 2.0 * slowness()
    return cpu_s(folder, cache, "solve", maze, "-o", "tour.json", "--time-limit", f"{limit_s:.2f}")


def random_cpu_s(goals: int, seed: int, folder: Path, cache: Path) -> float:
    """Return the CPU seconds of solving a random world with the tether of `netsp world`."""
    from netsp.plan.random_worlds import random_world

    problem = folder / "world.json"
    world = random_world(seed, goals=goals, tether_length=300.0)
    problem.write_text(json.dumps(json.loads(world.to_json())), encoding="utf-8")
    return solve_cpu_s(problem, folder, cache)


def first_uses(worlds: int) -> Iterator[FirstUse]:
    """Yield the first uses that `make accept` measures, the longest first.

    Parameters
    ----------
    worlds : int
        Random worlds for each number of goals.
    """
    yield FirstUse("make demo, installing included", 45.0, demo_cpu_s)
    yield FirstUse("execute with surprises", 15.0, execute_cpu_s)
    yield FirstUse("simulate missions/basin.json", 8.0, simulate_cpu_s)
    yield FirstUse("solve library/maze-30-0.json, --time-limit 2", 4.0, limited_cpu_s)
    for problem in sorted((ROOT / "problems").glob("*.json")):
        yield FirstUse(f"solve {problem.name}", 4.0, partial(solve_cpu_s, problem))
    for goals in GOAL_COUNTS:
        for seed in range(1, worlds + 1):
            yield FirstUse(
                f"solve a random world, {goals} goals, seed {seed}", 4.0,
                partial(random_cpu_s, goals, seed),
            )  # fmt: skip


def main() -> int:
    """Measure the first uses and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--worlds", type=int, default=5)
    parser.add_argument("words", nargs="*")
    args = parser.parse_args()
    head("command, from cold", "CPU s", "at most")
    is_good = True
    for use in (*first_uses(args.worlds), FirstUse("warm-up", 90.0, warm_up_cpu_s)):
        if args.words and not any(word in use.name for word in args.words):
            continue
        middle = statistics.median(use.cpu_s() for _ in range(args.runs))
        max_cpu_s = use.max_cpu_s * slowness()
        is_good = is_good and middle <= max_cpu_s
        row(use.name, f"{middle:.1f}", f"{max_cpu_s:.1f}")
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
