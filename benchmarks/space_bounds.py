"""Bounds on all tours in space, with and without the windings around loops of bars.

    python benchmarks/space_bounds.py [--scenes "linked rings" "frame 0" …] [--seconds 20]
                                      [--keep] [--cpu-limits]

Each bound has the time limit for itself. The tours beside them are those of the tables
`space-missions` and `space-frames`, from `python benchmarks/space.py`.
"""

from __future__ import annotations

import argparse
import json
import time

from sites import SITES, mission_of, shipped
from space import random_frame
from table import RESULTS, head, row

from netsp.base.clock import Clock
from netsp.plan.space.mission_policy import ClassPolicy, StatePolicy
from netsp.plan.space.path_bound import LegBounds, _bound_with_windings, _bound_without_tether
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.space_legs import RobotPaths
from netsp.plan.space.wound_loops import WoundLoops
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene

SCENES = ("ring", "linked rings", "net pen", "jacket", *(f"frame {n}" for n in range(10)))


def scene_named(name: str) -> tuple[Mission, Scene]:
    if name.startswith("frame "):
        return random_frame(int(name.split()[1]))
    return mission_of(name) if name in SITES else shipped(name)


def published_tour(name: str) -> float:
    """Return the length of the tour in the tables of tours, m."""
    is_frame = name.startswith("frame ")
    table = json.loads((RESULTS / f"space-{'frames' if is_frame else 'missions'}.json").read_text())
    wanted = name.split()[1] if is_frame else name
    (found,) = [r for r in table["rows"] if r[0] == wanted]
    return float(found[table["columns"].index("tour m")])


def bounds_of(name: str, seconds: float) -> tuple[float, float, int, float]:
    """Return both bounds, m, the number of loops that are counted, and CPU seconds."""
    mission, scene = scene_named(name)
    field = scene.field()
    context = PlanningContext.for_mission(mission, scene, field)
    places = Places.for_mission(mission, field)
    paths = RobotPaths(context, places, StatePolicy().effort(len(places)))
    legs = LegBounds(paths, list(range(len(places))), context.policy.potential)
    begin = time.process_time()
    without = _bound_without_tether(legs, Clock(seconds), 0) or 0.0
    loops = WoundLoops.of_mission(context, legs.points, ClassPolicy())
    counted, best = 0, without
    if loops is not None:
        best = max(best, _bound_with_windings(legs, loops, Clock(seconds), 0))
        counted = len(loops.loops)
    return without, best, counted, time.process_time() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", nargs="+", default=SCENES, help="names of scenes")
    parser.add_argument("--seconds", type=float, default=20.0, help="limit of each bound, s")
    args = parser.parse_args()
    head("scene", "loops counted", "tour m", "bound without a tether m", "its gap %",
         "bound with windings m", "gap %", "CPU s", name="space-bounds")  # fmt: skip
    for name in args.scenes:
        tour = published_tour(name)
        without, best, counted, took = bounds_of(name, args.seconds)
        row(name, counted, f"{tour:.1f}", f"{without:.2f}", f"{100 * (1 - without / tour):.1f}",
            f"{best:.2f}", f"{100 * (1 - best / tour):.1f}", f"{took:.0f}")  # fmt: skip


if __name__ == "__main__":
    main()
