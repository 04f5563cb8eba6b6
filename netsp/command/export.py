"""`netsp export`: a tour as a mission file of a ground station."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from netsp.base.errors import InputError, counted
from netsp.command import json_output, messages
from netsp.command.clearance_warning import warn_of_clearance, warn_of_problem
from netsp.command.types import load_verified_pair, margins

if TYPE_CHECKING:
    from netsp.exchange.missions.mission_files import ExportSettings
    from netsp.exchange.missions.waypoints import Waypoint


def run(args: argparse.Namespace) -> int:
    """Write the file, warn of small margins, and return the exit code."""
    from netsp.base.files import is_mission_file

    return _mission(args) if is_mission_file(args.solution) else _problem(args)


def _problem(args: argparse.Namespace) -> int:
    """Write the solution of a problem."""
    from netsp.base.files import read_text
    from netsp.exchange.maps.goal_depths import surface_warning
    from netsp.exchange.maps.projection import Projection
    from netsp.exchange.missions import mission_files
    from netsp.exchange.missions.common_depth import at_depth
    from netsp.exchange.missions.export_margins import warnings
    from netsp.exchange.missions.export_notes import export_notes
    from netsp.exchange.missions.fence import FencePolicy

    if args.problem is None:
        read_text(args.solution)  # a file that cannot be read is refused by its own message
        raise InputError(
            f"{args.solution} is not a planned mission; give the tour's problem with --problem FILE"
        )
    problem, solution = load_verified_pair(args.problem, args.solution)
    if args.depth is not None:
        problem, solution = at_depth(problem, solution, args.depth)
    elif (text := surface_warning(problem)) is not None:
        messages.warning(text)
    kind = mission_files.format_of(args.output, args.format)
    min_bytes = FencePolicy().min_bytes
    if args.fence_bytes < min_bytes:
        raise InputError(f"--fence-bytes: expected {min_bytes} or more, got {args.fence_bytes}")
    slack, clearance = margins(args.margin)
    projection = None
    if args.origin:
        projection = Projection.parse(args.origin, problem.base[:2], "--origin")
    settings = mission_files.ExportSettings(
        goal_hold_s=args.hold,
        speed=args.speed or mission_files.ExportSettings.speed,
        max_waypoints=args.max_waypoints,
        fence=FencePolicy(max_bytes=args.fence_bytes),
    )
    points = mission_files.export(
        problem,
        solution,
        args.output,
        kind,
        projection,
        acceptance=args.acceptance,
        settings=settings,
    )
    row = _row(args.output, kind, points, settings)
    print(
        f"{args.output}: {len(points)} waypoints, {row['stops']} of them at goals, all in the "
        f"class of the plan; about {row['seconds']:.0f} s at {settings.speed:g} "
        f"{problem.units}/s, stops included",
        file=sys.stderr,
    )
    if args.json:
        json_output.tell(row)
    for line in warnings(problem, solution, points, slack, clearance):
        messages.warning(line)
    if kind in mission_files.FOR_VEHICLES:
        warn_of_problem(args, problem, solution.margin)
    remarks = export_notes(problem, points, kind, settings)
    for line in remarks.warnings:
        messages.warning(line)
    for line in remarks.notes:
        messages.note(line)
    return 0


def _row(file: str, kind: str, points: list[Waypoint], settings: ExportSettings) -> dict[str, Any]:
    """Return the summary of an export for programs."""
    from netsp.exchange.missions.mission_files import predicted_s

    return {
        "file": file,
        "format": kind,
        "waypoints": len(points),
        "stops": sum(p.goal is not None and p.goal >= 0 for p in points),
        "seconds": predicted_s(points, settings),
        "speed": settings.speed,
    }


def _mission(args: argparse.Namespace) -> int:
    """Write a planned mission."""
    if args.problem is not None:
        raise InputError(f"--problem: {args.solution} is a mission; expected none")
    if args.depth is not None:
        raise InputError(f"--depth: {args.solution} is a mission, which has depths of its own")
    from netsp.command.interrupts import until_interrupted
    from netsp.exchange.maps.projection import Projection
    from netsp.exchange.missions import mission_files
    from netsp.exchange.missions.export_notes import bend_note
    from netsp.exchange.missions.mission_export import export_mission
    from netsp.world.mission.mission import Mission

    mission = Mission.load(args.solution)
    kind = mission_files.format_of(args.output, args.format)
    slack, clearance = margins(args.margin)
    projection = None
    if args.origin:
        projection = Projection.parse(args.origin, mission.start[:2], "--origin")
    settings = mission_files.ExportSettings(
        goal_hold_s=args.hold, speed=args.speed or mission.speed, max_waypoints=args.max_waypoints
    )
    tour = until_interrupted(
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
    row = _row(args.output, kind, tour.points, settings)
    print(
        f"{args.output}: {len(tour.points)} waypoints, {row['stops']} of them stops, all in the "
        f"classes of the plan; about {row['seconds']:.0f} s at {settings.speed:g} m/s, "
        f"stops included; longest tether {tour.longest:.2f} of {mission.tether_length:g} m",
        file=sys.stderr,
    )
    if args.json:
        tether = {"longest_tether": tour.longest, "tether_length": mission.tether_length}
        json_output.tell(row | tether)
    if mission.tether_length - tour.longest < slack:
        messages.warning(
            f"only {mission.tether_length - tour.longest:.2f} m of tether are left, less than the "
            f"margin of {slack:g}: plan with a shorter tether_length, or set another margin"
        )
    if tour.room < clearance:
        messages.warning(
            f"the lines between waypoints come within {tour.room:.2f} m of a solid, less than the "
            f"margin of {clearance:g}: plan with a larger clearance, or set another margin"
        )
    if kind in mission_files.FOR_VEHICLES:
        warn_of_clearance(args.position_error, args.current, mission.clearance, "m")
        min_depth = settings.policy.min_depth
        shallow = sum(p.position[2] > -min_depth for p in tour.points)
        if shallow:
            messages.note(
                f"{counted(shallow, 'waypoint')} shallower than {min_depth} m moved to that depth"
            )
        if (text := bend_note(tour.points, settings)) is not None:
            messages.note(text)
        messages.note("the solids are not written: fences are upright, whatever the depth")
        messages.note("home is assumed to be at the surface above the start; do not set it by hand")
    return 0
