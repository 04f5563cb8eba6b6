"""Tours in short orders: estimate the lengths of legs, solve for an order, and drive it.

The estimate of a leg is the straight distance, and more if a solid stands between its ends. The
planner `predictive` drives the order in both directions (`netsp.plan.space.given_order`). The
lengths of the driven legs replace their estimates, and the next round begins. Each round takes
about as long as driving one tour, which is far less than a search for states. The tours have no
proof.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.base.geometry import polylines
from netsp.plan.solve_problem import solve_graph
from netsp.plan.space.board import DrivenTour
from netsp.plan.space.given_order import drive_order
from netsp.plan.space.mission_policy import OrderPolicy
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext, is_straight_clear
from netsp.roadmap.from_state import from_state
from netsp.roadmap.travel_graph import TravelGraph


def short_order_tour(
    context: PlanningContext,
    places: Places,
    clock: Clock,
    seed: int = 0,
    policy: OrderPolicy | None = None,
) -> DrivenTour | None:
    """Drive tours in short orders, and return the best.

    Parameters
    ----------
    clock : Clock
        Clock of the run; when it is up, the best tour so far is returned.
    policy : OrderPolicy, optional
        Effort; by default that of the context.

    Returns
    -------
    DrivenTour or None
        The tour with the most visits, and of these the shortest; None if no order can be driven.
    """
    policy = policy or context.policy.orders
    clock = clock.part(policy.time_share)
    estimates = _estimate_lengths(context, places, clock, policy)
    best: DrivenTour | None = None
    driven_orders: set[tuple[int, ...]] = set()
    for _ in range(policy.max_rounds):
        order = _solve_order(estimates, places, Clock(policy.max_solve_s, within=clock), seed)
        if order is None or tuple(order) in driven_orders:
            return best
        driven_orders |= {tuple(order), tuple(order[::-1])}
        # a mission under way has one direction: from the robot to the start
        for direction in (order, order[::-1])[: 1 if places.present is not None else 2]:
            if clock.is_up:
                return best
            driven = drive_order(
                context,
                [(int(n), int(c)) for n, c in _waypoints_and_choices(places, direction)],
                clock,
            )
            if driven is None:
                continue
            _update_estimates(estimates, places, direction, driven)
            if best is None or _sort_key(driven) < _sort_key(best):
                best = driven
    return best


def _sort_key(driven: DrivenTour) -> tuple[int, float]:
    """Return the sort key of a tour: more stops first, then the shorter tour."""
    return -len(driven.visits), driven.length


def _waypoints_and_choices(places: Places, order: list[int]) -> Ints:
    """Return the waypoint and the choice of each place of an order, shape (n, 2)."""
    return np.column_stack([places.waypoint[order], places.choice[order]])


def _estimate_lengths(
    context: PlanningContext, places: Places, clock: Clock, policy: OrderPolicy
) -> Floats:
    """Return the estimated lengths (n + 1, n + 1) of legs; row 0 is the start, then places."""
    points = np.vstack([context.mission.start, places.points])
    lengths = np.linalg.norm(points[:, None] - points[None], axis=2)
    if len(points) > policy.max_sighted + 1:
        return np.asarray(lengths)
    for u in range(len(points)):
        if clock.is_up:
            break
        for v in range(u):
            if not is_straight_clear(
                context.field, points[u], points[v], context.mission.clearance
            ):
                lengths[u, v] = lengths[v, u] = policy.blocked_ratio * lengths[u, v]
    return np.asarray(lengths)


def _solve_order(estimates: Floats, places: Places, clock: Clock, seed: int) -> list[int] | None:
    """Return the places of the shortest tour by estimates; None if the time is up."""
    cluster = np.r_[0, 1 + places.waypoint]
    graph, first = TravelGraph.from_costs(estimates, cluster), 1
    if places.present is not None:
        graph, first = from_state(graph, 1 + places.present), 2
    result = solve_graph(graph, "auto", time_limit=clock, seed=seed)
    return None if result.tour is None else [v - 1 for v in result.tour[first:]]


def _update_estimates(
    estimates: Floats, places: Places, order: list[int], driven: DrivenTour
) -> None:
    """Replace the estimates of legs by the lengths that they were driven with."""
    place_of = {places.waypoint[n]: 1 + n for n in order}
    row = 0 if places.present is None else 1 + places.present
    for visit in driven.visits:
        column = place_of[visit.waypoint]
        estimates[row, column] = estimates[column, row] = polylines.length(visit.path)
        row = column
    estimates[row, 0] = estimates[0, row] = polylines.length(driven.home)
