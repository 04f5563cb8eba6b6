"""Policies of groups of words, and of measures of entanglement."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class CompletionPolicy:
    """Limits of the completion of rules (Knuth & Bendix). A group that reaches one is not exact.

    Attributes
    ----------
    max_rules
        Maximum number of rules.
    max_side
        Maximum number of letters in the longer side of a rule; longer rules are dropped.
    max_overlaps
        Maximum number of overlaps of two rules that are examined.
    """

    max_rules: int = 100
    max_side: int = 16
    max_overlaps: int = 5000

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class MeasurePolicy:
    """Accuracy of measures of entanglement.

    Attributes
    ----------
    contact_depth
        Depth by which a tether may enter an obstacle that it touches, as a share of the problem's
        size.
    sagitta
        Distance between an arc and its chords, as a share of the largest obstacle. Within it, a
        path that retraces an arc does not count as crossing itself.
    visibility_points
        Number of points along a tether, besides its vertices, that lines of sight may join.
    """

    contact_depth: float = 1e-6
    sagitta: float = 1e-3
    visibility_points: int = 120

    def __post_init__(self) -> None:
        check_positive(self)
