"""`netsp report`: one page about a comparison, a solution or a run."""

from __future__ import annotations

import argparse
import sys

from netsp.base.errors import InputError
from netsp.command.command_options import refuse

PAGES = (".html", ".htm")
"""File-name extensions of pages."""


def run(args: argparse.Namespace) -> int:
    """Write the page, and return the exit code."""
    if not args.output.lower().endswith(PAGES) and args.output != "-":
        raise InputError(
            f"{args.output}: a page is HTML; expected a name ending in .html (a browser prints it "
            "to PDF)"
        )
    if args.results.endswith((".jsonl", ".jsonl.gz")):
        from netsp.view.report.page import write_report

        write_report(args.results, args.output, args.figures)
    else:
        refuse(args, "--figures", f"is for comparisons, and {args.results} is none")
        from netsp.view.report.opened import OpenedMission, open_result
        from netsp.view.report.result_page import write_result_page

        result = open_result(args.results, args.problem)
        if isinstance(result, OpenedMission):
            refuse(args, "--problem", f"{args.results} is of a mission; expected none")
        write_result_page(args.results, result, args.output)
    if args.output != "-":
        print(f"page {args.output}", file=sys.stderr)
    return 0
