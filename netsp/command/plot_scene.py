"""`netsp plot` for scenes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.base.polyline_file import read_path
from netsp.command import messages
from netsp.view.pictures import scene_picture as pictures
from netsp.view.pictures import style
from netsp.world.mission.mission import Mission
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene
from netsp.world.simulator.simulation_policy import MissionLimits
from netsp.world.tether import GeodesicTether, Tether, make_tether
from netsp.world.tether.resolution import delta_for_path


def plot_scene(args: argparse.Namespace) -> int:
    """Run `netsp plot SCENE [PATH]`, and return the exit code."""
    style.check_format(args.output, pictures.INTERACTIVE)
    scene = Scene.load(args.problem)
    path, tether = None, None
    if args.solution is None:
        note_scene(scene.name, scene.reading_notes())
    else:
        path = points_of(args.solution)
        field = scene.field(on_progress=tell)
        note_scene(scene.name, field.notes)
        check_overlap(scene, field, path, args.solution)
        delta = args.delta or delta_for_path(field, path)
        if (nodes := polylines.length(path) / delta) > (
            max_nodes := MissionLimits().max_tether_nodes
        ):
            raise InputError(
                f"--delta: {delta:g} makes {nodes:.2g} nodes of a tether; "
                f"expected at most {max_nodes:g}"
            )
        tether = lay(field, path, args.tether_model, delta)
        print(
            f"{scene.name}: taut tether {tether.length:.6g} {scene.units} "
            f"({args.tether_model}, delta {delta:.3g}), {len(tether.contacts)} contacts",
            file=sys.stderr,
        )
    pictures.save(scene, args.output, path=path, tether=tether)
    return 0


def note_scene(name: str, notes: Sequence[str]) -> None:
    """Print what was left out or assumed when the files of a scene were read."""
    for note in notes:
        messages.note(f"{name}: {note}")


def note_mission_scene(mission: Mission, scene: Scene, field: DistanceField) -> None:
    """Print what was left out or assumed in the scene of a mission, and where it is too coarse."""
    note_scene(scene.name, field.notes)
    model = GeodesicTether(field, mission.delta)
    warn_of_scene(model, mission.delta, "lower the mission's delta")


def warn_of_scene(model: GeodesicTether, delta: float, remedy: str) -> None:
    """Warn if the scene is coarser than the requested delta, or if a solid is so thin that the
    tether may slip through."""
    if model.delta > delta:
        messages.warning(
            f"delta {delta:g} is finer than the voxels of the scene: {model.delta:g} is taken"
        )
    if thin := model.warnings:
        others = f" (and {len(thin) - 1} more)" if len(thin) > 1 else ""
        messages.warning(f"{thin[0]}{others}: the tether may slip through; {remedy}")


def lay(field: DistanceField, path: Floats, model: str, delta: float) -> Tether:
    """Return the tether after a robot has followed a path from its anchor, the first point."""
    chosen = make_tether(model, field, delta)
    if isinstance(chosen, GeodesicTether):
        warn_of_scene(chosen, delta, "take a smaller --delta")
    tether: Tether = chosen.lay(path)
    return tether


def points_of(file: str) -> Floats:
    """Return the points (k, 3) of a path file: CSV x,y,z or a JSON list of points."""
    path = read_path(file, messages.note)
    if path is None:
        raise InputError(f"{file}: expected a path: CSV x,y,z or a JSON list of points")
    points = np.asarray(path, dtype=float)
    if points.shape[1] != 3:
        raise InputError(f"{file}: expected points x, y, z, got x, y")
    return points


def check_overlap(scene: Scene, field: DistanceField, path: Floats, file: str) -> None:
    """Raise InputError if a path is too far from the scene for both to be in the same units."""
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
    """Show the progress of a long computation."""
    if sys.stderr.isatty():
        end = "\n" if fraction >= 1.0 else ""
        print(f"\r{stage}: {100 * fraction:.0f} %", end=end, file=sys.stderr, flush=True)
