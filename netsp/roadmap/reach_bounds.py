"""Shortest paths between goals by parity: by the rays that they cross an odd number of times.

A search from every goal (`netsp.roadmap.explore`) finds all taut paths up to a length. Of the paths
with one parity only the shortest is kept. Thousands of classes have few parities, because going
round an obstacle twice counts as not going round it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.gtsp.travel.parity_distances import BITS_PER_ENTRY, ParityDistances
from netsp.roadmap.explore import ALL, run_explore
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.trie import LETTER, PARENT, Trie

ParityRows = tuple[Ints, Floats, npt.NDArray[np.uint64]]
"""Paths from a goal: other goals (k,), planar lengths (k,), and parity bits (k, w)."""


def find_parity_paths(paths: TautPaths, up: Callable[[], bool]) -> ParityDistances | None:
    """Return paths between goals, up to a length at which there are not too many, and all paths
    from the base up to the tether length; None if the time is up first."""
    points, tether = paths.outline.points, paths.problem.tether_length
    apart = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    nearest = float(apart.min(axis=1).max(initial=0.0))
    policy = paths.policy.parity
    reach, best = max(policy.first_ratio * nearest, policy.min_tether_share * tether), None
    if up():
        return None
    from_base = _paths_from(paths, 0, tether + paths.margin)
    while from_base is not None and reach < policy.growth * tether:
        found = _paths_up_to(paths, min(reach, tether), from_base[0], best is None, up)
        if found is None:
            break
        best, reach = found, reach * policy.growth
    return best


def _paths_up_to(
    paths: TautPaths, reach: float, from_base: ParityRows, first: bool, up: Callable[[], bool]
) -> ParityDistances | None:
    """Return all paths up to a planar length; None if the time is up, or if they are too many and
    not the first."""
    each, count = [from_base], 0
    for a in range(1, len(paths.outline.points) - 1):
        found = None if up() else _paths_from(paths, a, reach)
        if found is None:
            return None
        each.append(found[0])
        count += found[1]
        if count > paths.policy.parity.max_paths and not first:
            return None
    ends: Ints = np.vstack(
        [np.column_stack([np.full(len(goal), a), goal]) for a, (goal, _, _) in enumerate(each)]
    )
    z = paths.problem.points[:, 2]
    planar: Floats = np.concatenate([length for _, length, _ in each])
    in_space = np.hypot(planar, z[ends[:, 1]] - z[ends[:, 0]])
    odd = np.vstack([bits for _, _, bits in each])
    return ParityDistances(ends, odd, in_space, reach, len(paths.outline.rays))


def _paths_from(paths: TautPaths, a: int, reach: float) -> tuple[ParityRows, int] | None:
    """Return the paths from a goal to those of higher numbers, and the number of taut paths; None
    if there are too many."""
    words = max(1, -(-len(paths.outline.rays) // BITS_PER_ENTRY))
    trie = Trie.root(reach)
    found = run_explore(
        paths.tangents,
        a,
        trie,
        margin=paths.outline.margin,
        rule=ALL,
        max_states=paths.policy.parity.max_states,
    )
    if found.capped:
        return None
    later = found.goal > a
    goal, planar = found.goal[later], found.length[later]
    bits = _odd_letters(trie.nodes, trie.size, words)[found.word[later]]
    order = np.lexsort((planar, *bits.T, goal))
    goal, planar, bits = goal[order], planar[order], bits[order]
    new = np.ones(len(goal), dtype=bool)
    new[1:] = (goal[1:] != goal[:-1]) | (bits[1:] != bits[:-1]).any(axis=1)
    return (goal[new], planar[new], bits[new]), len(found.goal)


@kernel
def _odd_letters(trie: Ints, size: int, words: int) -> npt.NDArray[np.uint64]:
    """Return the (size, words) bits of the obstacles of which a node's word has an odd number of
    letters."""
    out = np.zeros((size, words), dtype=np.uint64)
    for k in range(1, size):
        for j in range(words):
            out[k, j] = out[trie[k, PARENT], j]
        i = abs(trie[k, LETTER]) - 1
        out[k, i // BITS_PER_ENTRY] ^= np.uint64(1) << np.uint64(i % BITS_PER_ENTRY)
    return out
