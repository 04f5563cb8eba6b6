"""Kernels that copy, sort and enlarge arrays.

They are written as loops: Numba would need seconds to compile the broadcasting behind a slice
assignment, or NumPy's sort.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.interpretation import interprets
from netsp.base.compiled.kernel import kernel


@kernel
def more_rows(a: Floats) -> Floats:
    """Return a copy of an array with room for twice as many rows."""
    b = np.empty((2 * a.shape[0], a.shape[1]))
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            b[i, j] = a[i, j]
    return b


@kernel
def sort_in_place(a: Floats, n: int) -> None:
    """Sort the first n entries by insertion, which is fast for few entries."""
    for i in range(1, n):
        x = a[i]
        j = i - 1
        while j >= 0 and a[j] > x:
            a[j + 1] = a[j]
            j -= 1
        a[j + 1] = x


@kernel
def more_int_rows(a: Ints) -> Ints:
    """Return a copy of an array with room for twice as many rows."""
    b = np.empty((2 * a.shape[0], a.shape[1]), dtype=np.int64)
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            b[i, j] = a[i, j]
    return b


@kernel
def longer(a: Floats) -> Floats:
    """Return a copy of a float array with room for twice as many numbers."""
    b = np.empty(2 * len(a))
    for i in range(len(a)):
        b[i] = a[i]
    return b


@kernel
def write_ints(to: Ints, values: Ints, n: int) -> None:
    """Copy the first n integers of an array to another array."""
    for i in range(n):
        to[i] = values[i]


@kernel
def write_floats(to: Floats, values: Floats, n: int) -> None:
    """Copy the first n floats of an array to another array."""
    for i in range(n):
        to[i] = values[i]


@kernel
def write_rows(to: Floats, rows: Floats, n: int) -> None:
    """Copy the first n rows of an array to another array."""
    for i in range(n):
        for j in range(rows.shape[1]):
            to[i, j] = rows[i, j]


@interprets(write_ints)
@interprets(write_floats)
@interprets(write_rows)
def _write_in_numpy(to: Floats, values: Floats, n: int) -> None:
    """Vectorise `write_ints`, `write_floats` and `write_rows`."""
    to[:n] = values[:n]


@kernel
def order_of(values: Floats) -> Ints:
    """Return the indices that sort numbers without NaN; equal numbers keep their order."""
    n = len(values)
    order, merged = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    size = 16  # runs of this length are sorted by insertion, then merged
    for begin in range(0, n, size):
        for i in range(begin, min(begin + size, n)):
            j = i
            while j > begin and values[order[j - 1]] > values[i]:
                order[j] = order[j - 1]
                j -= 1
            order[j] = i
    while size < n:
        for begin in range(0, n, 2 * size):
            middle, end = min(begin + size, n), min(begin + 2 * size, n)
            i, j = begin, middle
            for k in range(begin, end):
                if j >= end or (i < middle and values[order[i]] <= values[order[j]]):
                    merged[k] = order[i]
                    i += 1
                else:
                    merged[k] = order[j]
                    j += 1
        order, merged = merged, order
        size *= 2
    return order


@interprets(order_of)
def _order_in_numpy(values: Floats) -> Ints:
    """Vectorise `order_of`."""
    return np.argsort(values, kind="stable")
