"""Times the spine: command start, the wharf, classes and legs of random worlds.

    python benchmarks/spine.py

Prints one markdown table; medians over the stated runs, in one process each where that matters.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time

from table import ROOT, head, heading, row


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
        graph = TautRoadmap(problem).to_travel_graph()
        graph.costs  # noqa: B018
        return time.perf_counter() - begin, len(graph)

    build(0)
    rows = [build(seed) for seed in range(worlds)]
    return [t for t, _ in rows], [n for _, n in rows]


def times_row(name: str, values: list[float], note: str = "") -> None:
    """One line of the table."""
    low, high = min(values), max(values)
    row(name, f"{statistics.median(values):.3f}", f"{low:.3f}", f"{high:.3f}", len(values), note)


def main() -> None:
    """Run everything."""
    heading("The spine")
    head("what", "median s", "min", "max", "samples", "note")
    times_row("`netsp --help`", command("--help"))
    with tempfile.TemporaryDirectory() as folder:
        wharf = str(ROOT / "problems" / "wharf.json")
        times_row(
            "`netsp solve problems/wharf.json`", command("solve", wharf, "-o", f"{folder}/s.json")
        )
        times_row("`netsp verify` of it", command("verify", wharf, f"{folder}/s.json"))
    for tether in (200.0, 250.0, 300.0, 350.0):
        times, sizes = roadmap(tether)
        note = f"{min(sizes)} to {max(sizes)} vertices"
        times_row(f"classes and legs, 20 circles, 20 goals, tether {tether:g}", times, note)


if __name__ == "__main__":
    main()
