"""`netsp export`: a tour as a mission file of a ground station."""

from __future__ import annotations

import argparse
import sys

from netsp.base.errors import InputError, counted
from netsp.command import json_output, messages
from netsp.command.clearance_flags import clearance_flags, warn_of_clearance, warn_of_problem
from netsp.command.types import (
    check_writable,
    depth,
    length,
    margins,
    natural,
    positive,
    whole_bytes,
)

SPEED = 0.5
"""Metres per second, where none is given."""

EXAMPLE = (
    "netsp export solution.json --problem problems/wharf.json --origin 41.18,-8.70 -o wharf.plan"
)


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument(
        "solution", metavar="SOLUTION", help="solution file, or a mission that was planned (JSON)"
    )
    p.add_argument("--problem", metavar="FILE", help="the problem that a solution solves")
    p.add_argument(
        "--format",
        metavar="NAME",
        help="plan (QGroundControl), wpl (QGC WPL 110), cockpit (Cockpit, .cmp), geojson, kml, kmz "
        "or csv; default: by the extension",
    )
    p.add_argument(
        "--origin",
        metavar="LAT,LON[,HEADING]",
        help="position of the base, and compass heading of the y axis in degrees; "
        "default: the problem's own origin",
    )
    p.add_argument(
        "--acceptance",
        type=length,
        default=0.0,
        metavar="R",
        help="acceptance radius of the vehicle (m), within which it cuts corners; default 0",
    )
    p.add_argument(
        "--hold",
        type=natural,
        metavar="S",
        help="seconds to hold at every goal; default 5, of a mission what its waypoints ask for",
    )
    p.add_argument(
        "--speed", type=length, metavar="V", help="speed, m/s; default 0.5, or a mission's own"
    )
    p.add_argument(
        "--max-waypoints",
        type=positive,
        default=650,
        metavar="N",
        help="maximum number of waypoints; default 650",
    )
    p.add_argument(
        "--fence-bytes",
        type=whole_bytes,
        default=672,
        metavar="N",
        help="storage of the vehicle for its fence, bytes; default 672, that of Pixhawk flight "
        "controllers without an SD card",
    )
    p.add_argument(
        "--margin",
        default="0.3,0.2",
        metavar="SLACK[,CLEARANCE]",
        help="warn where less tether is left or an obstacle is closer; default 0.3,0.2",
    )
    clearance_flags(p)
    p.add_argument(
        "--depth",
        type=depth,
        metavar="D",
        help="depth of all goals of a solution (m), instead of their own",
    )
    p.add_argument(
        "--surface",
        type=float,
        default=0.0,
        metavar="Z",
        help="of a mission: z of the water's surface (m); default 0",
    )
    p.add_argument("-o", "--output", required=True, metavar="FILE")
    json_output.json_flag(p)


def run(args: argparse.Namespace) -> int:
    """Write the file, warn of what is tight, and return the exit code."""
    from netsp.base.files import is_mission_file

    json_output.check_stdout(args)
    if is_mission_file(args.solution):
        return _mission(args)
    if args.problem is None:
        raise InputError(f"--problem: {args.solution} is no mission; expected its problem")
    check_writable(args.output, inputs=(args.solution, args.problem))
    from netsp.exchange.maps.goal_depths import surface_warning
    from netsp.exchange.maps.projection import Projection
    from netsp.exchange.missions.common_depth import at_depth
    from netsp.exchange.missions.export_margins import warnings
    from netsp.exchange.missions.export_notes import export_notes
    from netsp.exchange.missions.fence import FencePolicy
    from netsp.exchange.missions.mission_files import (
        FOR_VEHICLES,
        ExportSettings,
        export,
        format_of,
        predicted_s,
    )
    from netsp.judge import verify
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution

    problem, solution = Problem.load(args.problem), Solution.load(args.solution)
    judged = verify(problem, solution)
    if not judged:
        failed = next(c for c in judged.checks if not c.passed)
        raise InputError(f"{args.solution}: fails its check {failed.name!r}: {failed.detail}")
    if args.depth is not None:
        problem, solution = at_depth(problem, solution, args.depth)
    elif (text := surface_warning(problem)) is not None:
        messages.warning(text)
    kind = format_of(args.output, args.format)
    min_bytes = FencePolicy().min_bytes
    if args.fence_bytes < min_bytes:
        raise InputError(f"--fence-bytes: expected {min_bytes} or more, got {args.fence_bytes}")
    slack, clearance = margins(args.margin)
    projection = None
    if args.origin:
        projection = Projection.parse(args.origin, problem.base[:2], "--origin")
    settings = ExportSettings(
        goal_hold_s=args.hold,
        speed=SPEED if args.speed is None else args.speed,
        max_waypoints=args.max_waypoints,
        fence=FencePolicy(max_bytes=args.fence_bytes),
    )
    points = export(
        problem,
        solution,
        args.output,
        kind,
        projection,
        acceptance=args.acceptance,
        settings=settings,
    )
    goals = sum(p.goal is not None and p.goal >= 0 for p in points)
    seconds = predicted_s(points, settings)
    print(
        f"{args.output}: {len(points)} waypoints, {goals} of them at goals, "
        "all in the class of the plan; "
        f"about {seconds:.0f} s at {settings.speed:g} {problem.units}/s, stops included",
        file=sys.stderr,
    )
    if args.json:
        json_output.tell(
            {
                "file": args.output,
                "format": kind,
                "waypoints": len(points),
                "stops": goals,
                "seconds": seconds,
                "speed": settings.speed,
            }
        )
    for line in warnings(problem, solution, points, slack, clearance):
        messages.warning(line)
    if kind in FOR_VEHICLES:
        warn_of_problem(args, problem, solution.margin)
    export_warnings = export_notes(problem, points, kind, settings)
    for line in export_warnings.warnings:
        messages.warning(line)
    for line in export_warnings.notes:
        messages.note(line)
    return 0


