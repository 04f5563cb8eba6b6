"""Random missions with solids that are not on the map.

    python benchmarks/unknown.py [--missions 60] [--vehicle bluerov2]

Nine piles are on the map and five leaning posts are not; some of these appear on the way. A mission
is good if the tether is never over its limit, nothing is met, and the tether is free at home.
"""

from __future__ import annotations

import argparse

import numpy as np
from table import head, heading, row

from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import Run
from netsp.world.simulator.mission_run import simulate
from netsp.world.simulator.surprises import SceneSurprises

PILES = Scene.model_validate({
    "solids": [
        {"name": f"pile {x} {y}", "post": {"center": [x, y], "radius": 0.5}}
        for x in (0, 6, 12) for y in (-3, 0, 3)
    ],
    "bounds": (-6, -8, -6, 18, 8, 2), "schema_version": 1,
})  # fmt: skip

WAYPOINTS = [(3, 1.5, -2), (9, 1.5, -3), (14, -1.5, -2), (3, -1.5, -1)]


def flown(seed: int, vehicle: str) -> Run:
    """One of the missions, flown."""
    rng = np.random.default_rng([seed, 18])
    events = []
    for _ in range(5):
        x, y = rng.uniform((1, -5), (15, 5))
        post = {"a": [x, y, -6], "b": [x + 1, y - 1, 2], "radius": float(rng.uniform(0.1, 0.5))}
        events.append({"time": float(rng.choice([0, 20, 60])), "appear": {"capsule": post}})
    mission = Mission.model_validate({
        "scene": "-", "anchor": (-3, -6, 0), "start": (-3, -5, 0), "waypoints": WAYPOINTS,
        "tether_length": float(rng.uniform(12, 25)), "speed": 0.5,
        "range_sensor": {"noise": float(rng.choice([0.0, 0.03]))}, "schema_version": 1,
    })  # fmt: skip
    surprises = SceneSurprises.model_validate({"events": events, "schema_version": 1})
    return simulate(mission, vehicle=vehicle, scene=PILES, surprises=surprises, seed=seed)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--missions", type=int, default=60)
    parser.add_argument("--vehicle", default="kinematic")
    args = parser.parse_args()
    heading("Solids that are not on the map")
    runs = [flown(seed, args.vehicle).summary for seed in range(args.missions)]
    head("vehicle", "missions", "over the limit", "contacts", "home and free", "visited",
         "worst replan, s CPU")  # fmt: skip
    row(
        args.vehicle, len(runs), sum(s["exceedance_s"] > 0.0 for s in runs),
        sum(s["contacts"] for s in runs), sum(s["home"]["tether_free"] for s in runs),
        f"{sum(s['visited'] for s in runs)} of {sum(s['waypoints'] for s in runs)}",
        f"{max(s['replan_worst_s'] for s in runs):.2f}",
    )  # fmt: skip


if __name__ == "__main__":
    main()
