"""Recordings of any format: tables, telemetry logs of ground stations, and logs of vehicles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from netsp.base.errors import InputError
from netsp.base.files import check_file
from netsp.online.guard.dataflash_log import read_bin
from netsp.online.guard.message_tally import MessageTally
from netsp.online.guard.recording_checks import doubts
from netsp.online.guard.table_recording import read_recording
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.telemetry_log import read_tlog
from netsp.online.link.geo_frame import Frame

KINDS = ".csv, .csv.gz, .tlog or .bin"


def read_fixes(
    file: str | Path, frame: Frame, system: int | None = None, *,
    tally: MessageTally | None = None, on_note: Callable[[str], None] | None = None,
) -> Iterator[Fix]:  # fmt: skip
    """The fixes of a recording, in their order.

    Parameters
    ----------
    file : str or Path
        A table (a time; x, y, z, or north, east, down, or lat, lon, altitude or depth; vx, vy, vz
        of the same frame, heading, armed, mode, estimate, paid_out where it has them), a ground
        station's .tlog, or a .bin of ArduPilot.
    frame : Frame
        Of the site.
    system : int, optional
        System id of the vehicle; by default the only one that tells positions.
    tally : MessageTally, optional
        Told what becomes of each message or row.
    on_note : callable, optional
        Called with what was assumed and what was left out, one line each.

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
    tally = MessageTally() if tally is None else tally
    say = on_note or (lambda _: None)
    placed: list[Fix] = []
    found: Iterator[Fix]
    if name.endswith((".csv", ".csv.gz")):
        found = read_recording(Path(file), frame, tally, say)
    elif name.endswith(".tlog"):
        found = iter(read_tlog(Path(file), frame, system, tally, say))
    elif name.endswith(".bin"):
        found = iter(read_bin(Path(file), frame, tally, say))
    else:
        raise InputError(f"--replay: {file}: expected a file that ends in {KINDS}")
    for fix in found:
        if fix.position is not None:
            placed.append(fix)
        yield fix
    if not placed:
        raise InputError(f"--replay: {file}: has no positions")
    for note in (*tally.notes, *doubts(placed, frame.site)):
        say(f"--replay: {file}: {note}")
