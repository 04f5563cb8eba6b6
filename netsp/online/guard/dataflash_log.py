"""Logs that ArduPilot's vehicles write themselves (.bin)."""

from __future__ import annotations

import contextlib
import io
import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from netsp.base.errors import InputError
from netsp.base.validated import shown
from netsp.online.guard.message_tally import MessageTally
from netsp.online.guard.telemetry import Fix
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import CONSTANT, HORIZONTAL, NO_GPS_FIX, NO_NUMBERS
from netsp.online.link.modes import mode_name
from netsp.online.link.position_aiding import PositionAiding

MAX_SECONDS = 1e9
"""Bound on times of a log, s; messages with larger ones are damaged."""

MAX_METRES = 1e9
"""Bound on places (m) and velocities (m/s) of a log; messages with larger ones are damaged."""

FILTERS = ("XKF", "NKF")
"""Families of filters: EKF3, and EKF2 of older vehicles."""

MESSAGE_MARK = b"\xa3\x95"
"""First bytes of each message of a log."""

SEARCHED_BYTES = 65_536
"""Bytes at the beginning of a log that must hold a message; damaged bytes may precede it."""

KINDS = ("XKF1", "XKF4", "NKF1", "NKF4", "POS", "ARM", "MODE", "WINC")
"""Messages that are read."""

UNUSED_REASON = "says nothing that the guard uses"
"""Reason to leave out messages of other kinds."""


def read_bin(
    file: Path, frame: Frame, tally: MessageTally, on_note: Callable[[str], None]
) -> list[Fix]:
    """Read the estimates of the primary filter, arming, modes and the winch.

    Where the site has an origin and the log has POS with a GPS fix, the degrees of POS count;
    otherwise the metres of EKF3 (XKF1, XKF4), or of EKF2 in older vehicles, from the base.

    Parameters
    ----------
    file : Path
        Log of the vehicle.
    frame : Frame
        Frame of the site.
    tally : MessageTally
        Told what becomes of each message.
    on_note : callable
        Called with what was assumed.

    Returns
    -------
    list of Fix
        One for each message that says something that counts.

    Raises
    ------
    InputError
        No such log, or none with positions.
    """
    where = f"--replay: {file}"
    _check_begin(file, where)
    messages, counts = _messages(file, where)
    choices = [*FILTERS]
    if frame.is_global:
        choices.insert(0, "POS")
    found: list[Fix] = []
    try:
        for source in choices:
            own = MessageTally()
            found = _fixes_of_log(messages, frame, source, own)
            if any(fix.position is not None for fix in found):
                break
        else:
            raise InputError(f"{where}: has no positions{_help(messages, counts, frame)}")
    except AttributeError as error:
        raise InputError(f"{where}: a message without its column {shown(str(error))}") from None
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"{where}: no log of ArduPilot: {error}") from None
    if frame.is_global and source != "POS":
        on_note(
            f"{where}: no POS with a GPS fix; {source}1 is taken as metres north, east and down of "
            "the base, as with --frame local; right only if the vehicle's estimate began there"
        )
    tally.used.update(own.used)
    for reason, kinds in own.left_out.items():
        for kind, n in kinds.items():
            tally.leave_out(kind, reason, n)
    for kind, n in counts.items():
        if kind not in KINDS:
            tally.leave_out(kind, UNUSED_REASON, n)
    return found


