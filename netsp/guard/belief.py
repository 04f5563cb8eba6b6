"""In which classes may the tether be, when the position is known only roughly?

The estimate is off by a drift that changes slowly and is normal with a standard deviation. It is
put on a grid of offsets: a hypothesis is an offset and the word of the tether if the robot has been
off by that. A step of the estimate moves all of them alike, and each writes the letters of the rays
that it crosses; an offset goes over to one beside it at the cost of a random walk, an offset that
puts the robot into an obstacle costs by its depth, and what is left for each offset and word is the
cheapest way there (Viterbi 1967, on the covering space in place of a line). Costs are negative
logarithms of likelihoods. With no obstacle near, all offsets of a word are one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.arrays import Floats
from netsp.hsignature import Word, concatenate, crossings
from netsp.problem import Problem

RINGS = 4
"""Of the grid of offsets: 61 of them."""

REACH = 2.5
"""Standard deviations of the drift that the grid reaches."""

DRIFT_S = 60.0
"""Seconds in which the drift forgets what it was."""

MIX_S = 2.0
"""Seconds between two exchanges of offsets."""

UNLIKELY = 4.5
"""Classes this much dearer than the best (three standard deviations) are given up."""

MOST_WORDS = 8
"""Classes that are kept at most."""


@dataclass(frozen=True)
class Hypothesis:
    """A class that the tether may be in.

    Parameters
    ----------
    word : Word
        Of the tether.
    likely : float
        Its share, from 0 to 1.
    offset : ndarray, shape (2,)
        Metres from the estimate to where the robot most likely is in this class.
    """

    word: Word
    likely: float
    offset: Floats


class Belief:
    """The classes that a tether may be in.

    Parameters
    ----------
    problem : Problem
        The site.
    drift : float
        Standard deviation of how far the estimate is off, metres.
    noise : float
        Standard deviation of what is left of its noise, metres.
    """

    def __init__(self, problem: Problem, drift: float, noise: float) -> None:
        self.problem, self.rays = problem, problem.representative_points
        self.drift, self.noise = max(drift, 1e-6), max(noise, 1e-2)
        self.reach = REACH * self.drift
        self.offsets, self._beside = _hexagonal(RINGS, self.reach / RINGS)
        self._prior = 0.5 * (self.offsets**2).sum(1) / self.drift**2
        self._solids = [o.shape(0.0) for o in problem.obstacles]
        boxes = np.array([s.bounds for s in self._solids]).reshape(-1, 4)
        self._low, self._high = boxes[:, :2], boxes[:, 2:]
        # word at the place of each offset, or, where no obstacle is near, at the estimate alone
        self._costs: dict[Word, Floats] = {(): np.zeros(1)}
        self._spread = False
        self._mixed = 0.0
        # from an offset to one beside it, in the time between two exchanges
        spacing = self.reach / RINGS
        self._change = spacing**2 / (4.0 * self.drift**2 / DRIFT_S * MIX_S)

    def begin(self, words: dict[Word, float]) -> None:
        """Begin anew with some classes.

        Parameters
        ----------
        words : dict of Word to float
            Of the tether to the place of the estimate, and their costs.
        """
        self._costs = {w: np.array([float(cost)]) for w, cost in words.items()}
        self._spread = False
        self._trim()

    @property
    def words(self) -> set[Word]:
        """Of all classes that are believed."""
        return set(self._costs)

    def near(self, points: Floats) -> bool:
        """Whether some offset of some places may be in an obstacle, or beyond one.

        Parameters
        ----------
        points : ndarray, shape (k, 2)
            Metres.

        Returns
        -------
        bool
            Whether it may.
        """
        if not len(self._low):
            return False
        low, high = points.min(0) - self.reach, points.max(0) + self.reach
        return bool(np.any(np.all((self._low <= high) & (self._high >= low), axis=1)))

    def move(self, before: Floats, after: Floats, dt: float) -> None:
        """The estimate has moved in a straight line.

        Parameters
        ----------
        before : ndarray, shape (2,)
            Metres.
        after : ndarray, shape (2,)
            Metres.
        dt : float
            Seconds.
        """
        step = np.array([before, after])
        if not self.near(step):
            self._gather(before)
            letters = crossings(step, self.rays)
            if letters:
                self._costs = {concatenate(w, letters): c for w, c in self._costs.items()}
            return
        self._scatter(before)
        self._translate(step)
        self._avoid(after, dt)
        self._mixed += dt
        if self._mixed >= MIX_S:
            self._mixed = 0.0
            self._mix(after)
        self._trim()

    def _scatter(self, place: Floats) -> None:
        """From words at the estimate to words at all offsets from it."""
        if self._spread:
            return
        groups: dict[Word, list[int]] = {}
        for k, offset in enumerate(self.offsets):
            letters = crossings(np.array([place, place + offset]), self.rays)
            groups.setdefault(letters, []).append(k)
        out: dict[Word, Floats] = {}
        for word, cost in self._costs.items():
            for letters, some in groups.items():
                into = out.setdefault(concatenate(word, letters), self._nowhere())
                into[some] = np.minimum(into[some], cost[0] + self._prior[some])
        self._costs, self._spread = out, True

    def _gather(self, place: Floats) -> None:
        """Back to words at the estimate, when no obstacle is near any more."""
        if not self._spread:
            return
        out: dict[Word, Floats] = {}
        for word, cost in self._costs.items():
            for k in np.flatnonzero(np.isfinite(cost)):
                back = crossings(np.array([place + self.offsets[k], place]), self.rays)
                to = concatenate(word, back)
                # a drift that is believed less is believed again later: only what an obstacle
                # has cost it stays
                own = np.array([cost[k]])
                out[to] = np.minimum(out.get(to, own), own)
        self._costs, self._spread = out, False
        self._trim()

    def _nowhere(self) -> Floats:
        return np.full(len(self.offsets), np.inf)

    def classes(self) -> list[Hypothesis]:
        """What is believed, the likeliest first.

        Returns
        -------
        list of Hypothesis
            Shares add up to 1.
        """
        best = {w: (int(np.argmin(c)), float(c.min())) for w, c in self._costs.items()}
        least = min(cost for _, cost in best.values())
        weights = {w: math.exp(least - cost) for w, (_, cost) in best.items()}
        total = sum(weights.values())
        order = sorted(best, key=lambda w: (best[w][1], len(w), w))
        return [Hypothesis(w, weights[w] / total, self.offsets[best[w][0]]) for w in order]

    def _translate(self, step: Floats) -> None:
        """All offsets moved alike: each with the letters that it writes on the way."""
        x = step[:, :1] + self.offsets[:, 0]  # (2, k)
        right = x[:, :, None] >= self.rays[None, None, :, 0]
        crossing = np.flatnonzero((right[0] != right[1]).any(axis=1))
        if not len(crossing):
            return
        letters = {int(k): crossings(step + self.offsets[k], self.rays) for k in crossing}
        moved: dict[Word, Floats] = {}
        for word, cost in self._costs.items():
            groups: dict[tuple[int, ...], list[int]] = {}
            for k, written in letters.items():
                groups.setdefault(written, []).append(k)
            still = np.ones(len(cost), dtype=bool)
            still[list(letters)] = False
            for written, some in [*groups.items(), ((), np.flatnonzero(still).tolist())]:
                if not some:
                    continue
                to = concatenate(word, written) if written else word
                into = moved.setdefault(to, self._nowhere())
                into[some] = np.minimum(into[some], cost[some])
        self._costs = moved

    def _avoid(self, place: Floats, dt: float) -> None:
        """Offsets in obstacles cost by their depth, once for every second there."""
        places = place + self.offsets
        depth = np.zeros(len(places))
        for i, o in enumerate(self.problem.obstacles):
            if np.any(self._low[i] - self.reach > place) or np.any(
                self._high[i] + self.reach < place
            ):
                continue
            depth = np.maximum(depth, -np.asarray(o.signed_distance(places)))
        if not depth.any():
            return
        price = 0.5 * (depth / self.noise) ** 2 * min(dt, 1.0)
        for cost in self._costs.values():
            cost += price

    def _mix(self, place: Floats) -> None:
        """The drift has changed a bit: each offset from those beside it, where that is cheaper."""
        pairs = self._beside
        ends = place + self.offsets[pairs]  # (m, 2, 2)
        right = ends[:, :, :1] >= self.rays[None, None, :, 0]
        crossing = (right[:, 0] != right[:, 1]).any(axis=1)
        written = {int(m): crossings(ends[m], self.rays) for m in np.flatnonzero(crossing)}
        free = self._passable(ends)
        mixed = {w: c.copy() for w, c in self._costs.items()}
        plain = np.array([not written.get(m) for m in range(len(pairs))]) & free
        for word, cost in self._costs.items():
            into = mixed[word]
            np.minimum.at(into, pairs[plain, 1], cost[pairs[plain, 0]] + self._change)
            np.minimum.at(into, pairs[plain, 0], cost[pairs[plain, 1]] + self._change)
            for m, letters in written.items():
                if not letters or not free[m]:
                    continue
                a, b = pairs[m]
                for p, q, way in ((a, b, letters), (b, a, tuple(-x for x in reversed(letters)))):
                    if not np.isfinite(cost[p]):
                        continue
                    to = mixed.setdefault(concatenate(word, way), self._nowhere())
                    to[q] = min(to[q], cost[p] + self._change)
        self._costs = mixed

    def _passable(self, ends: Floats) -> np.ndarray:
        """(m,) whether the middle between two offsets is in no obstacle."""
        middle = ends.mean(axis=1)
        free = np.ones(len(middle), dtype=bool)
        for o in self.problem.obstacles:
            free &= np.asarray(o.signed_distance(middle)) >= 0.0
        return free

    def _trim(self) -> None:
        least = min(float(c.min()) for c in self._costs.values())
        kept = {w: c - least for w, c in self._costs.items() if c.min() - least <= UNLIKELY}
        order = sorted(kept, key=lambda w: (float(kept[w].min()), len(w), w))[:MOST_WORDS]
        self._costs = {w: kept[w] for w in order}


def _hexagonal(rings: int, spacing: float) -> tuple[Floats, np.ndarray]:
    """(k, 2) a hexagonal grid about the origin, and (m, 2) the pairs that are next to each other,
    the lower number first."""
    points = np.array([
        (spacing * (a + 0.5 * b), spacing * math.sqrt(0.75) * b)
        for a in range(-rings, rings + 1)
        for b in range(-rings, rings + 1)
        if abs(a + b) <= rings
    ])  # fmt: skip
    order = np.argsort((points**2).sum(1), kind="stable")  # the middle first
    points = points[order]
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    a, b = np.nonzero(np.triu(apart < 1.01 * spacing, 1))
    return points, np.column_stack([a, b])
