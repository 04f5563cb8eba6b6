"""`netsp animate`: a tour or a run as a moving picture."""

from __future__ import annotations

import argparse
import sys
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
        help="a solution, or the folder of a run of `netsp execute`; several stand side by side",
    )  # fmt: skip
    p.add_argument("--problem", metavar="FILE", help="the problem of solution files")
    p.add_argument(
        "-o", "--output", required=True, metavar="FILE", help="gif, or mp4 (extra video)"
    )
    p.add_argument(
        "--seconds", type=positive, default=12, metavar="N", help="how long it is; default 12"
    )
    p.add_argument("--fps", type=positive, default=15, metavar="N", help="default 15")
    p.add_argument("--quiet", action="store_true", help="no progress")


MOST_SIDE_BY_SIDE = 3


def run(args: argparse.Namespace) -> int:
    """Draw, and return the exit code."""
    check_writable(args.output, inputs=(*args.source, args.problem))
    from netsp.pictures.animation import FORMATS, save_animation

    if Path(args.output).suffix.lower() not in FORMATS:
        raise InputError(f"{args.output}: expected a name ending in {' or '.join(FORMATS)}")
    if len(args.source) > MOST_SIDE_BY_SIDE:
        raise InputError(
            f"SOURCE: {len(args.source)} of them; expected {MOST_SIDE_BY_SIDE} or fewer"
        )
    count = args.seconds * args.fps
    films = [_film(source, args.problem, count) for source in args.source]

    def tell(done: int, of: int) -> None:
        print(f"\r{done} of {of} pictures", end="" if done < of else "\n", file=sys.stderr)

    loud = not args.quiet and sys.stderr.isatty()
    save_animation(films, args.output, args.seconds, args.fps, tell if loud else None)
    return 0


def _film(source: str, problem_file: str | None, count: int) -> Film:
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
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(
                f"{source}: a file of the run is damaged: {type(error).__name__}: {error}"
            ) from None
        return Film(f"{problem.name}, carried out", moments, seconds)
    title = f"{problem.name}: {solution.solver}, {solution.length:.4g} {problem.units}"
    moments = moments_of_plan(problem, solution, count)
    return Film(title, moments, float(polylines.length(np.array(solution.path))))