def _check_begin(file: Path, where: str) -> None:
    """Refuse a file without an ArduPilot message near its beginning, such as a renamed file."""
    with open(file, "rb") as stream:
        begin = stream.read(SEARCHED_BYTES)
    if MESSAGE_MARK not in begin:
        what = "the file is empty" if not begin else "no message in its beginning"
        raise InputError(f"{where}: no log of ArduPilot: {what}; expected a .bin of the vehicle")


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep pymavlink's remarks on damaged logs from the user's streams: its indexer writes them
    from C, past what Python calls standard output and error."""
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


def _messages(file: Path, where: str) -> tuple[list[Any], Counter[str]]:
    """Return the messages of `KINDS`, and the number of messages of every kind."""
    try:
        from pymavlink.DFReader import DFReader_binary
    except ImportError:
        raise InputError(
            "--replay: a .bin needs pymavlink; install it with: pip install 'netsp[mavlink]'"
        ) from None
    log = DFReader_binary.__new__(DFReader_binary)  # which leaves its file open when it fails
    try:
        with _silence():
            DFReader_binary.__init__(log, str(file))
            messages = list(iter(lambda: log.recv_match(type=list(KINDS)), None))
            counts = Counter({
                name: int(log.counts[number])
                for number, name in log.id_to_name.items() if log.counts[number]
            })  # fmt: skip
    except Exception as error:  # it raises just that where a format is damaged
        raise InputError(f"{where}: no log of ArduPilot: {error}") from None
    finally:
        for part in ("data_map", "filehandle"):
            with contextlib.suppress(AttributeError, BufferError):
                getattr(log, part).close()
    return messages, counts


def _fixes_of_log(
    messages: Sequence[Any], frame: Frame, source: str, tally: MessageTally
) -> list[Fix]:
    """Return the fixes of messages, with positions of POS or of a family of filters.

    Of several filters that run beside each other the one that the vehicle goes by counts, if it is
    logged. Older vehicles log the first one only under these names, and do not number it.
    """
    logged = {m.get_type() for m in messages}
    filters = source
    if source == "POS":
        filters = next((f for f in FILTERS if f"{f}1" in logged or f"{f}4" in logged), FILTERS[0])
    places, status = f"{filters}1", f"{filters}4"
    cores = {int(getattr(m, "C", 0)) for m in messages if m.get_type() == places}
    primary, found, aiding = 0, [], PositionAiding()
    for m in messages:
        kind, time = m.get_type(), float(m.TimeUS) * 1e-6
        if not abs(time) < MAX_SECONDS:
            tally.leave_out(kind, NO_NUMBERS)
            continue
        if kind == status and (int(getattr(m, "PI", 0)) in cores or not cores):
            primary = int(getattr(m, "PI", 0))
        if kind in (places, status) and getattr(m, "C", primary) != primary:
            tally.leave_out(kind, "of a filter that the vehicle does not go by")
            continue
        fix = _fix_of_message(m, kind, time, frame, source, places, status)
        if kind == status and isinstance(fix, Fix):
            aiding.take_innovation(float(getattr(m, "SP", math.nan)))
            aiding.take_gps_checks(int(getattr(m, "GPS", 0)))
            fix = replace(fix, aiding_fault=aiding.fault(time))
        if isinstance(fix, str):
            tally.leave_out(kind, fix)
        else:
            tally.use(kind)
            found.append(fix)
    return found


def _fix_of_message(
    m: Any, kind: str, time: float, frame: Frame, source: str, places: str, status: str
) -> Fix | str:
    """Return the fix of a message, or the reason to leave it out."""
    if kind == places:
        return _fix_of_filter(m, time, frame, has_place=source != "POS")
    if kind == "POS":
        return _fix_of_pos(m, time, frame) if source == "POS" else _pos_unused(m, frame)
    if kind == status:
        # nav_filter_status: the first bits are those of EKF_STATUS_REPORT, but the one that says
        # there that nothing is known yet is here set for good once the vehicle has turned
        flags = int(m.SS)
        return Fix(time, estimate=bool(flags & HORIZONTAL) and not flags & CONSTANT)
    if kind == "WINC":
        good = 0.0 <= float(m.Len) < MAX_METRES
        return Fix(time, paid_out=float(m.Len)) if good else NO_NUMBERS
    if kind == "ARM":
        return Fix(time, armed=bool(m.ArmState))
    if kind == "MODE":
        return Fix(time, mode=mode_name(int(m.ModeNum)))
    return "of the other family of filters"


def _fix_of_filter(m: Any, time: float, frame: Frame, *, has_place: bool) -> Fix | str:
    """Return place, velocity and heading of a filter; without the place where POS has it."""
    at, speeds = ([float(v) for v in some] for some in ((m.PN, m.PE, m.PD), (m.VN, m.VE, m.VD)))
    if has_place and not all(abs(v) < MAX_METRES for v in at):
        return NO_NUMBERS
    right = all(abs(v) < MAX_METRES for v in speeds)
    return Fix(
        time, position=frame.from_local(*at) if has_place else None,
        heading=float(m.Yaw) % 360.0 if abs(float(m.Yaw)) < MAX_METRES else None,
        velocity=frame.velocity(*speeds) if right else None,
    )  # fmt: skip


def _fix_of_pos(m: Any, time: float, frame: Frame) -> Fix | str:
    """Return the best place of all that the vehicle has, in degrees."""
    lat, lon = float(m.Lat), float(m.Lng)
    if lat == 0.0 and lon == 0.0:
        return NO_GPS_FIX
    above = getattr(m, "RelHomeAlt", None)
    height = float(m.Alt if above is None else above)
    if not (abs(lat) <= 90.0 and abs(lon) <= 180.0 and abs(height) < MAX_METRES):
        return NO_NUMBERS
    return Fix(time, position=frame.from_degrees(lat, lon, height))


def _pos_unused(m: Any, frame: Frame) -> str:
    if float(m.Lat) == 0.0 and float(m.Lng) == 0.0:
        return NO_GPS_FIX
    return "metres of the filter count" + ("" if frame.has_origin else ": the site has no origin")


def _help(messages: Sequence[Any], counts: Counter[str], frame: Frame) -> str:
    """Return what to do about a log without positions."""
    pos = [m for m in messages if m.get_type() == "POS"]
    fixed = sum(not (float(m.Lat) == 0.0 and float(m.Lng) == 0.0) for m in pos)
    if fixed and not frame.is_global:
        return f": {fixed} POS are in degrees; expected " + (
            "--frame global" if frame.has_origin else "a problem with an origin"
        )
    held = ", ".join(f"{n} {kind}" for kind, n in counts.most_common(6) if kind != "FMT")
    said = f" in XKF1, NKF1 and POS; the log has {held or 'no messages'}"
    return said + (f" ({len(pos)} POS without a GPS fix)" if pos else "")
