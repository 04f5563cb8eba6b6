"""A guard on recordings of ArduSub's own simulator, against the true positions: lead of its
warnings before loops that closed, and the class at every second.

    python benchmarks/guard_recorded.py FOLDER [--noise 0.3] [--drift 0.5] [--only NAME] [--keep]

FOLDER has the recordings (`NAME.BIN.gz`, `NAME.tlog.gz`), their truths (`NAME-true.csv.gz`: t, x,
y, z in the site's frame) and the mission `m-basin.json`. The tests have the smaller of them
(`tests/data/ardusub47`). The true class is the word of the true path around the bare obstacles,
without a roadmap or a tether model. Both are compared where the robot truly is: the guard's word is
joined with the straight line from where it believes the robot to be.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import io
import json
import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from table import ROOT, head, heading, row

from netsp.hsignature import Word, concatenate, crossings
from netsp.model.problem import Problem
from netsp.online.guard.alarms import Level
from netsp.online.guard.guard_report import Report
from netsp.online.guard.replay import read_fixes
from netsp.online.guard.stream import replay_fixes
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard, GuardOptions
from netsp.online.link.geo_frame import Frame
from netsp.world.mission.mission import Mission

WARNED_S = 60.0
"""Time before a loop closes in which a warning counts for it, s."""

SURE = 0.05
"""Share from which on a class counts as one that the guard says to be possible."""


@dataclass(frozen=True)
class Flight:
    """Recorded flight, and what is known of it from its true positions.

    Attributes
    ----------
    name
        Of the files.
    site
        Name of the problem.
    begin, end
        Seconds of the vehicle's clock between which it was under way.
    loops
        Seconds at which the tether truly closed a loop around itself, by an independent tracker of
        the rope among the bare obstacles.
    lost
        Second at which its GPS was lost or moved; None for none.
    tether
        Length of the tether, m, in place of the problem's; None for the problem's.
    """

    name: str
    site: str
    begin: float
    end: float
    loops: tuple[float, ...] = ()
    lost: float | None = None
    tether: float | None = None


FLIGHTS = (
    Flight("fly-wharf", "wharf", 60.40, 200.30),
    Flight("guard-loops-wharf", "wharf", 50.54, 197.50, (78.0, 161.4)),
    Flight("guard-loops-wharf", "wharf", 50.54, 197.50, (78.0, 161.4), tether=30.0),
    Flight("pilot-wharf", "wharf", 48.60, 167.70, (90.3,)),
    Flight("gps-lost-pool", "pool", 57.20, 88.30, lost=77.3),
    Flight("gps-jump-pool", "pool", 76.26, 109.10, lost=96.3),
)
"""The loop of guard-loops-wharf at 96.4 s undoes the one before, so that no warning is due. On
purpose it goes farther than the problem's tether of 20 m reaches; it is watched with 30 m, too."""


@dataclass
class Outcome:
    """Result of a guard on the recording of a flight.

    Attributes
    ----------
    leads
        Seconds from the last warning before each loop to the loop; None where there was none.
    seconds, likeliest, possible, silent
        Seconds compared; of these, with the true class as the likeliest, among the possible, and
        with no claim at all.
    warnings
        Warnings of loops in all.
    noticed
        Seconds from the loss of the GPS to the alarm; None for none.
    longest
        Longest taut tether of the likeliest class, m.
    """

    leads: list[float | None]
    seconds: int = 0
    likeliest: int = 0
    possible: int = 0
    silent: int = 0
    warnings: int = 0
    noticed: float | None = None
    longest: float = 0.0


def table_of(file: Path) -> dict[str, np.ndarray]:
    """Read a table of numbers by the names of its columns."""
    rows = list(csv.reader(io.StringIO(gzip.decompress(file.read_bytes()).decode())))
    values = np.array(rows[1:], dtype=float)
    return {name: values[:, k] for k, name in enumerate(rows[0])}


def true_words(
    problem: Problem, truth: dict[str, np.ndarray]
) -> Iterator[tuple[float, Word, np.ndarray]]:
    """Yield time, word of the tether and place for each true position."""
    rays = problem.representative_points
    places = np.column_stack([truth["x"], truth["y"]])
    word = crossings(np.array([problem.base[:2], places[0]]), rays)
    yield float(truth["t"][0]), word, places[0]
    for k in range(1, len(places)):
        word = concatenate(word, crossings(places[k - 1 : k + 1], rays))
        yield float(truth["t"][k]), word, places[k]


def fixes_of(file: Path, frame: Frame) -> list[Fix]:
    """Read the fixes of a packed recording."""
    kind = file.suffixes[-2].lower()
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / f"flight{kind}"
        plain.write_bytes(gzip.decompress(file.read_bytes()))
        return list(read_fixes(plain, frame))


