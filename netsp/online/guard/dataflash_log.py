"""Reader of the onboard logs of ArduPilot vehicles (.bin)."""

from __future__ import annotations

import contextlib
import io
import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from netsp.base.errors import InputError
from netsp.base.validated import shown
from netsp.online.guard.guard_policy import RecordingPolicy
from netsp.online.guard.message_tally import MessageTally
from netsp.online.guard.telemetry import Fix
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import EKF_CONSTANT, EKF_HORIZONTAL, NO_GPS_FIX, NO_NUMBERS
from netsp.online.link.modes import mode_name
from netsp.online.link.position_aiding import PositionAiding

FILTERS = ("XKF", "NKF")
"""Families of filters: EKF3, and EKF2 of older vehicles."""

MESSAGE_MARK = b"\xa3\x95"
"""First bytes of each message of a log."""

LOG_MESSAGES = ("XKF1", "XKF4", "NKF1", "NKF4", "POS", "ARM", "MODE", "WINC")
"""Messages that are read."""

UNUSED_REASON = "says nothing that the guard uses"
"""Reason to leave out messages of other kinds."""


def read_bin(
    file: Path,
    frame: Frame,
    tally: MessageTally,
    on_note: Callable[[str], None],
    policy: RecordingPolicy = RecordingPolicy(),
) -> list[Fix]:
    """Read the estimates of the primary filter, arming, modes and the winch.

    If the site has an origin and the log has POS with a GPS fix, the degrees of POS count;
    otherwise the metres of EKF3 (XKF1, XKF4), or of EKF2 in older vehicles, from the base.

    Raises
    ------
    InputError
        The file is no such log, or has no positions.
    """
    where = f"--replay: {file}"
    _check_begin(file, where, policy)
    messages, counts = _messages(file, where)
    sources = [*FILTERS]
    if frame.is_global:
        sources.insert(0, "POS")
    fixes: list[Fix] = []
    try:
        for source in sources:
            source_tally = MessageTally()
            fixes = _LogReader(messages, frame, source, policy).fixes(messages, source_tally)
            if any(fix.position is not None for fix in fixes):
                break
        else:
            raise InputError(f"{where}: has no positions{_help(messages, counts, frame)}")
    except AttributeError as error:
        raise InputError(f"{where}: a message without its column {shown(str(error))}") from None
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"{where}: not a log of ArduPilot: {error}") from None
    if frame.is_global and source != "POS":
        on_note(
            f"{where}: no POS with a GPS fix; {source}1 is taken as metres north, east and down of "
            "the base, as with --frame local; right only if the vehicle's estimate began there"
        )
    tally.add(source_tally)
    for kind, n in counts.items():
        if kind not in LOG_MESSAGES:
            tally.leave_out(kind, UNUSED_REASON, n)
    return fixes


