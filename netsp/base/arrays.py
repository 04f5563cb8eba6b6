"""Array types for annotations, named by their contents; docstrings state the shapes."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
"""Lengths, coordinates, costs."""

Singles = npt.NDArray[np.float32]
"""Numbers in single precision, for arrays of millions, such as distances at grid points."""

Ints = npt.NDArray[np.int64]
"""Indices, letters, counts."""

Bools = npt.NDArray[np.bool_]
"""Masks."""


class ComparesArrays:
    """Base of dataclasses that have arrays as fields, and are equal if all their fields are.

    The `__eq__` of a dataclass compares tuples of fields, which raises ValueError for arrays, so
    derived classes are declared with ``@dataclass(eq=False)``. Arrays are equal if their shapes,
    dtypes and elements are; NaN equals NaN.
    """

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ComparesArrays) or type(self) is not type(other):
            return NotImplemented
        return all(
            _is_equal(getattr(self, f.name), getattr(other, f.name))
            for f in dataclasses.fields(self)  # type: ignore[arg-type]
            if f.compare
        )

    __hash__ = None  # type: ignore[assignment]


def _is_equal(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    return bool(a == b)
