"""`netsp animate`: a tour or a run as a moving picture."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from netsp.base.errors import InputError
from netsp.command.solve_mission import is_mission
from netsp.command.types import check_writable, positive

if TYPE_CHECKING:
    from netsp.view.pictures.film import Film

EXAMPLE = "netsp animate tour.json --problem problems/wharf.json -o tour.gif"


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument(
        "source",
        metavar="SOURCE",
        nargs="+",
        help="a solution, a planned mission, or the folder of a run of `netsp execute` or "
        "`netsp simulate`; several stand side by side",
    )
    p.add_argument("--problem", metavar="FILE", help="the problem of solution files")
    p.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="FILE",
        help="gif, mp4 (extra video), or a page (html) with a slider",
    )
    p.add_argument(
        "--seconds", type=positive, default=12, metavar="N", help="how long it is; default 12"
    )
    p.add_argument("--fps", type=positive, default=15, metavar="N", help="default 15")
    p.add_argument("--quiet", action="store_true", help="no progress")


MAX_SIDE_BY_SIDE = 3
"""Maximum number of runs in one film."""

PAGE = ".html"
"""Ending of films that are pages."""

MAX_SECONDS = 600
"""Maximum duration of a film, s."""

MAX_FPS = 60
"""Maximum number of frames per second."""


def run(args: argparse.Namespace) -> int:
    """Draw, and return the exit code."""
    check_writable(args.output, inputs=(*args.source, args.problem))
    from netsp.view.pictures.animation import FORMATS, save_animation

    kinds = (*FORMATS, PAGE)
    if Path(args.output).suffix.lower() not in kinds:
        raise InputError(f"{args.output}: expected a name ending in {', '.join(kinds)}")
    for name, value, maximum in (
        ("--seconds", args.seconds, MAX_SECONDS),
        ("--fps", args.fps, MAX_FPS),
    ):
        if value > maximum:
            raise InputError(f"{name}: expected at most {maximum}, got {value}")
    if len(args.source) > MAX_SIDE_BY_SIDE:
        raise InputError(
            f"SOURCE: {len(args.source)} of them; expected {MAX_SIDE_BY_SIDE} or fewer"
        )
    if Path(args.output).suffix.lower() == PAGE:
        return _page(args)
    count = args.seconds * args.fps
    films = [_film(source, args.problem, count) for source in args.source]

    def tell(done: int, of: int) -> None:
        print(f"\r{done} of {of} pictures", end="" if done < of else "\r\x1b[K", file=sys.stderr)

    loud = not args.quiet and sys.stderr.isatty()
    save_animation(films, args.output, args.seconds, args.fps, tell if loud else None)
    return _animate_runs(args)


def _animate_runs(args: argparse.Namespace) -> int:
    if not args.quiet:
        print(f"picture {args.output}", file=sys.stderr)
    return 0


def _in_space(source: str) -> bool:
    """Return whether a source is a mission, or the folder of a flight in space."""
    place = Path(source)
    if place.is_dir():
        return (place / "mission.json").exists() and not (place / "solution.json").exists()
    return is_mission(source)


def _page(args: argparse.Namespace) -> int:
    """Write a page that plays."""
    in_space = [_in_space(source) for source in args.source]
    if all(in_space):
        from netsp.view.pictures.film_page import PAGE_FRAMES, save_page

        films = [_film(source, args.problem, PAGE_FRAMES) for source in args.source]
        names = dict.fromkeys(film.title.split("\n")[0] for film in films)
        save_page(films, " and ".join(names), args.output)
    elif any(in_space):
        raise InputError(
            f"SOURCE: {args.source[in_space.index(True)]} is in space and "
            f"{args.source[in_space.index(False)]} is not; expected a page of one kind"
        )
    elif len(args.source) > 1:
        from netsp.view.report.opened import opened
        from netsp.view.report.side_by_side_page import save_beside

        save_beside([opened(source, args.problem) for source in args.source], args.output)
    else:
        from netsp.view.report.tour_page import report_tour

        report_tour(args.source[0], args.problem, args.output)
    return _animate_runs(args)


def _film(source: str, problem_file: str | None, count: int) -> Film:
    if not _in_space(source):
        from netsp.view.report.opened import opened

        return opened(source, problem_file).film(count)
    if not Path(source).is_dir():
        from netsp.view.pictures.film import film_of_mission
        from netsp.world.mission.mission import Mission

        mission = Mission.load(source)
        return film_of_mission(mission, mission.load_scene(), count)
    from netsp.view.pictures.film import film_of_flight
    from netsp.world.mission.run_log import read_run

    run = read_run(source)
    try:
        return film_of_flight(run, run.mission.load_scene(), count)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{source}: a summary of the run is damaged: {type(error).__name__}: {error}"
        ) from None
