"""Read-only contents of the page: a solution, a tour that was carried out, or a flown mission."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from netsp.app.solving import bound_message
from netsp.base.errors import InputError
from netsp.base.files import csv_rows, read_text
from netsp.base.geometry import polylines
from netsp.base.validated import parse_json_object
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.world.scene.scene import Scene, scene_of

SHOWN_FRAMES = 240
"""Number of moments of a run on the page's slider."""


@dataclass(frozen=True)
class Shown:
    """A page that cannot be edited.

    Parameters
    ----------
    data : dict
        The problem, as its file has it.
    answer : dict
        What is told of the tour.
    scene : Scene
        In space.
    solution : Solution or None
        What was planned.
    frames : list of dict
        The tether at moments of a run; empty for a plan.
    events : list of dict
        time, event, and what came of it.
    """

    data: dict[str, Any]
    answer: dict[str, Any]
    scene: Scene
    solution: Solution | None = None
    frames: list[dict[str, Any]] = field(default_factory=list)
    events: list[dict[str, str]] = field(default_factory=list)

    def facts(self) -> dict[str, Any]:
        """Profile of a run, as of `netsp.app.facts.facts`.

        Returns
        -------
        dict
            Tether out and height over the share of the time.
        """
        last = max(len(self.frames) - 1, 1)
        rows = [[k / last, f["length"], f["z"]] for k, f in enumerate(self.frames)]
        return {"sufficient": None, "margins": None, "profile": rows, "visits": []}

    def problem(self) -> Problem:
        """Return the site. Goals that a run has lost lie in obstacles.

        Returns
        -------
        Problem
            As it is at the end.
        """
        return Problem.from_run(json.dumps(self.data), "the run")

    def along(self, share: float) -> dict[str, Any]:
        """Return the tether at a share of the run's time.

        Parameters
        ----------
        share : float
            From 0 to 1.

        Returns
        -------
        dict
            Of a frame.
        """
        k = round(min(max(share, 0.0), 1.0) * (len(self.frames) - 1))
        return {**self.frames[k], "share": share}


def read_shown(source: str | Path, problem_file: str | Path | None = None) -> Shown:
    """Read a solution file with its problem, or the folder of a run of `execute` or `simulate`.

    Parameters
    ----------
    source : str or Path
        File or folder.
    problem_file : str or Path, optional
        The problem of a solution file.

    Returns
    -------
    Shown
        What is on the page.

    Raises
    ------
    InputError
        Files that cannot be read or do not belong together.
    """
    place = Path(source)
    if not place.is_dir():
        if problem_file is None:
            raise InputError(f"{source}: does not hold its problem; expected --problem FILE")
        return _of_plan(Problem.load(problem_file), Solution.load(place), str(source))
    if (place / "solution.json").exists():
        file = place / "problem.json"
        problem = Problem.from_run(read_text(file), str(file))
        return _of_execution(place, problem, Solution.load(place / "solution.json"))
    if (place / "mission.json").exists():
        return _of_mission(place)
    raise InputError(f"{source}: expected the folder of a run of netsp execute or netsp simulate")


def _of_plan(problem: Problem, solution: Solution, source: str) -> Shown:
    if problem.sha256 != solution.problem.sha256:
        raise InputError(f"{source}: solves another problem (sha256 differs)")
    if solution.length is None:
        raise InputError(f"{source}: has no tour (status {solution.status.value})")
    return Shown(
        json.loads(problem.to_json()), _answer(problem, solution), scene_of(problem), solution
    )


def _answer(problem: Problem, solution: Solution) -> dict[str, Any]:
    return {
        "version": 0,
        "stage": "done",
        "status": solution.status.value,
        "length": solution.length,
        **bound_message(solution.status, solution.length, solution.bound),
        "path": [list(p) for p in solution.path],
        "visits": [
            {"goal": v.goal, "tether": v.tether_length, "word": list(v.signature)}
            for v in solution.tour
        ],
    }


