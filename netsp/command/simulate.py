"""What `netsp plot` does with a scene, and `netsp simulate` with a mission."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from netsp.arrays import Floats
from netsp.errors import EXIT_DEFECT, EXIT_NOT_ALL, InputError
from netsp.files import read_path, read_text, write_text
from netsp.online.log import LogRow, Run, write_run
from netsp.online.mission import Mission
from netsp.online.planner import PLANNERS, Options, Planner
from netsp.online.scene.field import DistanceField, finite_point
from netsp.online.scene.scene import Scene
from netsp.online.simulate import STEP, simulate
from netsp.online.tether import GeodesicTether, ReactTether, Tether
from netsp.online.tether.resolution import THINNEST
from netsp.pictures import mission as flights
from netsp.pictures import scene as pictures

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


def run_mission(args: argparse.Namespace) -> int:
    """`netsp simulate MISSION`: returns the exit code."""
    mission = Mission.load(args.mission)
    changes: dict[str, object] = {}
    if args.tether is not None:
        changes["tether_length"] = args.tether
    if args.current is not None:
        changes["current"] = vector(args.current, "--current")
    mission = mission.model_copy(update=changes)
    if args.output is not None and Path(args.output).exists() and not Path(args.output).is_dir():
        raise InputError(f"{args.output}: expected a folder, and it is a file")
    scene = mission.load_scene()
    field = scene.field(on_progress=tell)
    if args.compare is not None and args.compare not in PLANNERS:
        raise InputError(f"--compare: expected {', '.join(PLANNERS)}, got {args.compare!r}")
    runs = []
    for planner in [args.planner, args.compare] if args.compare else [args.planner]:
        run = simulate(
            mission, planner, vehicle=args.vehicle, tether_model=args.tether_model,
            options=Options(args.ways, args.refine, args.seed),
            scene=scene, field=field, snap=args.snap, seed=args.seed,
            on_step=None if args.quiet or not sys.stderr.isatty() else live(mission, scene.units),
        )  # fmt: skip
        runs.append(run)
        if not args.quiet:
            print(
                ("\r\n" if sys.stderr.isatty() else "") + describe(run, scene.units),
                file=sys.stderr,
            )
        if run.summary["status"] == "interrupted":
            break
    if args.output is None:
        print(json.dumps(runs[0].summary, indent=1, allow_nan=False))
    else:
        write_run(runs[0], args.output)
        if len(runs) > 1:
            write_run(runs[1], Path(args.output) / runs[1].planner)
        draw_runs(runs, scene, Path(args.output))
    if any(r.summary["defects"] for r in runs):
        return EXIT_DEFECT
    complete = runs[0].summary["status"] == "done" and not runs[0].summary["skipped"]
    return 0 if complete else EXIT_NOT_ALL


def draw_runs(runs: list[Run], scene: Scene, folder: Path) -> None:
    """The pictures of one run, or of two side by side; the page only where plotly is installed."""
    flights.save_runs(runs, scene, folder / "run.png")
    try:
        import plotly  # noqa: F401
    except ImportError:
        return
    flights.save_page(runs, scene, folder / "run.html")


def live(mission: Mission, units: str) -> Callable[[LogRow, Planner], None]:
    """Shows how a mission goes, in one line."""
    count = len(mission.waypoints)

    def on_step(row: LogRow, planner: Planner) -> None:
        del planner
        if round(row.time / STEP) % 20:
            return
        done = int(20 * row.target / count)
        seen = f"  seen {100 * row.coverage:.0f} %" if mission.camera is not None else ""
        print(
            f"\r[{'#' * done:.<20}] {row.time:7.1f} s  waypoint {row.target}/{count}  "
            f"{row.mode:<8} tether {row.tether:.2f} of {mission.tether_length:g} {units}{seen}   ",
            end="", file=sys.stderr, flush=True,
        )  # fmt: skip

    return on_step


def vector(text: str, name: str) -> tuple[float, float, float]:
    """Three numbers, separated by commas."""
    try:
        x, y, z = (float(v) for v in text.split(","))
    except ValueError:
        raise InputError(f"{name}: expected three numbers like 0.1,0,0, got {text!r}") from None
    return finite_point((x, y, z), name)


def run_order(args: argparse.Namespace) -> int:
    """`netsp order MISSION`: returns the exit code."""
    from netsp.online.order import reorder

    mission = Mission.load(args.mission)
    scene_file = Mission.from_json(read_text(args.mission)).scene
    say = None if args.quiet else lambda text: print(f"netsp: {text} …", file=sys.stderr)
    found = reorder(mission, time_limit=args.time_limit, seed=args.seed, on_progress=say)
    kept = found.order == tuple(range(len(mission.waypoints)))
    if not args.quiet:
        for name, run in (("given", found.before), ("new", found.after)):
            s = run.summary
            print(
                f"{name:<6} inspection {s['inspection_s']:.1f} s, with the tether taken in "
                f"{s['total_s']['tether']:.1f} s, tether at most {s['longest_tether_m']:.2f} of "
                f"{s['tether_length']:g}, {s['visited']} of {s['waypoints']} visited",
                file=sys.stderr,
            )
        if kept:
            print("netsp: no better order was found", file=sys.stderr)
    placed = scene_file
    if args.output is not None and not Path(scene_file).is_absolute():
        there = Path(args.mission).parent / scene_file
        placed = os.path.relpath(there, Path(args.output).parent)
    full = found.mission.model_copy(update={"scene": placed, "camera": mission.camera})
    text = json.dumps(full.model_dump(mode="json", exclude_none=True), indent=1) + "\n"
    if args.output is None:
        sys.stdout.write(text)
    else:
        write_text(args.output, text)
    return 0


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
    if s["defects"]:
        lines.append(f"defect   planning failed {s['defects']} times; please report the mission")
    if s["coverage"] is not None:
        lines.insert(
            4,
            f"seen     {100 * s['coverage']:.1f} % of the surface "
            f"({100 * s['coverage_through']:.1f} % if nothing stood in between)",
        )
    if s["control_worst_s"] > 0.0:
        lines.append(
            f"control  median {1e3 * s['control_median_s']:.1f} ms, worst "
            f"{1e3 * s['control_worst_s']:.0f} ms; "
            f"{s['inspection_s'] / s['wall_s']:.0f} x real time"
        )
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
