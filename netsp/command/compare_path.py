"""`netsp compare-path`: compare paths made by hand or recorded with the planned tour."""

from __future__ import annotations

import argparse
import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from netsp.base.errors import EXIT_INFEASIBLE, EXIT_NOT_ALL, InputError
from netsp.command import json_output, messages

if TYPE_CHECKING:
    from netsp.exchange.maps.path_file import FoundPath
    from netsp.model.problem import Problem
    from netsp.study.compare.path_comparison import PathComparison


TABLES = (".csv", ".json")
"""File-name extensions of tables."""


def run(args: argparse.Namespace) -> int:
    """Compare the paths, print and write the results, and return the exit code."""
    from netsp.base.files import STANDARD, write_text
    from netsp.model.solution import Solution
    from netsp.study.compare.path_comparison import compare_paths
    from netsp.study.paths import PathPolicy

    if args.json and args.output == STANDARD:
        raise InputError("--json: standard output is taken by the table; expected -o FILE")
    if args.output not in (None, STANDARD) and not args.output.lower().endswith(TABLES):
        raise InputError(f"{args.output}: expected a name ending in {' or '.join(TABLES)}")
    if args.html is not None and not args.html.lower().endswith((".html", ".htm")):
        raise InputError(f"{args.html}: a page is HTML; expected a name ending in .html")
    problem, paths = _inputs(args)
    solution = Solution.load(args.solution) if args.solution else None
    from netsp.command.stages import Stages

    with contextlib.ExitStack() as stack:
        stage = None
        if not args.quiet:
            stage = stack.enter_context(Stages(sys.stderr, args.time_limit, args.policy))
        comparison = compare_paths(
            problem,
            paths,
            solution,
            speed=args.speed or PathPolicy.speed,
            policy=PathPolicy(radius=args.radius),
            time_limit=args.time_limit,
            seed=args.seed,
            on_stage=stage or (lambda text: None),
        )
    if args.json:
        json_output.tell(comparison.to_dict())
    elif args.output == STANDARD:
        sys.stdout.write(comparison.to_csv())
    elif not args.quiet:
        print(describe(comparison))
    if args.output not in (None, STANDARD):
        import json

        as_table = args.output.lower().endswith(".csv")
        text = (
            comparison.to_csv() if as_table else json.dumps(comparison.to_dict(), indent=1) + "\n"
        )
        write_text(args.output, text)
    if args.plot is not None:
        from netsp.view.pictures import style
        from netsp.view.pictures.path_picture import draw_comparison

        style.save(draw_comparison(comparison), args.plot)
    if args.html is not None:
        from netsp.view.report.path_page import page

        write_text(args.html, page(comparison))
    if not args.quiet:
        for name, file in (("table", args.output), ("picture", args.plot), ("page", args.html)):
            if file not in (None, STANDARD):
                print(f"{name:<8} {file}", file=sys.stderr)
    if comparison.tour is None:
        messages.warning(f"there is no tour to compare with: {comparison.tour_note}")
        return EXIT_INFEASIBLE if comparison.is_infeasible else EXIT_NOT_ALL
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
        paths_of_file = read_any_paths(
            file, problem, frame=args.frame, system=args.system, noise=args.noise
        )
        if not args.quiet:
            for note in dict.fromkeys(note for path in paths_of_file for note in path.notes):
                messages.note(note)
        paths += [replace(p, name=label) for p in paths_of_file] if label else paths_of_file
    return problem, paths


def describe(found: PathComparison) -> str:
    """Return a comparison as text.

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
