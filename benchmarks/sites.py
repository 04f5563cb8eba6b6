"""Sites of our own, each inspected by every planner (by the BlueROV2: `currents.py`).

    python benchmarks/sites.py [--sites jetty ring …] [--quick] [--react] [--keep]

The tether of each is a tenth longer than the longest of the shortest tethers to its waypoints, so
that no waypoint is out of reach and none may be gone to by any other class without a price. The
shipped missions are flown beside them.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from table import ROOT, head, heading, row

from netsp.base.geometry import polylines
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.paths.tree import ShortestTree, pull_taut
from netsp.world.scene.field import pushed_out
from netsp.world.simulator.mission_run import mission_grid, simulate

SHARE = 1.1
"""Tether over the longest of the shortest."""

ENOUGH = 1.01
"""Over the longest that a planner has out that ignores the tether: so much it needs."""

CURRENT = (0.25, 0.15, 0.0)
"""0.3 m/s, for the BlueROV2."""

Site = tuple[list[dict[str, Any]], tuple[float, ...], np.ndarray, tuple[float, ...]]
"""Solids, bounds, waypoints (n, 3), anchor."""


def capsule(a, b, radius: float) -> dict[str, Any]:
    """A solid."""
    return {"capsule": {"a": list(map(float, a)), "b": list(map(float, b)), "radius": radius}}


def box(center, size, turned: float = 0.0) -> dict[str, Any]:
    """A solid, turned about z, degrees."""
    return {"box": {"center": list(center), "size": list(size), "rotation": [0, 0, turned]}}


def about(center, radius: float, count: int, height: float = 0.0) -> np.ndarray:
    """(count, 3) points around an upright axis, climbing."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    x, y, z = center
    return np.column_stack(
        [x + radius * np.cos(angle), y + radius * np.sin(angle),
         z + height * np.arange(count) / count]
    )  # fmt: skip


def jetty() -> Site:
    """Twelve piles in two rows, with braces across and along."""
    piles = [(4.0 * i, 4.0 * j) for j in range(2) for i in range(6)]
    solids = [capsule((x, y, -9), (x, y, 1), 0.4) for x, y in piles]
    for i in range(6):
        solids += [capsule((4 * i, 0, -2), (4 * i, 4, -6), 0.15),
                   capsule((4 * i, 0, -6), (4 * i, 4, -2), 0.15)]  # fmt: skip
    for j in range(2):
        solids += [capsule((4 * i, 4 * j, -3), (4 * i + 4, 4 * j, -7), 0.15) for i in range(5)]
    points = np.vstack([about((x, y, -3.0), 1.0, 5, -4.0) for x, y in piles])
    return solids, (-4, -4, -9.5, 24, 8, 0), points, (-3, -3, -0.5)


def hull() -> Site:
    """A ship's hull with keel and rudder, inspected along both sides and under it."""
    solids = [
        box((0, 0, -1.0), (16, 4, 2)),
        box((0, 0, -2.4), (13, 0.4, 0.8)),
        box((-8.6, 0, -1.9), (0.9, 0.2, 1.8)),
        capsule((-8, 0, -2.2), (-7, 0, -2.2), 0.25),
    ]
    x = np.linspace(-7, 7, 8)
    sides = [np.column_stack([x, np.full(8, y), np.full(8, -1.2)]) for y in (-3.0, 3.0)]
    under = np.column_stack([x, np.where(np.arange(8) % 2, 1.2, -1.2), np.full(8, -3.0)])
    rudder = about((-8.6, 0, -2.2), 1.2, 6)
    return solids, (-13, -8, -7, 13, 8, 0), np.vstack([sides[0], rudder, sides[1], under]), (
        10, -5, -0.5,
    )  # fmt: skip


def net_pen() -> Site:
    """A cylinder of net lines between two rings, moored to four piles; inspected round about."""
    ring = {"axis": [0, 0, 1], "major_radius": 6.0, "minor_radius": 0.2}
    solids: list[dict[str, Any]] = [{"torus": {"center": [0, 0, z], **ring}} for z in (-0.5, -7.0)]
    for a in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        x, y = 6 * math.cos(a), 6 * math.sin(a)
        solids.append(capsule((x, y, -0.5), (x, y, -7), 0.12))
    for a in np.linspace(np.pi / 4, 2 * np.pi + np.pi / 4, 4, endpoint=False):
        far = (12 * math.cos(a), 12 * math.sin(a), -9.0)
        solids.append(capsule((6 * math.cos(a), 6 * math.sin(a), -0.5), far, 0.12))
    rounds = [about((0, 0, z), 7.3, 14) for z in (-2.0, -4.0, -6.0)]
    return solids, (-13, -13, -10, 13, 13, 0.5), np.vstack(rounds), (-11, 0, -0.5)


