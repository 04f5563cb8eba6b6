"""Files of paths: CSV or JSON lists of points."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.fields import LARGEST
from netsp.files import read_text


def read_path(file: str | Path) -> Floats | None:
    """The (k, 2) or (k, 3) polyline of a path file: CSV rows ``x,y[,z]`` with or without a head, or
    a JSON list of points; None if the file holds a JSON object, which is taken for a solution.

    Raises InputError with the row that cannot be read.
    """
    text = read_text(file)
    text = text.decode("utf-8-sig", "replace") if isinstance(text, bytes) else text
    text = text.removeprefix("\ufeff")
    if text.lstrip().startswith("{"):
        return None
    if text.lstrip().startswith("["):
        try:
            rows = json.loads(text)
        except (json.JSONDecodeError, RecursionError) as error:
            raise InputError(f"{file}: not valid JSON: {error}") from None
    else:
        rows = [row for row in csv.reader(text.splitlines()) if row]
        if rows and not any(_is_number(cell) for cell in rows[0]):
            rows = rows[1:]
    for k, row in enumerate(rows):
        if not _is_point(row) or len(row) != len(rows[0]):
            raise InputError(f"{file}: point {k}: expected x, y or x, y, z, got {row!r}")
    if len(rows) < 2:
        raise InputError(f"{file}: expected a path of at least 2 points, got {len(rows)}")
    return np.array(rows, dtype=float)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _is_point(row: object) -> bool:
    if not isinstance(row, list) or len(row) not in (2, 3):
        return False
    try:
        return all(abs(float(x)) <= LARGEST for x in row)
    except (TypeError, ValueError):
        return False
