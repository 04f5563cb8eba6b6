"""A guard beside three recorded flights, over and over for an hour: how long an update takes, and
whether memory grows.

    python benchmarks/guard_hour.py [--jobs 2] [--keep]
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from guard_tracks import DRIFT, DT, NOISE, SHIPPED, SPEED, drifted, recorded
from table import head, heading, row

from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard, GuardOptions


def resident() -> float:
    """MiB of this process."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20


def hour(jobs: int) -> None:
    """A recorded flight over and over for an hour at ten a second, with noise and drift, each
    update told as a line of JSON; every flight in a process of its own."""
    head("flight", "updates", "update ms, median / p99 / worst", "path home with it, ms",
         "MiB after 6 min", "after 60 min", name="guard-hour")  # fmt: skip
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, max_tasks_per_child=1, mp_context=spawn) as pool:
        for cells in pool.map(hour_of, SHIPPED):
            row(*cells)
    print()


def hour_of(name: str) -> list[str]:
    """The cells of one flight."""
    problem, true = recorded(name)
    guard, rng = Guard(problem, GuardOptions(NOISE, DRIFT, SPEED)), np.random.default_rng(0)
    begin, updates, home, early, count = np.zeros(2), [], [], 0.0, 0
    while count < 36_000:
        for place in drifted(true, rng, begin):
            began = time.perf_counter()
            report = guard.update(Fix(count * DT, tuple(place), estimate=True))
            updates.append(1e3 * (time.perf_counter() - began))
            began = time.perf_counter()
            json.dumps(report.as_row())
            home.append(1e3 * (time.perf_counter() - began))
            count += 1
            if count == 3_600:
                early = resident()
    ms = np.array(updates)
    return [
        name, str(count), f"{np.median(ms):.1f} / {np.percentile(ms, 99):.1f} / {ms.max():.0f}",
        f"{np.percentile(home, 99):.2f}", f"{early:.0f}", f"{resident():.0f}",
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    heading("A guard over an hour")
    hour(args.jobs)


if __name__ == "__main__":
    main()
