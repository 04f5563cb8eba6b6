"""Loops of bars that a bound on all tours counts.

All loops of a large scene would give too many states (`netsp.plan.space.class_bound`). So the first
graph has none. Whenever its shortest tour winds around some loop at its end, or its tether exceeds
the limit, the loop that is the costliest to avoid is added, and the graph is solved again. Any
choice of loops gives a bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.plan.space.class_bound import TourLeg, WindingGraph, WindingLegs
from netsp.plan.space.core_detours import DetourEffort, detour_lengths
from netsp.plan.space.mission_policy import ClassPolicy
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.reduced_leg_costs import reduced_leg_costs
from netsp.plan.space.solid_cores import Cores, solid_cores
from netsp.plan.space.winding_numbers import Loops, costliest_loop, piercings


@dataclass
class WoundLoops:
    """Loops of a scene that bounds count.

    Attributes
    ----------
    cores
        Cores of all loops.
    points
        (n, 3) the start, the places, and the nodes of the tether at the start from the anchor on.
    size
        Number of the places and the start.
    max_tether, dip
        Length of the longest tether, and depth to which it may enter solids, metres.
    policy
        Sizes and time.
    loops
        Chosen loops: how often each runs along each core (m,), with signs.
    """

    cores: Cores
    points: Floats
    size: int
    max_tether: float
    dip: float
    policy: ClassPolicy
    loops: list[Ints] = field(default_factory=list)
    pairs: Ints = field(init=False)
    _pierced: Ints | None = field(init=False)
    _number: dict[tuple[int, int], int] = field(init=False)

    def __post_init__(self) -> None:
        n = self.size
        one, other = np.triu_indices(n, 1)
        laid = np.arange(n, len(self.points) - 1)
        to_anchor = np.column_stack([np.arange(n), np.full(n, n)])
        legs, steps = np.column_stack([one, other]), np.column_stack([laid, laid + 1])
        self.pairs = np.vstack([legs, to_anchor, steps])
        self._pierced = piercings(self.cores, self.points, self.pairs, self.policy)
        self._number = {(u, v): k for k, (u, v) in enumerate(self.pairs.tolist())}

    @classmethod
    def of_mission(
        cls, context: PlanningContext, points: Floats, policy: ClassPolicy
    ) -> WoundLoops | None:
        """Return the loops of a mission's scene, none of them chosen; None if there are none.

        Parameters
        ----------
        points : ndarray of shape (v, 3)
            The start, then the places, metres.
        """
        dip = context.max_dip
        cores = solid_cores(context.field, dip, policy).loops()
        if not len(cores.edges):
            return None
        every = np.vstack([points, np.asarray(context.start_tether.nodes)])
        max_tether = context.mission.tether_length * (1.0 + 1e-6)
        out = cls(cores, every, len(points), max_tether, dip, policy)
        return None if out._pierced is None else out

    def graph(self, costs: Floats, rooms: Floats, clock: Clock) -> WindingGraph:
        """Return the graph of the chosen loops, whose tours bound all tours.

        Parameters
        ----------
        costs : ndarray of shape (v, v)
            Bounds on legs between the start and the places whatever their windings, metres.
        rooms : ndarray of shape (v, v)
            Least distance of the robot on legs from solids, metres.
        """
        incidence = np.array(self.loops, dtype=np.int64).reshape(-1, len(self.cores.edges)).T
        loops = Loops(self.cores, incidence)
        legs = WindingLegs(loops, self.points, self.pairs, self.policy)
        reduced = reduced_leg_costs(costs, clock)
        return WindingGraph(legs, costs, rooms, reduced, self.max_tether, self.dip, self.policy)

    def choose(self, tour: list[TourLeg], costs: Floats, rooms: Floats) -> bool:
        """Choose loops that a tour or its tether winds around, and return whether there are any.

        Parameters
        ----------
        tour : list of TourLeg
            A shortest tour of the graph of the loops chosen so far.
        costs, rooms
            As for `graph`.
        """
        before = len(self.loops)
        if before >= self.policy.max_loops or not tour:
            return False
        detours = np.array(
            [self._lengths(u, v, float(rooms[u, v]), math.inf) - costs[u, v] for u, v, _ in tour]
        )
        wound = np.zeros(len(self.cores.edges), dtype=np.int64)
        laid = sum(
            (self._along(k, k + 1) for k in range(self.size, len(self.points) - 1)), wound.copy()
        )
        worst: tuple[Ints, float] | None = None
        for u, v, bars in tour:
            wound += self._along(u, v)
            for bar, sign in bars:
                wound[bar] += sign
            if v != 0:
                tether = laid + wound + self._along(v, self.size)
                lengths = self._lengths(self.size, v, -self.dip, 2.0 * self.max_tether)
                found = costliest_loop(self.cores, tether, lengths)
                if found is not None and found[1] > max(self.max_tether, worst[1] if worst else 0):
                    worst = found
        if worst is not None:
            self._add(worst[0])
        costs_of_bars = detours.min(0)
        for _ in range(self.policy.max_new_loops):
            found = costliest_loop(self.cores, wound, costs_of_bars)
            if found is None or found[1] <= self.policy.tolerance:
                break
            self._add(found[0])
            # look for a loop that does not need this bar
            on_loop = np.flatnonzero(found[0])
            costs_of_bars[on_loop[costs_of_bars[on_loop].argmin()]] = -math.inf
        return len(self.loops) > before

    def _add(self, loop: Ints) -> None:
        """Add a loop unless it is chosen."""
        if not any((loop == other).all() or (loop == -other).all() for other in self.loops):
            self.loops.append(loop)

    def _along(self, u: int, v: int) -> Ints:
        """Return how often each core pierces the triangle of a segment, as `piercings`."""
        assert self._pierced is not None
        if (u, v) in self._number:
            return np.asarray(self._pierced[self._number[u, v]])
        return np.asarray(-self._pierced[self._number[v, u]])

    def _lengths(self, u: int, v: int, room: float, longest: float) -> Floats:
        """Return bounds (m,) on paths between two points over each core, metres."""
        ends = self.cores.points[self.cores.edges]
        away = np.maximum(0.0, self.cores.depth + room)
        longest = min(longest, 1e3 * float(np.ptp(self.points, axis=0).max()) + 1.0)
        effort = DetourEffort(longest, self.policy.tolerance, self.policy.max_pieces)
        a, b = self.points[u], self.points[v]
        return detour_lengths(a, b, ends[:, 0], ends[:, 1], away, effort)
