"""Which ways may a robot have gone that nobody saw?"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.hsignature import Word, crossings
from netsp.model.problem import Problem
from netsp.online.execute.tour_repair import free_position
from netsp.online.guard.site import Site
from netsp.roadmap.tether_classes import Tethers

MOST_WAYS = 12
"""Ways that are kept, the shortest."""

TRIES, GROWTH = 16, 1.25
"""Lengths up to which ways are looked for, each longer by that than the one before."""


def ways_between(
    problem: Problem, before: Floats, after: Floats, farthest: float
) -> list[tuple[Word, float]]:
    """The classes of paths from one place to another that are no longer than that.

    Parameters
    ----------
    problem : Problem
        The site. Obstacles count as they are, without the clearance.
    before : ndarray, shape (3,)
        Where the robot was, metres.
    after : ndarray, shape (3,)
        Where it is.
    farthest : float
        Metres that it can have gone; the shortest way counts whatever it is.

    Returns
    -------
    list of (Word, float)
        Words, and the lengths of the shortest paths, metres; shortest first.
    """
    bare = problem.model_copy(update={"clearance": 0.0, "bounds": None})
    begin, end = free_position(bare, before), free_position(bare, after)
    straight = math.dist(begin, end)
    if straight <= 1e-6 * problem.scale:
        end = begin
    # ever longer, until there are enough: all ways at once may be more than anybody can count
    longest, found = max(1.05 * straight, 1e-6 * problem.scale), []
    for _ in range(TRIES):
        free = bare.model_copy(update={"base": begin, "goals": (), "tether_length": longest})
        found = Tethers(free).classes(*end)
        if len(found) >= MOST_WAYS or (found and longest >= farthest):
            break
        longest = (
            min(GROWTH * longest + 0.5, max(farthest, longest + 0.5))
            if found
            else (GROWTH * longest + 0.5)
        )
    kept = [(t.word, t.length) for t in found if t.length <= max(farthest, found[0].length)]
    if kept:
        return kept[:MOST_WAYS]
    # between obstacles that overlap there may be none: then it went straight
    line = np.array([before, after])
    return [(crossings(line, problem.representative_points), math.dist(before, after))]


def after_gap(
    site: Site, words: dict[Word, float], before: Floats, after: Floats, seconds: float,
    speed: float, reach: float,
) -> dict[Word, float]:  # fmt: skip
    """Classes of the tether after a gap, with their costs: a way is the less likely the longer it
    is than the shortest, in units of a quarter of what the robot can have gone.

    Parameters
    ----------
    site : Site
        Where.
    words : dict of Word to float
        Classes before, and their costs.
    before : ndarray, shape (3,)
        Where the robot was, metres.
    after : ndarray, shape (3,)
        Where it is.
    seconds : float
        Between the two.
    speed : float
        Of the robot, at most, m/s.
    reach : float
        How far off either place may be, metres.

    Returns
    -------
    dict of Word to float
        Classes now, and their costs.
    """
    gone = speed * seconds
    ways = site.ways(before, after, gone + reach)
    scale = max(0.25 * gone, 0.5 * reach, 1e-9)
    out: dict[Word, float] = {}
    for word, cost in words.items():
        for way, length in ways:
            to = site.letters.join(word, way)
            dearer = cost + (length - ways[0][1]) / scale
            out[to] = min(out.get(to, np.inf), dearer)
    return out
