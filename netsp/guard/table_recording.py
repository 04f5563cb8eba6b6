"""Recordings that are tables, with the quantities in columns of a name."""

from __future__ import annotations

import csv
import gzip
import io
import math
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from netsp.errors import InputError
from netsp.fields import Point3
from netsp.files import MOST_BYTES, read_bytes
from netsp.guard.fix import Fix
from netsp.guard.message_tally import MessageTally
from netsp.link.frame import Frame
from netsp.models import shown
from netsp.site.gpx import seconds_of

TRUTH = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}

NO_VALUES = ("", "nan", "-nan", "null", "none", "na", "n/a", "<null>")
"""Cells, in lower case, that hold nothing."""

MAX_METRES = 1e9
"""Bound on places, lengths and velocities of a table, m or m/s: numbers beyond are damage."""

MAX_SECONDS = 1e11
"""Bound on times, s: the year 5138. Larger numbers without a unit are milliseconds or less."""

TIMES = {
    "t": 0.0, "time": 0.0, "timestamp": 0.0, "datetime": 0.0, "date_time": 0.0, "utc": 0.0,
    "time_utc": 0.0, "time_s": 1.0, "t_s": 1.0, "seconds": 1.0, "timestamp_s": 1.0,
    "time_ms": 1e-3, "t_ms": 1e-3, "timestamp_ms": 1e-3, "time_boot_ms": 1e-3, "time_us": 1e-6,
    "t_us": 1e-6, "timeus": 1e-6, "time_usec": 1e-6, "timestamp_us": 1e-6, "time_ns": 1e-9,
    "timestamp_ns": 1e-9,
}  # fmt: skip
"""Names of the column of times, with the seconds of its unit; 0 where the name says none."""

PLACES = {
    "x": "x", "y": "y", "north": "north", "n": "north", "east": "east", "e": "east", "lat": "lat",
    "latitude": "lat", "lon": "lon", "lng": "lon", "long": "lon", "longitude": "lon", "z": "z",
    "height": "z", "relative_alt": "z", "rel_alt": "z", "alt": "z", "altitude": "z", "ele": "z",
    "elevation": "z", "depth": "depth", "down": "depth", "d": "depth",
}  # fmt: skip
"""Names of the columns of a place, with the quantity of each; a depth is a negative z."""

FRAMES = (("x", "y"), ("north", "east"), ("lat", "lon"))
"""Pairs of quantities that are a place in the plan; the first that a table has counts."""

OTHERS = ("vx", "vy", "vz", "heading", "armed", "mode", "estimate", "paid_out")


