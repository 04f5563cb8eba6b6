"""`netsp import`: make a problem from a map, and say what became of each of its features."""

from __future__ import annotations

import argparse
import math
import sys
from typing import TYPE_CHECKING

from netsp.base.errors import InfeasibleError, InputError
from netsp.command import json_output, messages
from netsp.command.patience import Patience
from netsp.command.types import check_writable, depth, length, option, positive

if TYPE_CHECKING:
    import shapely

    from netsp.exchange.maps.imported_site import ImportedSite
    from netsp.exchange.maps.options import InspectionOptions
    from netsp.exchange.maps.sea_floor import SeaFloor
    from netsp.model.problem import Problem

EXAMPLE = "netsp import examples/site.geojson -o problem.json"


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command line."""
    p.add_argument(
        "site",
        metavar="SITE",
        help="map: GeoJSON, KML, KMZ, shapefile, GeoPackage, DXF, S-57, GPX, .plan or .waypoints; "
        "or an occupancy image: YAML, PNG, PGM (docs/sites.md)",
    )
    p.add_argument(
        "--base",
        metavar="LAT,LON[,HEADING]",
        help="position of the base, and compass heading of the y axis; default: from the file; "
        "X,Y (m) in an occupancy image",
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
        "--map",
        action="append",
        type=option,
        default=[],
        metavar="OURS=THEIRS",
        help="what a layer holds (base, goal, obstacle, bounds, path, ignore=LAYER) or what a "
        "property is called (name, radius, depth, tether_length, clearance, heading=PROPERTY)",
    )
    p.add_argument(
        "--crs",
        metavar="SYSTEM",
        help="coordinate system of a file that names none, as EPSG:32632; local for a plane",
    )
    p.add_argument(
        "--units",
        metavar="UNIT",
        help="unit of lengths and of local coordinates in the file: m, km, cm, mm, ft, us-ft, in, "
        "yd, fathom; default: the unit that the file states, or m",
    )
    p.add_argument(
        "--line-width",
        type=length,
        metavar="W",
        help="width (m) of open lines that are obstacles and have none in the file",
    )
    p.add_argument(
        "--join-tolerance",
        type=length,
        metavar="T",
        help="join lines to an outline where their ends are no farther apart (m); default 0.01",
    )
    p.add_argument(
        "--crop",
        action=argparse.BooleanOptionalAction,
        help="leave out obstacles beyond the reach of the tether; default: in charts only",
    )
    p.add_argument(
        "--inspect", type=positive, metavar="N", help="N goals about every obstacle, at every depth"
    )
    p.add_argument(
        "--standoff", type=length, metavar="S", help="distance (m) of those goals from its surface"
    )
    p.add_argument(
        "--of",
        action="append",
        type=option,
        default=[],
        metavar="WORD=VALUE",
        help="inspect these obstacles only: layer=NAME, name=NAME (with * and ?), "
        "box=XMIN,YMIN,XMAX,YMAX (m), earth=SOUTH,WEST,NORTH,EAST (degrees); repeat a word for "
        "alternatives, different words must all match",
    )
    p.add_argument(
        "--depths", default="0", metavar="D[,D…]", help="depths (m) of those goals; default 0"
    )
    p.add_argument(
        "--depth", type=depth, metavar="D", help="depth of all goals (m), instead of their own"
    )
    p.add_argument(
        "--skip-unreachable",
        action="store_true",
        help="leave out goals that the tether cannot reach, and say which and why",
    )
    p.add_argument(
        "--goals",
        metavar="TABLE",
        help="more goals: CSV with the columns x, y (m) or lat, lon, and perhaps z or depth, name",
    )
    p.add_argument(
        "--candidates",
        metavar="TABLE",
        help="places where the base may stand (columns as for --goals); a cropped map keeps the "
        "reach from each of them",
    )
    charts = p.add_argument_group("charts")
    charts.add_argument(
        "--draught",
        type=depth,
        metavar="D",
        help="areas that may be shallower than this (m), or are not surveyed, become obstacles",
    )
    charts.add_argument(
        "--floor",
        metavar="FILE",
        help="write the sea floor of the chart's depths (.asc, .tif), for scenes",
    )
    charts.add_argument(
        "--floor-cell",
        type=length,
        metavar="C",
        help="size of its cells (m); default: 256 along a side",
    )
    images = p.add_argument_group("occupancy images")
    images.add_argument(
        "--resolution",
        type=length,
        metavar="R",
        help="size of a cell (m), of an image without YAML",
    )
    images.add_argument(
        "--tolerance",
        type=length,
        metavar="T",
        help="how far obstacles may go beyond occupied cells (m); default: a cell",
    )
    images.add_argument(
        "--unknown-free",
        action="store_true",
        help="take cells that the map does not know as free, not as obstacles",
    )
    p.add_argument(
        "--plot", metavar="FILE", help="draw the problem, what was left out dashed: PNG, SVG or PDF"
    )
    p.add_argument(
        "-o", "--output", metavar="FILE", help="write the problem to this file (default: stdout)"
    )
    json_output.json_flag(p)


def run(args: argparse.Namespace) -> int:
    """Write the problem, and return the exit code."""
    json_output.check_stdout(args)
    check_writable(
        args.output, args.plot, args.floor, inputs=(args.site, args.goals, args.candidates)
    )
    from netsp.base.files import write_text
    from netsp.exchange.maps.sea_floor import check_suffix

    if args.floor is not None:
        check_suffix(args.floor)

    left_out: tuple[shapely.Geometry, ...] = ()
    viewpoints: frozenset[str] = frozenset()
    floor: SeaFloor | None = None
    found: ImportedSite | None = None
    with Patience(sys.stderr, f"reading {args.site}"):
        if _is_image(args):
            problem = _of_image(args)
        else:
            found = _of_map(args)
            problem, left_out, floor = found.problem, found.left_out, found.floor
            viewpoints = found.viewpoints
    from netsp.exchange.maps.goal_depths import (
        HEIGHTS_REMEDY,
        height_warning,
        surface_warning,
        with_depth,
    )

    if args.depth is not None:
        problem = with_depth(problem, args.depth)
    why: list[str] = []
    is_cropped = problem.site is not None and problem.site.cropped is not None
    if args.skip_unreachable or (is_cropped and viewpoints):
        from netsp.roadmap.reachable_goals import UNREACHED, keep_reachable_goals, unreached_note

        try:
            with Patience(sys.stderr, "looking for the goals in reach"):
                before = problem.goals
                problem, why = keep_reachable_goals(
                    problem, None if args.skip_unreachable else viewpoints
                )
        except InfeasibleError:
            if found is not None:
                show_table(args.site, found)
            raise
        if why and found is not None:
            found = found.keeping(problem, UNREACHED)
            problem, left_out = found.problem, found.left_out
        if args.skip_unreachable:
            for line in why:
                messages.note(f"{line}: left out")
        elif why:
            messages.note(f"{args.site}: {unreached_note(before, problem.goals)}")
    if found is not None:
        show_table(args.site, found)
    print(f"{problem.name}: {problem.summary}{_extent(problem)}", file=sys.stderr)
    if args.depth is None and (text := surface_warning(problem)) is not None:
        messages.warning(text)
    if (text := height_warning(problem, HEIGHTS_REMEDY)) is not None:
        messages.warning(text)
    if args.output is None:
        sys.stdout.write(problem.to_json())
    else:
        write_text(args.output, problem.to_json())
    if floor is not None:
        floor.save(args.floor)
    if args.plot is not None:
        from netsp.view.pictures.problem_picture import save_import

        save_import(problem, left_out, args.plot)
    if args.json:
        json_output.tell(
            {
                "problem": problem.name,
                "units": problem.units,
                "goals": len(problem.goals),
                "obstacles": len(problem.obstacles),
                "tether_length": problem.tether_length,
                "clearance": problem.clearance,
                "left_out": list(why),
                "file": args.output,
                "site": None if problem.site is None else problem.site.model_dump(mode="json"),
            }
        )
    return 0


def _extent(problem: Problem) -> str:
    """Return clearance, extent and place on the earth in words, which show slips in the map."""
    import numpy as np

    places = np.vstack([problem.points[:, :2], problem.representative_points.reshape(-1, 2)])
    wide, high = np.round(np.ptp(places, axis=0), 3) + 0.0
    description = f", clearance {problem.clearance:g} {problem.units}"
    description += f"; {wide:.3g} x {high:.3g} {problem.units}"
    if problem.origin is not None:
        lat, lon = problem.origin.latitude, problem.origin.longitude
        north, east = "N" if lat >= 0.0 else "S", "E" if lon >= 0.0 else "W"
        description += f", base at {abs(lat):.6g} {north}, {abs(lon):.6g} {east}"
    return description


def _is_image(args: argparse.Namespace) -> bool:
    """Return whether the site is an occupancy image; refuse options of the other kind."""
    from netsp.exchange.maps.occupancy import FILES, IMAGES

    image: bool = args.site.lower().endswith((*FILES, *IMAGES))
    wrong = (
        (
            "map",
            "crs",
            "radius",
            "inspect",
            "standoff",
            "line_width",
            "join_tolerance",
            "crop",
            "of",
            "candidates",
            "draught",
            "floor",
            "floor_cell",
            "units",
        )
        if image
        else ("resolution", "tolerance", "unknown_free")
    )
    for name in wrong:
        if getattr(args, name):
            kind = "a map with features" if image else "an occupancy image (YAML, PNG, PGM)"
            raise InputError(f"--{name.replace('_', '-')}: expected {kind}, got {args.site}")
    return image


def _of_image(args: argparse.Namespace) -> Problem:
    from netsp.exchange.maps.csv_table import from_table
    from netsp.exchange.maps.occupancy import read_occupancy

    for name, what in (("base", "X,Y"), ("goals", "TABLE"), ("tether", "L")):
        if getattr(args, name) is None:
            raise InputError(f"{args.site}: an occupancy image needs --{name} {what}")
    try:
        base = tuple(float(v) for v in args.base.split(","))
    except ValueError:
        base = ()
    if not all(map(math.isfinite, base)):
        base = ()
    if len(base) not in (2, 3):
        raise InputError(f"--base: expected X,Y or X,Y,Z (m) in an image, got {args.base!r}")
    places, names = from_table(args.goals, on_note=messages.note)
    goals = [
        {"position": tuple(p), "name": n or f"g{k}"}
        for k, (p, n) in enumerate(zip(places.tolist(), names, strict=True), 1)
    ]
    return read_occupancy(
        args.site,
        base,
        goals,
        args.tether,
        clearance=args.clearance or 0.0,
        resolution=args.resolution,
        tolerance=args.tolerance,
        unknown_is_free=args.unknown_free,
        on_note=messages.note,
    )


def show_table(site: str, found: ImportedSite) -> None:
    """Print a table of how the features of each layer were used, and the notes of the import.

    Parameters
    ----------
    site : str
        Name of the map.
    found : ImportedSite
        Result of the import.
    """
    from netsp.command.text_table import print_table

    record = found.problem.site
    assert record is not None
    print_table(record.table(), sys.stderr)
    left_out = set(record.notes)
    for note in found.notes:
        if note not in left_out:  # these stand in the table
            messages.note(f"{site}: {note}")


def _of_map(args: argparse.Namespace) -> ImportedSite:
    from netsp.exchange.maps.options import SiteOptions
    from netsp.exchange.maps.projection import Projection
    from netsp.exchange.maps.site_import import import_site

    projection = Projection.parse(args.base, name="--base") if args.base else None
    options = SiteOptions(
        tether=args.tether,
        clearance=args.clearance,
        radius=args.radius,
        crs=args.crs,
        units=args.units,
        maps=args.map,
        inspection=_inspection(args),
        skip_unreachable=args.skip_unreachable,
        line_width=args.line_width,
        crop=args.crop,
        goals=args.goals,
        candidates=args.candidates,
        draught=args.draught,
        floor=args.floor is not None,
        floor_cell=args.floor_cell,
        **({} if args.join_tolerance is None else {"join_tolerance": args.join_tolerance}),
    )
    return import_site(args.site, projection, options=options)


def _inspection(args: argparse.Namespace) -> InspectionOptions | None:
    """Return how to inspect obstacles; None without --inspect."""
    from netsp.exchange.maps.options import InspectionOptions
    from netsp.exchange.maps.selection import Selection

    if args.inspect is None:
        for name in ("standoff", "of"):
            if getattr(args, name):
                raise InputError(f"--{name}: expected --inspect N with it")
        return None
    if args.standoff is None:
        raise InputError("--inspect: expected --standoff S with it")
    try:
        depths = tuple(0.0 - abs(float(d)) for d in args.depths.split(","))
    except ValueError:
        raise InputError(f"--depths: expected numbers with commas, got {args.depths!r}") from None
    return InspectionOptions(args.inspect, args.standoff, depths, Selection.parse(args.of))
