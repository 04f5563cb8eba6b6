"""Lengths of hanging tethers against cables in a physics engine, with and without friction.

    python benchmarks/cable.py [--scenes hull comb …] [--frictions 0 0.3] [--keep] [--store FILE]

Each scene is flown twice in the order of the file: by the planner `predictive`, which keeps to the
tether, and by `none`, along the shortest paths, whatever becomes of the tether. A cable in MuJoCo
follows the same path, with each friction, and its length is compared with the bracket of the tether
(`netsp.world.tether.tether_bracket`) at every stop and every `SAMPLE` metres of every leg. MuJoCo
comes with `pip install 'netsp[bench]'`.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from cable_rig import Cable, CableParams, cable_length
from sites import SITES, mission_of
from space import random_frame
from table import head, heading, row

from netsp.base.geometry import polylines
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.run_bracket import shortest_of_class
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.scene.field import DistanceField
from netsp.world.simulator.mission_run import simulate
from netsp.world.tether.tether_bracket import BracketPolicy, HoldingTether

SAMPLE = 0.25
"""Distance between two comparisons on a leg, metres."""

PAUSE_S = 0.3
"""Time that the robot waits before a comparison on a leg, s: the cable follows the robot."""

SPARE = 2.0
"""Ratio of the cable on the drum to the longest taut tether."""

SHORT = 1.0
"""Tethers that are shorter are not compared, metres: per cents of them say nothing."""

SCENES = ["hull", "comb", "ring", "frame 1", "frame 3"]


def mission_named(name: str) -> tuple[Mission, Scene]:
    """Return a site of ours, or a random frame."""
    return mission_of(name) if name in SITES else random_frame(int(name.split()[1]))


FLIGHTS = {"predictive": "predictive", "no planner": "none"}
"""Planners by the name of their flights."""


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
    """Return the places at which lengths are compared (n, 3), and which of them are stops."""
    places, stops = [], []
    for leg in legs:
        points = polylines.dense(leg, SAMPLE)
        if len(points):
            places.append(points)
            stops += [False] * (len(points) - 1) + [True]
    return np.vstack(places), np.array(stops)


def cable_lengths(
    scene: Scene, field: DistanceField, start: np.ndarray, anchor: Any, places: np.ndarray,
    stops: np.ndarray, longest: float, friction: float,
) -> np.ndarray:  # fmt: skip
    """Return the length of a cable in the physics engine at each place."""
    params = CableParams()
    cable, lengths = Cable(scene, anchor, longest, friction, params), []
    cable.go(start)
    for place, is_stop in zip(places, stops, strict=True):
        cable.go(place)
        cable.stay(params.settle_s if is_stop else PAUSE_S)
        lengths.append(cable_length(field, cable.nodes()))
    return np.array(lengths)


def compared(name: str, kind: str, frictions: list[float]) -> list[list[str]]:
    """Return the rows of a flight in a scene."""
    mission, scene = mission_named(name)
    field, rows = scene.field(), []
    model = HoldingTether(field, mission.delta, bracket=BracketPolicy())
    context = replace(PlanningContext.for_mission(mission, scene, field), model=model)
    legs = legs_flown(mission, scene, FLIGHTS[kind])
    places, stops = samples_of(legs)
    fine, at, here = [], [], legs[0][0]
    for place in places:
        fine += [*polylines.dense(np.vstack([here, place]), 0.5 * mission.delta)]
        at.append(len(fine) - 1)
        here = place
    tether = model.drive(
        model.start(mission.anchor, mission.anchor),
        polylines.dense(np.vstack([mission.anchor, legs[0][0]]), mission.delta),
    )[0]
    index = np.array(at)
    begin = time.process_time()
    path = np.array(fine)
    shorter = shortest_of_class(context, tether, path, list(index[stops]))
    found = model.along(tether, path, stops=list(index[stops]), shorter=shorter)
    spent = time.process_time() - begin
    lower, taut, upper = found.lower[index], found.taut[index], found.upper[index]
    counts = taut > SHORT
    for friction in frictions:
        cable = cable_lengths(
            scene, field, legs[0][0], mission.anchor, places, stops,
            SPARE * float(taut.max()), friction,
        )  # fmt: skip

        def worst(where: np.ndarray, cable=cable, reference=taut) -> str:
            share = 100.0 * (cable / reference - 1.0)[where]
            return f"{share.max(initial=0.0):.1f}, {share.min(initial=0.0):.1f}"

        def beyond(where: np.ndarray, cable=cable, lower=lower, upper=upper) -> str:
            over = max(0.0, float((cable / upper - 1.0)[where].max(initial=0.0)))
            under = max(0.0, float((1.0 - cable / lower)[where].max(initial=0.0)))
            return f"{100 * over:.1f}, {100 * under:.1f}"

        is_out = (cable > 1.01 * upper) | (cable < 0.99 * lower)
        rows.append([
            name, kind, f"{friction:g}", f"{taut.max():.2f}", f"{upper.max():.2f}",
            f"{cable.max():.2f}", worst(stops & counts), worst(~stops & counts),
            beyond(stops & counts), beyond(~stops & counts),
            f"{int((is_out & counts).sum())} of {int(counts.sum())}",
            f"{taut[-1]:.2f}, {cable[-1]:.2f}, {upper[-1]:.2f}", f"{spent:.0f}",
        ])  # fmt: skip
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="*", default=SCENES)
    parser.add_argument("--frictions", nargs="*", type=float, default=[0.0, 0.1, 0.2, 0.3])
    parser.add_argument("--flights", nargs="*", default=list(FLIGHTS), choices=FLIGHTS)
    parser.add_argument("--store", type=Path, help="file of rows to resume from")
    args = parser.parse_args()
    done = json.loads(args.store.read_text()) if args.store and args.store.exists() else {}
    heading("Hanging tethers against a physics engine")
    head("scene", "path", "friction", "longest taut m", "longest upper m", "longest cable m",
         "cable over taut at stops, most and least %", "on legs %",
         "beyond the bracket at stops, above and below %", "on legs, above and below %",
         "out by > 1 %", "left at home: taut, cable, upper m", "bracket CPU s",
         name="cable")  # fmt: skip
    for name in args.scenes:
        for kind in args.flights:
            key = f"{name}/{kind}"
            if key not in done:
                done[key] = compared(name, kind, args.frictions)
                if args.store:
                    args.store.write_text(json.dumps(done))
            for cells in done[key]:
                row(*cells)


if __name__ == "__main__":
    main()
