"""`netsp report`: one page about a comparison, a solution or a run."""

from __future__ import annotations

import argparse
import sys

from netsp.base.errors import InputError
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
        from netsp.view.report.opened import OpenedMission, open_result
        from netsp.view.report.result_page import write_result_page

        what = open_result(args.results, args.problem)
        if isinstance(what, OpenedMission) and args.problem is not None:
            raise InputError(f"--problem: {args.results} is of a mission; expected none")
        write_result_page(args.results, what, args.output)
        return
    from netsp.view.report.page import write_report

    write_report(args.results, args.output, args.figures)