def _mission(args: argparse.Namespace) -> int:
    """Write a planned mission."""
    if args.problem is not None:
        raise InputError(f"--problem: {args.solution} is a mission; expected none")
    if args.depth is not None:
        raise InputError(f"--depth: {args.solution} is a mission, which has depths of its own")
    check_writable(args.output, inputs=(args.solution,))
    from netsp.command.interrupts import until_interrupted
    from netsp.exchange.maps.projection import Projection
    from netsp.exchange.missions.export_notes import bend_note
    from netsp.exchange.missions.mission_export import export_mission
    from netsp.exchange.missions.mission_files import (
        FOR_VEHICLES,
        ExportSettings,
        format_of,
        predicted_s,
    )
    from netsp.world.mission.mission import Mission

    mission = Mission.load(args.solution)
    kind = format_of(args.output, args.format)
    slack, clearance = margins(args.margin)
    projection = None
    if args.origin:
        projection = Projection.parse(args.origin, mission.start[:2], "--origin")
    settings = ExportSettings(
        goal_hold_s=args.hold,
        speed=mission.speed if args.speed is None else args.speed,
        max_waypoints=args.max_waypoints,
    )
    done = until_interrupted(
        "exporting the tour",
        lambda: export_mission(
            mission,
            args.output,
            kind,
            projection,
            acceptance=args.acceptance,
            settings=settings,
            surface=args.surface,
        ),
    )
    stops = sum(p.goal is not None and p.goal >= 0 for p in done.points)
    seconds = predicted_s(done.points, settings)
    print(
        f"{args.output}: {len(done.points)} waypoints, {stops} of them stops, all in the classes "
        f"of the plan; about {seconds:.0f} s at {settings.speed:g} m/s, "
        f"stops included; longest tether {done.longest:.2f} of {mission.tether_length:g} m",
        file=sys.stderr,
    )
    if args.json:
        json_output.tell(
            {
                "file": args.output,
                "format": kind,
                "waypoints": len(done.points),
                "stops": stops,
                "seconds": seconds,
                "speed": settings.speed,
                "longest_tether": done.longest,
                "tether_length": mission.tether_length,
            }
        )
    if mission.tether_length - done.longest < slack:
        messages.warning(
            f"only {mission.tether_length - done.longest:.2f} m of tether are left, less than the "
            f"margin of {slack:g}: plan with a shorter tether_length, or set another margin"
        )
    if done.room < clearance:
        messages.warning(
            f"the lines between waypoints come within {done.room:.2f} m of a solid, less than the "
            f"margin of {clearance:g}: plan with a larger clearance, or set another margin"
        )
    if kind in FOR_VEHICLES:
        warn_of_clearance(args.position_error, args.current, mission.clearance, "m")
        min_depth = settings.policy.min_depth
        shallow = sum(p.position[2] > -min_depth for p in done.points)
        if shallow:
            messages.note(
                f"{counted(shallow, 'waypoint')} shallower than {min_depth} m moved to that depth"
            )
        if (text := bend_note(done.points, settings)) is not None:
            messages.note(text)
        messages.note("the solids are not written: fences are upright, whatever the depth")
        messages.note("home is assumed to be at the surface above the start; do not set it by hand")
    return 0
