"""Tethers as paths in a tree of bends.

All tethers begin at the base, and in the cover two tethers that have parted never meet again. So
all tethers that share a beginning share the bends of that beginning in the tree.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.dynamic_array import more_int_rows, more_rows
from netsp.base.compiled.kernel import kernel
from netsp.base.time_flags import Flag
from netsp.roadmap.arcs import LENGTH, RADIUS, Arcs
from netsp.roadmap.slits import Ends, Slits, empty_workspace, max_word_length
from netsp.roadmap.taut_by_word import EDGE, NODE, SAME_ANGLE, SLID, Path, empty_path, pull

AT, PARENT, CHILD, SIBLING = range(4)
"""Columns of the integers of a bend: its directed arc, the bend before (-1 at the root), the last
bend found after it, and the one of the same parent that was found before it (-1 for none)."""

TURNED, REACHED = range(2)
"""Columns of the floats of a bend: angle slid on the arc before, and length of tether up to it."""


class TetherTree(NamedTuple):
    """Tethers as paths in a tree of bends whose root is the base.

    Attributes
    ----------
    node, parent
        (bends,) directed arc, and the bend before, which is earlier in the arrays; -1 at the base.
    turned, length
        (bends,) angle slid on the arc before a bend, and length of tether up to it.
    last, slid
        (V,) last bend of each tether, and the angle slid there.
    """

    node: Ints
    parent: Ints
    turned: Floats
    length: Floats
    last: Ints
    slid: Floats

    def shared_length(self, u: int, v: int) -> float:
        """Return the length that two tethers have in common."""
        s, t = int(self.last[u]), int(self.last[v])
        while s != t:  # a bend comes after its parent
            if s > t:
                s = int(self.parent[s])
            else:
                t = int(self.parent[t])
        return float(self.length[s])


class Growth(NamedTuple):
    """Arrays of a tree that grows.

    Attributes
    ----------
    ints, floats
        (capacity, 4) and (capacity, 2) columns AT … and TURNED ….
    last, slid
        (V,) arrays of `TetherTree`; -1 for a tether that could not be pulled.
    """

    ints: Ints
    floats: Floats
    last: Ints
    slid: Floats


class GrowingTree:
    """Tree of bends to which tethers are added.

    Parameters
    ----------
    vertices
        Number of tethers. A tether that is never added bends at the base alone.
    """

    def __init__(self, vertices: int) -> None:
        self._growth = Growth(
            np.full((256, 4), -1, dtype=np.int64),
            np.zeros((256, 2)),
            np.zeros(vertices, dtype=np.int64),
            np.zeros(vertices),
        )
        self._size = 1

    def pull(self, ends: Ends, point: Ints, slits: Slits, arcs: Arcs, stop: Flag) -> Ints:
        """Add the tethers from vertex 0, the base, to all vertices. Return the vertices whose
        tether could not be pulled. Vertices are missing when the flag is set."""
        self._growth, self._size = _grow(ends, point, slits, arcs, self._growth, self._size, stop)
        last = self._growth.last
        missing = np.flatnonzero(last < 0)
        last[missing] = 0
        return missing

    def add(self, vertex: int, path: Path, arcs: Arcs) -> None:
        """Add the tether of a vertex, given as a path."""
        count = len(path.ints) - 1
        self._growth, self._size = _graft(vertex, count, path, arcs, self._growth, self._size)

    def tree(self) -> TetherTree:
        """Return the tree as it is."""
        growth = self._growth
        ints, floats = growth.ints[: self._size], growth.floats[: self._size]
        return TetherTree(
            ints[:, AT].copy(),
            ints[:, PARENT].copy(),
            floats[:, TURNED].copy(),
            floats[:, REACHED].copy(),
            growth.last,
            growth.slid,
        )


@kernel
def _grow(
    ends: Ends, point: Ints, slits: Slits, arcs: Arcs, growth: Growth, size: int, stop: Ints
) -> tuple[Growth, int]:
    longest = max_word_length(ends.row)
    room, path = empty_workspace(longest, slits), empty_path(longest, arcs.max_bends)
    for v in range(1, len(point)):
        if stop[0] != 0:
            break
        length, _, count = pull(0, v, ends, point, slits, arcs, room, path)
        if length < 0.0:
            growth.last[v] = -1
            continue
        growth, size = _graft(v, count, path, arcs, growth, size)
    return growth, size


@kernel
def _graft(
    v: int, count: int, path: Path, arcs: Arcs, growth: Growth, size: int
) -> tuple[Growth, int]:
    """Add the tether of vertex v, a path of `count` tangents, and return the tree with its size."""
    ints, floats, path_ints, path_floats = growth.ints, growth.floats, path.ints, path.floats
    disk, edge = arcs.disk, arcs.edge_floats
    bend, by, reached = 0, 0.0, 0.0
    for k in range(1, count):
        reached += by * disk[path_ints[k - 1, NODE], RADIUS] + edge[path_ints[k - 1, EDGE], LENGTH]
        child = ints[bend, CHILD]
        while child >= 0 and not (
            ints[child, AT] == path_ints[k, NODE] and abs(floats[child, TURNED] - by) <= SAME_ANGLE
        ):
            child = ints[child, SIBLING]
        if child < 0:
            if size == len(ints):
                ints, floats = more_int_rows(ints), more_rows(floats)
            child = size
            size += 1
            ints[child, AT], ints[child, PARENT] = path_ints[k, NODE], bend
            ints[child, CHILD], ints[child, SIBLING] = -1, ints[bend, CHILD]
            ints[bend, CHILD] = child
            floats[child, TURNED], floats[child, REACHED] = by, reached
        bend, by = child, path_floats[k, SLID]
    growth.last[v], growth.slid[v] = bend, by
    return Growth(ints, floats, growth.last, growth.slid), size
