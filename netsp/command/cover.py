"""`netsp cover`: a mission whose waypoints see a structure."""

from __future__ import annotations

import argparse
import contextlib
import sys
from typing import TYPE_CHECKING

from netsp.base.errors import InputError
from netsp.command import json_output
from netsp.command.command_clock import command_clock
from netsp.command.solve_mission import relative_to_file, write_mission
from netsp.command.types import vector

if TYPE_CHECKING:
    from netsp.plan.cover import Cover
    from netsp.world.mission.equipment import Camera


def run(args: argparse.Namespace) -> int:
    """Place waypoints, write the mission, and return the exit code."""
    camera = _camera(args.camera, args.patch)
    anchor = vector(args.anchor, "--anchor")
    start = None if args.start is None else vector(args.start, "--start")
    from netsp.command.plot_scene import note_scene
    from netsp.command.stages import Stages
    from netsp.plan.cover import cover
    from netsp.world.scene.scene import Scene

    clock = command_clock(args.time_limit)
    scene = clock.bounded("reading the scene", lambda: Scene.load(args.scene))
    if not args.quiet:
        note_scene(scene.name, scene.reading_notes())
    stages = None if args.quiet else Stages(sys.stderr, clock.left, args.policy)
    with stages or contextlib.nullcontext():
        result = cover(
            scene,
            anchor=anchor,
            start=start,
            camera=camera,
            standoff=args.standoff,
            tether_length=args.tether,
            clearance=args.clearance,
            share=args.share,
            incidence=args.incidence,
            farthest=args.farthest,
            inspect=tuple(args.inspect) if args.inspect else None,
            objective="viewpoints" if args.fewest else "time",
            speed=args.speed,
            time_limit=clock,
            seed=args.seed,
            on_progress=stages,
        )
    scene_path = args.scene if args.output is None else relative_to_file(args.scene, args.output)
    write_mission(result.mission, scene_path, args.output)
    if args.plot:
        from netsp.view.pictures.cover_picture import save

        save(result, scene, args.plot)
    if not args.quiet:
        print(_summary(result, scene.units, args.output, args.plot), file=sys.stderr)
    if args.json:
        json_output.tell(
            {
                "waypoints": len(result.viewpoints),
                "fewest_possible": result.bound,
                "seen": result.counted,
                "visible": result.visible,
                "candidates": result.candidates,
                "objective": result.objective,
                "tour_length": result.tour_length,
                "tour_s": result.tour_s,
                "tether_length": result.mission.tether_length,
                "units": scene.units,
            }
        )
    return 0


def _camera(text: str, patch: float) -> Camera:
    """Return the camera that ``RANGE[,FIELD[,TILT]]`` describes."""
    from netsp.world.mission.equipment import Camera

    names = ("range", "field_of_view", "tilt")
    try:
        values = [float(v) for v in text.split(",")]
    except ValueError:
        values = []
    if not 1 <= len(values) <= len(names):
        raise InputError(f"--camera: expected RANGE[,FIELD[,TILT]], as 2,70,90, got {text!r}")
    try:
        return Camera(**dict(zip(names, values, strict=False)), patch=patch)
    except InputError as error:
        # the values of --camera are wrong, or that of --patch
        message = str(error).removeprefix("Camera: ")
        flag = "--patch" if message.startswith("patch") else "--camera"
        raise InputError(f"{flag}: {message}") from None


def _summary(found: Cover, units: str, output: str | None, plot: str | None) -> str:
    """Return the result in a few lines."""
    mission, count = found.mission, len(found.viewpoints)
    percent_less = 100.0 * (1.0 - found.bound / count)
    chosen = f"the fewest: no choice among them has fewer than {found.bound}, {percent_less:.1f} % "
    chosen += "less"
    if count == found.bound:
        chosen = "the fewest: no choice among them has fewer"
    if found.objective == "time":
        chosen = "chosen together with their tour, for a short time"
    lines = [
        f"seen      {100 * found.counted:.1f} % of the surface; from all {found.candidates} "
        f"candidates together {100 * found.visible:.1f} %",
        f"waypoints {count}; {chosen}",
        f"tour      about {found.tour_length:.1f} {units}, {found.tour_s:.0f} s at "
        f"{mission.speed:g} {units}/s, before the tether is planned",
        f"tether    {mission.tether_length:g} {units}",
    ]
    if output:
        lines += [f"mission   {output}", f"next      netsp solve {output} -o planned.json"]
    if plot:
        lines.append(f"picture   {plot}")
    return "\n".join(lines)
