"""Contents of films: moments of a tour, a run, a flight or a planned mission."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.view.pictures.mission_picture import title_of
from netsp.view.pictures.moments import (
    Moment,
    moments_of_flight,
    moments_of_mission,
    moments_of_plan,
    moments_of_run,
)
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import Run
from netsp.world.scene.scene import Scene


@dataclass(frozen=True)
class Film:
    """Contents of one panel of a film.

    Parameters
    ----------
    title : str
        Title of the panel.
    moments : sequence of Moment
        Moments at equal steps.
    length : float
        Duration of a run, s, or length of a tour, in the problem's units.
    places : ndarray, shape (n, 3)
        Goals or waypoints, including those that are added during the run.
    anchor : (x, y, z)
        First position of the anchor.
    scene : Scene, optional
        Scene of a film in space; None for the map of each moment.
    by_time : bool
        Whether `length` is a duration.
    """

    title: str
    moments: Sequence[Moment]
    length: float
    places: Floats
    anchor: tuple[float, float, float]
    scene: Scene | None = None
    by_time: bool = True

    @property
    def measured_in(self) -> str:
        """Name of the quantity along the slider, with its unit."""
        if self.by_time:
            return "time (s)"
        problem = self.moments[0].problem
        units = self.scene.units if self.scene else problem.units if problem else ""
        return f"distance ({units})"

    @property
    def every_fate(self) -> set[str]:
        """Fates of all goals or waypoints."""
        return {fate for m in self.moments for fate, which in m.fates.items() if which}


@dataclass(frozen=True)
class Step:
    """Step of several films: one moment of each.

    Parameters
    ----------
    name : str
        Text for the time or distance of the step.
    moments : tuple of int
        Index of the moment in each film.
    """

    name: str
    moments: tuple[int, ...]


def steps_of(films: Sequence[Film], count: int) -> tuple[str, list[Step]]:
    """Films that run together, all by time or all by distance; the shorter ones wait at their ends.
    Where some are of seconds and some of metres, all take as long.

    Parameters
    ----------
    films : sequence of Film
        Films, at least one.
    count : int
        Number of steps, at least two.

    Returns
    -------
    str, list of Step
        Name of the quantity that the steps measure, and the steps.
    """
    alike = len({film.measured_in for film in films}) == 1
    longest = [max(film.length for film in films) if alike else film.length for film in films]
    steps = []
    for share in np.linspace(0.0, 1.0, count):
        numbers = tuple(
            round(min(share * longest_tether / film.length, 1.0) * (len(film.moments) - 1))
            if film.length > 0.0
            else 0
            for film, longest_tether in zip(films, longest, strict=True)
        )
        steps.append(Step(f"{share * (longest[0] if alike else 100.0):.4g}", numbers))
    return films[0].measured_in if alike else "done (%)", steps


def film_of_plan(problem: Problem, solution: Solution, count: int) -> Film:
    """Return the film of a planned tour, of `count` steps."""
    title = f"{problem.name}: tour of {solution.length:.4g} {problem.units} by {solution.solver}"
    moments = moments_of_plan(problem, solution, count)
    length = float(polylines.length(np.array(solution.path)))
    places = np.array([g.position for g in problem.goals]).reshape(-1, 3)
    return Film(title, moments, length, places, problem.base, by_time=False)


def film_of_run(
    maps: Sequence[tuple[float, Problem]],
    rows: Sequence[dict[str, str]],
    tethers: Sequence[dict[str, Any]],
    since: Mapping[str, Mapping[int, float]],
    count: int,
) -> Film:
    """Return the film of a recorded run, of about `count` moments.

    The arguments are those of `netsp.view.pictures.moments.moments_of_run`.
    """
    problem = maps[-1][1]
    moments = moments_of_run(maps, rows, tethers, count, since)
    places = np.array([g.position for g in problem.goals]).reshape(-1, 3)
    seconds = float(rows[-1]["time"])
    return Film(f"{problem.name}, carried out", moments, seconds, places, problem.base)


def film_of_flight(run: Run, scene: Scene, count: int) -> Film:
    """Return the film of a flight in space, of about `count` moments."""
    moments = moments_of_flight(run, scene, count)
    mission = run.mission
    title, seconds = f"{mission.name}\n{title_of(run)}", run.log[-1].time
    return Film(title, moments, seconds, mission.places, mission.anchor, scene)


def film_of_mission(mission: Mission, scene: Scene, count: int) -> Film:
    """Return the film of a planned mission, of `count` steps.

    Raises
    ------
    InputError
        The mission has no tour.
    """
    moments = moments_of_mission(mission, scene, count)
    assert mission.tour is not None
    length, units = mission.tour.length, scene.units
    stops = len(mission.tour.stops)
    title = f"{mission.name}\nplanned by {mission.tour.solver}: {stops} of "
    title += f"{len(mission.waypoints)} waypoints, {length:.4g} {units}"
    return Film(
        title,
        moments,
        polylines.length(mission.tour.line),
        mission.places,
        mission.anchor,
        scene,
        by_time=False,
    )
