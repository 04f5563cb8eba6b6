"""Rule by which the rest of a tour is repaired, in the plane as in space.

A tour that still holds is kept. Otherwise the order of the goals is kept and the paths to them
change, unless no such tour is found or one in a new order is worth the time that its planning
takes, while the robot holds its place. If there is neither, the robot falls back on what its world
allows: home along the tether in the plane, leg by leg in space.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

KEPT = "kept"
"""Response of a repair: the rest of the tour is kept."""

LOCAL = "local"
"""Response of a repair: the order is kept, with other paths or classes."""

REPLANNED = "replan"
"""Response of a repair: the rest of the tour is planned again."""

HOMEWARD = "home"
"""Response of a repair in the plane: no goal can be reached, so the robot goes home."""

BY_LEGS = "legs"
"""Response of a repair in space: no tour was found, so the planner searches leg by leg."""

SameOrder = TypeVar("SameOrder")
NewOrder = TypeVar("NewOrder")


def choose_repair(
    same_order: SameOrder | None, plan_new_order: Callable[[], NewOrder | None], fallback: str
) -> tuple[str, SameOrder | NewOrder | None]:
    """Return the response to a tour that no longer holds, and the tour to follow from now on.

    Parameters
    ----------
    same_order
        Tour through the remaining goals in the same order; None if there is none.
    plan_new_order
        Returns a tour in a new order if it is worth the time that it takes; None if not.
    fallback
        Response if there is no tour.
    """
    found = plan_new_order()
    if found is not None:
        return REPLANNED, found
    return (fallback if same_order is None else LOCAL), same_order
