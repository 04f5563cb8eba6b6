"""Flights of random runs, kept in files, so that they can be judged again without flying."""

from __future__ import annotations

import gzip
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.simulator.surprises import SceneEvent

HERE = Path(__file__).resolve().parent

JUDGES = ("judge_runs.py", "taut_string.py")
"""Modules that decide a verdict; a verdict of other versions of them is out of date."""


class FlownStep(NamedTuple):
    """Step of a flight: time, s; position and length of the simulator's tether, metres."""

    time: float
    x: float
    y: float
    z: float
    tether: float
    mode: str


JUDGE = hashlib.sha256(b"".join((HERE / name).read_bytes() for name in JUDGES)).hexdigest()[:12]
"""Version of the judge: a digest of these modules as they were imported."""


@dataclass(frozen=True)
class Flight:
    """Flight of a random run.

    Attributes
    ----------
    kind, index, scene_name, vehicle
        Kind and number of the run, name of its scene, and vehicle.
    commit
        Version of the project that flew it.
    cpu_s
        CPU time of the flight, s.
    refused
        Message, if the mission was refused.
    mission, scene
        Mission as it was given, without its tour, and the true scene at 0 s, as JSON.
    happened
        Times, s, and events as JSON, in the order in which they happened.
    log
        Steps.
    summary
        Some numbers of the run's summary.
    responses
        Responses of the repairs.
    """

    kind: str
    index: int
    scene_name: str
    vehicle: str
    commit: str
    cpu_s: float
    refused: str | None = None
    mission: dict[str, Any] = field(default_factory=dict)
    scene: dict[str, Any] = field(default_factory=dict)
    happened: Sequence[tuple[float, dict[str, Any]]] = ()
    log: Sequence[FlownStep] = ()
    summary: dict[str, Any] = field(default_factory=dict)
    responses: Sequence[str] = ()

    def parsed_mission(self) -> Mission:
        """Return the mission as it was given, without its tour."""
        return Mission.model_validate(self.mission)

    def parsed_scene(self) -> Scene:
        """Return the true scene at 0 s."""
        return Scene.model_validate(self.scene)

    def parsed_events(self) -> list[tuple[float, SceneEvent]]:
        """Return times, s, and events, in the order in which they happened."""
        return [(time, SceneEvent.model_validate(event)) for time, event in self.happened]


def as_json(model: Mission | Scene | SceneEvent) -> dict[str, Any]:
    """Return a model as JSON that `model_validate` reads back."""
    data: dict[str, Any] = model.model_dump(mode="json", exclude_none=True, exclude={"tour"})
    return data


class FlightStore:
    """Folder of flights, a file each, and of the verdicts on them.

    Parameters
    ----------
    folder : Path or None
        Folder; with None, nothing is kept.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)

    def flight(self, kind: str, index: int) -> Flight | None:
        """Return a flight; None if it was not flown yet."""
        if self.folder is None or not (file := self._file(kind, index)).exists():
            return None
        data = json.loads(gzip.decompress(file.read_bytes()))
        data["log"] = [FlownStep(*step) for step in data["log"]]
        return Flight(**data)

    def keep_flight(self, flight: Flight) -> None:
        """Keep a flight."""
        if self.folder is not None:
            text = json.dumps(vars(flight), default=float)
            self._file(flight.kind, flight.index).write_bytes(gzip.compress(text.encode(), 5))

    def verdict(self, flight: Flight) -> dict[str, Any] | None:
        """Return the verdict on a flight; None if there is none of the present judge."""
        if self.folder is None or not (file := self._verdict_file(flight)).exists():
            return None
        data: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        return data if data.pop("judge") == JUDGE and data.pop("flight") == (
            self._digest(flight)
        ) else None  # fmt: skip

    def keep_verdict(self, flight: Flight, verdict: dict[str, Any]) -> None:
        """Keep a verdict on a flight."""
        if self.folder is not None:
            data = {**verdict, "judge": JUDGE, "flight": self._digest(flight)}
            text = json.dumps(data, default=float)
            self._verdict_file(flight).write_text(text, encoding="utf-8")

    def _file(self, kind: str, index: int) -> Path:
        assert self.folder is not None
        return self.folder / f"{kind}-{index}.json.gz"

    def _verdict_file(self, flight: Flight) -> Path:
        assert self.folder is not None
        return self.folder / f"{flight.kind}-{flight.index}.verdict.json"

    def _digest(self, flight: Flight) -> str:
        return hashlib.sha256(self._file(flight.kind, flight.index).read_bytes()).hexdigest()[:12]
