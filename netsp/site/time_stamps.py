"""Time stamps of tables: seconds from any moment, finer units since 1970, and empty cells."""

from __future__ import annotations

NO_VALUES = ("", "nan", "-nan", "null", "none", "na", "n/a", "<null>")
"""Cells, in lower case, that hold nothing."""

MAX_SECONDS = 1e11
"""Bound on times, s: the year 5138. Larger numbers without a unit are milliseconds or less."""

FINER = ((1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds"))
"""Units of times since 1970 that are finer than seconds."""


def unit_of_time(value: float) -> tuple[float, str]:
    """Return the unit of a time whose column names none.

    Parameters
    ----------
    value : float
        The first time of a table.

    Returns
    -------
    scale : float
        Seconds of the unit.
    name : str
        Name of a unit since 1970; empty for seconds.

    Examples
    --------
    >>> unit_of_time(1732000000.5), unit_of_time(1732000000500.0)
    ((1.0, ''), (0.001, 'milliseconds'))
    """
    units = ((1.0, ""), *FINER)
    return next((unit for unit in units if abs(value) * unit[0] < MAX_SECONDS), units[0])
