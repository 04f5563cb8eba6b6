"""A certified lower bound on every tour of a mission's waypoints.

No tour is shorter than the shortest tour through lengths that no leg is shorter than. Those of legs
are the straight distance, which is exact between places in sight of one another, or that of a
potential over all cells that are not certain to be blocked (`netsp.space.potential`). A length that
was measured along a path, pulled taut or not, only tells how far to look: paths found on a grid are
no bound on the others.

These lengths leave the tether aside. Where a scene has upright solids, the plane's proof over all
homotopy classes of the tether around them is a second bound (`netsp.space.upright`). The larger of
the two counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.clock import Clock
from netsp.roadmap.from_state import from_state
from netsp.solvers.solve import solve_graph
from netsp.space.legs import Ways
from netsp.space.potential import PotentialParams, Region, cells_of, path_bound
from netsp.space.upright import bound_of_upright
from netsp.space.water import DEEPEST, ROOM_STEP, along, straight
from netsp.travel.graph import TravelGraph

UPRIGHT = 0.4
"""Share of the time left that the bound among upright solids may take."""

FARTHER = 2.2
"""Factor of the straight distance up to which paths are looked at where none is known."""

CLOSE = 2e-3
"""Share of a leg's known length by which its bound may be less and count as final."""

LEAST_SOLVING = 0.3
"""Seconds for the first bound, where the time is up."""

SECONDS_PER_CELL = 8e-6
"""Time that a potential takes per cell, s, by which a finer grid is left out for lack of time."""


def bound_of_all(
    ways: Ways, reached: list[int], clock: Clock | None, seed: int = 0,
    params: PotentialParams | None = None,
) -> float | None:  # fmt: skip
    """Return a length that no tour through some waypoints is shorter than.

    It holds for tours that go to the waypoints themselves, keep the mission's clearance as the
    judge has it (corners may be half of `delta` nearer), stay within the scene's bounds and no
    farther from the anchor than the tether is long.

    Parameters
    ----------
    ways : Ways
        Of the robot between waypoints; their lengths only tell how far to look.
    reached : list of int
        The waypoints of the tours.
    clock : Clock, optional
        When it is up, the bound is what is proven by then.
    seed : int
        Of the solver.
    params : PotentialParams, optional
        Effort for each leg.

    Returns
    -------
    float or None
        Metres; None if there was no time for any, or nothing is to be visited but the start.
    """
    clock = clock or Clock()
    places, visited = ways.places, set(reached)
    some = [n for n in range(len(places)) if n == places.begin or places.waypoint[n] in visited]
    if not some:
        return None
    upright = bound_of_upright(ways.water.mission, ways.water, some, places, clock.part(UPRIGHT))
    legs = LegBounds(ways, some, params or PotentialParams())
    of_robot = _of_robot(legs, clock, seed)
    return max(of_robot or 0.0, upright or 0.0) or None


