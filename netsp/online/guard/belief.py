"""In which classes may the tether be, when the position is known only roughly?

The estimate is off by a drift that changes slowly and is normal with a standard deviation. It is
put on a grid of offsets: a hypothesis is an offset and the word of the tether if the robot has been
off by that. A step of the estimate moves all of them alike, and each writes the letters of its
way; an offset goes over to one beside it as a random walk does that forgets, and what puts the
robot into an obstacle becomes less likely by its depth. So this is the forward algorithm of a
hidden Markov model (Rabiner 1989, section III.A) whose states are places of the covering space.
With no obstacle near, all offsets of a word write alike, and one word stands for them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.hsignature import Word
from netsp.online.guard.site import Letters

RINGS = 4
"""Of the grid of offsets: 61 of them."""

REACH, GRID = 3.2, 0.4
"""Standard deviations of the drift that the grid reaches (in the plan, 0.6 % are beyond), and share
of its spacing that a place is off."""

DRIFT_S = 60.0
"""Seconds in which the drift forgets what it was."""

MIX_S = 2.0
"""Seconds between two exchanges of offsets."""

UNLIKELY = 1e-3
"""Classes that much less likely than the likeliest are given up."""

MOST_WORDS = 16
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
        self.drift = max(drift, 1e-6)
        self.reach = REACH * self.drift
        spacing = self.reach / RINGS
        self._noise_left = noise
        self.noise = math.hypot(max(noise, 1e-2), GRID * spacing)
        self.offsets, self._beside = _hexagonal(RINGS, spacing)
        prior = np.exp(-0.5 * (self.offsets**2).sum(1) / self.drift**2)
        self._prior = prior / prior.sum()
        # of each word, how likely it is with each offset. The word is that to the place of the
        # offset (spread), or to the estimate
        self._likely: dict[Word, Floats] = {(): self._prior.copy()}
        self._spread = False
        self._mixed = 0.0
        self._charged = np.zeros(len(self.offsets))
        # six neighbours, each with this chance, spread as far as the drift does meanwhile
        chance = 2.0 * self.drift**2 * MIX_S / DRIFT_S / (3.0 * spacing**2)
        a, b = self._beside.T
        self._to = chance * np.minimum(1.0, self._prior[b] / self._prior[a])
        self._back = chance * np.minimum(1.0, self._prior[a] / self._prior[b])
        stays = np.ones(len(self.offsets))
        np.subtract.at(stays, a, self._to)
        np.subtract.at(stays, b, self._back)
        self._stays = stays

    def begin(self, words: dict[Word, float]) -> None:
        """Begin anew with some classes.

        Parameters
        ----------
        words : dict of Word to float
            Of the tether to the place of the estimate, and their costs: negative logarithms of how
            likely they are.
        """
        least = min(words.values())
        self._likely = {w: math.exp(least - cost) * self._prior for w, cost in words.items()}
        self._spread = False
        self._trim()

    def with_drift(self, drift: float, place: Floats) -> Belief:
        """Return a belief in the same classes for another drift of the position.

        Parameters
        ----------
        drift : float
            Standard deviation of the error of the estimate from now on, metres.
        place : ndarray, shape (2,) or (3,)
            The estimate, metres.

        Returns
        -------
        Belief
            New belief, without what was known of the offset.
        """
        other = Belief(self.letters, drift, self._noise_left)
        self._gather(place)
        other.begin({h.word: -math.log(h.likely) for h in self.classes() if h.likely > 0.0})
        return other

    def drop(self, words: set[Word]) -> None:
        """Some classes are none, for another reason than where the robot is.

        Parameters
        ----------
        words : set of Word
            As of `classes`; not all of them.
        """
        self._likely = {w: p for w, p in self._likely.items() if w not in words}
        self._trim()

    @property
    def words(self) -> set[Word]:
        """Of all classes that are believed."""
        return set(self._likely)

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
        known = self._likely, self._spread
        step = np.array([before, after])
        self._mixed += dt
        mixes = self._mixed >= MIX_S
        if mixes:
            self._mixed = 0.0
        if not self.letters.near(step, self.reach) and self._gather(before):
            (letters,) = self.letters.written(step[:1], step[1:])
            if letters is not None:
                if letters:
                    join = self.letters.join
                    self._likely = {join(w, letters): p for w, p in self._likely.items()}
                if mixes:
                    self._mix({(): np.arange(len(self._beside))})
                return True
        if not (self._scatter(before) and self._translate(before, after)):
            self._likely, self._spread = known
            return False
        self._avoid(after)
        if mixes:
            there = self._at(after)
            a, b = there[self._beside[:, 0]], there[self._beside[:, 1]]
            free = np.flatnonzero(self.letters.depth(0.5 * (a + b)) <= 0.0)
            self._mix(_groups(self.letters.written(a[free], b[free]), free))
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
        return self._rewritten(
            self.letters.written(np.broadcast_to(place, there.shape), there), spread=True
        )

    def _gather(self, place: Floats) -> bool:
        """Back to words at the estimate, when no obstacle is near any more; whether there are
        any."""
        if not self._spread:
            return True
        self._charged[:] = 0.0
        there = self._at(place)
        back = self.letters.written(there, np.broadcast_to(place, there.shape))
        if not self._rewritten(back, spread=False):
            return False
        self._trim()
        return True

    def _translate(self, before: Floats, after: Floats) -> bool:
        """All offsets moved alike: each with the letters that it writes on the way. Whether any
        can have gone so."""
        return self._rewritten(self.letters.written(self._at(before), self._at(after)), spread=True)

    def _rewritten(self, written: list[Word | None], *, spread: bool) -> bool:
        """The same offsets, each with letters more; whether any can have written them."""
        groups = _groups(written, range(len(written)))
        out: dict[Word, Floats] = {}
        for word, likely in self._likely.items():
            for letters, some in groups.items():
                if likely[some].any():
                    to = self.letters.join(word, letters)
                    out.setdefault(to, np.zeros(len(self.offsets)))[some] += likely[some]
        if not out:
            return False
        self._likely, self._spread = out, spread
        return True

    def classes(self) -> list[Hypothesis]:
        """What is believed, the likeliest first.

        Returns
        -------
        list of Hypothesis
            Shares add up to 1.
        """
        shares = {w: float(p.sum()) for w, p in self._likely.items()}
        total = sum(shares.values())
        order = sorted(shares, key=lambda w: (-shares[w], len(w), w))
        # words are at the estimate until they are spread; the first offset is none
        best = {w: int(np.argmax(self._likely[w])) if self._spread else 0 for w in order}
        return [Hypothesis(w, shares[w] / total, self.offsets[best[w]]) for w in order]

    def _avoid(self, place: Floats) -> None:
        """Offsets in obstacles are less likely by their depth, once for each time that they are
        there: what is left of the noise, and the drift, are the same from one moment to the
        next."""
        depth = self.letters.depth(self._at(place))
        price = 0.5 * (depth / self.noise) ** 2
        more = np.maximum(price - self._charged, 0.0)
        self._charged = np.where(depth > 0.0, np.maximum(self._charged, price), 0.0)
        if not more.any():
            return
        among = np.any([p > 0.0 for p in self._likely.values()], axis=0)
        less = np.exp(more[among].min() - more)
        self._likely = {w: less * p for w, p in self._likely.items()}

    def _mix(self, groups: Mapping[Word, Iterable[int]]) -> None:
        """The drift has changed a bit: each offset gives some of its share to those beside it, and
        to the middle more than away from it (Metropolis et al. 1953), so that it forgets. Pairs
        are given by what the way from the first to the second writes; across what is in none of
        them nothing goes."""
        goes = [np.array(list(some)) for some in groups.values()]
        through = np.concatenate(goes) if goes else np.zeros(0, dtype=np.int64)
        stays = self._stays
        if len(through) < len(self._beside):
            stays = np.ones(len(self.offsets))
            np.subtract.at(stays, self._beside[through, 0], self._to[through])
            np.subtract.at(stays, self._beside[through, 1], self._back[through])
        mixed = {w: stays * p for w, p in self._likely.items()}
        for word, likely in self._likely.items():
            for letters, some in zip(groups, goes, strict=True):
                for way, (p, q), chance in (
                    (letters, self._beside[some].T, self._to[some]),
                    (self.letters.back(letters), self._beside[some, ::-1].T, self._back[some]),
                ):
                    gone = chance * likely[p]
                    if gone.any():
                        to = self.letters.join(word, way)
                        into = mixed.setdefault(to, np.zeros(len(self.offsets)))
                        np.add.at(into, q, gone)
        self._likely = mixed

    def _trim(self) -> None:
        shares = {w: float(p.sum()) for w, p in self._likely.items()}
        most = max(shares.values())
        order = sorted(shares, key=lambda w: (-shares[w], len(w), w))[:MOST_WORDS]
        kept = [w for w in order if shares[w] >= UNLIKELY * most]
        total = sum(shares[w] for w in kept)
        self._likely = {w: self._likely[w] / total for w in kept}


def _groups(written: list[Word | None], numbers: Iterable[int]) -> dict[Word, list[int]]:
    """Numbers of steps by what they write, less those that nothing can have gone."""
    out: dict[Word, list[int]] = {}
    for k, letters in zip(numbers, written, strict=True):
        if letters is not None:
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
