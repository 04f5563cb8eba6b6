"""Drive the tether along the legs of a given tour, and check that it may be flown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.plan.space.board import DrivenTour, TourVisit
from netsp.plan.space.planning_context import PlanningContext, keeps_clearance
from netsp.plan.space.states import hang_alike


@dataclass(frozen=True)
class LegTo:
    """Leg of a tour to a waypoint.

    Attributes
    ----------
    waypoint
        Number of the waypoint.
    choice
        Number of its alternative, from 1 on; 0 for the position of the waypoint itself.
    path
        (k, 3) path from the waypoint before, metres.
    """

    waypoint: int
    choice: int
    path: Floats


def drive_legs(context: PlanningContext, legs: Sequence[LegTo], home: Floats) -> DrivenTour | None:
    """Drive the tether along the legs of a tour.

    Parameters
    ----------
    legs : sequence of LegTo
        Legs in the order of the tour; the first begins where the mission does.
    home : ndarray, shape (k, 3)
        Path from the last visit to the start, metres.

    Returns
    -------
    DrivenTour or None
        The tour with its words and tethers; None if a leg has no room for the robot or no word,
        the tether exceeds its limit, or it is not free at the end.
    """
    tether, word = context.present_tether, context.word_number(context.present_tether.nodes)
    limit = max(context.mission.tether_length, tether.length)
    visits: list[TourVisit] = []
    total = 0.0
    for leg in (*legs, LegTo(-1, 0, home)):
        leg_word = context.word_number(leg.path)
        if (
            word is None
            or leg_word is None
            or not keeps_clearance(context.field, leg.path, context.mission)
        ):
            return None
        word = context.words.multiply(word, leg_word)
        tether, longest = context.drive(tether, leg.path, is_fine=True)
        if longest > limit:
            return None
        total += polylines.length(leg.path)
        if leg.waypoint >= 0:
            letters = context.words.letters(word)
            visits.append(
                TourVisit(leg.waypoint, leg.choice, letters, tether.length, leg.path, longest)
            )
    is_free = word == context.word_number(context.start_tether.nodes)
    is_free = is_free and hang_alike(tether, context.start_tether, context.mission.delta)
    return DrivenTour([], visits, np.asarray(home), total, True, None) if is_free else None