@dataclass
class LegBounds:
    """Certified least lengths of legs between the start and places.

    Parameters
    ----------
    ways : Ways
        Of the robot.
    some : list of int
        The places.
    params : PotentialParams
        Effort.

    Attributes
    ----------
    points : ndarray, shape (v, 3)
        The start, then the places, metres.
    costs : ndarray, shape (v, v)
        Metres that legs are at least long.
    final : ndarray of bool, shape (v, v)
        Where more effort gives no more.
    """

    ways: Ways
    some: list[int]
    params: PotentialParams
    points: Floats = field(init=False)
    costs: Floats = field(init=False)
    final: Bools = field(init=False)
    _level: Ints = field(init=False)
    _looked: Bools = field(init=False)
    _room: Floats = field(init=False)

    def __post_init__(self) -> None:
        water = self.ways.water
        self.points = np.vstack([water.mission.start, self.ways.places.points[self.some]])
        self.costs = np.linalg.norm(self.points[:, None] - self.points[None], axis=2)
        self.final = np.eye(len(self.points), dtype=np.bool_)
        self._level = np.zeros(self.costs.shape, dtype=np.int64)
        self._looked = self.final.copy()
        self._room = water.field.distance(self.points)

    def raised(self, u: int, v: int, clock: Clock) -> bool:
        """Prove more of a leg.

        Parameters
        ----------
        u : int
            Where it begins, as in `points`.
        v : int
            Where it ends.
        clock : Clock
            A grid for which there is no time is left out.

        Returns
        -------
        bool
            Whether its least length has grown.
        """
        if self.final[u, v]:
            return False
        a, b, before = self.points[u], self.points[v], self.costs[u, v]
        water = self.ways.water
        if not self._looked[u, v]:
            self._looked[u, v] = self._looked[v, u] = True
            if straight(water.field, a, b, water.mission.clearance):
                self.final[u, v] = self.final[v, u] = True
                return False
        known = self._known(u, v)
        longest = known if math.isfinite(known) else FARTHER * float(np.linalg.norm(b - a))
        level = int(self._level[u, v]) + 1
        cells = cells_of(level, self.params)
        if SECONDS_PER_CELL * cells > clock.left:
            self.final[u, v] = self.final[v, u] = True
            return False
        length = path_bound(water.field, a, b, self._region(u, v), longest, cells, self.params)
        self.costs[u, v] = self.costs[v, u] = max(before, length)
        self._level[u, v] = self._level[v, u] = level
        if cells >= self.params.max_cells or length >= (1.0 - CLOSE) * longest:
            self.final[u, v] = self.final[v, u] = True
        return bool(self.costs[u, v] > before * (1.0 + 1e-9) + 1e-9)

    def _region(self, u: int, v: int) -> Region:
        """Return where a leg may run that the judge accepts (`netsp.space.water.has_room`)."""
        mission, water = self.ways.water.mission, self.ways.water
        room = min(mission.clearance, float(self._room[u]), float(self._room[v]))
        # between two samples along a path its room may be half a step less
        room = max(room - 0.5 * mission.delta - 2.0 * ROOM_STEP, -2.0 * DEEPEST)
        bounds = np.array([[-np.inf] * 3, [np.inf] * 3])
        if water.bounds is not None:
            bounds = np.array(water.bounds).reshape(2, 3)
        anchor = np.asarray(mission.anchor, dtype=float)
        return Region(room, bounds, anchor, mission.tether_length * (1.0 + 1e-6))

    def _known(self, u: int, v: int) -> float:
        """Return the length of the shortest path found so far; infinite where there is none."""
        ways = self.ways
        if u == 0 or v == 0:
            n, laid = self.some[max(u, v) - 1], along(ways.water.laid.nodes)
            return min((laid + along(t) for t in ways.tethers.get(n, ())), default=math.inf)
        known = ways.known(self.some[u - 1], self.some[v - 1])
        return min((along(path) for _, path in known), default=math.inf)


def _of_robot(legs: LegBounds, clock: Clock, seed: int) -> float | None:
    """Return the bound that is proven through least lengths of legs. Those of legs of the shortest
    tour are raised, and it is sought again, until no more can be proven of any."""
    places, best = legs.ways.places, 0.0
    point = np.array(legs.some)
    cluster: Ints = np.r_[0, 1 + np.unique(places.waypoint[point], return_inverse=True)[1]]
    begin = None if places.begin is None else 1 + int(np.flatnonzero(point == places.begin)[0])
    while True:
        graph = TravelGraph.from_costs(legs.costs, cluster)
        if begin is not None:
            graph = from_state(graph, begin)
        # straight lengths alone give a bound, however little time there is
        solving = Clock(LEAST_SOLVING) if clock.up else clock
        result = solve_graph(graph, "auto", time_limit=solving, seed=seed)
        best = max(best, result.lower_bound or 0.0)
        if clock.up or result.tour is None:
            return best or None
        tour, grown = list(pairwise((*result.tour, 0))), False
        while not grown and not all(legs.final[u, v] for u, v in tour):
            for u, v in tour:
                if clock.up:
                    return best or None
                grown = legs.raised(u, v, clock) or grown
        if not grown:
            return best or None
