"""Classes of the tether after a dropout."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.hsignature import Word
from netsp.world.world_protocol import World


def classes_after_dropout(
    world: World,
    words: dict[Word, float],
    before: Floats,
    after: Floats,
    max_travel: float,
    reach: float,
) -> dict[Word, float]:
    """Return the classes of the tether after a dropout, with their costs.

    A path is the less likely the longer it is than the shortest one, in units of a quarter of
    the distance that the robot can have travelled.

    Parameters
    ----------
    world : World
        Where the robot moves.
    words : dict of Word to float
        Classes before, and their costs.
    before, after : ndarray, shape (3,)
        Places of the robot before and after, m.
    max_travel : float
        Largest distance that the robot can have travelled, m.
    reach : float
        Largest error of either place, m.
    """
    paths = world.paths_between(before, after, max_travel + reach)
    scale = max(0.25 * max_travel, 0.5 * reach, 1e-9)
    out: dict[Word, float] = {}
    for word, cost in words.items():
        for path, length in paths:
            joined = world.letters.join(word, path)
            joined_cost = cost + (length - paths[0][1]) / scale
            out[joined] = min(out.get(joined, np.inf), joined_cost)
    return out
