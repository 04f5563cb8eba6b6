"""Recordings of any format: tables, telemetry logs of ground stations, and logs of vehicles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from netsp.base.errors import InputError
from netsp.base.files import check_file
from netsp.online.guard.dataflash_log import read_bin
from netsp.online.guard.guard_policy import RecordingPolicy
from netsp.online.guard.message_tally import MessageTally
from netsp.online.guard.recording_checks import plausibility_notes
from netsp.online.guard.table_recording import read_table_fixes
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.telemetry_log import read_tlog
from netsp.online.link.geo_frame import Frame

ENDINGS = ".csv, .csv.gz, .tlog or .bin"
"""File endings of recordings, for messages."""


def read_fixes(
    file: str | Path,
    frame: Frame,
    system: int | None = None,
    *,
    tally: MessageTally | None = None,
    on_note: Callable[[str], None] | None = None,
    policy: RecordingPolicy = RecordingPolicy(),
) -> Iterator[Fix]:
    """Yield the fixes of a recording, in their order, one for each row or message.

    Parameters
    ----------
    file : str or Path
        Table (a time; x, y, z, or north, east, down, or lat, lon, altitude or depth; vx, vy, vz
        of
        the same frame, heading, armed, mode, estimate, paid_out if it has them), .tlog of a
        ground
        station, or .bin of ArduPilot.
    frame : Frame
        Frame of the site.
    system : int, optional
        System id of the vehicle; by default the only one with positions.
    tally : MessageTally, optional
        Counts the messages or rows that are used and left out.
    on_note : callable, optional
        Called with what was assumed and what was left out, one line each.
    policy : RecordingPolicy
        Limits of what is plausible.

    Raises
    ------
    InputError
        The file cannot be read, is of another kind, or has no positions.
    """
    name = str(file).lower()
    check_file(file)
    tally = MessageTally(policy) if tally is None else tally
    note = on_note or (lambda _: None)
    placed: list[Fix] = []
    found: Iterator[Fix]
    if name.endswith((".csv", ".csv.gz")):
        found = read_table_fixes(Path(file), frame, tally, note, policy)
    elif name.endswith(".tlog"):
        found = iter(read_tlog(Path(file), frame, system, tally, note, policy))
    elif name.endswith(".bin"):
        found = iter(read_bin(Path(file), frame, tally, note, policy))
    else:
        raise InputError(f"--replay: {file}: expected a file that ends in {ENDINGS}")
    for fix in found:
        if fix.position is not None:
            placed.append(fix)
        yield fix
    if not placed:
        raise InputError(f"--replay: {file}: has no positions")
    for text in (*tally.notes, *plausibility_notes(placed, frame, policy)):
        note(f"--replay: {file}: {text}")
