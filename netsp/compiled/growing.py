"""Arrays that grow in compiled loops."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def more_rows(a):
    """The same rows with room for twice as many. Copied by hand: a slice assignment would compile
    NumPy's broadcasting and its error messages, seconds of work."""
    b = np.empty((2 * a.shape[0], a.shape[1]))
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            b[i, j] = a[i, j]
    return b


@njit(cache=True)
def sort_in_place(a, n):
    """Sort the first n entries, few as they are, by insertion."""
    for i in range(1, n):
        x = a[i]
        j = i - 1
        while j >= 0 and a[j] > x:
            a[j + 1] = a[j]
            j -= 1
        a[j + 1] = x


@njit(cache=True, nogil=True)
def more_int_rows(a):
    """The same rows with room for twice as many (copied by hand, see `more_rows`)."""
    b = np.empty((2 * a.shape[0], a.shape[1]), dtype=np.int64)
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            b[i, j] = a[i, j]
    return b


@njit(cache=True, nogil=True)
def longer(a):
    """A float array with room for twice as many."""
    b = np.empty(2 * len(a))
    for i in range(len(a)):
        b[i] = a[i]
    return b
