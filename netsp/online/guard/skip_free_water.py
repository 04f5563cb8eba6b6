"""How far a robot can go before anything has to be known of its tether.

Let the robot go straight through free water of the plan, or anyhow within a disk of it, which is
homotopic to straight. The tether, the way, and the tether afterwards bound a pseudo-triangle: three
corners, and sides that bend inward, so that it lies in the plane without overlap and the robot is
at one of its corners alone. So it meets its own tether, if at all, on the part that has not moved:
its way crosses the tether as it was at the beginning, before its last segment. And the tether is
no longer than it was and the way together.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.world.scene.field import DistanceField
from netsp.world.tether import Tether


def leap(field: DistanceField, tether: Tether, places: Floats, most: float) -> int:
    """Over how many places it can go without closing a loop or needing too much tether.

    Parameters
    ----------
    field : DistanceField
        Of a scene whose solids stand upright.
    tether : Tether
        Taut, to where the robot is.
    places : ndarray, shape (k, 3)
        That it would come to, one after the other, metres.
    most : float
        Length of tether that there is, metres.

    Returns
    -------
    int
        The first so many of them. That it may go on is not denied by fewer: it is not known.
    """
    here = tether.robot
    far = np.linalg.norm(places - here, axis=1)
    count = _first(tether.length + far > most)
    if count:
        near = _first(far[:count] >= float(field.distance(here)))
        count = max(near, _straight(field, here, places[:count]))
    if count and len(tether.nodes) > 2:
        way = np.vstack([here, places[:count]])
        count = _first(_meets(tether.nodes[:-1, :2], way[:, :2]))
    return count


def _straight(field: DistanceField, here: Floats, places: Floats) -> int:
    """How many places are on one free line from here, as far as halving finds out."""
    step, count = places[0] - here, len(places)
    even = here + np.arange(1, count + 1)[:, None] * step
    if not (np.abs(even - places) <= 1e-9 * (1.0 + float(np.abs(step).max()))).all():
        return 0
    while count and not field.line_of_sight(here, places[count - 1]):
        count //= 2
    return count


def _meets(line: Floats, way: Floats) -> Bools:
    """(k,) whether each step of a way (k + 1, 2) touches a polyline (n, 2)."""
    a, d = line[:-1, None], np.diff(line, axis=0)[:, None]
    p, e = way[None, :-1], np.diff(way, axis=0)[None]
    # on which side of the one's line are the ends of the other
    from_line = [d[..., 0] * (q - a)[..., 1] - d[..., 1] * (q - a)[..., 0] for q in (p, p + e)]
    from_way = [e[..., 0] * (q - p)[..., 1] - e[..., 1] * (q - p)[..., 0] for q in (a, a + d)]
    slack = 1e-12 * (1.0 + np.abs(d).sum(-1) * np.abs(e).sum(-1))
    parted = [
        (np.minimum(*sides) <= slack) & (np.maximum(*sides) >= -slack)
        for sides in (from_line, from_way)
    ]
    return np.asarray((parted[0] & parted[1]).any(axis=0))


def _first(bad: Bools) -> int:
    """How many come before the first that is bad."""
    return int(np.argmax(bad)) if bad.any() else len(bad)
