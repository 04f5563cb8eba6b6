"""Sets of the ng-route relaxation (Baldacci, Mingozzi & Roberti 2011): memories of goals.

Each goal h has a set N(h) of goals that it remembers. A walk that goes from goal g to goal h keeps,
of the goals in its memory, only the goals in N(h), and adds h: M(h) = (M(g) ∩ N(h)) ∪ {h}. It must
not visit a goal in its memory. If every N holds all goals, the walks are tours; with small sets
there are few states and the bound is weaker. Where the best walk repeats a goal, the goals between
learn to remember it (Roberti & Mingozzi 2014, Martinelli, Pecin & Poggi 2014).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Ints
from netsp.model.arrangement import UNORDERED

Masks = npt.NDArray[np.int32]

BITS_PER_TABLE = 7
"""Format of memories: bits that one table translates."""

TABLES = 3
"""Format of memories: tables that translate a memory, whose parts are joined by "or"."""

MAX_REMEMBERED = TABLES * BITS_PER_TABLE
"""Format of memories: maximum number of goals that a goal remembers, itself among them."""


class Memory:
    """Goals that each goal remembers; bit k of a memory at goal g stands for the k-th goal of g.

    Parameters
    ----------
    near
        (n + 1, k) clusters nearest to each cluster, nearest first.
    size
        Number of nearest goals that are remembered at first, the goal itself (bit 0) among them.
    before
        (n + 1, n + 1) which goals come before which (`Instance.before`), (0, 0) for none: a walk
        that remembers a goal must not visit one that comes before it.
    """

    def __init__(self, near: Ints, size: int, before: Bools = UNORDERED) -> None:
        self.n = len(near) - 1
        self.before = before if len(before) else np.zeros((self.n + 1, self.n + 1), dtype=bool)
        self.sets: list[list[int]] = [[]]
        for g in range(1, self.n + 1):
            others = [int(h) for h in near[g] if h not in (0, g)]
            self.sets.append([g, *others[: size - 1]])
        self._tables: dict[bool, Masks] = {}

    @property
    def bits(self) -> Ints:
        """(n + 1,) number of goals that each remembers."""
        return np.array([1, *(len(s) for s in self.sets[1:])], dtype=np.int64)

    def tables(self, *, backwards: bool = False) -> Masks:
        """Return the tables that translate memories, (n + 1, n + 1, TABLES, 2^BITS_PER_TABLE).

        By goal g left, goal h entered and part of the memory at g, they hold that part of the
        memory at h; it is negative if h is remembered, or a goal that h must precede. For walks
        read backwards, precedences are reversed.
        """
        if backwards in self._tables:
            return self._tables[backwards]
        n = self.n
        before = self.before.T if backwards else self.before
        bit = np.full((n + 1, n + 1), -1)
        for g in range(1, n + 1):
            bit[g, self.sets[g]] = np.arange(len(self.sets[g]))
        tables = np.zeros((n + 1, n + 1, TABLES, 1 << BITS_PER_TABLE), dtype=np.int32)
        tables[:, :, 0] = 1
        chunk = np.arange(1 << BITS_PER_TABLE)
        for g in range(1, n + 1):
            for k, remembered in enumerate(self.sets[g]):
                part, place = divmod(k, BITS_PER_TABLE)
                held = (chunk >> place) & 1
                image = np.where(bit[:, remembered] >= 0, 1 << np.maximum(bit[:, remembered], 0), 0)
                tables[g, :, part] |= (image[:, None] * held[None, :]).astype(np.int32)
            for k, remembered in enumerate(self.sets[g]):
                part, place = divmod(k, BITS_PER_TABLE)
                held = (chunk >> place) & 1 == 1
                tables[g, remembered, part, held] = -1
                for earlier in np.flatnonzero(before[:, remembered]):
                    tables[g, earlier, part, held] = -1
        self._tables[backwards] = tables
        return tables

    def widen(self, goals: list[int]) -> bool:
        """Remember along the cycles of a walk, short ones first, and between goals in the wrong
        order, and return whether a memory changed."""
        last: dict[int, int] = {}
        cycles = []
        for k, g in enumerate(goals):
            if g in last:
                cycles.append((k - last[g], last[g], k))
            last[g] = k
            later = (i for h, i in last.items() if self.before[g, h])
            cycles += [(k - i, i, k) for i in later]
        changed = False
        for _, first, again in sorted(cycles):
            g = goals[first]
            forgetful = [h for h in set(goals[first + 1 : again]) if g not in self.sets[h]]
            if all(len(self.sets[h]) < MAX_REMEMBERED for h in forgetful):
                for h in forgetful:
                    self.sets[h].append(g)
                    changed = True
        if changed:
            self._tables = {}
        return changed
