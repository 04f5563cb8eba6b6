"""The log of a run, and its files."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from netsp.errors import InputError
from netsp.online.mission import Mission
from netsp.online.tether import Tether


@dataclass(frozen=True)
class LogRow:
    """One step: seconds, position (m), heading (rad), index of the target, mode, tether (m), share
    of the surface seen and seen if nothing stood in between, planning (s)."""

    time: float
    x: float
    y: float
    z: float
    yaw: float
    target: int
    mode: str
    tether: float
    coverage: float
    coverage_through: float
    replan_s: float


@dataclass(frozen=True)
class Run:
    """What came of a mission.

    log : one row per step. tether : at the end. summary : the numbers (`summarise`).
    """

    mission: Mission
    planner: str
    log: tuple[LogRow, ...]
    tether: Tether
    summary: dict[str, Any]


def write_run(run: Run, folder: str | Path) -> None:
    """log.csv, summary.json and mission.json into a folder, which is made."""
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
        mission = json.dumps(run.mission.model_dump(mode="json"), indent=1)
        (place / "mission.json").write_text(mission + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror or error}") from None


def _short(value: Any) -> Any:
    return round(value, 5) if isinstance(value, float) else value
