"""Drive the tether along the legs of a given tour, and check that it may be flown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.plan.space.board import Driven, Stop
from netsp.plan.space.planning_context import Water, along, has_room
from netsp.plan.space.states import alike


@dataclass(frozen=True)
class LegTo:
    """Leg of a tour to a waypoint.

    Parameters
    ----------
    waypoint : int
        Number of the waypoint.
    choice : int
        Number of the alternative of the waypoint, from 1 on; 0 for the waypoint's position.
    path : ndarray, shape (k, 3)
        Path from the waypoint before, metres.
    """

    waypoint: int
    choice: int
    path: Floats


def drive_legs(water: Water, legs: Sequence[LegTo], home: Floats) -> Driven | None:
    """Drive the tether along the legs of a tour.

    Parameters
    ----------
    water : Water
        Where they are.
    legs : sequence of LegTo
        In the order of the tour; the first begins where the mission does.
    home : ndarray, shape (k, 3)
        From the last stop to the start, metres.

    Returns
    -------
    Driven or None
        The tour with its words and tethers; None where a leg has no room for the robot or no word,
        the tether exceeds its limit, or is not free at the end.
    """
    tether, word = water.present, water.number(water.present.nodes)
    limit = max(water.mission.tether_length, tether.length)
    stops: list[Stop] = []
    total = 0.0
    for leg in (*legs, LegTo(-1, 0, home)):
        writes = water.number(leg.path)
        if word is None or writes is None or not has_room(water.field, leg.path, water.mission):
            return None
        word = water.words.times(word, writes)
        tether, longest = water.driven(tether, leg.path, fine=True)
        if longest > limit:
            return None
        total += along(leg.path)
        if leg.waypoint >= 0:
            letters = water.words.letters(word)
            stops.append(Stop(leg.waypoint, leg.choice, letters, tether.length, leg.path, longest))
    free = word == water.number(water.laid.nodes)
    free = free and alike(tether, water.laid, water.mission.delta)
    return Driven([], stops, np.asarray(home), total, True, None) if free else None
