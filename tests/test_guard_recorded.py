"""A guard on a recording of ArduSub's own simulator, against the true positions: it warns in time
of the loop that closes, and has the true class at every second."""

import csv
import gzip
from pathlib import Path

import numpy as np

from netsp import Problem
from netsp.hsignature import concatenate, crossings
from netsp.online.guard.alarms import Level
from netsp.online.guard.stream import replay_fixes
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard

ROOT = Path(__file__).parent
FLIGHT = ROOT / "data" / "ardusub47" / "guard-loops-wharf-true.csv.gz"
BEGIN, CLOSED, END = 50.54, 78.0, 100.0
"""Seconds: of the way, of the loop around A1 by an independent tracker of the rope, of the test."""


def test_a_loop_of_a_recorded_flight_is_warned_of_and_the_class_is_right_at_every_second():
    site = Problem.load(ROOT.parent / "problems" / "wharf.json")
    with gzip.open(FLIGHT, "rt") as file:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    rows = [row for row in rows if row["t"] <= END]
    fixes = [Fix(r["t"], (r["est_x"], r["est_y"], r["est_z"]), estimate=True) for r in rows]
    times, rays = np.array([r["t"] for r in rows]), site.representative_points
    true = np.array([[site.base[:2], *[(r["x"], r["y"]) for r in rows]]])[0]
    words = [()]
    for k in range(1, len(true)):
        words.append(concatenate(words[-1], crossings(true[k - 1 : k + 1], rays)))
    warned, compared = [], 0
    second = np.ceil(BEGIN)
    for report in replay_fixes(Guard(site), fixes):
        warned += [
            report.time for a in report.raised
            if a.kind == "loop-ahead" and a.level >= Level.WARNING and "A1" in a.text
        ]  # fmt: skip
        if report.time >= second:
            k = int(np.abs(times - report.time).argmin()) + 1
            way = crossings(np.array([report.position[:2], true[k]]), rays)
            assert concatenate(report.classes[0].word, way) == words[k], report.time
            second, compared = second + 1.0, compared + 1
        if CLOSED + 2.0 < report.time < CLOSED + 10.0:
            assert report.loops == (("A1",),)
    assert compared >= 48
    assert 8.0 < CLOSED - warned[0] < 20.0
