"""Contents of a solution file or of the folder of a run, checked to belong together."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.files import is_mission_file, read_text
from netsp.base.geometry import polylines
from netsp.base.validated import parse_json
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.plan.tour_plan import HOME
from netsp.view.pictures.film import (
    Film,
    film_of_flight,
    film_of_mission,
    film_of_plan,
    film_of_run,
)
from netsp.view.pictures.moments import CANCELLED, LEFT_OUT, VISITED
from netsp.view.report import run_page
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import check_log, read_run
from netsp.world.scene.scene import Scene


@contextmanager
def reading_run(source: str | Path | None) -> Iterator[None]:
    """Turn errors that damaged files of a run cause into InputError, which names the source."""
    try:
        yield
    except (KeyError, IndexError, ValueError, TypeError, OverflowError) as error:
        raise InputError(
            f"{source}: a file of the run is damaged: {type(error).__name__}: {error}"
        ) from None


@dataclass(frozen=True)
class Opened:
    """Contents of a file or folder that a report is about.

    Parameters
    ----------
    problem : Problem
        Problem of the solution.
    solution : Solution
        Solution with a tour.
    rows : list of dict
        Rows of the log of a run; empty for a solution.
    tethers : list of dict or None
        Tethers of a run; None for a solution.
    run : Path or None
        Folder of a run; None for a solution.
    maps : sequence of (float, Problem)
        Maps of a run, each with the time, s, from which it applied; the first from 0.
    """

    problem: Problem
    solution: Solution
    rows: Sequence[dict[str, str]] = ()
    tethers: list[dict[str, Any]] | None = None
    run: Path | None = None
    maps: Sequence[tuple[float, Problem]] = ()

    @property
    def driven(self) -> Floats | None:
        """Path (k, 3) of the robot in a run; None for a solution."""
        if not self.rows:
            return None
        return np.array([[float(r[k]) for k in "xyz"] for r in self.rows])

    @property
    def order(self) -> dict[int, int] | None:
        """Number of the visit to each goal that a run visited; None for a solution.

        Raises
        ------
        KeyError, ValueError
            The list of visits is damaged.
        """
        if self.run is None:
            return None
        goals = [int(r["goal"]) for r in run_page.rows_of(self.run / "visits.csv")]
        return {goal: n for n, goal in enumerate((g for g in goals if g != HOME), 1)}

    @property
    def fates(self) -> dict[int, str]:
        """Goals that a run did not visit, with the reason in two words.

        Raises
        ------
        InputError
            The summary of the run is damaged.
        """
        if self.run is None:
            return {}
        file = self.run / "summary.json"
        with reading_run(file):
            s = json_of(file)
            left_out = {int(x["goal"]): LEFT_OUT for x in s["left_out"]}
            return left_out | {int(g): CANCELLED for g in s["cancelled"]}

    def film(self, count: int) -> Film:
        """Return the film of the tour or run, of about `count` moments.

        Raises
        ------
        InputError
            A file of the run is damaged.
        """
        if not self.tethers:
            return film_of_plan(self.problem, self.solution, count)
        with reading_run(self.run):
            return film_of_run(self.maps, self.rows, self.tethers, self._since(), count)

    def _since(self) -> dict[str, dict[int, float]]:
        """Times in seconds at which the fates of goals in a run were decided, by fate."""
        assert self.run is not None
        visits = run_page.rows_of(self.run / "visits.csv")
        summary = json_of(self.run / "summary.json")
        left = {int(x["goal"]): self._covered(int(x["goal"])) for x in summary["left_out"]}
        cancelled = [int(g) for g in summary["cancelled"]]
        times = summary.get("cancelled_s", [math.inf] * len(cancelled))  # older runs have none
        visited = {int(v["goal"]): float(v["time"]) for v in visits if int(v["goal"]) != HOME}
        return {
            VISITED: visited,
            LEFT_OUT: left,
            CANCELLED: dict(zip(cancelled, map(float, times), strict=True)),
        }

    def _covered(self, goal: int) -> float:
        """Return the time, s, from which an obstacle covers a goal; inf if none does."""
        for time, problem in self.maps:
            if goal < len(problem.goals):
                place, min_distance = problem.goals[goal].position[:2], problem.clearance
                if any(
                    float(o.signed_distance(place)) < min_distance - problem.tolerance
                    for o in problem.obstacles
                ):
                    return time
        return math.inf


@dataclass(frozen=True)
class OpenedMission:
    """Mission that a report is about.

    Attributes
    ----------
    mission
        Mission, as planned or as flown.
    run
        Folder of the flight; None if it was not flown.
    """

    mission: Mission
    run: Path | None = None

    @cached_property
    def scene(self) -> Scene:
        """Scene of the mission."""
        return self.mission.load_scene()

    def film(self, count: int) -> Film:
        """Return the film of the tour or flight, of about `count` moments.

        Raises
        ------
        InputError
            A file of the flight is damaged, or the mission has no tour and was not flown.
        """
        if self.run is None:
            return film_of_mission(self.mission, self.scene, count)
        flight = read_run(self.run)
        with reading_run(self.run):
            return film_of_flight(flight, self.scene, count)


def open_result(
    source: str | Path, problem_file: str | Path | None = None
) -> Opened | OpenedMission:
    """Return a solution, a planned mission, or the folder of a run in the plane or in space.

    `problem_file` is the problem of a solution file.

    Raises
    ------
    InputError
        A file cannot be read, or the files do not belong together.
    """
    place = Path(source)
    if not place.is_dir():
        is_solution = not is_mission_file(source)
        return opened(source, problem_file) if is_solution else OpenedMission(Mission.load(source))
    if (place / "solution.json").exists() or not (place / "mission.json").exists():
        return opened(source, problem_file)
    return OpenedMission(Mission.load(place / "mission.json"), place)


def opened(source: str | Path, problem_file: str | Path | None) -> Opened:
    """Return the contents of a solution file and its problem file, or of a planar run's folder.

    Raises
    ------
    InputError
        A file cannot be read, or the files do not belong together.
    """
    file: str | Path = source
    run = Path(source) if Path(source).is_dir() else None
    if run is not None:
        if (run / "mission.json").exists() and not (run / "solution.json").exists():
            raise InputError(f"{source}: is of a mission; expected a run of a problem")
        problem_file = run / "problem.json"
        file = run / "solution.json"
        if not file.exists():
            raise InputError(f"{source}: is not the folder of a run; expected solution.json in it")
    solution = Solution.load(file)
    if problem_file is None:
        raise InputError(f"{source}: does not hold its problem; expected --problem FILE")
    problem = (
        Problem.load(problem_file)
        if run is None
        else Problem.from_run(read_text(problem_file), str(problem_file))
    )
    if run is None and problem.sha256 != solution.problem.sha256:
        raise InputError(f"{source}: solves another problem than {problem_file} (sha256 differs)")
    if solution.length is None:
        raise InputError(f"{source}: has no tour (status {solution.status.value})")
    if len(solution.path) < 2:
        raise InputError(f"{source}: path: expected at least 2 points, got {len(solution.path)}")
    beyond = [v.goal for v in solution.tour if v.goal >= len(problem.goals)]
    if beyond:
        raise InputError(
            f"{source}: tour: no goal #{beyond[0]}; expected #0 to #{len(problem.goals) - 1}"
        )
    drawn = polylines.length(np.array(solution.path))
    if abs(drawn - solution.length) > 0.05 * max(drawn, solution.length):
        raise InputError(
            f"{source}: path: is {drawn:.4g} long; expected about length, {solution.length:.4g}"
        )
    rows = run_page.rows_of(run / "log.csv") if run else []
    if run is not None and not rows:
        raise InputError(f"{run / 'log.csv'}: holds no row")
    if run is not None:
        check_log(rows, run / "log.csv")
    tethers = json_of(run / "tethers.json") if run else None
    maps = [(0.0, problem)]
    if run is not None and (run / "maps.json").exists():
        maps = _maps_of(run / "maps.json")
    return Opened(problem, solution, rows, tethers, run, maps)


def _maps_of(file: Path) -> list[tuple[float, Problem]]:
    found = json_of(file)
    try:
        maps = [
            (float(m["time"]), Problem.from_run(json.dumps(m["problem"]), str(file))) for m in found
        ]
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{file}: expected times and problems: {error}") from None
    times = [time for time, _ in maps]
    if not times or times[0] != 0.0 or not all(a <= b for a, b in pairwise(times)):
        raise InputError(f"{file}: expected times from 0 on, got {times[:4]}")
    return maps


def json_of(file: Path) -> Any:
    """Return the contents of a JSON file of a run; raise InputError if it is not JSON."""
    return parse_json(read_text(file), str(file))
