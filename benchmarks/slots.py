"""Walls with slots of random place, width and angle: no bound on all tours is above a known tour.

    python benchmarks/slots.py [--scenes 30] [--bounds-only] [--seed 0] [--keep]

The shortest tour that exists is known from above in closed form: through the slot, or round a
free end of the wall, from corner to corner with square corners at the clearance. `--bounds-only`
leaves out the planning: legs that were "found" go round the wall, as they do where cells close the
slot, and only the bound is asked for.
"""

from __future__ import annotations

import argparse
import itertools
import math

import numpy as np
from table import head, row

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.plan.space.mission_policy import StatePolicy
from netsp.plan.space.mission_solver import solve_mission
from netsp.plan.space.path_bound import bound_all_tours
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.space_legs import RobotPaths
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene

BOUNDS = (-6.0, -7.0, -2.0, 6.0, 7.0, 2.0)
CLEARANCE, THICK, END = 0.1, 0.2, 4.0


def slot_scene(rng: np.random.Generator) -> tuple[Mission, Scene, float]:
    """Return a mission on both sides of a wall, its scene, and the length of a known tour."""
    y, width = rng.uniform(-2.0, 2.0), rng.uniform(0.21, 0.4)
    angle = rng.choice([0.0, rng.uniform(-20.0, 20.0)])
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    solids = []
    for begin, end in ((-END, y - 0.5 * width), (y + 0.5 * width, END)):
        middle = 0.5 * (begin + end)
        solids.append({"box": {
            "center": [-s * middle, c * middle, 0], "size": [THICK, end - begin, 5.0],
            "rotation": [0, 0, angle],
        }})  # fmt: skip
    scene = Scene.model_validate({"schema_version": 1, "bounds": BOUNDS, "solids": solids})
    start = (-4.0, float(rng.uniform(-1, 1)), 0.0)
    points = [(4.0, float(rng.uniform(-2, 2)), 0.0) for _ in range(2)]
    points.append((-4.0, float(rng.uniform(-2, 2)), 0.0))
    mission = Mission(
        scene="-", anchor=start, start=start, waypoints=points, tether_length=30.0,
        clearance=CLEARANCE, speed=0.3,
    )  # fmt: skip
    turned = np.array([[c, s], [-s, c]])  # into the wall's own axes
    legs = np.array([turned @ np.array(p[:2]) for p in (start, *points)])
    return mission, scene, _shortest(legs, y, width)


def _shortest(places: Floats, y: float, width: float) -> float:
    """Return the length of the best order along legs that exist."""
    n = len(places)
    length = np.zeros((n, n))
    for a, b in itertools.combinations(range(n), 2):
        length[a, b] = length[b, a] = _leg(places[a], places[b], y, width)
    return min(
        sum(length[u, v] for u, v in itertools.pairwise((0, *order, 0)))
        for order in itertools.permutations(range(1, n))
    )


def _leg(a: Floats, b: Floats, y: float, width: float) -> float:
    if a[0] * b[0] > 0.0:
        return float(np.linalg.norm(b - a))
    if a[0] > 0.0:
        a, b = b, a
    half, spare = 0.5 * THICK + CLEARANCE, 0.5 * width - CLEARANCE
    across = np.linspace(y - spare, y + spare, 21)
    lengths = [
        math.hypot(a[0] + half, p - a[1]) + math.hypot(2 * half, q - p)
        + math.hypot(b[0] - half, b[1] - q)
        for p in across for q in across
    ]  # fmt: skip
    return min(lengths)


def bound_only(mission: Mission, scene: Scene, seconds: float = 4.0) -> float:
    """Return the bound if all paths found go round the wall."""
    context = PlanningContext.for_mission(mission, scene, scene.field())
    places = Places.for_mission(mission, context.field)
    ways = RobotPaths(context, places, StatePolicy().effort(len(places)))
    round_ = np.array([mission.start, (-0.5, END + 0.5, 0), (0.5, END + 0.5, 0), (4, 0, 0)])
    for n in range(len(places)):
        ways.tethers[n] = [np.vstack([round_[:-1], places.points[n]])]
    return bound_all_tours(ways, list(range(len(places))), Clock(seconds)) or 0.0


def main() -> None:
    """Print a row for each scene and the sums."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--bounds-only", action="store_true")
    parser.add_argument("--time-limit", type=float, default=60.0)
    args = parser.parse_args()
    rng, above = np.random.default_rng(args.seed), 0
    head("scene", "a tour that exists m", "tour m", "bound m", "above it", "status", "gaps told",
         name=None if args.bounds_only else "space-slots")  # fmt: skip
    for k in range(args.scenes):
        mission, scene, exists = slot_scene(rng)
        if args.bounds_only:
            bound, told = bound_only(mission, scene), ("", "", "")
        else:
            found = solve_mission(mission, scene=scene, time_limit=args.time_limit)
            bound = found.tour.bound_of_all or 0.0
            cells = found.gaps
            gaps = 0 if cells is None else len(cells.shown) + len(cells.left)
            told = (f"{found.tour.length:.2f}", found.tour.status.value, str(gaps))
        wrong = bound > exists * (1.0 + 1e-6)
        above += wrong
        row(k, f"{exists:.2f}", told[0], f"{bound:.2f}", "yes" if wrong else "no", told[1], told[2])
    print(f"bounds above a tour that exists: {above} of {args.scenes}")


if __name__ == "__main__":
    main()
