"""Lengths of hanging tethers against cables in a physics engine, with and without friction.

    python benchmarks/cable.py [--scenes hull comb …] [--keep]
    python benchmarks/cable.py --record [--seconds 200]

Each scene is flown twice in the order of the file: by the planner `predictive`, which keeps to the
tether, and by `none`, along the shortest paths, whatever becomes of the tether. A cable in MuJoCo
follows the same path, with each friction. `--record` writes its length at every stop and every
`SAMPLE` metres of every leg to `cable_lengths.json`; it may be interrupted, and goes on where it
was. Without it, the recorded lengths are compared with the bracket of the tether
(`netsp.world.tether.tether_bracket`), up to the error of the cable itself (`cable_forms.py`).
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from cable_rig import Cable, CableParams, cable_length
from sites import SITES, mission_of
from space import random_frame
from table import ROOT, head, heading, row

from netsp.base.geometry import polylines
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.run_bracket import shortest_of_class
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import simulate
from netsp.world.tether import GeodesicTether
from netsp.world.tether.load import turning
from netsp.world.tether.tether_bracket import BracketPolicy, HoldingTether

RECORDS = ROOT / "benchmarks" / "cable_lengths.json"
"""File of the recorded lengths."""

SAMPLE = 0.25
"""Distance between two comparisons on a leg, metres."""

ERROR_SHARE = 1e-3
"""Error of a cable as a share of its length (`cable_forms.py`)."""

ERROR_PER_RIGHT_ANGLE = 0.015
"""Error of a cable for each right angle by which the taut tether turns, metres
(`cable_forms.py`)."""

SPARE = 1.6
"""Ratio of the cable on the drum to the longest taut tether."""

SHORT = 1.0
"""Tethers that are shorter are not compared, metres: per cents of them say nothing."""

SCENES = ["ring", "comb", "frame 1", "hull"]

FRICTIONS = (0.0, 0.1, 0.2, 0.3)

FLIGHTS = {"predictive": "predictive", "no planner": "none"}
"""Planners by the name of their flights."""


def mission_named(name: str) -> tuple[Mission, Scene]:
    """Return a site of ours, or a random frame."""
    return mission_of(name) if name in SITES else random_frame(int(name.split()[1]))


def legs_flown(mission: Mission, scene: Scene, planner: str) -> list[np.ndarray]:
    """Return the legs that a planner flies; one that ignores the tether has an endless one."""
    if planner == "none":
        mission = mission.model_copy(update={"tether_length": 1e3})
    log = simulate(mission, planner, scene=scene).log
    places = np.array([(r.x, r.y, r.z) for r in log])
    turns = np.flatnonzero(np.diff([r.waypoint for r in log])) + 1
    cuts = [0, *turns, len(places) - 1]
    return [places[a : b + 1] for a, b in pairwise(cuts) if b > a]


def samples_of(legs: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the places at which lengths are compared (n, 3), and which of them are stops.

    The cable goes straight from place to place, as the taut tether that is compared with it does.
    """
    places, stops = [], []
    for leg in legs:
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(leg, axis=0), axis=1))])
        count = max(1, int(np.ceil(along[-1] / SAMPLE)))
        rows = np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], count + 1)[1:]))
        places.append(leg[np.minimum(rows, len(leg) - 1)])
        stops += [False] * (len(rows) - 1) + [True]
    return np.vstack(places), np.array(stops)


def taut_lengths(mission: Mission, scene: Scene, path: np.ndarray) -> np.ndarray:
    """Return the lengths of the taut tether along a path that begins at the anchor."""
    model = HoldingTether(scene.field(), mission.delta)
    return model.along(model.start(mission.anchor, mission.anchor), path).taut


def new_flight(name: str, kind: str) -> dict[str, Any]:
    """Return the record of a flight, without cables."""
    mission, scene = mission_named(name)
    legs = legs_flown(mission, scene, FLIGHTS[kind])
    places, stops = samples_of(legs)
    return {
        "scene": name,
        "path": kind,
        "start": legs[0][0].round(4).tolist(),
        "places": places.round(4).tolist(),
        "stops": np.flatnonzero(stops).tolist(),
        "cables": {},
    }


def cable_lengths(flight: dict[str, Any], friction: float) -> tuple[list[float], float]:
    """Return the length of a cable in the physics engine at each place, and the CPU seconds."""
    begin, params = time.process_time(), CableParams()
    mission, scene = mission_named(flight["scene"])
    field, places = scene.field(), np.array(flight["places"])
    path = np.vstack([mission.anchor, flight["start"], places])
    fine = polylines.dense(path, 0.5 * mission.delta)
    longest = float(taut_lengths(mission, scene, fine).max())
    cable, lengths, stops = (
        Cable(scene, mission.anchor, SPARE * longest + 1.0, friction, params),
        [],
        set(flight["stops"]),
    )
    cable.go(flight["start"])
    for k, place in enumerate(places):
        cable.go(place)
        cable.stay(params.settle_s if k in stops else params.pause_s)
        lengths.append(round(cable_length(field, cable.nodes(), params.max_depth), 4))
    return lengths, time.process_time() - begin


def recorded_flights() -> list[dict[str, Any]]:
    """Return the flights whose cables are recorded."""
    return list(json.loads(RECORDS.read_text(encoding="utf-8")).values())


