"""Arrays that compiled loops copy, order and let grow.

The loops are written out: assigning one slice to another would compile NumPy's broadcasting and its
error messages, and sorting would compile NumPy's sort, each of which takes seconds.
"""

from __future__ import annotations

import numpy as np

from netsp.arrays import Floats, Ints
from netsp.compiled.interpretation import interprets
from netsp.compiled.kernel import kernel

RUN = 16
"""Length of the stretches that `order_of` sorts by insertion before it merges them."""


@kernel
def more_rows(a: Floats) -> Floats:
    """Return the same rows with room for twice as many."""
    b = np.empty((2 * a.shape[0], a.shape[1]))
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            b[i, j] = a[i, j]
    return b


@kernel
def sort_in_place(a: Floats, n: int) -> None:
    """Sort the first n entries, few as they are, by insertion."""
    for i in range(1, n):
        x = a[i]
        j = i - 1
        while j >= 0 and a[j] > x:
            a[j + 1] = a[j]
            j -= 1
        a[j + 1] = x


@kernel
def more_int_rows(a: Ints) -> Ints:
    """Return the same rows with room for twice as many."""
    b = np.empty((2 * a.shape[0], a.shape[1]), dtype=np.int64)
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            b[i, j] = a[i, j]
    return b


@kernel
def longer(a: Floats) -> Floats:
    """A float array with room for twice as many."""
    b = np.empty(2 * len(a))
    for i in range(len(a)):
        b[i] = a[i]
    return b


@kernel
def write_ints(to: Ints, values: Ints, n: int) -> None:
    """Copy the first n whole numbers of an array to another one."""
    for i in range(n):
        to[i] = values[i]


@kernel
def write_floats(to: Floats, values: Floats, n: int) -> None:
    """Copy the first n numbers of an array to another one."""
    for i in range(n):
        to[i] = values[i]


@kernel
def write_rows(to: Floats, rows: Floats, n: int) -> None:
    """Copy the first n rows of an array to another one."""
    for i in range(n):
        for j in range(rows.shape[1]):
            to[i, j] = rows[i, j]


@interprets(write_ints)
@interprets(write_floats)
@interprets(write_rows)
def _write_in_numpy(to: Floats, values: Floats, n: int) -> None:
    """Do as `write_ints`, `write_floats` and `write_rows`."""
    to[:n] = values[:n]


@kernel
def order_of(values: Floats) -> Ints:
    """Return the indices that sort numbers, none of them NaN; equal ones keep their order."""
    n = len(values)
    order, merged = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    for begin in range(0, n, RUN):
        for i in range(begin, min(begin + RUN, n)):
            j = i
            while j > begin and values[order[j - 1]] > values[i]:
                order[j] = order[j - 1]
                j -= 1
            order[j] = i
    size = RUN
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
    """Do as `order_of`."""
    return np.argsort(values, kind="stable")
