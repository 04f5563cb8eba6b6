"""Read-only contents of the page: a solution, a tour that was carried out, or a flown mission."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from netsp.app.app_policy import AppPolicy
from netsp.app.facts import bound_message
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.plan.space.space_world import SpaceWorld
from netsp.view.report.opened import Opened, OpenedMission, json_of, open_result, reading_run
from netsp.view.report.run_page import rows_of
from netsp.world.mission.anchor_track import AnchorTrack
from netsp.world.mission.run_log import check_log
from netsp.world.scene.scene import Scene, scene_of


@dataclass(frozen=True)
class Shown:
    """Contents of a page that cannot be edited.

    Parameters
    ----------
    data : dict
        Problem, in the format of problem files.
    answer : dict
        Fields of the tour for the page.
    scene : Scene
        Scene for the view in space.
    solution : Solution or None
        Planned tour.
    frames : list of dict
        The tether at moments of a run; empty for a plan.
    events : list of dict
        Time and event, and the response to it.
    """

    data: dict[str, Any]
    answer: dict[str, Any]
    scene: Scene
    solution: Solution | None = None
    frames: list[dict[str, Any]] = field(default_factory=list)
    events: list[dict[str, str]] = field(default_factory=list)

    def facts(self) -> dict[str, Any]:
        """Return tether length and height by share of the time, as `netsp.app.facts.facts`."""
        n_intervals = max(len(self.frames) - 1, 1)
        rows = [[k / n_intervals, f["length"], f["z"]] for k, f in enumerate(self.frames)]
        return {"sufficient": None, "margins": None, "profile": rows, "visits": []}

    def problem(self) -> Problem:
        """Return the problem as it is at the end; goals that a run has lost lie in obstacles."""
        return Problem.from_run(json.dumps(self.data), "the run")

    def along(self, share: float) -> dict[str, Any]:
        """Return the frame at a share of the run's time, from 0 to 1."""
        k = round(min(max(share, 0.0), 1.0) * (len(self.frames) - 1))
        return {**self.frames[k], "share": share}


def read_shown(
    source: str | Path, problem_file: str | Path | None = None, policy: AppPolicy = AppPolicy()
) -> Shown:
    """Return the page of a solution file with its problem, or of the folder of a run.

    Raises
    ------
    InputError
        Files that cannot be read or do not belong together.
    """
    result = open_result(source, problem_file)
    with reading_run(source):
        if isinstance(result, Opened):
            return (
                _show_execution(result, policy)
                if result.run
                else _show_plan(result.problem, result.solution)
            )
        if result.run is None:
            raise InputError(f"{source}: is a mission; expected the folder of a flight")
        return _show_mission(result, result.run, policy)


def _show_plan(problem: Problem, solution: Solution) -> Shown:
    return Shown(json.loads(problem.to_json()), _answer(solution), scene_of(problem), solution)


def _answer(solution: Solution) -> dict[str, Any]:
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


def _show_execution(result: Opened, policy: AppPolicy) -> Shown:
    """Read a tour that was carried out: its path, tethers and events."""
    problem, solution, rows = result.problem, result.solution, result.rows
    assert result.run is not None
    stamps = np.array([float(r["time"]) for r in rows])
    frames, tethers = [], result.tethers or []
    for frame in tethers[:: max(1, len(tethers) // policy.shown_frames)]:
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
        "summary": json_of(result.run / "summary.json"),
    }
    events = [
        {"time": r["time"], "event": r["event"], "text": f"{r['response']}: {r['reason']}"}
        for r in rows_of(result.run / "events.csv")
    ]
    return Shown(json.loads(problem.to_json()), answer, scene_of(problem), solution, frames, events)


def _show_mission(result: OpenedMission, run: Path, policy: AppPolicy) -> Shown:
    """Read a mission that was flown; its tether is computed again along the path."""
    mission, scene = result.mission, result.scene
    rows = rows_of(run / "log.csv")
    check_log(rows, run / "log.csv")
    path = np.array([[float(r[k]) for k in "xyz"] for r in rows])
    world = SpaceWorld(mission, scene)
    state = world.present_tether
    track, frames, interval = (
        AnchorTrack.for_mission(mission),
        [],
        max(1, len(rows) // policy.shown_frames),
    )
    for k, row in enumerate(rows):
        anchor = None if track is None else track(float(row["time"]))
        state = world.model.update(state, path[k], anchor)
        if k % interval == 0 or k == len(rows) - 1:
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
        "summary": json_of(run / "summary.json"),
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
