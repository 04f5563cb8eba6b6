"""Single taut paths, by their words: tangents and circumscribed arcs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.base.errors import InputError, LimitReachedError, NetspError, counted, warn_left_out
from netsp.base.time_flags import NEVER, Flag
from netsp.hsignature import Word
from netsp.model.problem import Problem
from netsp.roadmap.arcs import Arcs, build_arcs
from netsp.roadmap.explore import ALL, FoundPaths, run_explore
from netsp.roadmap.outline import Outline, build_outline, is_free
from netsp.roadmap.roadmap_policy import RoadmapPolicy
from netsp.roadmap.shortest import ContactGraph
from netsp.roadmap.slits import Ends, Slits, build_slits, flatten_words, slit_lengths
from netsp.roadmap.tangents import TangentGraph, build_tangents
from netsp.roadmap.taut_by_word import pull_each, pull_one
from netsp.roadmap.trie import Trie


class UnknownPathError(NetspError):
    """Error: no taut path of a word was found."""


class TautPaths:
    """Taut paths between the base (point 0) and the goals (points 1 …) of a problem.

    Parameters
    ----------
    longest
        Largest planar length of a path. By default it is that of a leg between two admissible
        classes, and obstacles that the tether cannot touch are ignored.
    clock
        Clock of the run; None for no time limit.

    Raises
    ------
    LimitReachedError
        The clock was up before outline and tangents were complete.
    """

    def __init__(
        self,
        problem: Problem,
        longest: float | None = None,
        clock: Clock | None = None,
        policy: RoadmapPolicy | None = None,
    ) -> None:
        self.problem = problem
        self.policy = policy or RoadmapPolicy()
        self.outline: Outline = build_outline(problem, clock)
        reach = problem.tether_length if longest is None else longest
        self.tangents: TangentGraph = build_tangents(self.outline, reach, clock, self.policy.sight)
        self._longest = 2.0 * problem.tether_length if longest is None else longest
        # the most that rounding and the extra growth of obstacles add to a length
        self.margin = 100.0 * self.outline.margin
        self._z = problem.points[:, 2]
        self._cache: dict[tuple[int, int, Word], tuple[float, list[tuple[int, float]]]] = {}

    @cached_property
    def contacts(self) -> ContactGraph:
        """Return the graph of shortest paths in any class over the same tangents."""
        return ContactGraph(self.outline, self.tangents, policy=self.policy)

    def bounds_in_any_class(self, up: Callable[[], bool]) -> Floats:
        """Return (points, points) lower bounds on 3D paths between points, in any class.

        Parameters
        ----------
        up : callable
            Returns whether the time is up; the remaining pairs then get straight distances.
        """
        return self.contacts.distance_bounds(self._z, up)

    @cached_property
    def arcs(self) -> Arcs:
        """Return the tangent graph in the form over which paths are pulled."""
        return build_arcs(self.problem, self.outline, self.tangents, self.slits, self.policy.paths)

    @cached_property
    def slits(self) -> Slits:
        """Return the slits, which bound lengths from below."""
        return build_slits(self.problem)

    def length(self, a: int, b: int, word: Word) -> float:
        """Return the 3D length of the taut path of a word from point a to point b."""
        return math.hypot(self.planar_length(a, b, word), float(self._z[b] - self._z[a]))

    def lengths(self, a: Sequence[int], b: Sequence[int], words: Sequence[Word]) -> Floats:
        """Return the 3D lengths (k,) of many taut paths at once; inf, with a warning, for each path
        that is not found."""
        from_, to = np.asarray(a, dtype=np.int64), np.asarray(b, dtype=np.int64)
        ends_of = list(zip(from_.tolist(), to.tolist(), words, strict=True))
        for p, q, word in ends_of:
            if not self._has_obstacles_of(word):
                raise UnknownPathError(f"no obstacle for every letter of word {word} ({p} to {q})")
        points = np.concatenate([from_, to])
        letters, row = flatten_words([*[()] * len(from_), *words])
        places = self.outline.places[points]
        ends = Ends(places, self.slits.cells(places[:, 0]), letters, row)
        out, pairs = np.empty(len(from_)), np.arange(len(from_))
        pull_each(pairs, pairs + len(pairs), ends, points, self.slits, self.arcs, out)
        for k in np.flatnonzero(out < 0.0).tolist():
            try:
                out[k] = self.planar_length(*ends_of[k])
            except UnknownPathError:
                out[k] = np.inf
        if missing := int(np.isinf(out).sum()):
            warn_left_out(f"lengths of {counted(missing, 'taut path')} left out: no path was found")
        return np.asarray(np.hypot(out, self._z[to] - self._z[from_]))

    def planar_length(self, a: int, b: int, word: Word, longest: float | None = None) -> float:
        """Return the planar length, at most `longest`, of the taut path of a word from point a to
        point b."""
        return self.pieces(a, b, word, longest)[0]

    def planar_length_within(self, a: int, b: int, word: Word, longest: float) -> float | None:
        """Return the planar length of the taut path of a word from point a to point b; None if it
        exceeds `longest`."""
        key = (a, b, tuple(word))
        if key not in self._cache:
            found = self._find(a, b, word, longest)
            if found is None:
                return None
            self._cache[key] = found
        planar = self._cache[key][0]
        return planar if planar <= longest + self.margin else None

    def slit_length(self, a: int, b: int, word: Word) -> float:
        """Return a lower bound on the planar length of the taut path of a word from point a to
        point b."""
        places, cluster = self.outline.places, np.array([a, b])
        return float(slit_lengths(self.slits, places, cluster, [(), tuple(word)])[0, 1])

    def turning(self, a: int, b: int, word: Word) -> float:
        """Return the sum of the angles in the plan by which the taut path of a word turns,
        radians."""
        _, pieces = self.pieces(a, b, word)
        return float(sum(slid for _, slid in pieces[1:]))

    def path(self, a: int, b: int, word: Word, longest: float | None = None) -> Floats:
        """Return the (n, 3) polyline of the taut path of a word from point a to point b, whose
        planar length is known not to exceed `longest`."""
        _, pieces = self.pieces(a, b, word, longest)
        return self._with_heights(a, b, self._polyline(a, b, pieces))

    def _with_heights(self, a: int, b: int, xy: Floats) -> Floats:
        """Return the (n, 3) polyline of a planar one from point a to point b, rising evenly."""
        steps = np.hypot(*np.diff(xy, axis=0).T)
        total = float(steps.sum())
        fraction = np.concatenate([[0.0], np.cumsum(steps)]) / total if total else steps
        if not total:
            fraction = np.linspace(0.0, 1.0, len(xy))
        z = self._z[a] + fraction * (self._z[b] - self._z[a])
        out = np.column_stack([xy + self.outline.origin, z])
        out[0], out[-1] = self.problem.points[a], self.problem.points[b]
        return out

    def tether(self, goal: int, word: Word) -> Floats:
        """Return the (n, 3) polyline of the taut tether to a goal (0-based), as a solution states
        it.

        Raises InputError if there is no such goal or class.
        """
        known = len(self.problem.obstacles)
        if goal < len(self.problem.goals) and all(1 <= abs(a) <= known for a in word):
            try:
                return self.path(0, goal + 1, tuple(word))
            except NetspError:
                pass
        raise InputError(
            f"solution: tour: no taut tether to goal #{goal} has the word {list(word)}"
        )

    def tether_if_found(self, goal: int, word: Word) -> Floats | None:
        """Return the tether as `tether` does; None, with a warning, if the search for its path
        fails."""
        try:
            return self.path(0, goal + 1, tuple(word))
        except UnknownPathError:
            if not self._has_obstacles_of(word):
                return self.tether(goal, word)
            label = self.problem.goal_label(goal)
            warn_left_out(f"tether to {label} left out: no taut path of word {list(word)} found")
            return None

    def pieces(
        self, a: int, b: int, word: Word, longest: float | None = None, stop: Flag = NEVER
    ) -> tuple[float, list[tuple[int, float]]]:
        """Return the planar length, and (departure, angle slid before it) along the taut path of a
        word from point a to point b, whose planar length is known not to exceed `longest`.

        Raises LimitReachedError when the flag of a clock is set before the path is found.
        """
        key = (a, b, tuple(word))
        if key not in self._cache:
            if len(self._cache) >= self.policy.paths.max_known:
                self._cache.clear()
            self._cache[key] = self._search(a, b, word, longest, stop)
        return self._cache[key]

    def _search(
        self, a: int, b: int, word: Word, longest: float | None, stop: Flag
    ) -> tuple[float, list[tuple[int, float]]]:
        found = self._find(a, b, word, longest, stop)
        if found is None and self._has_obstacles_of(word):
            found = self._search_all_words(a, b, word, longest, stop)
        if found is None:
            raise UnknownPathError(f"internal: no taut path of word {word} from {a} to {b}")
        return found

    def _find(
        self, a: int, b: int, word: Word, longest: float | None, stop: Flag = NEVER
    ) -> tuple[float, list[tuple[int, float]]] | None:
        """Return length and pieces; None if the path is longer than `longest`."""
        if not self._has_obstacles_of(word):
            return None
        length, edges, slid = self._pull(a, b, word)
        if length >= 0.0:
            return length, list(zip(edges.tolist(), slid.tolist(), strict=True))
        return self._search_word(a, b, word, longest, stop)

    def _search_word(
        self, a: int, b: int, word: Word, longest: float | None = None, stop: Flag = NEVER
    ) -> tuple[float, list[tuple[int, float]]] | None:
        """Search for the path of a word, as `_find`, by following the word."""
        for limit in self._limits(a, b, longest):
            trie = Trie.from_word(word, limit)
            found = run_explore(
                self.tangents, a, trie, keeps_tree=True, margin=self.outline.margin, stop=stop
            )
            best = _shortest_hit(found, b, len(word))
            if best is not None:
                return best
            _check_flag(stop, word)
        return None

    def _search_all_words(
        self, a: int, b: int, word: Word, longest: float | None = None, stop: Flag = NEVER
    ) -> tuple[float, list[tuple[int, float]]] | None:
        """Search for the path of a word, as `_find`, among the paths of all words.

        The search prunes no pending letter. It also returns None if it needs more than
        `PathPolicy.max_states`.
        """
        rest = self.contacts.remaining_lengths(b).to_end
        for limit in self._limits(a, b, longest):
            trie = Trie.root(limit)
            found = run_explore(
                self.tangents,
                a,
                trie,
                keeps_tree=True,
                margin=self.outline.margin,
                rule=ALL,
                target=(b, rest),
                max_states=self.policy.paths.max_states,
                stop=stop,
            )
            for w in np.unique(found.word[found.goal == b]).tolist():
                if trie.word(w) == tuple(word):
                    return _shortest_hit(found, b, w)
            _check_flag(stop, word)
            if found.capped:
                return None
        return None

    def _limits(self, a: int, b: int, longest: float | None) -> Iterator[float]:
        """Yield growing limits of length for the search for a path. A search with a smaller limit
        is far cheaper, and a class has only one taut path."""
        max_length = (self._longest if longest is None else longest) + self.margin
        apart = math.dist(self.outline.points[a], self.outline.points[b])
        policy = self.policy.paths
        limit, step = min(policy.first_ratio * apart + self.margin, max_length), policy.first_ratio
        while True:
            yield limit
            if limit >= max_length:
                return
            step = min(step**2, policy.max_growth)
            limit = min(max(step * limit, policy.min_second_share * max_length), max_length)

    def tethers(
        self, goals: Sequence[int], words: Sequence[Word], longest: float, stop: Flag
    ) -> list[list[tuple[int, float]] | None]:
        """Return the pieces of the taut paths from the base to goals, found by one search.

        Paths are None if they are longer than `longest`, or not found before the flag is set.
        """
        trie, node = Trie.from_words(words, longest + self.margin)
        found = run_explore(
            self.tangents, 0, trie, keeps_tree=True, margin=self.outline.margin, stop=stop
        )
        # longest first, so that the shortest spelling of a path replaces the others
        shortest = {
            (int(found.goal[k]), int(found.word[k])): int(k)
            for k in np.argsort(-found.length, kind="stable").tolist()
        }
        hits = [shortest.get(key) for key in zip(goals, node, strict=True)]
        return [None if k is None else found.pieces(k) for k in hits]

    def _has_obstacles_of(self, word: Word) -> bool:
        """Return whether there is an obstacle for every letter."""
        return all(abs(letter) <= len(self.outline.rays) for letter in word)

    def _pull(self, a: int, b: int, word: Word) -> tuple[float, Ints, Floats]:
        """Pull the path of a word as `netsp.roadmap.taut_by_word.pull_one` does."""
        points = np.array([a, b])
        letters, row = flatten_words([(), word])
        places = self.outline.places[points]
        ends = Ends(places, self.slits.cells(places[:, 0]), letters, row)
        return pull_one(ends, points, self.slits, self.arcs)

    def _polyline(self, a: int, b: int, pieces: Sequence[tuple[int, float]]) -> Floats:
        """Return tangents and circumscribed arcs as one polyline, finer where a gap is narrow."""
        step = self.policy.paths.max_chord_turn
        for _ in range(12):
            xy = self._draw(a, b, pieces, step)
            if is_free(xy, self.outline.blockers):
                break
            step /= 2.0
        return xy

    def _draw(self, a: int, b: int, pieces: Sequence[tuple[int, float]], step: float) -> Floats:
        t = self.tangents
        out = [tuple(self.outline.points[a])]
        for k, (e, slid) in enumerate(pieces):
            if k > 0:
                before = pieces[k - 1][0]
                node = int(t.target[before])
                cx, cy, r = t.arcs[node // 2, :3]
                sense = 1.0 if node % 2 == 0 else -1.0
                # the first departure may lie a rounding before the arrival: then nothing is slid
                count = max(1, math.ceil(slid / step - 1e-9))
                if slid > 1e-7:
                    out.append(tuple(t.ends[before, 2:]))
                    half = slid / count / 2.0
                    radius = r / math.cos(half)
                    for i in range(count):
                        theta = t.angle[before, 1] + sense * half * (2 * i + 1)
                        out.append((cx + radius * math.cos(theta), cy + radius * math.sin(theta)))
                out.append(tuple(t.ends[e, :2]))
        out.append(tuple(self.outline.points[b]))
        xy = np.array(out)
        keep = np.concatenate([[True], np.any(np.diff(xy, axis=0) != 0.0, axis=1)])
        keep[-1] = True
        return np.asarray(xy[keep] if keep.sum() > 1 else xy[[0, -1]])


def _shortest_hit(
    found: FoundPaths, goal: int, word: int
) -> tuple[float, list[tuple[int, float]]] | None:
    """Return the length and the pieces of the shortest hit of a goal with the word of a trie's
    node; None if there is none."""
    wanted = np.flatnonzero((found.goal == goal) & (found.word == word))
    if not len(wanted):
        return None
    best = int(wanted[np.argmin(found.length[wanted])])
    return float(found.length[best]), found.pieces(best)


def _check_flag(stop: Flag, word: Word) -> None:
    """Raise LimitReachedError if the flag of a clock is set."""
    if stop[0]:
        raise LimitReachedError(f"time limit reached while pulling a leg of word {word}")
