"""Files that the page uploads and offers; the server touches no others."""

from __future__ import annotations

import json
import math
import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from netsp.app.app_policy import AppPolicy
from netsp.base.errors import InputError, UnansweredError
from netsp.base.validated import shown
from netsp.model.problem import Problem
from netsp.model.solution import Solution

MAPS = (
    ".geojson",
    ".kml",
    ".kmz",
    ".gpkg",
    ".dxf",
    ".000",
    ".gpx",
    ".plan",
    ".waypoints",
    ".wpl",
    ".fen",
    ".ral",
)
"""File-name extensions of maps in one file, unlike shapefiles, and images with a YAML file."""

EXPORTS = {
    "plan": "mission.plan",
    "wpl": "mission.waypoints",
    "cockpit": "mission.cmp",
    "geojson": "tour.geojson",
    "kml": "tour.kml",
    "csv": "tour.csv",
}
"""Formats in which a tour can be written, and the file name offered for each."""


def bare_name(name: str, policy: AppPolicy = AppPolicy()) -> str:
    """Return the last part of a file name from any operating system.

    Raises
    ------
    InputError
        The name is empty, hidden, not printable, or too long.
    """
    bare = PurePosixPath(PureWindowsPath(name).name).name
    if not bare or bare.startswith(".") or not bare.isprintable():
        raise InputError(f"file: expected a name, got {shown(name)}")
    if (size := len(bare.encode())) > (limit := policy.max_file_name):
        raise InputError(f"file: expected a name of at most {limit} bytes, got {size}")
    return bare


@dataclass(frozen=True)
class ImportAnswers:
    """Answers to what an import asks for.

    Attributes
    ----------
    base
        Latitude and longitude of the base, with a comma, in degrees.
    tether
        Length of the tether, metres.
    radius
        Radius of obstacles that are points, metres.
    line_width
        Width of open lines that are obstacles, metres.
    crs
        Coordinate system, as ``EPSG:32632`` or ``local``.
    viewpoints
        Viewpoints around each obstacle.
    standoff
        Distance of viewpoints from its surface, metres.
    units
        Unit of lengths in the file, as ``mm``.
    """

    base: str | None = None
    tether: float | None = None
    radius: float | None = None
    line_width: float | None = None
    crs: str | None = None
    viewpoints: int | None = None
    standoff: float | None = None
    units: str | None = None

    @classmethod
    def parse(cls, given: Mapping[str, str]) -> ImportAnswers:
        """Return the answers in the fields of a form; an empty field is no answer.

        Parameters
        ----------
        given : mapping
            Name of a field to text; other names do not count.

        Raises
        ------
        InputError
            A field is no positive number.
        """
        given_fields = {k: v.strip() for k, v in given.items() if v.strip()}
        viewpoints = _positive(given_fields, "viewpoints")
        if viewpoints is not None and viewpoints != int(viewpoints):
            raise InputError(f"viewpoints: expected a whole number, got {viewpoints:g}")
        return cls(
            base=given_fields.get("base"),
            crs=given_fields.get("crs"),
            units=given_fields.get("units"),
            viewpoints=None if viewpoints is None else int(viewpoints),
            tether=_positive(given_fields, "tether"),
            radius=_positive(given_fields, "radius"),
            line_width=_positive(given_fields, "line_width"),
            standoff=_positive(given_fields, "standoff"),
        )


def without_options(text: str) -> str:
    """Return a message without its clauses about options of the command line.

    Examples
    --------
    >>> without_options("no coordinate system; give it with --crs EPSG:4326, or --crs local")
    'no coordinate system'
    >>> without_options("1 open line (pier); expected a width (--line-width W), in metres")
    '1 open line (pier); expected a width, in metres'
    """
    bare = re.sub(r"\s*\([^()]*--[a-z][^()]*\)", "", text)
    bare = re.sub(r"(?<![\w-])--([a-z][a-z-]*):", lambda m: m[1].replace("-", " ") + ":", bare)
    return re.sub(r"(;|,| or)\s[^;,]*--[a-z][^;]*", "", bare)


def _positive(given_fields: Mapping[str, str], field: str) -> float | None:
    if field not in given_fields:
        return None
    label = field.replace("_", " ")
    try:
        value = float(given_fields[field])
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise InputError(f"{label}: expected a positive number, got {shown(given_fields[field])}")
    return value


def imported(
    name: str,
    content: bytes,
    tether_length: float | None = None,
    answers: ImportAnswers | None = None,
    policy: AppPolicy = AppPolicy(),
) -> tuple[dict[str, Any], list[str]]:
    """Read the problem in a file: a problem file, or a map (docs/guide/bring-your-site-in.md).

    Parameters
    ----------
    name : str
        Name of the file; its extension states the format.
    content : bytes
        Contents of the file.
    tether_length : float, optional
        Length for a map that states none, metres.
    answers : ImportAnswers, optional
        Answers of the user about a map.
    policy : AppPolicy
        Limits of the file and its name.

    Returns
    -------
    data : dict
        Problem, in the format of problem files.
    notes : list of str
        Repairs and omissions, one line each.

    Raises
    ------
    UnansweredError
        A map lacks something that the user can answer.
    InputError
        The file is too large, of an unknown format, or not valid.
    """
    file_name = bare_name(name, policy)
    extension = Path(file_name).suffix.lower()
    if len(content) > policy.max_file_bytes:
        raise InputError(
            f"{file_name}: {len(content)} bytes; expected at most {policy.max_file_bytes}"
        )
    notes: list[str] = []
    with tempfile.TemporaryDirectory(prefix="netsp-") as folder:
        file = Path(folder) / file_name
        file.write_bytes(content)
        try:
            if extension == ".json" and not is_map(content):
                problem = Problem.load(file)
            elif extension in (*MAPS, ".json"):
                problem = _site(file, notes, tether_length, answers or ImportAnswers())
            else:
                raise InputError(f"{file_name}: expected .json, {', '.join(MAPS)}")
        except UnansweredError as error:  # leave out the temporary folder, which is gone
            complaints, plain = (
                [without_options(text.replace(f"{folder}/", "")) for text in texts]
                for texts in (error.complaints, error.plain)
            )
            raise UnansweredError(complaints, plain, error.asks) from None
        except InputError as error:
            raise InputError(without_options(str(error).replace(f"{folder}/", ""))) from None
    lines = [without_options(note.replace(f"{folder}/", "")) for note in notes]
    return json.loads(problem.to_json()), lines


