"""Missions flown by `netsp simulate` and `netsp execute`: progress, summaries, files, pictures."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from netsp.base.errors import LimitReachedError
from netsp.command import json_output
from netsp.command.types import check_writable

if TYPE_CHECKING:
    from netsp.base.clock import Clock
    from netsp.world.mission.mission import Mission
    from netsp.world.mission.run_log import LogRow, Run
    from netsp.world.planner import Planner
    from netsp.world.scene.scene import Scene
    from netsp.world.simulator.surprises import SceneSurprises


WRITTEN = ("log.csv", "summary.json", "mission.json", "run.png", "run.html")
"""Files of a flight."""


def fly(
    mission: Mission,
    planners: Sequence[str],
    *,
    output: str | None,
    quiet: bool,
    surprises: SceneSurprises | None,
    source: str | None,
    check: bool = False,
    as_json: bool = False,
    inputs: Sequence[str | None] = (),
    **how: Any,
) -> list[Run]:
    """Fly a mission by each of some planners, tell what came of it, and write the first run.

    `check` has the mission's tour judged before; `inputs` are files that must not be overwritten;
    `how` is as of `simulate`. Ctrl-C ends the flight, and what was flown is written."""
    from netsp.base.compiled.compile_policy import long_work
    from netsp.base.interrupt_signals import until_interrupt

    if output is not None:
        existing = [str(Path(output) / name) for name in WRITTEN if (Path(output) / name).exists()]
        check_writable(*existing, inputs=inputs)
    with until_interrupt(None) as clock, long_work():
        try:
            runs = _flown(
                mission,
                planners,
                clock,
                output=output,
                quiet=quiet,
                surprises=surprises,
                source=source,
                check=check,
                **how,
            )
        except LimitReachedError:
            if clock.is_stopped:
                raise KeyboardInterrupt from None
            raise
    if output is None or as_json:
        json_output.tell(runs[0].summary)
    return runs


def _flown(
    mission: Mission,
    planners: Sequence[str],
    clock: Clock,
    *,
    output: str | None,
    quiet: bool,
    surprises: SceneSurprises | None,
    source: str | None,
    check: bool,
    **how: Any,
) -> list[Run]:
    from netsp.base.files import output_folder
    from netsp.command.plot_scene import note_scene, tell, warn_of_scene
    from netsp.world.mission.run_log import describe_run, write_run
    from netsp.world.simulator.mission_run import simulate
    from netsp.world.tether import GeodesicTether

    show = not quiet and sys.stderr.isatty()
    runs: list[Run] = []
    with output_folder(output):
        scene = clock.bounded("reading the scene", mission.load_scene)
        if surprises is not None:
            surprises.check(scene, source or "", len(mission.waypoints))
        field = clock.bounded(
            "measuring distances in the scene", lambda: scene.field(on_progress=tell)
        )
        if surprises is not None:
            surprises.check_places(mission, scene, field, source or "")
        if check:
            from netsp.plan.space.judge import check_mission_tour

            clock.bounded("judging the tour", lambda: check_mission_tour(mission, scene, field))
        if clock.is_stopped:
            raise KeyboardInterrupt
        if not quiet:
            note_scene(scene.name, field.notes)
            warn_of_scene(
                GeodesicTether(field, mission.delta), mission.delta, "lower the mission's delta"
            )
        for planner in planners:
            on_step = until_stopped(clock, show_mission(mission, scene.units) if show else None)
            fly_by = partial(
                simulate,
                mission,
                planner,
                scene=scene,
                field=field,
                surprises=surprises,
                on_step=on_step,
                **how,
            )
            run = clock.bounded("flying", fly_by, winds_down=True)
            runs.append(run)
            if mission.tour is not None and not mission.track:
                from netsp.plan.space.flown import words_of_flight

                run.summary["words"] = words_of_flight(run, scene=scene, field=field).to_summary()
            if not quiet:
                print(
                    ("\r\n" if sys.stderr.isatty() else "") + describe_run(run, scene.units),
                    file=sys.stderr,
                )
            if run.summary["status"] == "interrupted":
                break
    if output is not None:
        write_run(runs[0], output)
        if len(runs) > 1:
            write_run(runs[1], Path(output) / runs[1].planner)
        draw_runs(runs, runs[0].scene or scene, Path(output))
    return runs


def draw_runs(runs: list[Run], scene: Scene, folder: Path) -> None:
    """Draw one run, or two side by side; the page is written only if plotly is installed."""
    from netsp.view.pictures import mission_picture as flights

    flights.save_runs(runs, scene, folder / "run.png")
    try:
        import plotly  # noqa: F401
    except ImportError:
        return
    from netsp.view.pictures.film import film_of_flight
    from netsp.view.pictures.film_page import PAGE_FRAMES, save_page

    films = [film_of_flight(run, scene, PAGE_FRAMES) for run in runs]
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
    """Shows how a mission goes, in one line."""
    from netsp.world.simulator.simulation_policy import SimulationPolicy

    count, step_s = len(mission.waypoints), SimulationPolicy().step_s

    def on_step(row: LogRow, planner: Planner) -> None:
        del planner
        if round(row.time / step_s) % 20:
            return
        done = int(20 * row.waypoint / count)
        seen = f"  seen {100 * row.coverage:.0f} %" if mission.camera is not None else ""
        print(
            f"\r[{'#' * done:.<20}] {row.time:7.1f} s  "
            f"waypoint {min(row.waypoint, count)}/{count}  "
            f"{row.mode:<8} tether {row.tether:.2f} of {mission.tether_length:g} {units}{seen}   ",
            end="",
            file=sys.stderr,
            flush=True,
        )

    return on_step
