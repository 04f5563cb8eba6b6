"""Viewpoints that may take the place of chosen ones, one for one, in any combination."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.plan.cover.cover_policy import CoverPolicy
from netsp.plan.cover.viewpoints import Viewpoints


def find_alternatives(
    found: Viewpoints, chosen: Ints, areas: Floats, needed: float, policy: CoverPolicy | None = None
) -> list[list[int]]:
    """Return the numbers of the alternatives of each chosen viewpoint.

    Every patch that is seen gets one owner among the chosen. A viewpoint in an owner's place loses
    the patches of that owner that it does not see itself. Whichever alternatives are taken, the
    area that is seen stays at least the needed one. Only places nearer to another chosen viewpoint
    count, because they make tours shorter.

    Parameters
    ----------
    areas : ndarray, shape (m,)
        Areas of the patches.
    needed : float
        Area that must be seen.
    """
    alternatives: list[list[int]] = [[] for _ in chosen]
    policy = policy or CoverPolicy()
    max_count = min(policy.max_alternatives, policy.max_places // max(len(chosen), 1) - 1)
    if max_count <= 0 or len(chosen) < 2:
        return alternatives
    sees = found.sees[chosen]
    spare = float(areas[sees.any(axis=0)].sum()) - needed
    owner = _owners(sees)
    pairs = []
    for k, number in enumerate(chosen):
        others = found.places[np.delete(chosen, k)]
        distances = np.linalg.norm(found.places[:, None] - others[None], axis=2).min(axis=1)
        lost = ~found.sees[:, owner == k] @ areas[owner == k]
        candidates = np.flatnonzero((lost <= spare) & (distances < distances[number]))
        pairs += [
            (float(lost[c]), float(distances[c]), k, int(c)) for c in candidates if c not in chosen
        ]
    reserved = np.zeros(len(chosen))
    for lost, _, k, c in sorted(pairs):
        if len(alternatives[k]) < max_count and lost - reserved[k] <= spare:
            spare -= max(0.0, lost - reserved[k])
            reserved[k] = max(reserved[k], lost)
            alternatives[k].append(c)
    return alternatives


def _owners(sees: np.ndarray) -> Ints:
    """Return (m,) one of the viewpoints that see each patch, -1 for none. A viewpoint that is the
    only one to see much owns the rest of what it sees, too, so that others are freer."""
    alone = sees & (sees.sum(axis=0) == 1)
    owner = np.full(sees.shape[1], -1)
    for k in np.argsort(-alone.sum(axis=1), kind="stable"):
        owner[sees[k] & (owner < 0)] = k
    return owner
