"""Meshes as people have them: open, inverted, soups, thin, in millimetres; covered, solved and
flown, beside an independent ray caster (`ray_caster.py`).

    python benchmarks/meshes.py FOLDER [--only NAME …] [--limit 2] [--record FILE] [--keep]

FOLDER holds the files of `SOURCES`; absent files are left out. With `--record`, an interrupted run
goes on where it was. Each mesh is scaled to the same size, but for files in millimetres: these are
read at their own size, and the camera and all distances are as much smaller. What netsp says of the
size of the file when nobody states a scale stands among the causes.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from ray_caster import RayCaster
from table import head, heading, row

from netsp.base.errors import InputError, LimitReachedError
from netsp.plan.cover import cover
from netsp.plan.space.mission_solver import solve_mission
from netsp.world import Scene
from netsp.world.mission.equipment import Camera
from netsp.world.scene.readers import read_mesh_file
from netsp.world.simulator.mission_run import simulate
from netsp.world.simulator.simulation_policy import SimulationPolicy

EXTENT = 4.0
"""Longest side of each mesh in its scene, metres, but for files in millimetres."""

MILLIMETRE = 0.001
"""Scale of files in millimetres, metres."""

CAMERA = Camera(range=4.0, field_of_view=90.0, patch=0.15)
"""Camera before a mesh of `EXTENT`."""

CLEARANCE, STANDOFF, DELTA, REACH = 0.3, 2.0, 0.1, 0.1
"""Lengths of a mission before a mesh of `EXTENT`, metres."""

TOLERANCE = 2.0
"""Largest difference of a percentage from that of the rays, points."""

SPEED = 1.0
"""Speed of the robot before a mesh of `EXTENT`, m/s."""

COVER: dict[str, Any] = {"objective": "viewpoints", "incidence": 75.0, "share": 0.95}

SOURCES = {
    "mikedh/trimesh": (
        "bunny.ply", "chair_model.obj", "cycloidal.ply", "soup.stl", "multibody.stl",
        "counter.unitsmm.STL", "1002_tray_bottom.STL", "target.obj", "CesiumMilkTruck.glb",
        "plate_holes.STL", "monkey.glb", "fixed_top.ply", "octagonal_pocket.stl", "busted.STL",
        "torus.STL", "quadknot.obj", "wallhole.obj", "Duck.glb", "rabbit.obj",
    ),
    "alecjacobson/common-3d-test-models": (
        "suzanne.obj", "teapot.obj", "beetle.obj", "woody.obj", "alligator.obj", "cow.obj",
        "rocker-arm.obj", "fandisk.obj", "spot.obj", "homer.obj",
    ),
    "uuvsimulator/uuv_simulator": ("RexROV_no_props.stl",),
}  # fmt: skip
"""Names of the files, by the repository on GitHub that they come from: of its folder `models`,
`data` or `uuv_descriptions/meshes`. Other files in the folder are left out."""

IN_MILLIMETRES = (
    "counter.unitsmm.STL", "1002_tray_bottom.STL", "plate_holes.STL", "fixed_top.ply",
)  # fmt: skip
"""Files in millimetres: parts of machines, drawn at their size."""

VARIANTS = {"spot.obj": "inverted", "homer.obj": "half of the faces turned", "rabbit.obj": "soup"}
"""Defects that are made in sound meshes, because no file has them."""


@dataclass
class Outcome:
    """Results of one mesh: areas in square metres, shares in per cent, times in CPU seconds."""

    faces: int = 0
    notes: tuple[str, ...] = ()
    size_note: str = ""
    field_s: float = 0.0
    cover_s: float = 0.0
    solve_s: float = 0.0
    simulate_s: float = 0.0
    area: float = 0.0
    area_by_rays: float = 0.0
    seen: float = 0.0
    seen_by_rays: float = 0.0
    flown: float = 0.0
    flown_by_rays: float = 0.0
    solved: str = ""
    visited: str = ""
    error: str = ""


COVER_LIMITS = 15.0
"""Time limit of a choice of waypoints, in those of a solution: it measures distances, too."""

WARM_UP_LIMIT = 60.0
"""Time limit of a solution while kernels compile, CPU seconds with `--cpu-limits`."""

CAUSES = (
    "one face only", "no clear outside", "parts thinner", "disagree on the outside", "overlap",
    "inside out", "on the back of others", "thickness of", "m across",
)  # fmt: skip
"""Parts of the notes that name a reason not to trust a mesh."""


def size_note(path: Path) -> str:
    """Return what netsp says of the size of a file that is taken to be in metres."""
    try:
        notes = Scene.model_validate({"mesh": {"file": str(path)}}).reading_notes()
    except InputError as error:
        notes = [str(error)]
    return next((n.removeprefix(f"{path}: ") for n in notes if "m across" in n), "")


def causes(out: Outcome) -> str:
    """Return the causes that notes name, without what was made of them."""
    notes = [n for n in out.notes if "m across" not in n]
    named = [n.split(": ")[0].split("; ")[0] for n in notes if any(c in n for c in CAUSES)]
    if out.size_note:
        named.append("without a scale: " + out.size_note.removeprefix("mesh.scale: "))
    return "; ".join(named) or "none"


def spoiled(triangles: Any, how: str) -> Any:
    """Return triangles with a defect."""
    rng = np.random.default_rng(0)
    out = triangles.copy()
    if how == "inverted":
        return out[:, ::-1]
    if how == "soup":  # no two faces share a vertex
        return out + rng.normal(size=(len(out), 1, 3)) * 2e-4 * np.ptp(out.reshape(-1, 3))
    half = rng.random(len(out)) < 0.5
    out[half] = out[half][:, ::-1]
    return out


def recorded(record: Path | None) -> dict[tuple[str, str], Outcome]:
    """Return the results that a record has, by file and defect."""
    lines = record.read_text().splitlines() if record is not None and record.exists() else []
    return {(k["name"], k["how"]): Outcome(**k["outcome"]) for k in map(json.loads, lines)}


def measured(path: Path, how: str, limit: float, record: Path | None) -> Outcome:
    """Cover, solve and fly one mesh, and count by rays; add the results to the record."""
    out = Outcome()
    try:
        _measure(path, how, limit, out)
    except (InputError, LimitReachedError) as error:
        out.error = str(error)
    if record is not None:
        with record.open("a") as end:
            kept = {"name": path.name, "how": how, "outcome": asdict(out)}
            end.write(json.dumps(kept) + "\n")
    return out


def _measure(path: Path, how: str, limit: float, out: Outcome) -> None:
    read = read_mesh_file(path)
    triangles = read.vertices[read.faces]
    with tempfile.TemporaryDirectory() as folder:
        if how:
            import trimesh

            triangles = spoiled(triangles, how)
            faces = np.arange(3 * len(triangles)).reshape(-1, 3)
            path = Path(folder) / "spoiled.stl"
            trimesh.Trimesh(triangles.reshape(-1, 3), faces, process=False).export(path)
        _fly(path, triangles, limit, out)


def _fly(path: Path, triangles: Any, limit: float, out: Outcome) -> None:
    extent = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    scale = MILLIMETRE if path.name in IN_MILLIMETRES else EXTENT / extent
    triangles = scale * triangles
    small = scale * extent / EXTENT  # ratio of all lengths to those before a mesh of EXTENT
    low, high = triangles.min((0, 1)), triangles.max((0, 1))
    scene = Scene.model_validate({"mesh": {"file": str(path), "scale": scale}})
    beside = float(low[0]) - small, 0.5 * float(low[1] + high[1])
    camera = CAMERA.model_copy(
        update={"range": small * CAMERA.range, "patch": small * CAMERA.patch}
    )
    out.faces = len(triangles)
    clock = time.process_time
    begin = clock()
    field = scene.field()
    out.field_s = clock() - begin
    out.notes = tuple(n.removeprefix(f"{path}: ") for n in field.notes)
    out.size_note = size_note(path)
    begin = clock()
    found = cover(
        scene,
        anchor=(*beside, float(high[2]) + 0.8 * small),
        camera=camera,
        standoff=small * STANDOFF,
        clearance=small * CLEARANCE,
        time_limit=COVER_LIMITS * limit,
        **COVER,
    )
    out.cover_s, out.seen = clock() - begin, 100 * found.counted
    out.area = float(found.patches.areas.sum()) / small**2
    begin = clock()
    lengths = {"delta": small * DELTA, "reach": small * REACH}
    mission = found.mission.model_copy(update={"speed": small * SPEED, **lengths})
    try:
        solved = solve_mission(mission, scene=scene, time_limit=limit)
        mission, out.solved = solved.mission, f"{solved.tour.length:.3g} m"
    except LimitReachedError:
        out.solved = "no tour in time"
    out.solve_s = clock() - begin
    begin = clock()
    run = simulate(mission, scene=scene)
    out.simulate_s, out.flown = clock() - begin, 100 * run.summary["coverage"]
    out.visited = f"{run.summary['visited']} of {run.summary['waypoints']}"
    rays = RayCaster(triangles, camera, found.mission.clearance, COVER["incidence"])
    out.area_by_rays = rays.area / small**2
    for place, yaw in zip(found.viewpoints.places, found.viewpoints.headings, strict=True):
        rays.look(place, float(yaw), camera, COVER["incidence"])
    out.seen_by_rays = 100 * rays.share
    rays.seen[:] = False
    for k, step in enumerate(run.log):
        if k % SimulationPolicy.camera_steps == 0 and step.mode != "home":
            rays.look(np.array([step.x, step.y, step.z]), step.yaw, camera)
    out.flown_by_rays = 100 * rays.share


def warm_up() -> None:
    """Cover, solve and fly an open ball, so that compiling is in no row."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=2.0)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ball.stl"
        trimesh.Trimesh(ball.vertices, ball.faces[:-20]).export(path)
        _fly(path, np.asarray(ball.triangles[:-20]), WARM_UP_LIMIT, Outcome())


