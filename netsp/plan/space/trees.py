"""States that a tether reaches from waypoint to waypoint along trees of short legs.

A tour around a tree leaves its tether free, and short tours stay near such trees. The states along
such a tour need not have the shortest words of their waypoints, nor hang as the shortest tethers
do. So the tether is driven along a few trees between the tree of the shortest legs and that of the
shortest paths from the start (Prim and Dijkstra; the trade-off between the two is that of Alpert et
al. 1995, IEEE Trans. CAD 14(7)).
"""

from __future__ import annotations

import heapq

from netsp.base.clock import Clock
from netsp.base.geometry import polylines
from netsp.plan.space.space_legs import RobotPaths
from netsp.plan.space.states import States


def add_states_of_trees(states: States, robot_paths: RobotPaths, clock: Clock) -> None:
    """Drive the tether along trees, and add the states in which it arrives, beyond the maximum per
    place.

    Parameters
    ----------
    clock : Clock
        When it is up, the remaining trees are left out.
    """
    max_per_place, trade_offs = states.max_per_place, states.context.policy.states.tree_trade_offs
    states.max_per_place += len(trade_offs)
    roots = [
        min(numbers, key=lambda s: states.entries[s].tether.length)
        for numbers in states.at_place.values()
        if numbers
    ]
    for trade_off in trade_offs:
        _grow(states, robot_paths, clock, roots, trade_off)
    states.max_per_place = max_per_place


def _grow(
    states: States, robot_paths: RobotPaths, clock: Clock, roots: list[int], trade_off: float
) -> None:
    """Grow one tree from the states with the shortest tethers, and drive the tether along it."""
    context = states.context
    # (key, tie, distance from the start, state, place, path); path -1 stands for a root itself
    waiting: list[tuple[float, int, float, int, int, int]] = []
    for s in roots:
        distance = states.entries[s].tether.length
        waiting.append(
            (distance * (1.0 + trade_off), len(waiting), distance, s, states.entries[s].place, -1)
        )
    heapq.heapify(waiting)
    tie, settled = len(waiting), set()
    while waiting and not clock.is_up:
        _, _, distance, s, point, k = heapq.heappop(waiting)
        if point in settled:
            continue
        arrived: int | None = s
        if k >= 0:
            word, path = robot_paths.between(states.entries[s].place, point)[k]
            tether, longest = context.drive(states.entries[s].tether, path)
            if longest > states.limit:
                continue
            word = context.words.multiply(states.entries[s].word, word)
            arrived = states.find(point, word, tether)
            if arrived is None:
                arrived = states.add(point, word, tether)
        if arrived is None:
            continue
        settled.add(point)
        for m in robot_paths.neighbours[point]:
            if int(m) in settled:
                continue
            for j, (_, path) in enumerate(robot_paths.between(point, int(m))):
                leg = polylines.length(path)
                tie += 1
                key = leg + trade_off * (distance + leg)
                heapq.heappush(waiting, (key, tie, distance + leg, arrived, int(m), j))