def read_table(
    file: Path, frame: Frame, tally: MessageTally, on_note: Callable[[str], None]
) -> Iterator[Fix]:
    """Read the rows of a table.

    Parameters
    ----------
    file : Path
        Comma, semicolon or tab separated, perhaps gzipped; columns named in the first line.
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
    where = f"--replay: {file}"
    packed = read_bytes(file)
    try:
        if file.suffix.lower() == ".gz":
            with gzip.GzipFile(fileobj=io.BytesIO(packed)) as raw:
                packed = raw.read(MOST_BYTES + 1)
        if len(packed) > MOST_BYTES:
            raise InputError(f"{where}: more than {MOST_BYTES / 2**20:g} MiB unpacked")
        text = packed.decode("utf-8-sig")
        first = text.lstrip().partition("\n")[0]
        delimiter = ";" if ";" in first else "\t" if "\t" in first else ","
        rows = csv.DictReader(io.StringIO(text, newline=""), delimiter=delimiter)
        columns = _Columns([str(c) for c in rows.fieldnames or ()], frame, where, on_note)
        for number, row in enumerate(rows, 2):
            cells = {str(k): v for k, v in row.items() if isinstance(v, str)}
            fix = columns.fix(cells, f"{where}: line {number}", delimiter == ";")
            if fix is None:
                tally.leave_out("rows", "neither a time nor a position")
                continue
            if fix.position is None:
                tally.leave_out("rows", "no position: a gap of the track")
            else:
                tally.use("rows")
            yield fix
    except (OSError, EOFError, UnicodeError, zlib.error, csv.Error) as error:
        raise InputError(f"{where}: {error}") from None


class _Columns:
    """Columns of a table by what they hold."""

    def __init__(
        self, names: list[str], frame: Frame, where: str, on_note: Callable[[str], None]
    ) -> None:
        self.frame, self.where, self.on_note = frame, where, on_note
        own = {name: name.strip().lower() for name in names}
        self.column: dict[str, str] = {}
        for name, lower in own.items():
            quantity = "t" if lower in TIMES else PLACES.get(lower)
            if quantity is None and lower in OTHERS:
                quantity = lower
            if quantity is not None:
                self.column.setdefault(quantity, name)
        has = self.column.keys()
        self.plan = next((pair for pair in FRAMES if set(pair) <= has), None)
        self.up = next((q for q in ("z", "depth") if q in has), None)
        if self.plan is None or "t" not in has or (self.up is None and not frame.is_of_plane):
            raise InputError(
                f"{where}: expected columns t, x, y, z (or t, north, east, down; or t, lat, lon, "
                f"altitude or depth), got {shown(', '.join(sorted(map(str.strip, names))))}"
            )
        if self.up is None:
            on_note(f"{where}: no column z, altitude or depth: z is taken as 0")
        if self.plan == ("lat", "lon") and not frame.is_global:
            raise InputError(
                f"{where}: positions are in degrees, and "
                + ("--frame local asks for metres; expected --frame global" if frame.has_origin
                   else "the site has no origin; expected a problem with an origin")
            )  # fmt: skip
        self.scale = TIMES[own[self.column["t"]]]
        used = {self.column[q] for q in ("t", *self.plan, *OTHERS, self.up) if q in has}
        unused = [name.strip() for name in names if name not in used and name.strip()]
        if unused:
            on_note(f"{where}: columns left out: {', '.join(unused)[:200]}")

    def fix(self, row: Mapping[str, str], where: str, decimal_comma: bool) -> Fix | None:
        """Return what a row says; None for one without a time and a position."""

        def cell(quantity: str) -> str:
            text = row.get(self.column.get(quantity, ""), "").strip()
            return "" if text.lower() in NO_VALUES else text

        def number(quantity: str, most: float = MAX_METRES) -> float | None:
            text = cell(quantity)
            if not text:
                return None
            try:
                value = float(text.replace(",", ".") if decimal_comma else text)
            except ValueError:
                value = math.nan
            if not abs(value) < most:
                raise InputError(
                    f"{where}: {self.column[quantity].strip()}: expected a number below "
                    f"{most:g}, got {shown(text)}"
                )
            return value

        def truth(quantity: str) -> bool | None:
            text = cell(quantity).lower()
            if text and text not in TRUTH:
                raise InputError(f"{where}: {quantity}: expected 0 or 1, got {shown(text)}")
            return TRUTH.get(text)

        assert self.plan is not None
        a, b = (number(q) for q in self.plan)
        height = 0.0 if self.up is None else number(self.up)
        place = None
        if a is not None and b is not None and height is not None:
            z = -height if self.up == "depth" else height
            place = self._place(a, b, z, where)
        time = self._time(cell("t"), where, decimal_comma)
        if time is None:
            if place is None:
                return None
            raise InputError(f"{where}: {self.column['t'].strip()}: expected seconds, got nothing")
        v, w, u = (number(q) for q in ("vx", "vy", "vz"))
        velocity = None
        if v is not None and w is not None:
            there = (v, w, u or 0.0)
            velocity = there if self.plan == ("x", "y") else self.frame.velocity(*there)
        return Fix(
            time, place, number("heading"), truth("armed"), cell("mode") or None,
            truth("estimate"), number("paid_out"), velocity,
        )  # fmt: skip

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

    def _time(self, text: str, where: str, decimal_comma: bool) -> float | None:
        """Return seconds: numbers of the column's unit, or ISO 8601."""
        if not text:
            return None
        name = f"{where}: {self.column['t'].strip()}"
        try:
            value = float(text.replace(",", ".") if decimal_comma else text)
        except ValueError:
            return seconds_of(text, name)
        if not self.scale:
            self.scale = 1.0
            for scale, unit in ((1e-3, "milli"), (1e-6, "micro"), (1e-9, "nano")):
                if abs(value) * self.scale >= MAX_SECONDS:
                    self.scale = scale
                    said = f"times are taken as {unit}seconds since 1970"
            if self.scale != 1.0:
                self.on_note(f"{self.where}: {said}")
        value *= self.scale
        if not abs(value) < MAX_SECONDS:
            raise InputError(f"{name}: expected seconds below {MAX_SECONDS:g}, got {shown(text)}")
        return value
