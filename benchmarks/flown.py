"""Recorded flights of exported missions against the times that `netsp export` predicts.

python benchmarks/flown.py FOLDER
"""

from __future__ import annotations

import csv
import gzip
import sys
from pathlib import Path

from table import ROOT, head, heading, row

from netsp import Problem, Solution
from netsp.export.waypoints import waypoints_of
from netsp.export.write import Settings, predicted_s, start_of

SHIPPED = ("wharf", "pool", "oc4-jacket")


def flights(folder: Path) -> list[tuple[str, float, float]]:
    """(name, predicted, flown) seconds of every recorded flight, from arming to the last item."""
    out = []
    for tour in sorted(folder.glob("tour-*.json")):
        name = tour.stem.removeprefix("tour-")
        own = folder / f"problem-{name}.json"
        problem = Problem.load(own if own.exists() else ROOT / "problems" / f"{name}.json")
        solution = Solution.load(tour)
        points = [start_of(problem, solution), *waypoints_of(problem, solution)]
        with gzip.open(folder / f"ardusub-{name}.csv.gz", "rt") as stream:
            rows = list(csv.DictReader(stream))
        reached = [float(r["t"]) for r in rows if r["reached"]]
        # those missions began with the first goal's way, without a held start
        settings = Settings()
        predicted = (predicted_s(points, settings) or 0.0) - settings.bend
        out.append((name, predicted, reached[-1] - float(rows[0]["t"])))
    return out


def ratios(folder: Path) -> list[float]:
    """Predicted over flown times."""
    return [predicted / flown for _, predicted, flown in flights(folder)]


def main() -> None:
    """One row a flight."""
    heading("Recorded flights")
    head("mission", "predicted s", "flown s", "ratio", name="flown")
    for name, predicted, flown in flights(Path(sys.argv[1])):
        row(name, f"{predicted:.0f}", f"{flown:.0f}", f"{predicted / flown:.2f}")


if __name__ == "__main__":
    main()
