"""Results files: a line of JSON for each trial, appended when the trial is finished.

A line is written whole and flushed to disk, so killing the process costs only the trials that were
running. If it was killed while writing, the last line is incomplete: it is removed, and its trial
runs again.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from netsp.base.errors import InputError
from netsp.base.field_types import LARGEST
from netsp.base.files import STANDARD, read_bytes, read_gzip

SCHEMA = "netsp-trial/1"
TrialRow = dict[str, Any]

LOST = frozenset({"crashed", "killed", "timeout", "out_of_memory"})
"""Statuses of trials whose worker ended, or may have ended."""

FAILED = LOST | {"error"}
"""Statuses of trials without a result."""

_BEGIN = f'{{"schema": "{SCHEMA}"'.encode()


_TEXTS = ("study", "study_name", "trial", "status", "message", "finished", "machine")
_TABLES = ("world", "roadmap", "solver")


def read_rows(path: str | Path) -> list[TrialRow]:
    """Return all rows of a results file, without an incomplete last line.

    A file whose name ends in .gz is unpacked. Raises InputError if the file has no rows.
    """
    data = read_gzip(path) if Path(path).suffix == ".gz" else read_bytes(path)
    rows = []
    *lines, torn = data.split(b"\n")
    for number, line in enumerate(lines, start=1):
        row = _parsed(line)
        if row is None:
            raise InputError(
                f"{path}: line {number}: expected a row of schema {SCHEMA}, got "
                f"{line[:40].decode(errors='replace')!r}"
            )
        rows.append(row)
    begin = _BEGIN[: len(torn)]
    if not rows and not torn.startswith(begin):
        raise InputError(f"{path}: expected rows of schema {SCHEMA}; it is another kind of file")
    return rows


def _parsed(line: bytes) -> TrialRow | None:
    """Return the row in a line, or None if the line is no row."""
    try:
        row = json.loads(line, parse_constant=_no_constant)
    except (ValueError, RecursionError):
        return None
    good = (
        isinstance(row, dict)
        and row.get("schema") == SCHEMA
        and all(isinstance(row.get(name), str) for name in _TEXTS)
        and all(isinstance(row.get(name), dict) for name in _TABLES)
        and isinstance(row["solver"].get("label"), str)
        and isinstance(row["roadmap"].get("label"), str)
        and all(
            isinstance(s, int) and s is not True
            for s in (row.get("seed"), row["world"].get("seed"))
        )
        and all(_fits(row["world"].get(k), kinds) for k, kinds in _WORLD.items())
        and all(_fits(row.get(k), kinds) for k, kinds in _VALUES.items())
        and (row.get("length") is None or (row.get("total_s") or 0.0) > 0.0)
        and all(isinstance(v, str) for v in (row.get("versions") or {}).values())
        and all(
            isinstance(p, list)
            and len(p) == 3
            and _fits(p[0], (int, float))
            and all(_fits(v, _MAYBE) for v in p[1:])
            for p in row.get("history") or ()
        )
    )
    return row if good and _encodable(row) else None


def _encodable(row: object) -> bool:
    """Return whether all texts can be encoded; a lone surrogate cannot."""
    try:
        json.dumps(row, ensure_ascii=False).encode()
    except UnicodeError:
        return False
    return True


_MAYBE = (int, float, type(None))
_WORLD: dict[str, tuple[type, ...]] = {
    "goals": (int,),
    "tether_length": (int, float),
    "family": (str,),
}
_VALUES: dict[str, tuple[type, ...]] = {
    "length": _MAYBE,
    "lower_bound": _MAYBE,
    "gap": _MAYBE,
    "total_s": _MAYBE,
    "cpu_s": _MAYBE,
    "roadmap_s": _MAYBE,
    "matrix_s": _MAYBE,
    "solve_s": _MAYBE,
    "longest_tether": _MAYBE,
    "entangled": (int, type(None)),
    "redrawn": (int, type(None)),
    "problem_sha256": (str, type(None)),
    "versions": (dict, type(None)),
    "history": (list, type(None)),
    "lower_bound_of": (str, type(None)),
}
"""Types of the fields of a row that pages rely on."""


def _fits(value: object, kinds: tuple[type, ...]) -> bool:
    if isinstance(value, bool) or not isinstance(value, kinds):
        return False
    return not isinstance(value, int | float) or abs(value) <= LARGEST


def _no_constant(name: str) -> None:
    raise ValueError(name)


class RowsFile:
    """Results file of one study, open for appending and locked.

    Attributes
    ----------
    done
        Identifiers of the trials in the file.

    Raises
    ------
    InputError
        The file has content other than rows of this study.
    """

    def __init__(self, path: str | Path, study: str) -> None:
        self.path = Path(path)
        if path == STANDARD:
            raise InputError("-: a comparison resumes from its results; expected a file's name")
        try:
            if self.path.exists() and not self.path.is_file():
                raise InputError(f"{path}: expected a file of results, not a folder or a device")
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

    def append(self, row: TrialRow) -> None:
        """Write a row to disk, or raise InputError and write nothing."""
        data = (json.dumps(row, allow_nan=False) + "\n").encode()
        end = os.fstat(self._fd).st_size
        try:
            while data:
                data = data[os.write(self._fd, data) :]
            os.fsync(self._fd)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._fd, end)
            raise InputError(f"{self.path}: cannot be written: {error.strerror}") from None
        self.done.add(row["trial"])

    def close(self) -> None:
        """Close the file, which unlocks it."""
        os.close(self._fd)

    def __enter__(self) -> RowsFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def check_study(rows: Iterable[TrialRow], study: str, source: str) -> None:
    """Raise InputError if a row belongs to another study, by its sha256."""
    for number, row in enumerate(rows, start=1):
        if row["study"] != study:
            raise InputError(
                f"{source}: line {number}: is of another study ({row['study_name']!r}, sha256 "
                f"{row['study'][:12]}…); name another file"
            )


def combine(sources: list[str], target: str) -> int:
    """Add the rows of several shards to a results file, each trial once; return how many were
    added.

    Raises InputError if the sources hold no trial or rows of several studies, or if the target
    exists and is not a results file of the same study.
    """
    found: list[TrialRow] = []
    for source in sources:
        rows = read_rows(source)
        check_study(rows, (found or rows)[0]["study"] if found or rows else "", source)
        found += rows
    if not found:
        raise InputError(f"{sources[0]}: holds no trial yet")
    with RowsFile(target, found[0]["study"]) as out:
        for row in found:
            if row["trial"] not in out.done:
                out.append(row)
        return len(out.done)
