"""Log of a mission run, and its files."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from netsp.base.data_frames import frame_of
from netsp.base.errors import InputError
from netsp.base.field_types import LARGEST
from netsp.base.files import csv_rows, read_text
from netsp.base.reprs import Drawn
from netsp.base.validated import parse_json_object, shown
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene
from netsp.world.tether import Tether
from netsp.world.tether.strand import WIDTH

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class LogRow:
    """One step of a run.

    Parameters
    ----------
    time : float
        Seconds since the start.
    x, y, z : float
        Position, metres, z up.
    yaw : float
        Heading, rad.
    waypoint : int
        Next waypoint.
    mode : str
        Mode of the planner, as in `netsp.world.planner.Command`.
    tether : float
        Length of the taut tether, metres.
    payout : float
        Length that must be out, with slack and sag, metres. The limit applies to it.
    turning : float
        Sum of the angles by which the tether turns at its contacts, rad.
    coverage : float
        Share of the surface seen.
    coverage_through : float
        Share of the surface that would be seen without occlusion.
    replan_s : float
        CPU time of planning, s.
    limit : float
        Maximum payout, metres.
    shortening : bool
        Whether the limit was lowered and the payout is still above it.
    """

    time: float
    x: float
    y: float
    z: float
    yaw: float
    waypoint: int
    mode: str
    tether: float
    payout: float
    turning: float
    coverage: float
    coverage_through: float
    replan_s: float
    limit: float
    shortening: bool


@dataclass(frozen=True, repr=False)
class Run(Drawn):
    """Result of a mission run.

    Parameters
    ----------
    mission : Mission
        The mission as flown.
    planner : str
        Name of the planner.
    log : tuple of LogRow
        One row per step.
    tether : Tether
        The tether at the end.
    summary : dict
        Numbers of the run (`netsp.world.simulator.summary.summarise`).
    scene : Scene or None
        The scene at the end, if it has changed.
    tethers : tuple of (int, Tether)
        Indices of rows of the log and the tethers there, at intervals, if the scene has changed.
    """

    picture: ClassVar[str] = "netsp.view.pictures.mission_picture:draw_run"

    mission: Mission
    planner: str
    log: tuple[LogRow, ...]
    tether: Tether
    summary: dict[str, Any]
    scene: Scene | None = None
    tethers: tuple[tuple[int, Tether], ...] = ()

    def to_frame(self) -> pandas.DataFrame:
        """Return the log as a pandas DataFrame: a row for each step, a column for each field of
        `LogRow`.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        return frame_of(self.log)

    def __repr__(self) -> str:
        """Return mission, planner and results in one line."""
        s = self.summary
        return (
            f"<Run of {s['mission']!r} by {self.planner}: {s['visited']} of {s['waypoints']} "
            f"waypoints in {s['inspection_s']:.1f} s, longest tether {s['longest_tether']:.4g} "
            f"of {s['tether_length']:g}>"
        )


def write_run(run: Run, folder: str | Path) -> None:
    """Write log.csv, summary.json and mission.json to a folder, which is created if necessary.

    Raises
    ------
    InputError
        The folder cannot be written.
    """
    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
        text = io.StringIO()
        table = csv.DictWriter(text, fieldnames=list(LogRow.__dataclass_fields__))
        table.writeheader()
        table.writerows({k: _short(v) for k, v in asdict(r).items()} for r in run.log)
        (place / "log.csv").write_text(text.getvalue(), encoding="utf-8")
        summary = json.dumps(run.summary, indent=1, allow_nan=False)
        (place / "summary.json").write_text(summary + "\n", encoding="utf-8")
        data = run.mission.model_dump(mode="json")
        # a mission file names its scene relative to its own folder
        data["scene"] = Path(os.path.relpath(data["scene"], place)).as_posix()
        mission = json.dumps(data, indent=1)
        (place / "mission.json").write_text(mission + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror or error}") from None


FINITE = ("time", "x", "y", "z", "tether", "limit")
"""Columns of log.csv that must be finite, because pictures draw them."""


