"""Telemetry logs of ground stations (.tlog): a time of eight bytes before each MAVLink message."""

from __future__ import annotations

import binascii
import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from netsp.base.errors import InputError
from netsp.base.files import read_bytes
from netsp.online.guard.guard_policy import RecordingPolicy
from netsp.online.guard.message_tally import MessageTally
from netsp.online.guard.telemetry import Fix
from netsp.online.link.dialect import dialect, parser
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import AUTOPILOT, POSITIONS, Listener
from netsp.online.link.vehicle_kind import other_vehicle_warning

STAMP_BYTES = 8
"""Format of a log: length of the time stamp before each message, bytes."""

CHECKSUM_BYTES = 2
"""Format of MAVLink: length of the checksum after each message, bytes."""

_VERSION_1 = 0xFE
"""Format of MAVLink 1: first byte of a message."""

_VERSION_2 = 0xFD
"""Format of MAVLink 2: first byte of a message."""

_SIGNED = 1
"""Format of MAVLink 2: flag of a message with a signature."""

_MARKER = re.compile(b"[\xfd\xfe]")

_BITS_REVERSED = bytes(int(f"{k:08b}"[::-1], 2) for k in range(256))


def read_tlog(
    file: Path,
    frame: Frame,
    system: int | None,
    tally: MessageTally,
    on_note: Callable[[str], None],
    policy: RecordingPolicy = RecordingPolicy(),
) -> list[Fix]:
    """Read the messages of one vehicle, one fix for each message that is used.

    `system` is the vehicle's system id; by default the only one with positions.

    Raises
    ------
    InputError
        The file is no telemetry log; several vehicles have positions and `system` is None; no
        message is of `system`.
    """
    where = f"--replay: {file}"
    data = read_bytes(file)
    recording = _Recording.parse(data, frame, policy)
    if not recording.vehicles and not recording.others.total:
        raise InputError(f"{where}: {_no_log(data)}")
    vehicle = recording.vehicle(system, where)
    if not vehicle.has_positions and frame.is_global and not frame.is_given:
        other = _Recording.parse(data, frame.local(), policy)
        fallback = other.vehicle(system, where)
        if fallback.has_positions:
            on_note(
                f"{where}: no GLOBAL_POSITION_INT with a GPS fix; LOCAL_POSITION_NED is taken as "
                "metres north, east and down of the base, as with --frame local; right only if "
                "the vehicle's estimate began there"
            )
            recording, vehicle = other, fallback
    recording.count(vehicle, tally)
    if recording.foreign_bytes > 0:
        on_note(f"{where}: {recording.foreign_bytes:,} bytes left out: they belong to no message")
    kind = vehicle.listener.kind
    if kind is not None and not kind.is_ardusub:
        on_note(f"{where}: {other_vehicle_warning(kind)}")
    if not vehicle.has_positions:
        raise InputError(f"{where}: has no positions{_help(recording, vehicle, frame)}")
    return vehicle.fixes


def messages_of_log(data: bytes, policy: RecordingPolicy = RecordingPolicy()) -> Iterator[Any]:
    """Yield the messages of a log in order; bytes that belong to no message are skipped."""
    reads, error = parser(), dialect().MAVError
    at = 0
    while (begin := _next_marker(data, at + STAMP_BYTES)) >= 0:
        at = begin + 1 - STAMP_BYTES  # the next place to search if this is no message
        end = begin + _length(data, begin)
        if end > len(data) or (data[begin] == _VERSION_2 and data[begin + 2] & ~_SIGNED):
            continue
        if not _is_message(data, begin, end, policy):
            continue
        try:
            message = reads.decode(bytearray(data[begin:end]))
        except (error, struct.error, ValueError):
            continue
        at = end
        yield message


def _next_marker(data: bytes, begin: int) -> int:
    """Return the index of the next first byte of a message; -1 if there is none."""
    found = _MARKER.search(data, begin)
    return -1 if found is None else found.start()


def _length(data: bytes, begin: int) -> int:
    """Return the length in bytes of the message that begins at a marker, by its header."""
    header, signature = (6, 0) if data[begin] == _VERSION_1 else (10, 0)
    if begin + header > len(data):
        return header
    if data[begin] == _VERSION_2 and data[begin + 2] & _SIGNED:
        signature = 13
    return header + data[begin + 1] + CHECKSUM_BYTES + signature


def _is_message(data: bytes, begin: int, end: int, policy: RecordingPolicy) -> bool:
    """Return whether some bytes are a message, by their checksum.

    Messages of other dialects, which have no known checksum, are recognized by the times before
    and
    after them. pymavlink does the same in Python, which takes seconds for each megabyte of a
    file
    that is no log. `binascii.crc_hqx` has the polynomial of MAVLink's checksum, with the bits
    of each
    byte reversed.
    """
    if data[begin] == _VERSION_1:
        header, number = 6, data[begin + 5]
    else:
        header, number = 10, int.from_bytes(data[begin + 7 : begin + 10], "little")
    known = dialect().mavlink_map.get(number)
    if known is None:
        return _is_between_times(data, begin, end, policy)
    tail = begin + header + data[begin + 1]
    checked = data[begin + 1 : tail] + bytes([known.crc_extra])
    found = binascii.crc_hqx(checked.translate(_BITS_REVERSED), 0xFFFF)
    low, high = data[tail : tail + CHECKSUM_BYTES]
    return found == _BITS_REVERSED[low] << 8 | _BITS_REVERSED[high]


