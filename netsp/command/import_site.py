"""`netsp import`: make a problem from a map, and say what became of each of its features."""

from __future__ import annotations

import argparse
import math
import sys
from typing import TYPE_CHECKING

from netsp.base.errors import InfeasibleError, InputError
from netsp.command import json_output, messages
from netsp.command.command_options import names_of, refuse
from netsp.command.command_table import IMAGES
from netsp.command.patience import Patience

if TYPE_CHECKING:
    import shapely

    from netsp.exchange.maps.imported_site import ImportedSite
    from netsp.exchange.maps.options import InspectionOptions
    from netsp.exchange.maps.sea_floor import SeaFloor
    from netsp.model.problem import Problem


FOR_MAPS = (
    "--map --crs --radius --inspect --standoff --line-width --join-tolerance --crop --of "
    "--candidates --draught --floor --floor-cell --units"
)
"""Options that do not apply to occupancy images."""


def run(args: argparse.Namespace) -> int:
    """Write the problem, and return the exit code."""
    from netsp.base.files import STANDARD, write_text
    from netsp.exchange.maps.sea_floor import check_suffix

    if args.floor is not None:
        check_suffix(args.floor)

    left_out: tuple[shapely.Geometry, ...] = ()
    viewpoints: frozenset[str] = frozenset()
    floor: SeaFloor | None = None
    found: ImportedSite | None = None
    with Patience(sys.stderr, f"reading {args.site}", args.policy):
        if _is_image(args):
            problem = _read_image(args)
        else:
            found = _import_map(args)
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
    reasons: list[str] = []
    is_cropped = problem.site is not None and problem.site.cropped is not None
    if args.skip_unreachable or (is_cropped and viewpoints):
        from netsp.roadmap.reachable_goals import UNREACHED, keep_reachable_goals, unreached_note

        try:
            with Patience(sys.stderr, "looking for the goals in reach", args.policy):
                goals_before = problem.goals
                problem, reasons = keep_reachable_goals(
                    problem, None if args.skip_unreachable else viewpoints
                )
        except InfeasibleError:
            if found is not None:
                show_table(args.site, found)
            raise
        if reasons and found is not None:
            found = found.keeping(problem, UNREACHED)
            problem, left_out = found.problem, found.left_out
        if args.skip_unreachable:
            for line in reasons:
                messages.note(f"{line}: left out")
        elif reasons:
            messages.note(f"{args.site}: {unreached_note(goals_before, problem.goals)}")
    if found is not None:
        show_table(args.site, found)
    print(f"{problem.name}: {problem.summary}{_extent(problem)}", file=sys.stderr)
    if args.depth is None and (text := surface_warning(problem)) is not None:
        messages.warning(text)
    if (text := height_warning(problem, HEIGHTS_REMEDY)) is not None:
        messages.warning(text)
    write_text(args.output or STANDARD, problem.to_json())
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
                "left_out": list(reasons),
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
    from netsp.exchange.maps.occupancy import FILES
    from netsp.exchange.maps.occupancy import IMAGES as IMAGE_FILES

    image: bool = args.site.lower().endswith((*FILES, *IMAGE_FILES))
    if image:
        refuse(args, FOR_MAPS, f"expected a map with features, got {args.site}")
    else:
        refuse(
            args, names_of(IMAGES), f"expected an occupancy image (YAML, PNG, PGM), got {args.site}"
        )
    return image


def _read_image(args: argparse.Namespace) -> Problem:
    """Return the problem in an occupancy image."""
    from netsp.exchange.maps.csv_table import from_table
    from netsp.exchange.maps.occupancy import read_occupancy

    for name, form in (("base", "X,Y"), ("goals", "TABLE"), ("tether", "L")):
        if getattr(args, name) is None:
            raise InputError(f"{args.site}: an occupancy image needs --{name} {form}")
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
    """Print a table of how the features of each layer were used, and the notes of the import."""
    from netsp.command.text_table import print_table

    record = found.problem.site
    assert record is not None
    print_table(record.table(), sys.stderr)
    left_out = set(record.notes)
    for note in found.notes:
        if note not in left_out:  # these stand in the table
            messages.note(f"{site}: {note}")


def _import_map(args: argparse.Namespace) -> ImportedSite:
    """Import a map with features."""
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
        refuse(args, "--standoff --of", "expected --inspect N with it")
        return None
    if args.standoff is None:
        raise InputError("--inspect: expected --standoff S with it")
    try:
        depths = tuple(0.0 - abs(float(d)) for d in args.depths.split(","))
    except ValueError:
        raise InputError(f"--depths: expected numbers with commas, got {args.depths!r}") from None
    return InspectionOptions(args.inspect, args.standoff, depths, Selection.parse(args.of))
