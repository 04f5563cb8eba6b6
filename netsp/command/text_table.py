"""Tables of text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TextIO


def print_table(rows: Sequence[Sequence[str]], stream: TextIO) -> None:
    """Print rows with aligned columns, numbers to the right; the first row is the head.

    Parameters
    ----------
    rows : sequence of sequence of str
        Cells, as many in each row; the last column may be long.
    stream : file
        Where to print.

    Examples
    --------
    >>> import sys
    >>> print_table([("layer", "features"), ("piles", "12")], sys.stdout)
    layer  features
    piles        12
    """
    columns = list(zip(*rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    is_number = [all(cell.isdigit() or not cell for cell in column[1:]) for column in columns]
    for row in rows:
        cells = [
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, is_number, strict=True)
        ]
        print("  ".join(cells).rstrip(), file=stream)
