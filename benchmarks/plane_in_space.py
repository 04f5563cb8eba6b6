"""Missions among upright prisms, solved in space beside the proven optimum of the plane.

    python benchmarks/plane_in_space.py [--worlds 20] [--time-limit 60] [--plane-limit 60] [--keep]
                                         [--cpu-limits]

Random posts and prisms of any size: radii from a rope to a caisson, pairs with a narrow gap, and
pairs that touch. The tether is 1.05 to 1.5 times as long as the farthest waypoint needs.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

import numpy as np
from space import upright
from table import head, heading, row

from netsp import Problem, solve
from netsp.plan.space.mission_solver import solve_mission
from netsp.roadmap.explain_unreachable import shortest_tethers
from netsp.world import Scene
from netsp.world.mission.mission import Mission

BASE, CLEARANCE, BOUNDS = (-9.0, 0.0, -3.0), 0.1, (-10.0, -10.0, 10.0, 10.0)
MIN_RADIUS, MAX_RADIUS = 0.03, 2.5
TETHER_RATIOS = (1.05, 1.5)


def random_prisms(seed: int) -> tuple[Problem, Mission, Scene]:
    """Return 4 to 7 prisms with 5 to 8 goals about them: in the plane, and as a mission with the
    same clearance and tether."""
    import shapely

    rng = np.random.default_rng([66, seed])
    around, placed = shapely.Point(BASE[:2]), list[tuple[dict[str, Any], dict[str, Any], Any]]()

    def add(centre: np.ndarray, radius: float, kind: str, apart: float) -> bool:
        obstacle, solid, shape = upright(kind, centre, radius, rng)
        if shape.distance(around) < 0.6 or any(shape.distance(s) < apart for *_, s in placed):
            return False
        placed.append((obstacle, solid, shape))
        return True

    count = 4 + seed % 3
    while len(placed) < count:
        radius = math.exp(rng.uniform(math.log(MIN_RADIUS), math.log(MAX_RADIUS)))
        kind = str(rng.choice(["circles", "circles", "boxes", "polygons"]))
        if not add(rng.uniform(-7.5, 7.5, 2), radius, kind, 0.5) or seed % 3 == 0:
            continue
        # beside it another one, with a gap that the robot just fits through, or none
        gap = 0.0 if seed % 3 == 2 else float(rng.uniform(0.25, 0.5))
        near, angle = placed[-1][2], float(rng.uniform(-math.pi, math.pi))
        way, beside = np.array([math.cos(angle), math.sin(angle)]), float(rng.uniform(0.05, 1.0))
        middle = np.array(near.centroid.coords[0])
        far = beside + gap + max(
            float(way @ (np.array(p) - middle)) for p in near.exterior.coords
        )  # fmt: skip
        for _ in range(60):
            d = near.distance(shapely.Point(middle + far * way)) - beside
            if abs(d - gap) < 1e-9:
                break
            far += gap - d
        others = placed[:-1]
        centre = middle + far * way
        disc = shapely.Point(centre).buffer(beside)
        if disc.distance(around) > 0.6 and all(disc.distance(s) > 0.5 for *_, s in others):
            placed.append(upright("circles", centre, beside, rng))
    goals: list[tuple[float, float, float]] = []
    while len(goals) < 5 + seed % 4:
        x, y = rng.uniform(-9.0, 9.0, 2)
        if all(shapely.Point(x, y).distance(s) > 0.25 for *_, s in placed):
            goals.append((float(x), float(y), BASE[2]))
    problem = Problem.model_validate({
        "base": BASE, "goals": goals, "clearance": CLEARANCE, "bounds": BOUNDS,
        "obstacles": [obstacle for obstacle, *_ in placed], "tether_length": 90.0,
    })  # fmt: skip
    needed = shortest_tethers(problem)
    reached = [k for k in range(len(goals)) if needed[k] <= 90.0]
    goals = [goals[k] for k in reached]
    length = float(needed[reached].max()) * rng.uniform(*TETHER_RATIOS)
    problem = Problem.model_validate({
        **problem.model_dump(mode="json", exclude_none=True),
        "goals": goals, "tether_length": length,
    })  # fmt: skip
    scene = Scene(
        solids=[solid for _, solid, _ in placed],
        bounds=[BOUNDS[0], BOUNDS[1], -6.0, BOUNDS[2], BOUNDS[3], 0.0],
    )
    mission = Mission(
        scene="-", anchor=BASE, start=BASE, waypoints=goals, clearance=CLEARANCE,
        tether_length=length,
    )  # fmt: skip
    return problem, mission, scene


def main() -> None:
    """Print a row for each world."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first world")
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--plane-limit", type=float, default=60.0, help="seconds, of the plane")
    args = parser.parse_args()
    heading("Missions among upright prisms")
    head("world", "solids", "goals", "tether m", "in the plane m", "status there", "in space m",
         "longer by %", "found by", "status", "bound of all tours m", "gap %", "CPU s",
         name="space-plane")  # fmt: skip
    for seed in range(args.first, args.first + args.worlds):
        problem, mission, scene = random_prisms(seed)
        best = solve(problem, time_limit=args.plane_limit)
        begin = time.process_time()
        found = solve_mission(mission, scene=scene, time_limit=args.time_limit)
        took, tour = time.process_time() - begin, found.tour
        assert best.length is not None
        longer = 100 * (tour.length / best.length - 1)
        if found.left_out:
            longer = math.nan
        row(seed, len(scene.solids), len(problem.goals), f"{mission.tether_length:.2f}",
            f"{best.length:.3f}", best.status.value, f"{tour.length:.3f}", f"{longer + 0.0:.2f}",
            tour.solver, tour.status.value, f"{tour.bound_of_all or 0.0:.3f}",
            f"{100 * (1.0 if tour.gap_to_all is None else tour.gap_to_all):.2f}",
            f"{took:.1f}")  # fmt: skip
    print()


if __name__ == "__main__":
    main()
