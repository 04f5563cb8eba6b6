"""Tours along spokes: the robot's shortest paths from the start to each waypoint.

A leg between two waypoints leads back along one spoke and out along the other, pulled taut. All
such legs are of the class of the two spokes, so a tour along them leaves the tether free: its word
is empty in any scene, and no word need be found. The spokes come from one tree of shortest paths,
so this is the first tour of a run. Where the tether does not fit on the taut leg, or hangs
otherwise, the robot goes all along its spoke back to the start, and out again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.bounded_work import end_if_abandoned
from netsp.base.clock import Clock
from netsp.base.geometry import polylines
from netsp.plan.solve_problem import solve_graph
from netsp.plan.space.board import DrivenTour, TourVisit
from netsp.plan.space.judge import JudgePolicy
from netsp.plan.space.mission_policy import OrderPolicy
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext, keeps_clearance
from netsp.plan.space.states import hang_alike
from netsp.roadmap.from_state import from_state
from netsp.roadmap.travel_graph import TravelGraph
from netsp.world.mission.mission_tether import mission_tether
from netsp.world.paths.tree import ShortestTree
from netsp.world.tether import Tether


@dataclass(frozen=True)
class Spoke:
    """The robot's shortest path from the start to a place, pulled taut.

    Attributes
    ----------
    path
        (k, 3) path of the robot, metres.
    tethers
        Tether of the robot at its end, at the resolutions of the mission and of the judge.
    """

    path: Floats
    tethers: tuple[Tether, Tether]


@dataclass
class Spokes:
    """Spokes of a mission's places, as far as they were asked for.

    Attributes
    ----------
    context, places
        Context of the mission, and its places.
    judge
        Accuracy of the judge: the tether is driven at its resolution, too.
    """

    context: PlanningContext
    places: Places
    judge: JudgePolicy = field(default_factory=JudgePolicy)
    _known: dict[int, Spoke | None] = field(default_factory=dict)
    _legs: dict[tuple[int, int], Floats] = field(default_factory=dict)

    @cached_property
    def contexts(self) -> tuple[PlanningContext, PlanningContext]:
        """Return the context at the resolutions of the mission and of the judge."""
        context = self.context
        finer = mission_tether(context.mission, context.field, self.judge.delta_ratio)
        return context, replace(context, model=finer)

    @cached_property
    def _tree(self) -> ShortestTree:
        """Return the tree of shortest paths to the start."""
        return ShortestTree(
            self.context.grid, np.array(self.context.mission.start), self.places.points
        )

    @property
    def limit(self) -> float:
        """Return the maximum length of a tether at a waypoint and on a leg, metres."""
        context = self.context
        share = context.policy.tether_share * context.mission.tether_length
        return max(share, context.present_tether.length)

    def to_place(self, n: int) -> Spoke | None:
        """Return the spoke of a place; None if there is no path, or the tether exceeds its
        limit."""
        if n not in self._known:
            self._known[n] = self._find(n)
        return self._known[n]

    def _find(self, n: int) -> Spoke | None:
        """Find the spoke of a place."""
        context = self.context
        if n == self.places.present:
            # the robot is there, and may go back along its tether whatever the clearance
            line = [context.start_tether.nodes[::-1], context.present_tether.nodes[1:]]
            tethers = tuple(c.present_tether for c in self.contexts)
            return Spoke(np.vstack(line), (tethers[0], tethers[1]))
        cells = self._tree.path(n)
        if cells is None:
            return None
        for path in (context.pull_taut(cells[::-1]), cells[::-1]):
            if keeps_clearance(context.field, path, context.mission):
                rounds = context.policy.states.max_pull_rounds
                one, other = (
                    c.model.relaxed(np.vstack([c.start_tether.nodes, path[1:]]), rounds)
                    for c in self.contexts
                )
                return Spoke(path, (one, other)) if one.length <= self.limit else None
        return None

    def leg(self, n: int, m: int) -> Floats:
        """Return the path (k, 3) from one place to another in the class of their spokes, pulled
        taut, metres; both places must have a spoke."""
        key = (min(n, m), max(n, m))
        if key not in self._legs:
            a, b = self.to_place(key[0]), self.to_place(key[1])
            assert a is not None
            assert b is not None
            self._legs[key] = self.context.pull_taut(np.vstack([a.path[::-1], b.path[1:]]))
        return self._legs[key] if n < m else self._legs[key][::-1]

    def replace(self, n: int, tethers: tuple[Tether, Tether]) -> None:
        """Replace the tethers of a place that has a spoke."""
        spoke = self._known[n]
        assert spoke is not None
        self._known[n] = replace(spoke, tethers=tethers)

    def drive(self, order: Sequence[int], clock: Clock | None = None) -> DrivenTour | None:
        """Drive the tether along a tour.

        Parameters
        ----------
        order : sequence of int
            Places in the order of the tour, without the present one. Those without a spoke are left
            out.
        clock : Clock, optional
            When it is up, there is no tour.

        Returns
        -------
        DrivenTour or None
            The tour, without words; None if it visits no place, or its tether is not free at home.
        """
        drive, visits = _Drive(self), list[TourVisit]()
        for n in order:
            end_if_abandoned()
            if clock is not None and clock.is_up:
                return None
            leg = None if self.to_place(n) is None else drive.to(n)
            if leg is None:
                continue
            waypoint, choice = int(self.places.waypoint[n]), int(self.places.choice[n])
            visits.append(TourVisit(waypoint, choice, None, drive.tethers[0].length, *leg))
        home = drive.to(None)
        if not visits or home is None:
            return None
        return DrivenTour([], visits, home[0], drive.length, True, None)


class _Drive:
    """Robot that goes from spoke to spoke with its tether.

    Attributes
    ----------
    tethers
        The tether where the robot is, at the resolutions of the mission and of the judge.
    length
        Length of the tour so far, metres.
    """

    def __init__(self, spokes: Spokes) -> None:
        self.spokes = spokes
        one, other = spokes.contexts
        self.tethers, self.length = (one.present_tether, other.present_tether), 0.0
        self._place = spokes.places.present

    def to(self, n: int | None) -> tuple[Floats, float] | None:
        """Drive to a place, or home.

        Returns
        -------
        (ndarray of shape (k, 3), float) or None
            Path of the robot, and maximum length of the tether on it, metres. None if the tether
            does not fit, or would not come free; then the robot stays where it is.
        """
        at, spokes = self._place, self.spokes
        by_start = self._by_start(at, n)
        one, other = (context.start_tether for context in spokes.contexts)
        if n is None:
            return self._go(by_start, n, (one, other))
        spoke = spokes.to_place(n)
        assert spoke is not None
        paths = [by_start] if at is None else [spokes.leg(at, n), by_start]
        for path in paths:
            gone = self._go(path, n, spoke.tethers)
            if gone is not None:
                return gone
        return self._go_and_return(by_start, n, (one, other))

    def _by_start(self, at: int | None, n: int | None) -> Floats:
        """Return the path (k, 3) back to the start along one spoke and out along another."""
        start = np.asarray(self.spokes.context.mission.start, dtype=float)
        parts = [np.array([start, start])]
        if at is not None:
            parts.insert(0, self._path_out(at)[::-1])
        if n is not None:
            parts.append(self._path_out(n))
        line = np.vstack(parts)
        is_new = np.r_[True, (np.diff(line, axis=0) != 0.0).any(axis=1)]
        return line[is_new] if np.count_nonzero(is_new) > 1 else line[:2]

    def _path_out(self, n: int) -> Floats:
        """Return the path (k, 3) from the start to a place, metres."""
        spoke = self.spokes.to_place(n)
        assert spoke is not None
        return spoke.path

    def _go(
        self, path: Floats, n: int | None, expected: tuple[Tether, Tether]
    ) -> tuple[Floats, float] | None:
        """Drive along a path if the tether comes to hang as expected."""
        driven = self._driven(path)
        if driven is None:
            return None
        tethers, longest = driven
        delta = self.spokes.context.mission.delta
        if not all(hang_alike(t, e, delta) for t, e in zip(tethers, expected, strict=True)):
            return None
        return self._arrive(path, n, tethers, longest)

    def _go_and_return(
        self, by_start: Floats, n: int, free: tuple[Tether, Tether]
    ) -> tuple[Floats, float] | None:
        """Drive along a path by the start if the tether comes free back along the spoke;
        the spoke has the tether that was driven from then on."""
        driven = self._driven(by_start)
        if driven is None:
            return None
        tethers, longest = driven
        returning = _Drive(self.spokes)
        returning.tethers, returning._place = tethers, n
        if returning._go(self._by_start(n, None), None, free) is None:
            return None
        self.spokes.replace(n, tethers)
        return self._arrive(by_start, n, tethers, longest)

    def _arrive(
        self, path: Floats, n: int | None, tethers: tuple[Tether, Tether], longest: float
    ) -> tuple[Floats, float]:
        """Move the robot to the end of a path."""
        self.tethers, self._place = tethers, n
        self.length += polylines.length(path)
        return path, longest

    def _driven(self, path: Floats) -> tuple[tuple[Tether, Tether], float] | None:
        """Return the tethers after a path, and the maximum length meanwhile, if the robot has room,
        the tether keeps its limit, and both resolutions agree on its lengths as the judge asks."""
        spokes, mission = self.spokes, self.spokes.context.mission
        if not keeps_clearance(spokes.context.field, path, mission):
            return None
        tethers, longest = [], []
        for context, tether in zip(spokes.contexts, self.tethers, strict=True):
            after, on_path = context.drive(tether, path, is_fine=True)
            if on_path > spokes.limit:
                return None
            tethers.append(after)
            longest.append(on_path)
        for a, b in (longest, [t.length for t in tethers]):
            if abs(a - b) > mission.delta + spokes.judge.max_length_error * a:
                return None
        return (tethers[0], tethers[1]), longest[0]


def drive_spoke_orders(
    spokes: Spokes, clock: Clock, seed: int = 0, policy: OrderPolicy | None = None
) -> Iterator[DrivenTour]:
    """Drive tours in the shortest orders along spokes.

    The cost of a leg between near places is its length along the two spokes, pulled taut; others
    lead through the start. Legs on which the tether does not fit cost the path through the start in
    the next round.

    Parameters
    ----------
    clock : Clock
        When it is up, there are no more tours.
    policy : OrderPolicy, optional
        Effort; by default that of the context.

    Yields
    ------
    DrivenTour
        Each tour that is shorter than those before, or visits more waypoints.
    """
    policy, places = policy or spokes.context.policy.orders, spokes.places
    usable = [n for n in range(len(places)) if spokes.to_place(n) is not None]
    if clock.is_up or not usable or (places.present is not None and len(usable) < 2):
        return
    costs = _spoke_costs(spokes, usable, clock)
    best: DrivenTour | None = None
    driven_orders: set[tuple[int, ...]] = set()
    for _ in range(policy.max_rounds):
        order = _solve_order(costs, usable, places, Clock(policy.max_solve_s, within=clock), seed)
        if order is None or tuple(order) in driven_orders:
            return
        driven_orders |= {tuple(order), tuple(order[::-1])}
        for direction in (order, order[::-1])[: 1 if places.present is not None else 2]:
            driven = spokes.drive(direction, clock)
            if driven is None:
                continue
            _update_costs(costs, usable, places, direction, driven)
            if best is None or _sort_key(driven) < _sort_key(best):
                best = driven
                yield driven


def _sort_key(driven: DrivenTour) -> tuple[int, float]:
    """Return the sort key of a tour: more stops first, then the shorter tour."""
    return -len(driven.visits), driven.length


def _spoke_costs(spokes: Spokes, usable: list[int], clock: Clock) -> Floats:
    """Return the lengths (n + 1, n + 1) of legs along spokes, metres; row 0 is the start."""
    spokes_found = [spokes.to_place(n) for n in usable]
    lengths = np.array([0.0, *(polylines.length(s.path) for s in spokes_found if s is not None)])
    costs = np.asarray(lengths[:, None] + lengths[None, :])
    distances = spokes.places.distances[np.ix_(usable, usable)]
    count = min(spokes.context.policy.states.n_neighbours, len(usable) - 1)
    nearest = np.argsort(distances, axis=1, kind="stable")[:, :count]
    pairs = sorted(
        {(min(u, int(v)), max(u, int(v))) for u in range(len(usable)) for v in nearest[u]},
        key=lambda pair: float(distances[pair]),
    )
    for u, v in pairs:
        if clock.is_up:
            break
        if np.isfinite(distances[u, v]):
            length = polylines.length(spokes.leg(usable[u], usable[v]))
            costs[u + 1, v + 1] = costs[v + 1, u + 1] = min(length, costs[u + 1, v + 1])
    np.fill_diagonal(costs, 0.0)
    return costs


def _solve_order(
    costs: Floats, usable: list[int], places: Places, clock: Clock, seed: int
) -> list[int] | None:
    """Return the places of the shortest tour by costs; None if the time is up."""
    waypoint = places.waypoint[usable]
    cluster = np.r_[0, 1 + np.unique(waypoint, return_inverse=True)[1]]
    graph, first = TravelGraph.from_costs(costs, cluster), 1
    if places.present is not None:
        graph, first = from_state(graph, 1 + usable.index(places.present)), 2
    result = solve_graph(graph, "auto", time_limit=clock, seed=seed)
    return None if result.tour is None else [usable[v - 1] for v in result.tour[first:]]


def _update_costs(
    costs: Floats, usable: list[int], places: Places, order: list[int], driven: DrivenTour
) -> None:
    """Replace the costs of legs by the lengths that they were driven with."""
    row_of = {int(places.waypoint[n]): 1 + usable.index(n) for n in order}
    row = 0 if places.present is None else 1 + usable.index(places.present)
    for visit in driven.visits:
        column = row_of[visit.waypoint]
        costs[row, column] = costs[column, row] = polylines.length(visit.path)
        row = column
