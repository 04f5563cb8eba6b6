"""Lower bound on tours that counts how path and tether wind around loops of bars.

A tour must come home with its path unwound from every loop of the scene's bars and rings. The
winding numbers at the waypoints, modulo three, are states of a travel graph. A leg that does not
wind like the straight segment between its ends must go around a bar, and is longer
(`netsp.plan.space.core_detours`). A state whose tether would be longer than the limit is left out.
The shortest tour of this graph bounds all tours. The proof is in docs/theory, Section 23.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.base.errors import NetspError
from netsp.plan.solve_problem import solve_graph
from netsp.plan.space.core_detours import DetourEffort, detour_lengths
from netsp.plan.space.mission_policy import ClassPolicy
from netsp.plan.space.potential import BOUND_ROUNDING
from netsp.plan.space.reduced_leg_costs import ReducedCosts
from netsp.plan.space.winding_numbers import Crossings, Loops
from netsp.roadmap.travel_graph import TravelGraph

DIGIT = 4
"""Format of winding numbers: bits of each number modulo three in an integer."""


def packed_windings(numbers: Iterable[int]) -> int:
    """Return winding numbers modulo three as one integer.

    Examples
    --------
    >>> hex(packed_windings([1, -1, 3]))
    '0x21'
    """
    return sum((int(n) % 3) << (DIGIT * k) for k, n in enumerate(numbers))


def add_windings(a: int, b: int, n: int) -> int:
    """Return the sum of n packed winding numbers.

    Examples
    --------
    >>> hex(add_windings(0x021, 0x012, 3))
    '0x0'
    """
    ones = (1 << (DIGIT * n)) // 15
    total = a + b
    # a digit of three or more has its highest bit set once five are added
    return total - 3 * (((total + 5 * ones) & (8 * ones)) >> 3)


class Detour(NamedTuple):
    """Lower bound on paths with some windings, and the bars that the bound leads them around.

    Attributes
    ----------
    length
        Lower bound on the length of the paths, or on their excess over other paths, metres.
    bars
        Segments of the cores, as pairs of number and direction.
    """

    length: float
    bars: tuple[tuple[int, int], ...] = ()

    def backward(self, subtracted: float = 0.0) -> Detour:
        """Return the same for the paths in the other direction."""
        return Detour(self.length - subtracted, tuple((e, -sign) for e, sign in self.bars))


@dataclass
class WindingLegs:
    """Bounds on paths between some points by their windings.

    Attributes
    ----------
    loops
        Loops of cores that paths wind around.
    points
        (n, 3) ends of paths, metres.
    pairs
        (p, 2) ends of the paths whose windings are asked for, as in `points`.
    policy
        Sizes and accuracy.
    """

    loops: Loops
    points: Floats
    pairs: Ints
    policy: ClassPolicy
    n: int = field(init=False)
    _straight: dict[tuple[int, int], int] = field(init=False)
    _bars: list[int] = field(init=False)

    def __post_init__(self) -> None:
        crossings = Crossings(self.loops, self.points, self.pairs, self.policy)
        self.n = len(crossings.used)
        self._straight = {}
        for (u, v), counts in zip(self.pairs.tolist(), crossings.counts, strict=True):
            self._straight[u, v] = packed_windings(counts)
            self._straight[v, u] = packed_windings(-counts)
        rows = self.loops.incidence[:, crossings.used]
        self._bars = [packed_windings(row) for row in rows.tolist()]

    def sum(self, *windings: int) -> int:
        """Return the sum of packed winding numbers."""
        total = 0
        for w in windings:
            total = add_windings(total, w, self.n)
        return total

    def negative(self, windings: int) -> int:
        """Return the packed winding numbers of a path in the other direction."""
        return add_windings(windings, windings, self.n)

    def straight(self, u: int, v: int) -> int:
        """Return the packed winding numbers of the straight segment between two points."""
        return 0 if u == v else self._straight[u, v]

    def other_windings(
        self, u: int, v: int, on_all: float, room: float, longest: float, max_count: int
    ) -> tuple[dict[int, Detour], float]:
        """Return bounds on paths between two points that wind otherwise than the straight segment.

        Parameters
        ----------
        on_all : float
            A bound on all paths, metres.
        room : float
            Least distance of the paths from solids, metres; negative if they may enter them.
        longest : float
            Longest bound of interest, metres.
        max_count : int
            Maximum number of windings.

        Returns
        -------
        bounds : dict of int to Detour
            Bounds, by the difference of the windings from those of the segment; the bound for
            difference 0 is `on_all`.
        others : float
            Bound on the paths with any other windings, metres.
        """
        cores = self.loops.cores
        ends = cores.points[cores.edges]
        a, b, away = self.points[u], self.points[v], np.maximum(0.0, cores.depth + room)
        begins, ends = ends[:, 0], ends[:, 1]
        effort = DetourEffort(longest, self.policy.tolerance, self.policy.max_pieces)
        lengths = detour_lengths(a, b, begins, ends, away, effort)
        order = [int(e) for e in np.argsort(lengths, kind="stable") if self._bars[e]]
        bounds, seen = {0: Detour(on_all)}, set[int]()
        for e in order:
            length, turn = max(on_all, float(lengths[e])), self._bars[e]
            if length >= longest:
                return bounds, longest
            if turn in seen:
                continue
            if 3 * len(bounds) > max_count:
                return bounds, length
            inverse = self.negative(turn)
            seen |= {turn, inverse}
            for before, detour in list(bounds.items()):
                for w, sign in ((turn, 1), (inverse, -1)):
                    to = Detour(length, (*detour.bars, (e, sign)))
                    bounds.setdefault(self.sum(before, w), to)
        return bounds, longest


@dataclass
class WindingGraph:
    """States of waypoints with winding numbers, and legs between them.

    Attributes
    ----------
    legs
        Bounds on paths by their windings. The points are the start, the places, and then the nodes
        of the tether at the start from the anchor on.
    costs
        (v, v) bounds on legs between the start and the places whatever their windings, metres.
    rooms
        (v, v) least distance of the robot on legs from solids, metres.
    reduced
        Bound on all tours whatever their windings, and reduced costs.
    max_tether, dip
        Length of the longest tether, and depth to which it may enter solids, metres.
    policy
        Sizes and time.
    """

    legs: WindingLegs
    costs: Floats
    rooms: Floats
    reduced: ReducedCosts
    max_tether: float
    dip: float
    policy: ClassPolicy
    _legs: dict[tuple[int, int], dict[int, Detour]] = field(default_factory=dict)
    _tethers: dict[int, tuple[dict[int, Detour], float]] = field(default_factory=dict)
    complete: float = field(init=False)

    def __post_init__(self) -> None:
        bound, reduced = self.reduced
        self.complete = bound * (1.0 + self.policy.max_raise_ratio)
        for u in range(len(self.costs)):
            for v in range(u + 1, len(self.costs)):
                spare = self.complete - bound - float(reduced[u, v])
                if spare <= 0.0:
                    continue
                cost = float(self.costs[u, v])
                bounds, others = self.legs.other_windings(
                    u, v, cost, float(self.rooms[u, v]), cost + spare, self.policy.max_leg_windings
                )
                self._legs[u, v] = {w: Detour(d.length - cost, d.bars) for w, d in bounds.items()}
                self._legs[v, u] = {
                    self.legs.negative(w): d.backward(cost) for w, d in bounds.items()
                }
                # no tour that is shorter has a leg with other windings
                self.complete = min(self.complete, bound + float(reduced[u, v]) + others - cost)

    def reaches(self, place: int, windings: int) -> bool:
        """Return whether a tether may reach a place with some windings of the path from the
        start."""
        anchor, laid = len(self.costs), range(len(self.costs), len(self.legs.points) - 1)
        if place not in self._tethers:
            longest = self.max_tether * (1.0 + BOUND_ROUNDING)
            straight = float(np.linalg.norm(self.legs.points[anchor] - self.legs.points[place]))
            self._tethers[place] = self.legs.other_windings(
                anchor, place, straight, -self.dip, longest, self.policy.max_tether_windings
            )
        bounds, others = self._tethers[place]
        total = self.legs.sum(
            *(self.legs.straight(k, k + 1) for k in laid),
            windings,
            self.legs.negative(self.legs.straight(anchor, place)),
        )
        known = bounds.get(total)
        return (others if known is None else known.length) <= self.max_tether

    def states(self, longest: float) -> dict[tuple[int, int], float] | None:
        """Return the states that tours up to a length may pass; None if they are too many.

        Parameters
        ----------
        longest : float
            Length of the tours, metres; at most `complete`.

        Returns
        -------
        dict of (int, int) to float, or None
            For place and windings, the least sum of reduced costs and detours of paths from the
            start, metres.
        """
        bound, reduced = self.reduced
        half = 0.5 * (longest - bound)
        found: dict[tuple[int, int], float] = {}
        queue, nearest = [(0.0, 0, 0)], {(0, 0): 0.0}
        while queue:
            d, u, w = heapq.heappop(queue)
            if (u, w) in found:
                continue
            found[u, w] = d
            if len(found) > self.policy.max_states:
                return None
            for v in range(1, len(self.costs)):
                near = d + float(reduced[u, v])
                if near > half or (u, v) not in self._legs:
                    continue
                after = self.legs.sum(w, self.legs.straight(u, v))
                for turn, (detour, _) in self._legs[u, v].items():
                    to = v, self.legs.sum(after, turn)
                    if near + detour < min(nearest.get(to, math.inf), half) and self.reaches(*to):
                        nearest[to] = near + detour
                        heapq.heappush(queue, (near + detour, *to))
        return found

    def leg(self, begin: tuple[int, int], end: tuple[int, int]) -> Detour | None:
        """Return the excess of a leg between two states over other legs; None if it is too long."""
        (u, w), (v, x) = begin, end
        turn = self.legs.sum(x, self.legs.negative(w), self.legs.negative(self.legs.straight(u, v)))
        return self._legs.get((u, v), {}).get(turn)

    def travel_graph(self, states: dict[tuple[int, int], float], longest: float) -> TravelGraph:
        """Return the travel graph of some states, with all legs of tours up to a length."""
        bound, reduced = self.reduced
        order = sorted(states)
        place = np.array([u for u, _ in order])
        raised = np.array([states[state] for state in order])
        costs = np.full((len(order), len(order)), np.inf)
        for i, (u, w) in enumerate(order):
            # most that a leg may add to the bound for a tour over it to be short enough
            spare = longest - bound - raised[i] - raised[:i] - reduced[u, place[:i]]
            for j in np.flatnonzero(spare >= 0.0).tolist():
                known = self.leg(order[j], (u, w))
                if known is not None and known.length <= spare[j]:
                    costs[i, j] = costs[j, i] = self.costs[u, place[j]] + known.length
        return TravelGraph.from_costs(costs, place.tolist())


TourLeg = tuple[int, int, tuple[tuple[int, int], ...]]
"""Leg of a tour: two places, and the bars that it is led over, as in `Detour`."""


class WindingBound(NamedTuple):
    """Bound on all tours, and the legs that it rests on.

    Attributes
    ----------
    length
        No tour is shorter, metres.
    tour
        Legs of a shortest tour of the travel graph; empty if there is none.
    """

    length: float
    tour: list[TourLeg]


def bound_by_windings(graph: WindingGraph, clock: Clock, seed: int = 0) -> WindingBound:
    """Return a lower bound on all tours that counts how path and tether wind around bars.

    The first travel graph has the states of tours that are little longer than the bound without
    windings. As long as its shortest tour is no shorter than that, the next one has longer tours.

    Parameters
    ----------
    graph : WindingGraph
        States and legs.
    clock : Clock
        Clock of the run; when it is up, the bound proven so far is returned.
    """
    best = bound = graph.reduced.bound
    tour: list[TourLeg] = []
    spare = (graph.complete - bound) * 0.5**graph.policy.max_halvings
    while spare > 0.0 and not clock.is_up:
        longest = min(graph.complete, bound + spare)
        states = graph.states(longest)
        if states is None:
            break
        if len({u for u, _ in states}) < len(graph.costs):
            best = max(best, longest)  # tours up to this length miss a place
        else:
            try:
                travel = graph.travel_graph(states, longest)
                result = solve_graph(travel, "auto", time_limit=clock, seed=seed)
            except NetspError:
                best = max(best, longest)  # no tour
            else:
                best = max(best, min(longest, result.lower_bound or 0.0))
                if result.tour is not None:
                    order = sorted(states)
                    tour = []
                    for i, j in pairwise((*result.tour, 0)):
                        leg = graph.leg(order[i], order[j])
                        tour.append((order[i][0], order[j][0], leg.bars if leg else ()))
                    if (result.length or math.inf) < longest:
                        break
        if longest >= graph.complete:
            break
        spare *= 2.0
    return WindingBound(best * (1.0 - BOUND_ROUNDING), tour)