def _is_between_times(data: bytes, begin: int, end: int, policy: RecordingPolicy) -> bool:
    """Return whether the times before and after some bytes are of one log, or the log ends here."""
    following = end + STAMP_BYTES
    if following >= len(data):
        return end == len(data)
    before, after = (int.from_bytes(data[k - STAMP_BYTES : k], "big") for k in (begin, following))
    is_soon = abs(after - before) < 1e6 * policy.max_message_gap_s
    return data[following] in (_VERSION_1, _VERSION_2) and is_soon


def _no_log(data: bytes) -> str:
    """Return why a file without a single message has no positions, and what it may be instead."""
    instead = "expected the .tlog of a ground station"
    if data.startswith(b"\xa3\x95"):
        instead = "it begins as a log of a vehicle does: expected its name to end in .bin"
    elif data.startswith(b"\x1f\x8b"):
        instead = "it is compressed: unpack it with gunzip"
    return f"has no positions: not a telemetry log, because it holds no MAVLink message; {instead}"


@dataclass
class _Vehicle:
    """Messages of one system."""

    system: int
    listener: Listener
    fixes: list[Fix] = field(default_factory=list)
    tally: MessageTally = field(default_factory=MessageTally)

    @property
    def has_positions(self) -> bool:
        return any(f.position is not None for f in self.fixes)

    def add(self, message: Any) -> None:
        """Add a message to the fixes, or count why it has none."""
        fix = self.listener.read(message)
        kind = message.get_type()
        if fix is None and self.listener.left_out:
            self.tally.leave_out(kind, self.listener.left_out)
            return
        self.tally.use(kind)
        if fix is not None:
            self.fixes.append(fix)


class _Recording:
    """Recording, sorted by vehicle."""

    def __init__(self) -> None:
        self.vehicles: dict[int, _Vehicle] = {}
        self.others = MessageTally()
        self.foreign_bytes = 0

    @classmethod
    def parse(cls, data: bytes, frame: Frame, policy: RecordingPolicy) -> _Recording:
        """Parse a log, and sort its messages by vehicle."""
        self = cls()
        self.foreign_bytes = len(data)
        for message in messages_of_log(data, policy):
            self.foreign_bytes -= STAMP_BYTES + len(message.get_msgbuf())
            system = message.get_srcSystem()
            if message.get_srcComponent() != AUTOPILOT:
                kind = f"{message.get_type()} of component {message.get_srcComponent()}"
                self.others.leave_out(kind, "not of an autopilot (component 1)")
                continue
            vehicle = self.vehicles.get(system)
            if vehicle is None:
                vehicle = _Vehicle(system, Listener(frame, system))
                self.vehicles[system] = vehicle
            vehicle.add(message)
        return self

    def vehicle(self, system: int | None, where: str) -> _Vehicle:
        """Return the given vehicle, or the only one with positions."""
        if system is not None:
            if system not in self.vehicles:
                raise InputError(f"{where}: has no positions of system {system}{self._systems()}")
            return self.vehicles[system]
        if not self.vehicles and not self.others.total:
            raise InputError(
                f"{where}: has no positions: no MAVLink message; expected a telemetry log of a "
                "ground station"
            )
        if not self.vehicles:
            raise InputError(f"{where}: has no positions: no message of an autopilot")
        placed = [v for v in self.vehicles.values() if v.has_positions]
        if len(placed) > 1:
            names = " and ".join(str(v.system) for v in placed)
            raise InputError(
                f"{where}: systems {names} send positions; expected one of them with "
                + " or ".join(f"--system {v.system}" for v in placed)
            )
        return placed[0] if placed else next(iter(self.vehicles.values()))

    def _systems(self) -> str:
        systems = ", ".join(f"{v.system}" for v in self.vehicles.values())
        return f"; it has messages of system {systems}" if systems else "; it has no messages"

    def count(self, vehicle: _Vehicle, tally: MessageTally) -> None:
        """Count each message as used or left out for a vehicle."""
        for other in self.vehicles.values():
            if other is vehicle:
                tally.add(other.tally)
            else:
                kind = f"of system {other.system}"
                reason = f"not of the vehicle, system {vehicle.system}"
                tally.leave_out(kind, reason, other.tally.total)
        tally.add(self.others)


def _help(recording: _Recording, vehicle: _Vehicle, frame: Frame) -> str:
    """Return what to do about a recording without positions."""
    left_out = vehicle.tally.left_out.items()
    reasons = {
        (kind, reason): n
        for reason, kinds in left_out
        for kind, n in kinds.items()
        if kind in POSITIONS
    }
    if not reasons:
        placed = [v.system for v in recording.vehicles.values() if v.has_positions]
        expected = f" of system {vehicle.system}: expected {' or '.join(POSITIONS)}"
        return expected + (f"; or --system {placed[0]}" if placed else "")
    text = "; ".join(f"{n} {kind}: {reason}" for (kind, reason), n in reasons.items())
    local, degrees = (any(k == kind for k, _ in reasons) for kind in POSITIONS)
    if local and frame.is_global:
        text += "; expected --frame local to read the metres"
    elif degrees and not frame.is_global and frame.has_origin:
        text += "; expected --frame global to read the degrees"
    elif degrees and not frame.is_global:
        text += "; expected a problem with an origin to read the degrees"
    return f": {text}"
