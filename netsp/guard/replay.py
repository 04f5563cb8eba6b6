"""Recordings: CSV files, telemetry logs of ground stations, and logs of ArduPilot's vehicles."""

from __future__ import annotations

import contextlib
import csv
import gzip
import io
import math
import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from netsp.errors import InputError
from netsp.files import MOST_BYTES, check_file, read_bytes
from netsp.guard.fix import Fix
from netsp.link.dialect import dialect, parser
from netsp.link.frame import Frame
from netsp.link.messages import CONSTANT, HORIZONTAL, Listener
from netsp.link.modes import mode_name
from netsp.models import shown

KINDS = ".csv, .csv.gz, .tlog or .bin"

TRUE = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}

MOST = 1e9
"""Of seconds and metres."""

MOST_PACKET = 300
"""Bytes of a MAVLink message, at most."""


TIMES = ("t", "time")
"""Names of the column of seconds; the second is that of our own runs."""


def read_fixes(file: str | Path, frame: Frame, system: int | None = None) -> Iterator[Fix]:
    """The fixes of a recording, in their order.

    Parameters
    ----------
    file : str or Path
        A table (columns t or time, x, y, z, or north, east, down; vx, vy, vz of the same frame,
        heading, armed, mode, estimate, paid_out where it has them), a ground station's .tlog, or
        a .bin of ArduPilot.
    frame : Frame
        Of the site.
    system : int, optional
        System id of the vehicle; by default the first heard.

    Yields
    ------
    Fix
        One for each row or message.

    Raises
    ------
    InputError
        The file cannot be read, is of another kind, or has no positions.
    """
    name = str(file).lower()
    check_file(file)
    if name.endswith((".csv", ".csv.gz")):
        found = _table(Path(file), frame)
    elif name.endswith(".tlog"):
        found = _tlog(Path(file), frame, system)
    elif name.endswith(".bin"):
        found = _dataflash(Path(file), frame)
    else:
        raise InputError(f"--replay: {file}: expected a file that ends in {KINDS}")
    any_place = False
    for fix in found:
        any_place = any_place or fix.position is not None
        yield fix
    if not any_place:
        raise InputError(f"--replay: {file}: has no positions")


def _table(file: Path, frame: Frame) -> Iterator[Fix]:
    packed = read_bytes(file)
    try:
        if file.suffix.lower() == ".gz":
            with gzip.GzipFile(fileobj=io.BytesIO(packed)) as raw:
                packed = raw.read(MOST_BYTES + 1)
        if len(packed) > MOST_BYTES:
            raise InputError(f"--replay: {file}: more than {MOST_BYTES / 2**20:g} MiB unpacked")
        rows = csv.DictReader(io.StringIO(packed.decode("utf-8-sig"), newline=""))
        columns = set(rows.fieldnames or ())
        named = {"x", "y", "z"} <= columns
        if not columns & set(TIMES) or not (named or {"north", "east", "down"} <= columns):
            raise InputError(
                f"--replay: {file}: expected columns t, x, y, z (or t, north, east, down), got "
                f"{shown(', '.join(sorted(map(str, columns))))}"
            )
        for number, row in enumerate(rows, 2):
            yield _row(row, frame, named, f"--replay: {file}: line {number}")
    except (OSError, EOFError, UnicodeError, zlib.error, csv.Error) as error:
        raise InputError(f"--replay: {file}: {error}") from None


def _row(row: dict[str, str], frame: Frame, named: bool, where: str) -> Fix:
    def number(column: str) -> float | None:
        text = row.get(column)
        if text is None or text.strip() == "":
            return None
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not abs(value) < MOST:
            raise InputError(
                f"{where}: {column}: expected a number below {MOST:g}, got {shown(text)}"
            )
        return value

    def yes(column: str) -> bool | None:
        text = (row.get(column) or "").strip().lower()
        if text and text not in TRUE:
            raise InputError(f"{where}: {column}: expected 0 or 1, got {shown(text)}")
        return TRUE.get(text)

    column = next(c for c in TIMES if c in row)
    time = number(column)
    if time is None:
        raise InputError(f"{where}: {column}: expected seconds, got nothing")
    parts = [number(c) for c in (("x", "y", "z") if named else ("north", "east", "down"))]
    place = None
    if None not in parts:
        a, b, c = (float(v) for v in parts if v is not None)
        place = (a, b, c) if named else frame.from_local(a, b, c)
    first, second, third = (number(column) for column in ("vx", "vy", "vz"))
    velocity = None
    if first is not None and second is not None:
        there = (first, second, third or 0.0)
        velocity = there if named else frame.velocity(*there)
    return Fix(
        time, place, number("heading"), yes("armed"), row.get("mode") or None, yes("estimate"),
        number("paid_out"), velocity,
    )  # fmt: skip


