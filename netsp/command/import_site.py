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
        "--base", metavar="LAT,LON[,HEADING]", help="where the tether is fixed; default the file's"
    )
    p.add_argument("--tether", type=length, metavar="L", help="tether length; default the file's")
    p.add_argument("--clearance", type=length, metavar="C", help="default the file's, or 0")
    p.add_argument("--radius", type=length, metavar="R", help="of obstacles that have none")
    p.add_argument("-o", "--output", metavar="FILE", help="write the problem here (else stdout)")


def run(args: argparse.Namespace) -> int:
    """Write the problem, and return the exit code."""
    check_writable(args.output, inputs=(args.site,))
    from netsp.export.projection import Projection
    from netsp.export.site import read_site
    from netsp.files import write_text

    projection = Projection.parse(args.base, name="--base") if args.base else None
    problem = read_site(
        args.site, projection, tether=args.tether, clearance=args.clearance, radius=args.radius
    )
    print(
        f"{problem.name}: {len(problem.goals)} goals, {len(problem.obstacles)} obstacles, tether "
        f"{problem.tether_length:g} m",
        file=sys.stderr,
    )
    if args.output is None:
        sys.stdout.write(problem.to_json())
    else:
        write_text(args.output, problem.to_json())
    return 0
