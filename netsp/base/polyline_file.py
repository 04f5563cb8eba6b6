"""Polylines from tables and JSON files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.columns import Quantity
from netsp.base.errors import InputError
from netsp.base.field_types import LARGEST
from netsp.base.files import read_bytes
from netsp.base.table_file import Table, decode_text, read_table
from netsp.base.validated import parse_json, shown


def read_path(file: str | Path, on_note: Callable[[str], None] | None = None) -> Floats | None:
    """Read a polyline (k, 2) or (k, 3) from a table or a JSON list of points; None for a JSON
    object.

    A JSON object is taken for a solution.

    Parameters
    ----------
    file : str or Path
        Table with the columns x, y and perhaps z or depth in any order, or two or three columns
        without names.
    on_note : callable, optional
        Called with one line each for decimal commas and for unused columns.

    Raises
    ------
    InputError
        A row that cannot be read, or fewer than two points.
    """
    text = decode_text(read_bytes(file), str(file))
    if text.lstrip().startswith("{"):
        return None
    if text.lstrip().startswith("["):
        rows = parse_json(text, str(file))
        for k, row in enumerate(rows):
            if not _is_point(row) or len(row) != len(rows[0]):
                raise InputError(f"{file}: point {k}: expected x, y or x, y, z, got {shown(row)}")
        points = np.array(rows, dtype=float)
    elif not text.strip():
        points = np.empty((0, 2))
    else:
        table = read_table(file, positional=("x", "y", "z"), text=text)
        points = _polyline(table)
        if on_note is not None:
            for note in table.notes(("x", "y", "z", "altitude")):
                on_note(f"{file}: {note}")
    if len(points) < 2:
        raise InputError(f"{file}: expected a path of at least 2 points, got {len(points)}")
    return points


def _polyline(table: Table) -> Floats:
    if table.head:
        if table.pair((("x", "y"),)) is None:
            raise table.wanted("columns x, y and perhaps z or depth")
        up = table.height()
        return table.numbers(("x", "y", up) if up else ("x", "y"))
    for k, row in enumerate(table.rows):
        cells = [c.replace(",", ".") if table.has_decimal_commas else c for c in row]
        if not _is_point(cells) or len(row) != len(table.rows[0]):
            raise InputError(
                f"{table.source}: point {k}: expected x, y or x, y, z, got {shown(row)}"
            )
    names: tuple[Quantity, ...] = ("x", "y", "z")
    return table.numbers(names[: len(table.rows[0])])


def _is_point(row: object) -> bool:
    if not isinstance(row, list) or len(row) not in (2, 3):
        return False
    try:
        return all(abs(float(x)) <= LARGEST for x in row)
    except (TypeError, ValueError):
        return False