def ring() -> Site:
    """An upright ring that the robot goes through and around."""
    solids = [{"torus": {"center": [0, 0, -4], "axis": [0, 1, 0], "major_radius": 3.0,
                         "minor_radius": 0.4}}]  # fmt: skip
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    tube = [(3 * math.cos(a), 0.0, -4 + 3 * math.sin(a)) for a in angle]
    points = []
    for k, (a, (x, _, z)) in enumerate(zip(angle, tube, strict=True)):
        out, side = (1.3, -1.3)[k % 2], (0.9, -0.9)[k // 2 % 2]
        points.append((x + out * math.cos(a), side, z + out * math.sin(a)))
    return solids, (-8, -6, -9, 8, 6, 0), np.array(points), (-6, -4, -0.5)


def linked_rings() -> Site:
    """Two rings through one another."""
    solids = [
        {"torus": {"center": [x, 0, -4], "axis": list(axis), "major_radius": 2.5,
                   "minor_radius": 0.35}}
        for x, axis in ((-1.25, (0, 1, 0)), (1.25, (0, 0, 1)))
    ]  # fmt: skip
    points = np.vstack([
        about((1.25, 0, -4), 3.7, 8), about((1.25, 0, -4), 1.2, 4),
        [(-1.25 + 3.7 * math.cos(a), 0.1, -4 + 3.7 * math.sin(a))
         for a in np.linspace(0.5, 2 * np.pi + 0.5, 8, endpoint=False)],
    ])  # fmt: skip
    return solids, (-8, -7, -9, 8, 7, 0), points, (-6, -5, -0.5)


def comb() -> Site:
    """Seven plates in a row; a waypoint deep between each two."""
    solids = [box((1.6 * i, 0, -3), (0.3, 6, 4)) for i in range(7)]
    points = [(1.6 * i + 0.8, (1.8, -1.8)[i % 2], -3.0 - 0.5 * (i % 3)) for i in range(6)]
    return solids, (-5, -8, -8, 15, 8, 0), np.array(points), (-3, -5, -0.5)


def slanted_forest() -> Site:
    """Fifteen poles that lean every way."""
    rng = np.random.default_rng(4)
    feet = np.array([(4.0 * i, 4.0 * j) for i in range(5) for j in range(3)])
    feet = feet + rng.uniform(-0.8, 0.8, feet.shape)
    heads = feet + rng.uniform(-1.5, 1.5, feet.shape)
    solids = [capsule((*f, -10), (*h, 0), 0.3) for f, h in zip(feet, heads, strict=True)]
    points = np.vstack(
        [about((*(0.5 * (f + h)), -5 + d), 0.9, 3) for f, h, d in
         zip(feet, heads, rng.uniform(-2, 2, len(feet)), strict=True)]
    )  # fmt: skip
    return solids, (-4, -4, -10, 20, 12, 0), points, (-3, -3, -0.5)


def tunnel() -> Site:
    """A culvert with a bend and a pillar in it, inspected from within."""
    solids = [
        box((5, 1.75, -3), (14, 0.5, 4)), box((4, -1.75, -3), (12, 0.5, 4)),
        box((5, 0, -0.75), (14, 4, 0.5)), box((5, 0, -5.25), (14, 4, 0.5)),
        box((12.25, -4.5, -3), (0.5, 13, 4)), box((9.75, -6.5, -3), (0.5, 10, 4)),
        box((11, -4.5, -0.75), (3, 13, 0.5)), box((11, -4.5, -5.25), (3, 13, 0.5)),
        capsule((5, 0, -5), (5, 0, -1), 0.3),
    ]  # fmt: skip
    x = np.linspace(0, 10, 6)
    first = np.column_stack([x, np.where(np.arange(6) % 2, 0.8, -0.8), np.full(6, -3.5)])
    second = [(11, y, -2.5 - (k % 2)) for k, y in enumerate(np.linspace(-2, -10, 5))]
    return solids, (-5, -14, -7, 15, 5, 0), np.vstack([first, second]), (-3.5, -0.2, -2.5)


def large() -> Site:
    """100 x 100 x 30 m with forty piles of four kinds: default settings."""
    rng = np.random.default_rng(7)
    places = np.array([(12.0 * i + 8, 12.0 * j + 8) for i in range(8) for j in range(8)])
    places = (places + rng.uniform(-3, 3, places.shape))[rng.permutation(64)[:40]]
    radii = rng.choice([0.5, 0.8, 1.2, 2.0], size=40)
    solids = [capsule((*p, -30), (*p, 1), float(r)) for p, r in zip(places, radii, strict=True)]
    points = []
    for p, r in list(zip(places, radii, strict=True))[:14]:
        points.append(about((*p, -rng.uniform(4, 26)), r + 1.2, 2))
    return solids, (0, 0, -30, 100, 100, 0), np.vstack(points), (1, 1, -1)


SITES: dict[str, Callable[[], Site]] = {
    f.__name__.replace("_", " "): f
    for f in (jetty, hull, net_pen, ring, linked_rings, comb, slanted_forest, tunnel, large)
}


def mission_of(name: str) -> tuple[Mission, Scene]:
    """A mission at one of our sites, and the scene."""
    return tight_mission(name, *SITES[name]())


def tight_mission(name, solids, bounds, points, anchor) -> tuple[Mission, Scene]:
    """Return a mission at a site, with a tether that only just reaches, and the scene."""
    scene = Scene(name=name, solids=solids, bounds=bounds)
    field = scene.field()
    places = pushed_out(field, points, 0.4)
    start = np.add(anchor, (0.3, 0.3, -0.2))
    there = Mission(
        scene="-", name=name, anchor=anchor, start=tuple(start), tether_length=1e3,
        waypoints=[tuple(p) for p in places], clearance=0.3, speed=0.4,
    )  # fmt: skip
    tree = ShortestTree(mission_grid(there, scene, field), anchor, places)
    paths = [tree.path(k) for k in range(len(places))]
    room = field.distance(places) > 0.3
    reachable = [k for k, p in enumerate(paths) if p is not None and room[k]]
    longest = max(
        polylines.length(pull_taut(field, p, 0.0, there.delta)) for p in paths if p is not None
    )
    return there.model_copy(
        update={
            "tether_length": round(SHARE * longest + 0.2, 2),
            "waypoints": tuple(there.waypoints[k] for k in reachable),
        }
    ), scene


def shipped(name: str) -> tuple[Mission, Scene]:
    """A mission of ours that is shipped."""
    there = Mission.load(ROOT / "missions" / f"{name}.json")
    return there.model_copy(update={"camera": None}), there.load_scene()


def flights(quick: bool = False, react: bool = False) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """(planner, vehicle, changes)."""
    yield "predictive", "kinematic", {}
    if react:
        yield "react", "kinematic", {}
    if not quick:
        yield "none", "kinematic", {}
    yield "predictive", "bluerov2", {"current": CURRENT}


def flown(mission: Mission, scene: Scene, planner: str, vehicle: str, changes) -> dict[str, Any]:
    """The summary of one flight."""
    return simulate(
        mission.model_copy(update=changes), planner, vehicle=vehicle, scene=scene
    ).summary


def where_none_will_do(mission: Mission, scene: Scene) -> tuple[dict[str, Any], dict[str, Any]]:
    """The summaries of `none`, and of `predictive` with as long a tether as `none` takes."""
    endless = mission.model_copy(update={"tether_length": 1e3})
    none = flown(endless, scene, "none", "kinematic", {})
    enough = {"tether_length": round(ENOUGH * none["longest_tether"], 2)}
    return none, flown(mission, scene, "predictive", "kinematic", enough)


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", nargs="*", default=[*SITES, "basin", "pipes", "jacket"])
    parser.add_argument("--where-none-will-do", action="store_true",
                        help="only: with as long a tether as `none` takes")  # fmt: skip
    parser.add_argument("--quick", action="store_true", help="predictive only")
    parser.add_argument(
        "--react", action="store_true", help="the paper's planner, too: a quarter of an hour a site"
    )
    args = parser.parse_args()
    if args.where_none_will_do:
        heading("Where a planner that ignores the tether would do")
        head("site", "tether m", "inspection s: none", "predictive", "home s: none", "predictive",
             "left m: none", "predictive", name="sites-none")  # fmt: skip
        for name in args.sites:
            mission, scene = mission_of(name) if name in SITES else shipped(name)
            none, ours = where_none_will_do(mission, scene)
            row(name, f"{ENOUGH * none['longest_tether']:.2f}", f"{none['inspection_s']:.1f}",
                f"{ours['inspection_s']:.1f}", f"{none['home']['seconds']:.1f}",
                f"{ours['home']['seconds']:.1f}", f"{none['home']['left']:.1f}",
                f"{ours['home']['left']:.1f}")  # fmt: skip
        return
    heading("Sites")
    head("site", "tether m", "planner", "visited", "longest m", "over s", "inspection s",
         "home s", "tether free", "worst replan ms", name="sites")  # fmt: skip
    for name in args.sites:
        mission, scene = mission_of(name) if name in SITES else shipped(name)
        for planner, vehicle, changes in flights(args.quick, args.react):
            if vehicle != "kinematic":
                continue
            s = flown(mission, scene, planner, vehicle, changes)
            home = s["home"]
            row(
                name, f"{mission.tether_length:g}",
                planner,
                f"{s['visited']} of {s['waypoints']}", f"{s['longest_tether']:.2f}",
                f"{s['exceedance_s']:.1f}", f"{s['inspection_s']:.1f}",
                f"{home['seconds']:.1f}" if home["reached"] else "not reached",
                "yes" if home["tether_free"] else f"{home['left']:.1f} m left",
                f"{1e3 * s['replan_worst_s']:.0f}",
            )  # fmt: skip


if __name__ == "__main__":
    main()
