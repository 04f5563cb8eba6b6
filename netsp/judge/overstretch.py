"""Check that the taut tether keeps its limit everywhere along a path.

Lemma. Let T(s) be the length of the taut tether at the point s of a path, in the class that the
path gives it. Between two neighbouring vertices of the path, T is at most the larger of its values
at the two. So T keeps a limit along the whole path if it keeps the limit at every vertex.

Proof. A point of the cover is a position together with the class of the tether there, and T is the
distance in the cover from the base with the empty class. In the plane the cover is CAT(0), and with
heights it is the product of that and a line, which is CAT(0), too (docs/theory, Propositions 2
and 6). In a CAT(0) space the distance to a fixed point is convex along geodesics. A straight
segment in free space lifts to a geodesic, so T is convex along it, and a convex function on an
interval is largest at an end. ∎

Many vertices need no string pulling, because T changes by at most the distance travelled. T at a
vertex is at most T at the last known vertex plus the distance from there, and at most T at the next
goal plus the distance to it. If the smaller of the two keeps the limit, so does T.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.judge.stringpull import StringPuller


@dataclass(frozen=True)
class Overstretch:
    """Vertex of a path at which the taut tether, of a given length, exceeds its limit."""

    vertex: int
    length: float


def first_overstretch(
    puller: StringPuller,
    path: Floats,
    pieces: list[list[tuple[int, bool]]],
    limit: float,
    known: dict[int, float],
    allowance: Callable[[Floats], float],
    start: int = 0,
) -> Overstretch | None:
    """Return the first vertex of a path at which the taut tether is over the limit, or None.

    A tether that is over the limit at the start may stay so until it fits, but may not grow.

    Parameters
    ----------
    puller
        Triangulated free space.
    path
        Points (n, 3), from the base.
    pieces
        Triangle edges that each segment of the path crosses, in order.
    limit
        Limit of the tether length, in the problem's units.
    known
        Tether lengths by vertex, with the last vertex among them; none exceeds the limit.
    allowance
        Function from a point (3,) of the path to the excess of the tether that is allowed there.
    start
        Vertex at which the robot begins to move; the path up to it is its tether at the start.
    """
    steps: Floats = np.linalg.norm(np.diff(path, axis=0), axis=1)
    sleeve: list[tuple[int, bool]] = []
    for piece in pieces[:start]:
        _carry(sleeve, piece)

    def pulled(k: int) -> float:
        planar = puller.pull(path[0], path[k], sleeve).low
        return float(np.hypot(planar, path[k, 2] - path[0, 2]))

    bound = pulled(start)
    ceiling = max(limit, bound)
    homeward = _homeward(steps, known)
    for k in range(start + 1, len(path)):
        _carry(sleeve, pieces[k - 1])
        if k in known:
            bound = known[k]
            ceiling = limit
            continue
        bound = min(bound + float(steps[k - 1]), float(homeward[k]))
        if bound <= limit:
            ceiling = limit
            continue
        bound = pulled(k)
        if bound > ceiling and bound > ceiling + allowance(path[k]):
            return Overstretch(k, bound)
        ceiling = max(limit, min(ceiling, bound))
    return None


def _carry(sleeve: list[tuple[int, bool]], piece: list[tuple[int, bool]]) -> None:
    """Append crossings to a reduced sequence in place; crossing an edge back cancels it."""
    for crossing in piece:
        if sleeve and sleeve[-1][0] == crossing[0]:
            sleeve.pop()
        else:
            sleeve.append(crossing)


def _homeward(steps: Floats, known: dict[int, float]) -> Floats:
    """Return for each vertex the tether length at the next known vertex plus the distance there."""
    out = np.full(len(steps) + 1, np.inf)
    for k in range(len(steps), -1, -1):
        if k in known:
            out[k] = known[k]
        elif k < len(steps):
            out[k] = out[k + 1] + steps[k]
    return out
