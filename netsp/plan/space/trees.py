"""States that a tether comes to in going from waypoint to waypoint, along trees of short legs.

A tour that goes around a tree leaves its tether free, and tours that are short stay near such
trees; but the states that it comes through need not be of the shortest words of their waypoints,
nor hang as the shortest tethers do. So the tether is driven along a few trees, between the one of
the shortest legs and the one of the shortest ways from the start (Prim and Dijkstra; the trade-off
between the two is that of Alpert et al. 1995, IEEE Trans. CAD 14(7)).
"""

from __future__ import annotations

import heapq

from netsp.base.clock import Clock
from netsp.plan.space.planning_context import along
from netsp.plan.space.space_legs import Ways
from netsp.plan.space.states import States


def states_of_trees(states: States, ways: Ways, clock: Clock) -> None:
    """Drive the tether along trees; where it arrives in a state that was not there, there is one
    more.

    Parameters
    ----------
    states : States
        The first ones; more are added, whatever the most of a waypoint.
    ways : Ways
        The robot's ways between waypoints.
    clock : Clock
        When it is up, trees are left as they are.
    """
    most, trade_offs = states.most, states.water.policy.states.tree_trade_offs
    states.most += len(trade_offs)
    roots = [min(of, key=lambda s: states.all[s].tether.length) for of in states.of.values() if of]
    for trade in trade_offs:
        _grow(states, ways, clock, roots, trade)
    states.most = most


def _grow(states: States, ways: Ways, clock: Clock, roots: list[int], trade: float) -> None:
    water = states.water
    # (key, tie, how far from the start, state, waypoint, way); a way of -1 is straight to a root
    waiting: list[tuple[float, int, float, int, int, int]] = []
    for s in roots:
        far = states.all[s].tether.length
        waiting.append((far * (1.0 + trade), len(waiting), far, s, states.all[s].point, -1))
    heapq.heapify(waiting)
    tie, settled = len(waiting), set()
    while waiting and not clock.up:
        _, _, far, s, point, k = heapq.heappop(waiting)
        if point in settled:
            continue
        arrived: int | None = s
        if k >= 0:
            word, path = ways.known(states.all[s].point, point)[k]
            tether, longest = water.driven(states.all[s].tether, path)
            if longest > states.limit:
                continue
            word = water.words.times(states.all[s].word, word)
            arrived = states.find(point, word, tether)
            if arrived is None:
                arrived = states.add(point, word, tether)
        if arrived is None:
            continue
        settled.add(point)
        for m in ways.near[point]:
            if int(m) in settled:
                continue
            for j, (_, path) in enumerate(ways.known(point, int(m))):
                leg = along(path)
                tie += 1
                key = leg + trade * (far + leg)
                heapq.heappush(waiting, (key, tie, far + leg, arrived, int(m), j))
