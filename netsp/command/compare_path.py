"""`netsp compare-path`: compare paths made by hand or recorded with the planned tour."""

from __future__ import annotations

import argparse
import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from netsp.base.errors import EXIT_INFEASIBLE, EXIT_NOT_ALL, InputError
from netsp.command import json_output, messages
from netsp.command.types import check_writable, length, natural, seconds

if TYPE_CHECKING:
    from netsp.exchange.maps.path_file import FoundPath
    from netsp.model.problem import Problem
    from netsp.study.compare.path_comparison import PathComparison

EXAMPLE = (
    "netsp compare-path problems/wharf.json examples/paths/wharf-systematic-1.csv --html page.html"
)

TABLES = (".csv", ".json")


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command line."""
    p.add_argument(
        "problem",
        metavar="PROBLEM",
        help="problem file (JSON), or a study of paths (.toml), which names problem and paths",
    )
    p.add_argument(
        "paths",
        metavar="PATH",
        nargs="*",
        help="a path: table (.csv; columns x, y[, z] or lon, lat[, depth], and t), GeoJSON, GPX, a "
        "recorded flight (.csv.gz, .tlog, .bin) or a solution",
    )
    p.add_argument(
        "--solution", metavar="FILE", help="the planned tour; default: solved on the spot"
    )
    p.add_argument(
        "--radius",
        type=length,
        metavar="R",
        help="distance at which a goal counts as visited, in the problem's units; default 2 %% of "
        "the problem's size",
    )
    p.add_argument(
        "--speed",
        type=length,
        metavar="V",
        help="speed of the tour and of paths without time stamps, in the problem's units per "
        "second; default 0.5",
    )
    p.add_argument(
        "--noise",
        type=length,
        metavar="M",
        default=0.0,
        help="straighten paths by up to M, the error of their positions; default 0",
    )
    p.add_argument(
        "--frame",
        metavar="NAME",
        help="local (the problem's plane) or global (degrees), for recordings and GeoJSON; default "
        "global where the problem has an origin",
    )
    p.add_argument(
        "--system",
        type=natural,
        metavar="N",
        help="the vehicle's system id in a .tlog; default: the only one with positions",
    )
    p.add_argument(
        "--time-limit", type=seconds, metavar="S", help="seconds for the tour; default no limit"
    )
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="random seed; default 0")
    p.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="write a row for the tour and each path: a table (.csv; - is standard output) or JSON",
    )
    p.add_argument("--plot", metavar="FILE", help="draw paths and tour (png, svg or pdf)")
    p.add_argument("--html", metavar="FILE", help="write a page with pictures and tables")
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")
    p.add_argument("--json", action="store_true", help="print all figures as JSON on stdout")


def run(args: argparse.Namespace) -> int:
    """Compare the paths, print and write the results, and return the exit code."""
    from netsp.base.files import STANDARD, write_text
    from netsp.model.solution import Solution
    from netsp.study.compare.path_comparison import compare_paths
    from netsp.study.paths import PathPolicy
    from netsp.study.paths.path_measures import DEFAULT_SPEED
    from netsp.view.pictures import style

    if args.json and args.output == STANDARD:
        raise InputError("--json: standard output is taken by the table; expected -o FILE")
    if args.output not in (None, STANDARD) and not args.output.lower().endswith(TABLES):
        raise InputError(f"{args.output}: expected a name ending in {' or '.join(TABLES)}")
    if args.html is not None and not args.html.lower().endswith((".html", ".htm")):
        raise InputError(f"{args.html}: a page is HTML; expected a name ending in .html")
    check_writable(
        args.output, args.plot, args.html, inputs=(args.problem, args.solution, *args.paths)
    )
    if args.plot is not None:
        style.check_format(args.plot)
    problem, paths = _inputs(args)
    solution = Solution.load(args.solution) if args.solution else None
    from netsp.command.stages import Stages

    with contextlib.ExitStack() as stack:
        stage = None
        if not args.quiet:
            stage = stack.enter_context(Stages(sys.stderr, args.time_limit))
        found = compare_paths(
            problem,
            paths,
            solution,
            speed=args.speed or DEFAULT_SPEED,
            policy=PathPolicy(radius=args.radius),
            time_limit=args.time_limit,
            seed=args.seed,
            on_stage=stage or (lambda text: None),
        )
    if args.json:
        json_output.tell(found.to_dict())
    elif args.output == STANDARD:
        sys.stdout.write(found.to_csv())
    elif not args.quiet:
        print(describe(found))
    if args.output not in (None, STANDARD):
        import json

        as_table = args.output.lower().endswith(".csv")
        text = found.to_csv() if as_table else json.dumps(found.to_dict(), indent=1) + "\n"
        write_text(args.output, text)
    if args.plot is not None:
        from netsp.view.pictures.path_picture import draw_comparison

        style.save(draw_comparison(found), args.plot)
    if args.html is not None:
        from netsp.view.report.path_page import page

        write_text(args.html, page(found))
    if not args.quiet:
        for name, file in (("table", args.output), ("picture", args.plot), ("page", args.html)):
            if file not in (None, STANDARD):
                print(f"{name:<8} {file}", file=sys.stderr)
    if found.tour is None:
        messages.warning(f"there is no tour to compare with: {found.tour_note}")
        return EXIT_INFEASIBLE if found.is_infeasible else EXIT_NOT_ALL
    return 0


def _inputs(args: argparse.Namespace) -> tuple[Problem, list[FoundPath]]:
    """Return the problem and the paths, including those of a study; settings of a study replace
    arguments that are not given."""
    from dataclasses import replace

    from netsp.model.problem import Problem
    from netsp.online.guard.recorded_path import read_any_paths
    from netsp.study.compare.path_study import PathStudy

    files: list[tuple[str, str]] = [(file, "") for file in args.paths]
    problem_file = args.problem
    if problem_file.lower().endswith(".toml"):
        study, place = PathStudy.load(problem_file), Path(problem_file).parent
        problem_file = str(place / study.problem)
        files = [(str(place / path.file), path.label) for path in study.paths] + files
        args.radius, args.speed = args.radius or study.radius, args.speed or study.speed
        args.noise = args.noise or study.noise
    if not files:
        raise InputError("PATH: expected a file with a path, got none")
    problem = Problem.load(problem_file)
    paths = []
    for file, label in files:
        found = read_any_paths(
            file, problem, frame=args.frame, system=args.system, noise=args.noise
        )
        if not args.quiet:
            for note in dict.fromkeys(note for path in found for note in path.notes):
                messages.note(note)
        paths += [replace(p, name=label) for p in found] if label else found
    return problem, paths


def describe(found: PathComparison) -> str:
    """Return a comparison as text.

    Parameters
    ----------
    found : PathComparison
        The comparison.

    Returns
    -------
    str
        A paragraph for the tour and each path, each with its visits.
    """
    from netsp.command.measures import aligned, visit_table
    from netsp.view.report.path_wording import figures_of

    problem, tour, u = found.problem, found.tour, found.problem.units
    parts = [f"{problem.name}: {problem.summary}"]
    if tour is not None and tour.length is not None:
        names = " → ".join(problem.goal_name(v.goal) for v in tour.tour)
        longest = max((v.tether_length for v in tour.tour), default=0.0)
        parts.append(
            "planned tour\n"
            + aligned(
                [
                    ("length", f"{tour.length:.6g} {u}, {found.proof}"),
                    ("time", f"{tour.length / found.speed:.5g} s at {found.speed:.3g} {u}/s"),
                    ("order", names),
                    ("longest tether", f"{longest:.6g} of {problem.tether_length:g} {u}"),
                ]
            )
        )
    for path in found.paths:
        text = f"path {path.name}\n{aligned(figures_of(found, path))}"
        parts.append(text + (f"\n{visit_table(path.measures)}" if path.measures.visits else ""))
    return "\n\n".join(parts)
