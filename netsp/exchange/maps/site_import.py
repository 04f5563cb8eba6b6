"""Import of a problem from a map, by the contract of docs/reference/maps.md.

All complaints are collected and raised together. Every feature of the map ends in the ledger: used
as one kind, or left out for a reason.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from netsp.base.deprecated import renamed_parameters
from netsp.base.errors import InputError
from netsp.base.units import UNITS
from netsp.base.validated import shown
from netsp.exchange.maps.contract import SHAPE_LAYERS, parse_mappings
from netsp.exchange.maps.imported_site import ImportedSite
from netsp.exchange.maps.map_context import MapContext
from netsp.exchange.maps.options import SiteOptions
from netsp.exchange.maps.projection import Projection
from netsp.exchange.maps.read_map import read_map
from netsp.exchange.maps.site_problem import site_of
from netsp.model.problem import Problem


def import_site(
    file: str | Path,
    projection: Projection | None = None,
    *,
    options: SiteOptions | None = None,
    name: str | None = None,
) -> ImportedSite:
    """Return the problem of a map, in metres from its base, y towards the projection's heading.

    Parameters
    ----------
    file : str or Path
        GeoJSON, GPX, .plan, .waypoints, KML, KMZ, shapefile, GeoPackage, DXF, S-57, or another
        format that GDAL reads.
    projection : Projection, optional
        Projection around the base; None for the map's own base, with y towards its heading or
        north.
    name : str, optional
        Name of the problem; default: the file's.

    Returns
    -------
    ImportedSite
        Its problem has an origin if the map has a place on the earth.

    Raises
    ------
    InputError
        The file cannot be read or is no site; `SeveralErrors` if more than one thing is wrong.
    """
    options = options or SiteOptions()
    if options.units is not None and options.units not in UNITS:
        raise InputError(f"units: expected one of {', '.join(UNITS)}, got {shown(options.units)}")
    kinds, fields = parse_mappings(options.maps)
    found = read_map(file, options.crs, options.units, options.policy)
    for layer in kinds:
        if layer not in found.layer_names and layer not in SHAPE_LAYERS:
            typed = next(theirs for _, theirs in options.maps if theirs.lower() == layer)
            if not any(found.layers):
                raise InputError(
                    f"--map: the map has no layers; expected one of {', '.join(SHAPE_LAYERS)}, got "
                    f"{typed!r}"
                )
            raise InputError(
                f"--map: {file} has no layer {typed!r}; it has "
                f"{', '.join(filter(None, found.layers))}"
            )
    properties = {str(name).lower() for feature in found.features for name in feature.properties}
    for ours, theirs in fields.items():
        if theirs not in properties:
            listed = sorted(properties)[: options.policy.max_listed_properties]
            raise InputError(
                f"--map: no feature of {file} has the property {theirs!r}, which is to be its "
                f"{ours}; there are {', '.join(listed) or 'none'}"
            )
    context = MapContext(file, found, options, kinds, fields, projection)
    return site_of(context, name or Path(file).stem)


@renamed_parameters(looking="inspection")
def read_site(
    file: str | Path,
    projection: Projection | None = None,
    *,
    options: SiteOptions | None = None,
    name: str | None = None,
    on_note: Callable[[str], None] | None = None,
    **more: Any,
) -> Problem:
    """Return the problem of a map, as `import_site`; its `site` records the use of every feature.

    Parameters
    ----------
    options : SiteOptions, optional
        Options of the import; its fields may be given by name instead.
    on_note : callable, optional
        Called with assumptions, changes and omissions, one line each.
    **more
        Fields of `SiteOptions`.

    Raises
    ------
    InputError
        As `import_site`.
    """
    found = import_site(file, projection, options=options or SiteOptions(**more), name=name)
    if on_note is not None:
        for note in found.notes:
            on_note(f"{file}: {note}")
    return found.problem
