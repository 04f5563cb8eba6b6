"""Recordings that are tables with named columns (`netsp.base.columns`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from netsp.base.columns import Quantity
from netsp.base.errors import InputError
from netsp.base.field_types import Point3
from netsp.base.table_file import Table, read_table
from netsp.base.validated import shown
from netsp.exchange.maps.time_stamps import NO_VALUES, TimeStamps
from netsp.online.guard.guard_policy import RecordingPolicy
from netsp.online.guard.message_tally import MessageTally
from netsp.online.guard.recording_checks import in_order_of_time
from netsp.online.guard.telemetry import Fix
from netsp.online.link.geo_frame import Frame

TRUTH = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}
"""Values of a column of truths, in small letters."""

POSITION_PAIRS: tuple[tuple[Quantity, Quantity], ...] = (
    ("x", "y"),
    ("north", "east"),
    ("latitude", "longitude"),
)
"""Pairs of quantities that give a position in the plan; the first pair in the table counts."""

EXTRA_QUANTITIES: tuple[Quantity, ...] = (
    "velocity_x",
    "velocity_y",
    "velocity_z",
    "heading",
    "armed",
    "mode",
    "estimate",
    "paid_out",
)
"""Quantities besides the position that a row may have."""


def read_table_fixes(
    file: Path,
    frame: Frame,
    tally: MessageTally,
    on_note: Callable[[str], None],
    policy: RecordingPolicy = RecordingPolicy(),
) -> Iterator[Fix]:
    """Yield the fixes of a table, one for each row; a row without a place is a gap.

    Raises
    ------
    InputError
        The table is missing, a value is invalid, or a column of depths holds heights.
    """
    found: list[Fix] = []
    try:
        rows = _Rows(read_table(file), frame, on_note, policy)
        for k in range(len(rows.table.rows)):
            fix = rows.fix(k)
            if isinstance(fix, str):
                tally.leave_out("rows", fix)
                continue
            if fix.position is None:
                tally.leave_out("rows", "no position: a gap of the track")
            else:
                tally.use("rows")
            found.append(fix)
    except InputError as error:
        raise InputError(f"--replay: {error}") from None
    ordered = in_order_of_time(found, policy)
    if ordered is not found:
        on_note(f"--replay: {file}: the rows are not in order of time; they were sorted")
    yield from ordered


class _Rows:
    """Rows of a table as fixes."""

    def __init__(
        self, table: Table, frame: Frame, on_note: Callable[[str], None], policy: RecordingPolicy
    ) -> None:
        self.table, self.frame, self.policy = table, frame, policy
        self.where = table.source
        self.on_note = on_note
        plan, up = table.pair(POSITION_PAIRS), table.height()
        self.clock: Quantity = "time" if "time" in table else "date"
        if plan is None or self.clock not in table or (up is None and not frame.is_planar):
            raise table.wanted(
                "columns t, x, y, z (or t, north, east, down; or t, lat, lon, altitude or depth)"
            )
        self.plan, self.up = plan, up
        if up is None:
            self._note("no column z, altitude or depth: z is taken as 0")
        if plan == ("latitude", "longitude") and not frame.is_global:
            why = "the site has no origin; expected a problem with an origin"
            if frame.has_origin:
                why = "--frame local asks for metres; expected --frame global"
            raise InputError(f"{self.where}: positions are in degrees, and {why}")
        used = ("time", "date", *plan, *EXTRA_QUANTITIES, *((up,) if up else ()))
        for note in table.notes(used):
            self._note(note)
        self.stamps = TimeStamps(table.columns[self.clock][1], self._note)
        self.has_times = any(self._cell(k, self.clock) for k in range(len(table.rows)))
        self._check_depths()
        self._check_heading()

    def _check_depths(self) -> None:
        """Refuse a column of depths that holds heights."""
        if self.up != "z":
            return
        z = [v for k in range(len(self.table.rows)) if (v := self._number(k, "z")) is not None]
        if z and max(z) > self.policy.max_height:
            self.table.check_depths(np.array(z))

    def _check_heading(self) -> None:
        """Add a note if the headings may be in radians."""
        if "heading" not in self.table or self.table.columns["heading"][1].unit:
            return
        values = [self._number(k, "heading") for k in range(len(self.table.rows))]
        turns = {abs(v) for v in values if v is not None}
        if len(turns) > 1 and max(turns) <= 2.0 * math.pi:
            title = self.table.title("heading")
            self._note(
                f"column {title} is taken as degrees, but no value exceeds {max(turns):.3g}; "
                f"if these are radians, name it {title}_rad"
            )

    def _note(self, text: str) -> None:
        self.on_note(f"--replay: {self.where}: {text}")

    def _at(self, k: int) -> str:
        return f"{self.where}: line {self.table.lines[k]}"

    def fix(self, k: int) -> Fix | str:
        """Return the fix in row k, or the reason to leave the row out."""
        a, b = (self._number(k, q) for q in self.plan)
        z = 0.0 if self.up is None else self._number(k, self.up)
        place = None
        if a is not None and b is not None and z is not None:
            place = self._place(a, b, z, self._at(k))
        text = self._cell(k, self.clock)
        if not text:
            if place is None:
                return "neither a time nor a position"
            if self.has_times:
                return "a position without a time"
            raise InputError(
                f"{self._at(k)}: {self.table.title(self.clock)}: expected seconds, got nothing"
            )
        date = self._cell(k, "date") if self.clock == "time" else ""
        time = self.stamps.seconds(text, f"{self._at(k)}: {self.table.title(self.clock)}", date)
        v, w, u = (self._number(k, q) for q in EXTRA_QUANTITIES[:3])
        velocity = None
        if v is not None and w is not None:
            given = (v, w, u or 0.0)
            velocity = given if self.plan == ("x", "y") else self.frame.velocity(*given)
        return Fix(
            time,
            position=place,
            heading=self._number(k, "heading"),
            armed=self._truth(k, "armed"),
            mode=self._cell(k, "mode") or None,
            estimate=self._truth(k, "estimate"),
            paid_out=self._number(k, "paid_out"),
            velocity=velocity,
        )

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
        if not abs(value) < self.policy.max_value:
            raise InputError(
                f"{self._at(k)}: {self.table.title(quantity)}: expected a number below "
                f"{self.policy.max_value:g}, got {shown(text)}"
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
        if a == b and a in self.policy.no_places:
            return None
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
