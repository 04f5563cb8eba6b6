"""Certified lower bound on every tour of a mission's waypoints.

Each leg gets a certified lower bound: the straight distance, which is exact between places in
sight of one another, the shortest path around polytopes inside of the solids
(`netsp.plan.space.edge_bound`), or the bound of a potential over all cells that are not certain to
be blocked (`netsp.plan.space.potential`). The shortest tour by these lengths is a lower bound on
every tour. The length of a path that was found, pulled taut or not, only says how far to look: a
path found on a grid is no bound on other paths.

These lengths ignore the tether. If a scene has upright solids, the plane's proof over all homotopy
classes of the tether around them is a second bound (`netsp.plan.space.upright`). If bars or rings
form loops, a third bound counts how path and tether wind around them
(`netsp.plan.space.class_bound`). The result is the largest bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.geometry import polylines
from netsp.plan.solve_problem import solve_graph
from netsp.plan.space.class_bound import bound_by_windings
from netsp.plan.space.edge_bound import edge_bound
from netsp.plan.space.inscribed_polytopes import Polytopes, inscribed_polytopes
from netsp.plan.space.mission_policy import BoundPolicy, ClassPolicy, EdgePolicy, PotentialPolicy
from netsp.plan.space.planning_context import is_straight_clear
from netsp.plan.space.potential import Ends, Region, cells_at_level, path_bound
from netsp.plan.space.space_legs import RobotPaths
from netsp.plan.space.upright import bound_by_upright_solids, judged_room
from netsp.plan.space.wound_loops import WoundLoops
from netsp.roadmap.from_state import from_state
from netsp.roadmap.travel_graph import TravelGraph


def bound_all_tours(
    robot_paths: RobotPaths,
    waypoints: list[int],
    clock: Clock | None,
    seed: int = 0,
    policy: BoundPolicy | None = None,
    potential: PotentialPolicy | None = None,
    classes: ClassPolicy | None = None,
) -> float | None:
    """Return a lower bound on the length of every tour through some waypoints.

    The bound holds for tours that go to the waypoints themselves, keep the mission's clearance as
    the judge checks it (`netsp.plan.space.planning_context.keeps_clearance`), stay within the
    scene's bounds and within the tether's length of the anchor.

    Parameters
    ----------
    robot_paths : RobotPaths
        Known paths between waypoints; their lengths only say how far to look.
    waypoints : list of int
        Numbers of the waypoints that the tours visit.
    clock : Clock, optional
        Clock of the run; when it is up, the bound proven so far is returned.
    policy : BoundPolicy, optional
        Time and accuracy; by default those of the context.
    potential : PotentialPolicy, optional
        Effort for each leg; by default that of the context.
    classes : ClassPolicy, optional
        Sizes and time of the bound by windings; by default those of the context.

    Returns
    -------
    float or None
        Lower bound, metres; None if there was no time for one, or no waypoint besides the start.
    """
    clock, defaults = clock or Clock(), robot_paths.context.policy
    policy, potential = policy or defaults.bound, potential or defaults.potential
    places, visited = robot_paths.places, set(waypoints)
    place_numbers = [
        n for n in range(len(places)) if n == places.present or places.waypoint[n] in visited
    ]
    if not place_numbers:
        return None
    upright = bound_by_upright_solids(
        robot_paths.context.mission,
        robot_paths.context,
        place_numbers,
        places,
        clock.part(policy.upright_share),
    )
    legs = LegBounds(robot_paths, place_numbers, potential, policy, uses_potentials=False)
    classes = classes or defaults.classes
    loops = None
    if _has_one_place_each(legs) and len(place_numbers) > 1:
        loops = WoundLoops.of_mission(robot_paths.context, legs.points, classes)
    bounds = [upright or 0.0]
    # potentials take seconds for a leg, so they come last
    for uses_potentials in (False, True):
        legs.uses_potentials = uses_potentials
        part = clock if loops is None else clock.part(1.0 - classes.share)
        bounds.append(_bound_without_tether(legs, part, seed) or 0.0)
        if loops is not None:
            part = clock if uses_potentials else clock.part(classes.share)
            bounds.append(_bound_with_windings(legs, loops, part, seed))
    return max(bounds) or None


def _has_one_place_each(legs: LegBounds) -> bool:
    """Return whether tours begin at the start, and no waypoint has alternatives."""
    places, numbers = legs.paths.places, legs.place_numbers
    waypoints = set(places.waypoint[numbers].tolist())
    return places.present is None and len(waypoints) == len(numbers)


@dataclass
class LegBounds:
    """Certified lower bounds on legs between the start and some places.

    Attributes
    ----------
    paths
        Known paths between waypoints.
    place_numbers
        Numbers of the places, as in `paths.places`.
    potential, policy, edges
        Effort for each leg by potentials; time and accuracy; effort for each leg by edges.
    uses_potentials
        Whether `raise_bound` uses potentials once it has a bound around edges.
    points
        (v, 3) the start, then the places, metres.
    costs
        (v, v) lower bound on the length of each leg, metres.
    final
        (v, v) true if more effort cannot raise the bound.
    """

    paths: RobotPaths
    place_numbers: list[int]
    potential: PotentialPolicy
    policy: BoundPolicy = field(default_factory=BoundPolicy)
    edges: EdgePolicy = field(default_factory=EdgePolicy)
    uses_potentials: bool = True
    points: Floats = field(init=False)
    costs: Floats = field(init=False)
    final: Bools = field(init=False)
    _level: Ints = field(init=False)
    _is_sight_tested: Bools = field(init=False)
    _polytopes: dict[float, Polytopes] = field(default_factory=dict)
    _clearance: Floats = field(init=False)

    def __post_init__(self) -> None:
        context = self.paths.context
        self.points = np.vstack(
            [context.mission.start, self.paths.places.points[self.place_numbers]]
        )
        self.costs = np.linalg.norm(self.points[:, None] - self.points[None], axis=2)
        self.final = np.eye(len(self.points), dtype=np.bool_)
        self._level = np.zeros(self.costs.shape, dtype=np.int64)
        self._is_sight_tested = self.final.copy()
        self._clearance = context.field.distance(self.points)

    def is_exhausted(self, u: int, v: int) -> bool:
        """Return whether `raise_bound` cannot raise the bound of a leg by the means in use."""
        done = self.final[u, v] or (self._level[u, v] > 0 and not self.uses_potentials)
        return bool(done)

    def raise_bound(self, u: int, v: int, clock: Clock) -> bool:
        """Raise the bound of a leg, and return whether it has grown.

        The first call uses edges of polytopes. With `uses_potentials`, later calls use potentials
        on ever finer grids.

        Parameters
        ----------
        u, v : int
            Ends of the leg, as in `points`.
        clock : Clock
            Clock of the run; a grid that would take longer than it allows is skipped.
        """
        if self.is_exhausted(u, v):
            return False
        a, b, before = self.points[u], self.points[v], self.costs[u, v]
        context = self.paths.context
        if not self._is_sight_tested[u, v]:
            self._is_sight_tested[u, v] = self._is_sight_tested[v, u] = True
            if is_straight_clear(context.field, a, b, context.mission.clearance):
                self.final[u, v] = self.final[v, u] = True
                return False
        known_length = self._known_length(u, v)
        farthest = self.policy.max_detour_ratio * float(np.linalg.norm(b - a))
        longest = known_length if math.isfinite(known_length) else farthest
        ends, region, level = Ends(a, b, longest), self._region(u, v), int(self._level[u, v])
        if level == 0:
            length, is_final = edge_bound(self._shapes(region), ends, region, self.edges, clock)
            self._keep(u, v, length, 1)
            if is_final or length >= (1.0 - self.policy.max_leg_gap) * longest:
                self.final[u, v] = self.final[v, u] = True
            return bool(self.costs[u, v] > before * (1.0 + 1e-9) + 1e-9)
        cells = cells_at_level(level, self.potential)
        if self.policy.cell_s * cells > clock.left:
            self.final[u, v] = self.final[v, u] = True
            return False
        length = path_bound(context.field, ends, region, cells, self.potential, clock)
        self._keep(u, v, length, level + 1)
        if cells >= self.potential.max_cells or length >= (1.0 - self.policy.max_leg_gap) * longest:
            self.final[u, v] = self.final[v, u] = True
        return bool(self.costs[u, v] > before * (1.0 + 1e-9) + 1e-9)

    def _keep(self, u: int, v: int, length: float, level: int) -> None:
        """Keep a bound on a leg if it is greater than the one before, and the level it was made
        at."""
        self.costs[u, v] = self.costs[v, u] = max(self.costs[u, v], length)
        self._level[u, v] = self._level[v, u] = level

    def _shapes(self, region: Region) -> Polytopes:
        """Return polytopes that all paths in a region stay out of."""
        if region.room not in self._polytopes:
            reach = np.array([-region.reach, region.reach])[:, None]
            low, high = region.anchor + reach
            box = np.array([np.maximum(low, region.bounds[0]), np.minimum(high, region.bounds[1])])
            self._polytopes[region.room] = inscribed_polytopes(
                self.paths.context.field, region.room, box, self.edges
            )
        return self._polytopes[region.room]

    def room(self, u: int, v: int) -> float:
        """Return the least distance from solids of all paths that the judge accepts, metres.

        It is negative for ends in solids.
        """
        mission = self.paths.context.mission
        room = min(mission.clearance, float(self._clearance[u]), float(self._clearance[v]))
        return judged_room(room, self.paths.context)

    def _region(self, u: int, v: int) -> Region:
        """Return the region of all legs that the judge accepts
        (`netsp.plan.space.planning_context.keeps_clearance`)."""
        mission, context = self.paths.context.mission, self.paths.context
        bounds = np.array([[-np.inf] * 3, [np.inf] * 3])
        if context.bounds is not None:
            bounds = np.array(context.bounds).reshape(2, 3)
        anchor = np.asarray(mission.anchor, dtype=float)
        return Region(self.room(u, v), bounds, anchor, mission.tether_length * (1.0 + 1e-6))

    def _known_length(self, u: int, v: int) -> float:
        """Return the length of the shortest path found so far; infinite where there is none."""
        robot_paths = self.paths
        if u == 0 or v == 0:
            n, laid = (
                self.place_numbers[max(u, v) - 1],
                polylines.length(robot_paths.context.start_tether.nodes),
            )
            return min(
                (laid + polylines.length(t) for t in robot_paths.tethers.get(n, ())),
                default=math.inf,
            )
        known = robot_paths.between(self.place_numbers[u - 1], self.place_numbers[v - 1])
        return min((polylines.length(path) for _, path in known), default=math.inf)


def _bound_without_tether(legs: LegBounds, clock: Clock, seed: int) -> float | None:
    """Return the bound that the lower bounds of legs prove.

    Solve for the shortest tour by these lengths, raise the bounds of its legs, and solve again,
    until no bound of a leg can be raised or the time is up.
    """
    places, best = legs.paths.places, 0.0
    point = np.array(legs.place_numbers)
    cluster: Ints = np.r_[0, 1 + np.unique(places.waypoint[point], return_inverse=True)[1]]
    begin = None if places.present is None else 1 + int(np.flatnonzero(point == places.present)[0])
    while True:
        graph = TravelGraph.from_costs(legs.costs, cluster)
        if begin is not None:
            graph = from_state(graph, begin)
        # straight lengths give a bound even if the time is up
        solving = Clock(legs.policy.min_solve_s) if clock.is_up else clock
        result = solve_graph(graph, "auto", time_limit=solving, seed=seed)
        best = max(best, result.lower_bound or 0.0)
        if clock.is_up or result.tour is None:
            return best or None
        tour, grown = list(pairwise((*result.tour, 0))), False
        while not grown and not all(legs.is_exhausted(u, v) for u, v in tour):
            for u, v in tour:
                if clock.is_up:
                    return best or None
                grown = legs.raise_bound(u, v, clock) or grown
        if not grown:
            return best or None


def _bound_with_windings(legs: LegBounds, loops: WoundLoops, clock: Clock, seed: int) -> float:
    """Return the bound that the lower bounds of legs and their windings prove; 0 without time.

    As `_bound_without_tether`, raise the bounds of the legs of the shortest tour, and solve again.
    If none can be raised, add loops that this tour winds around.
    """
    best, count = 0.0, len(legs.points)
    rooms = np.array([[legs.room(u, v) for v in range(count)] for u in range(count)])
    while not clock.is_up:
        found = bound_by_windings(loops.graph(legs.costs, rooms, clock), clock, seed)
        best, grown = max(best, found.length), False
        while not grown and not all(legs.is_exhausted(u, v) for u, v, _ in found.tour):
            for u, v, _ in found.tour:
                if clock.is_up:
                    return best
                grown = legs.raise_bound(u, v, clock) or grown
        if not grown and not loops.choose(found.tour, legs.costs, rooms):
            break
    return best
