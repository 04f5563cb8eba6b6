"""`netsp import`: a problem from a map."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from netsp.command import messages
from netsp.command.types import check_writable, length, option, positive
from netsp.errors import InputError

if TYPE_CHECKING:
    from netsp.site.options import Looking

EXAMPLE = "netsp import examples/site.geojson -o problem.json"


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument(
        "site", metavar="SITE",
        help="map: GeoJSON, KML, KMZ, shapefile, GeoPackage, DXF or S-57 (docs/sites.md)",
    )  # fmt: skip
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
        "--map", action="append", type=option, default=[], metavar="OURS=THEIRS",
        help="what a layer holds (base, goal, obstacle, bounds, path, ignore=LAYER) or what a "
        "property is called (name, radius, depth, tether_length, clearance, heading=PROPERTY)",
    )  # fmt: skip
    p.add_argument(
        "--crs", metavar="SYSTEM",
        help="coordinate system of a file that names none, as EPSG:32632; local for a plane",
    )  # fmt: skip
    p.add_argument(
        "--units", default="m", metavar="UNIT",
        help="of lengths and of local coordinates in the file: m, km, cm, mm, ft, us-ft, in, yd, "
        "fathom; default m",
    )  # fmt: skip
    p.add_argument(
        "--inspect", type=positive, metavar="N", help="N goals about every obstacle, at every depth"
    )
    p.add_argument(
        "--standoff", type=length, metavar="S",
        help="distance (m) of those goals from its surface",
    )  # fmt: skip
    p.add_argument(
        "--depths", default="0", metavar="D[,D…]", help="depths (m) of those goals; default 0"
    )
    p.add_argument(
        "--skip-unreachable", action="store_true",
        help="leave out goals farther from the base than the tether is long, and say so",
    )  # fmt: skip
    p.add_argument(
        "-o", "--output", metavar="FILE", help="write the problem to this file (default: stdout)"
    )


def run(args: argparse.Namespace) -> int:
    """Write the problem, and return the exit code."""
    check_writable(args.output, inputs=(args.site,))
    from netsp.files import write_text
    from netsp.site.options import SiteOptions
    from netsp.site.projection import Projection
    from netsp.site.read import read_site

    projection = Projection.parse(args.base, name="--base") if args.base else None
    options = SiteOptions(
        tether=args.tether, clearance=args.clearance, radius=args.radius, crs=args.crs,
        units=args.units, maps=args.map, looking=_looking(args),
        skip_unreachable=args.skip_unreachable,
    )  # fmt: skip
    problem = read_site(args.site, projection, options=options, on_note=messages.note)
    print(
        f"{problem.name}: {problem.summary}",
        file=sys.stderr,
    )
    if args.output is None:
        sys.stdout.write(problem.to_json())
    else:
        write_text(args.output, problem.to_json())
    return 0


def _looking(args: argparse.Namespace) -> Looking | None:
    """How obstacles are looked at, where that is asked for."""
    from netsp.site.options import Looking

    if args.inspect is None:
        if args.standoff is not None:
            raise InputError("--standoff: expected --inspect N with it")
        return None
    if args.standoff is None:
        raise InputError("--inspect: expected --standoff S with it")
    try:
        depths = tuple(0.0 - abs(float(d)) for d in args.depths.split(","))
    except ValueError:
        raise InputError(f"--depths: expected numbers with commas, got {args.depths!r}") from None
    return Looking(args.inspect, args.standoff, depths)
