"""From covers to classes without the matrix of all legs.

A tour that takes a leg between two classes is over a cover one along the leg between their cells,
which costs no more. Where that leg, at what the program over the cover has proven, would lead to a
tour as long as the best one if it were so much longer, every leg above it that is so much longer is
in no better tour. After a few covers of the ways between goals fewer than one leg in ten is left,
so that the legs of some classes at a time are measured, and most are let go at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.gtsp.travel.graph import TravelGraph
from netsp.mip.cover_bounds import CellBound
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.prices import Prices

ROUNDING = 1e-9
"""Ways are shortest up to this, relative."""


def max_leg_costs(over: CellBound, cutoff: float) -> Floats:
    """(m, m) what a leg above one between two cells may cost, at most, to be in a tour shorter
    than the cutoff; -inf for nothing.

    Parameters
    ----------
    over
        What is proven over the cells.
    """
    costs, dead = over.costs, DeadLegs(over.dead | np.isinf(over.costs))
    prices = Prices(costs, dead, over.cells.cluster, over.cuts, over.duals)
    return np.where(np.isinf(costs), 0.0, costs) + prices.room(cutoff) + ROUNDING * cutoff


def surviving_legs(
    graph: TravelGraph, over: CellBound, length: float, tour: Sequence[int], odd: Bools
) -> SparseCosts:  # fmt: skip
    """The legs among all vertices that may be in a tour as short as one of that length.

    Parameters
    ----------
    over
        As of `max_leg_costs`.
    tour
        One as short as that, whose legs are kept in any case.
    odd
        (V, n) as of `netsp.mip.parity_cuts.odd_letters`.

    Raises
    ------
    LimitReachedError
        The graph's clock was up before they were measured.
    """
    own = over.cells.of(graph.cluster, odd)
    longest = max_leg_costs(over, length)
    return SparseCosts(len(graph), graph.costs_in_blocks(), own, longest, np.asarray(tour))
