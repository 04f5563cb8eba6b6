"""Reading and writing whole files: kind and size are looked at first, no file is half written."""

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
from functools import lru_cache
from itertools import zip_longest
from pathlib import Path
from typing import ClassVar, Self

from netsp.base.errors import InputError
from netsp.base.validated import Model, read_model, shown

STANDARD = "-"
"""The name of a file that stands for standard input, or output."""

MOST_BYTES = 256 * 2**20
"""Largest file that is read, unpacked if it is packed: a problem of a million goals is smaller."""

CHUNK = 2**20

_NUMBERS = re.compile(r"[-+0-9. eE]*")


def check_file(path: str | Path, most: int = MOST_BYTES) -> None:
    """InputError unless this is a regular file of at most so many bytes, for readers that open it
    by themselves. Pipes and devices may never end, so they are refused."""
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
    if status.st_size > most:
        raise InputError(
            f"{path}: cannot be read: {status.st_size / 2**20:.4g} MiB; expected at most "
            f"{most / 2**20:g} MiB"
        )


def read_bytes(path: str | Path, most: int = MOST_BYTES) -> bytes:
    """Contents of a regular file of at most so many bytes, or of standard input, or `InputError` in
    one line."""
    if path == STANDARD:
        return _standard_input(most)
    check_file(path, most)
    try:
        with open(path, "rb") as stream:
            data = stream.read(most + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    if len(data) > most:
        raise InputError(f"{path}: cannot be read: more than {most / 2**20:g} MiB")
    return data


@lru_cache(maxsize=1)
def _standard_input(most: int) -> bytes:
    """All of it: it can be read but once, and is asked for by who looks what kind of file it is,
    too."""
    if sys.stdin is None:
        raise InputError("-: standard input is closed; expected a file piped in")
    if sys.stdin.isatty():
        raise InputError("-: standard input is a terminal; expected a file piped in")
    data = getattr(sys.stdin, "buffer", sys.stdin).read(most + 1)
    if len(data) > most:
        raise InputError(f"-: cannot be read: more than {most / 2**20:g} MiB")
    return data if isinstance(data, bytes) else str(data).encode()


def read_text(path: str | Path) -> str:
    """Return the contents of a UTF-8 text file without its byte order mark, or raise `InputError`.

    RFC 8259 (8.1) lets readers of JSON ignore the mark, which spreadsheets and editors write.
    """
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8") from None


def read_gzip(path: str | Path, most: int = MOST_BYTES) -> bytes:
    """Contents of a gzipped file that unpacks to at most so many bytes, or `InputError`."""
    data = read_bytes(path)
    out, size = [], 0
    try:
        while data:
            unpack = zlib.decompressobj(wbits=31)
            while data and not unpack.eof:
                piece = unpack.decompress(data, CHUNK)
                data = unpack.unconsumed_tail
                size += len(piece)
                if size > most:
                    raise InputError(f"{path}: unpacks to more than {most / 2**20:g} MiB")
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
    """Write a text to a file in UTF-8, replacing the file as `write_bytes` does.

    Parameters
    ----------
    path : str or Path
        The file; ``-`` is standard output.
    text : str
        Text.

    Raises
    ------
    InputError
        It cannot be written.
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
    """Write a file by renaming a finished one into place, so that it is never half written.

    Parameters
    ----------
    path : str or Path
        The file; through a symbolic link, what it points to is replaced. ``-`` is standard output.
    data : bytes
        Contents.

    Raises
    ------
    InputError
        It cannot be written.
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
    except ValueError as error:  # half a character, a zero
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
    """The folder, made if need be.

    Raises
    ------
    InputError
        It cannot be made, or nothing can be written there.
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
    """A folder to write to, tried before long work begins; taken away again if it was made here and
    the work ends in an error."""
    if folder is None:
        yield
        return
    there = Path(folder).exists()
    place = make_folder(folder)
    try:
        yield
    except BaseException:
        if not there and not any(place.iterdir()):
            place.rmdir()
        raise


def cell(text: str | None) -> str:
    """A text as a cell of a table that a spreadsheet takes for no formula (OWASP, "CSV injection"):
    what begins like one gets an apostrophe."""
    text = text or ""
    if _NUMBERS.fullmatch(text):
        return text
    risky = text.lstrip()[:1] in ("=", "+", "-", "@") or text[:1] in ("\t", "\r")
    return f"'{text}" if risky else text


def csv_lines(text: str, source: str) -> Iterator[list[str]]:
    """Yield the cells of each line of a CSV text, as `csv.reader`.

    Parameters
    ----------
    text : str
        The text.
    source : str
        What messages call it, such as the name of the file.

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
    """Return the rows of a CSV text by column name; the first line that is not empty has the names.

    Parameters
    ----------
    text : str
        The text, with or without a byte order mark.
    source : str
        What messages call it, such as the name of the file.

    Returns
    -------
    list of dict
        Cells as text. Lines without cells are left out; cells that a short line lacks are empty.

    Raises
    ------
    InputError
        A line cannot be read, or has more cells than there are names.

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
    """A model that is a file of its own, JSON of a format version."""

    file_kind: ClassVar[str] = "file"

    @classmethod
    def from_json(cls, text: str | bytes, *, source: str | None = None) -> Self:
        """Parse and validate the text of a file.

        Parameters
        ----------
        text : str or bytes
            JSON of the format version.
        source : str, optional
            What messages call it; by default the kind of file.

        Returns
        -------
        Self
            The model.

        Raises
        ------
        InputError
            Anything wrong, in one line.
        """
        if not isinstance(text, str | bytes):
            raise InputError(f"{cls.file_kind}: expected text, got {shown(text)}")
        return read_model(cls, text, source or cls.file_kind)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a file.

        Parameters
        ----------
        path : str or Path
            The file.

        Returns
        -------
        Self
            The model.

        Raises
        ------
        InputError
            The file cannot be read or is not valid, in one line.
        """
        if not isinstance(path, str | os.PathLike):
            raise InputError(f"path: expected the name of a file, got {shown(path)}")
        return cls.from_json(read_text(path), source=str(path))

    def to_json(self) -> str:
        """The model as JSON of format version 1, without what is not given.

        Returns
        -------
        str
            Text of a file.
        """
        data = self.model_dump(mode="json", exclude_none=True)
        return json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n"

    def save(self, path: str | Path) -> None:
        """Write the file, whole or not at all.

        Parameters
        ----------
        path : str or Path
            The file; one that is there is replaced. Files that it names are named as they are.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        write_text(path, self.to_json())
