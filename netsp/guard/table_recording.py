"""Recordings that are tables, with the quantities in columns of a name (`netsp.axes`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

from netsp.axes import Quantity, Table, read_table
from netsp.errors import InputError
from netsp.fields import Point3
from netsp.guard.fix import Fix
from netsp.guard.message_tally import MessageTally
from netsp.link.frame import Frame
from netsp.models import shown
from netsp.site.gpx import seconds_of
from netsp.site.time_stamps import MAX_SECONDS, NO_VALUES, unit_of_time

TRUTH = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}

MAX_METRES = 1e9
"""Bound on places, lengths (m) and velocities (m/s) of a table; larger numbers are refused."""

POSITION_PAIRS: tuple[tuple[Quantity, Quantity], ...] = (
    ("x", "y"), ("north", "east"), ("latitude", "longitude"),
)  # fmt: skip
"""Pairs of quantities that give a position in the plan; the first pair in the table counts."""

EXTRA_QUANTITIES: tuple[Quantity, ...] = (
    "velocity_x", "velocity_y", "velocity_z", "heading", "armed", "mode", "estimate", "paid_out",
)  # fmt: skip
"""Quantities besides the position that a row may have."""


def read_recording(
    file: Path, frame: Frame, tally: MessageTally, on_note: Callable[[str], None]
) -> Iterator[Fix]:
    """Read the rows of a table.

    Parameters
    ----------
    file : Path
        Table that `netsp.axes.read_table` reads, its columns named in the first line.
    frame : Frame
        Frame of the site.
    tally : MessageTally
        Told what becomes of each row.
    on_note : callable
        Called with what was assumed.

    Yields
    ------
    Fix
        One for each row; a row without a place is a gap.

    Raises
    ------
    InputError
        No such table, or a value that is none.
    """
    try:
        rows = _Rows(read_table(file), frame, on_note)
        for k in range(len(rows.table.rows)):
            fix = rows.fix(k)
            if fix is None:
                tally.leave_out("rows", "neither a time nor a position")
                continue
            if fix.position is None:
                tally.leave_out("rows", "no position: a gap of the track")
            else:
                tally.use("rows")
            yield fix
    except InputError as error:
        raise InputError(f"--replay: {error}") from None


class _Rows:
    """Rows of a table as fixes."""

    def __init__(self, table: Table, frame: Frame, on_note: Callable[[str], None]) -> None:
        self.table, self.frame = table, frame
        self.where = table.source
        self.on_note = on_note
        plan, up = table.pair(POSITION_PAIRS), table.height()
        if plan is None or "time" not in table or (up is None and not frame.is_of_plane):
            raise table.wanted(
                "columns t, x, y, z (or t, north, east, down; or t, lat, lon, altitude or depth)"
            )
        self.plan, self.up = plan, up
        if up is None:
            self._note("no column z, altitude or depth: z is taken as 0")
        if plan == ("latitude", "longitude") and not frame.is_global:
            raise InputError(
                f"{self.where}: positions are in degrees, and "
                + ("--frame local asks for metres; expected --frame global" if frame.has_origin
                   else "the site has no origin; expected a problem with an origin")
            )  # fmt: skip
        unused = table.left_out(("time", *plan, *EXTRA_QUANTITIES, *((up,) if up else ())))
        if unused:
            self._note(f"unused columns: {', '.join(unused)[:200]}")
        self.scale: float | None = None
        meaning = table.columns["time"][1]
        if meaning.unit or meaning.factor != 1.0:
            self.scale = meaning.factor

    def _note(self, text: str) -> None:
        self.on_note(f"--replay: {self.where}: {text}")

    def _at(self, k: int) -> str:
        return f"{self.where}: line {self.table.lines[k]}"

    def fix(self, k: int) -> Fix | None:
        """Return what row k says; None for one without a time and a position."""
        a, b = (self._number(k, q) for q in self.plan)
        z = 0.0 if self.up is None else self._number(k, self.up)
        place = None
        if a is not None and b is not None and z is not None:
            place = self._place(a, b, z, self._at(k))
        time = self._time(k)
        if time is None:
            if place is None:
                return None
            raise InputError(
                f"{self._at(k)}: {self.table.title('time')}: expected seconds, got nothing"
            )
        v, w, u = (self._number(k, q) for q in EXTRA_QUANTITIES[:3])
        velocity = None
        if v is not None and w is not None:
            there = (v, w, u or 0.0)
            velocity = there if self.plan == ("x", "y") else self.frame.velocity(*there)
        return Fix(
            time, place, self._number(k, "heading"), self._truth(k, "armed"),
            self._cell(k, "mode") or None, self._truth(k, "estimate"),
            self._number(k, "paid_out"), velocity,
        )  # fmt: skip

    def _cell(self, k: int, quantity: Quantity) -> str:
        text = self.table.plain(k, quantity) if quantity in self.table else ""
        return "" if text.lower() in NO_VALUES else text

    def _number(self, k: int, quantity: Quantity) -> float | None:
        text = self._cell(k, quantity)
        if not text:
            return None
        try:
            value = float(text) * self.table.columns[quantity][1].factor
        except ValueError:
            value = math.nan
        if not abs(value) < MAX_METRES:
            raise InputError(
                f"{self._at(k)}: {self.table.title(quantity)}: expected a number below "
                f"{MAX_METRES:g}, got {shown(text)}"
            )
        return value + 0.0

    def _truth(self, k: int, quantity: Quantity) -> bool | None:
        text = self._cell(k, quantity).lower()
        if text and text not in TRUTH:
            raise InputError(
                f"{self._at(k)}: {self.table.title(quantity)}: expected 0 or 1, got {shown(text)}"
            )
        return TRUTH.get(text)

    def _place(self, a: float, b: float, z: float, where: str) -> Point3 | None:
        if self.plan == ("x", "y"):
            return a, b, z
        if self.plan == ("north", "east"):
            return self.frame.from_local(a, b, -z)
        if a == 0.0 and b == 0.0:
            return None  # no GPS fix
        if abs(a) > 90.0 or abs(b) > 180.0:
            raise InputError(
                f"{where}: expected degrees, lat within 90 and lon within 180, got {a:g}, {b:g}"
            )
        return self.frame.from_degrees(a, b, z)

    def _time(self, k: int) -> float | None:
        """Return seconds: numbers of the column's unit, or ISO 8601."""
        text = self._cell(k, "time")
        if not text:
            return None
        name = f"{self._at(k)}: {self.table.title('time')}"
        try:
            value = float(text)
        except ValueError:
            return seconds_of(text, name)
        if self.scale is None:
            self.scale, unit = unit_of_time(value)
            if unit:
                self._note(f"times are taken as {unit} since 1970")
        value *= self.scale
        if not abs(value) < MAX_SECONDS:
            raise InputError(f"{name}: expected seconds below {MAX_SECONDS:g}, got {shown(text)}")
        return value
