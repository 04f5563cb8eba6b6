"""Beginning of a flight elsewhere than at the start of its tour.

The class of the tether comes from the record of an interrupted flight, from the state file of a
guard, or from the operator.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import shapely

from netsp.base.arrays import Floats
from netsp.base.errors import InputError, counted
from netsp.base.files import read_text
from netsp.base.geometry import polylines
from netsp.hsignature import Word
from netsp.model.problem import Circle, Goal, Problem
from netsp.model.solution import Solution
from netsp.online.execute.run_record import PROBLEM, SOLUTION, STATE, ResumePoint, RunState
from netsp.online.execute.tether_reserve import ReservePolicy
from netsp.online.fly.flight_policy import FlightPolicy
from netsp.online.fly.stopped import RefusedError
from netsp.online.guard.state_file import GuardState
from netsp.plan.tour_plan import HOME, legs_of
from netsp.roadmap.paths import TautPaths, UnknownPathError
from netsp.roadmap.plane_world import PlaneWorld, free_position
from netsp.roadmap.roadmap_policy import RoadmapPolicy

BeginsAt = Callable[[Floats], ResumePoint]
"""Function that returns how a flight begins, given the position of the vehicle, shape (3,)."""

CLASS_HINT = "say with --class on which sides of the obstacles the tether lies"


def parse_class(text: str) -> Word:
    """Parse a class given by an operator.

    Parameters
    ----------
    text : str
        Numbers of obstacles from 1, negative where the ray is crossed from right to left, with
        commas or spaces between them; empty for a straight tether.

    Raises
    ------
    InputError
        Anything else.
    """
    try:
        word = tuple(int(part) for part in text.replace(",", " ").split())
    except ValueError:
        word = (0,)
    if 0 in word:
        raise InputError(
            "--class: expected numbers of obstacles from 1 such as '1,-2', or '' for a straight "
            f"tether, got {text!r}"
        )
    return word


def read_run(folder: str | Path) -> tuple[Problem, Solution, RunState]:
    """Read the record of a flight: its latest problem, its plan and its state.

    Raises
    ------
    InputError
        A file is missing or not valid.
    """
    place = Path(folder)
    if not (place / STATE).is_file():
        raise InputError(f"--resume: {folder}: has no {STATE}; expected the folder of a flight")
    # an obstacle may have appeared on a goal since
    problem = Problem.from_run(read_text(place / PROBLEM), str(place / PROBLEM))
    solution = Solution.load(place / SOLUTION)
    state = RunState.load(place / STATE)
    state.check(problem, f"--resume: {place / STATE}")
    return problem, solution, state


def from_record(
    problem: Problem, state: RunState, policy: FlightPolicy = FlightPolicy()
) -> BeginsAt:
    """Return a function that begins an interrupted flight again, by its last state.

    The function raises RefusedError if the class is not known any more.
    """
    before = np.array(state.tether, dtype=float)

    def begin_at(place: Floats) -> ResumePoint:
        distance = float(np.linalg.norm(place - before[-1]))
        if distance > policy.max_unwatched_distance:
            raise RefusedError(
                f"the vehicle is {distance:.1f} m from where it was last; expected at most "
                f"{policy.max_unwatched_distance:g} m, because nobody saw how it got there: "
                f"{CLASS_HINT}"
            )
        blocked = _between(problem, before[-1], place)
        if blocked is not None:
            raise RefusedError(
                f"{problem.obstacle_label(blocked)} lies between the vehicle and where it was "
                f"last: {CLASS_HINT}"
            )
        return _resume_point(problem, state, np.vstack([before, place]))

    return begin_at


def from_word(problem: Problem, word: Word, state: RunState) -> BeginsAt:
    """Return a function that begins a flight with a tether of a given class.

    The function raises RefusedError if no tether of the class reaches the vehicle. `state` says
    which
    goals are left.

    Raises
    ------
    InputError
        The class names an obstacle that the problem does not have.
    """
    if any(abs(letter) > len(problem.obstacles) for letter in word):
        raise InputError(
            f"--class: expected numbers of obstacles up to {len(problem.obstacles)}, got "
            f"{', '.join(map(str, word))}"
        )

    def begin_at(place: Floats) -> ResumePoint:
        goal = Goal(position=free_position(problem, place))
        placed = problem.model_copy(update={"goals": (goal,), "state": None})
        try:
            longest = RoadmapPolicy().max_state_ratio * problem.tether_length
            path = TautPaths(placed, longest).path(0, 1, word)
        except UnknownPathError:
            raise RefusedError(
                f"no tether of class {', '.join(map(str, word)) or 'straight'} reaches the "
                "vehicle: is the class right?"
            ) from None
        return _resume_point(problem, state, np.asarray(path))

    return begin_at


def from_guard(
    problem: Problem, file: str | Path, state: RunState, policy: FlightPolicy = FlightPolicy()
) -> BeginsAt:
    """Return a function that begins a flight with the tether that a guard has watched.

    The function raises RefusedError if the class is not known where the vehicle is. `file` is
    the
    state file of the guard, and `state` says which goals are left.

    Raises
    ------
    InputError
        The file is not valid, of another site, or without a certain class.
    """
    known = GuardState.load(file)
    known.words(PlaneWorld(problem))
    likeliest, *others = known.classes
    odds = min((math.exp(c.cost - likeliest.cost) for c in others), default=math.inf)
    if odds < policy.min_class_odds:
        raise InputError(
            f"{file}: classes: the likeliest is only {odds:.3g} times as likely as the next; "
            f"expected {policy.min_class_odds:g}: {CLASS_HINT}"
        )
    if likeliest.tether is None:
        return from_word(problem, likeliest.word, state)
    resumed = state.model_copy(update={"tether": likeliest.tether})
    return from_record(problem, resumed, policy)


def whole_tour(problem: Problem, solution: Solution) -> RunState:
    """Return the state of a flight that has not visited any goal."""
    left = tuple(leg.goal for leg in legs_of(problem, solution) if leg.goal != HOME)
    base = problem.base
    reserve = ReservePolicy().of_plan(problem, solution)
    return RunState(time=0.0, tether=(base, base), left=left, reserve=reserve)


def _resume_point(problem: Problem, state: RunState, tether: Floats) -> ResumePoint:
    tether = tether.copy()
    tether[0] = problem.base
    length = polylines.length(tether)
    reason = (
        f"resumed with {counted(len(state.left), 'goal')} left, {length:.1f} {problem.units} along "
        "the tether from the base"
    )
    left_out = {g.goal: g.reason for g in state.left_out}
    cancelled = tuple(state.cancelled)
    return ResumePoint(tether, list(state.left), reason, left_out, cancelled, state.reserve)


def _between(problem: Problem, before: Floats, after: Floats) -> int | None:
    """Return an obstacle that the straight line between two places enters; None if it is free."""
    line = shapely.LineString([before[:2], after[:2]])
    for i, o in enumerate(problem.obstacles):
        if isinstance(o, Circle):
            enters = line.distance(shapely.Point(o.center)) < o.radius
        else:
            enters = bool(line.intersects(shapely.Polygon(o.polygon)))
        if enters:
            return i
    return None
