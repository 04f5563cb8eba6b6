"""What goals say of each other: alternatives, of which one suffices, and which comes after which.

Goals of one choice are one cluster of the travel graph, whose tours take one vertex of each: the
theory (McCammon & Hollinger 2017, section IV) needs no more. Precedences make it a sequential
ordering problem (Escudero 1988) on that graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from netsp.base.arrays import Bools, Ints


class Goal(Protocol):
    """What is asked of goals here (`netsp.model.problem.Goal`)."""

    @property
    def name(self) -> str | None:
        """Of the goal."""

    @property
    def choice(self) -> str | None:
        """What it is an alternative for."""

    @property
    def after(self) -> tuple[str, ...]:
        """Names of what comes before it."""


UNORDERED: Bools = np.zeros((0, 0), dtype=bool)
"""Precedences where there are none."""


def clusters_of(goals: Sequence[Goal]) -> Ints:
    """Numbers the clusters of goals in the order of their first goals.

    Parameters
    ----------
    goals : sequence of Goal
        Of a problem.

    Returns
    -------
    ndarray of int, shape (m,)
        From 1; the same for goals of one choice.
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


def precedences_of(goals: Sequence[Goal]) -> Bools:
    """Which clusters come before which.

    Parameters
    ----------
    goals : sequence of Goal
        Of a problem; names that none of them has are passed over.

    Returns
    -------
    ndarray of bool, shape (c + 1, c + 1)
        True at (a, b) if cluster a must be visited before b, by way of others, too; shape (0, 0)
        where goals ask for nothing.
    """
    if not any(goal.after for goal in goals):
        return UNORDERED
    cluster = clusters_of(goals)
    named = _named(goals)
    direct = np.zeros((int(cluster.max()) + 1,) * 2, dtype=bool)
    for k, goal in enumerate(goals):
        for name in goal.after:
            direct[cluster[named.get(name, [])], cluster[k]] = True
    return closure(direct) if direct.any() else UNORDERED


def closure(direct: Bools) -> Bools:
    """The transitive closure of a relation (Warshall 1962).

    Parameters
    ----------
    direct : ndarray of bool, shape (n, n)
        The relation.

    Returns
    -------
    ndarray of bool, shape (n, n)
        True wherever a chain leads.
    """
    out = direct.copy()
    for k in range(len(out)):
        out |= out[:, k : k + 1] & out[k : k + 1, :]
    return out


def keeps(order: Sequence[int], before: Bools) -> bool:
    """Whether clusters are visited in an order that precedences allow.

    Parameters
    ----------
    order : sequence of int
        Clusters as they are visited.
    before : ndarray of bool
        As `precedences_of` gives them.

    Returns
    -------
    bool
        True if they are.
    """
    if not len(before):
        return True
    o = np.asarray(order, dtype=np.int64)
    later_first = before[np.ix_(o, o)]
    return not bool(np.tril(later_first).any())


def complaint_of(goals: Sequence[Goal]) -> str | None:
    """What is wrong with what goals say of each other, if anything.

    Parameters
    ----------
    goals : sequence of Goal
        Of a problem.

    Returns
    -------
    str or None
        In one line, naming the field.
    """
    named = _named(goals)
    cluster = clusters_of(goals)
    for k, goal in enumerate(goals):
        for j, name in enumerate(goal.after):
            field = f"goals[{k}].after[{j}]"
            if name not in named:
                return f"{field}: expected the name of another goal, got {name!r}"
            if (cluster[named[name]] == cluster[k]).any():
                return f"{field}: {name!r} is the goal itself; expected the name of another"
    before = precedences_of(goals)
    for k in range(len(goals) if len(before) else 0):
        c = int(cluster[k])
        if before[c, c]:
            label = goals[k].choice or goals[k].name or f"#{k}"
            ring = [
                g.choice or g.name or f"#{i}" for i, g in enumerate(goals)
                if before[c, cluster[i]] and before[cluster[i], c] and i != k
            ]  # fmt: skip
            others = ", ".join(dict.fromkeys(r for r in ring if r != label))
            return f"goals[{k}].after: {label} is to come before and after {others}"
    return None


def _named(goals: Sequence[Goal]) -> dict[str, list[int]]:
    """Goals by their names, and by those of their choices."""
    out: dict[str, list[int]] = {}
    for k, goal in enumerate(goals):
        for name in {goal.name, goal.choice} - {None}:
            out.setdefault(str(name), []).append(k)
    return out
