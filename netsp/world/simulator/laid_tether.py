"""Tether at the beginning of a mission: at the start, or as its state has it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.world.mission.mission import Mission
from netsp.world.paths.tree import Grid, ShortestTree, pull_taut
from netsp.world.planner.planner import Tethers
from netsp.world.scene.field import DistanceField, pushed_out
from netsp.world.tether import Tether

STATE_TETHER_DEPTH = 0.25
"""Tolerance for the depth of a state's tether in a solid, as a share of delta. Edges of a taut
tether cut into surfaces by an eighth (docs/theory/tether.md), and files round them."""


def first_tether(mission: Mission, field: DistanceField, model: Tethers, grid: Grid) -> Tether:
    """Return the tether with the robot at the start.

    It is straight, or, without a line of sight, along the shortest path from the anchor.

    Raises
    ------
    InputError
        Anchor or start lie inside a solid, or in different parts of the water.
    """
    anchor = field.free_point(mission.anchor, "anchor")
    start = field.free_point(mission.start, "start")
    if field.line_of_sight(anchor, start, depth=0.125 * mission.delta):
        return model.start(anchor, start)
    path = ShortestTree(grid, start, anchor[None]).path(0)
    if path is None:
        raise InputError(
            f"start: no path in the water leads from the anchor {_shown(anchor)} to "
            f"{_shown(start)} at the clearance {mission.clearance:g}"
        )
    path = pull_taut(field, path, 0.0, mission.delta)
    return model.drive(model.start(anchor, anchor), path[1:])[0]


def present_tether(mission: Mission, field: DistanceField, model: Tethers, grid: Grid) -> Tether:
    """Return the tether at the beginning of a mission: `first_tether`, or that of its state.

    The latter is pulled taut as if the robot had travelled along the line of the state.

    Raises
    ------
    InputError
        `first_tether` raises it, the state lies inside a solid, or its tether passes through one or
        is over the limit.
    """
    if mission.state is None:
        return first_tether(mission, field, model, grid)
    anchor = field.free_point(mission.anchor, "anchor")
    robot = field.free_point(mission.state.position, "state.position")
    line = np.vstack([anchor, np.array(mission.state.tether)[1:-1].reshape(-1, 3), robot])
    for k, (a, b) in enumerate(pairwise(line)):
        if not field.line_of_sight(a, b, depth=STATE_TETHER_DEPTH * mission.delta):
            raise InputError(
                f"state.tether: passes through a solid between points {k} and {k + 1}, "
                f"{_shown(a)} and {_shown(b)}; expected a line in the water"
            )
    line[1:-1] = pushed_out(field, line[1:-1], 1e-3)
    tether = model.drive(model.start(anchor, anchor), line[1:])[0]
    if tether.length > mission.tether_length:
        raise InputError(
            f"state.tether: takes {tether.length:.4g} m when it is taut; expected no more than "
            f"tether_length, {mission.tether_length:g}"
        )
    return tether


def _shown(point: Floats) -> str:
    return f"({', '.join(f'{v:g}' for v in point)})"
