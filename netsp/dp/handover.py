"""Handover of a proof from walks to cutting planes."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.number_ranges import check_not_negative


@dataclass(frozen=True)
class Handover:
    """Limits from which on cutting planes prove sooner than walks.

    Parameters
    ----------
    max_legs : int
        Maximum number of legs that is left to cuts however few labels walks have, because walks,
        which remember more and more, take longer. With 0 (no legs) walks go on to the end.
    max_legs_of_slow_walks : int
        Maximum number of legs that is left to cuts once walks have many labels. Cuts take a second
        or two for 10,000 legs.
    max_labels : int
        Number of labels in a pass above which walks are slow. A pass over 25,000 labels takes the
        interpreter about 0.2 s of CPU, and later passes take longer.
    """

    max_legs: int = 0
    max_legs_of_slow_walks: int = 0
    max_labels: int = 0

    def __post_init__(self) -> None:
        check_not_negative(self)

    def is_due(self, vertices: int, labels: int) -> bool:
        """Return whether cuts take over.

        Parameters
        ----------
        vertices : int
            Number of vertices left; all legs between them are measured.
        labels : int
            Number of labels in the last pass.
        """
        legs = vertices * (vertices - 1) // 2
        is_slow = labels > self.max_labels
        return legs <= self.max_legs or (is_slow and legs <= self.max_legs_of_slow_walks)
