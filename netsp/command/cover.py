"""`netsp cover`: a mission whose waypoints see a structure."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from netsp.base.errors import InputError
from netsp.command import json_output
from netsp.command.command_clock import command_clock
from netsp.command.types import check_writable, length, natural, seconds, vector

if TYPE_CHECKING:
    from netsp.plan.cover import Cover
    from netsp.world.mission.equipment import Camera

EXAMPLE = "netsp cover scenes/jetty.json --anchor=-3,-3,-1 -o mission.json"


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument("scene", metavar="SCENE", help="scene file (JSON)")
    p.add_argument("--anchor", required=True, metavar="X,Y,Z", help="where the tether is fixed (m)")
    p.add_argument("--start", metavar="X,Y,Z", help="where the robot starts; default the anchor")
    p.add_argument(
        "--tether",
        type=length,
        metavar="L",
        help="tether length (m); default a tenth more than the waypoints need",
    )
    p.add_argument(
        "--standoff",
        type=length,
        metavar="D",
        help="distance from the surface (m); default half the camera's range",
    )
    p.add_argument(
        "--camera",
        metavar="RANGE[,FIELD[,TILT]]",
        default="2",
        help="range of sight (m), full angle of the field of view and maximum tilt (degrees); "
        "default 2,70,90",
    )
    p.add_argument(
        "--patch",
        type=length,
        default=0.2,
        metavar="S",
        help="edge of the patches of surface that are counted (m); default 0.2",
    )
    p.add_argument(
        "--clearance",
        type=length,
        default=0.3,
        metavar="R",
        help="kept from all solids (m); default 0.3",
    )
    p.add_argument(
        "--share",
        type=length,
        default=0.99,
        metavar="S",
        help="to be seen of what can be seen at all; default 0.99",
    )
    p.add_argument(
        "--incidence",
        type=length,
        default=75.0,
        metavar="DEG",
        help="most that a line of sight may be off the normal (degrees); default 75",
    )
    p.add_argument(
        "--farthest",
        type=length,
        metavar="D",
        help="most that a patch may be away (m); default the camera's range",
    )
    p.add_argument(
        "--inspect",
        action="append",
        metavar="NAME",
        help="only this solid (or mesh, cloud, floor); may be repeated",
    )
    p.add_argument(
        "--time-limit", type=seconds, default=60.0, metavar="S", help="seconds for all; default 60"
    )
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="random seed; default 0")
    p.add_argument(
        "-o", "--output", metavar="FILE", help="write the mission to this file (default: stdout)"
    )
    p.add_argument("--plot", metavar="FILE", help="draw the waypoints (png, svg or pdf)")
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")
    json_output.json_flag(p)


def run(args: argparse.Namespace) -> int:
    """Place waypoints, write the mission, and return the exit code."""
    json_output.check_stdout(args)
    check_writable(args.output, args.plot, inputs=(args.scene,))
    if args.plot:
        from netsp.view.pictures import style

        style.check_format(args.plot)
    camera = _camera(args.camera, args.patch)
    anchor = vector(args.anchor, "--anchor")
    start = None if args.start is None else vector(args.start, "--start")
    from netsp.base.files import write_text
    from netsp.command.plot_scene import note_scene
    from netsp.command.stages import Stages
    from netsp.plan.cover import cover
    from netsp.world.scene.scene import Scene

    clock = command_clock(args.time_limit)
    scene = clock.bounded("reading the scene", lambda: Scene.load(args.scene))
    if not args.quiet:
        note_scene(scene.name, scene.reading_notes())
    stages = None if args.quiet else Stages(sys.stderr, clock.left)
    with stages or contextlib.nullcontext():
        found = cover(
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
            time_limit=clock,
            seed=args.seed,
            on_progress=stages,
        )
    placed = args.scene
    if args.output is not None:
        placed = Path(os.path.relpath(args.scene, Path(args.output).parent)).as_posix()
    mission = found.mission.model_copy(update={"scene": placed})
    text = json.dumps(mission.model_dump(mode="json", exclude_none=True), indent=1) + "\n"
    if args.output is None:
        sys.stdout.write(text)
        sys.stdout.flush()
    else:
        write_text(args.output, text)
    if args.plot:
        from netsp.view.pictures.cover_picture import save

        save(found, scene, args.plot)
    if not args.quiet:
        print(_summary(found, scene.units, args.output, args.plot), file=sys.stderr)
    if args.json:
        json_output.tell(
            {
                "waypoints": len(found.viewpoints),
                "fewest_possible": found.bound,
                "seen": found.seen,
                "visible": found.visible,
                "candidates": found.candidates,
                "tether_length": mission.tether_length,
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
        # of what was given, or of the patch, which has a flag of its own
        message = str(error).removeprefix("Camera: ")
        flag = "--patch" if message.startswith("patch") else "--camera"
        raise InputError(f"{flag}: {message}") from None


def _summary(found: Cover, units: str, output: str | None, plot: str | None) -> str:
    """Return the result in a few lines."""
    mission, count = found.mission, len(found.viewpoints)
    less = 100.0 * (1.0 - found.bound / count)
    fewest = f"no choice among them has fewer than {found.bound}, {less:.1f} % less"
    if count == found.bound:
        fewest = "no choice among them has fewer"
    lines = [
        f"seen      {100 * found.seen:.1f} % of the surface; from all {found.candidates} "
        f"candidates together {100 * found.visible:.1f} %",
        f"waypoints {count}; {fewest}",
        f"tether    {mission.tether_length:g} {units}",
    ]
    if output:
        lines += [f"mission   {output}", f"next      netsp solve {output} -o planned.json"]
    if plot:
        lines.append(f"picture   {plot}")
    return "\n".join(lines)
