"""Recorded flights of ArduSub's simulator against the times that netsp predicts.

python benchmarks/flown.py

Missions in AUTO, leg by leg, and the tour of the wharf from target to target in GUIDED, whose
targets were sent again every 2 s. The recordings are in `tests/data`.
"""

from __future__ import annotations

import csv
import gzip
import json
from dataclasses import dataclass

import numpy as np
from table import ROOT, head, heading, row

from netsp import Problem, Solution
from netsp.exchange.missions.export_policy import DEFAULT_EXPORT
from netsp.exchange.missions.leg_times import leg_times, target_times
from netsp.exchange.missions.mission_files import altitude, start_of
from netsp.exchange.missions.waypoints import waypoints_of
from netsp.plan.tour_plan import HOME, legs_of
from tests.autopilot import Earth
from tests.test_autopilot_recordings import log, track

DATA = ROOT / "tests" / "data"
MISSIONS = ("oc4-jacket", "pool", "r1", "r4", "wharf")
SPEED = 0.5
"""Speed of the recorded vehicles, m/s (WPNAV_SPEED)."""

CLASSES = ((0.0, 0.5), (0.5, 2.0), (2.0, 6.0), (6.0, np.inf))
"""Bounds of the length of legs that are counted together, m."""


@dataclass
class Flight:
    """Legs of a mission: their lengths, m, and their times with the hold at their end, s."""

    name: str
    lengths: np.ndarray
    flown: np.ndarray
    predicted: np.ndarray


def mission(name: str) -> Flight:
    """Return the legs of a mission of a tour, from arming to the last waypoint."""
    folder = DATA / "ardusub"
    own = folder / f"problem-{name}.json"
    problem = Problem.load(own if own.exists() else ROOT / "problems" / f"{name}.json")
    solution = Solution.load(folder / f"tour-{name}.json")
    points = waypoints_of(problem, solution)
    with gzip.open(folder / f"ardusub-{name}.csv.gz", "rt") as stream:
        rows = list(csv.DictReader(stream))
    times = [float(r["t"]) for r in rows[:1] + [r for r in rows if r["reached"]]]
    # these missions began with the way to the first goal, without a held start
    places = [start_of(problem, solution).position]
    places += [(*p.position[:2], altitude(p.position[2])) for p in points]
    holds = [0.0] + [
        1.0 if p.goal in (None, HOME) else DEFAULT_EXPORT.default_hold_s for p in points
    ]
    return _flight(name, places, holds, times)


def space_mission() -> Flight:
    """Return the legs of the mission in space, from its first waypoint on."""
    plan = json.loads(gzip.decompress((DATA / "ardusub47" / "e-m-basin.plan.gz").read_bytes()))
    said = [(m["t"], m["Message"]) for m in log("auto-space-basin")["MSG"]]
    reached = {int(text.split("#")[1]): t for t, text in said if text.startswith("Reached")}
    items = [
        (k, i["params"]) for k, i in enumerate(plan["mission"]["items"], 1) if i["command"] == 16
    ]
    earth = Earth(*plan["mission"]["plannedHomePosition"][:2])
    places = [(*earth.local(round(p[4] * 1e7), round(p[5] * 1e7)), p[6]) for _, p in items]
    return _flight("basin", places, [p[0] for _, p in items], [reached[k] for k, _ in items])


def _flight(name: str, places: list, holds: list[float], times: list[float]) -> Flight:
    lengths = np.linalg.norm(np.diff(np.array(places), axis=0), axis=1)
    return Flight(name, lengths, np.diff(times), np.array(leg_times(places, holds, SPEED)))


def flights() -> list[Flight]:
    return [*map(mission, MISSIONS), space_mission()]


def guided() -> tuple[float, float]:
    """Return the seconds of the tour of the wharf in GUIDED, predicted and flown."""
    problem = Problem.load(ROOT / "problems" / "wharf.json")
    solution = Solution.load(DATA / "ardusub47" / "t-wharf.json")
    path = np.vstack([leg.path for leg in legs_of(problem, solution)])
    places = [(float(x), float(y), altitude(float(z))) for x, y, z in path]
    rows = track("fly-wharf")
    late = rows[rows[:, 0] > 150.0]
    home = late[np.linalg.norm(late[:, 4:7] - places[-1], axis=1) <= 0.3][0, 0]
    return sum(target_times(places, 0.3, SPEED, notice_s=0.1, repeat_s=2.0)), home - 60.4


def ratios() -> list[float]:
    """Predicted over flown times of all recorded flights."""
    predicted, flown = guided()
    return [float(f.predicted.sum() / f.flown.sum()) for f in flights()] + [predicted / flown]


def main() -> None:
    """Print one row a flight, and one for the legs of about one length."""
    heading("Recorded flights")
    head("mission", "legs", "predicted s", "flown s", "ratio", "root mean square of a leg s",
         "worst leg s", name="flown")  # fmt: skip
    found = flights()
    for f in found:
        off = f.predicted - f.flown
        a, b = f.predicted.sum(), f.flown.sum()
        row(f.name, len(off), f"{a:.0f}", f"{b:.0f}", f"{a / b:.2f}",
            f"{np.sqrt((off**2).mean()):.1f}", f"{off[np.abs(off).argmax()]:+.1f}")  # fmt: skip
    a, b = guided()
    row("wharf in GUIDED", "", f"{a:.0f}", f"{b:.0f}", f"{a / b:.2f}", "", "")
    print()
    head("length of legs m", "legs", "predicted s", "flown s", "ratio", name="flown-legs")
    length, predicted, flown = (
        np.concatenate([getattr(f, k) for f in found]) for k in ("lengths", "predicted", "flown")
    )
    for low, high in CLASSES:
        of = (length >= low) & (length < high)
        a, b = predicted[of].sum(), flown[of].sum()
        name = f"{low:g} to {high:g}" if np.isfinite(high) else f"over {low:g}"
        row(name, int(of.sum()), f"{a:.0f}", f"{b:.0f}", f"{a / b:.2f}")
    print()


if __name__ == "__main__":
    main()