def shown_name(name: str, how: str) -> str:
    """Return the name of a row."""
    kind = how or ("in millimetres" if name in IN_MILLIMETRES else "")
    return f"{name}, {kind}" if kind else name


def main() -> None:
    """Measure the meshes asked for, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--limit", type=float, default=2.0)
    parser.add_argument("--record", type=Path)
    args = parser.parse_args()
    repository = {name: source for source, names in SOURCES.items() for name in names}
    wanted = [name for name in repository if args.only is None or name in args.only]
    chosen = [name for name in wanted if (args.folder / name).is_file()]
    for name in sorted(set(wanted) - set(chosen)):
        print(f"{name} is not in {args.folder}: it is a file of {repository[name]} on GitHub")
    heading("Meshes as people have them")
    head("mesh", "from", "faces", "outside m²", "by rays m²", "cover %", "by rays %", "flown %",
         "by rays", "within 2", "field s", "cover s", "solve s", "simulate s", "solved", "visited",
         "causes", name="meshes")  # fmt: skip
    known = recorded(args.record)
    if set(chosen) - {name for name, _ in known}:
        warm_up()
    good = 0
    for name in chosen:
        how = VARIANTS.get(name, "")
        o = known.get((name, how)) or measured(args.folder / name, how, args.limit, args.record)
        off = max(abs(o.seen - o.seen_by_rays), abs(o.flown - o.flown_by_rays))
        is_good = not o.error and off <= TOLERANCE
        good += is_good
        row(
            shown_name(name, how), repository[name].split("/")[1], o.faces,
            f"{o.area:.1f}", f"{o.area_by_rays:.1f}",
            f"{o.seen:.1f}", f"{o.seen_by_rays:.1f}", f"{o.flown:.1f}", f"{o.flown_by_rays:.1f}",
            "yes" if is_good else f"no, {off:.2f}", f"{o.field_s:.1f}", f"{o.cover_s:.0f}",
            f"{o.solve_s:.0f}", f"{o.simulate_s:.0f}", o.solved, o.visited, o.error or causes(o),
        )  # fmt: skip
    print(f"\n{good} of {len(chosen)} within {TOLERANCE:g} points of the rays")


if __name__ == "__main__":
    main()
