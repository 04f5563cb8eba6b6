"""When walks leave the rest of a proof to cutting planes."""

from __future__ import annotations

from dataclasses import dataclass, fields

from netsp.errors import InputError


@dataclass(frozen=True)
class Handover:
    """Limits from which on cutting planes prove sooner than walks.

    Parameters
    ----------
    few_legs : int
        Most legs for which walks, which remember ever more, take longer than cuts. 0 leaves nothing
        to cuts.
    some_legs : int
        Most legs for which cuts take a second or two.
    max_labels : int
        Labels in a pass of the walks above which such a number of legs is left to cuts. A pass over
        25,000 takes the interpreter about 0.2 s of CPU, and the next ones take longer.
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
            Vertices left, all legs between them measured.
        labels : int
            Labels in the last pass.
        """
        legs = vertices * (vertices - 1) // 2
        return legs <= self.few_legs or (legs <= self.some_legs and labels > self.max_labels)
