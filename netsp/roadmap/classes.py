"""Classes that reach each goal: all whose taut tether fits, or the shortest if there are too many.

One search from the base, up to the tether length, finds all classes. With thin obstacles or a long
tether their number may explode. Then there is a search for each goal, guided by the exact shortest
remaining length, and its length limit is adapted until it yields the wanted number of classes. They
are the shortest classes of the goal: none that is left out has a shorter tether.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.hsignature import Word, is_looping, signature
from netsp.roadmap.explain_unreachable import find_unreached_error
from netsp.roadmap.explore import NON_LOOPING, FoundPaths, run_explore
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.trie import Trie


@dataclass(frozen=True)
class Classes:
    """Augmented goals, base first.

    Attributes
    ----------
    cluster, signatures, planar
        (V,) goal, word and planar tether length of each.
    min_tether_left_out
        Lower bound on the 3D tether of every class left out; inf if none is.
    """

    cluster: Ints
    signatures: list[Word]
    planar: Floats
    min_tether_left_out: float = math.inf

    @property
    def complete(self) -> bool:
        """Return whether no class was left out."""
        return self.min_tether_left_out == math.inf


def find_classes(paths: TautPaths, rule: int, max_classes: int, clock: Clock) -> Classes:
    """Return the classes of every goal: about `max_classes` in all, fewer when the time is up.

    Raises InfeasibleError for a goal that no tether within the limit reaches.
    """
    search = _Search(paths, rule, max_classes, clock)
    search.load_kernel()
    search.clock = Clock(search.policy.max_time_share * clock.left, within=clock)
    found = search.find_all()
    if found is not None:
        return found
    search.clock = Clock(search.policy.max_time_share * clock.left, within=clock)
    return search.find_shortest()


class _Search:
    def __init__(self, paths: TautPaths, rule: int, max_classes: int, clock: Clock) -> None:
        self.paths, self.rule, self.max_classes, self.clock = paths, rule, max_classes, clock
        self.whole = clock
        self.policy = paths.policy.classes
        self.problem = paths.problem
        points = self.problem.points
        self.goals = len(points) - 1
        self.dz = np.abs(points[:, 2] - points[0, 2])
        self.limit = self.problem.tether_length + paths.margin
        # a hypotenuse within the limit, and a rounding more
        self.within = np.sqrt(np.maximum(self.limit**2 - self.dz**2, 0.0)) * (1.0 + 1e-15)
        self.within[0] = -1.0

    def load_kernel(self) -> None:
        """Load or compile the kernel before the time of a search starts to count."""
        run_explore(
            self.paths.tangents, 0, Trie.root(0.0), margin=self.paths.outline.margin, max_states=0
        )

    def find_all(self) -> Classes | None:
        """Return all classes; None if there are too many, or the time is too short."""
        trie = Trie.root(self.limit)
        found = self.clock.interruptible(
            lambda: run_explore(
                self.paths.tangents,
                0,
                trie,
                margin=self.paths.outline.margin,
                rule=self.rule,
                max_states=max(1_000_000, self.policy.states_per_class * self.max_classes),
                max_lengths=self.within,
                max_hits=4 * self.max_classes + 1000,
                stop=self.clock.flag,
            )
        )
        best = self._shortest_by_class(found)
        if found.capped or len(best) > self.max_classes:
            return None
        missing = sorted(set(range(1, self.goals + 1)) - {g for g, _ in best})
        if missing:
            raise find_unreached_error(
                self.problem, self.paths.outline, missing, self.whole, self.paths.policy
            )
        rows = sorted((g, length, trie.word(w)) for (g, w), length in best.items())
        return _collect(rows, math.inf)

    def find_shortest(self) -> Classes:
        """Return the shortest classes of each goal, about equally many for each.

        Each goal has at least one, even if the time is up.
        """
        share = max(1, self.max_classes // self.goals)
        contacts = self.paths.contacts
        planar, before = contacts.tree(0)
        missing = [g for g in range(1, self.goals + 1) if planar[g] > self.within[g]]
        if missing:
            raise find_unreached_error(
                self.problem, self.paths.outline, missing, self.whole, self.paths.policy
            )
        rays = self.problem.representative_points - self.paths.outline.origin
        rows: list[tuple[int, float, Word]] = []
        left_out = math.inf
        for g in range(1, self.goals + 1):
            word = signature(contacts.draw(0, g, before), rays)
            nearest = (float(planar[g]), word)
            classes, beyond = [nearest], nearest[0]
            if not (self.clock.is_up or (self.rule == NON_LOOPING and is_looping(nearest[1]))):
                classes, beyond = self._shortest_of_goal(g, share)
                classes = classes or [nearest]
            rows += [(g, length, word) for length, word in classes]
            left_out = min(left_out, math.hypot(beyond, self.dz[g]))
        return _collect(rows, left_out)

    def _shortest_of_goal(self, g: int, share: int) -> tuple[list[tuple[float, Word]], float]:
        """Return the shortest classes of one goal, in order, and the planar length up to which none
        is missing (inf if all within the tether were found)."""
        rest = self.paths.contacts.remaining_lengths(g)
        min_length, max_length = float(rest.source), float(self.within[g])
        known: list[tuple[float, Word]] = []
        known_to = min_length
        low, high = 0.0, math.inf  # excess lengths that gave too few and too many classes
        excess = self.policy.first_excess * max(max_length - min_length, 0.0)
        for _ in range(self.policy.max_searches):
            reach = min(min_length + excess + self.paths.margin, max_length)
            found, words = self._classes_up_to(g, rest.to_end, reach, share)
            if found is None:
                high = excess
                if self.clock.is_up:
                    break
                excess = max(low + (high - low) / self.policy.shrink, 0.0)
                continue
            known, known_to = words, reach
            if reach >= max_length:
                known_to = math.inf
                break
            if len(words) >= share or self.clock.is_up:
                break
            low = excess
            excess = max(self.policy.growth * excess, 1e-6 * max_length)
            if excess >= high:
                excess = low + 0.5 * (high - low)
        if len(known) > share:
            known_to = min(known_to, known[share][0])
            known = known[:share]
        return known, known_to

    def _classes_up_to(
        self, g: int, rest: Floats, reach: float, share: int
    ) -> tuple[FoundPaths | None, list[tuple[float, Word]]]:
        """Return the classes of a goal up to a planar length; None if there are too many."""
        trie = Trie.root(reach)
        within = np.full(self.goals + 1, -1.0)
        within[g] = reach
        found = self.clock.interruptible(
            lambda: run_explore(
                self.paths.tangents,
                0,
                trie,
                margin=self.paths.outline.margin,
                rule=self.rule,
                max_states=max(20_000, self.policy.states_per_class * share),
                target=(g, rest),
                max_lengths=within,
                max_hits=8 * share + 64,
                stop=self.clock.flag,
            )
        )
        if found.capped:
            return None, []
        nearest = sorted((length, w) for (_, w), length in self._shortest_by_class(found).items())
        # one class more than are kept: its length is the bound on classes left out
        rows = [(length, trie.word(w)) for length, w in nearest[: share + 1]]
        return found, sorted(rows)

    def _shortest_by_class(self, found: FoundPaths) -> dict[tuple[int, int], float]:
        """Return the shortest length by (goal, word) among the hits within the tether."""
        reach = np.hypot(found.length, self.dz[found.goal])
        rows = np.flatnonzero((found.goal > 0) & (reach <= self.limit))
        best: dict[tuple[int, int], float] = {}
        for goal, word, length in zip(
            found.goal[rows].tolist(),
            found.word[rows].tolist(),
            found.length[rows].tolist(),
            strict=True,
        ):
            best[goal, word] = min(best.get((goal, word), math.inf), length)
        return best


def _collect(rows: list[tuple[int, float, Word]], left_out: float) -> Classes:
    return Classes(
        np.array([0, *(g for g, _, _ in rows)], dtype=np.int64),
        [(), *(word for _, _, word in rows)],
        np.array([0.0, *(length for _, length, _ in rows)]),
        left_out,
    )