def _tlog(file: Path, frame: Frame, system: int | None) -> Iterator[Fix]:
    """A time of eight bytes before each message (microseconds), as ground stations write them."""
    data = read_bytes(file)
    listener = Listener(frame, system)
    error = dialect().MAVError
    at = 0
    while at + 8 < len(data):
        reads = parser()
        message = None
        for k in range(at + 8, min(len(data), at + 8 + MOST_PACKET)):
            try:
                message = reads.parse_char(data[k : k + 1])
            except (error, struct.error, ValueError):
                break
            if message is not None:
                break
        if message is None or message.get_type() == "BAD_DATA":
            at += 1  # something is missing: on to where messages begin again
            continue
        at = k + 1
        fix = listener.understand(message)
        if fix is not None:
            yield fix


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """pymavlink tells what it makes of damaged logs, and its indexer does so from C: past what
    Python calls standard output and error."""
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        stack.enter_context(contextlib.redirect_stderr(io.StringIO()))
        nothing = os.open(os.devnull, os.O_WRONLY)
        stack.callback(os.close, nothing)
        for number in (1, 2):
            with contextlib.suppress(OSError):  # closed before we began
                kept = os.dup(number)
                stack.callback(os.close, kept)
                stack.callback(os.dup2, kept, number)
                os.dup2(nothing, number)
        yield


def _dataflash(file: Path, frame: Frame) -> Iterator[Fix]:
    """A log of the vehicle itself: estimates of the filter that it goes by, its status, arming,
    modes and the winch. Filters are those of EKF3 (XKF1, XKF4), or of EKF2 in older vehicles."""
    try:
        from pymavlink.DFReader import DFReader_binary
    except ImportError:
        raise InputError(
            "--replay: a .bin needs pymavlink; install it with: pip install 'netsp[mavlink]'"
        ) from None
    kinds = ["XKF1", "XKF4", "NKF1", "NKF4", "ARM", "MODE", "WINC"]
    log = DFReader_binary.__new__(DFReader_binary)  # which leaves its file open when it fails
    try:
        with _silence():
            DFReader_binary.__init__(log, str(file))
            messages = list(iter(lambda: log.recv_match(type=kinds), None))
    except Exception as error:  # it raises just that where a format is damaged
        raise InputError(f"--replay: {file}: no log of ArduPilot: {error}") from None
    finally:
        for part in ("data_map", "filehandle"):
            with contextlib.suppress(AttributeError, BufferError):
                getattr(log, part).close()
    try:
        found = _of_log(messages, frame, "XKF")
        if all(fix.position is None for fix in found):
            found = _of_log(messages, frame, "NKF")
    except AttributeError as error:
        raise InputError(
            f"--replay: {file}: a message without its column {shown(str(error))}"
        ) from None
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"--replay: {file}: no log of ArduPilot: {error}") from None
    yield from found


def _of_log(messages: Sequence[Any], frame: Frame, filters: str) -> list[Fix]:
    """Of several filters that run beside each other the one that the vehicle goes by counts, if it
    is logged. Older vehicles log the first one only under these names, and do not number it."""
    places, status = f"{filters}1", f"{filters}4"
    logged = {int(getattr(m, "C", 0)) for m in messages if m.get_type() == places}
    primary, found = 0, []
    for m in messages:
        kind, time = m.get_type(), float(m.TimeUS) * 1e-6
        if not abs(time) < MOST:
            continue
        if kind == status and int(getattr(m, "PI", 0)) in logged:
            primary = int(getattr(m, "PI", 0))
        if kind in (places, status) and getattr(m, "C", primary) != primary:
            continue
        fix = _of_message(m, kind, time, frame, places, status)
        if fix is not None:
            found.append(fix)
    return found


def _of_message(
    m: Any, kind: str, time: float, frame: Frame, places: str, status: str
) -> Fix | None:  # fmt: skip
    if kind == places:
        at, speeds = ([float(v) for v in some] for some in ((m.PN, m.PE, m.PD), (m.VN, m.VE, m.VD)))
        if not all(abs(v) < MOST for v in at):
            return None
        right = all(abs(v) < MOST for v in speeds)
        return Fix(
            time, position=frame.from_local(*at),
            heading=float(m.Yaw) % 360.0 if abs(float(m.Yaw)) < MOST else None,
            velocity=frame.velocity(*speeds) if right else None,
        )  # fmt: skip
    if kind == status:
        # nav_filter_status: the first bits are those of EKF_STATUS_REPORT, but the one that says
        # there that nothing is known yet is here set for good once the vehicle has turned
        flags = int(m.SS)
        return Fix(time, estimate=bool(flags & HORIZONTAL) and not flags & CONSTANT)
    if kind == "WINC":
        return Fix(time, paid_out=float(m.Len)) if 0.0 <= float(m.Len) < MOST else None
    if kind == "ARM":
        return Fix(time, armed=bool(m.ArmState))
    if kind == "MODE":
        return Fix(time, mode=mode_name(int(m.ModeNum)))
    return None  # of the other family of filters
