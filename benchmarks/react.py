"""Missions flown with every planner, beside the tables of Amer et al. 2025.

    python benchmarks/react.py [--seeds 10] [--vehicle NAME] [--cloud CLOUD --tour TOUR --scale 0.1]
    python benchmarks/react.py --missions jacket --only react "react, unrefined" --keep

Kinematic vehicle once (nothing is random), the BlueROV2 in a current with gusts for every seed.
With `--only` the kept rows of other planners and missions stay, and the commit says which are new.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from table import RESULTS, head, heading, row, source

from netsp.world import Scene
from netsp.world.mission.equipment import Camera
from netsp.world.mission.mission import Mission
from netsp.world.paths.refine import RefineParams
from netsp.world.planner import PlannerOptions
from netsp.world.simulator.mission_run import simulate

HERE = Path(__file__).parent.parent / "missions"
PLANNERS = ("none", "react", "react-draft", "react-thresholds", "predictive")
FARTHER_MOVES = RefineParams(keeps="farther")
CURRENT, GUSTS = (0.08, 0.05, 0.0), 0.04


def fly(
    mission: Mission, scene: Scene, field, planner: str, vehicle: str, seed: int = 0,
    tether_model: str = "geodesic", **how,
):  # fmt: skip
    return simulate(
        mission, planner, vehicle=vehicle, tether=tether_model, options=PlannerOptions(**how),
        scene=scene, field=field,
        snap=True, seed=seed,
    ).summary  # fmt: skip


COLUMNS = (
    "mission", "planner", "inspection s", "back: tether s", "back: path s", "total: tether s",
    "total: path s", "longest tether m", "over the limit s", "visited", "seen %",
    "seen through %", "replan median ms", "worst ms",
)  # fmt: skip

PAPER = (
    ("paper, CPP", "429", "", "426", "", "855", "31.16", "327.4", "", "", "99.82", "", ""),
    ("paper, REACT", "546", "134", "", "680", "", "10.52", "10.4", "", "", "99.91", "", "482"),
)
"""Amer et al. 2025, Tables I to III. It does not say along what its REACT comes back; its CPP takes
as long to come back as to inspect."""

VARIANTS = (
    *((p, {}) for p in PLANNERS),
    ("react, unrefined", {"refine": "none"}),
    ("react, farther moves only", {"refine_params": FARTHER_MOVES}),
    ("predictive, BIT*", {"paths": "bitstar"}),
)
"""Planners, and what is different about them."""

OWN_TETHER = (("react, its own tether", {"tether_model": "react"}),)
"""The paper's planner with the paper's tether model: slow, so about one pipe only."""


def kinematic(mission: Mission, scene: Scene, field, variants) -> Iterator[list[str]]:
    """Yield one row a planner."""
    for name, how in variants:
        s = fly(mission, scene, field, name.split(",")[0], "kinematic", **how)
        yield [
            f"{mission.name}, {mission.tether_length:g} m", name, f"{s['inspection_s']:.1f}",
            *(f"{s['recovery_s'][k]:.0f}" for k in ("tether", "path")),
            *(f"{s['total_s'][k]:.0f}" for k in ("tether", "path")), f"{s['longest_tether']:.2f}",
            f"{s['exceedance_s']:.1f}", f"{s['visited']} of {s['waypoints']}",
            f"{100 * s['coverage']:.1f}", f"{100 * s['coverage_through']:.1f}",
            f"{1e3 * s['replan_median_s']:.1f}", f"{1e3 * s['replan_worst_s']:.0f}",
        ]  # fmt: skip


def in_current(mission: Mission, scene: Scene, field, planner: str, seeds: int):
    """Summaries of the BlueROV2 in a current with gusts, one a seed."""
    stormy = mission.model_copy(update={"current": CURRENT, "gusts": GUSTS})
    return [fly(stormy, scene, field, planner, "bluerov2", seed) for seed in range(seeds)]


def dynamic(
    mission: Mission, scene: Scene, field, planners: Iterable[str], seeds: int
) -> Iterator[list[str]]:
    """Yield one row a planner, over some seeds of gusts: median, worst."""
    for planner in planners:
        count = seeds if planner == "predictive" else min(seeds, 3)
        rows = in_current(mission, scene, field, planner, count)

        def of(name: str, rows=rows):
            return np.array([s[name] for s in rows])

        yield [
            mission.name, planner, str(len(rows)),
            f"{np.median(of('inspection_s')):.1f}; {of('inspection_s').max():.1f}",
            f"{of('longest_tether').max():.2f}",
            f"{np.median(of('exceedance_s')):.1f}; {of('exceedance_s').max():.1f}",
            f"{of('visited').min()} of {len(mission.waypoints)}",
            f"{1e3 * of('replan_worst_s').max():.0f}",
            f"{1e3 * np.median(of('control_median_s')):.1f}; "
            f"{1e3 * of('control_worst_s').max():.0f}",
            f"{(of('inspection_s') / of('wall_s')).min():.0f}",
        ]  # fmt: skip


def write(
    name: str, columns: Iterable[str], rows: Iterable[list[str]], only: list[str] | None
) -> None:
    """Print a table as its rows come; with `only`, print it with the other kept rows in the end."""
    if only is None:
        head(*columns, name=name)
        for cells in rows:
            row(*cells)
        return
    old = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    table, names = old["rows"], [n for n, _ in (*VARIANTS, *OWN_TETHER)]
    missions: list[str] = []
    for cells in rows:
        print("measured: " + ", ".join(cells), flush=True)
        missions.append(cells[0].split(",")[0])
        same = [k for k, r in enumerate(table) if r[:2] == cells[:2]]
        if same:
            table[same[0]] = cells
            continue
        before = [
            k for k, r in enumerate(table)
            if r[0] == cells[0] and names.index(r[1]) < names.index(cells[1])
        ]  # fmt: skip
        table.insert(before[-1] + 1 if before else len(table), cells)
    now = f"{source()['commit']} ({', '.join(dict.fromkeys(missions))}: {'; '.join(only)})"
    head(*columns, name=name, date=source()["date"], commit=f"{old['commit']}, {now}")
    for cells in table:
        row(*cells)


def external_mission(
    cloud: str, tour: str, scale: float, first: int | None = None
) -> tuple[Mission, Scene]:
    """A tour of others about a cloud of points. first : only so many of its waypoints."""
    points = np.loadtxt(tour, delimiter=",", skiprows=1)[:first, :3] * scale
    scene = Scene(name="cloud", cloud={"file": cloud, "scale": scale, "voxel": 0.05})
    mission = Mission(
        scene="-", name="external tour", anchor=tuple(points[0]),
        start=tuple(points[0] + [0.0, 0.0, 1e-3]), waypoints=[tuple(p) for p in points],
        tether_length=10.0, clearance=0.2, speed=0.313, camera=Camera(range=2.0),
    )  # fmt: skip
    return mission, scene


BLUEROV2_COLUMNS = (
    "mission", "planner", "seeds", "inspection s", "longest tether m", "over the limit s",
    "visited at least", "replan worst ms", "control ms", "x real time",
)  # fmt: skip


def external(mission: Mission, scene: Scene, variants) -> Iterator[list[str]]:
    """Yield what the paper measured on its own tour, and one row a planner on the tour given."""
    for cells in PAPER:
        yield ["its own, 10 m", *cells]
    yield from kinematic(mission, scene, scene.field(), variants)


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--missions", nargs="*", default=["basin", "pipes", "jacket"])
    parser.add_argument("--vehicle", choices=("kinematic", "bluerov2"), help="only this one")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="only rows of these planners")
    parser.add_argument("--cloud", help="point cloud (npz) of a structure")
    parser.add_argument("--tour", help="with --cloud: waypoints (CSV, x,y,z first)")
    parser.add_argument("--scale", type=float, default=0.1)
    args = parser.parse_args()
    heading("Missions")
    missions = [Mission.load(HERE / f"{name}.json") for name in args.missions]
    there = [(m, s, s.field()) for m in missions for s in (m.load_scene(),)]

    def chosen(variants):
        return [v for v in variants if args.only is None or v[0] in args.only]

    if there and args.vehicle != "bluerov2":
        print("### Kinematic vehicle\n")
        rows = (
            cells for k, at in enumerate(there)
            for cells in kinematic(*at, chosen(VARIANTS + (OWN_TETHER if k == 0 else ())))
        )  # fmt: skip
        write("react-shipped", COLUMNS, rows, args.only)
        print()
    if there and args.vehicle != "kinematic":
        print(f"### BlueROV2, current {CURRENT}, gusts {GUSTS} m/s (median; worst)\n")
        planners = [n for n, _ in chosen([(n, {}) for n in ("none", "react", "predictive")])]
        rows = (cells for at in there for cells in dynamic(*at, planners, args.seeds))
        write("react-bluerov2", BLUEROV2_COLUMNS, rows, args.only)
        print()
    if args.cloud:
        mission, scene = external_mission(args.cloud, args.tour, args.scale)
        rows = external(mission, scene, chosen(VARIANTS))
        write("react-external", COLUMNS, rows, args.only)


if __name__ == "__main__":
    main()
