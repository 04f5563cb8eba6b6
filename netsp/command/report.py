"""`netsp report`: one page about a comparison, a solution or a run."""

from __future__ import annotations

import argparse

from netsp.command.types import check_writable

EXAMPLE = "netsp report rows.jsonl -o report.html"


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument(
        "results", metavar="RESULTS",
        help="rows of `netsp compare`, a solution file, or the folder of `netsp execute`",
    )  # fmt: skip
    p.add_argument("--problem", metavar="FILE", help="the problem of a solution file")
    p.add_argument(
        "-o", "--output", required=True, metavar="FILE", help="write the page (HTML) to this file"
    )
    p.add_argument(
        "--figures", choices=("svg", "png", "pdf"), help="also save the figures beside the page"
    )


def run(args: argparse.Namespace) -> int:
    """Write the page, and return the exit code."""
    if not args.results.endswith((".jsonl", ".jsonl.gz")):
        from netsp.report.tour import report_tour

        check_writable(args.output, inputs=(args.results, args.problem))
        report_tour(args.results, args.problem, args.output)
        return 0
    from netsp.report.page import write_report

    check_writable(args.output, inputs=(args.results,))
    write_report(args.results, args.output, args.figures)
    return 0
