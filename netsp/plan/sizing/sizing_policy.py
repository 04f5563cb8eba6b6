"""Policy of the questions that are asked before a tour: tether, base, margins."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class SizingPolicy:
    """Policy of sizing. All numbers are positive.

    Attributes
    ----------
    max_candidates
        Maximum number of candidates for the base.
    max_measured_classes
        Maximum number of classes among which all legs are measured at the start, for all steps of a
        tether curve together. Among more, each solve measures what it needs.
    bisections
        Number of bisections for the largest error of the obstacles: 40 give it to 1e-12 of the
        first interval.
    """

    max_candidates: int = 10_000
    max_measured_classes: int = 1500
    bisections: int = 40

    def __post_init__(self) -> None:
        check_positive(self)
