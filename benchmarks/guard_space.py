"""Planned missions in space, flown, with a guard beside: exact positions, and noise with drift.

python benchmarks/guard_space.py [--keep]
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np
from guard_tracks import DRIFT_S, DT, SPEED
from sites import SITES, mission_of, shipped
from table import head, heading, row

from netsp.online.guard.space_site import SpaceSite
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard, GuardOptions
from netsp.plan.space.mission_solver import solve_mission
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import LogRow
from netsp.world.simulator.mission_run import simulate


def beside_flight(
    mission: Mission, scene: Scene, log: Sequence[LogRow], noise: float, drift: float
) -> tuple[list[int], float, list[float], bool]:
    """Stops told as planned, otherwise and not at all, longest tether (m), updates (ms), and
    whether the end is free."""
    site = SpaceSite(mission, scene)
    guard = Guard(site, GuardOptions(max(noise, 0.02), max(drift, 0.02), SPEED))
    rng, off, longest, updates = np.random.default_rng(0), np.zeros(3), 0.0, []
    ends = np.array([stop.path[-1] for stop in site.mission.tour.stops])
    said: dict[int, set[bool | None]] = {}
    last = -math.inf
    for r in log:
        step = min(r.time - last, DRIFT_S)
        if step < 0.95 * DT:
            continue
        last, true = r.time, np.array([r.x, r.y, r.z])
        off[:2] += (
            drift * math.sqrt(2 * step / DRIFT_S) * rng.normal(size=2) - off[:2] * step / DRIFT_S
        )
        place = true + off + noise * rng.normal(size=3) * (1, 1, 0.2)
        begin = time.perf_counter()
        report = guard.update(Fix(r.time, tuple(place), estimate=True))
        updates.append(1e3 * (time.perf_counter() - begin))
        if report.classes:
            longest = max(longest, report.classes[0].taut)
        for k in np.flatnonzero(np.linalg.norm(ends - true, axis=1) <= mission.reach):
            said.setdefault(int(k), set()).add(report.as_planned)
    counts = [0, 0, 0]
    for k in range(len(ends)):
        answers = said.get(k, {None})
        counts[0 if True in answers else 1 if False in answers else 2] += 1
    free = report.classes[0].word == site.start_word() and not report.loops
    return counts, longest, updates, free


def main() -> None:
    heading("A guard beside missions that are flown")
    head("mission", "stops", "as planned, exact", "longest tether m, guard / flight",
         "free at home", "update ms, median / p99", "with noise: as planned", "otherwise",
         "not told",
         "update ms, median / p99 ", name="guard-space")  # fmt: skip
    for name in ("basin", "pipes", "jacket", "ring", "linked rings", "net pen"):
        mission, scene = mission_of(name) if name in SITES else shipped(name)
        found = solve_mission(mission, scene=scene)
        log = (found.run or simulate(found.mission, scene=scene)).log
        counts, longest, ms, free = beside_flight(found.mission, scene, log, 0.0, 0.0)
        noisy, _, slow, _ = beside_flight(found.mission, scene, log, 0.3, 0.5)
        row(name, str(sum(counts)), str(counts[0]),
            f"{longest:.2f} / {max(r.tether for r in log):.2f}", "yes" if free else "no",
            f"{np.median(ms):.1f} / {np.percentile(ms, 99):.1f}", *map(str, noisy),
            f"{np.median(slow):.1f} / {np.percentile(slow, 99):.1f}")  # fmt: skip
    print()


if __name__ == "__main__":
    main()
