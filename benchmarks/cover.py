"""Waypoints that see a structure, solved and flown; and the tour of others about the same cloud.

    python benchmarks/cover.py [--structures ring hull …] [--keep]

The external cloud and its tour (FC-Planner's, 347 waypoints) are read where they are present.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from react import external_mission
from sites import mission_of
from table import ROOT, head, heading, row

from netsp.plan.cover import cover
from netsp.plan.space.mission_solver import seconds_until_home, solve_mission
from netsp.world import Scene
from netsp.world.mission.equipment import Camera
from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import simulate

CAMERA: dict[str, Any] = {"camera": Camera(range=2.5, patch=0.25), "standoff": 1.2}
SITES = ("ring", "linked rings", "hull", "tunnel")
EXTERNAL = ROOT.parent / "shared" / "data" / "fc_planner_pipe"
LIMIT = 120.0


def external() -> tuple[Mission, Scene]:
    """The tour of others."""
    return external_mission(str(EXTERNAL / "cloud.npz"), str(EXTERNAL / "waypoints.csv"), 0.1)


def flown(name: str, mission: Mission, scene: Scene, visible: float, cells: list[str]) -> None:
    """Solve, fly, and tell."""
    begin = time.perf_counter()
    found = solve_mission(mission, scene=scene, time_limit=LIMIT)
    took = time.perf_counter() - begin
    run = simulate(found.mission, scene=scene)
    s = run.summary
    row(name, *cells, f"{took:.0f}", f"{found.tour.length:.0f}", f"{seconds_until_home(run):.0f}",
        f"{100 * s['coverage'] / visible:.1f}", f"{s['exceedance_s']:.1f}",
        f"{s['visited']} of {s['waypoints']}")  # fmt: skip


def covered(name: str, mission: Mission, scene: Scene, **how: Any) -> float:
    """A structure by our waypoints; the share of its surface that can be seen."""
    begin = time.perf_counter()
    found = cover(scene, anchor=mission.anchor, start=mission.start, **how)
    took = time.perf_counter() - begin
    cells = [
        str(found.candidates), f"{100 * found.visible:.1f}", str(len(found.viewpoints)),
        str(found.bound), f"{100 * found.seen / found.visible:.1f}", f"{took:.0f}",
    ]  # fmt: skip
    there = found.mission.model_copy(update={"speed": mission.speed})
    flown(name, there, scene, found.visible, cells)
    return found.visible


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--structures", nargs="*", default=[*SITES, "external"])
    args = parser.parse_args()
    heading("Waypoints that see a structure")
    head("structure", "candidates", "visible %", "waypoints", "bound", "of the visible %",
         "placed in s", "solved in s", "tour m", "home after s", "of the visible, flown %",
         "over s", "visited", name="cover")  # fmt: skip
    for name in args.structures:
        if name != "external":
            mission, scene = mission_of(name)
            covered(name, mission, scene, **CAMERA)
        elif Path(EXTERNAL).is_dir():
            mission, scene = external()
            visible = covered(
                "external pipe, ours", mission, scene, camera=Camera(range=2.0), standoff=1.0,
                tether_length=mission.tether_length, clearance=mission.clearance,
            )  # fmt: skip
            cells = ["", f"{100 * visible:.1f}", str(len(mission.waypoints)), "", "", ""]
            flown("external pipe, FC-Planner's waypoints", mission, scene, visible, cells)
    print()


if __name__ == "__main__":
    main()
