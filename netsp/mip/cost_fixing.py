"""Reduced-cost fixing of legs between classes by a bound over a cover.

A leg between two classes lies above the leg between their cells, which costs no more. If it costs
more than the leg of the cells by more than the slack of that leg in the cover's bound, it is in no
better tour. After a few covers over paths between goals fewer than one leg in ten is left. So legs
are measured in blocks, most of which is discarded at once, and no matrix of all legs is made.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.gtsp.instance import Instance
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.mip.cover_bounds import CellBound
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.mip_policy import PricingPolicy
from netsp.mip.prices import Prices

PATH_ROUNDING = 1e-9
"""Tolerance, relative, within which paths between goals are shortest."""


def max_leg_costs(
    bound: CellBound, cutoff: float, policy: PricingPolicy = PricingPolicy()
) -> Floats:
    """Return the largest cost (m, m) of a leg between two cells in a tour below the cutoff.

    It is -inf where no such tour has a leg.
    """
    costs, dead = bound.costs, DeadLegs(bound.dead | np.isinf(bound.costs), policy)
    prices = Prices(costs, dead, bound.cells.cluster, bound.cuts, bound.duals, policy=policy)
    increases = prices.max_increases(cutoff)
    return np.where(np.isinf(costs), 0.0, costs) + increases + PATH_ROUNDING * cutoff


def surviving_legs(
    graph: Instance,
    bound: CellBound,
    length: float,
    tour: Sequence[int],
    odd: Bools,
    policy: PricingPolicy = PricingPolicy(),
) -> SparseCosts:
    """Return the costs of the legs that may be in a tour of at most a given length.

    Parameters
    ----------
    tour
        Tour of that length, whose legs are kept in any case.
    odd
        Result of `netsp.mip.parity_cuts.odd_numbers`.

    Raises
    ------
    LimitReachedError
        The graph's clock was up before all legs were measured.
    """
    cell = bound.cells.cells_of(graph.cluster, odd)
    longest = max_leg_costs(bound, length, policy)
    return SparseCosts(len(graph), graph.costs_in_blocks(), cell, longest, np.asarray(tour))
