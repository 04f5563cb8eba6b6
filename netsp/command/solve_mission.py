"""Missions in `netsp solve` and `netsp order`.

The commands find the shortest tour of the waypoints that leaves the tether free, and write the
mission in that order, with the tour.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from netsp.base.errors import EXIT_NOT_ALL, counted
from netsp.command import json_output
from netsp.command.clearance_warning import warn_of_clearance
from netsp.command.command_clock import command_clock
from netsp.command.command_options import given_params
from netsp.command.command_policy import CommandPolicy

if TYPE_CHECKING:
    from netsp.plan.space.mission_solver import SolvedMission
    from netsp.world.mission.mission import Mission
    from netsp.world.scene.scene import Scene


def run(args: argparse.Namespace) -> int:
    """Plan a mission, write it, and return the exit code."""
    from netsp.base.files import read_text
    from netsp.command.plot_scene import note_mission_scene, tell
    from netsp.command.stages import Stages
    from netsp.plan.space.mission_policy import MissionPolicy
    from netsp.plan.space.mission_solver import solve_mission
    from netsp.world.mission.mission import Mission

    params = given_params(args)
    clock = command_clock(args.time_limit or args.policy.mission_time_limit_s)
    begin = time.monotonic()
    mission = clock.bounded("reading the mission", lambda: Mission.load(args.problem))
    stages = None if args.quiet else Stages(sys.stderr, clock.left, args.policy)
    with stages or contextlib.nullcontext():
        with clock.with_min_cpu(MissionPolicy().first_tour_s):
            scene = clock.bounded("reading the scene", mission.load_scene)
            field = clock.bounded(
                "measuring distances in the scene",
                lambda: scene.field(on_progress=None if args.quiet else tell),
            )
        if not args.quiet:
            note_mission_scene(mission, scene, field)
        found = solve_mission(
            mission,
            scene=scene,
            field=field,
            solver=args.solver,
            params=params,
            time_limit=clock,
            iteration_limit=args.iteration_limit,
            seed=args.seed,
            on_progress=stages,
        )
    scene_path = Mission.from_json(read_text(args.problem)).scene
    if args.output is not None and not Path(scene_path).is_absolute():
        scene_path = relative_to_file(Path(args.problem).parent / scene_path, args.output)
    write_mission(found.mission, scene_path, args.output)
    if args.plot:
        draw(found, scene, args.plot)
    if not args.quiet:
        spent = time.monotonic() - begin
        text = summary(mission, found, spent, args.output, args.plot, scene.units, args.policy)
        print(text, file=sys.stderr)
        warn_of_clearance(args.position_error, args.current, mission.clearance, scene.units)
    if args.json:
        json_output.tell(json_output.of_mission(mission, found, scene.units))
    return EXIT_NOT_ALL if found.left_out else 0


def relative_to_file(path: str | Path, file: str) -> str:
    """Return a path as seen from the folder of a file."""
    return Path(os.path.relpath(path, Path(file).parent)).as_posix()


def write_mission(mission: Mission, scene: str, output: str | None) -> None:
    """Write a mission and the place of its scene to a file, or to standard output."""
    from netsp.base.files import STANDARD, write_text

    data = mission.model_copy(update={"scene": scene}).model_dump(mode="json", exclude_none=True)
    write_text(output or STANDARD, json.dumps(data, indent=1) + "\n")


def draw(found: SolvedMission, scene: Scene, file: str) -> None:
    """Draw the flight, or the tour in space if there was no time for a flight."""
    if found.run is not None:
        from netsp.view.pictures.mission_picture import save_runs

        save_runs([found.run], scene, file)
    else:
        from netsp.view.pictures.mission_picture import save_mission

        save_mission(found.mission, scene, file)


def summary(
    mission: Mission,
    found: SolvedMission,
    seconds: float,
    output: str | None,
    plot: str | None,
    units: str,
    policy: CommandPolicy = CommandPolicy(),
) -> str:
    """Return the result in a few lines."""
    from netsp.model.bound_scope import LowerBound, Scope
    from netsp.model.solution import Status
    from netsp.plan.space.mission_solver import GOING_ON, seconds_until_home
    from netsp.plan.space.space_plan import AS_GIVEN, OUT_AND_BACK, PLANE, SHORT_ORDER

    tour = found.tour
    legs = f"{counted(tour.legs, 'leg')} between {counted(tour.states, 'state')}"
    if tour.status is Status.OPTIMAL:
        verdict = "no tour to these waypoints is shorter"
    elif tour.status is Status.OPTIMAL_OF_STATES:
        verdict = f"the shortest along {legs} of the tether found; other tours may be shorter"
    elif tour.lower_bound is not None:
        bound = LowerBound(tour.lower_bound, Scope.STATES)
        verdict = f"{bound.says(tour.length, units)}: {legs}"
    elif tour.solver == AS_GIVEN:
        verdict = "in the order given: no better order was found"
    elif tour.solver == GOING_ON:
        verdict = "found by going straight on"
    elif tour.solver == SHORT_ORDER:
        verdict = "in an order that is short by straight distances; other tours may be shorter"
    elif tour.solver == PLANE:
        verdict = "the shortest found in the plane: all solids are upright prisms"
    elif tour.solver == OUT_AND_BACK:
        verdict = "out along the tether to each waypoint and back: no shorter tour was found"
    else:
        verdict = f"along {legs} of the tether, with detours past what it would hang on"
    lines = [f"tour     {tour.length:.6g} {units}, {verdict}"]
    if tour.bound_of_all is not None:
        of_all = LowerBound(tour.bound_of_all, Scope.ALL_TOURS)
        to = "to the waypoints themselves" + (", without those left out" if found.left_out else "")
        lines.append(
            f"bound    {of_all.length:.6g} {units} on {of_all.scope.tours} {to}: gap "
            f"{of_all.percent(tour.length, 1)}"
        )
    names = [f"#{n}" for n in found.order[: len(tour.stops)]]
    limit = policy.max_named_waypoints
    if len(names) > limit:
        names = [*names[: limit // 2], "…", *names[-limit // 2 :]]
    lines.append(f"order    start → {' → '.join(names)} → start")
    lines.append(f"tether   longest {tour.longest_tether:.4g} of {mission.tether_length:g} {units}")
    if found.run is not None:
        s = found.run.summary
        given_flight = "" if found.given is None else f" ({_as_given(found)})"
        free = "free" if s["home"]["tether_free"] else "NOT free"
        lines.append(
            f"flown    {seconds_until_home(found.run):.1f} s until home, the tether {free}, over "
            f"the limit for {s['exceedance_s']:.1f} s{given_flight}"
        )
    else:
        lines.append(f"flown    not: {'interrupted' if found.interrupted else 'the time was up'}")
    if tour.exact is None:
        lines.append(
            "words    none: the time was up before the words of the scene were found; netsp verify "
            "finds them"
        )
    elif not tour.exact:
        lines.append(
            "words    the group of the cells is not completed: other words may be of the same "
            "class, too; an empty one still is that of a free tether"
        )
    if found.left_out:
        named = ", ".join(f"#{n}" for n in found.left_out[:limit])
        more = len(found.left_out) - limit
        lines.append(
            f"left out {named}{f' and {more} more' if more > 0 else ''}: not reached by any tether "
            f"within the limit that was found{_gap_hint(found)}"
        )
    lines += _gap_lines(found, units)
    lines.append(f"time     {seconds:.1f} s{', interrupted' if found.interrupted else ''}")
    if output:
        lines.append(f"mission  {output}")
    if plot:
        lines.append(f"picture  {plot}")
    return "\n".join(lines)


def _gap_hint(found: SolvedMission) -> str:
    """Return words for waypoints that may be left out because of a gap that the grid hides."""
    gaps, cells = found.tour.unresolved_gaps, found.gaps
    if not gaps or cells is None:
        return ""
    others = f" or {counted(len(gaps) - 1, 'other')}" if len(gaps) > 1 else ""
    return (
        f"; perhaps through the gap of {gaps[0]}{others}, which cells of {cells.cell:.3g} do not "
        "show: give the mission a finer `cell`"
    )


def _gap_lines(found: SolvedMission, units: str) -> list[str]:
    """Return lines about gaps that a finer cell shows, and about gaps that stay hidden."""
    if found.gaps is None:
        return []
    cell = f"{found.gaps.cell:.3g} {units}"
    lines = [f"gap      {gap}: shown by cells of {cell}, now in use" for gap in found.gaps.shown]
    lines += [
        f"gap      {gap}: wide enough for the robot, but cells of {cell} do not show it, and no "
        "tour through it was considered; give the mission a finer `cell`"
        for gap in found.tour.unresolved_gaps or ()
    ]
    if found.tour.unresolved_gaps is None:
        lines.append(
            f"gap      the search for gaps that cells of {cell} do not show was not completed; "
            "allow more time"
        )
    return lines


def _as_given(found: SolvedMission) -> str:
    """Return words for the flight in the order of the file."""
    from netsp.plan.space.mission_solver import seconds_until_home

    assert found.given is not None
    s = found.given.summary
    missed = s["waypoints"] - s["visited"]
    return f"in the order given {seconds_until_home(found.given):.1f} s" + (
        f", {counted(missed, 'waypoint')} missed" if missed else ""
    )
