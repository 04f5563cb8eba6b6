"""Detours between base and goals in any class, for planners that ignore the tether.

The 2016 workshop paper plans from goal to goal by the shortest path, whatever its homotopy class,
and changes the class by planning again through a sub-goal on the far side of an obstacle. Those
detours are tabulated here, so that its solvers, like the others, see no geometry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.gtsp.travel.result import Trajectory
from netsp.hsignature import Word, concatenate, invert

DIRECT = -1
"""Sentinel in place of a sub-goal: the shortest path in any class."""


@dataclass(frozen=True)
class Detours:
    """Places are the base (0), the goals (1 … m), then sub-goals beside the obstacles.

    Attributes
    ----------
    planar
        (m + 1, P) planar length of the shortest detour from base or goal to every place.
    height
        (m + 1,) z of base and goals. Sub-goals have none: depth changes evenly along a detour.
    letters, row
        Word of the detour from a to p is ``letters[row[a, p] : row[a, p + 1]]``; row is (m + 1, P
        + 1).
    far
        (m + 1, P, n) for the detour from a to p and each obstacle, the sub-goal on the far side of
        the obstacle; -1 if the obstacle has none in free space.
    near
        (m + 1, P, n) distance of the detour from the middle of the obstacle.
    draw
        Returns the detour from a to p as a polyline (k, 2).
    """

    planar: Floats
    height: Floats
    letters: Ints
    row: Ints
    far: Ints
    near: Floats
    draw: Callable[[int, int], Floats]

    def length(self, a: int, b: int, via: int = DIRECT) -> float:
        """Return the 3D length of the detour from a to b, through a sub-goal if `via` is one."""
        planar = self.planar[a, b] if via < 0 else self.planar[a, via] + self.planar[b, via]
        return float(np.hypot(planar, self.height[b] - self.height[a]))

    def word(self, a: int, b: int, via: int = DIRECT) -> Word:
        """Return the reduced word of the detour from a to b."""
        if via < 0:
            return self._word(a, b)
        return concatenate(self._word(a, via), invert(self._word(b, via)))

    def path(self, a: int, b: int, via: int = DIRECT) -> Floats:
        """Return the detour from a to b as a polyline (n, 3); depth changes evenly along it."""
        if via < 0:
            xy = self.draw(a, b)
        else:
            xy = np.vstack([self.draw(a, via), self.draw(b, via)[-2::-1]])
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
        share = along / along[-1] if along[-1] > 0.0 else np.linspace(0.0, 1.0, len(xy))
        z = self.height[a] + share * (self.height[b] - self.height[a])
        return np.column_stack([xy, z])

    def far_side(self, a: int, b: int, via: int, obstacle: int) -> int:
        """Return the sub-goal on the far side of an obstacle from the detour, or -1."""
        if via < 0:
            return int(self.far[a, b, obstacle])
        nearer = a if self.near[a, via, obstacle] <= self.near[b, via, obstacle] else b
        return int(self.far[nearer, via, obstacle])

    def _word(self, a: int, p: int) -> Word:
        return tuple(int(x) for x in self.letters[self.row[a, p] : self.row[a, p + 1]])


@dataclass(frozen=True, eq=False)
class BlindTrajectory(Trajectory):
    """Closed path of a baseline that ignores the tether, whatever it entangles.

    Parameters
    ----------
    words : tuple of Word
        At each goal, the word of the path from the base.
    word : Word
        Word of the whole path.
    """

    words: tuple[Word, ...]
    word: Word
