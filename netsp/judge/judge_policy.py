"""Policy of the judge: polygons that stand for obstacles, and the search for contacts."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive, check_shares


@dataclass(frozen=True)
class JudgePolicy:
    """Policy of the judge's geometry; tolerances do not depend on it.

    Attributes
    ----------
    max_inset_share
        Maximum distance by which an inset obstacle is smaller, as a share of a radius or of the
        room at a corner. A thin wall keeps three fifths of its thickness.
    circle_sides
        Number of edges of the polygon that stands for a circle. The polygon decides on which side a
        path passes; lengths come from the circle itself.
    corner_sides
        Number of edges of a full circle in the rounded corners of a grown polygon.
    min_clearance_ratio
        Ratio of the clearance to the place tolerance up to which polygons are not grown, because
        rounding errors would shape their rounded corners.
    phase
        Rotation of the polygons that stand for circles, as a share of an edge. An irregular value
        avoids degenerate triangles in symmetric worlds.
    max_contact_changes
        Maximum number of contacts that are added or removed; then bounds replace the exact length.
    """

    max_inset_share: float = 0.2
    circle_sides: int = 64
    corner_sides: int = 32
    min_clearance_ratio: float = 10.0
    phase: float = 0.2371
    max_contact_changes: int = 60

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "max_inset_share", "phase")