def check_log(rows: Sequence[dict[str, str]], file: Path) -> None:
    """Raise InputError, with line and column, if log.csv lacks a number or its times descend."""
    before = -math.inf
    for number, row in enumerate(rows, 2):
        for column in FINITE:
            try:
                value = float(row[column])
            except (KeyError, TypeError, ValueError):
                value = math.nan
            if not abs(value) < LARGEST:
                raise InputError(
                    f"{file}: line {number}: {column}: expected a number, got "
                    f"{shown(row.get(column))}"
                )
        if float(row["time"]) < before:
            raise InputError(f"{file}: line {number}: time: expected no less than {before:g}")
        before = float(row["time"])
    if before <= 0.0:
        raise InputError(f"{file}: time: expected a run of more than 0 s")


def read_run(folder: str | Path) -> Run:
    """Return a run from its files; its tether is straight, because files do not store its shape.

    Raises
    ------
    InputError
        Files cannot be read or are damaged, or the map changed during the run.
    """
    place = Path(folder)
    mission = Mission.load(place / "mission.json")
    summary = parse_json_object(read_text(place / "summary.json"), str(place / "summary.json"))
    file = place / "log.csv"
    rows = csv_rows(read_text(file), str(file))
    try:
        log = tuple(LogRow(**{k: _KINDS[k](v) for k, v in row.items()}) for row in rows)
        planner = str(summary["planner"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{folder}: a file of the run is damaged: {error}") from None
    if not log:
        raise InputError(f"{file}: holds no row")
    check_log(rows, file)
    if summary.get("surprises"):
        raise InputError(
            f"{folder}: the map changed during this run, and how its tether hung meanwhile is not "
            "kept; expected a run without surprises"
        )
    strand = np.zeros((2, WIDTH))
    strand[:, :3] = mission.anchor, (log[-1].x, log[-1].y, log[-1].z)
    return Run(mission, planner, log, Tether(strand, log[-1].tether), summary)


def _yes(text: str) -> bool:
    return text == "True"


_KINDS: dict[str, Callable[[str], Any]] = {
    **dict.fromkeys(LogRow.__dataclass_fields__, float),
    "waypoint": int,
    "mode": str,
    "shortening": _yes,
}
"""Functions that parse the columns of log.csv."""


def _short(value: Any) -> Any:
    return round(value, 5) if isinstance(value, float) else value


def describe_run(run: Run, units: str) -> str:
    """Return a summary of a run in a few lines."""
    s = run.summary
    return "\n".join(
        [
            f"mission  {s['mission']}, planner {s['planner']}: {s['status']}",
            f"visited  {s['visited']} of {s['waypoints']} waypoints",
            f"time     {s['inspection_s']:.1f} s{_time_home(s['home'])}",
            f"home     {_home(s['home'], units)}",
            *_tether_lines(s, units),
            *_bracket_lines(s, units),
            *_class_lines(s.get("words")),
            *_event_lines(s),
            *_left_out_lines(s),
        ]
    )


def _tether_lines(s: dict[str, Any], units: str) -> list[str]:
    """Return lines about tether, coverage and planning."""
    tether = (
        f"tether   longest {s['longest_tether']:.3f} of {s['tether_length']:g} {units}, "
        f"over the limit for {s['exceedance_s']:.1f} s"
    )
    if s["shortening_s"]:
        tether += f", shortened for {s['shortening_s']:.1f} s to a new one"
    seen = []
    if s["coverage"] is not None:
        seen = [
            f"seen     {100 * s['coverage']:.1f} % of the surface "
            f"({100 * s['coverage_through']:.1f} % if nothing stood in between)"
        ]
    lines = [tether, *seen]
    if s["longest_payout"] > s["longest_tether"] * (1.0 + 1e-9):
        payout = f"payout   at most {s['longest_payout']:.3f} {units}, with slack and sag"
        lines = [payout, *seen, tether]
    planning = (
        f"planning {s['replans']} times, median {1e3 * s['replan_median_s']:.1f} ms, worst "
        f"{1e3 * s['replan_worst_s']:.0f} ms"
    )
    return [*lines, planning]


def _bracket_lines(s: dict[str, Any], units: str) -> list[str]:
    """Return a line about a tether that may hang otherwise, if friction may hold it."""
    bracket = s.get("bracket")
    if not bracket or not (bracket["stops"] or bracket["over_s"]):
        return []
    line = (
        f"hangs    at most {bracket['longest']:.3f} {units} if friction holds it, over the limit "
        f"for {bracket['over_s']:.1f} s"
    )
    if not bracket["stops"]:
        return [line]
    widest = max(bracket["stops"], key=lambda b: b["at_most"] - b["at_least"])
    return [
        f"{line}; differs at {len(bracket['stops'])} waypoints, most at "
        f"#{_given(s, widest['waypoint'])}: {widest['at_least']:.2f} to {widest['at_most']:.2f} "
        f"{units}"
    ]


def _class_lines(words: dict[str, Any] | None) -> list[str]:
    """Return a line about the classes of the tether, if they were compared with a plan."""
    if words is None or words["as_planned"] is None:
        return []
    home = words["home"]
    if home is None:
        at_home = "not known at home"
    else:
        at_home = f"NOT empty at home: {home}" if home else "empty at home"
    return [
        f"classes  as planned at {words['as_planned']} of {len(words['stops'])} visits; {at_home}"
    ]


_RESPONSES = {
    "kept": "kept",
    "local": "repaired",
    "replan": "the rest planned again",
    "legs": "left to be found leg by leg",
}
"""Responses of a repair in words."""


def _event_lines(s: dict[str, Any]) -> list[str]:
    """Return lines about friction, surprises, repairs, contacts and errors."""
    lines = []
    if s["friction"] is not None:
        lines.append(
            f"friction multiplies the tension by {s['friction']['most_tension_ratio']:.2f} at most "
            f"(turning {s['friction']['most_turning_deg']:.0f}°), over the limit for "
            f"{s['friction']['over_s']:.1f} s"
        )
    if s["surprises"] is not None:
        found = s["surprises"]
        lines.append(
            f"surprise {found['happened']} events happened"
            + (f", {found['held_back']} had no room" if found["held_back"] else "")
            + (f"; the sensor found {found['found']} solids" if found["found"] else "")
        )
    lines += [
        f"repair   at {r['time']:.1f} s: {_RESPONSES[r['response']]} in {r['planning_s']:.2f} s, "
        f"{r['reason']}"
        for r in s.get("repairs", ())
    ]
    if s["contacts"]:
        lines.append(f"contact  with solids: {s['contacts']} times")
    if s["waited_s"]:
        lines.append(f"waited   {s['waited_s']:.1f} s for the anchor to come nearer")
    if s["defects"]:
        lines.append(f"defect   planning failed {s['defects']} times; please report the mission")
    if s["control_worst_s"] > 0.0:
        lines.append(
            f"control  median {1e3 * s['control_median_s']:.1f} ms, worst "
            f"{1e3 * s['control_worst_s']:.0f} ms; "
            f"{s['inspection_s'] / s['wall_s']:.0f} x real time"
        )
    return lines


def _left_out_lines(s: dict[str, Any]) -> list[str]:
    """Return lines about the first stalls, and the first waypoints left out."""
    # more than `waypoints` if some were tried again
    n_flown = len(s.get("given_as") or range(s["waypoints"]))
    lines = [
        f"stalled  at {stall['time']:.1f} s, on the way "
        + ("home" if stall["waypoint"] == n_flown else f"to waypoint #{stall['waypoint']}")
        for stall in s["stalls"][:5]
    ]
    lines += [
        f"left out waypoint #{_given(s, left['waypoint'])}: {left['reason']}"
        for left in s["left_out"][:5]
    ]
    if len(s["left_out"]) > 5:
        lines.append(f"         and {len(s['left_out']) - 5} more")
    return lines


def _given(summary: dict[str, Any], waypoint: int) -> int:
    """Return the number of a waypoint in the original mission."""
    given = summary.get("given_as")
    return waypoint if given is None else int(given[waypoint])


def _time_home(home: dict[str, Any]) -> str:
    if not home["seconds"]:
        return ""
    return f", and {home['seconds']:.1f} s {'home' if home['reached'] else 'on the way home'}"


def _home(home: dict[str, Any], units: str) -> str:
    if not home["reached"]:
        return f"not reached{': ' if home['reason'] else ''}{home['reason'] or ''}"
    if home["tether_free"]:
        return "reached, tether free"
    return f"reached, tether NOT free: {home['left']:.2f} {units} left"
