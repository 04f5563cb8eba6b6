"""Flights of the BlueROV2 at three speeds in six currents, at our sites and in random scenes.

    python benchmarks/currents.py [--missions ring comb …] [--flights FILE] [--limit 600] [--keep]

The flights are appended to a file as they end, and those that it has are not flown again;
`--limit` is the CPU time, s, after which no flight begins. A row counts the flights that have
ended.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import sites
from space import random_frame
from table import ROOT, head, heading, row

from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import simulate

SPEEDS = (0.5, 0.8, 1.0)
"""Cruise speeds, m/s."""

CURRENTS = (
    (0.0, 0.0, 0.0),
    (0.3, 0.0, 0.0),
    (0.0, -0.3, 0.0),
    (0.2, 0.2, 0.1),
    (-0.2, 0.15, -0.15),
    (0.0, 0.0, 0.3),
)
"""Velocities of the water, m/s."""

HELD_OUT = 2
"""Number of random scenes of each kind."""

SCENES = (ROOT / "tests" / "data", ROOT.parent / "shared" / "data" / "scenes")
"""Folders of scenes made by others; the second one may be absent."""

Flight = tuple[str, float, int]
"""Name of the mission, speed, and index of the current."""


def boulders(rng: np.random.Generator) -> sites.Site:
    """Return a floor with 24 boulders of 0.3 to 1.2 m; waypoints close above and between them."""
    solids: list[dict[str, Any]] = [sites.box((0, 0, -6.25), (16, 16, 0.5))]
    centers = np.column_stack([rng.uniform(-6, 6, (24, 2)), rng.uniform(-6.2, -5.4, 24)])
    for center, radius in zip(centers, rng.uniform(0.3, 1.2, 24), strict=True):
        solids.append({"sphere": {"center": center.tolist(), "radius": float(radius)}})
    points = np.column_stack([rng.uniform(-6, 6, (10, 2)), rng.uniform(-5.4, -4.4, 10)])
    return solids, (-9, -9, -6.5, 9, 9, 0), points, (-7, -7, -1)


def plates(rng: np.random.Generator) -> sites.Site:
    """Return plates in a row, 1.1 to 1.6 m apart, of random heights; a waypoint low beside each."""
    x = np.cumsum(rng.uniform(1.1, 1.6, 6))
    heights = rng.uniform(2.0, 4.5, 6)
    solids = [sites.box((a, 0, -6 + 0.5 * h), (0.2, 6, h)) for a, h in zip(x, heights, strict=True)]
    points = [(a + 0.55, y, -5.4) for a, y in zip(x, rng.uniform(-2.0, 2.0, 6), strict=True)]
    return solids, (-4, -7, -6.5, 13, 7, 0), np.array(points), (-2, 0, -0.5)


def leaning_poles(rng: np.random.Generator) -> sites.Site:
    """Return twelve poles that lean any way, with waypoints between them."""
    feet = rng.uniform(-5, 5, (12, 2))
    heads = feet + rng.uniform(-2, 2, feet.shape)
    solids = [sites.capsule((*f, -7), (*h, 0), 0.25) for f, h in zip(feet, heads, strict=True)]
    points = np.column_stack([rng.uniform(-5, 5, (10, 2)), rng.uniform(-6, -1, 10)])
    return solids, (-8, -8, -7, 8, 8, 0), points, (-7, -7, -0.5)


KINDS = {"boulders": boulders, "plates": plates, "poles": leaning_poles}


def mission_of(name: str) -> tuple[Mission, Scene]:
    """Return the mission of a name in `names`, and its scene."""
    kind, _, number = name.rpartition(" ")
    if kind in KINDS:
        return sites.tight_mission(name, *KINDS[kind](np.random.default_rng(int(number))))
    if kind == "frame":
        return random_frame(int(number))
    if name in sites.SITES:
        return sites.mission_of(name)
    for file in _others():
        if file.stem == name:
            mission = Mission.load(file)
            return mission, mission.load_scene()
    return sites.shipped(name)


def names() -> list[str]:
    """Return the names of all missions: our sites, shipped, by others, and random ones."""
    held_out = [f"{kind} {seed}" for seed in range(HELD_OUT) for kind in (*KINDS, "frame")]
    others = dict.fromkeys(file.stem for file in _others())
    return [*sites.SITES, "basin", "pipes", "jacket", *others, *held_out]


def _others() -> list[Path]:
    return [file for folder in SCENES for file in sorted(folder.glob("*-tight.json"))]


def flights(name: str) -> Iterator[Flight]:
    """Yield the flights of a mission: all speeds in all currents."""
    for speed in SPEEDS:
        for current in range(len(CURRENTS)):
            yield name, speed, current


def flown(mission: Mission, scene: Scene, speed: float, current: int) -> dict[str, Any]:
    """Fly a mission, and return the numbers by which the flight is judged."""
    begin = time.process_time()
    field = scene.field()
    changes = {"speed": speed, "current": CURRENTS[current]}
    run = simulate(mission.model_copy(update=changes), vehicle="bluerov2", scene=scene, field=field)
    s, places = run.summary, np.array([(r.x, r.y, r.z) for r in run.log])
    return {
        "name": mission.name, "speed": speed, "current": current,
        "visited": s["visited"], "waypoints": s["waypoints"],
        "home": s["home"]["reached"], "free": s["home"]["tether_free"],
        "over_s": s["exceedance_s"], "contacts": s["contacts"], "stalls": len(s["stalls"]),
        "left_out": s["left_out"], "clearance": mission.clearance,
        "nearest": float(field.distance(places).min()),
        "tether": s["longest_tether"] / s["tether_length"],
        "seconds": run.log[-1].time, "cpu_s": time.process_time() - begin,
    }  # fmt: skip


def is_good(flight: dict[str, Any]) -> bool:
    """Return whether a flight visited all, came home free, and was never over the limit."""
    complete = flight["visited"] == flight["waypoints"] and flight["home"] and flight["free"]
    return bool(complete and flight["over_s"] == 0.0)


def show(done: dict[Flight, dict[str, Any]], wanted: dict[str, list[Flight]]) -> None:
    """Print a row for each mission with a flight that has ended."""
    heading("The BlueROV2 at 0.5, 0.8 and 1.0 m/s in six currents")
    head("mission", "waypoints", "flights", "all visited", "home and free", "over s", "stalls",
         "contacts", "nearest to solids m", "clearance m", "flown s", "CPU s",
         name="currents")  # fmt: skip
    total: list[dict[str, Any]] = []
    for name, keys in wanted.items():
        group = [done[key] for key in keys if key in done]
        if group:
            total += group
            _show_row(name, group, len(keys))
    if total:
        _show_row("all", total, sum(len(keys) for keys in wanted.values()))


def _show_row(name: str, group: list[dict[str, Any]], wanted: int) -> None:
    points = group[0]["waypoints"] if name != "all" else ""
    row(
        name, points, f"{len(group)} of {wanted}",
        sum(f["visited"] == f["waypoints"] for f in group),
        sum(f["home"] and f["free"] for f in group), f"{sum(f['over_s'] for f in group):.1f}",
        sum(f["stalls"] for f in group), sum(f["contacts"] for f in group),
        f"{min(f['nearest'] for f in group):.2f}",
        f"{group[0]['clearance']:g}" if name != "all" else "",
        f"{sum(f['seconds'] for f in group):.0f}", f"{sum(f['cpu_s'] for f in group):.0f}",
    )  # fmt: skip


def main() -> None:
    """Fly the missions asked for that have not been flown yet, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--missions", nargs="*", default=names(), help="only these")
    parser.add_argument("--flights", type=Path, help="file of the flights so far, JSON lines")
    parser.add_argument("--limit", type=float, default=np.inf, help="begin no flight after, CPU s")
    args = parser.parse_args()
    done: dict[Flight, dict[str, Any]] = {}
    if args.flights is not None and args.flights.exists():
        for line in args.flights.read_text().splitlines():
            flight = json.loads(line)
            done[flight["key"][0], flight["key"][1], flight["key"][2]] = flight
    wanted: dict[str, list[Flight]] = {}
    for name in args.missions:
        wanted[name] = list(flights(name))
        missing = [key for key in wanted[name] if key not in done]
        if not missing or time.process_time() > args.limit:
            continue
        mission, scene = mission_of(name)
        for key in missing:
            if time.process_time() > args.limit:
                break
            done[key] = {"key": key, **flown(mission, scene, key[1], key[2])}
            if args.flights is not None:
                with args.flights.open("a") as file:
                    file.write(json.dumps(done[key]) + "\n")
    show(done, wanted)


if __name__ == "__main__":
    main()