def watched(
    flight: Flight, problem: Problem, fixes: list[Fix], truth: dict[str, np.ndarray],
    options: GuardOptions,
) -> Outcome:  # fmt: skip
    """Return what a guard says of a flight, against the truth."""
    known = list(true_words(problem, truth))
    times = np.array([t for t, _, _ in known])
    rays = problem.representative_points
    out = Outcome([None] * len(flight.loops))
    second = math.ceil(flight.begin)
    last: Report | None = None
    for report in replay_fixes(Guard(problem, options), fixes):
        if report.time > flight.end + 1.0:
            break
        for alarm in report.raised:
            if alarm.kind == "loop-ahead" and alarm.level >= Level.WARNING:
                out.warnings += 1
                for k, closed in enumerate(flight.loops):
                    lead = closed - report.time
                    if 0.0 <= lead <= WARNED_S:
                        out.leads[k] = lead
            is_after = flight.lost is not None and report.time >= flight.lost
            if is_after and alarm.kind == "position" and out.noticed is None:
                assert flight.lost is not None
                out.noticed = report.time - flight.lost
        while second <= min(report.time, flight.end):
            _, true, place = known[int(np.abs(times - second).argmin())]
            out.seconds += 1
            if last is None or not last.classes:
                out.silent += 1
            else:
                assert last.position is not None
                way = crossings(np.array([last.position[:2], place]), rays)
                is_true = [concatenate(c.word, way) == true for c in last.classes]
                out.likeliest += is_true[0]
                out.possible += any(
                    good and c.likely >= SURE for good, c in zip(is_true, last.classes, strict=True)
                )
            second += 1
        last = report
        if report.classes:
            out.longest = max(out.longest, report.classes[0].taut)
    return out


def mission_row(folder: Path, options: GuardOptions) -> None:
    """Print what a guard says of the flight of a mission in space."""
    data = json.loads((folder / "m-basin.json").read_text())
    data["scene"] = str(ROOT / "scenes" / "basin.json")
    mission = Mission.model_validate(data)
    fixes = fixes_of(folder / "auto-space-basin.BIN.gz", Frame(mission))
    told = as_planned = 0
    longest, last = 0.0, None
    for report in replay_fixes(Guard(mission, options), fixes):
        if report.as_planned is not None:
            told += 1
            as_planned += report.as_planned
        if report.classes:
            longest, last = max(longest, report.classes[0].taut), report
    free = last is not None and not last.loops and last.classes[0].word == ()
    row(
        "auto-space-basin", "BIN", "", "", f"{as_planned} of {told} reports at visits", "", "", "",
        f"{longest:.2f} of {mission.tether_length:g}", "free at the end" if free else "not free",
    )  # fmt: skip


def main() -> int:
    """Print the table."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("folder", type=Path)
    p.add_argument("--noise", type=float, default=0.3)
    p.add_argument("--drift", type=float, default=0.5)
    p.add_argument("--only", default="")
    args = p.parse_args()
    options = GuardOptions(args.noise, args.drift)
    heading(f"A guard on recordings (noise {args.noise:g} m, drift {args.drift:g} m)")
    head(
        "flight", "recording", "loops", "lead of the warnings s", "true class likeliest, of s",
        "possible", "no claim", "warnings", "longest tether m", "lost GPS",
        name="guard-recorded",
    )  # fmt: skip
    for flight in FLIGHTS:
        if args.only not in flight.name:
            continue
        problem = Problem.load(ROOT / "problems" / f"{flight.site}.json")
        if flight.tether is not None:
            problem = problem.model_copy(update={"tether_length": flight.tether})
        for kind in ("BIN", "tlog"):
            file, truth = (
                args.folder / f"{flight.name}.{kind}.gz",
                args.folder / f"{flight.name}-true.csv.gz",
            )
            if not file.exists() or not truth.exists():
                continue
            out = watched(flight, problem, fixes_of(file, Frame(problem)), table_of(truth), options)
            row(
                flight.name, kind, len(flight.loops),
                ", ".join("none" if x is None else f"{x:.1f}" for x in out.leads),
                f"{out.likeliest} of {out.seconds - out.silent}", out.possible, out.silent,
                out.warnings, f"{out.longest:.2f} of {problem.tether_length:g}",
                "" if flight.lost is None
                else "not noticed" if out.noticed is None else f"after {out.noticed:.1f} s",
            )  # fmt: skip
    if args.only in "auto-space-basin" and (args.folder / "m-basin.json").exists():
        mission_row(args.folder, options)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
