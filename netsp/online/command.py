"""What `netsp plot` does with a scene, and `netsp simulate` with a mission."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

from netsp.errors import InputError
from netsp.measuring import read_path
from netsp.online import pictures
from netsp.online.field import DistanceField
from netsp.online.mission import Mission
from netsp.online.planner import Planner
from netsp.online.scene import Scene
from netsp.online.simulate import STEP, LogRow, Run, simulate, write_run
from netsp.online.tether import GeodesicTether, ReactTether, Tether
from netsp.online.tether.geodesic import THINNEST

Floats = npt.NDArray[np.float64]

MODELS = {"geodesic": GeodesicTether, "react": ReactTether}


def plot_scene(args: argparse.Namespace) -> int:
    """`netsp plot SCENE [PATH]`: returns the exit code."""
    pictures.check_format(args.output)
    scene = Scene.load(args.problem)
    path, tether = None, None
    if args.solution is not None:
        path = points_of(args.solution)
        field = scene.field(on_progress=tell)
        for note in field.notes:
            print(f"netsp: {scene.name}: {note}", file=sys.stderr)
        check_overlap(scene, field, path, args.solution)
        delta = args.delta or suggested_delta(field, path)
        tether = lay(field, path, args.tether_model, delta)
        print(
            f"{scene.name}: taut tether {tether.length:.6g} {scene.units} "
            f"({args.tether_model}, delta {delta:.3g}), {len(tether.contacts)} contacts",
            file=sys.stderr,
        )
    pictures.save(scene, args.output, path=path, tether=tether)
    return 0


EXIT_NOT_ALL = 4
"""Some waypoints were given up, or the run was interrupted."""


def run_mission(args: argparse.Namespace) -> int:
    """`netsp simulate MISSION`: returns the exit code."""
    mission = Mission.load(args.mission)
    if args.tether is not None:
        mission = mission.model_copy(update={"tether_length": args.tether})
    if args.output is not None and Path(args.output).exists() and not Path(args.output).is_dir():
        raise InputError(f"{args.output}: expected a folder, and it is a file")
    scene = mission.load_scene()
    field = scene.field(on_progress=tell)
    show = not args.quiet and sys.stderr.isatty()

    def on_step(row: LogRow, planner: Planner) -> None:
        if show and int(row.time / STEP) % 20 == 0:
            print(
                f"\r{row.time:7.1f} s  waypoint {row.target}/{len(mission.waypoints)}  "
                f"{row.mode:<8} tether {row.tether:.2f} of {mission.tether_length:g} "
                f"{scene.units}   ",
                end="",
                file=sys.stderr,
                flush=True,
            )

    run = simulate(mission, args.planner, scene=scene, field=field, snap=args.snap, on_step=on_step)
    if show:
        print(file=sys.stderr)
    text = json.dumps(run.summary, indent=1, allow_nan=False)
    if args.output is not None:
        write_run(run, args.output)
        pictures.save_run(run, scene, Path(args.output) / "run.png")
    else:
        print(text)
    if not args.quiet:
        print(describe(run, scene.units), file=sys.stderr)
    complete = run.summary["status"] == "done" and not run.summary["skipped"]
    return 0 if complete else EXIT_NOT_ALL


def describe(run: Run, units: str) -> str:
    """A run in a few lines."""
    s = run.summary
    lines = [
        f"mission  {s['mission']}, planner {s['planner']}: {s['status']}",
        f"visited  {s['visited']} of {s['waypoints']} waypoints",
        f"time     {s['inspection_s']:.1f} s, and back along the tether "
        f"{s['recovery_s']['tether']:.1f} s",
        f"tether   longest {s['longest_tether_m']:.3f} of {s['tether_length']:g} {units}, "
        f"too long for {s['exceedance_s']:.1f} s",
        f"planning {s['replans']} times, median {1e3 * s['replan_median_s']:.1f} ms, worst "
        f"{1e3 * s['replan_worst_s']:.0f} ms",
    ]
    lines += [f"left out {left['waypoint']}: {left['reason']}" for left in s["skipped"][:5]]
    if len(s["skipped"]) > 5:
        lines.append(f"         and {len(s['skipped']) - 5} more")
    return "\n".join(lines)


def lay(field: DistanceField, path: Floats, model: str, delta: float) -> Tether:
    """The tether after a robot has gone a path from its anchor, the first point, on."""
    if model not in MODELS:
        raise InputError(f"--tether-model: expected {' or '.join(MODELS)}, got {model!r}")
    chosen = MODELS[model](field, delta)
    if isinstance(chosen, GeodesicTether) and (thin := chosen.warnings):
        more = f" (and {len(thin) - 1} more)" if len(thin) > 1 else ""
        print(
            f"netsp: {thin[0]}{more}: the tether may slip through; take a smaller --delta",
            file=sys.stderr,
        )
    for k in range(len(path) - 1):
        if not field.line_of_sight(path[k], path[k + 1], depth=0.25 * delta):
            raise InputError(
                f"path[{k}] to path[{k + 1}]: passes through a solid; expected a free path"
            )
    tether: Tether = chosen.lay(path)
    return tether


def suggested_delta(field: DistanceField, path: Floats) -> float:
    """A resolution for a scene: a hundredth of the path's extent, and fine enough for the thinnest
    solid."""
    size = float(np.linalg.norm(path.max(0) - path.min(0))) or 1.0
    thinnest = min((t for _, t in field.thickness), default=np.inf)
    return float(max(min(size / 100.0, thinnest / (1.05 * THINNEST)), size / 5000.0))


def points_of(file: str) -> Floats:
    """The points (k, 3) of a path file: CSV x,y,z or a JSON list of points."""
    path = read_path(file)
    if path is None:
        raise InputError(f"{file}: expected a path: CSV x,y,z or a JSON list of points")
    points = np.asarray(path, dtype=float)
    if points.shape[1] != 3:
        raise InputError(f"{file}: expected points x, y, z, got x, y")
    return points


def check_overlap(scene: Scene, field: DistanceField, path: Floats, file: str) -> None:
    """InputError when a path is so far from the scene that the two cannot be in the same units."""
    boxes = [b for s in scene.all_solids() if (b := s.shape.box()) is not None]
    if field.box is not None:
        boxes.append(field.box)
    if not boxes:
        return
    low, high = np.vstack(boxes).min(0), np.vstack(boxes).max(0)
    flat = np.array([not (low[a] == high[a] == 0.0) for a in range(3)])  # posts have no height
    size = float((high - low).max())
    start, end = path.min(0), path.max(0)
    apart = np.maximum(np.maximum(low - end, start - high), 0.0)[flat]
    reach = float(np.linalg.norm(end - start))
    if np.linalg.norm(apart) > 10.0 * max(size, reach) or (
        len(path) > 2 and not 1e-3 < (reach + 1e-12) / size < 1e3
    ):
        raise InputError(
            f"{file}: the path spans {_box(start, end)} and the scene {_box(low, high)} "
            f"{scene.units}; expected the same place and units"
        )


def _box(low: Floats, high: Floats) -> str:
    return " to ".join("(" + ", ".join(f"{v:.4g}" for v in p) + ")" for p in (low, high))


def tell(stage: str, fraction: float) -> None:
    """Progress of a long build."""
    if sys.stderr.isatty():
        end = "\n" if fraction >= 1.0 else ""
        print(f"\r{stage}: {100 * fraction:.0f} %", end=end, file=sys.stderr, flush=True)
