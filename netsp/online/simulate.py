"""Runs a mission: planner, vehicle and tether, step by step, with a log that tells all."""

from __future__ import annotations

import csv
import io
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.errors import InputError
from netsp.online.field import DistanceField
from netsp.online.mission import Mission
from netsp.online.planner import Planner, make_planner
from netsp.online.planner.base import DONE
from netsp.online.scene import Scene
from netsp.online.surfaces import extent
from netsp.online.tether import GeodesicTether, Tether
from netsp.online.tree import Grid

Floats = npt.NDArray[np.float64]

STEP = 0.1
"""Seconds between two decisions of the planner."""

STUCK = 600.0
"""Seconds at one waypoint after which it is given up."""


@dataclass(frozen=True)
class LogRow:
    """One step: seconds, position, index of the target, mode, tether (m), planning (s)."""

    time: float
    x: float
    y: float
    z: float
    target: int
    mode: str
    tether: float
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


def grid_of(mission: Mission, scene: Scene, field: DistanceField) -> Grid:
    """The grid that ways are sought on: the scene's bounds, or all there is and some room."""
    if scene.bounds is not None:
        low, high = np.array(scene.bounds[:3]), np.array(scene.bounds[3:])
    else:
        places = np.array([mission.anchor, mission.start, *mission.waypoints])
        low, high = extent(scene, places)
        room = 5.0 * mission.cell + mission.clearance
        low, high = low - room, high + room
    return Grid(field, low, high, mission.cell, mission.clearance)


def simulate(
    mission: Mission,
    planner: str = "predictive",
    *,
    scene: Scene | None = None,
    field: DistanceField | None = None,
    snap: bool = False,
    on_step: Callable[[LogRow, Planner], None] | None = None,
) -> Run:
    """Run a mission with a vehicle that goes straight to where it is told, at its speed.

    Parameters
    ----------
    planner : name (`netsp.online.planner.PLANNERS`). scene, field : when they are at hand.
    snap : move waypoints out of solids. on_step : is told every row; a KeyboardInterrupt ends the
    run, and what was done till then is returned.

    Raises
    ------
    InputError : before the first step: unknown planner, waypoints inside solids, anchor and start
        not in sight of one another, a tether that is shorter than the way between them.
    """
    scene = scene or mission.load_scene()
    field = field or scene.field()
    mission = mission.checked_waypoints(field, snap=snap)
    tethers = GeodesicTether(field, mission.delta)
    tether = tethers.start(mission.anchor, mission.start)
    if tether.length > mission.tether_length:
        raise InputError(
            f"tether_length: {mission.tether_length:g} is shorter than the way from anchor to "
            f"start, {tether.length:.4g}"
        )
    chosen = make_planner(planner, mission, field, tethers, grid_of(mission, scene, field))
    chosen.warm_up(np.array(mission.start), tether)
    robot, now, since = np.array(mission.start), 0.0, (0.0, -1)
    log: list[LogRow] = []
    interrupted = False
    begin = time.perf_counter()
    try:
        while True:
            command = chosen.step(robot, tether)
            x, y, z = (float(v) for v in robot)
            row = LogRow(
                round(now, 6), x, y, z, chosen.index, command.mode, tether.length, command.replan_s
            )
            log.append(row)
            if on_step is not None:
                on_step(row, chosen)
            if command.mode == DONE:
                break
            if since[1] != chosen.index:
                since = (now, chosen.index)
            elif now - since[0] > STUCK:
                chosen.give_up(f"not reached in {STUCK:g} s")
                continue
            stops, passed = advance(robot, command.way, mission.speed * STEP)
            blocked = field.distance(np.array(stops)).min() < -0.2 * mission.delta
            if blocked:
                chosen.give_up("the way to it leads through a solid")
            else:
                for stop in stops:
                    tether = tethers.update(tether, stop)
                robot = stops[-1]
                chosen.passed(passed)
            now += STEP
    except KeyboardInterrupt:
        interrupted = True
    summary = summarise(mission, chosen, log, tether, time.perf_counter() - begin, interrupted)
    return Run(mission, planner, tuple(log), tether, summary)


def advance(robot: Floats, way: Floats, step: float) -> tuple[list[Floats], int]:
    """The corners that a robot passes on its next `step` metres of a way and where it ends, and how
    many points of the way it has passed."""
    stops: list[Floats] = []
    here, left = robot, step
    for passed, point in enumerate(way):
        far = float(np.linalg.norm(point - here))
        if far > left:
            return [*stops, here + (point - here) * (left / far)], passed
        here, left = point, left - far
        stops.append(here)
    return stops or [robot], len(way)


def summarise(
    mission: Mission, planner: Planner, log: list[LogRow], tether: Tether, wall: float,
    interrupted: bool,
) -> dict[str, Any]:  # fmt: skip
    """The numbers of a run, as the papers give them.

    exceedance_s : seconds with a tether longer than it is. recovery_s : seconds to come back to the
    anchor afterwards, by retracing the tether, or the whole path (the paper does not say which).
    """
    lengths = np.array([r.tether for r in log])
    places = np.array([[r.x, r.y, r.z] for r in log])
    planned = [r.replan_s for r in log if r.replan_s > 0.0]
    walked = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    inspection = log[-1].time if log else 0.0
    by_tether, by_path = tether.length / mission.speed, walked / mission.speed
    return {
        "mission": mission.name,
        "planner": planner.name,
        "status": "interrupted" if interrupted else "done",
        "inspection_s": inspection,
        "recovery_s": {"tether": by_tether, "path": by_path},
        "total_s": {"tether": inspection + by_tether, "path": inspection + by_path},
        "path_m": walked,
        "tether_length": mission.tether_length,
        "longest_tether_m": float(lengths.max(initial=0.0)),
        "exceedance_s": float((lengths > mission.tether_length * (1 + 1e-9)).sum() * STEP),
        "visited": len(planner.reached),
        "waypoints": len(mission.waypoints),
        "skipped": [{"waypoint": k, "reason": why} for k, why in planner.skipped],
        "replans": len(planned),
        "replan_median_s": float(np.median(planned)) if planned else 0.0,
        "replan_worst_s": max(planned, default=0.0),
        "wall_s": wall,
    }


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
