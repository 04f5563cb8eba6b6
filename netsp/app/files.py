"""Files that come in by the page and go out by it; none but these are touched."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from netsp.errors import InputError
from netsp.models import shown
from netsp.problem import Problem
from netsp.solution import Solution

LONGEST_NAME = 200
"""Bytes: file systems take 255, and what is not saved yet is kept under a longer one."""

MOST_BYTES = 64 * 2**20
"""Of a file that comes in."""

MAPS = (".geojson", ".kml", ".kmz", ".gpkg", ".dxf", ".000")
"""Sites in one file; shapefiles come in several, and images with a YAML beside them."""

EXPORTS = {
    "plan": "mission.plan", "wpl": "mission.waypoints", "geojson": "tour.geojson",
    "csv": "tour.csv",
}  # fmt: skip
"""What a tour can be written as, and the name that it is offered under."""


def bare_name(name: str) -> str:
    """The last part of a name, whatever the system it comes from.

    Parameters
    ----------
    name : str
        As given.

    Returns
    -------
    str
        Without folders.

    Raises
    ------
    InputError
        Nothing is left, it is hidden, cannot be printed, or is too long.
    """
    last = PurePosixPath(PureWindowsPath(name).name).name
    if not last or last.startswith(".") or not last.isprintable():
        raise InputError(f"file: expected a name, got {shown(name)}")
    if len(last.encode()) > LONGEST_NAME:
        raise InputError(
            f"file: expected a name of at most {LONGEST_NAME} bytes, got {len(last.encode())}"
        )
    return last


def imported(
    name: str, content: bytes, tether_length: float | None = None
) -> tuple[dict[str, Any], list[str]]:
    """The problem in a file: a problem file, or a map of a site (docs/sites.md).

    Parameters
    ----------
    name : str
        Of the file; its ending says what it is.
    content : bytes
        Of the file.
    tether_length : float, optional
        Taken where a map says none.

    Returns
    -------
    data : dict
        As a problem file has it.
    notes : list of str
        What was repaired or left out.

    Raises
    ------
    InputError
        Too large, of no kind that is read, or not valid.
    """
    last = bare_name(name)
    ending = Path(last).suffix.lower()
    if len(content) > MOST_BYTES:
        raise InputError(f"{last}: {len(content)} bytes; expected at most {MOST_BYTES}")
    notes: list[str] = []
    with tempfile.TemporaryDirectory(prefix="netsp-") as folder:
        file = Path(folder) / last
        file.write_bytes(content)
        try:
            if ending == ".json" and not _is_geojson(content):
                problem = Problem.load(file)
            elif ending in (*MAPS, ".json"):
                problem = _site(file, notes, tether_length)
            else:
                raise InputError(f"{last}: expected .json, {', '.join(MAPS)}")
        except InputError as error:  # the folder is ours and gone
            raise InputError(str(error).replace(f"{folder}/", "")) from None
    return json.loads(problem.to_json()), notes


def _site(file: Path, notes: list[str], tether_length: float | None) -> Problem:
    from netsp.site.read import read_site

    try:
        return read_site(file, on_note=notes.append)
    except InputError as error:
        if tether_length is None or "has no tether length" not in str(error):
            raise
    notes[:] = [f"{file.name}: has no tether length: {tether_length:g} m, as before"]
    return read_site(file, on_note=notes.append, tether=tether_length)


def exported(problem: Problem, solution: Solution, kind: str) -> tuple[str, str]:
    """A tour as a mission file.

    Parameters
    ----------
    problem : Problem
        What was solved.
    solution : Solution
        Its solution.
    kind : str
        One of `EXPORTS`.

    Returns
    -------
    name : str
        That it is offered under.
    text : str
        What `netsp export` writes.

    Raises
    ------
    InputError
        An unknown kind, no origin; as of `netsp.export.write.export`.
    """
    from netsp.export.write import export

    if kind not in EXPORTS:
        raise InputError(f"export: expected one of {', '.join(EXPORTS)}, got {kind!r}")
    with tempfile.TemporaryDirectory(prefix="netsp-") as folder:
        file = Path(folder) / EXPORTS[kind]
        export(problem, solution, file, kind)
        return file.name, file.read_text(encoding="utf-8")


def _is_geojson(content: bytes) -> bool:
    try:
        data = json.loads(content)
    except (ValueError, RecursionError):  # `Problem.load` says what is wrong
        return False
    return isinstance(data, dict) and data.get("type") == "FeatureCollection"
