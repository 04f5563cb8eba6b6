"""`netsp animate`: a tour or a run as a moving picture."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from netsp.base.errors import InputError

PAGE = ".html"
"""File-name extension of films that are pages."""


def run(args: argparse.Namespace) -> int:
    """Write the film, and return the exit code."""
    from netsp.view.pictures.animation import FORMATS, save_animation
    from netsp.view.report.opened import open_result

    kinds = (*FORMATS, PAGE)
    if Path(args.output).suffix.lower() not in kinds:
        raise InputError(f"{args.output}: expected a name ending in {', '.join(kinds)}")
    for name, value, maximum in (
        ("--seconds", args.seconds, args.policy.max_film_s),
        ("--fps", args.fps, args.policy.max_fps),
    ):
        if value > maximum:
            raise InputError(f"{name}: expected at most {maximum}, got {value}")
    if len(args.source) > args.policy.max_films:
        raise InputError(
            f"SOURCE: {len(args.source)} of them; expected {args.policy.max_films} or fewer"
        )
    if Path(args.output).suffix.lower() == PAGE:
        return _page(args)
    count = args.seconds * args.fps
    films = [open_result(source, args.problem).film(count) for source in args.source]

    def show_progress(done: int, total: int) -> None:
        print(
            f"\r{done} of {total} pictures", end="" if done < total else "\r\x1b[K", file=sys.stderr
        )

    is_shown = not args.quiet and sys.stderr.isatty()
    save_animation(films, args.output, args.seconds, args.fps, show_progress if is_shown else None)
    return _report_picture(args)


def _report_picture(args: argparse.Namespace) -> int:
    """Print the name of the picture, and return the exit code."""
    if not args.quiet:
        print(f"picture {args.output}", file=sys.stderr)
    return 0


def _page(args: argparse.Namespace) -> int:
    """Write the film as a page with a slider, and return the exit code."""
    from netsp.view.report.opened import Opened, OpenedMission, open_result

    results = [open_result(source, args.problem) for source in args.source]
    missions = [result for result in results if isinstance(result, OpenedMission)]
    tours = [result for result in results if isinstance(result, Opened)]
    if missions and tours:
        sources = dict(zip(map(type, results), args.source, strict=True))
        raise InputError(
            f"SOURCE: {sources[OpenedMission]} is in space and {sources[Opened]} is not; expected "
            "a page of one kind"
        )
    if missions:
        from netsp.view.pictures.film_page import save_page
        from netsp.view.pictures.picture_layout import PageLayout

        films = [result.film(PageLayout.frames) for result in missions]
        names = dict.fromkeys(film.title.split("\n")[0] for film in films)
        save_page(films, " and ".join(names), args.output)
    elif len(tours) > 1:
        from netsp.view.report.side_by_side_page import save_beside

        save_beside(tours, args.output)
    else:
        from netsp.view.report.result_page import write_result_page

        write_result_page(args.source[0], tours[0], args.output)
    return _report_picture(args)
