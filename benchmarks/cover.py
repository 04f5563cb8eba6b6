"""Waypoints that see a structure, flown: tour and viewpoints chosen together, beside the fewest
viewpoints and then their tour; and the tour of others about the same cloud.

    python benchmarks/cover.py [--structures ring hull …] [--limit S] [--resume FILE]
                               [--external FOLDER] [--keep] [--cpu-limits]

Both ways have the same scene, camera, tether and limits of time. Waypoints are flown in the order
that `netsp cover` writes, by the planner that keeps the tether; with `--limit`, `netsp solve` plans
a tour before. The external cloud and its tour
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
from sites import mission_of
from table import ROOT, head, heading, row

from netsp.base.geometry import polylines
from netsp.plan.cover import Cover, cover
from netsp.plan.space.mission_solver import seconds_until_home, solve_mission
from netsp.world import Scene
from netsp.world.mission.equipment import Camera
from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import simulate

CAMERA: dict[str, Any] = {"camera": Camera(range=2.5, patch=0.25), "standoff": 1.2}
SITES = ("ring", "linked rings", "hull", "comb", "tunnel")
EXTERNAL = ROOT.parent / "shared" / "data" / "fc_planner_pipe"
WAYS = {"viewpoints": "fewest, then tour", "time": "together"}
COLUMNS = (
    "structure", "chosen", "candidates", "visible %", "waypoints", "of the visible %",
    "placed in s", "solved in s", "flown m", "home after s", "less time %",
    "of the visible, flown %", "over s", "free", "visited",
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
        "placed in s": f"{took_s:.0f}",
    }


class Rows:
    """Rows of the table, with those of a run before."""

    def __init__(self, resumed: Path | None) -> None:
        self.resumed = resumed
        is_there = resumed is not None and resumed.exists()
        self.kept: dict[str, dict[str, Any]] = json.loads(resumed.read_text()) if is_there else {}

    def measure(self, structure: str, chosen: str, measure: Any) -> dict[str, Any]:
        """Return the cells of a row, measured unless a run before has measured it; print them."""
        name = f"{structure}: {chosen}"
        if name not in self.kept:
            self.kept[name] = {"structure": structure, "chosen": chosen, **measure()}
            if self.resumed is not None:
                self.resumed.write_text(json.dumps(self.kept))
        cells = self.kept[name]
        row(*(cells.get(column, "") for column in COLUMNS))
        return cells


def compared(
    name: str, mission: Mission, scene: Scene, limit_s: float, rows: Rows, **how: Any
) -> dict[str, Any]:
    """Cover a structure both ways, and return the last cells."""
    before: dict[str, Any] = {}
    for objective, chosen in WAYS.items():
        if before:
            how["tether_length"] = before["tether"]

        def measure(objective: str = objective, before: dict[str, Any] = before) -> dict[str, Any]:
            found, cells = placed(mission, scene, objective=objective, **how)
            cells |= flown(found.mission, scene, found.visible, limit_s)
            if before:
                ratio = float(cells["home after s"]) / float(before["home after s"])
                cells["less time %"] = f"{100 * (1 - ratio):.0f}"
            return {**cells, "tether": found.mission.tether_length, "visible": found.visible}

        before = rows.measure(name, chosen, measure)
    return before


def external_pipe(mission: Mission, scene: Scene, limit_s: float, rows: Rows) -> None:
    """Cover the external pipe both ways, and fly FC-Planner's waypoints beside."""
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

    rows.measure("external pipe", "FC-Planner's waypoints", theirs)


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--structures", nargs="*", default=[*SITES, "external"])
    parser.add_argument("--limit", type=float, default=0.0, help="solve each for these seconds")
    parser.add_argument("--resume", type=Path, help="file of the rows that are measured")
    parser.add_argument("--external", type=Path, default=EXTERNAL, help="folder of FC-Planner's")
    args = parser.parse_args()
    heading("Waypoints that see a structure")
    head(*COLUMNS, name="cover")
    rows = Rows(args.resume)
    for name in args.structures:
        if name != "external":
            compared(name, *mission_of(name), args.limit, rows, **CAMERA)
        elif args.external.is_dir():
            external_pipe(*external(args.external), args.limit, rows)
    print()


if __name__ == "__main__":
    main()
