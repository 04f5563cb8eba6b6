"""Loops in a taut tether.

In the plan a taut tether is a geodesic of its class. Where it meets itself, the piece in between is
a geodesic from a place to that same place. Geodesics of a class are unique (docs/theory), so a
loop
that could be pulled out would have length 0. So every such loop is around something, and has to be
undone; and a robot that comes to a place where its own tether lies has just closed one.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.hsignature import signature
from netsp.model.problem import Problem
from netsp.online.guard.site import Loop


def loop_of_line(problem: Problem, line: Floats) -> Loop | None:
    """Return a closed line, shape (k, 2), as a loop; None if it is around nothing."""
    word = signature(line, problem.representative_points, closed=True)
    if not word:
        return None
    wound = [0] * len(problem.obstacles)
    for letter in word:
        wound[abs(letter) - 1] += 1 if letter > 0 else -1
    # winding numbers may all be zero (a commutator): then it is around the obstacles of its word
    around = tuple(i for i, n in enumerate(wound) if n) or tuple(
        sorted({abs(letter) - 1 for letter in word})
    )
    return Loop(around, line)


def loop_closed_by(problem: Problem, tether: Floats, step: Floats) -> Loop | None:
    """Return the loop that a robot closes by a straight step; None if none.

    Parameters
    ----------
    problem : Problem
        The site.
    tether : ndarray, shape (n, 2)
        Taut tether to the robot, m; its last segment swings along.
    step : ndarray, shape (2, 2)
        Ends of the step, m.
    """
    if len(tether) < 3:
        return None
    for k, place in _crossings(tether[:-1], step)[::-1]:
        found = loop_of_line(problem, np.vstack([place, tether[k + 1 :], place]))
        if found is not None:
            return found
    return None


def loops_in(problem: Problem, tether: Floats) -> list[Loop]:
    """Return the loops of a taut tether in the plan, shape (n, 2), the last to be closed first.

    Each is around other obstacles than those before.
    """
    found: list[Loop] = []
    for j in _crossing_segments(tether):
        for k, place in _crossings(tether[:j], tether[j : j + 2]):
            loop = loop_of_line(problem, np.vstack([place, tether[k + 1 : j + 1], place]))
            if loop is not None and all(loop.around != other.around for other in found):
                found.append(loop)
    return found


def _crossing_segments(line: Floats) -> list[int]:
    """Return the segments of a polyline that may cross an earlier one, the last first.

    The ends of neither segment are on one side of the other one.
    """
    if len(line) < 4:
        return []
    d = np.diff(line, axis=0)
    # side of each segment's line (row) that each vertex (column) is on
    side = d[:, :1] * line[:, 1] - d[:, 1:] * line[:, 0]
    side -= (d[:, 0] * line[:-1, 1] - d[:, 1] * line[:-1, 0])[:, None]
    slack = 1e-12 * max(1.0, float(np.abs(line).max())) * np.abs(d).sum(1, keepdims=True)
    parted = np.minimum(side[:, :-1], side[:, 1:]) <= slack
    parted &= np.maximum(side[:, :-1], side[:, 1:]) >= -slack
    meet = np.triu(parted & parted.T, 2)  # neighbours share a vertex
    return [int(j) for j in np.flatnonzero(meet.any(axis=0))[::-1]]


def _crossings(line: Floats, step: Floats) -> list[tuple[int, Floats]]:
    """Return the segments of a polyline that a segment crosses, each with the place."""
    a, d = line[:-1], np.diff(line, axis=0)
    p, e = step[0], step[1] - step[0]
    cross = d[:, 0] * e[1] - d[:, 1] * e[0]
    # nearly parallel segments may overflow; they are no hit
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        s = ((p - a)[:, 0] * e[1] - (p - a)[:, 1] * e[0]) / cross
        t = ((p - a)[:, 0] * d[:, 1] - (p - a)[:, 1] * d[:, 0]) / cross
    hits = (np.abs(cross) > 1e-15) & (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    return [(int(k), a[k] + s[k] * d[k]) for k in np.flatnonzero(hits)]
