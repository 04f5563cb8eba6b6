"""Waypoints that see a structure, flown: tour and viewpoints chosen together, beside the fewest
viewpoints and then their tour, of fewer and of the same candidates; and the tour of others about
the same cloud.

    python benchmarks/cover.py [--structures ring hull …] [--ways together …] [--limit S]
                               [--resume FILE] [--external FOLDER] [--keep] [--cpu-limits]

All ways have the same scene, camera, tether and limits of time, and the same search for the order
of their waypoints. Waypoints are flown in the order that `netsp cover` writes, by the planner that
keeps the tether; with `--limit`, `netsp solve` plans a tour before. The external cloud and its tour
(FC-Planner's, 347 waypoints) are read where they are present.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from react import external_mission
from sites import mission_of, shipped
from table import ROOT, head, heading, row

from netsp.base.geometry import polylines
from netsp.plan.cover import Cover, cover
from netsp.plan.cover.cover_policy import CoverPolicy
from netsp.plan.space.mission_solver import seconds_until_home, solve_mission
from netsp.world import Scene
from netsp.world.mission.equipment import Camera
from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import simulate

CAMERA: dict[str, Any] = {"camera": Camera(range=2.5, patch=0.25), "standoff": 1.2}
JACKET: dict[str, Any] = {"camera": Camera(range=4.0, patch=0.3), "standoff": 2.0}
STRUCTURES = ("ring", "linked rings", "hull", "tunnel", "comb", "jacket", "external")
DENSE = CoverPolicy(dense_objectives=("time", "viewpoints"))
EXTERNAL = ROOT.parent / "shared" / "data" / "fc_planner_pipe"
WAYS = {
    "fewest, then tour": {"objective": "viewpoints"},
    "fewest of all candidates, then tour": {"objective": "viewpoints", "policy": DENSE},
    "together": {"objective": "time", "policy": DENSE},
}
FASTER = {
    "less than the first %": "fewest, then tour",
    "less than the second %": "fewest of all candidates, then tour",
}
COLUMNS = (
    "structure", "chosen", "candidates", "visible %", "waypoints", "of the visible %",
    "tour, as estimated s", "placed in s", "solved in s", "flown m", "home after s",
    "less than the first %", "less than the second %", "of the visible, flown %", "over s", "free",
    "visited",
)  # fmt: skip


def external(folder: Path = EXTERNAL) -> tuple[Mission, Scene]:
    """The tour of others."""
    return external_mission(str(folder / "cloud.npz"), str(folder / "waypoints.csv"), 0.1)


def flown(mission: Mission, scene: Scene, visible: float, limit_s: float) -> dict[str, Any]:
    """Fly a mission in the order that is written, or solve it before if there is a limit; return
    the cells of the flight."""
    begin = time.process_time()
    run = None
    if limit_s > 0.0:
        found = solve_mission(mission, scene=scene, time_limit=limit_s)
        mission, run = found.mission, found.run
    took_s = time.process_time() - begin
    run = run or simulate(mission, scene=scene)
    s = run.summary
    return {
        "solved in s": f"{took_s:.0f}" if limit_s > 0.0 else "",
        "flown m": f"{polylines.length(np.array([[r.x, r.y, r.z] for r in run.log])):.0f}",
        "free": "yes" if s["home"]["tether_free"] else "no",
        "home after s": f"{seconds_until_home(run):.0f}",
        "of the visible, flown %": f"{100 * s['coverage'] / visible:.1f}",
        "over s": f"{s['exceedance_s']:.1f}",
        "visited": f"{s['visited']} of {s['waypoints']}",
    }


def placed(mission: Mission, scene: Scene, **how: Any) -> tuple[Cover, dict[str, Any]]:
    """Place waypoints, and return the cells about them."""
    begin = time.process_time()
    found = cover(scene, anchor=mission.anchor, start=mission.start, speed=mission.speed, **how)
    took_s = time.process_time() - begin
    return found, {
        "candidates": str(found.candidates),
        "visible %": f"{100 * found.visible:.1f}",
        "waypoints": str(len(found.viewpoints)),
        "of the visible %": f"{100 * found.seen / found.visible:.1f}",
        "tour, as estimated s": f"{found.tour_s:.0f}",
        "placed in s": f"{took_s:.0f}",
    }


class Rows:
    """Rows of the table, with those of a run before, and changes of the missions to fly."""

    def __init__(self, resumed: Path | None, ways: list[str]) -> None:
        self.changes: dict[str, Any] = {}
        self.resumed, self.ways = resumed, ways
        is_there = resumed is not None and resumed.exists()
        self.kept: dict[str, dict[str, Any]] = json.loads(resumed.read_text()) if is_there else {}

    def measure(self, structure: str, chosen: str, measure: Any) -> dict[str, Any]:
        """Return the cells of a row, measured unless a run before has measured it."""
        name = f"{structure}: {chosen}"
        if name not in self.kept:
            self.kept[name] = {"structure": structure, "chosen": chosen, **measure()}
            if self.resumed is not None:
                self.resumed.write_text(json.dumps(self.kept))
        return self.kept[name]

    def show(self, cells: dict[str, Any]) -> None:
        """Print the cells of a row."""
        row(*(cells.get(column, "") for column in COLUMNS))


def compared(
    name: str, mission: Mission, scene: Scene, limit_s: float, rows: Rows, **how: Any
) -> dict[str, Any]:
    """Cover a structure in the ways that are asked for, and return the last cells."""
    before: dict[str, dict[str, Any]] = {}
    cells: dict[str, Any] = {}
    for chosen in (chosen for chosen in WAYS if chosen in rows.ways):

        def measure(way: dict[str, Any] = WAYS[chosen]) -> dict[str, Any]:
            found, cells = placed(mission, scene, **way, **how)
            there = found.mission.model_copy(update=rows.changes)
            cells |= flown(there, scene, found.visible, limit_s)
            return {**cells, "tether": found.mission.tether_length, "visible": found.visible}

        cells = dict(rows.measure(name, chosen, measure))
        for column, other in FASTER.items():
            if other in before:
                ratio = float(cells["home after s"]) / float(before[other]["home after s"])
                cells[column] = f"{100 * (1 - ratio):.0f}"
        rows.show(cells)
        before[chosen] = cells
        how["tether_length"] = cells["tether"]
    return cells


def external_pipe(mission: Mission, scene: Scene, limit_s: float, rows: Rows) -> None:
    """Cover the external pipe in all ways, and fly FC-Planner's waypoints beside."""
    ours = compared(
        "external pipe",
        mission,
        scene,
        limit_s,
        rows,
        camera=Camera(range=2.0),
        standoff=1.0,
        tether_length=mission.tether_length,
        clearance=mission.clearance,
    )

    def theirs() -> dict[str, Any]:
        cells = flown(mission, scene, ours["visible"], limit_s)
        return {"waypoints": str(len(mission.waypoints)), **cells}

    rows.show(rows.measure("external pipe", "FC-Planner's waypoints", theirs))


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--structures", nargs="*", default=STRUCTURES)
    parser.add_argument("--ways", nargs="*", default=list(WAYS), choices=list(WAYS))
    parser.add_argument("--limit", type=float, default=0.0, help="solve each for these seconds")
    parser.add_argument("--resume", type=Path, help="file of the rows that are measured")
    parser.add_argument("--external", type=Path, default=EXTERNAL, help="folder of FC-Planner's")
    args = parser.parse_args()
    heading("Waypoints that see a structure")
    head(*COLUMNS, name="cover")
    rows = Rows(args.resume, args.ways)
    for name in args.structures:
        if name == "jacket":
            mission, scene = shipped(name)
            how = {"clearance": mission.clearance, "inspect": mission.inspect, **JACKET}
            rows.changes = {name: getattr(mission, name) for name in ("cell", "delta", "reach")}
            compared("a leg of the jacket", mission, scene, args.limit, rows, **how)
            rows.changes = {}
        elif name != "external":
            compared(name, *mission_of(name), args.limit, rows, **CAMERA)
        elif args.external.is_dir():
            external_pipe(*external(args.external), args.limit, rows)
    print()


if __name__ == "__main__":
    main()
