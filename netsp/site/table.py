"""Places from a table."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.files import read_text


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
    rows = list(csv.DictReader(io.StringIO(read_text(file))))
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
                    f"{file}: row {k + 1}: {axis}: expected a number, got {row[axis]!r}"
                )
    return places, [row.get("name") or None for row in rows]
