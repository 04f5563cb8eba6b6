"""Time stamps of tables: numbers of any unit, dates with times, clock times, and empty cells."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from datetime import UTC, datetime

from netsp.base.columns import Column
from netsp.base.errors import InputError
from netsp.base.validated import shown
from netsp.exchange.maps.import_policy import DEFAULT_READ, ReadPolicy
from netsp.exchange.maps.word_tables import words

NO_VALUES = words("nan -nan null none na n/a <null> #n/a #nv inf +inf -inf - -- ---") | {""}
"""Cells, in lower case, without a value."""

FINER = ((1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds"))
"""Units of times since 1970 that are finer than seconds."""

DAY_S = 86_400.0
"""Unit: length of a day, s."""

CLOCK = re.compile(r"(\d{1,3}):([0-5]\d):([0-5]\d(?:[.,]\d*)?)")
"""Clock time or elapsed time: hours, minutes, seconds."""

DATES = (
    (re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})"), (3, 2, 1)),
    (re.compile(r"(\d{4})[/.](\d{1,2})[/.](\d{1,2})"), (1, 2, 3)),
)
"""Dates besides ISO 8601, with the positions of year, month and day.

A date such as 11/12/2026 is refused, because the order of day and month is ambiguous.
"""


class TimeStamps:
    """Reader of the times of a table, which must all be of one kind.

    Parameters
    ----------
    meaning : Column
        Meaning of the column of times; a unit in its name decides.
    on_note : callable
        Called with assumptions, one line each.

    Examples
    --------
    >>> stamps = TimeStamps(Column("time"), print)
    >>> [stamps.seconds(text, "t") for text in ("23:59:59.5", "0:00:01")]
    times are taken as hours, minutes and seconds
    [86399.5, 86401.0]
    """

    def __init__(
        self, meaning: Column, on_note: Callable[[str], None], policy: ReadPolicy = DEFAULT_READ
    ) -> None:
        self.on_note, self.policy = on_note, policy
        self.scale: float | None = None
        if meaning.unit or meaning.factor != 1.0:
            self.scale = meaning.factor
        self._kind = ""
        self._days, self._last = 0, 0.0

    def seconds(self, text: str, where: str, date: str = "") -> float:
        """Return a time in seconds, since 1970 if the table states dates.

        Parameters
        ----------
        where : str
            Name of the cell in messages.
        date : str
            Cell of the date, if the table has a column of dates.

        Raises
        ------
        InputError
            The cell is no time, or of another kind than earlier cells.
        """
        number = _number(text)
        clock = CLOCK.fullmatch(text)
        kind = "numbers" if number is not None else "clock times" if clock else "dates"
        kind = "dates" if date else kind
        if self._kind and kind != self._kind:
            raise InputError(
                f"{where}: expected one kind of times, got {self._kind} before and {shown(text)}"
            )
        is_first, self._kind = not self._kind, kind
        if kind == "dates":
            return seconds_of(f"{date} {text}" if date else text, where)
        if clock is not None:
            if is_first:
                self.on_note("times are taken as hours, minutes and seconds")
            return self._clock_seconds(clock)
        assert number is not None
        if self.scale is None:
            self.scale, unit = unit_of_time(number, self.policy)
            if unit:
                self.on_note(f"times are taken as {unit} since 1970")
        value = number * self.scale
        max_time_s = self.policy.max_time_s
        if not abs(value) < max_time_s:
            raise InputError(f"{where}: expected seconds below {max_time_s:g}, got {shown(text)}")
        return value

    def _clock_seconds(self, clock: re.Match[str]) -> float:
        """Return the seconds of a clock time; a fall of over half a day means midnight."""
        hours, minutes, rest = clock.groups()
        value = 3600.0 * int(hours) + 60.0 * int(minutes) + float(rest.replace(",", "."))
        if value < self._last - 0.5 * DAY_S:
            self._days += 1
        self._last = value
        return value + self._days * DAY_S


def seconds_of(text: str, where: str) -> float:
    """Return the seconds since 1970 of a date with a time, in UTC unless it states a time zone.

    Parameters
    ----------
    text : str
        ISO 8601, or a date such as 01.05.2026 or 2026/05/01 with a time after it.
    where : str
        Name of the value in messages.

    Raises
    ------
    InputError
        The text is no such time.

    Examples
    --------
    >>> seconds_of("01.05.2026 7:00:00", "t") == seconds_of("2026-05-01T07:00:00Z", "t")
    True
    """
    try:
        time = datetime.fromisoformat(_in_iso(text.strip()))
        return (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError, OSError):
        raise InputError(
            f"{where}: expected a time such as 2026-05-01T12:00:00Z, got {shown(text)}"
        ) from None


def _in_iso(text: str) -> str:
    """Return a date of `DATES`, a time with one digit for the hour, or UTC after it in ISO 8601."""
    for pattern, (year, month, day) in DATES:
        if (found := pattern.match(text)) is not None:
            date = f"{found[year]}-{int(found[month]):02}-{int(found[day]):02}"
            text = date + text[found.end() :]
            break
    text = re.sub(r"^(\d{4}-\d{2}-\d{2})[T,\s]+(?=\d)", r"\1T", text)
    text = re.sub(r"T(\d):", r"T0\1:", text)
    return re.sub(r"\s*(UTC|GMT)$", "Z", text)


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def unit_of_time(value: float, policy: ReadPolicy = DEFAULT_READ) -> tuple[float, str]:
    """Return the unit of a time whose column names none: its length, s, and its name (empty for s).

    Examples
    --------
    >>> unit_of_time(1732000000.5), unit_of_time(1732000000500.0)
    ((1.0, ''), (0.001, 'milliseconds'))
    """
    units = ((1.0, ""), *FINER)
    return next((unit for unit in units if abs(value) * unit[0] < policy.max_time_s), units[0])
