"""Exact legs between augmented goals: branch by branch, or pulled along their words."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.base.ram import check_available
from netsp.base.time_flags import NEVER, Flag
from netsp.gtsp.cost_oracle import Estimate
from netsp.hsignature import Word, concatenate, invert
from netsp.roadmap.branches import OPEN, Branches, Lengths, build_branches, fill, fill_parallel
from netsp.roadmap.leg_provider import Legs
from netsp.roadmap.paths import TautPaths, UnknownPathError
from netsp.roadmap.slits import Ends, flatten_words, slit_lengths
from netsp.roadmap.taut_by_word import Path, path_from_pieces, pull_each
from netsp.roadmap.tethertree import GrowingTree, TetherTree

ROUNDED_DOWN = 1.0 - 2.0**-23
"""Format of single precision: a length times this is rounded to no more than the length."""


class TautLegs(Legs):
    """Exact legs between given augmented goals.

    Parameters
    ----------
    cluster, signatures, planar
        Goal (0 is the base), word and planar taut tether length of each vertex; the first is the
        base.

    Attributes
    ----------
    left_out
        Legs (u, v), u < v, whose taut path was not found. Such a leg is replaced by the path back
        along the tether of u and out along the tether of v, which has the same class and is at
        least as long.
    """

    def __init__(
        self, paths: TautPaths, cluster: Ints, signatures: Sequence[Word], planar: Floats
    ) -> None:
        self.paths, self.cluster, self.planar = paths, cluster, planar
        self.policy = paths.policy.legs
        self.signatures = list(signatures)
        self._z = paths.problem.points[:, 2]
        self._tree: TetherTree | None = None
        self.left_out: set[tuple[int, int]] = set()

    def estimate(self, k: int) -> Estimate:
        """Return the estimate for all legs among k vertices, found branch by branch."""
        return Estimate(self.policy.s_per_leg * k * (k - 1) / 2, 8.0 * k * k)

    def lengths(
        self, vertices: Ints, wanted: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return the (k, k) 3D leg lengths among vertices; inf within a cluster, and undefined
        where `wanted` is false.

        Raises LimitReachedError when the clock is up before all are found. Legs among up to
        `untimed_vertices` are found whatever the clock says.
        """
        vertices = np.asarray(vertices, dtype=np.int64)
        if (
            wanted is None
            and len(vertices) <= self.policy.untimed_vertices
            and len(self.cluster) > self.policy.max_parted_classes
        ):
            # one by one, even if time is up, because building the tree of tethers takes a while
            wanted = np.ones((len(vertices), len(vertices)), dtype=bool)
        few = max(self.policy.max_single_legs, 2 * len(vertices))
        if wanted is not None and wanted.sum() <= few:
            return self._selected(vertices, wanted)
        return self._matrix(vertices, np.float64, 1.0, clock)

    def rounded(self, vertices: Ints, clock: Clock | None = None) -> Floats:
        """Return the (k, k) 3D leg lengths in single precision, rounded down; inf within a cluster.
        Raise LimitReachedError as `lengths` does."""
        return self._matrix(np.asarray(vertices, dtype=np.int64), np.float32, ROUNDED_DOWN, clock)

    def blocks(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Iterator[tuple[Ints, Floats]]:
        """Yield the legs among vertices in single precision, rounded down, in blocks of rows: (r,)
        positions among the vertices, and (r, k) lengths, which are valid until the next block.

        Raises LimitReachedError as `lengths` does.

        Parameters
        ----------
        rows
            Positions whose rows are wanted; by default all.
        """
        vertices = np.asarray(vertices, dtype=np.int64)
        clock, n = clock or Clock(), len(vertices)
        _measure_in_time(clock, lambda: self._tether_tree(clock.flag), n)
        size = max(self.policy.block_rows, self.policy.max_block_legs // max(n, 1))
        branches = build_branches(self._tether_tree(clock.flag), vertices)
        places = np.arange(n) if rows is None else np.sort(branches.rank[rows])
        out: Floats = np.empty((min(size, len(places)), n), dtype=np.float32)  # type: ignore[assignment]
        for first in range(0, len(places), size):
            block_places = places[first : first + size]
            block, positions = out[: len(block_places)], branches.order[block_places]
            row = np.full(n, -1, dtype=np.int64)
            row[block_places] = np.arange(len(block_places))

            def fill_block(row: Ints = row, block: Floats = block) -> None:
                self._fill(vertices, ROUNDED_DOWN, block, clock.flag, branches, row)

            _measure_in_time(clock, fill_block, n)
            self._set_non_legs(vertices, positions, ROUNDED_DOWN, block)
            yield positions, block

    def _matrix(
        self, vertices: Ints, kind: type[np.floating], share: float, clock: Clock | None
    ) -> Floats:
        """Return all legs among vertices, found branch by branch (`netsp.roadmap.branches`)."""
        n = len(vertices)
        check_available(
            float(np.dtype(kind).itemsize) * n**2,
            f"legs between {n} homotopy classes",
            "lower tether_length or max_classes",
        )
        out: Floats = np.empty((n, n), dtype=kind)  # type: ignore[assignment]

        def whole(stop: Flag) -> None:
            branches = build_branches(self._tether_tree(stop), vertices)
            self._fill(vertices, share, out, stop, branches, branches.order)

        # a few legs are measured even if time is up, or there would be no tour
        if (
            n <= self.policy.untimed_vertices
            and len(self.cluster) <= self.policy.max_parted_classes
        ):
            whole(NEVER)
        else:
            clock = clock or Clock()
            _measure_in_time(clock, lambda: whole(clock.flag), n)
        self._set_non_legs(vertices, np.arange(n), share, out)
        return out

    def _set_non_legs(self, vertices: Ints, rows: Ints, share: float, out: Floats) -> None:
        """Write the other entries into rows (r, k): tethers for legs of the base, inf within a
        goal."""
        point, tethers = self.cluster[vertices], share * self.to_base()[vertices]
        for base in np.flatnonzero(point == 0).tolist():
            out[rows == base] = tethers
            out[:, base] = tethers[rows]
        for g in np.unique(point).tolist():
            out[np.ix_(point[rows] == g, point == g)] = np.inf

    def _fill(
        self, vertices: Ints, share: float, out: Floats, stop: Flag, branches: Branches, row: Ints
    ) -> None:
        """Write the legs between goals into (r, k) `out`; some are missing when the flag is set."""
        rows = self.policy.block_rows
        for first in range(0, len(out), rows):
            if stop[0]:
                return
            out[first : first + rows] = OPEN
        paths, (every, points) = self.paths, self._ends
        letters, at = flatten_words([self.signatures[v] for v in vertices])
        ends = Ends(every.place[vertices], every.cell[vertices], letters, at)
        point = points[vertices]
        lengths = Lengths(self.planar[vertices], self._z[point], share, out, row)
        i, j = 0, 1 if len(out) == len(vertices) else 0
        while True:
            i, j = fill(branches, lengths, point, ends, paths.slits, paths.arcs, stop, i, j)
            if i >= len(vertices) or stop[0]:
                return
            u, v = branches.order[sorted((i, j))].tolist()
            found = self._search_leg(int(vertices[u]), int(vertices[v]), stop)
            if found is None:
                around = share * self._through_base(int(vertices[u]), int(vertices[v]))
                for x, y in ((u, v), (v, u)):
                    if row[branches.rank[x]] >= 0:
                        out[row[branches.rank[x]], y] = around
                continue
            length, path = found
            fill_parallel(u, v, length, len(path.ints) - 1, path, branches, lengths)

    def _search_leg(self, u: int, v: int, stop: Flag) -> tuple[float, Path] | None:
        """Search for a leg that could not be pulled. Return its planar length and its path, or None
        if it is not found; raise LimitReachedError if the flag is set first."""
        a, b = int(self.cluster[u]), int(self.cluster[v])
        word, longest = self.relative_word(u, v), self._max_length(u, v)
        try:
            length, pieces = self.paths.pieces(a, b, word, longest, stop)
        except UnknownPathError:
            return None
        return length, path_from_pieces(a, pieces, self.paths.tangents.target, self.paths.arcs)

    def _through_base(self, u: int, v: int) -> float:
        """Return the 3D length of the path back along one tether and out along another, and record
        the leg as left out."""
        self.left_out.add((min(u, v), max(u, v)))
        tethers = self.to_base()
        return float(tethers[u] + tethers[v])

    def bounds_of_left_out(self) -> Floats:
        """Return lower bounds (k, 3) in 3D for each leg of `left_out`: on the tether at one end,
        the leg, and the tether at the other end."""
        tethers = self.to_base()
        rows = [
            (tethers[u], self.lower_bounds(np.array([u, v]))[0, 1], tethers[v])
            for u, v in sorted(self.left_out)
        ]
        return np.array(rows).reshape(-1, 3)

    def _tether_tree(self, stop: Flag) -> TetherTree:
        """Return the tree of all tethers, built once; it is not complete when the flag is set."""
        if self._tree is not None:
            return self._tree
        paths, (ends, point) = self.paths, self._ends
        growing = GrowingTree(len(point))
        missing = growing.pull(ends, point, paths.slits, paths.arcs, stop).tolist()
        known: dict[int, Path] = {}
        if len(missing) > self.policy.min_joint_searches and not stop[0]:
            known = self._search_tethers(missing, stop)
        for v in missing:
            if stop[0]:
                break
            path = known.get(v)
            if path is None and (found := self._search_leg(0, v, stop)) is not None:
                path = found[1]
            # a leg left out has no known path to share with other legs
            if path is not None:
                growing.add(v, path, paths.arcs)
        tree = growing.tree()
        if not stop[0]:
            self._tree = tree
        return tree

    def _search_tethers(self, vertices: list[int], stop: Flag) -> dict[int, Path]:
        """Return the tethers of vertices, found by one search; fewer when the flag is set."""
        paths, (_, point) = self.paths, self._ends
        found = paths.tethers(
            point[vertices].tolist(),
            [self.signatures[v] for v in vertices],
            float(self.planar[vertices].max()),
            stop,
        )
        return {
            v: path_from_pieces(0, pieces, paths.tangents.target, paths.arcs)
            for v, pieces in zip(vertices, found, strict=True)
            if pieces is not None and not stop[0]
        }

    def to_base(self) -> Floats:
        """Return the (V,) 3D lengths of the legs from the base, which are the tethers."""
        return np.asarray(np.hypot(self.planar, self._z[self.cluster] - self._z[0]))

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return (k, k) lower bounds on leg lengths: a leg is no shorter than its class among slits
        (`netsp.roadmap.slits`), nor than the difference of its two tethers (triangle inequality in
        the cover).

        Parameters
        ----------
        rows
            (r,) positions among the vertices; the result is then (r, k).
        """
        vertices = np.asarray(vertices, dtype=np.int64)
        cluster, planar, z = self.cluster[vertices], self.planar[vertices], self._z
        positions = np.arange(len(vertices)) if rows is None else np.asarray(rows, dtype=np.int64)
        check_available(
            3.0 * 8.0 * len(positions) * len(vertices),
            f"bounds on the legs between {len(vertices)} homotopy classes",
            "lower tether_length or max_classes",
        )
        stop = NEVER if clock is None else clock.flag
        words = [self.signatures[v] for v in vertices]
        low = slit_lengths(
            self.paths.slits, self.paths.outline.places, cluster, words, rows, stop, self.policy
        )
        if stop[0]:
            raise LimitReachedError(
                f"time limit reached while bounding the legs between {len(vertices)} homotopy "
                "classes; lower tether_length or raise the limit"
            )
        size = self.policy.block_rows
        for first in range(0, len(positions), size):
            part, block = positions[first : first + size], low[first : first + size]
            np.maximum(block, np.abs(planar[part][:, None] - planar[None, :]), out=block)
            # rounding must not lift a bound above the length
            block -= self.paths.margin
            np.maximum(block, 0.0, out=block)
            if np.ptp(z) > 0.0:
                np.hypot(block, z[cluster[part]][:, None] - z[cluster][None, :], out=block)
        return low

    def relative_word(self, u: int, v: int) -> Word:
        """Return the word of the leg from vertex u to vertex v."""
        return concatenate(invert(self.signatures[u]), self.signatures[v])

    def path(self, u: int, v: int) -> Floats:
        """Return the (n, 3) polyline of the taut leg from vertex u to vertex v, with arcs
        circumscribed; height changes in proportion to planar length."""
        if u > v:  # one search serves both directions
            return self.path(v, u)[::-1].copy()
        word, longest = self.relative_word(u, v), self._max_length(u, v)
        try:
            return self.paths.path(int(self.cluster[u]), int(self.cluster[v]), word, longest)
        except UnknownPathError:
            if 0 in (u, v):
                raise
            return np.vstack([self.path(u, 0), self.path(0, v)[1:]])

    def _max_length(self, u: int, v: int) -> float:
        """Return an upper bound on the planar length of a leg: back along one tether to where the
        other parts, as far as that is known."""
        part = 0.0 if self._tree is None else self._tree.shared_length(u, v)
        return float(self.planar[u] + self.planar[v] - 2.0 * part)

    def _selected(self, vertices: Ints, wanted: Bools) -> Floats:
        """Return the lengths of a few legs, as `lengths` does; where pulling fails, by a search for
        each leg."""
        out = np.full(wanted.shape, np.inf)
        rows, columns = np.nonzero(np.triu(wanted, 1) | np.tril(wanted, -1).T)
        us, vs = vertices[rows], vertices[columns]
        apart = self.cluster[us] != self.cluster[vs]
        rows, columns, us, vs = rows[apart], columns[apart], us[apart], vs[apart]
        out[rows, columns] = out[columns, rows] = self.pairs(us, vs)
        return out

    def pairs(self, us: Ints, vs: Ints, clock: Clock | None = None) -> Floats:
        """Return the (k,) 3D lengths of legs between vertices of different goals."""
        planar = self._pull_pairs(us, vs)
        around: dict[int, float] = {}
        for k in np.flatnonzero(planar < 0.0).tolist():
            u, v = int(us[k]), int(vs[k])
            if 0 in (u, v):
                planar[k] = self.planar[max(u, v)]
                continue
            a, b = int(self.cluster[u]), int(self.cluster[v])
            try:
                planar[k] = self.paths.planar_length(
                    a, b, self.relative_word(u, v), self._max_length(u, v)
                )
            except UnknownPathError:
                around[k] = self._through_base(u, v)
        out = np.hypot(planar, self._z[self.cluster[us]] - self._z[self.cluster[vs]])
        for k, length in around.items():
            out[k] = length
        return np.asarray(out)

    def _pull_pairs(self, us: Ints, vs: Ints) -> Floats:
        """Return the (k,) planar lengths of legs, negative where they could not be pulled."""
        paths, (ends, point) = self.paths, self._ends
        # strided arrays are another type, for which the kernel would be compiled again
        us, vs = np.ascontiguousarray(us), np.ascontiguousarray(vs)
        out = np.empty(len(us))

        count = self.policy.max_single_legs

        def pull_part(first: int) -> None:
            k = slice(first, first + count)
            pull_each(us[k], vs[k], ends, point, paths.slits, paths.arcs, out[k])

        if len(us) <= count:
            pull_part(0)
        else:
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                list(pool.map(pull_part, range(0, len(us), count)))
        return out

    @cached_property
    def _ends(self) -> tuple[Ends, Ints]:
        """Return the ends of all vertices, and their points."""
        places, point = self.paths.outline.places, np.asarray(self.cluster, dtype=np.int64)
        letters, row = flatten_words(self.signatures)
        return Ends(places[point], self.paths.slits.cells(places[:, 0])[point], letters, row), point


def _measure_in_time(clock: Clock, find: Callable[[], object], classes: int) -> None:
    """Find legs until the clock is up; raise LimitReachedError if it was."""
    clock.interruptible(find)
    if clock.flag[0]:
        raise LimitReachedError(
            f"time limit reached while measuring the legs between {classes} homotopy classes; "
            "lower tether_length or raise the limit"
        )
