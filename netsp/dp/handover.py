"""Handover of a proof from walks to cutting planes."""

from __future__ import annotations

from dataclasses import dataclass, fields

from netsp.errors import InputError


@dataclass(frozen=True)
class Handover:
    """Limits from which on cutting planes prove sooner than walks.

    Parameters
    ----------
    few_legs : int
        Maximum number of legs that is left to cuts at once, because walks, which remember more and
        more, take longer. With 0 (no legs) walks go on to the end.
    some_legs : int
        Maximum number of legs that is left to cuts once walks have many labels. Cuts take a second
        or two for 10,000 legs.
    max_labels : int
        Number of labels in a pass of the walks above which up to `some_legs` legs are left to cuts.
        A pass over 25,000 labels takes the interpreter about 0.2 s of CPU, and later passes take
        longer.
    """

    few_legs: int = 0
    some_legs: int = 0
    max_labels: int = 0

    def __post_init__(self) -> None:
        for field in fields(self):
            if not getattr(self, field.name) >= 0:
                raise InputError(
                    f"{field.name}: expected a number that is not negative, "
                    f"got {getattr(self, field.name)}"
                )

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
        return legs <= self.few_legs or (legs <= self.some_legs and labels > self.max_labels)