def record(scenes: list[str], seconds: float) -> bool:
    """Record cables until the time is over; return whether all are recorded."""
    begin = time.monotonic()
    records = json.loads(RECORDS.read_text()) if RECORDS.exists() else {}
    for name in scenes:
        for kind in FLIGHTS:
            flight = records.get(f"{name}/{kind}") or new_flight(name, kind)
            first = records.get(f"{name}/{next(iter(FLIGHTS))}", flight)
            if flight is not first and flight["places"] == first["places"]:
                continue  # both planners fly the same path
            records[f"{name}/{kind}"] = flight
            for friction in FRICTIONS:
                if f"{friction:g}" in flight["cables"]:
                    continue
                if time.monotonic() - begin > seconds:
                    return False
                lengths, spent = cable_lengths(flight, friction)
                flight["cables"][f"{friction:g}"] = lengths
                text = ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in records.items())
                RECORDS.write_text("{\n" + text + "\n}\n")
                print(name, kind, friction, f"{spent:.0f} s", flush=True)
    return True


class Bracket(NamedTuple):
    """Bracket of a flight at its places, and the error of cables there, each (n,) in metres."""

    lower: np.ndarray
    taut: np.ndarray
    upper: np.ndarray
    error: np.ndarray
    cpu_s: float


def bracket_of(flight: dict[str, Any], *, has_words: bool = True) -> Bracket:
    """Return the bracket of the tether of a flight."""
    mission, scene = mission_named(flight["scene"])
    field = scene.field()
    model = HoldingTether(field, mission.delta, bracket=BracketPolicy())
    path, index, here = [], [], np.array(mission.anchor)
    for place in [flight["start"], *flight["places"]]:
        path += [*polylines.dense(np.vstack([here, place]), 0.5 * mission.delta)]
        index.append(len(path) - 1)
        here = np.array(place)
    at = np.array(index[1:])
    stops = [int(at[k]) for k in flight["stops"]]
    begin = time.process_time()
    tether, points = model.start(mission.anchor, mission.anchor), np.array(path)
    shorter = None
    if has_words:
        context = replace(PlanningContext.for_mission(mission, scene, field), model=model)
        shorter = shortest_of_class(context, tether, points, stops)
    found = model.along(tether, points, stops=stops, shorter=shorter)
    spent = time.process_time() - begin
    taut, turned, last = GeodesicTether(field, mission.delta), [], 0
    for k in at:
        tether = taut.drive(tether, points[last : k + 1])[0]
        turned.append(turning(tether, mission.delta))
        last = k + 1
    error = ERROR_SHARE * found.taut[at] + ERROR_PER_RIGHT_ANGLE * np.array(turned) / (0.5 * np.pi)
    return Bracket(found.lower[at], found.taut[at], found.upper[at], error, spent)


def beyond(bracket: Bracket, cable: np.ndarray, places: np.ndarray) -> tuple[float, float]:
    """Return by which shares cables leave the bracket at some places, above and below, up to the
    error of cables."""
    over = (cable - bracket.upper - bracket.error) / bracket.upper
    under = (bracket.lower - bracket.error - cable) / bracket.lower
    return tuple(max(0.0, float(v[places].max(initial=0.0))) for v in (over, under))


def compared(flight: dict[str, Any], *, has_words: bool = True) -> list[list[str]]:
    """Return the rows of a flight, one for each friction."""
    bracket, rows = bracket_of(flight, has_words=has_words), []
    lower, taut, upper = bracket.lower, bracket.taut, bracket.upper
    is_stop = np.isin(np.arange(len(taut)), flight["stops"])
    counts = taut > SHORT
    for friction, lengths in flight["cables"].items():
        cable = np.array(lengths)
        share, both = 100.0 * (cable / taut - 1.0), (is_stop & counts, ~is_stop & counts)
        share = share.round(1) + 0.0  # no minus zero
        cells = [f"{share[w].min(initial=0):.1f} to {share[w].max(initial=0):.1f}" for w in both]
        cells += [", ".join(f"{100.0 * v:.1f}" for v in beyond(bracket, cable, w)) for w in both]
        is_out = (cable > 1.01 * upper + bracket.error) | (cable < 0.99 * lower - bracket.error)
        rows.append([
            flight["scene"], flight["path"], friction, f"{taut.max():.2f}", f"{upper.max():.2f}",
            f"{cable.max():.2f}", *cells,
            f"{int((is_out & counts).sum())} of {int(counts.sum())}",
            f"{100.0 * float((upper > 1.01 * lower)[counts].mean()):.0f}",
            f"{taut[-1]:.2f}, {cable[-1]:.2f}, {upper[-1]:.2f}", f"{bracket.cpu_s:.1f}",
        ])  # fmt: skip
    return rows


def main() -> None:
    """Record cables, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="*", default=SCENES)
    parser.add_argument("--record", action="store_true", help="simulate cables not yet recorded")
    parser.add_argument("--seconds", type=float, default=np.inf, help="time limit of --record")
    args = parser.parse_args()
    if args.record:
        print("all recorded" if record(args.scenes, args.seconds) else "call again to go on")
        return
    heading("Hanging tethers against a physics engine")
    head("scene", "path", "friction", "longest taut m", "longest upper m", "longest cable m",
         "cable over taut at visits %", "on legs %",
         "beyond the bracket at visits, above and below %", "on legs, above and below %",
         "out by > 1 %", "bracket wider than 1 %, % of places",
         "left at home: taut, cable, upper m", "bracket CPU s", name="cable")  # fmt: skip
    for flight in recorded_flights():
        if flight["scene"] in args.scenes:
            for cells in compared(flight):
                row(*cells)


if __name__ == "__main__":
    main()
