"""Missions flown with every planner, beside the tables of Amer et al. 2025.

    python benchmarks/react.py [--seeds 10] [--cloud CLOUD --tour TOUR --scale 0.1]

Kinematic vehicle once (nothing is random), the BlueROV2 in a current with gusts for every seed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from table import head, heading, row

from netsp.online import Scene
from netsp.online.mission import Camera, Mission
from netsp.online.planner import Options
from netsp.online.simulate import simulate

HERE = Path(__file__).parent.parent / "missions"
PLANNERS = ("none", "react", "react-draft", "predictive")
CURRENT, GUSTS = (0.08, 0.05, 0.0), 0.04


def fly(
    mission: Mission, scene: Scene, field, planner: str, vehicle: str, seed: int = 0,
    tether_model: str = "geodesic", **how,
):  # fmt: skip
    return simulate(
        mission, planner, vehicle=vehicle, tether=tether_model, options=Options(**how),
        scene=scene, field=field,
        snap=True, seed=seed,
    ).summary  # fmt: skip


def kinematic(mission: Mission, scene: Scene, field) -> None:
    print(f"### {mission.name}, {mission.tether_length:g} m of tether, kinematic\n")
    head(
        "planner", "inspection s", "back: tether s", "back: path s", "total: tether s",
        "total: path s", "longest m", "too long s", "visited", "seen %", "seen through %",
        "replan median ms", "worst ms",
    )  # fmt: skip
    for name, how in (
        *((p, {}) for p in PLANNERS),
        ("react, unrefined", {"refine": "none"}),
        ("react, its own tether", {"tether_model": "react"}),
        ("react-draft, its own tether", {"tether_model": "react"}),
        ("predictive, BIT*", {"paths": "bitstar"}),
    ):
        s = fly(mission, scene, field, name.split(",")[0], "kinematic", **how)
        row(
            name, f"{s['inspection_s']:.1f}",
            *(f"{s['recovery_s'][k]:.0f}" for k in ("tether", "path")),
            *(f"{s['total_s'][k]:.0f}" for k in ("tether", "path")), f"{s['longest_tether_m']:.2f}",
            f"{s['exceedance_s']:.1f}", f"{s['visited']} of {s['waypoints']}",
            f"{100 * s['coverage']:.1f}", f"{100 * s['coverage_through']:.1f}",
            f"{1e3 * s['replan_median_s']:.1f}", f"{1e3 * s['replan_worst_s']:.0f}",
        )  # fmt: skip
    print()


def dynamic(mission: Mission, scene: Scene, field, seeds: int) -> None:
    print(
        f"### {mission.name}, BlueROV2, current {CURRENT}, gusts {GUSTS} m/s, {seeds} seeds "
        "(median; worst)\n"
    )
    head(
        "planner", "inspection s", "longest m", "too long s", "visited at least", "replan worst ms",
        "control median; worst ms", "x real time",
    )  # fmt: skip
    stormy = mission.model_copy(update={"current": CURRENT, "gusts": GUSTS})
    for planner in ("none", "react", "predictive"):
        rows = [
            fly(stormy, scene, field, planner, "bluerov2", seed)
            for seed in range(seeds if planner == "predictive" else min(seeds, 3))
        ]

        def of(name: str, rows=rows):
            return np.array([s[name] for s in rows])

        row(
            f"{planner} ({len(rows)})",
            f"{np.median(of('inspection_s')):.1f}; {of('inspection_s').max():.1f}",
            f"{of('longest_tether_m').max():.3f}",
            f"{np.median(of('exceedance_s')):.1f}; {of('exceedance_s').max():.1f}",
            f"{of('visited').min()} of {len(mission.waypoints)}",
            f"{1e3 * of('replan_worst_s').max():.0f}",
            f"{1e3 * np.median(of('control_median_s')):.1f}; "
            f"{1e3 * of('control_worst_s').max():.0f}",
            f"{(of('inspection_s') / of('wall_s')).min():.0f}",
        )  # fmt: skip
    print()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--missions", nargs="*", default=["basin", "pipes", "jacket"])
    parser.add_argument("--cloud", help="point cloud (npz) of a structure")
    parser.add_argument("--tour", help="with --cloud: waypoints (CSV, x,y,z first)")
    parser.add_argument("--scale", type=float, default=0.1)
    args = parser.parse_args()
    heading("Missions")
    for name in args.missions:
        mission = Mission.load(HERE / f"{name}.json")
        scene = mission.load_scene()
        field = scene.field()
        kinematic(mission, scene, field)
        if args.seeds:
            dynamic(mission, scene, field, args.seeds)
    if args.cloud:
        points = np.loadtxt(args.tour, delimiter=",", skiprows=1)[:, :3] * args.scale
        scene = Scene(name="cloud", cloud={"file": args.cloud, "scale": args.scale, "voxel": 0.05})
        mission = Mission(
            scene="-", name="external tour", anchor=tuple(points[0]),
            start=tuple(points[0] + [0.0, 0.0, 1e-3]), waypoints=[tuple(p) for p in points],
            tether_length=10.0, clearance=0.2, speed=0.313, camera=Camera(range=2.0),
        )  # fmt: skip
        kinematic(mission, scene, scene.field())


if __name__ == "__main__":
    main()
