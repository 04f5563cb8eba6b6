"""Steps of a look ahead that need no tether model.

Let the robot move straight through free water in the plane, or in any way within a free disk, which
is homotopic to straight. The tether before, the path, and the tether afterwards bound a
pseudo-triangle: three corners, and sides that bend inward, so that it lies in the plane without
overlap and the robot is alone at one of its corners. So the robot can meet only the part of its
tether that has not moved: its path crosses the tether as it was at the beginning, before its last
segment. And the tether is no longer than before plus the path.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.world.scene.field import DistanceField
from netsp.world.tether import Tether


def safe_prefix(field: DistanceField, tether: Tether, places: Floats, tether_length: float) -> int:
    """Return over how many places the robot can surely move without a loop or lack of tether.

    It may be able to move farther.

    Parameters
    ----------
    field : DistanceField
        Field of a scene whose solids stand upright.
    tether : Tether
        Taut tether to the robot.
    places : ndarray, shape (k, 3)
        Next places of the robot, in order, m.
    tether_length : float
        Length of the tether, m.
    """
    robot = tether.robot
    far = np.linalg.norm(places - robot, axis=1)
    count = _count_before(tether.length + far > tether_length)
    if count:
        near = _count_before(far[:count] >= float(field.distance(robot)))
        count = max(near, _count_straight(field, robot, places[:count]))
    if count and len(tether.nodes) > 2:
        path = np.vstack([robot, places[:count]])
        count = _count_before(_meets(tether.nodes[:-1, :2], path[:, :2]))
    return count


def _count_straight(field: DistanceField, robot: Floats, places: Floats) -> int:
    """Return how many places are on one free line from the robot, as far as halving finds out."""
    step, count = places[0] - robot, len(places)
    even = robot + np.arange(1, count + 1)[:, None] * step
    if not (np.abs(even - places) <= 1e-9 * (1.0 + float(np.abs(step).max()))).all():
        return 0
    while count and not field.line_of_sight(robot, places[count - 1]):
        count //= 2
    return count


def _meets(line: Floats, path: Floats) -> Bools:
    """Return whether each step of a path (k + 1, 2) touches a polyline (n, 2), shape (k,)."""
    a, d = line[:-1, None], np.diff(line, axis=0)[:, None]
    p, e = path[None, :-1], np.diff(path, axis=0)[None]
    # on which side of a segment's line the ends of the other segment are
    from_line = [d[..., 0] * (q - a)[..., 1] - d[..., 1] * (q - a)[..., 0] for q in (p, p + e)]
    from_path = [e[..., 0] * (q - p)[..., 1] - e[..., 1] * (q - p)[..., 0] for q in (a, a + d)]
    slack = 1e-12 * (1.0 + np.abs(d).sum(-1) * np.abs(e).sum(-1))
    parted = [
        (np.minimum(*sides) <= slack) & (np.maximum(*sides) >= -slack)
        for sides in (from_line, from_path)
    ]
    return np.asarray((parted[0] & parted[1]).any(axis=0))


def _count_before(bad: Bools) -> int:
    """Return how many entries come before the first true one."""
    return int(np.argmax(bad)) if bad.any() else len(bad)
