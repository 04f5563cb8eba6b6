"""Reader of places from a table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.columns import MAP_PAIRS, Quantity
from netsp.base.errors import InputError
from netsp.base.table_file import read_table
from netsp.base.validated import shown
from netsp.exchange.maps.projection import Projection


def from_table(
    file: str | Path,
    projection: Projection | None = None,
    on_note: Callable[[str], None] | None = None,
) -> tuple[Floats, list[str | None]]:
    """Return places and their names from a table.

    Parameters
    ----------
    file : str or Path
        Table whose first line names its columns in any order (`netsp.base.columns`): x, y (easting,
        northing without a projection; lat, lon with one), and perhaps z or depth, and name.
    projection : Projection, optional
        Projection of latitudes and longitudes into the plane.
    on_note : callable, optional
        Called with one line each for decimal commas and for unused columns.

    Returns
    -------
    places : ndarray, shape (k, 2) or (k, 3)
        Metres, z upwards.
    names : list of str or None
        Name of each place.

    Raises
    ------
    InputError
        The table has no such columns, or degrees without a projection.
    """
    table = read_table(file)
    # coordinates of a map are not those of a plane about a base
    pair = table.pair(MAP_PAIRS if projection is None else (("x", "y"),))
    is_global = pair is None and table.pair((("latitude", "longitude"),)) is not None
    if is_global and projection is None:
        raise InputError(
            f"{file}: positions are in degrees, and the site has no place on the earth; expected "
            "the columns x, y (m)"
        )
    plane: tuple[Quantity, Quantity] | None = ("latitude", "longitude") if is_global else pair
    if plane is None or not table.rows:
        wanted = "x, y" if projection is None else "x, y (m) or lat, lon"
        raise table.wanted(f"a table with the columns {wanted} and perhaps z or depth, name")
    up = table.height()
    label: Quantity = "name" if "name" in table else "identifier"
    used: list[Quantity] = [*plane, up] if up else [*plane]
    places = table.numbers(used)
    if up is not None and table.columns[up][1].factor < 0.0 and (places[:, 2] > 0.0).any():
        row = int(np.flatnonzero(places[:, 2] > 0.0)[0])
        raise InputError(
            f"{file}: row {row + 1}: {shown(table.title(up))} counts downwards; expected 0 or "
            f"more, got {-places[row, 2]:g} m; put heights into a column z"
        )
    if is_global and projection is not None:
        wrong = np.flatnonzero((np.abs(places[:, :2]) > [90.0, 180.0]).any(axis=1))
        if wrong.size:
            lat, lon = places[wrong[0], :2]
            raise InputError(
                f"{file}: row {wrong[0] + 1}: expected a latitude within 90 and a longitude within "
                f"180 degrees, got {lat:g} and {lon:g}"
            )
        places[:, :2] = np.asarray(projection.to_plane(places[:, :2]))
    if on_note is not None:
        for note in table.notes([*used, label]):
            on_note(f"{file}: {note}")
    return places, [table.text(k, label) or None for k in range(len(table.rows))]
