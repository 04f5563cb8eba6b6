"""`netsp import`: a problem from a map."""

from __future__ import annotations

import argparse
import sys

from netsp.command.types import (
    check_writable,
    length,
)

EXAMPLE = "netsp import examples/site.geojson -o problem.json"


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument("site", metavar="SITE", help="GeoJSON file: obstacles and goals")
    p.add_argument(
        "--base",
        metavar="LAT,LON[,HEADING]",
        help="position of the base, and compass heading of the y axis; default: from the file",
    )
    p.add_argument(
        "--tether", type=length, metavar="L", help="tether length (m); default: from the file"
    )
    p.add_argument(
        "--clearance",
        type=length,
        metavar="C",
        help="clearance from obstacles (m); default: from the file, or 0",
    )
    p.add_argument(
        "--radius",
        type=length,
        metavar="R",
        help="radius (m) of point obstacles that have none in the file",
    )
    p.add_argument(
        "-o", "--output", metavar="FILE", help="write the problem to this file (default: stdout)"
    )


def run(args: argparse.Namespace) -> int:
    """Write the problem, and return the exit code."""
    check_writable(args.output, inputs=(args.site,))
    from netsp.files import write_text
    from netsp.site.projection import Projection
    from netsp.site.read import read_site

    projection = Projection.parse(args.base, name="--base") if args.base else None
    problem = read_site(
        args.site, projection, tether=args.tether, clearance=args.clearance, radius=args.radius
    )
    print(
        f"{problem.name}: {problem.summary}",
        file=sys.stderr,
    )
    if args.output is None:
        sys.stdout.write(problem.to_json())
    else:
        write_text(args.output, problem.to_json())
    return 0
