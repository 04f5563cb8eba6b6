"""Protocol of signatures: words that distinguish homotopy classes of paths.

In the plane and among prisms, letters are crossings of rays (`PlanarSignature`). In other scenes
they come from a cubical complex (`netsp.plan.space.space_signature.SpaceSignature`). Either way,
the words of loops at one point form a group, so callers can compare words, or test whether one is
empty, without knowing which signature it is.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.hsignature.rays import signature
from netsp.hsignature.words import Word, concatenate


class Signature(Protocol):
    """Words of paths."""

    @property
    def exact(self) -> bool:
        """True if two paths with the same ends are homotopic exactly when their words are equal.

        If False, paths with equal words are homotopic, but homotopic paths may differ in words.
        """

    def word(self, path: npt.ArrayLike, *, closed: bool = False) -> Word:
        """Return the word of a polyline (k, 3).

        The word of one path followed by another is the `product` of their words.
        """

    def product(self, *words: Word) -> Word:
        """Return the word of paths one after the other."""

    def windings(self, word: Word) -> tuple[int, ...]:
        """Return the winding numbers of a word, its class in the abelianisation.

        All are 0 for a contractible path, but also for some other paths.
        """


class PlanarSignature:
    """Words by ray crossings: a free group with a generator for each obstacle.

    Parameters
    ----------
    points : array_like, shape (n, 2)
        Representative points of the obstacles, metres.

    Examples
    --------
    >>> rays = PlanarSignature([(0, 0)])
    >>> rays.word([(-1, 1, 0), (1, 1, -3)]), rays.windings((1, 1))
    ((1,), (2,))
    """

    exact = True

    def __init__(self, points: npt.ArrayLike) -> None:
        self.points: Floats = np.asarray(points, dtype=float).reshape(-1, 2)

    def word(self, path: npt.ArrayLike, *, closed: bool = False) -> Word:
        """Return the letters of the rays that a polyline crosses, reduced.

        Parameters
        ----------
        path : array_like, shape (k, 2) or (k, 3)
            Polyline, metres; only x and y count.
        closed : bool
            Whether the last point is joined to the first.
        """
        return signature(path, self.points, closed=closed)

    def product(self, *words: Word) -> Word:
        """Return the reduced word of paths one after the other."""
        return concatenate(*words)

    def windings(self, word: Word) -> tuple[int, ...]:
        """Return the winding number of a loop around each obstacle."""
        out = [0] * len(self.points)
        for x in word:
            out[abs(x) - 1] += 1 if x > 0 else -1
        return tuple(out)
