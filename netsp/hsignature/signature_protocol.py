"""What tells classes of paths apart, whatever the words are made of.

In the plane and among prisms letters are crossings of rays (`PlanarSignature`); in any scene they
are those of a cubical complex (`netsp.plan.space.space_signature.SpaceSignature`). Either way the
words of loops at one point make a group, and whoever asks whether a tether is as planned, or free,
need not know which.
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
        """Whether paths between the same ends are of one class exactly when their words are equal.
        If not, equal words still mean one class; words that differ may mean one, too."""

    def word(self, path: npt.ArrayLike, *, closed: bool = False) -> Word:
        """The word of a polyline (k, 3). Where one path ends and another begins, the word of both
        is `product` of their words."""

    def product(self, *words: Word) -> Word:
        """The word of paths one after the other."""

    def windings(self, word: Word) -> tuple[int, ...]:
        """How often a path of a word winds around what there is, counted with signs: its class in
        the abelianisation of the group. All zero for what is contractible, and not for that
        alone."""


class PlanarSignature:
    """Words of the rays of obstacles: the free group, one generator for each obstacle.

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
        """Letters of the rays that a polyline crosses, reduced.

        Parameters
        ----------
        path : array_like, shape (k, 2) or (k, 3)
            Metres; only x and y count.
        closed : bool
            Whether the last point is joined to the first.

        Returns
        -------
        Word
            Its word.
        """
        return signature(path, self.points, closed=closed)

    def product(self, *words: Word) -> Word:
        """The word of paths one after the other.

        Parameters
        ----------
        *words : Word
            Their words.

        Returns
        -------
        Word
            Reduced.
        """
        return concatenate(*words)

    def windings(self, word: Word) -> tuple[int, ...]:
        """Winding numbers, one for each obstacle.

        Parameters
        ----------
        word : Word
            Of a loop.

        Returns
        -------
        tuple of int
            Crossings of each ray, counted with signs.
        """
        out = [0] * len(self.points)
        for x in word:
            out[abs(x) - 1] += 1 if x > 0 else -1
        return tuple(out)
