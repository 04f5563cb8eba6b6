"""Bracket of the tether's length in a run: at least, taut, and at most."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.plan.space.planning_context import PlanningContext
from netsp.world.mission.run_log import Run
from netsp.world.paths.tree import ShortestTree
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene
from netsp.world.tether import Tether
from netsp.world.tether.tether_bracket import BracketPolicy, HoldingTether


def bracket_run(
    run: Run, scene: Scene, field: DistanceField, policy: BracketPolicy = BracketPolicy()
) -> dict[str, Any] | None:
    """Return the lengths that the tether has at least and at most in a run, for its summary.

    Parameters
    ----------
    run : Run
        The run.
    scene, field : Scene, DistanceField
        Scene of the mission and its distance field.
    policy : BracketPolicy
        Friction that is assumed to hold the tether; the mission's friction, if that is larger.

    Returns
    -------
    dict or None
        `hold_friction`, the `longest` length that the tether has at most, metres, and the next
        `waypoint` there; `over_s`, the time over the limit if friction holds the tether; and in
        `stops` the lengths `at_least` and `at_most` at the waypoints where they differ by more than
        a hundredth of the taut length `tether`. None if the anchor moved or the scene changed.

    Raises
    ------
    InputError
        As `netsp.plan.space.space_signature.SpaceSignature.in_box`.
    """
    mission, log = run.mission, run.log
    if mission.track or run.scene is not None or run.tethers or not log:
        return None
    friction = max(policy.hold_friction, mission.tether.friction)
    model = HoldingTether(field, mission.delta, bracket=replace(policy, hold_friction=friction))
    context = replace(PlanningContext.for_mission(mission, scene, field), model=model)
    places = np.array([(r.x, r.y, r.z) for r in log])
    tether, arrivals = context.present_tether, _arrivals(run)
    rows = sorted(set(arrivals.values()))
    shorter = shortest_of_class(context, tether, places, rows, policy.rest_rounds)
    found = model.along(tether, places, stops=rows, shorter=shorter)
    low, taut, high = found.lower, found.taut, found.upper
    longest = int(high.argmax())
    times = np.diff([r.time for r in log], append=log[-1].time)
    limits = np.array([r.limit for r in log])
    return {
        "hold_friction": friction,
        "longest": float(high[longest]),
        "waypoint": int(log[longest].waypoint),
        "over_s": float(times[high > limits * (1.0 + 1e-9)].sum()),
        "stops": [
            {
                "waypoint": k,
                "at_least": float(low[n]),
                "tether": float(taut[n]),
                "at_most": float(high[n]),
            }
            for k, n in sorted(arrivals.items())
            if high[n] - low[n] > policy.min_shown_share * taut[n]
        ],
    }


def shortest_of_class(
    context: PlanningContext,
    tether: Tether,
    path: Floats,
    rows: list[int],
    rounds: int = BracketPolicy.rest_rounds,
) -> Mapping[int, Tether]:
    """Return the taut tethers along shortest paths that are of the class of a driven tether.

    Parameters
    ----------
    context : PlanningContext
        Words, grid and tether model of a mission.
    tether : Tether
        Tether where the path begins.
    path : ndarray, shape (n, 3)
        Path of the robot, metres.
    rows : list of int
        Indices of the points to look at, in order.
    rounds : int
        Maximum number of rounds in which a shortest path is pulled taut.

    Returns
    -------
    mapping of int to Tether
        A tether for each index at which the shortest path from the anchor has the word of the
        tether that was driven there.
    """
    words, found = context.words, dict[int, Tether]()
    if not rows:
        return found
    tree = ShortestTree(context.grid, tether.anchor, path[rows])
    word, broken = words.try_word(np.vstack([tether.nodes, path[:1]]))
    at = 0
    for n, row in enumerate(rows):
        piece, broken_here = words.try_word(path[at : row + 1])
        if broken is not None or broken_here is not None:
            break
        word, at = words.product(word, piece), row
        shortest = tree.path(n)
        if shortest is None:
            continue
        shortest_word, broken_there = words.try_word(shortest[::-1])
        if broken_there is None and shortest_word == word:
            found[row] = context.model.relaxed(shortest[::-1], rounds)
    return found


def _arrivals(run: Run) -> dict[int, int]:
    """Return the row of the log at which each visited waypoint was reached, by waypoint."""
    visited = {int(s["waypoint"]) for s in run.summary["stops"]}
    arrivals, passed = dict[int, int](), 0
    for n, row in enumerate(run.log):
        for k in range(passed, row.waypoint):
            if k in visited:
                arrivals[k] = n
        passed = max(passed, row.waypoint)
    return arrivals
