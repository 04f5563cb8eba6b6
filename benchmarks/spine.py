"""Times the spine: command start, the wharf, classes and legs of random worlds.

    python benchmarks/spine.py

Prints one markdown table; medians over the stated runs, in one process each where that matters.
"""

from __future__ import annotations

import datetime
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))


def command(*args: str, runs: int = 7) -> list[float]:
    """Wall seconds of a netsp command; the first run, which may compile, is not counted."""
    times = []
    for _ in range(runs + 1):
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-m", "netsp", *args], check=True, capture_output=True)
        times.append(time.perf_counter() - begin)
    return times[1:]


def roadmap(tether: float, goals: int = 20, worlds: int = 10) -> tuple[list[float], list[int]]:
    """Seconds for classes and all legs, and vertices, of random worlds with 20 circles."""
    from netsp.roadmap.taut import TautRoadmap
    from tests.worlds import random_world

    def build(seed: int) -> tuple[float, int]:
        problem = random_world(seed, goals=goals, tether=tether)
        begin = time.perf_counter()
        graph = TautRoadmap(problem).travel_graph()
        graph.costs  # noqa: B018
        return time.perf_counter() - begin, len(graph)

    build(0)
    rows = [build(seed) for seed in range(worlds)]
    return [t for t, _ in rows], [n for _, n in rows]


def row(name: str, values: list[float], note: str = "") -> None:
    """One line of the table."""
    print(
        f"| {name} | {statistics.median(values):.3f} | {min(values):.3f} | {max(values):.3f} "
        f"| {len(values)} | {note} |",
        flush=True,
    )


def main() -> None:
    """Run everything."""
    commit = subprocess.run(
        ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"],
        capture_output=True, text=True, check=False,
    ).stdout.strip()  # fmt: skip
    print(
        f"{datetime.date.today()}, commit {commit}, {os.cpu_count()} cores {platform.machine()}, "
        f"Python {platform.python_version()}\n"
    )
    print("| what | median s | min | max | runs | note |\n|---|---|---|---|---|---|")
    row("`netsp --help`", command("--help"))
    with tempfile.TemporaryDirectory() as folder:
        wharf = str(ROOT / "problems" / "wharf.json")
        row("`netsp solve problems/wharf.json`", command("solve", wharf, "-o", f"{folder}/s.json"))
        row("`netsp verify` of it", command("verify", wharf, f"{folder}/s.json"))
    for tether in (200.0, 250.0, 300.0, 350.0):
        times, sizes = roadmap(tether)
        note = f"{min(sizes)} to {max(sizes)} vertices"
        row(f"classes and legs, 20 circles, 20 goals, tether {tether:g}", times, note)


if __name__ == "__main__":
    main()
