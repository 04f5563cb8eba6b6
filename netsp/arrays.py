"""Array types by what they hold, for annotations; shapes are in the docstrings."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
"""Lengths, coordinates, costs."""

Singles = npt.NDArray[np.float32]
"""Of what is held by the million, such as distances at grid points."""

Ints = npt.NDArray[np.int64]
"""Indices, letters, counts."""

Bools = npt.NDArray[np.bool_]
"""Marks, one per row."""
