"""Sentinel values that mark missing heights."""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Bools, Floats

CUSTOMARY_NODATA = (
    -9999.0, 9999.0, -99999.0, 99999.0, -32768.0, -32767.0, 32767.0, -999999.0, 999999.0,
)  # fmt: skip
"""Sentinel values that usually mark a missing height.

If a file does not declare them as nodata, they count as missing only where their distance from all
other values exceeds the range of those values.
"""

MAX_HEIGHT = 1e9
"""Sentinel limit of heights, in units of the file: larger values, such as 1e20 or the largest
number of a data type, mark a missing height. Heights on earth are below 1.2e7 mm."""


def marks_of_no_height(z: Floats, *more: float) -> list[tuple[float, Bools]]:
    """Return the values that mark a missing height, each with a mask of where it occurs.

    Parameters
    ----------
    z : ndarray
        Heights in the units of their file; NaN where there is none.
    *more : float
        Further values that may mark a missing height, such as the largest of the data type.

    Examples
    --------
    >>> marks_of_no_height(np.array([-4.0, -9999.0, -5.0]))
    [(-9999.0, array([False,  True, False]))]
    """
    customary = (*CUSTOMARY_NODATA, *more)
    suspect = np.isin(z, customary) | (np.abs(z) > MAX_HEIGHT)
    if not suspect.any():
        return []
    others = z[~suspect & ~np.isnan(z)]
    span = float(np.ptp(others)) if len(others) else 0.0
    found = []
    for value in np.unique(z[suspect]):
        apart = float(np.abs(others - value).min()) if len(others) else math.inf
        if abs(value) > MAX_HEIGHT or apart > span:
            found.append((float(value), np.asarray(z == value)))
    return found
