"""Tables in text files, of any separator, decimal sign and order of columns."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.columns import MAP_PAIRS, WITHOUT_UNIT, Column, Quantity, column, meanings
from netsp.base.errors import InputError
from netsp.base.field_types import LARGEST
from netsp.base.files import csv_lines, read_bytes, read_gzip
from netsp.base.validated import shown


@dataclass(frozen=True)
class Table:
    """Table of a text file, with its columns by the quantities that they hold.

    Parameters
    ----------
    source : str
        Name of the file, for messages.
    head : tuple of str
        Names of the columns as they are written; empty for a table without a head.
    columns : mapping
        Position and meaning of each column with a known name, by quantity.
    unused : tuple of str
        Names of the other columns.
    rows : list of list of str
        Cells.
    lines : list of int
        Number of each row's line in the file, from 1.
    has_decimal_commas : bool
        Whether numbers are written as ``1,5``.
    """

    source: str
    head: tuple[str, ...]
    columns: Mapping[Quantity, tuple[int, Column]]
    unused: tuple[str, ...]
    rows: list[list[str]] = field(repr=False)
    lines: list[int] = field(repr=False)
    has_decimal_commas: bool = False

    def __contains__(self, quantity: object) -> bool:
        return quantity in self.columns

    def text(self, row: int, quantity: Quantity) -> str:
        """Return a cell without blanks around it; empty if there is none."""
        if quantity not in self.columns:
            return ""
        k = self.columns[quantity][0]
        cells = self.rows[row]
        return cells[k].strip() if k < len(cells) else ""

    def plain(self, row: int, quantity: Quantity) -> str:
        """Return the text of a number with a decimal point."""
        text = self.text(row, quantity)
        return text.replace(",", ".") if self.has_decimal_commas and _COMMA.match(text) else text

    def number(self, row: int, quantity: Quantity) -> float:
        """Return a number in metres, degrees or seconds, z upwards.

        Raises
        ------
        InputError
            The cell is no finite number.
        """
        try:
            value = float(self.plain(row, quantity))
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST:
            raise InputError(
                f"{self.source}: line {self.lines[row]}: {self.title(quantity)}: expected a "
                f"number, got {shown(self.text(row, quantity))}"
            )
        return value * self.columns[quantity][1].factor + 0.0

    def title(self, quantity: Quantity) -> str:
        """Return the name of the column with a quantity as the file writes it."""
        if quantity in self.columns and self.head:
            return self.head[self.columns[quantity][0]].strip()
        return str(quantity)

    def numbers(self, quantities: Sequence[Quantity]) -> Floats:
        """Return columns of numbers (n, k) in metres, degrees or seconds, z upwards.

        Raises
        ------
        InputError
            A cell is no finite number.
        """
        values = self._numbers(quantities)
        if "z" in quantities:
            self.check_depths(values[:, list(quantities).index("z")])
        return values

    def check_depths(self, z: Floats) -> None:
        """Refuse a column of depths, given as metres upwards (n,), that holds heights: no value
        below 0.

        Raises
        ------
        InputError
            All values count upwards.
        """
        if self.columns["z"][1].factor < 0.0 and len(z) and z.min() >= 0.0 and z.max() > 0.0:
            raise InputError(
                f"{self.source}: column {shown(self.title('z'))} holds negative numbers only, and "
                "depths count downwards; expected positive depths, or the name z for heights"
            )

    def _numbers(self, quantities: Sequence[Quantity]) -> Floats:
        places = [self.columns[q][0] for q in quantities]
        factors = np.array([self.columns[q][1].factor for q in quantities])
        try:
            cells = [[row[k] for k in places] for row in self.rows]
            if self.has_decimal_commas:
                cells = [[c.replace(",", ".") for c in row] for row in cells]
            values = np.array(cells, dtype=float).reshape(len(cells), len(places))
            if (np.abs(values) <= LARGEST).all():
                return np.asarray(values * factors + 0.0)
        except (ValueError, IndexError):
            pass
        return np.array(
            [[self.number(k, q) for q in quantities] for k in range(len(self.rows))]
        ).reshape(len(self.rows), len(places))

    def pair(
        self, pairs: Sequence[tuple[Quantity, Quantity]] = MAP_PAIRS
    ) -> tuple[Quantity, Quantity] | None:
        """Return the first pair of quantities that the table holds, the preferred one first, or
        None."""
        return next((p for p in pairs if p[0] in self and p[1] in self), None)

    def height(self) -> Quantity | None:
        """Return the quantity that holds z: `z` (perhaps from depths), else `altitude`, or None."""
        if "z" in self:
            return "z"
        return "altitude" if "altitude" in self else None

    def wanted(self, text: str) -> InputError:
        """Return an error that states which columns were expected and which there are."""
        got = ", ".join(name.strip() for name in self.head) if self.head else "no names of columns"
        return InputError(f"{self.source}: expected {text}, got {shown(got)}")

    def left_out(self, quantities: Sequence[Quantity]) -> tuple[str, ...]:
        """Return the names of the columns that hold none of the quantities that a reader uses."""
        known = [self.title(q) for q in self.columns if q not in quantities]
        return (*known, *self.unused)

    def notes(self, quantities: Sequence[Quantity], max_length: int = 200) -> list[str]:
        """Return notes on decimal commas, and on columns without the quantities that the reader
        uses.

        `max_length` is the maximum number of characters for the names of unused columns.
        """
        out = ["numbers are read with decimal commas"] if self.has_decimal_commas else []
        names = [shown(name) if "," in name else name for name in self.left_out(quantities)]
        return out + ([f"unused columns: {', '.join(names)[:max_length]}"] if names else [])


_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?$")
_POINT = re.compile(r"[-+]?(\d+\.\d*|\.\d+)([eE][-+]?\d+)?$")
_WHOLE = re.compile(r"[-+]?\d+$")


def decode_text(data: bytes, source: str) -> str:
    """Return the text of a file in UTF-8, or in UTF-16 with a byte order mark, without the mark.

    Raises
    ------
    InputError
        Another encoding.
    """
    is_wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return data.decode("utf-16" if is_wide else "utf-8-sig").removeprefix("\ufeff")
    except UnicodeDecodeError:
        raise InputError(f"{source}: not a text file in UTF-8") from None


def read_table(
    file: str | Path,
    *,
    positional: Sequence[Quantity] = (),
    text: str | None = None,
    sample_lines: int = 1000,
) -> Table:
    """Read a table of any separator, decimal sign and order of columns.

    Parameters
    ----------
    file : str or Path
        Table in UTF-8 (or UTF-16 with a byte order mark), perhaps packed (``.gz``); separated by
        semicolons, tabs, commas or blanks. Lines that begin with ``#`` or ``//`` are comments; the
        last of them before the first row may name the columns.
    positional : sequence of str
        Quantities of the first columns of a table without a head; empty to refuse such a table.
    text : str, optional
        Contents of the file, where they have been read already.
    sample_lines : int
        Number of lines that decide the separator and the decimal sign; later lines must agree.

    Raises
    ------
    InputError
        Unreadable or ambiguous: two columns for one quantity, decimal commas between commas, mixed
        decimal signs, rows longer than the head.
    """
    source = str(file)
    if text is None:
        is_packed = source.lower().endswith(".gz")
        text = decode_text(read_gzip(file) if is_packed else read_bytes(file), source)
    numbered, comment = _content(text)
    if not numbered:
        raise InputError(f"{source}: expected a table, got nothing")
    separator = _separator(numbered, source, sample_lines)
    rows, lines = _cells(numbered, separator, source)
    head: tuple[str, ...] = ()
    if not any(_is_number(cell) for cell in rows[0]):
        head, rows, lines = tuple(rows[0]), rows[1:], lines[1:]
    elif comment is not None:
        names = _comment_head(comment, separator)
        if len(names) >= len(rows[0]) or len(names) >= 3:
            head = names
    if head:
        columns, unused = meanings(head, source)
        _check_widths(rows, lines, len(head), separator, source)
    else:
        columns = _by_position(rows, positional, source, sample_lines)
        unused = tuple(f"column {k + 1}" for k in range(len(positional), max(map(len, rows))))
        if not positional:
            raise InputError(
                f"{source}: line {lines[0]}: expected the names of the columns first, got "
                f"{shown(', '.join(rows[0]))}"
            )
    used = [k for q, (k, _) in columns.items() if q not in WITHOUT_UNIT]
    commas = _decimal_commas(rows, lines, used, source, sample_lines)
    if not head and separator == "," and not commas:
        _check_commas(rows, lines, source, sample_lines)
    return Table(source, head, columns, unused, rows, lines, commas)


def _content(text: str) -> tuple[list[tuple[int, str]], str | None]:
    """Return the numbered lines that are no comments, and the last comment before them."""
    numbered: list[tuple[int, str]] = []
    comment = None
    for number, line in enumerate(text.splitlines(), 1):
        bare = line.strip()
        if not bare.strip(",;"):
            continue
        if bare.startswith(("#", "//")):
            if not numbered:
                comment = bare.lstrip("#/! ").strip()
            continue
        numbered.append((number, line))
    return numbered, comment


def _separator(numbered: Sequence[tuple[int, str]], source: str, sample_lines: int) -> str:
    """Return the separator of a table: a semicolon, a tab, a comma or a blank."""
    first = numbered[0][1].strip()
    stated = re.fullmatch(r"sep=(.)", first.lower())
    if stated and isinstance(numbered, list):
        numbered.pop(0)
        if not numbered:
            raise InputError(f"{source}: expected a table, got nothing")
        return str(stated[1])
    sample = [line for _, line in numbered[:sample_lines]]
    for mark in (";", "\t"):
        if all(mark in line for line in sample):
            return mark
    if not any("," in line for line in sample):
        return " "
    body = [line.split() for line in sample[1:] or sample]
    are_numbers = all(
        len(cells) > 1 and all(_COMMA.match(c) or _WHOLE.match(c) for c in cells) for cells in body
    )
    if are_numbers and any("," in c for cells in body for c in cells):
        return " "
    if "," in first:
        return ","
    return " " if len(first.split()) > 1 else ","


def _cells(
    numbered: Sequence[tuple[int, str]], separator: str, source: str
) -> tuple[list[list[str]], list[int]]:
    lines = [number for number, _ in numbered]
    if separator == " ":
        return [line.split() for _, line in numbered], lines
    if not any('"' in line for _, line in numbered):
        return [line.strip("\r\n").split(separator) for _, line in numbered], lines
    text = "\n".join(line for _, line in numbered)
    if separator == ",":
        rows = list(csv_lines(text, source))
    else:
        try:
            rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=separator))
        except csv.Error as error:
            raise InputError(f"{source}: {error}") from None
    if len(rows) != len(lines):
        raise InputError(f"{source}: expected each row of the table on one line")
    return rows, lines


def _comment_head(comment: str, separator: str) -> tuple[str, ...]:
    """Return the names in a comment, where they name coordinates; else nothing."""
    for mark in (separator, ",", ";", "\t", " "):
        names = tuple(n.strip() for n in (comment.split() if mark == " " else comment.split(mark)))
        found = {c.quantity for n in names if n and (c := column(n)) is not None}
        pairs = (*MAP_PAIRS, ("latitude", "longitude"))
        if any(found.issuperset(pair) for pair in pairs):
            return names
    return ()


def _by_position(
    rows: Sequence[Sequence[str]], positional: Sequence[Quantity], source: str, sample_lines: int
) -> dict[Quantity, tuple[int, Column]]:
    """Return the columns of a table without a head."""
    width = min(map(len, rows))
    sample = rows[:sample_lines]
    if width > len(positional) > 0 and len(sample) > 2:
        first = [cells[0].strip() for cells in sample]
        if all(_WHOLE.match(c) for c in first):
            steps = {b - a for a, b in zip(map(int, first), map(int, first[1:]), strict=False)}
            if len(steps) == 1 and steps.pop() > 0:
                raise InputError(
                    f"{source}: the first column seems to number the rows; expected the names of "
                    "the columns in the first line"
                )
    return {q: (k, Column(q)) for k, q in enumerate(positional) if k < width}


def _check_widths(
    rows: Sequence[Sequence[str]], lines: Sequence[int], width: int, separator: str, source: str
) -> None:
    """Refuse rows with more cells than the head has."""
    for line, cells in zip(lines, rows, strict=True):
        if len(cells) > width and any(c.strip() for c in cells[width:]):
            hint = "; decimal commas need semicolons between the cells" if separator == "," else ""
            raise InputError(
                f"{source}: line {line}: expected {width} cells as the head has, got "
                f"{len(cells)}{hint}"
            )


def _decimal_commas(
    rows: Sequence[Sequence[str]],
    lines: Sequence[int],
    used: Sequence[int],
    source: str,
    sample_lines: int,
) -> bool:
    """Return whether numbers are written with decimal commas; refuse a mixture."""
    comma = point = -1
    for k, cells in enumerate(rows):
        for j in used:
            cell = cells[j].strip() if j < len(cells) else ""
            if comma < 0 and "," in cell and _COMMA.match(cell):
                comma = k
            elif point < 0 and "." in cell and _POINT.match(cell):
                point = k
        if k >= sample_lines and comma < 0:
            break
    if comma >= 0 and point >= 0:
        raise InputError(
            f"{source}: line {lines[comma]} has decimal commas and line {lines[point]} decimal "
            "points; expected one of them"
        )
    return comma >= 0


def _check_commas(
    rows: Sequence[Sequence[str]], lines: Sequence[int], source: str, sample_lines: int
) -> None:
    """Refuse a table without a head whose commas may be separators or decimal signs."""
    sample = rows[:sample_lines]
    if not all(_WHOLE.match(c.strip()) for cells in sample for c in cells):
        return
    is_halved = any(re.match(r"0\d", c.strip()) for cells in sample for c in cells[1::2])
    if len(rows[0]) == 6 or (len(rows[0]) == 4 and is_halved):
        raise InputError(
            f"{source}: line {lines[0]}: the commas may be decimal commas; expected decimal "
            "points, or semicolons between the cells"
        )


def _is_number(cell: str) -> bool:
    text = cell.strip()
    if _COMMA.match(text):
        return True
    try:
        float(text)
    except ValueError:
        return False
    return True
