"""Whole wind farms, curves of tether lengths, searches for a base and margins, in tables.

    python benchmarks/sizing.py [--farms FOLDER] [--seconds 60] [--keep]

The farms (GeoJSON of turbines: dudgeon.geojson, hornsrev1.geojson) are read from a folder.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from perturbed import violations
from table import head, heading, row

from netsp import Problem, Status, solve, verify
from netsp.exchange.maps import Projection, read_site
from netsp.exchange.maps.options import InspectionOptions
from netsp.plan.random_worlds import reachable_world
from netsp.plan.sizing import best_base, margins, tether_curve
from netsp.plan.sizing.candidates import over_grid

PROBLEMS = Path(__file__).parent.parent / "problems"
FORMATS = (
    ("GeoJSON", "s.geojson", None), ("KML", "s.kml", "LIBKML"), ("KMZ", "s.kmz", "LIBKML"),
    ("GeoPackage", "s.gpkg", "GPKG"),
)  # fmt: skip

SUBSTATION = Projection(55.486, 7.84)
"""About where the one of Horns Rev stands; the data has turbines only."""

FARMS = (
    ("dudgeon", None, (2000.0, 4000.0, 7000.0, 9000.0)),
    ("hornsrev1", SUBSTATION, (2000.0, 4000.0, 9000.0)),
)


def farm(folder: Path, name: str, base: Projection | None, tether: float) -> tuple[Problem, int]:
    """A farm with a goal at every turbine in reach, and how many are not."""
    notes: list[str] = []
    problem = read_site(
        folder / f"{name}.geojson", base, tether=tether, radius=4.0,
        inspection=InspectionOptions(1, 3.0, (-10.0,)), skip_unreachable=True, on_note=notes.append,
    )  # fmt: skip
    return problem, sum("left out" in n for n in notes)


def farms(folder: Path, seconds: float) -> None:
    print(f"### Wind farms, {seconds:g} s each\n")
    head("farm", "tether m", "goals", "out of reach", "tour m", "bound m", "gap %", "status", "s",
         "verified", name="sizing-farms")  # fmt: skip
    for name, base, tethers in FARMS:
        for tether in tethers:
            problem, left_out = farm(folder, name, base, tether)
            begin = time.perf_counter()
            found = solve(problem, time_limit=seconds)
            took = time.perf_counter() - begin
            good = bool(verify(problem, found))
            row(name, f"{tether:g}", len(problem.goals), left_out, f"{found.length:.0f}",
                f"{found.lower_bound:.0f}", f"{100.0 * found.gap:.2f}", found.status.value,
                f"{took:.0f}", "yes" if good else "NO")  # fmt: skip
    print()


def formats() -> None:
    """The site of the tests, written in every format and read back."""
    sys.path.insert(0, str(PROBLEMS.parent))
    from tests.test_site import PLANE, feature, rows, write_geojson, write_vector

    plane: dict[str, Any] = PLANE
    print("### One site in every format\n")
    head("format", "goals off by at most, mm", "obstacles differ by, cm²", "read in ms",
         name="sizing-formats")  # fmt: skip
    goals = {p["name"]: s.coords[0] for s, p in plane["goal"]}
    shapes = {
        p["name"]: s.buffer(p["radius_m"], quad_segs=64) if "radius_m" in p else s
        for s, p in plane["obstacle"]
    }
    for label, name, driver in FORMATS:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / name
            if driver is None:
                write_geojson(file, [feature(s, kind=k, **p) for k, s, p in rows()])
            else:
                plain = file.with_name("doc.kml") if name.endswith("kmz") else file
                write_vector(plain, driver)
                if plain != file:
                    with zipfile.ZipFile(file, "w") as packed:
                        packed.write(plain, "doc.kml")
            maps = [("tether_length", "tether_len")] if driver else []
            read_site(file, maps=maps)  # GDAL loaded
            begin = time.perf_counter()
            found = read_site(file, maps=maps)
            took = time.perf_counter() - begin
        off = max(np.abs(np.array(g.position) - goals[g.name]).max() for g in found.goals)
        area = max(o.shape().symmetric_difference(shapes[o.name]).area for o in found.obstacles)
        row(label, f"{1e3 * off:.2g}", f"{1e4 * area:.2g}", f"{1e3 * took:.0f}")
    print()


def curves() -> None:
    print("### Curves of tether lengths, up to twice the problem's\n")
    head("problem", "goals", "shortest tether", "steps", "longest tour", "shortest tour", "proven",
         "s", name="sizing-curves")  # fmt: skip
    cases = [Problem.load(PROBLEMS / f"{n}.json") for n in ("wharf", "pool", "oc4-jacket")]
    cases += [world(20, 1, 300.0), world(20, 2, 300.0), world(20, 3, 300.0)]
    for problem in cases:
        begin = time.perf_counter()
        curve = tether_curve(problem, 2.0 * problem.tether_length)
        took = time.perf_counter() - begin
        proven = sum(s.status is Status.OPTIMAL for s in curve.steps)
        row(problem.name, len(problem.goals), f"{curve.shortest:.4f}", len(curve.steps),
            f"{curve.steps[0].length:.3f}", f"{curve.steps[-1].length:.3f}",
            f"{proven} of {len(curve.steps)}" if curve.whole else "cut short",
            f"{took:.1f}")  # fmt: skip
    print()


def bases() -> None:
    print("### Where to stand, 100 candidates on a grid\n")
    head("problem", "goals", "possible", "solved", "best tour", "worst tour solved", "proven",
         "s", name="sizing-bases")  # fmt: skip
    for problem in (
        Problem.load(PROBLEMS / "wharf.json"),
        world(20, 1, 300.0),
        world(20, 2, 300.0),
    ):
        begin = time.perf_counter()
        found = best_base(problem, over_grid("10,10", problem))
        took = time.perf_counter() - begin
        solved = [c.length for c in found.candidates if c.length is not None]
        possible = sum(c.possible for c in found.candidates)
        row(problem.name, len(problem.goals), possible, len(solved),
            f"{min(solved):.3f}", f"{max(solved):.3f}", "yes" if found.proven else "no",
            f"{took:.1f}")  # fmt: skip
    print()


def margined(worlds: int) -> None:
    print(f"### Margins, {worlds} worlds each whose obstacles are off by no more\n")
    head("problem", "planned with", "tour", "obstacles may be off by", "tether to lose", "worlds",
         "do not fit", "s", name="sizing-margins")  # fmt: skip
    wharf = Problem.load(PROBLEMS / "wharf.json")
    cases = [(wharf, 0.0), (wharf, 0.3), (Problem.load(PROBLEMS / "pool.json"), 0.0)]
    cases += [(world(10, seed, 330.0), margin) for seed in (1, 2, 3) for margin in (0.0, 1.0)]
    for problem, margin in cases:
        solution = solve(problem, margin=margin)
        begin = time.perf_counter()
        found = margins(problem, solution)
        took = time.perf_counter() - begin
        bad = violations(problem, solution, found.obstacles, worlds, seed=0)
        row(problem.name, f"{margin:g}", f"{solution.length:.3f}", f"{found.obstacles:.4f}",
            f"{found.tether:.3f}", worlds, bad, f"{took:.1f}")  # fmt: skip
    print()


def world(goals: int, seed: int, tether: float) -> Problem:
    """A random world of as many circles as goals, by the recipe of the ICRA 2017 paper."""
    return reachable_world(seed, goals=goals, obstacles=goals, tether_length=tether)[0]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--farms", help="folder with the maps of the farms")
    parser.add_argument("--worlds", type=int, default=1200, help="that are off, for every tour")
    parser.add_argument("--seconds", type=float, default=60.0)
    args = parser.parse_args()
    heading("Sites, tethers and bases")
    solve(Problem.load(PROBLEMS / "pool.json"))  # compiled, or loaded
    np.seterr(all="ignore")
    formats()
    curves()
    bases()
    margined(args.worlds)
    if args.farms:
        farms(Path(args.farms), args.seconds)


if __name__ == "__main__":
    main()
