"""Handover of a proof from walks to cutting planes."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_not_negative


@dataclass(frozen=True)
class Handover:
    """Sizes of the rest of a proof at which cutting planes take over from walks.

    Parameters
    ----------
    max_legs : int
        Maximum number of remaining legs at which cuts take over at once, because they finish such a
        proof sooner than walks. With 0, walks go on to the end.
    max_legs_of_slow_walks : int
        Maximum number of remaining legs at which cuts take over if walks have become slow. For
        10,000 legs, cuts take a second or two.
    max_labels : int
        Number of labels in a pass above which walks count as slow. A pass over 25,000 labels takes
        about 0.2 s of CPU interpreted, and later passes take longer.
    """

    max_legs: int = 0
    max_legs_of_slow_walks: int = 0
    max_labels: int = 0

    def __post_init__(self) -> None:
        check_not_negative(self)

    def is_due(self, vertices: int, labels: int) -> bool:
        """Return whether cuts take over, by remaining vertices and labels of the last pass."""
        legs = vertices * (vertices - 1) // 2
        is_slow = labels > self.max_labels
        return legs <= self.max_legs or (is_slow and legs <= self.max_legs_of_slow_walks)
