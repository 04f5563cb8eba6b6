"""In which classes may the tether be, when the position is known only roughly?

The estimate is off by a drift that changes slowly and is normal with a standard deviation. It is
put on a grid of offsets: a hypothesis is an offset and the word of the tether if the robot has been
off by that. A step of the estimate moves all of them alike, and each writes the letters of its
way; an offset goes over to one beside it at the cost of a random walk, an offset that
puts the robot into an obstacle costs by its depth, and what is left for each offset and word is the
cheapest way there (Viterbi 1967, on the covering space in place of a line). Costs are negative
logarithms of likelihoods. With no obstacle near, all offsets of a word are one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.arrays import Floats
from netsp.guard.site import Letters
from netsp.hsignature import Word

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
    letters : Letters
        Of the site.
    drift : float
        Standard deviation of how far the estimate is off in the plan, metres: depth is measured.
    noise : float
        Standard deviation of what is left of its noise, metres.
    """

    def __init__(self, letters: Letters, drift: float, noise: float) -> None:
        self.letters = letters
        self.drift, self.noise = max(drift, 1e-6), max(noise, 1e-2)
        self.reach = REACH * self.drift
        self.offsets, self._beside = _hexagonal(RINGS, self.reach / RINGS)
        self._prior = 0.5 * (self.offsets**2).sum(1) / self.drift**2
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

    def move(self, before: Floats, after: Floats, dt: float) -> bool:
        """The estimate has moved in a straight line.

        Parameters
        ----------
        before : ndarray, shape (2,) or (3,)
            Metres.
        after : ndarray, shape (2,) or (3,)
            Metres.
        dt : float
            Seconds.

        Returns
        -------
        bool
            False where no robot can have gone so, wherever it is: then nothing has changed.
        """
        known = dict(self._costs), self._spread
        step = np.array([before, after])
        if not self.letters.near(step, self.reach) and self._gather(before):
            (letters,) = self.letters.written(step[:1], step[1:])
            if letters is not None:
                if letters:
                    join = self.letters.join
                    self._costs = {join(w, letters): c for w, c in self._costs.items()}
                return True
        if not (self._scatter(before) and self._translate(before, after)):
            self._costs, self._spread = known
            return False
        self._avoid(after, dt)
        self._mixed += dt
        if self._mixed >= MIX_S:
            self._mixed = 0.0
            self._mix(after)
        self._trim()
        return True

    def _at(self, place: Floats) -> Floats:
        """(k, d) where the robot is at each offset from a place."""
        out = np.repeat(place[None], len(self.offsets), axis=0)
        out[:, :2] += self.offsets
        return out

    def _scatter(self, place: Floats) -> bool:
        """From words at the estimate to words at all offsets from it; whether there are any."""
        if self._spread:
            return True
        there = self._at(place)
        groups = _groups(self.letters.written(np.broadcast_to(place, there.shape), there))
        out: dict[Word, Floats] = {}
        for word, cost in self._costs.items():
            for letters, some in groups.items():
                into = out.setdefault(self.letters.join(word, letters), self._nowhere())
                into[some] = np.minimum(into[some], cost[0] + self._prior[some])
        self._costs, self._spread = out, True
        return bool(out)

    def _gather(self, place: Floats) -> bool:
        """Back to words at the estimate, when no obstacle is near any more; whether there are
        any."""
        if not self._spread:
            return True
        there = self._at(place)
        back = self.letters.written(there, np.broadcast_to(place, there.shape))
        out: dict[Word, Floats] = {}
        for word, cost in self._costs.items():
            for k in np.flatnonzero(np.isfinite(cost)):
                letters = back[int(k)]
                if letters is None:
                    continue
                to = self.letters.join(word, letters)
                # a drift that is believed less is believed again later: only what an obstacle
                # has cost it stays
                own = np.array([cost[k]])
                out[to] = np.minimum(out.get(to, own), own)
        if not out:
            return False
        self._costs, self._spread = out, False
        self._trim()
        return True

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

    def _translate(self, before: Floats, after: Floats) -> bool:
        """All offsets moved alike: each with the letters that it writes on the way. Whether any
        can have gone so."""
        groups = _groups(self.letters.written(self._at(before), self._at(after)))
        moved: dict[Word, Floats] = {}
        for word, cost in self._costs.items():
            for letters, some in groups.items():
                if not np.isfinite(cost[some]).any():
                    continue
                to = self.letters.join(word, letters)
                into = moved.setdefault(to, self._nowhere())
                into[some] = np.minimum(into[some], cost[some])
        self._costs = moved or self._costs
        return bool(moved)

    def _avoid(self, place: Floats, dt: float) -> None:
        """Offsets in obstacles cost by their depth, once for every second there."""
        depth = self.letters.depth(self._at(place))
        if not depth.any():
            return
        price = 0.5 * (depth / self.noise) ** 2 * min(dt, 1.0)
        for cost in self._costs.values():
            cost += price

    def _mix(self, place: Floats) -> None:
        """The drift has changed a bit: each offset from those beside it, where that is cheaper."""
        pairs = self._beside
        there = self._at(place)
        a, b = there[pairs[:, 0]], there[pairs[:, 1]]
        free = self.letters.depth(0.5 * (a + b)) <= 0.0
        groups = _groups(self.letters.written(a, b), free)
        mixed = {w: c.copy() for w, c in self._costs.items()}
        for word, cost in self._costs.items():
            for letters, some in groups.items():
                for way, p, q in (
                    (letters, pairs[some, 0], pairs[some, 1]),
                    (self.letters.back(letters), pairs[some, 1], pairs[some, 0]),
                ):
                    cheap = cost[p] + self._change
                    if np.isfinite(cheap).any():
                        to = self.letters.join(word, way)
                        np.minimum.at(mixed.setdefault(to, self._nowhere()), q, cheap)
        self._costs = mixed

    def _trim(self) -> None:
        least = min(float(c.min()) for c in self._costs.values())
        kept = {w: c - least for w, c in self._costs.items() if c.min() - least <= UNLIKELY}
        order = sorted(kept, key=lambda w: (float(kept[w].min()), len(w), w))[:MOST_WORDS]
        self._costs = {w: kept[w] for w in order}


def _groups(written: list[Word | None], free: np.ndarray | None = None) -> dict[Word, list[int]]:
    """Numbers of steps by what they write, less those that nothing can have gone."""
    out: dict[Word, list[int]] = {}
    for k, letters in enumerate(written):
        if letters is not None and (free is None or free[k]):
            out.setdefault(letters, []).append(k)
    return out


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