def _site(
    file: Path, notes: list[str], tether_length: float | None, answers: ImportAnswers
) -> Problem:
    from netsp.exchange.maps.options import InspectionOptions, SiteOptions
    from netsp.exchange.maps.projection import Projection
    from netsp.exchange.maps.site_import import import_site
    from netsp.roadmap.reachable_goals import UNREACHED, keep_reachable_goals, unreached_note

    projection = Projection.parse(answers.base, name="base") if answers.base else None
    makes_viewpoints = answers.viewpoints is not None and answers.standoff is not None
    inspection = (
        InspectionOptions(answers.viewpoints or 1, answers.standoff or 0.0)
        if makes_viewpoints
        else None
    )
    options = SiteOptions(
        tether=answers.tether,
        radius=answers.radius,
        line_width=answers.line_width,
        crs=answers.crs,
        units=answers.units,
        inspection=inspection,
    )
    try:
        site = import_site(file, projection, options=options)
    except UnansweredError as error:
        if tether_length is None or "tether" not in error.asks:
            raise
        notes.append(f"{file.name}: has no tether length: {tether_length:g} m, as before")
        site = import_site(file, projection, options=replace(options, tether=tether_length))
    problem = site.problem
    assert problem.site is not None
    in_table = set(problem.site.notes)
    notes += [f"{file.name}: {note}" for note in site.notes if note not in in_table]
    if site.viewpoints and problem.site.cropped is not None:
        problem, reasons = keep_reachable_goals(problem, site.viewpoints)
        if reasons:
            notes.append(f"{file.name}: {unreached_note(site.problem.goals, problem.goals)}")
            problem = site.keeping(problem, UNREACHED).problem
    return problem


def import_warnings(problem: Problem) -> list[str]:
    """Return warnings about a problem that was imported from a map, one line each.

    Parameters
    ----------
    problem : Problem
        Problem, perhaps edited since its import; a problem from no map has no warnings.
    """
    if problem.site is None:
        return []
    from netsp.exchange.maps.goal_depths import HEIGHTS_REMEDY, height_warning, surface_warning

    remedy = "set one depth for all in the panel"
    found = (surface_warning(problem, remedy), height_warning(problem, HEIGHTS_REMEDY))
    return [text for text in found if text is not None]


def exported(problem: Problem, solution: Solution, kind: str) -> tuple[str, str, list[str]]:
    """Return a tour as a mission file.

    Parameters
    ----------
    problem : Problem
        Problem that was solved.
    solution : Solution
        Its solution.
    kind : str
        One of `EXPORTS`.

    Returns
    -------
    name : str
        Name under which the file is offered.
    text : str
        Text of the file, as `netsp export` writes it.
    notes : list of str
        Notes and warnings of `netsp export`, one line each.

    Raises
    ------
    InputError
        The kind is unknown, the problem has no origin, or as
        `netsp.exchange.missions.mission_files.export`.
    """
    from netsp.exchange.maps.goal_depths import surface_warning
    from netsp.exchange.missions.export_margins import warnings
    from netsp.exchange.missions.export_notes import export_notes
    from netsp.exchange.missions.mission_files import ExportSettings, export

    if kind not in EXPORTS:
        raise InputError(f"export: expected one of {', '.join(EXPORTS)}, got {kind!r}")
    if problem.origin is None and kind != "csv":
        raise InputError(
            "origin: netsp does not know where the base is on the earth; enter its latitude and "
            "longitude in the panel"
        )
    with tempfile.TemporaryDirectory(prefix="netsp-") as folder:
        file = Path(folder) / EXPORTS[kind]
        points = export(problem, solution, file, kind)
        settings = ExportSettings()
        remarks = export_notes(problem, points, kind, settings)
        depth_warning = surface_warning(problem, "set one depth for all in the panel")
        notes = [
            *([depth_warning] if depth_warning is not None else []),
            *warnings(
                problem, solution, points, settings.policy.min_slack, settings.policy.min_clearance
            ),
            *remarks.warnings,
            *remarks.notes,
        ]
        return file.name, file.read_text(encoding="utf-8"), notes


def is_map(content: bytes) -> bool:
    """Return whether JSON is a map (GeoJSON or a QGroundControl plan) instead of a problem."""
    try:
        data = json.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError):  # `Problem.load` says what is wrong
        return False
    return isinstance(data, dict) and ("type" in data or "fileType" in data)
