"""Policy of the judge: how it draws obstacles, and how long it searches for contacts."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive, check_shares


@dataclass(frozen=True)
class JudgePolicy:
    """Policy of the judge's geometry. It changes no tolerance.

    Attributes
    ----------
    max_inset_share
        Maximum part of a radius, or of the room at a corner, by which an inset obstacle is smaller.
        The rest, three fifths of a thin wall, still stops every path.
    circle_sides
        Edges of the polygon that stands for a circle. They decide on which side a path passes;
        lengths come from the circles themselves.
    corner_sides
        Edges of the polygon that stands for the whole circle around a corner at the distance of the
        clearance.
    min_clearance_ratio
        Ratio of the clearance to the place tolerance up to which polygons are not grown: their
        rounded corners would consist of rounding errors.
    phase
        Rotation of the polygons that stand for circles, as a part of an edge. An odd number keeps
        symmetric worlds from degenerate triangles.
    max_contact_changes
        Maximum number of contacts that are added or removed before an exact length is given up.
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
