"""Counts of the points, cells or faces of a file that are used, and left out by reason."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.errors import counted


@dataclass(frozen=True)
class Tally:
    """Counts of the parts of a file.

    Parameters
    ----------
    part : str
        Name of one part: point, cell, face, part of a mesh.
    total : int
        Number of parts of the file.
    used : int
        Number of parts in the scene.
    left_out : tuple of (str, int)
        Reasons, and the number of parts left out for each.

    Raises
    ------
    ValueError
        Some parts are neither used nor left out.

    Examples
    --------
    >>> Tally("point", 5, 3, (("marked as withheld", 2),)).note
    '3 of 5 points used'
    """

    part: str
    total: int
    used: int
    left_out: tuple[tuple[str, int], ...] = ()

    def __post_init__(self) -> None:
        named = self.used + sum(count for _, count in self.left_out)
        if named != self.total:
            raise ValueError(f"expected {self.total} {self.part}s used or left out, got {named}")

    @property
    def note(self) -> str:
        """Statement of how many parts are used; empty if all are."""
        if not self.left_out:
            return ""
        return f"{self.used} of {counted(self.total, self.part)} used"
