"""Places from a table."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.files import csv_rows, read_text
from netsp.models import shown


def from_table(file: str | Path) -> tuple[Floats, list[str | None]]:
    """Places and names of a table with the columns x, y and perhaps z and name.

    Parameters
    ----------
    file : str or Path
        CSV, the names of the columns first.

    Returns
    -------
    places : ndarray, shape (k, 2) or (k, 3)
        In the problem's units.
    names : list of str or None
        One for each.

    Raises
    ------
    InputError
        Not such a table.
    """
    rows = csv_rows(read_text(file), str(file))
    if not rows or not {"x", "y"} <= rows[0].keys():
        raise InputError(f"{file}: expected a table with the columns x, y and perhaps z, name")
    axes = ("x", "y", "z") if "z" in rows[0] else ("x", "y")
    places = np.empty((len(rows), len(axes)))
    for k, row in enumerate(rows):
        for j, axis in enumerate(axes):
            try:
                places[k, j] = float(row[axis] or "")
            except ValueError:
                places[k, j] = math.nan
            if not math.isfinite(places[k, j]):
                raise InputError(
                    f"{file}: row {k + 1}: {axis}: expected a number, got {shown(row[axis])}"
                )
    return places, [row.get("name") or None for row in rows]
