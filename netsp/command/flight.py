"""Missions flown by `netsp simulate` and `netsp execute`: progress, summaries, files, pictures."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from netsp.base.errors import EXIT_DEFECT, EXIT_NOT_ALL, EXIT_NOT_VERIFIED, LimitReachedError
from netsp.command import json_output
from netsp.command.command_options import Input, files_of
from netsp.command.types import check_writable

if TYPE_CHECKING:
    from netsp.base.clock import Clock
    from netsp.world.mission.mission import Mission
    from netsp.world.mission.run_log import LogRow, Run
    from netsp.world.planner import Planner
    from netsp.world.scene.scene import Scene


WRITTEN = ("log.csv", "summary.json", "mission.json", "run.png", "run.html")
"""Names of the files that a flight writes."""


def fly(
    mission: Mission,
    planners: Sequence[str],
    args: argparse.Namespace,
    *,
    is_judged: bool = False,
    **options: Any,
) -> list[Run]:
    """Fly a mission with each of some planners, print the results, and write the first run.

    Ctrl-C ends the flight, and what was flown is written.

    Parameters
    ----------
    mission : Mission
        The mission.
    planners : sequence of str
        Names of the planners.
    args : Namespace
        Options `output`, `quiet`, `json` and `surprise` of the command, and its inputs.
    is_judged : bool
        Whether the tour of the mission is judged first.
    **options
        Further options of `simulate`.
    """
    from netsp.base.compiled.compile_policy import long_work
    from netsp.base.interrupt_signals import until_interrupt

    if args.output is not None:
        files = (str(Path(args.output) / name) for name in WRITTEN)
        check_writable(*filter(os.path.exists, files), inputs=files_of(args, Input))
    with until_interrupt(None) as clock, long_work():
        try:
            runs = _flown(mission, planners, clock, args, is_judged, **options)
        except LimitReachedError:
            if clock.is_stopped:
                raise KeyboardInterrupt from None
            raise
    if args.output is None or args.json:
        json_output.tell(runs[0].summary)
    return runs


def _flown(
    mission: Mission,
    planners: Sequence[str],
    clock: Clock,
    args: argparse.Namespace,
    is_judged: bool,
    **options: Any,
) -> list[Run]:
    """Fly as `fly` does, with a clock that stops at Ctrl-C."""
    from netsp.base.files import output_folder
    from netsp.command.plot_scene import note_mission_scene, tell
    from netsp.world.mission.run_log import describe_run, write_run
    from netsp.world.simulator.mission_run import simulate
    from netsp.world.simulator.surprises import SceneSurprises

    surprises = SceneSurprises.load(args.surprise) if args.surprise else None
    is_shown = not args.quiet and sys.stderr.isatty()
    runs: list[Run] = []
    with output_folder(args.output):
        scene = clock.bounded("reading the scene", mission.load_scene)
        if surprises is not None:
            surprises.check(scene, args.surprise, len(mission.waypoints))
        field = clock.bounded(
            "measuring distances in the scene", lambda: scene.field(on_progress=tell)
        )
        if surprises is not None:
            surprises.check_places(mission, scene, field, args.surprise)
        if is_judged:
            from netsp.plan.space.judge import check_mission_tour

            clock.bounded("judging the tour", lambda: check_mission_tour(mission, scene, field))
        if clock.is_stopped:
            raise KeyboardInterrupt
        if not args.quiet:
            note_mission_scene(mission, scene, field)
        for planner in planners:
            on_step = until_stopped(clock, show_mission(mission, scene.units) if is_shown else None)
            fly_by = partial(
                simulate,
                mission,
                planner,
                scene=scene,
                field=field,
                surprises=surprises,
                on_step=on_step,
                **options,
            )
            run = clock.bounded("flying", fly_by, winds_down=True)
            runs.append(run)
            if mission.tour is not None and not mission.track:
                from netsp.plan.space.flown import words_of_flight

                run.summary["words"] = words_of_flight(run, scene=scene, field=field).to_summary()
            if getattr(args, "bracket", False) and run.summary["status"] == "done":
                from netsp.plan.space.run_bracket import bracket_run

                run.summary["bracket"] = clock.bounded(
                    "comparing tethers that hold", partial(bracket_run, run, scene, field)
                )
            if not args.quiet:
                new_line = "\r\n" if sys.stderr.isatty() else ""
                print(new_line + describe_run(run, scene.units), file=sys.stderr)
            if run.summary["status"] == "interrupted":
                break
    if args.output is not None:
        write_run(runs[0], args.output)
        if len(runs) > 1:
            write_run(runs[1], Path(args.output) / runs[1].planner.replace(":", "."))
        draw_runs(runs, runs[0].scene or scene, Path(args.output))
    return runs


def exit_code(summary: Mapping[str, Any], is_home: bool, is_free: bool) -> int:
    """Return the exit code for the summary of a run."""
    if summary["defects"]:
        return EXIT_DEFECT
    if summary["exceedance_s"] > 0.0 or (is_home and not is_free):
        return EXIT_NOT_VERIFIED
    return EXIT_NOT_ALL if summary["left_out"] or summary["status"] != "done" else 0


def draw_runs(runs: list[Run], scene: Scene, folder: Path) -> None:
    """Draw one run, or two side by side; the page is written only if plotly is installed."""
    from netsp.view.pictures import mission_picture as flights

    flights.save_runs(runs, scene, folder / "run.png")
    try:
        import plotly  # noqa: F401
    except ImportError:
        return
    from netsp.view.pictures.film import film_of_flight
    from netsp.view.pictures.film_page import save_page
    from netsp.view.pictures.picture_layout import PageLayout

    films = [film_of_flight(run, scene, PageLayout.frames) for run in runs]
    save_page(films, runs[0].mission.name, folder / "run.html")


def until_stopped(
    clock: Clock, on_step: Callable[[LogRow, Planner], None] | None
) -> Callable[[LogRow, Planner], None]:
    """Return a callback that also ends the flight at Ctrl-C."""

    def step(row: LogRow, planner: Planner) -> None:
        if clock.is_stopped:
            raise KeyboardInterrupt
        if on_step is not None:
            on_step(row, planner)

    return step


def show_mission(mission: Mission, units: str) -> Callable[[LogRow, Planner], None]:
    """Return a callback that shows the progress of a mission in one line."""
    from netsp.world.simulator.simulation_policy import SimulationPolicy

    count, step_s = len(mission.waypoints), SimulationPolicy().step_s

    def on_step(row: LogRow, planner: Planner) -> None:
        del planner
        if round(row.time / step_s) % 20:
            return
        n_filled = int(20 * row.waypoint / count)
        seen = f"  seen {100 * row.coverage:.0f} %" if mission.camera is not None else ""
        print(
            f"\r[{'#' * n_filled:.<20}] {row.time:7.1f} s  "
            f"waypoint {min(row.waypoint, count)}/{count}  "
            f"{row.mode:<8} tether {row.tether:.2f} of {mission.tether_length:g} {units}{seen}   ",
            end="",
            file=sys.stderr,
            flush=True,
        )

    return on_step
