"""Relations between goals: choices, of whose goals a tour visits one, and precedences.

The goals of one choice are one cluster of the travel graph, whose tours visit one vertex of each
cluster (McCammon & Hollinger 2017, section IV). With precedences, the problem is a sequential
ordering problem (Escudero 1988) on that graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from netsp.base.arrays import Bools, Ints
from netsp.base.validated import shown_names


class Goal(Protocol):
    """Protocol of a goal: the fields that define its relations (`netsp.model.problem.Goal`)."""

    @property
    def name(self) -> str | None:
        """Name of the goal."""

    @property
    def choice(self) -> str | None:
        """Name of the choice that the goal belongs to."""

    @property
    def after(self) -> tuple[str, ...]:
        """Names of goals or choices that must be visited before the goal."""


UNORDERED: Bools = np.zeros((0, 0), dtype=bool)
"""Precedence matrix of goals without precedences."""


def cluster_numbers(goals: Sequence[Goal]) -> Ints:
    """Return the cluster (m,) of each goal, numbered from 1 in order of first appearance.

    Goals of one choice share a cluster.
    """
    known: dict[str, int] = {}
    out, last = [], 0
    for goal in goals:
        number = known.get(goal.choice, 0) if goal.choice is not None else 0
        if not number:
            last += 1
            number = last
            if goal.choice is not None:
                known[goal.choice] = number
        out.append(number)
    return np.array(out, dtype=np.int64)


def precedence_matrix(goals: Sequence[Goal]) -> Bools:
    """Return the matrix of precedences between clusters, transitively closed.

    Names that no goal has are ignored.

    Returns
    -------
    ndarray of bool, shape (c + 1, c + 1)
        True at (a, b) if cluster a must be visited before b; shape (0, 0) without precedences.
    """
    if not any(goal.after for goal in goals):
        return UNORDERED
    cluster = cluster_numbers(goals)
    named = _named(goals)
    direct = np.zeros((int(cluster.max()) + 1,) * 2, dtype=bool)
    for k, goal in enumerate(goals):
        for name in goal.after:
            direct[cluster[named.get(name, [])], cluster[k]] = True
    return transitive_closure(direct) if direct.any() else UNORDERED


def transitive_closure(direct: Bools) -> Bools:
    """Return the transitive closure (n, n) of a relation (Warshall 1962)."""
    out = direct.copy()
    for k in range(len(out)):
        out |= out[:, k : k + 1] & out[k : k + 1, :]
    return out


def respects_precedences(order: Sequence[int], before: Bools) -> bool:
    """Return whether an order of clusters keeps all precedences."""
    if not len(before):
        return True
    o = np.asarray(order, dtype=np.int64)
    later_first = before[np.ix_(o, o)]
    return not bool(np.tril(later_first).any())


def arrangement_complaint(goals: Sequence[Goal]) -> str | None:
    """Return the first fault in the relations between goals in one line, or None."""
    named = _named(goals)
    cluster = cluster_numbers(goals)
    for k, goal in enumerate(goals):
        for j, name in enumerate(goal.after):
            field = f"goals[{k}].after[{j}]"
            if name not in named:
                others = shown_names(n for n in named if n not in (goal.name, goal.choice))
                return (
                    f"{field}: expected the name of another goal, got {name!r}; there are {others}"
                )
            if (cluster[named[name]] == cluster[k]).any():
                return f"{field}: {name!r} is the goal itself; expected the name of another"
    before = precedence_matrix(goals)
    for k in range(len(goals) if len(before) else 0):
        c = int(cluster[k])
        if before[c, c]:
            label = goals[k].choice or goals[k].name or f"#{k}"
            ring = [
                g.choice or g.name or f"#{i}"
                for i, g in enumerate(goals)
                if before[c, cluster[i]] and before[cluster[i], c] and i != k
            ]
            others = ", ".join(dict.fromkeys(r for r in ring if r != label))
            return f"goals[{k}].after: {label} is to come before and after {others}"
    return None


def _named(goals: Sequence[Goal]) -> dict[str, list[int]]:
    """Return the indices of goals by goal name and by choice name."""
    out: dict[str, list[int]] = {}
    for k, goal in enumerate(goals):
        for name in {goal.name, goal.choice} - {None}:
            out.setdefault(str(name), []).append(k)
    return out
