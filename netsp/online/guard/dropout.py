"""Paths that a robot may have taken during a dropout, and the classes after it."""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.hsignature import Word, crossings
from netsp.model.problem import Problem
from netsp.online.execute.tour_repair import free_position
from netsp.online.guard.guard_policy import SitePolicy
from netsp.online.guard.site import Site
from netsp.roadmap.tether_classes import Tethers


def paths_between(
    problem: Problem,
    before: Floats,
    after: Floats,
    max_length: float,
    policy: SitePolicy = SitePolicy(),
) -> list[tuple[Word, float]]:
    """Return the words and lengths of paths from one place to another, shortest first.

    Parameters
    ----------
    problem : Problem
        The site; obstacles count without the clearance.
    before, after : ndarray, shape (3,)
        Places, m.
    max_length : float
        Largest length, m; the shortest path counts at any length.
    policy : SitePolicy
        Limits of the search.
    """
    bare = problem.model_copy(update={"clearance": 0.0, "bounds": None})
    begin, end = free_position(bare, before), free_position(bare, after)
    straight = math.dist(begin, end)
    if straight <= 1e-6 * problem.scale:
        end = begin
    # up to ever larger lengths, until there are enough: all paths at once may be too many
    longest, found = max(1.05 * straight, 1e-6 * problem.scale), []
    for _ in range(policy.max_searches):
        free = bare.model_copy(update={"base": begin, "goals": (), "tether_length": longest})
        found = Tethers(free).classes(*end)
        if len(found) >= policy.max_paths or (found and longest >= max_length):
            break
        longer = policy.length_growth * longest + 0.5
        longest = min(longer, max(max_length, longest + 0.5)) if found else longer
    kept = [(t.word, t.length) for t in found if t.length <= max(max_length, found[0].length)]
    if kept:
        return kept[: policy.max_paths]
    # between obstacles that overlap there may be none: then the robot moved straight
    line = np.array([before, after])
    return [(crossings(line, problem.representative_points), math.dist(before, after))]


def classes_after_dropout(
    site: Site,
    words: dict[Word, float],
    before: Floats,
    after: Floats,
    max_travel: float,
    reach: float,
) -> dict[Word, float]:
    """Return the classes of the tether after a dropout, with their costs.

    A path is the less likely the longer it is than the shortest one, in units of a quarter of
    the
    distance that the robot can have travelled.

    Parameters
    ----------
    site : Site
        The site.
    words : dict of Word to float
        Classes before, and their costs.
    before, after : ndarray, shape (3,)
        Places of the robot before and after, m.
    max_travel : float
        Largest distance that the robot can have travelled, m.
    reach : float
        Largest error of either place, m.
    """
    paths = site.paths_between(before, after, max_travel + reach)
    scale = max(0.25 * max_travel, 0.5 * reach, 1e-9)
    out: dict[Word, float] = {}
    for word, cost in words.items():
        for path, length in paths:
            joined = site.letters.join(word, path)
            joined_cost = cost + (length - paths[0][1]) / scale
            out[joined] = min(out.get(joined, np.inf), joined_cost)
    return out
