"""Arrays that grow in compiled loops."""

from __future__ import annotations

import numpy as np

from netsp.arrays import Floats, Ints
from netsp.compiled.kernel import kernel


@kernel
def more_rows(a: Floats) -> Floats:
    """The same rows with room for twice as many. Copied by hand: a slice assignment would compile
    NumPy's broadcasting and its error messages, seconds of work."""
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
    """The same rows with room for twice as many (copied by hand, see `more_rows`)."""
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
