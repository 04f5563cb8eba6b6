"""Belief about the class of the tether if the position is known roughly only.

The estimate is off by a drift that changes slowly and is normal with a standard deviation. The
drift is put on a grid of offsets: a hypothesis is an offset and the word of the tether if the robot
is off by it. A step of the estimate moves all offsets alike, and each writes the letters of its own
step. The drift is a random walk between neighbouring offsets that forgets. An offset that puts the
robot into an obstacle becomes less likely by its depth, once for each stay. But for this rule, it
is the forward algorithm of a hidden Markov model (Rabiner 1989, section III.A) whose states are
places with words. With no obstacle near, one word at the estimate stands for all offsets
(Propositions G3 and G4 of docs/theory).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.hsignature import Word
from netsp.online.guard.guard_policy import BeliefPolicy
from netsp.world.world_protocol import Letters


@dataclass(frozen=True)
class Hypothesis:
    """Class that the tether may be in.

    Attributes
    ----------
    word
        Word of the tether.
    likely
        Share of the class, 0 to 1.
    offset
        Offset from the estimate to the likeliest position in this class, shape (2,), m.
    """

    word: Word
    likely: float
    offset: Floats


class Belief:
    """Belief about the classes that a tether may be in.

    Parameters
    ----------
    letters : Letters
        Letters of the site.
    drift : float
        Standard deviation of the error of the estimate in the plan, m: depth is measured.
    noise : float
        Standard deviation of its noise after smoothing, m.
    policy : BeliefPolicy
        Grid, random walk and limits.
    """

    def __init__(
        self, letters: Letters, drift: float, noise: float, policy: BeliefPolicy = BeliefPolicy()
    ) -> None:
        self.letters, self.policy = letters, policy
        self.drift = max(drift, 1e-6)
        self.reach = policy.grid_reach * self.drift
        spacing = self.reach / policy.n_rings
        self._noise_left = noise
        self.noise = math.hypot(max(noise, 1e-2), policy.placement_share * spacing)
        self.offsets, self._neighbours = _hexagonal_grid(policy.n_rings, spacing)
        prior = np.exp(-0.5 * (self.offsets**2).sum(1) / self.drift**2)
        self._prior = prior / prior.sum()
        # likelihood of each word with each offset. The word is that to the place of the offset if
        # `_is_spread`, otherwise to the estimate
        self._likely: dict[Word, Floats] = {(): self._prior.copy()}
        self._is_spread = False
        self._exchange_age_s = 0.0
        self._charged = np.zeros(len(self.offsets))
        # exchanges with six neighbours, each with this chance, spread as far as the drift does
        exchange_s, drift_time_s = policy.exchange_s, policy.drift_time_s
        chance = 2.0 * self.drift**2 * exchange_s / drift_time_s / (3.0 * spacing**2)
        a, b = self._neighbours.T
        self._forward = chance * np.minimum(1.0, self._prior[b] / self._prior[a])
        self._backward = chance * np.minimum(1.0, self._prior[a] / self._prior[b])
        stays = np.ones(len(self.offsets))
        np.subtract.at(stays, a, self._forward)
        np.subtract.at(stays, b, self._backward)
        self._stays = stays

    def begin(self, words: dict[Word, float]) -> None:
        """Restart with given classes of the tether to the estimate.

        Parameters
        ----------
        words : dict of Word to float
            Cost of each class: the negative logarithm of its likelihood.
        """
        min_cost = min(words.values())
        self._likely = {w: math.exp(min_cost - cost) * self._prior for w, cost in words.items()}
        self._is_spread = False
        self._trim()

    def with_drift(self, drift: float, place: Floats) -> Belief:
        """Return a belief in the same classes for another drift of the position.

        It starts with no knowledge of the offset.

        Parameters
        ----------
        drift : float
            Standard deviation of the error of the estimate from now on, m.
        place : ndarray, shape (2,) or (3,)
            Estimate, m.
        """
        other = Belief(self.letters, drift, self._noise_left, self.policy)
        self._gather(place)
        other.begin({h.word: -math.log(h.likely) for h in self.classes() if h.likely > 0.0})
        return other

    def drop(self, words: set[Word]) -> None:
        """Drop some classes, not all, for a reason other than the position of the robot."""
        self._likely = {w: p for w, p in self._likely.items() if w not in words}
        self._trim()

    @property
    def words(self) -> set[Word]:
        """Return all classes that are believed."""
        return set(self._likely)

    def move(self, before: Floats, after: Floats, dt: float) -> bool:
        """Move the estimate in a straight line.

        Parameters
        ----------
        before, after : ndarray, shape (2,) or (3,)
            Ends of the line, m.
        dt : float
            Time in between, s.

        Returns
        -------
        bool
            False if no robot can have moved so, whatever its offset: then nothing has
            changed.
        """
        known = self._likely, self._is_spread
        step = np.array([before, after])
        self._exchange_age_s += dt
        exchanges = self._exchange_age_s >= self.policy.exchange_s
        if exchanges:
            self._exchange_age_s = 0.0
        if not self.letters.is_near(step, self.reach) and self._gather(before):
            (letters,) = self.letters.words_of_steps(step[:1], step[1:])
            if letters is not None:
                if letters:
                    join = self.letters.join
                    self._likely = {join(w, letters): p for w, p in self._likely.items()}
                if exchanges:
                    self._exchange({(): np.arange(len(self._neighbours))})
                return True
        if not (self._scatter(before) and self._translate(before, after)):
            self._likely, self._is_spread = known
            return False
        self._charge_depths(after)
        if exchanges:
            places = self._places(after)
            a, b = places[self._neighbours[:, 0]], places[self._neighbours[:, 1]]
            free = np.flatnonzero(self.letters.depth(0.5 * (a + b)) <= 0.0)
            self._exchange(_numbers_by_word(self.letters.words_of_steps(a[free], b[free]), free))
        self._trim()
        return True

    def _places(self, place: Floats) -> Floats:
        """Return the position of the robot at each offset from a place, shape (k, d)."""
        out = np.repeat(place[None], len(self.offsets), axis=0)
        out[:, :2] += self.offsets
        return out

    def _scatter(self, place: Floats) -> bool:
        """Change words at the estimate to words at all offsets; return whether any are possible."""
        if self._is_spread:
            return True
        places = self._places(place)
        return self._append(
            self.letters.words_of_steps(np.broadcast_to(place, places.shape), places), spread=True
        )

    def _gather(self, place: Floats) -> bool:
        """Change words at the offsets to words at the estimate; return whether any are possible."""
        if not self._is_spread:
            return True
        self._charged[:] = 0.0
        places = self._places(place)
        inward = self.letters.words_of_steps(places, np.broadcast_to(place, places.shape))
        if not self._append(inward, spread=False):
            return False
        self._trim()
        return True

    def _translate(self, before: Floats, after: Floats) -> bool:
        """Move all offsets alike, with the letters of each step; return whether any can move."""
        steps = self.letters.words_of_steps(self._places(before), self._places(after))
        return self._append(steps, spread=True)

    def _append(self, steps: list[Word | None], *, spread: bool) -> bool:
        """Append the word of its step to those of each offset; return whether any are possible."""
        groups = _numbers_by_word(steps, range(len(steps)))
        out: dict[Word, Floats] = {}
        for word, likely in self._likely.items():
            for letters, offsets in groups.items():
                if likely[offsets].any():
                    joined = self.letters.join(word, letters)
                    out.setdefault(joined, np.zeros(len(self.offsets)))[offsets] += likely[offsets]
        if not out:
            return False
        self._likely, self._is_spread = out, spread
        return True

    def classes(self) -> list[Hypothesis]:
        """Return the classes, the likeliest first; their shares add up to 1."""
        shares = {w: float(p.sum()) for w, p in self._likely.items()}
        total = sum(shares.values())
        order = sorted(shares, key=lambda w: (-shares[w], len(w), w))
        # words are at the estimate until they are spread; the first offset is none
        best = {w: int(np.argmax(self._likely[w])) if self._is_spread else 0 for w in order}
        return [Hypothesis(w, shares[w] / total, self.offsets[best[w]]) for w in order]

    def _charge_depths(self, place: Floats) -> None:
        """Make offsets in obstacles less likely by their depth.

        Each is charged once while it is there: the noise that is left, and the drift, are
        the same
        from one moment to the next.
        """
        depth = self.letters.depth(self._places(place))
        price = 0.5 * (depth / self.noise) ** 2
        more = np.maximum(price - self._charged, 0.0)
        self._charged = np.where(depth > 0.0, np.maximum(self._charged, price), 0.0)
        if not more.any():
            return
        among = np.any([p > 0.0 for p in self._likely.values()], axis=0)
        less = np.exp(more[among].min() - more)
        self._likely = {w: less * p for w, p in self._likely.items()}

    def _exchange(self, groups: Mapping[Word, Iterable[int]]) -> None:
        """Let each offset pass some of its share to its neighbours, as the drift changes.

        More goes to the middle than away from it (Metropolis et al. 1953), so that the
        drift
        forgets. `groups` holds the pairs of neighbours by the word of the step from the
        first to
        the second; nothing passes between other pairs.
        """
        pairs = [np.array(list(numbers)) for numbers in groups.values()]
        passable = np.concatenate(pairs) if pairs else np.zeros(0, dtype=np.int64)
        stays = self._stays
        if len(passable) < len(self._neighbours):
            stays = np.ones(len(self.offsets))
            np.subtract.at(stays, self._neighbours[passable, 0], self._forward[passable])
            np.subtract.at(stays, self._neighbours[passable, 1], self._backward[passable])
        mixed = {w: stays * p for w, p in self._likely.items()}
        for word, likely in self._likely.items():
            for letters, numbers in zip(groups, pairs, strict=True):
                inverse = self.letters.inverse(letters)
                for step, (p, q), chance in (
                    (letters, self._neighbours[numbers].T, self._forward[numbers]),
                    (inverse, self._neighbours[numbers, ::-1].T, self._backward[numbers]),
                ):
                    moved = chance * likely[p]
                    if moved.any():
                        joined = self.letters.join(word, step)
                        into = mixed.setdefault(joined, np.zeros(len(self.offsets)))
                        np.add.at(into, q, moved)
        self._likely = mixed

    def _trim(self) -> None:
        """Drop unlikely classes, and normalize the shares."""
        shares = {w: float(p.sum()) for w, p in self._likely.items()}
        min_share = self.policy.min_odds * max(shares.values())
        order = sorted(shares, key=lambda w: (-shares[w], len(w), w))[: self.policy.max_classes]
        kept = [w for w in order if shares[w] >= min_share]
        total = sum(shares[w] for w in kept)
        self._likely = {w: self._likely[w] / total for w in kept}


def _numbers_by_word(steps: list[Word | None], numbers: Iterable[int]) -> dict[Word, list[int]]:
    """Return the numbers of possible steps, by their word."""
    out: dict[Word, list[int]] = {}
    for k, letters in zip(numbers, steps, strict=True):
        if letters is not None:
            out.setdefault(letters, []).append(k)
    return out


def _hexagonal_grid(rings: int, spacing: float) -> tuple[Floats, np.ndarray]:
    """Return a hexagonal grid about the origin, shape (k, 2), and its neighbouring pairs, shape (m,
    2), the
        lower number first.
    """
    points = np.array(
        [
            (spacing * (a + 0.5 * b), spacing * math.sqrt(0.75) * b)
            for a in range(-rings, rings + 1)
            for b in range(-rings, rings + 1)
            if abs(a + b) <= rings
        ]
    )
    order = np.argsort((points**2).sum(1), kind="stable")  # the middle first
    points = points[order]
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    a, b = np.nonzero(np.triu(apart < 1.01 * spacing, 1))
    return points, np.column_stack([a, b])
