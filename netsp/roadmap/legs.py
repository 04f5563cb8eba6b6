"""Exact legs between augmented goals: pulled along their words, or else searched for."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property

import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.clock import NEVER, Clock, Flag
from netsp.compiled.kernel import kernel
from netsp.errors import LimitReachedError
from netsp.hsignature import Word, concatenate, invert
from netsp.memory import ask
from netsp.roadmap.arcs import Arcs
from netsp.roadmap.classes import TetherTree
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.pulled import path_for, pull, pull_each
from netsp.roadmap.slits import Ends, Slits, flattened, room_for, slit_lengths
from netsp.roadmap.sought import Tethers, longest_word, sought
from netsp.travel.graph import UNTIMED

BLOCK = 256
"""Rows of a matrix that are worked on at a time, so that what is in between stays small."""

FEW = 20_000
"""So many entries of a matrix are pulled one by one, hundredths of a second; more by both cores."""


class TautLegs:
    """Exact legs between given augmented goals. Satisfies `netsp.travel.graph.Legs`.

    Parameters
    ----------
    cluster, signatures, planar
        Goal (0 is the base), word and planar taut tether length of each vertex.
    tree
        Where their tethers part, if known.
    """

    def __init__(
        self,
        paths: TautPaths,
        cluster: Ints,
        signatures: Sequence[Word],
        planar: Floats,
        tree: TetherTree | None = None,
    ) -> None:
        self.paths, self.cluster, self.planar = paths, cluster, planar
        self.signatures = list(signatures)
        self._z = paths.problem.points[:, 2]
        nothing = np.zeros(1, dtype=np.int64)
        self._tree = tree or TetherTree(np.zeros_like(cluster), nothing - 1, np.zeros(1))

    def lengths(
        self, vertices: Ints, asked: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """(k, k) 3D leg lengths among the given vertices; inf within a cluster, and where `asked`
        is given and false. LimitReachedError when the clock is up before all of many are measured.
        """
        vertices = np.asarray(vertices, dtype=np.int64)
        cluster = self.cluster[vertices]
        if asked is not None and asked.sum() <= max(FEW, 2 * len(vertices)):
            return self._few(vertices, asked)
        ask(
            2.0 * 8.0 * len(vertices) ** 2,
            f"legs between {len(vertices)} homotopy classes",
            "lower tether_length or max_classes",
        )
        # what takes a fraction of a second is measured all the same, or there would be no tour
        count = len(vertices) ** 2 if asked is None else int(asked.sum())
        stop = clock.flag if clock is not None and count > UNTIMED**2 else NEVER
        out = np.full((len(vertices), len(vertices)), np.inf)
        letters, row = flattened([self.signatures[v] for v in vertices])
        tethers = Tethers(
            letters, row, cluster, self.planar[vertices], self._tree.last[vertices],
            self._tree.parent, self._tree.depth, self._tree.length,
        )  # fmt: skip
        if asked is None:
            asked = np.ones(out.shape, dtype=bool)
        goals = np.unique(cluster)

        def measure(g: int) -> None:
            here = np.flatnonzero(cluster == g)
            there = np.flatnonzero(cluster > g)
            if len(there) == 0 or stop[0]:
                return
            if g == 0:
                block = np.broadcast_to(tethers.planar[there], (len(here), len(there)))
            else:
                block = self._legs_from(g, here, there, asked, tethers, stop)
            block = np.hypot(block, (self._z[g] - self._z[cluster[there]])[None, :])
            out[np.ix_(here, there)] = block
            out[np.ix_(there, here)] = block.T

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(measure, goals.tolist()))
        if stop[0]:
            raise LimitReachedError(
                f"time limit reached while measuring the legs between {len(vertices)} homotopy "
                "classes; lower tether_length or raise the limit"
            )
        return out

    def _legs_from(
        self, g: int, here: Ints, there: Ints, asked: Bools, tethers: Tethers, stop: Flag
    ) -> Floats:
        """(len(here), len(there)) planar lengths of all legs from the classes of goal g."""
        paths = self.paths
        places, cluster = paths.outline.places, tethers.cluster
        cells = paths.slits.cells(places[:, 0])
        ends = Ends(places[cluster], cells[cluster], tethers.letters, tethers.row)
        out = np.full((len(here), len(there)), np.inf)
        left = _pulled(here, there, asked, cluster, ends, paths.slits, paths.arcs, out, stop)
        if left and not stop[0]:
            asked = asked[np.ix_(here, there)] & np.isinf(out)
            found = sought(paths, g, here, there, asked, tethers, ends, stop)
            np.minimum(out, found, out=out)
        return out

    def to_base(self) -> Floats:
        """(V,) 3D lengths of the legs from the base, which are the tethers."""
        return np.asarray(np.hypot(self.planar, self._z[self.cluster] - self._z[0]))

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """(k, k) lower bounds on leg lengths: a leg is no shorter than its class among slits
        (`netsp.roadmap.slits`), nor than the difference of its two tethers (triangle inequality
        on the cover).

        Parameters
        ----------
        rows
            (r,) positions among the vertices; then (r, k).
        """
        vertices = np.asarray(vertices, dtype=np.int64)
        cluster, planar, z = self.cluster[vertices], self.planar[vertices], self._z
        own = np.arange(len(vertices)) if rows is None else np.asarray(rows, dtype=np.int64)
        ask(
            3.0 * 8.0 * len(own) * len(vertices),
            f"bounds on the legs between {len(vertices)} homotopy classes",
            "lower tether_length or max_classes",
        )
        stop = NEVER if clock is None else clock.flag
        words = [self.signatures[v] for v in vertices]
        low = slit_lengths(self.paths.slits, self.paths.outline.places, cluster, words, rows, stop)
        if stop[0]:
            raise LimitReachedError(
                f"time limit reached while bounding the legs between {len(vertices)} homotopy "
                "classes; lower tether_length or raise the limit"
            )
        for first in range(0, len(own), BLOCK):
            part, block = own[first : first + BLOCK], low[first : first + BLOCK]
            np.maximum(block, np.abs(planar[part][:, None] - planar[None, :]), out=block)
            # rounding must not lift a bound above the length
            block -= self.paths.margin
            np.maximum(block, 0.0, out=block)
            if np.ptp(z) > 0.0:
                np.hypot(block, z[cluster[part]][:, None] - z[cluster][None, :], out=block)
        return low

    def relative_word(self, u: int, v: int) -> Word:
        """The word of the leg from vertex u to vertex v."""
        return concatenate(invert(self.signatures[u]), self.signatures[v])

    def path(self, u: int, v: int) -> Floats:
        """(n, 3) polyline of the taut leg from vertex u to vertex v, arcs circumscribed; height
        changes in proportion to planar length."""
        if u > v:  # searched once for both senses
            return self.path(v, u)[::-1].copy()
        word, longest = self.relative_word(u, v), self._longest(u, v)
        return self.paths.path(int(self.cluster[u]), int(self.cluster[v]), word, longest)

    def _longest(self, u: int, v: int) -> float:
        """More than the planar length of a leg: back along one tether to where the other parts."""
        s, t, tree = int(self._tree.last[u]), int(self._tree.last[v]), self._tree
        while s != t:
            if tree.depth[s] >= tree.depth[t]:
                s = int(tree.parent[s])
            else:
                t = int(tree.parent[t])
        return float(self.planar[u] + self.planar[v] - 2.0 * tree.length[s])

    def _few(self, vertices: Ints, asked: Bools) -> Floats:
        """As `lengths`, for a few legs; those that cannot be pulled are searches of their own."""
        out = np.full(asked.shape, np.inf)
        rows, columns = np.nonzero(np.triu(asked, 1) | np.tril(asked, -1).T)
        us, vs = vertices[rows], vertices[columns]
        apart = self.cluster[us] != self.cluster[vs]
        rows, columns, us, vs = rows[apart], columns[apart], us[apart], vs[apart]
        out[rows, columns] = out[columns, rows] = self.pairs(us, vs)
        return out

    def pairs(self, us: Ints, vs: Ints) -> Floats:
        """(k,) 3D lengths of legs between vertices of different goals."""
        planar = self._each(us, vs)
        for k in np.flatnonzero(planar < 0.0).tolist():
            u, v = int(us[k]), int(vs[k])
            a, b = int(self.cluster[u]), int(self.cluster[v])
            planar[k] = self.paths.planar_length(
                a, b, self.relative_word(u, v), self._longest(u, v)
            )
        return np.asarray(np.hypot(planar, self._z[self.cluster[us]] - self._z[self.cluster[vs]]))

    def _each(self, us: Ints, vs: Ints) -> Floats:
        """(k,) planar lengths of legs, negative where they could not be pulled."""
        paths, (ends, point) = self.paths, self._ends
        out = np.empty(len(us))

        def some(first: int) -> None:
            k = slice(first, first + FEW)
            pull_each(us[k], vs[k], ends, point, paths.slits, paths.arcs, out[k])

        if len(us) <= FEW:
            some(0)
        else:
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                list(pool.map(some, range(0, len(us), FEW)))
        return out

    @cached_property
    def _ends(self) -> tuple[Ends, Ints]:
        """Of all vertices, and their points."""
        places, point = self.paths.outline.places, np.asarray(self.cluster, dtype=np.int64)
        letters, row = flattened(self.signatures)
        return Ends(places[point], self.paths.slits.cells(places[:, 0])[point], letters, row), point


@kernel
def _pulled(
    here: Ints, there: Ints, asked: Bools, cluster: Ints, ends: Ends, slits: Slits, arcs: Arcs,
    out: Floats, stop: Ints,
) -> int:  # fmt: skip
    """The planar lengths of legs between two lists of vertices, into (len(here), len(there)) `out`;
    how many of those asked for could not be pulled."""
    longest = longest_word(here, there, ends.row)
    room, path = room_for(longest, slits), path_for(longest)
    left = 0
    for a in range(len(here)):
        if stop[0] != 0:
            break
        u = here[a]
        for b in range(len(there)):
            v = there[b]
            if asked[u, v]:
                length, _, _ = pull(u, v, ends, cluster, slits, arcs, room, path)
                if length >= 0.0:
                    out[a, b] = length
                else:
                    left += 1
    return left
