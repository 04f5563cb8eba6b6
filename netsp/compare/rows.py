"""The results: one line of JSON for every trial, appended when it is finished.

A line is written whole and flushed to the disk, so a kill at any moment costs the trials that were
running. A last line without its end is what a kill in mid-write leaves: it is cut off, and its
trial run again.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from netsp.errors import InputError
from netsp.solution import write_text

SCHEMA = "netsp-trial/1"
Row = dict[str, Any]

_BEGIN = f'{{"schema": "{SCHEMA}"'.encode()


def read_rows(path: str | Path) -> list[Row]:
    """All rows of a results file; a torn last line is left out. InputError if it is not one."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    rows = []
    *lines, torn = data.split(b"\n")
    for number, line in enumerate(lines, start=1):
        try:
            row = json.loads(line)
            good = isinstance(row, dict) and row["schema"] == SCHEMA
        except (ValueError, KeyError):
            good = False
        if not good:
            raise InputError(
                f"{path}: line {number}: expected a row of schema {SCHEMA}, got "
                f"{line[:40].decode(errors='replace')!r}"
            )
        rows.append(row)
    begin = _BEGIN[: len(torn)]
    if not rows and not torn.startswith(begin):
        raise InputError(f"{path}: expected rows of schema {SCHEMA}; it is another kind of file")
    return rows


class RowsFile:
    """A results file of one study, open for appending; nobody else may have it open.

    done : ids of the trials that are in it. Raises InputError if the file holds anything but rows
    of this study.
    """

    def __init__(self, path: str | Path, study: str) -> None:
        self.path = Path(path)
        try:
            self._fd = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from None
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._fd)
            raise InputError(f"{path}: another comparison is writing to it") from None
        try:
            rows = read_rows(path)
            check_study(rows, study, str(path))
        except InputError:
            os.close(self._fd)
            raise
        self.done = {row["trial"] for row in rows}
        whole = self.path.read_bytes()
        os.ftruncate(self._fd, whole.rfind(b"\n") + 1)

    def append(self, row: Row) -> None:
        """Write a row, to the disk."""
        os.write(self._fd, (json.dumps(row, allow_nan=False) + "\n").encode())
        os.fsync(self._fd)
        self.done.add(row["trial"])

    def close(self) -> None:
        """Let others have it."""
        os.close(self._fd)

    def __enter__(self) -> RowsFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def check_study(rows: Iterable[Row], study: str, source: str) -> None:
    """InputError if a row belongs to another study (by its sha256)."""
    for number, row in enumerate(rows, start=1):
        if row["study"] != study:
            raise InputError(
                f"{source}: line {number}: is of another study ({row['study_name']!r}, sha256 "
                f"{row['study'][:12]}…); name another file"
            )


def combine(sources: list[str], target: str) -> int:
    """Join the results of shards of one study, each trial once; how many rows that makes."""
    seen: dict[str, Row] = {}
    study = ""
    for source in sources:
        rows = read_rows(source)
        study = study or (rows[0]["study"] if rows else "")
        check_study(rows, study, source)
        for row in rows:
            seen.setdefault(row["trial"], row)
    write_text(target, "".join(_lines(seen.values())))
    return len(seen)


def _lines(rows: Iterable[Row]) -> Iterator[str]:
    for row in rows:
        yield json.dumps(row, allow_nan=False) + "\n"
