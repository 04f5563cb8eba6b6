"""`netsp animate`: a tour or a run as a moving picture."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from netsp.command.types import check_writable, positive
from netsp.errors import InputError

if TYPE_CHECKING:
    from netsp.pictures.animation import Film

EXAMPLE = "netsp animate tour.json --problem problems/wharf.json -o tour.gif"


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument(
        "source", metavar="SOURCE", nargs="+",
        help="a solution, or the folder of a run of `netsp execute` or `netsp simulate`; several "
        "stand side by side",
    )  # fmt: skip
    p.add_argument("--problem", metavar="FILE", help="the problem of solution files")
    p.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="FILE",
        help="gif, mp4 (extra video), or a page (html) with a slider, of one",
    )
    p.add_argument(
        "--seconds", type=positive, default=12, metavar="N", help="how long it is; default 12"
    )
    p.add_argument("--fps", type=positive, default=15, metavar="N", help="default 15")
    p.add_argument("--quiet", action="store_true", help="no progress")


MOST_SIDE_BY_SIDE, PAGE = 3, ".html"

MOST_SECONDS, MOST_FPS = 600, 60
"""Of a film."""


def run(args: argparse.Namespace) -> int:
    """Draw, and return the exit code."""
    check_writable(args.output, inputs=(*args.source, args.problem))
    from netsp.pictures.animation import FORMATS, save_animation

    kinds = (*FORMATS, PAGE)
    if Path(args.output).suffix.lower() not in kinds:
        raise InputError(f"{args.output}: expected a name ending in {', '.join(kinds)}")
    for name, value, most in (
        ("--seconds", args.seconds, MOST_SECONDS), ("--fps", args.fps, MOST_FPS)
    ):  # fmt: skip
        if value > most:
            raise InputError(f"{name}: expected at most {most}, got {value}")
    if len(args.source) > MOST_SIDE_BY_SIDE:
        raise InputError(
            f"SOURCE: {len(args.source)} of them; expected {MOST_SIDE_BY_SIDE} or fewer"
        )
    if Path(args.output).suffix.lower() == PAGE:
        return _page(args)
    count = args.seconds * args.fps
    films = [_film(source, args.problem, count) for source in args.source]

    def tell(done: int, of: int) -> None:
        print(f"\r{done} of {of} pictures", end="" if done < of else "\r\x1b[K", file=sys.stderr)

    loud = not args.quiet and sys.stderr.isatty()
    save_animation(films, args.output, args.seconds, args.fps, tell if loud else None)
    return _told(args)


def _told(args: argparse.Namespace) -> int:
    if not args.quiet:
        print(f"picture {args.output}", file=sys.stderr)
    return 0


def _is_flight(source: str) -> bool:
    """Whether it is the folder of a flight in space."""
    place = Path(source)
    return (place / "mission.json").exists() and not (place / "solution.json").exists()


def _page(args: argparse.Namespace) -> int:
    """A page that plays."""
    flights = [_is_flight(source) for source in args.source]
    if all(flights):
        from netsp.online.log import read_run
        from netsp.pictures.mission import save_page

        runs = [read_run(source) for source in args.source]
        try:
            save_page(runs, runs[0].mission.load_scene(), args.output)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                f"{', '.join(args.source)}: a summary of the run is damaged: "
                f"{type(error).__name__}: {error}"
            ) from None
        return _told(args)
    if len(args.source) > 1:
        raise InputError(f"{args.output}: a page shows one tour, or flights in space; expected one")
    from netsp.report.tour import report_tour

    report_tour(args.source[0], args.problem, args.output)
    return _told(args)


def _flight(source: str, count: int) -> Film:
    from netsp.online.log import read_run
    from netsp.pictures.animation import Film, Space
    from netsp.pictures.mission import stops_of
    from netsp.pictures.moments import moments_of_flight

    run = read_run(source)
    scene = run.mission.load_scene()
    title = f"{run.mission.name}, by {run.planner}"
    stops = replace(stops_of(run), anchor=run.mission.anchor)
    moments = moments_of_flight(run, scene, count)
    return Film(title, moments, run.log[-1].time, Space(scene, stops))


def _film(source: str, problem_file: str | None, count: int) -> Film:
    if _is_flight(source):
        return _flight(source, count)
    import numpy as np

    from netsp.geometry import polylines
    from netsp.pictures.animation import Film
    from netsp.pictures.moments import moments_of_plan, moments_of_run
    from netsp.report.opened import opened

    what = opened(source, problem_file)
    problem, solution = what.problem, what.solution
    if what.tethers:
        try:
            moments = moments_of_run(what.maps, what.rows, what.tethers, count)
            seconds = float(what.rows[-1]["time"])
        except (KeyError, ValueError, TypeError, OverflowError) as error:
            raise InputError(
                f"{source}: a file of the run is damaged: {type(error).__name__}: {error}"
            ) from None
        return Film(f"{problem.name}, carried out", moments, seconds)
    title = f"{problem.name}: {solution.solver}, {solution.length:.4g} {problem.units}"
    moments = moments_of_plan(problem, solution, count)
    return Film(title, moments, float(polylines.length(np.array(solution.path))))