def _of_execution(place: Path, problem: Problem, solution: Solution) -> Shown:
    """Read a tour that was carried out: its path, tethers and events."""
    rows = _rows(place / "log.csv", ("time", "x", "y", "z", "tether", "mode"))
    stamps = np.array([float(r["time"]) for r in rows])
    kept = parse_json_object(
        '{"frames": ' + read_text(place / "tethers.json") + "}", str(place / "tethers.json")
    )["frames"]
    frames = []
    for frame in kept[:: max(1, len(kept) // SHOWN_FRAMES)]:
        k = min(int(np.searchsorted(stamps, frame["time"])), len(rows) - 1)
        frames.append(_frame(np.array(frame["nodes"], dtype=float), rows[k]))
    answer = {
        "version": 0,
        "stage": "run",
        "length": polylines.length(np.array(solution.path)),
        "path": [[float(r[k]) for k in "xyz"] for r in rows],
        "planned": [list(p) for p in solution.path],
        "visits": [
            {"goal": v.goal, "tether": v.tether_length}
            for v in solution.tour
            if v.goal < len(problem.goals)
        ],
        "summary": parse_json_object(read_text(place / "summary.json"), "summary.json"),
    }
    events = [
        {"time": r["time"], "event": r["event"], "text": f"{r['response']}: {r['reason']}"}
        for r in _rows(place / "events.csv", ("time", "event", "response", "reason"), min_count=0)
    ]
    return Shown(json.loads(problem.to_json()), answer, scene_of(problem), solution, frames, events)


def _of_mission(place: Path) -> Shown:
    """Read a mission that was flown; its tether is computed again along the path."""
    from netsp.plan.space.space_world import SpaceWorld
    from netsp.world.mission.anchor_track import AnchorTrack
    from netsp.world.mission.mission import Mission

    mission = Mission.load(place / "mission.json")
    scene = mission.load_scene()
    summary = parse_json_object(read_text(place / "summary.json"), "summary.json")
    rows = _rows(place / "log.csv", ("time", "x", "y", "z", "tether", "mode"))
    path = np.array([[float(r[k]) for k in "xyz"] for r in rows])
    world = SpaceWorld(mission, scene)
    state = world.present_tether
    track, frames, every = AnchorTrack.for_mission(mission), [], max(1, len(rows) // SHOWN_FRAMES)
    for k, row in enumerate(rows):
        anchor = None if track is None else track(float(row["time"]))
        state = world.model.update(state, path[k], anchor)
        if k % every == 0 or k == len(rows) - 1:
            frames.append(_frame(state.nodes, row))
    data = {
        "schema_version": 1,
        "name": mission.name,
        "units": scene.units,
        "base": list(mission.anchor),
        "tether_length": mission.tether_length,
        "clearance": mission.clearance,
        "obstacles": [],
        "goals": [{"position": [float(v) for v in p]} for p in mission.places],
    }
    answer = {
        "version": 0,
        "stage": "run",
        "length": polylines.length(path),
        "path": path.tolist(),
        "visits": [],
        "summary": summary,
    }
    return Shown(data, answer, scene, None, frames)


def _frame(nodes: Any, row: dict[str, str]) -> dict[str, Any]:
    return {
        "x": float(row["x"]),
        "y": float(row["y"]),
        "z": float(row["z"]),
        "time": float(row["time"]),
        "length": float(row["tether"]),
        "mode": row["mode"],
        "path": np.round(nodes, 3).tolist(),
        "word": [],
    }


def _rows(file: Path, columns: tuple[str, ...], min_count: int = 1) -> list[dict[str, str]]:
    text = read_text(file)
    rows = csv_rows(text, str(file))
    if len(rows) < min_count:
        raise InputError(f"{file}: holds no row")
    missing = [c for c in columns if rows and c not in rows[0]]
    if missing:
        raise InputError(f"{file}: lacks the column {missing[0]!r}")
    return rows
