"""Base, among candidates, from which the tour is shortest, with proof.

The shortest sufficient tether of a candidate is the length of the shortest path to the goal
farthest from it, and those lengths, for all candidates and goals, come from one graph of tangents.
So does a bound on the tour: that of the travelling salesperson over the shortest paths between
goals and candidate in any class. Candidates are solved in the order of their bounds, until the best
tour is no longer than the next bound: the others are then proven worse without a solve.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.clock import Clock, TimeLimit
from netsp.base.data_frames import frame_of
from netsp.base.errors import InfeasibleError, InputError, LimitReachedError
from netsp.base.files import csv_cell, write_text
from netsp.base.interrupt_signals import until_interrupt
from netsp.base.reprs import Drawn
from netsp.mip.cost_fixing import PATH_ROUNDING
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE, LowerBound, Scope, strongest
from netsp.model.problem import Problem
from netsp.model.solution import Solution, Status
from netsp.plan.sizing.sizing_policy import SizingPolicy
from netsp.plan.solve_problem import solve, solve_graph
from netsp.roadmap.outline import build_outline
from netsp.roadmap.shortest import ContactGraph
from netsp.roadmap.travel_graph import TravelGraph

if TYPE_CHECKING:
    import pandas

CROP_TOLERANCE = 1e-9
"""Tolerance of the radius of the part of a map that was imported, relative: a rounding."""

HEAD = (
    "rank",
    "name",
    "x",
    "y",
    "z",
    "shortest_tether",
    "lower_bound",
    "lower_bound_of",
    "length",
    "status",
    "why",
)
"""Columns of a ranking."""


@dataclass(frozen=True)
class Candidate:
    """Candidate for the base.

    Parameters
    ----------
    position : tuple of float
        (x, y, z), in the problem's units.
    name : str
        Name for people; by default its number.
    shortest_tether : float
        Shortest tether that reaches every goal from here; inf if a goal is cut off.
    lower_bound : float
        Lower bound on tours from here; inf if there is none.
    length : float or None
        Length of the best tour found from here; None if none was searched for.
    status : Status or None
        What is proven of that tour; `infeasible` if there is none; None if none was searched for.
    why : str
        Reason why there is no tour from here.
    """

    position: tuple[float, float, float]
    name: str
    shortest_tether: float
    lower_bound: float
    length: float | None = None
    status: Status | None = None
    why: str = ""

    @property
    def possible(self) -> bool:
        """Return whether there may be a tour from here."""
        return not self.why

    @property
    def bound(self) -> LowerBound:
        """Return the lower bound, on all tours from here."""
        return LowerBound(self.lower_bound, Scope.ALL_TOURS)


@dataclass(frozen=True)
class BaseSearch(Drawn):
    """Ranking of candidates for the base, the best first.

    Parameters
    ----------
    problem : Problem
        Problem with its original base.
    candidates : tuple of Candidate
        Candidates with a tour by its length, then those with a bound only, then those without a
        tour.
    solution : Solution or None
        Tour from the best candidate; None if no candidate has one.
    proven : bool
        Whether no other candidate has a shorter tour.
    """

    picture: ClassVar[str] = "netsp.view.pictures.sizing:draw_base_search"

    problem: Problem
    candidates: tuple[Candidate, ...]
    solution: Solution | None
    proven: bool

    def to_frame(self) -> pandas.DataFrame:
        """Return the ranking as a pandas DataFrame, with a column for each field of `Candidate`.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        return frame_of(self.candidates)

    @property
    def best(self) -> Candidate | None:
        """Return the candidate with the shortest tour."""
        first = self.candidates[0]
        return first if first.length is not None else None

    @property
    def best_problem(self) -> Problem | None:
        """Return the problem with its base at the best candidate."""
        return None if self.best is None else _with_base(self.problem, self.best.position)

    def to_json(self) -> str:
        """Return the ranking as a JSON object with the candidates in a list."""
        rows = [
            {
                "name": c.name,
                "position": list(c.position),
                "shortest_tether": _finite(c.shortest_tether),
                "lower_bound": _finite(c.bound.length),
                "lower_bound_of": c.bound.scope.value,
                "length": c.length,
                "status": None if c.status is None else c.status.value,
                "why": c.why or None,
            }
            for c in self.candidates
        ]
        data = {
            "problem": self.problem.name,
            "units": self.problem.units,
            "proven": self.proven,
            "candidates": rows,
        }
        return json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n"

    def to_csv(self) -> str:
        """Return the ranking as a CSV table, with a row for every candidate."""
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(HEAD)
        for k, c in enumerate(self.candidates, 1):
            table.writerow(
                [
                    k,
                    csv_cell(c.name),
                    *(f"{v:.9g}" for v in c.position),
                    f"{c.shortest_tether:.9g}",
                    f"{c.bound.length:.9g}",
                    c.bound.scope.value,
                    "" if c.length is None else f"{c.length:.9g}",
                    "" if c.status is None else c.status.value,
                    c.why,
                ]
            )
        return text.getvalue()

    def save(self, file: str | Path) -> None:
        """Write the ranking: a table if the name ends in ``.csv``, otherwise JSON.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        write_text(file, self.to_csv() if Path(file).suffix.lower() == ".csv" else self.to_json())


def best_base(
    problem: Problem,
    candidates: npt.ArrayLike,
    *,
    names: Sequence[str | None] | None = None,
    every: bool = False,
    time_limit: TimeLimit = None,
    seed: int = 0,
    on_candidate: Callable[[Candidate, int], None] | None = None,
    policy: SizingPolicy | None = None,
) -> BaseSearch:
    """Find the base, among candidates, from which the tour of a problem is shortest.

    Parameters
    ----------
    problem : Problem
        Problem whose own base does not count.
    candidates : array_like, shape (k, 2) or (k, 3)
        Places, in the problem's units; without z at the height of the problem's base.
    names : sequence of str, optional
        Names of the candidates.
    every : bool
        Whether every candidate is solved, even if its bound proves it worse.
    time_limit : float or Clock, optional
        Seconds in all; the best known by then, or at Ctrl-C, is returned.
    seed : int
        Seed of all random choices.
    on_candidate : callable, optional
        Called with every candidate that was solved, and the number of those that may still be
        better.
    policy : SizingPolicy, optional
        Limit of the number of candidates.

    Returns
    -------
    BaseSearch
        Ranking, and the best tour.

    Raises
    ------
    InputError
        Bad candidates, or a problem whose robot is already out.
    """
    if problem.state is not None:
        raise InputError("state: a base is chosen before the robot is out; expected none")
    places = _checked_places(problem, candidates, policy or SizingPolicy())
    _check_crop(problem, places, names)
    with until_interrupt(time_limit) as clock:
        rated = _rate_candidates(problem, places, names, clock, seed)
        return _solve_candidates(
            problem, rated, clock, every=every, seed=seed, on_candidate=on_candidate
        )


def _solve_candidates(
    problem: Problem,
    rated: list[Candidate],
    clock: Clock,
    *,
    every: bool,
    seed: int,
    on_candidate: Callable[[Candidate, int], None] | None,
) -> BaseSearch:
    """Solve from the candidates, the most promising first, until no other can be better."""
    order = sorted(range(len(rated)), key=lambda k: (rated[k].lower_bound, k))
    best: Solution | None = None
    for n, k in enumerate(order):
        candidate = rated[k]
        if not candidate.possible:
            break
        if clock.is_up or (best is not None and not every and _is_worse(candidate, best)):
            continue
        try:
            found = solve(_with_base(problem, candidate.position), time_limit=clock, seed=seed)
        except InfeasibleError as error:
            rated[k] = replace(candidate, status=Status.INFEASIBLE, why=str(error))
            continue
        except LimitReachedError:
            continue
        bound = strongest(candidate.bound, found.bound) or candidate.bound
        if found.length is not None:
            bound = bound.capped_at(found.length)
        rated[k] = replace(
            candidate, length=found.length, lower_bound=bound.length, status=found.status
        )
        if found.length is not None and (
            best is None or best.length is None or found.length < best.length
        ):
            best = found
        if on_candidate is not None:
            on_candidate(rated[k], sum(not _is_worse(rated[j], best) for j in order[n + 1 :]))
    ranking = sorted(
        rated, key=lambda c: (not c.possible, c.length is None, c.length or c.lower_bound)
    )
    proven = (
        best is not None
        and all(_is_worse(c, best) for c in ranking if c.possible and c.length != best.length)
        and ranking[0].status is Status.OPTIMAL
    )
    return BaseSearch(problem, tuple(ranking), best, proven)


def _is_worse(candidate: Candidate, best: Solution | None) -> bool:
    """Return whether a candidate is proven to have no shorter tour."""
    length = None if best is None else best.length
    if length is None:
        return not candidate.possible
    return not candidate.possible or candidate.lower_bound >= length * (1.0 - OPTIMALITY_TOLERANCE)


def _with_base(problem: Problem, position: Sequence[float]) -> Problem:
    """Return the problem with another base. Its origin holds for the old base only, and is
    dropped."""
    data = problem.model_dump(exclude={"origin"})
    return Problem.model_validate({**data, "base": tuple(position)})


def _checked_places(problem: Problem, candidates: npt.ArrayLike, policy: SizingPolicy) -> Floats:
    """Return the (k, 3) finite places."""
    try:
        given = np.atleast_2d(np.asarray(candidates, dtype=float))
    except (TypeError, ValueError):
        raise InputError("candidates: expected rows of x, y or x, y, z") from None
    if given.ndim != 2 or given.shape[1] not in (2, 3) or not len(given):
        raise InputError(f"candidates: expected rows of x, y or x, y, z, got shape {given.shape}")
    if not np.isfinite(given).all():
        raise InputError("candidates: expected finite coordinates")
    max_count = policy.max_candidates
    if len(given) > max_count:
        raise InputError(f"candidates: {len(given):,}; expected at most {max_count:,}")
    if given.shape[1] == 2:
        given = np.column_stack([given, np.full(len(given), problem.base[2])])
    return given


def _check_crop(problem: Problem, places: Floats, names: Sequence[str | None] | None) -> None:
    """Raise InputError if a tether would leave the part of the map that was imported."""
    circle = None if problem.site is None else problem.site.cropped
    if circle is None:
        return
    away = np.hypot(*(places[:, :2] - np.array(circle.center)).T)
    beyond = np.flatnonzero(
        away + problem.tether_length + problem.clearance > circle.radius * (1.0 + CROP_TOLERANCE)
    )
    if len(beyond):
        first = int(beyond[0])
        called = (names[first] if names is not None else None) or f"#{first}"
        more = f" and {len(beyond) - 1} more" if len(beyond) > 1 else ""
        raise InputError(
            f"candidates: {called}{more}: the tether reaches beyond the part of the map that was "
            "imported; expected places that were given to netsp import (--candidates)"
        )


def _rate_candidates(
    problem: Problem, places: Floats, names: Sequence[str | None] | None, clock: Clock, seed: int
) -> list[Candidate]:
    """Return the candidates with their shortest tethers and bounds."""
    blocked = [_obstruction(problem, p) for p in places]
    free = [k for k, why in enumerate(blocked) if not why]
    tethers, between = shortest_paths(problem, places[free])
    labels = [names[k] if names is not None else None for k in range(len(places))]
    out: list[Candidate] = []
    for k, place in enumerate(places):
        position = (float(place[0]), float(place[1]), float(place[2]))
        name = labels[k] or f"#{k}"
        if blocked[k]:
            out.append(Candidate(position, name, np.inf, np.inf, why=blocked[k]))
            continue
        to = tethers[free.index(k)]
        farthest = _farthest_goal(problem, to)
        shortest = float(to[farthest])
        if shortest > problem.tether_length * (1.0 + 1e-12):
            goal = problem.goal_label(farthest)
            why = (
                f"{goal} cannot be reached"
                if np.isinf(shortest)
                else f"{goal} needs a tether of {shortest:.6g}"
            )
            out.append(Candidate(position, name, shortest, np.inf, why=why))
            continue
        bound = _tour_bound(problem, to, between, clock, seed)
        out.append(Candidate(position, name, shortest, bound))
    return out


def _obstruction(problem: Problem, place: Floats) -> str:
    """Return why no base can be at a place; empty if it can."""
    if problem.bounds is not None:
        low, high = np.array(problem.bounds[:2]), np.array(problem.bounds[2:])
        if (place[:2] < low - problem.tolerance).any() or (
            place[:2] > high + problem.tolerance
        ).any():
            return "lies outside of the bounds"
    for i, o in enumerate(problem.obstacles):
        if float(o.signed_distance(place[:2])) < problem.clearance - problem.tolerance:
            return f"lies inside {problem.obstacle_label(i)}" + (
                " grown by the clearance" if problem.clearance else ""
            )
    return ""


def shortest_paths(problem: Problem, places: Floats) -> tuple[Floats, Floats]:
    """Return the lengths of shortest paths in any class, in 3D; inf where there is no path.

    Base and tether of the problem do not count.

    Returns
    -------
    from_places : ndarray, shape (k, goals)
        Lengths from places to goals.
    between : ndarray, shape (goals, goals)
        Lengths between goals.

    Raises
    ------
    InputError
        Places so far apart that obstacles between them are too small to be distinguished.
    """
    goals = problem.points[1:]
    if not len(places):
        return np.zeros((0, len(goals))), np.zeros((len(goals), len(goals)))
    # one point for all places and goals at the same spot in the plane
    points = np.vstack([goals, places])
    flat, which = np.unique(points[:, :2], axis=0, return_inverse=True)
    which = np.asarray(which).reshape(-1)
    data: dict[str, Any] = problem.model_dump(exclude={"origin", "state", "bounds", "site"})
    reach = 10.0 * float(np.ptp(flat, axis=0).max() + problem.tether_length)
    plain = Problem(
        **{
            **data,
            "base": tuple(flat[0]),
            "tether_length": reach,
            "goals": [tuple(p) for p in flat[1:]] or [tuple(flat[0] + 1e-3 * reach)],
            "bounds": problem.bounds,
        }
    )
    sources = sorted(set(which[: len(goals)].tolist()))
    found = ContactGraph(build_outline(plain)).lengths(sources)
    row = {s: k for k, s in enumerate(sources)}
    planar = np.array([found[row[int(g)]][which] for g in which[: len(goals)]])
    rise = np.abs(goals[:, 2][:, None] - points[:, 2][None, :])
    lengths = np.hypot(planar, rise)
    return lengths[:, len(goals) :].T.copy(), lengths[:, : len(goals)].copy()


def _farthest_goal(problem: Problem, to: Floats) -> int:
    """Return the goal that needs the longest tether; of every choice the nearest counts."""
    nearest = [
        members[np.argmin(to[members])]
        for c in range(1, problem.visits + 1)
        for members in (np.flatnonzero(problem.clusters == c),)
    ]
    return int(max(nearest, key=lambda k: to[k]))


def _tour_bound(problem: Problem, to: Floats, between: Floats, clock: Clock, seed: int) -> float:
    """Return a lower bound on tours from a place: that of the travelling salesperson over shortest
    paths, one goal of each choice, in any order."""
    within = np.flatnonzero(np.isfinite(to))
    to, between = to[within], between[np.ix_(within, within)]
    n = len(to)
    costs = np.zeros((n + 1, n + 1))
    costs[0, 1:] = costs[1:, 0] = to
    costs[1:, 1:] = np.minimum(between, between.T)
    np.fill_diagonal(costs, 0.0)
    choices = problem.clusters[within]
    over = TravelGraph.from_costs(costs, [0, *choices.tolist()])
    bound_by_farthest = 2.0 * max(
        float(to[choices == c].min()) for c in np.unique(choices)
    )  # there and back
    if clock.is_up:
        return bound_by_farthest
    bound = solve_graph(over, time_limit=clock, seed=seed).lower_bound or 0.0
    return max(bound_by_farthest, bound) * (1.0 - PATH_ROUNDING)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
