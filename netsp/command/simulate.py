"""`netsp simulate`: a mission in a scene, with a taut tether."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from netsp.command.types import (
    choices,
    length,
    natural,
    vector,
)
from netsp.errors import EXIT_DEFECT, EXIT_NOT_ALL, InputError

if TYPE_CHECKING:
    from netsp.online.log import LogRow, Run
    from netsp.online.mission import Mission
    from netsp.online.planner import Planner
    from netsp.online.scene.scene import Scene

EXAMPLE = "netsp simulate missions/basin.json -o run"


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument("mission", metavar="MISSION", help="mission file (JSON)")
    p.add_argument(
        "--planner", default="predictive", metavar="NAME",
        help=choices("predictive (default), react, react-draft or none", "netsp.planners"),
    )  # fmt: skip
    p.add_argument(
        "--tether", type=length, metavar="L", help="tether length, instead of the mission's"
    )
    p.add_argument(
        "--vehicle", default="kinematic", metavar="NAME",
        help="kinematic (default) or bluerov2 (with its dynamics and controller)",
    )  # fmt: skip
    p.add_argument(
        "--tether-model", default="geodesic", metavar="NAME",
        help=choices("used by the planner: geodesic (default) or react", "netsp.tethers"),
    )  # fmt: skip
    p.add_argument("--current", metavar="X,Y,Z", help="current (m/s), instead of the mission's")
    p.add_argument(
        "--paths", default="tree", metavar="NAME",
        help="how paths are found: tree (default), bitstar, rrtstar or prmstar (OMPL)",
    )  # fmt: skip
    p.add_argument(
        "--refine", metavar="NAME", help="none, paper or gradient; default is the planner's own"
    )
    p.add_argument(
        "--seed",
        type=natural,
        default=0,
        metavar="N",
        help="random seed of gusts and of sampling planners; default 0",
    )
    p.add_argument("--compare", metavar="NAME", help="also fly with this planner, for comparison")
    p.add_argument(
        "--surprise", metavar="FILE",
        help="surprise file (JSON): solids that appear, vanish or move",
    )  # fmt: skip
    p.add_argument("--snap", action="store_true", help="move waypoints out of solids")
    p.add_argument(
        "-o",
        "--output",
        metavar="RUN",
        help="folder for log.csv, summary.json, run.png and (with plotly) run.html",
    )
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")


def run(args: argparse.Namespace) -> int:
    """Fly the mission, write what happened, and return the exit code."""
    from netsp.command.compiling import compile_messages
    from netsp.command.plot_scene import tell, warn_of_scene
    from netsp.files import output_folder
    from netsp.online.limits import check_names
    from netsp.online.log import describe_run, write_run
    from netsp.online.mission import Mission
    from netsp.online.planner import PLANNERS, PlannerOptions
    from netsp.online.simulate import simulate
    from netsp.online.surprises import SceneSurprises
    from netsp.online.tether import GeodesicTether

    mission = Mission.load(args.mission)
    changes: dict[str, object] = {}
    if args.tether is not None:
        changes["tether_length"] = args.tether
    if args.current is not None:
        changes["current"] = vector(args.current, "--current")
    mission = mission.model_copy(update=changes)
    check_names(args.planner, args.vehicle, args.tether_model)
    if args.compare is not None and args.compare not in PLANNERS:
        raise InputError(f"--compare: expected {', '.join(PLANNERS)}, got {args.compare!r}")
    surprises = SceneSurprises.load(args.surprise) if args.surprise else None
    show = not args.quiet and sys.stderr.isatty()
    runs = []
    messages = nullcontext() if args.quiet else compile_messages(sys.stderr)
    with output_folder(args.output), messages:
        scene = mission.load_scene()
        if surprises is not None:
            surprises.check(scene, args.surprise)
        field = scene.field(on_progress=tell)
        if not args.quiet:
            warn_of_scene(
                GeodesicTether(field, mission.delta), mission.delta, "lower the mission's delta"
            )
        for planner in [args.planner, args.compare] if args.compare else [args.planner]:
            run = simulate(
                mission, planner, vehicle=args.vehicle, tether=args.tether_model,
                options=PlannerOptions(args.paths, args.refine, args.seed),
                scene=scene, field=field, snap=args.snap, seed=args.seed,
                surprises=surprises,
                on_step=show_mission(mission, scene.units) if show else None,
            )  # fmt: skip
            runs.append(run)
            if mission.tour is not None and not mission.track:
                from netsp.space.flown import words_of_flight

                flown = words_of_flight(run, scene=scene, field=field)
                run.summary["words"] = flown.told()
            if not args.quiet:
                print(
                    ("\r\n" if sys.stderr.isatty() else "") + describe_run(run, scene.units),
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
        draw_runs(runs, runs[0].scene or scene, Path(args.output))
    if any(r.summary["defects"] for r in runs):
        return EXIT_DEFECT
    s = runs[0].summary
    complete = s["status"] == "done" and not s["left_out"] and s["home"]["tether_free"]
    return 0 if complete else EXIT_NOT_ALL


def draw_runs(runs: list[Run], scene: Scene, folder: Path) -> None:
    """The pictures of one run, or of two side by side; the page only where plotly is installed."""
    from netsp.pictures import mission as flights

    flights.save_runs(runs, scene, folder / "run.png")
    try:
        import plotly  # noqa: F401
    except ImportError:
        return
    flights.save_page(runs, scene, folder / "run.html")


def show_mission(mission: Mission, units: str) -> Callable[[LogRow, Planner], None]:
    """Shows how a mission goes, in one line."""
    from netsp.online.simulation import STEP

    count = len(mission.waypoints)

    def on_step(row: LogRow, planner: Planner) -> None:
        del planner
        if round(row.time / STEP) % 20:
            return
        done = int(20 * row.waypoint / count)
        seen = f"  seen {100 * row.coverage:.0f} %" if mission.camera is not None else ""
        print(
            f"\r[{'#' * done:.<20}] {row.time:7.1f} s  "
            f"waypoint {min(row.waypoint, count)}/{count}  "
            f"{row.mode:<8} tether {row.tether:.2f} of {mission.tether_length:g} {units}{seen}   ",
            end="", file=sys.stderr, flush=True,
        )  # fmt: skip

    return on_step
