"""`netsp report`: one page about a comparison, a solution or a run."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from netsp.base.errors import InputError
from netsp.command.solve_mission import is_mission
from netsp.command.types import check_writable

EXAMPLE = "netsp report rows.jsonl -o report.html"


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument(
        "results",
        metavar="RESULTS",
        help="rows of `netsp compare`, a solution, a planned mission, or the folder of a run",
    )
    p.add_argument("--problem", metavar="FILE", help="the problem of a solution file")
    p.add_argument(
        "-o", "--output", required=True, metavar="FILE", help="write the page (HTML) to this file"
    )
    p.add_argument(
        "--figures", choices=("svg", "png", "pdf"), help="also save the figures beside the page"
    )


def run(args: argparse.Namespace) -> int:
    """Write the page, and return the exit code."""
    check_writable(args.output, inputs=(args.results, args.problem))
    if not args.output.lower().endswith(PAGES) and args.output != "-":
        raise InputError(
            f"{args.output}: a page is HTML; expected a name ending in .html (a browser prints it "
            "to PDF)"
        )
    _written(args)
    if args.output != "-":
        print(f"page {args.output}", file=sys.stderr)
    return 0


PAGES = (".html", ".htm")


def _written(args: argparse.Namespace) -> None:
    if not args.results.endswith((".jsonl", ".jsonl.gz")):
        if args.figures is not None:
            raise InputError(f"--figures: is for comparisons, and {args.results} is none")
        if _of_mission(args.results):
            from netsp.view.report.mission_page import report_mission

            if args.problem is not None:
                raise InputError(f"--problem: {args.results} is of a mission; expected none")
            report_mission(args.results, args.output)
            return
        from netsp.view.report.tour_page import report_tour

        report_tour(args.results, args.problem, args.output)
        return
    from netsp.view.report.page import write_report

    write_report(args.results, args.output, args.figures)


def _of_mission(source: str) -> bool:
    """Return whether a source is a mission, or the folder of a flown one."""
    place = Path(source)
    if place.is_dir():
        return (place / "mission.json").exists() and not (place / "solution.json").exists()
    return is_mission(source)
