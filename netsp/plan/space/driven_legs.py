"""Drive the tether along the legs of a given tour, and check that it may be flown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
        The tour with its tethers, and with its words if the context has words; None if a leg has no
        room for the robot or no word, the tether exceeds its limit, or it is not free at the end.
    """
    tether = context.present_tether
    limit = max(context.mission.tether_length, tether.length)
    visits: list[TourVisit] = []
    total = 0.0
    for leg in (*legs, LegTo(-1, 0, home)):
        if not keeps_clearance(context.field, leg.path, context.mission):
            return None
        tether, longest = context.drive(tether, leg.path, is_fine=True)
        if longest > limit:
            return None
        total += polylines.length(leg.path)
        if leg.waypoint >= 0:
            visits.append(
                TourVisit(leg.waypoint, leg.choice, None, tether.length, leg.path, longest)
            )
    if not hang_alike(tether, context.start_tether, context.mission.delta):
        return None
    driven = DrivenTour([], visits, np.asarray(home), total, True, None)
    return with_words(context, driven) if context.has_words else driven


def with_words(context: PlanningContext, driven: DrivenTour) -> DrivenTour | None:
    """Return a driven tour with the words of its tethers; None if a leg has no word, or the word at
    the end is not that of the tether at the start."""
    paths = [*(visit.path for visit in driven.visits), driven.home]
    *words, at_home = context.words_along(paths)
    is_free = at_home is not None and at_home == context.words.word(context.start_tether.nodes)
    if not is_free or None in words:
        return None
    visits = [replace(v, word=word) for v, word in zip(driven.visits, words, strict=True)]
    return replace(driven, visits=visits)