def _check_begin(file: Path, where: str, policy: RecordingPolicy) -> None:
    """Refuse a file without an ArduPilot message near its beginning, such as a renamed file."""
    with open(file, "rb") as stream:
        begin = stream.read(policy.searched_bytes)
    if MESSAGE_MARK not in begin:
        what = "the file is empty" if not begin else "no message in its beginning"
        raise InputError(f"{where}: not a log of ArduPilot: {what}; expected a .bin of the vehicle")


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep pymavlink's remarks on damaged logs from the user's streams.

    Its indexer writes them from C, past Python's standard output and error.
    """
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
    """Return the messages of `LOG_MESSAGES`, and the number of messages of every kind."""
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
            messages = list(iter(lambda: log.recv_match(type=list(LOG_MESSAGES)), None))
            numbers = {k: name for k, name in log.id_to_name.items() if log.counts[k]}
            counts = Counter({name: int(log.counts[k]) for k, name in numbers.items()})
    except Exception as error:  # which it raises itself if a format is damaged
        raise InputError(f"{where}: not a log of ArduPilot: {error}") from None
    finally:
        for part in ("data_map", "filehandle"):
            with contextlib.suppress(AttributeError, BufferError):
                getattr(log, part).close()
    return messages, counts


class _LogReader:
    """Reader of the fixes of a log, with positions of POS or of a family of filters.

    Of several filters that run side by side the one that the vehicle uses counts, if it is logged.
    Older vehicles log the first one only under these names, and do not number it.
    """

    def __init__(
        self, messages: Sequence[Any], frame: Frame, source: str, policy: RecordingPolicy
    ) -> None:
        self.frame, self.source, self.policy = frame, source, policy
        logged = {m.get_type() for m in messages}
        filters = source
        if source == "POS":
            filters = next((f for f in FILTERS if f"{f}1" in logged or f"{f}4" in logged), "XKF")
        self.places, self.status = f"{filters}1", f"{filters}4"
        self.cores = {int(getattr(m, "C", 0)) for m in messages if m.get_type() == self.places}
        self.primary = 0
        self.aiding = PositionAiding()

    def fixes(self, messages: Sequence[Any], tally: MessageTally) -> list[Fix]:
        """Return the fixes of messages, and count each message."""
        found = []
        for m in messages:
            fix = self._fix(m)
            if isinstance(fix, str):
                tally.leave_out(m.get_type(), fix)
            else:
                tally.use(m.get_type())
                found.append(fix)
        return found

    def _fix(self, m: Any) -> Fix | str:
        """Return the fix of a message, or the reason to leave it out."""
        kind, time = m.get_type(), float(m.TimeUS) * 1e-6
        if not abs(time) < self.policy.max_time_s:
            return NO_NUMBERS
        if kind == self.status and (int(getattr(m, "PI", 0)) in self.cores or not self.cores):
            self.primary = int(getattr(m, "PI", 0))
        if kind in (self.places, self.status) and getattr(m, "C", self.primary) != self.primary:
            return "of a filter that the vehicle does not use"
        if kind == self.places:
            return self._filter_fix(m, time)
        if kind == "POS":
            is_used = self.source == "POS"
            return self._pos_fix(m, time) if is_used else _pos_unused(m, self.frame)
        if kind == self.status:
            return self._status_fix(m, time)
        if kind == "WINC":
            is_good = 0.0 <= float(m.Len) < self.policy.max_value
            return Fix(time, paid_out=float(m.Len)) if is_good else NO_NUMBERS
        if kind == "ARM":
            return Fix(time, armed=bool(m.ArmState))
        if kind == "MODE":
            return Fix(time, mode=mode_name(int(m.ModeNum)))
        return "of the other family of filters"

    def _status_fix(self, m: Any, time: float) -> Fix:
        # nav_filter_status: the first bits are those of EKF_STATUS_REPORT, but the one that says
        # there that nothing is known yet is here set for good once the vehicle has turned
        flags = int(m.SS)
        self.aiding.observe_innovations(time, float(getattr(m, "SP", math.nan)))
        self.aiding.observe_gps_checks(int(getattr(m, "GPS", 0)))
        return Fix(
            time,
            estimate=bool(flags & EKF_HORIZONTAL) and not flags & EKF_CONSTANT,
            aiding_fault=self.aiding.fault(time),
        )

    def _filter_fix(self, m: Any, time: float) -> Fix | str:
        """Return place, velocity and heading of a filter; no place if POS has it."""
        max_value, has_place = self.policy.max_value, self.source != "POS"
        place = float(m.PN), float(m.PE), float(m.PD)
        velocity = float(m.VN), float(m.VE), float(m.VD)
        if has_place and not all(abs(v) < max_value for v in place):
            return NO_NUMBERS
        is_good = all(abs(v) < max_value for v in velocity)
        return Fix(
            time,
            position=self.frame.from_local(*place) if has_place else None,
            heading=float(m.Yaw) % 360.0 if abs(float(m.Yaw)) < max_value else None,
            velocity=self.frame.velocity(*velocity) if is_good else None,
        )

    def _pos_fix(self, m: Any, time: float) -> Fix | str:
        """Return the vehicle's best place, in degrees."""
        lat, lon = float(m.Lat), float(m.Lng)
        if lat == 0.0 and lon == 0.0:
            return NO_GPS_FIX
        above = getattr(m, "RelHomeAlt", None)
        height = float(m.Alt if above is None else above)
        is_low = abs(height) < self.policy.max_value
        if not (abs(lat) <= 90.0 and abs(lon) <= 180.0 and is_low):
            return NO_NUMBERS
        return Fix(time, position=self.frame.from_degrees(lat, lon, height))


def _pos_unused(m: Any, frame: Frame) -> str:
    if float(m.Lat) == 0.0 and float(m.Lng) == 0.0:
        return NO_GPS_FIX
    return "metres of the filter count" + ("" if frame.has_origin else ": the site has no origin")


def _help(messages: Sequence[Any], counts: Counter[str], frame: Frame) -> str:
    """Return advice for a log without positions."""
    pos = [m for m in messages if m.get_type() == "POS"]
    fixed = sum(not (float(m.Lat) == 0.0 and float(m.Lng) == 0.0) for m in pos)
    if fixed and not frame.is_global:
        return f": {fixed} POS are in degrees; expected " + (
            "--frame global" if frame.has_origin else "a problem with an origin"
        )
    held = ", ".join(f"{n} {kind}" for kind, n in counts.most_common(6) if kind != "FMT")
    text = f" in XKF1, NKF1 and POS; the log has {held or 'no messages'}"
    return text + (f" ({len(pos)} POS without a GPS fix)" if pos else "")
