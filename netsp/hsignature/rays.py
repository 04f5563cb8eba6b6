"""Crossings of a path with the rays of the obstacles.

A ray runs straight up (+y) from the representative point of each obstacle. By the rules below, the
word of a path depends on floating-point comparisons of its *vertices* alone, so splitting,
reversing or joining paths never changes a word:

- half-open sides: a vertex with ``x < x_ray`` is left of a ray, and any other is right of it, so a
  vertex on a ray counts once, and a vertical segment crosses nothing;
- a segment crosses rays in the order of their x, because it is monotone in x; rays with equal x are
  crossed in the order of their numbers, as if each stood infinitesimally to the right of the last;
- a ray passes through everything above it, also through other obstacles.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from netsp.hsignature.words import Word, reduce


def crossings(
    path: npt.ArrayLike, points: npt.ArrayLike, *, closed: bool = False
) -> tuple[int, ...]:
    """Return the letters of all ray crossings along a polyline, in order, not reduced.

    Parameters
    ----------
    path : array_like, shape (k, 2) or (k, 3)
        Polyline; only x and y count.
    points : array_like, shape (n, 2)
        Representative points of the obstacles.
    closed : bool
        Whether the last vertex is joined to the first.

    Returns
    -------
    tuple of int
        i + 1 where the path crosses the ray of obstacle i from left to right, -(i + 1) from right
        to left.
    """
    xy = np.asarray(path, dtype=float)
    rays = np.asarray(points, dtype=float).reshape(-1, 2)
    if xy.size == 0 or len(rays) == 0:
        return ()
    if xy.ndim != 2 or xy.shape[1] not in (2, 3):
        raise ValueError(f"path: expected an array of shape (k, 2) or (k, 3), got {xy.shape}")
    xy = xy[:, :2]
    if closed:
        xy = np.vstack([xy, xy[:1]])
    right = xy[:, :1] >= rays[None, :, 0]
    change = right[1:] != right[:-1]
    letters: list[int] = []
    for k in np.flatnonzero(change.any(axis=1)):
        letters.extend(_segment_crossings(xy[k], xy[k + 1], change[k], right[k + 1], rays))
    return tuple(letters)


def _segment_crossings(
    p: npt.NDArray[np.float64],
    q: npt.NDArray[np.float64],
    change: npt.NDArray[np.bool_],
    to_right: npt.NDArray[np.bool_],
    rays: npt.NDArray[np.float64],
) -> Sequence[int]:
    ids = np.flatnonzero(change)
    x, y = rays[ids, 0], rays[ids, 1]
    height = p[1] + (x - p[0]) / (q[0] - p[0]) * (q[1] - p[1])
    ids = ids[height > y]
    order = np.lexsort((ids, rays[ids, 0]))
    if q[0] < p[0]:
        order = order[::-1]
    ids = ids[order]
    return [int(i) + 1 if to_right[i] else -(int(i) + 1) for i in ids]


def signature(path: npt.ArrayLike, points: npt.ArrayLike, *, closed: bool = False) -> Word:
    """Return the h-signature of a polyline: its ray crossings, reduced.

    The path must not pass through a representative point. Free paths do not, because these points
    lie inside obstacles.

    Parameters
    ----------
    path : array_like, shape (k, 2) or (k, 3)
        Polyline; only x and y count.
    points : array_like, shape (n, 2)
        Representative points of the obstacles.
    closed : bool
        Whether the last vertex is joined to the first.

    Examples
    --------
    >>> signature([(-1, 1), (1, 1)], [(0, 0)])
    (1,)
    >>> signature([(-1, 1), (1, 1), (1, -1), (-1, -1)], [(0, 0)], closed=True)
    (1,)
    """
    return reduce(crossings(path, points, closed=closed))
