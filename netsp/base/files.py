"""Reading and writing of whole files: kind and size are checked first, and writing is atomic."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import stat
import sys
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import zip_longest
from pathlib import Path
from typing import ClassVar, Self

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_positive
from netsp.base.validated import MARKER_FIELDS, Model, kind_of, parse_json_object, read_model, shown

STANDARD = "-"
"""File name that means standard input or standard output."""


@dataclass(frozen=True)
class FilePolicy:
    """Policy of files that are read. All numbers are positive.

    Attributes
    ----------
    max_bytes
        Maximum size of a file, unpacked if it is packed. A problem of a million goals is smaller.
    unpack_bytes
        Number of bytes that are unpacked at a time, so that a file that unpacks to more than
        `max_bytes` is refused before it fills the memory.
    """

    max_bytes: int = 256 * 2**20
    unpack_bytes: int = 2**20

    def __post_init__(self) -> None:
        check_positive(self)


_NUMBERS = re.compile(r"[-+0-9. eE]*")


def check_file(path: str | Path, max_bytes: int = FilePolicy.max_bytes) -> None:
    """Raise InputError unless a path is a regular file of at most `max_bytes`.

    For readers that open the file by themselves. Pipes and devices may never end, so they are
    refused.
    """
    if path == STANDARD:
        raise InputError("-: this is not read from standard input; expected the name of a file")
    try:
        status = os.stat(path)
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read: {reason}") from None
    if not stat.S_ISREG(status.st_mode):
        kind = "a directory" if stat.S_ISDIR(status.st_mode) else "a pipe or a device"
        raise InputError(f"{path}: cannot be read: expected a file, got {kind}")
    if status.st_size > max_bytes:
        raise InputError(
            f"{path}: cannot be read: {status.st_size / 2**20:.4g} MiB; expected at most "
            f"{max_bytes / 2**20:g} MiB"
        )


def read_bytes(path: str | Path, max_bytes: int = FilePolicy.max_bytes) -> bytes:
    """Return the contents of a regular file, or of standard input for ``-``.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    if path == STANDARD:
        return _standard_input(max_bytes)
    check_file(path, max_bytes)
    try:
        with open(path, "rb") as stream:
            data = stream.read(max_bytes + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    if len(data) > max_bytes:
        raise InputError(f"{path}: cannot be read: more than {max_bytes / 2**20:g} MiB")
    return data


@lru_cache(maxsize=1)
def _standard_input(max_bytes: int) -> bytes:
    """Return all of standard input; the cache serves later calls, because a pipe is read only
    once."""
    if sys.stdin is None:
        raise InputError("-: standard input is closed; expected a file piped in")
    if sys.stdin.isatty():
        raise InputError("-: standard input is a terminal; expected a file piped in")
    data = getattr(sys.stdin, "buffer", sys.stdin).read(max_bytes + 1)
    if len(data) > max_bytes:
        raise InputError(f"-: cannot be read: more than {max_bytes / 2**20:g} MiB")
    return data if isinstance(data, bytes) else str(data).encode()


def read_text(path: str | Path) -> str:
    """Return the contents of a UTF-8 text file without its byte order mark, or raise `InputError`.

    RFC 8259 (8.1) lets readers of JSON ignore the mark, which spreadsheets and editors write.
    """
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8") from None


def is_mission_file(path: str | Path) -> bool:
    """Return whether a file is a mission, even if fields are missing or misspelt. False for files
    that cannot be read: reading them as problems reports why."""
    try:
        data = parse_json_object(read_text(path), str(path))
    except InputError:
        return False
    kind = kind_of(data)
    return kind == "mission" or (kind is None and not MARKER_FIELDS["mission"].isdisjoint(data))


def read_gzip(path: str | Path, policy: FilePolicy = FilePolicy()) -> bytes:
    """Return the unpacked contents of a gzipped file; raise InputError if they are too large."""
    data = read_bytes(path)
    out, size = [], 0
    try:
        while data:
            unpack = zlib.decompressobj(wbits=31)
            while data and not unpack.eof:
                piece = unpack.decompress(data, policy.unpack_bytes)
                data = unpack.unconsumed_tail
                size += len(piece)
                if size > policy.max_bytes:
                    limit = f"{policy.max_bytes / 2**20:g} MiB"
                    raise InputError(f"{path}: unpacks to more than {limit}")
                out.append(piece)
                if not data and not piece:
                    break
            if not unpack.eof:
                raise zlib.error("cut short")
            data = unpack.unused_data
    except zlib.error:
        raise InputError(f"{path}: not a gzip file, or cut short") from None
    return b"".join(out)


def write_text(path: str | Path, text: str) -> None:
    """Write a text in UTF-8 as `write_bytes` writes bytes.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    if path == STANDARD:
        sys.stdout.write(text)
        sys.stdout.flush()
        return
    try:
        data = text.encode()
    except UnicodeError as error:
        raise InputError(f"{shown(str(path))}: cannot be written: {error}"[:300]) from None
    write_bytes(path, data)


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a temporary file and rename it into place, so that no reader sees half a file.

    A symbolic link stays, and its target is replaced. The name ``-`` means standard output.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    if path == STANDARD:
        sys.stdout.buffer.write(data)
        sys.stdout.flush()
        return
    try:
        target = Path(os.path.realpath(path)) if os.path.islink(path) else Path(path)
        special = target.exists() and not target.is_file()  # /dev/stdout and the like
    except (UnicodeError, ValueError, OSError) as error:
        raise InputError(f"{shown(str(path))}: cannot be written: {error}"[:300]) from None
    if special:
        try:
            target.write_bytes(data)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None
        return
    try:
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name[:40]}.")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None
    except ValueError as error:  # a lone surrogate or a null character in the name
        raise InputError(f"{shown(str(path))}: cannot be written: {error}") from None
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)
        os.replace(name, target)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def make_folder(folder: str | Path) -> Path:
    """Create a folder unless it exists, and return its path.

    Raises
    ------
    InputError
        The folder cannot be created, or no files can be written to it.
    """
    place = Path(folder)
    if folder == STANDARD:
        raise InputError("-: a run is several files; expected the name of a folder")
    if place.exists() and not place.is_dir():
        raise InputError(f"{folder}: expected a folder, and it is a file")
    try:
        place.mkdir(parents=True, exist_ok=True)
        probe = place / ".netsp"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"{folder}: cannot be written to: {error.strerror or error}") from None
    return place


@contextmanager
def output_folder(folder: str | Path | None) -> Iterator[None]:
    """Create a folder before the body runs; if the body raises, remove the folder if it is new and
    empty."""
    if folder is None:
        yield
        return
    had_folder = Path(folder).exists()
    place = make_folder(folder)
    try:
        yield
    except BaseException:
        if not had_folder and not any(place.iterdir()):
            place.rmdir()
        raise


def csv_cell(text: str | None) -> str:
    """Return a text as a CSV cell that no spreadsheet evaluates as a formula.

    A text that begins like a formula gets an apostrophe in front (OWASP, "CSV injection").
    """
    text = text or ""
    if _NUMBERS.fullmatch(text):
        return text
    risky = text.lstrip()[:1] in ("=", "+", "-", "@") or text[:1] in ("\t", "\r")
    return f"'{text}" if risky else text


def csv_lines(text: str, source: str) -> Iterator[list[str]]:
    """Yield the cells of each line of a CSV text, as `csv.reader`; `source` names it in messages.

    Raises
    ------
    InputError
        A line cannot be read, for example because a cell has more than 131,072 characters.
    """
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        yield from reader
    except csv.Error as error:
        raise InputError(f"{source}: line {reader.line_num}: {error}") from None


def csv_rows(text: str, source: str) -> list[dict[str, str]]:
    """Return the rows of a CSV text as dictionaries; the first line with cells names the columns.

    Empty lines are skipped, and cells that a short line lacks are empty.

    Parameters
    ----------
    text : str
        Text, with or without a byte order mark.
    source : str
        Name in messages, such as that of the file.

    Raises
    ------
    InputError
        A line cannot be read, or has more cells than the header.

    Examples
    --------
    >>> csv_rows("x,y\\n1,2\\n", "path.csv")
    [{'x': '1', 'y': '2'}]
    """
    lines = (line for line in csv_lines(text.removeprefix("\ufeff"), source) if line)
    names = next(lines, [])
    rows = []
    for number, line in enumerate(lines, 1):
        if len(line) > len(names):
            raise InputError(
                f"{source}: row {number}: expected at most {len(names)} cells, got {len(line)}"
            )
        rows.append(dict(zip_longest(names, line, fillvalue="")))
    return rows


class FileModel(Model):
    """Model that is a JSON file of its own, with a format version."""

    file_kind: ClassVar[str] = "file"

    @classmethod
    def from_json(cls, text: str | bytes, *, source: str | None = None) -> Self:
        """Return the validated model that a JSON text describes.

        Parameters
        ----------
        text : str or bytes
            JSON of format version 1.
        source : str, optional
            Name of the text in messages; by default the kind of file.

        Raises
        ------
        InputError
            The text is not valid, in one line.
        """
        if not isinstance(text, str | bytes):
            raise InputError(f"{cls.file_kind}: expected text, got {shown(text)}")
        return read_model(cls, text, source or cls.file_kind)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the validated model in a file.

        Raises
        ------
        InputError
            The file cannot be read or is not valid, in one line.
        """
        if not isinstance(path, str | os.PathLike):
            raise InputError(f"path: expected the name of a file, got {shown(path)}")
        return cls.from_json(read_text(path), source=str(path))

    def to_json(self) -> str:
        """Return the model as JSON of format version 1, without fields that are None."""
        data = self.model_dump(mode="json", exclude_none=True)
        return json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n"

    def save(self, path: str | Path) -> None:
        """Write the model to a file, as JSON; an existing file is replaced at once.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        write_text(path, self.to_json())
