"""Compare paths made by hand or recorded with the planned tour of the same problem (McCammon &
Hollinger 2017, Table II)."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.base.errors import InfeasibleError, InputError, LimitReachedError
from netsp.base.files import csv_cell
from netsp.exchange.maps.path_file import FoundPath
from netsp.gtsp.travel.result import OnProgress
from netsp.model.bound_scope import above_shortest
from netsp.model.problem import Goal, Problem
from netsp.model.solution import Solution, Status
from netsp.plan.solve_problem import solve
from netsp.roadmap.tether_classes import Tethers
from netsp.study.paths import PathMeasures, PathPolicy, measure_path

COLUMNS = (
    "path",
    "length",
    "longer_by",
    "longer_by_percent",
    "time_s",
    "time_from",
    "goals_visited",
    "goals",
    "order",
    "revisits",
    "longest_tether",
    "tether_length",
    "comes_home",
    "free",
    "word",
    "entangled",
    "through",
    "out_of_bounds",
    "order_length",
    "order_longer_by_percent",
)


@dataclass(frozen=True)
class ComparedPath:
    """Path, its measures, and the lengths to compare it with, in the problem's units.

    Parameters
    ----------
    name : str
        Name of the path.
    measures : PathMeasures
        Figures of the path.
    order_length : float, optional
        Length of the shortest tour that visits the same goals in the order of their first visits;
        None if there is none.
    order_note : str
        Phrase that says what `order_length` is, or why it is None.
    visited_length : float, optional
        Length of the best tour of the goals that the path visits, if it misses some.
    """

    name: str
    measures: PathMeasures
    order_length: float | None = None
    order_note: str = ""
    visited_length: float | None = None


@dataclass(frozen=True)
class PathComparison:
    """Comparison of paths with the planned tour.

    Parameters
    ----------
    problem : Problem
        The problem.
    paths : tuple of ComparedPath
        Paths in the order given.
    tour : Solution, optional
        The planned tour; None if there is none.
    tour_note : str
        Reason why there is no planned tour.
    speed : float
        Speed of the tour and of paths without time stamps, in the problem's units per second.
    is_infeasible : bool
        Whether it is proven that there is no tour.

    Examples
    --------
    >>> from netsp import Problem
    >>> from netsp.exchange.maps.path_file import read_paths
    >>> problem = Problem.load("problems/pool.json")
    >>> comparison = compare_paths(problem, [])
    >>> comparison.proof, round(comparison.tour_length, 2)
    ('proven shortest by this solver', 29.58)
    """

    problem: Problem = field(repr=False)
    paths: tuple[ComparedPath, ...]
    tour: Solution | None
    tour_note: str
    speed: float
    is_infeasible: bool = False

    @property
    def proof(self) -> str:
        """Phrase that says what is proven about the length of the tour."""
        if self.tour is None:
            return self.tour_note
        if self.tour.certified != "none":
            return self.tour.proof
        status = self.tour.status
        above = above_shortest(self.tour.length, self.tour.bound)
        if status.is_optimal and status is not Status.OPTIMAL_OF_KEPT:
            return status.verdict
        return f"{status.verdict}; {above}" if status.is_optimal else above

    @property
    def tour_length(self) -> float | None:
        """Length of the planned tour."""
        return None if self.tour is None else self.tour.length

    def longer_by(self, length: float | None) -> float | None:
        """Return a length minus the length of the tour; None if either is unknown."""
        tour = self.tour_length
        return None if length is None or tour is None else length - tour

    def percent(self, length: float | None) -> float | None:
        """Return `longer_by` in percent of the length of the tour."""
        more, tour = self.longer_by(length), self.tour_length
        return None if more is None or not tour else 100.0 * more / tour

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for the tour and one for each path, with the keys `COLUMNS`."""
        out = [] if self.tour is None else [self._tour_row(self.tour)]
        return out + [self._path_row(path) for path in self.paths]

    def _tour_row(self, tour: Solution) -> dict[str, Any]:
        problem = self.problem
        length = float(tour.length or 0.0)
        return {
            **dict.fromkeys(COLUMNS),
            "path": "planned tour",
            "length": length,
            "longer_by": 0.0,
            "longer_by_percent": 0.0,
            "time_s": length / self.speed,
            "time_from": "speed",
            "goals_visited": len(tour.tour),
            "goals": problem.visits,
            "order": [problem.goal_name(v.goal) for v in tour.tour],
            "revisits": [],
            "longest_tether": max((v.tether_length for v in tour.tour), default=None),
            "tether_length": problem.tether_length,
            "comes_home": True,
            "free": not tour.entangled,
            "word": [],
            "entangled": [problem.obstacle_name(k) for k in tour.entangled],
            "through": [],
            "out_of_bounds": False,
            "order_length": length,
            "order_longer_by_percent": 0.0,
        }

    def _path_row(self, path: ComparedPath) -> dict[str, Any]:
        m, problem = path.measures, self.problem
        through = sorted({k for s in m.stretches if s.kind == "obstacle" for k in s.obstacles})
        return {
            "path": path.name,
            "length": m.length,
            "longer_by": self.longer_by(m.length),
            "longer_by_percent": self.percent(m.length),
            "time_s": m.duration_s,
            "time_from": "time stamps" if m.is_timed else "speed",
            "goals_visited": len(m.order),
            "goals": problem.visits,
            "order": [problem.goal_name(g) for g in m.order],
            "revisits": [problem.goal_name(g) for g in m.revisits],
            "longest_tether": m.longest_tether,
            "tether_length": problem.tether_length,
            "comes_home": m.is_closed,
            "free": m.is_free,
            "word": list(m.word),
            "entangled": [problem.obstacle_name(k) for k in m.entangled],
            "through": [problem.obstacle_name(k) for k in through],
            "out_of_bounds": any(s.kind == "bounds" for s in m.stretches),
            "order_length": path.order_length,
            "order_longer_by_percent": self.percent(path.order_length),
        }

    def to_csv(self) -> str:
        """Return the rows as CSV; lists are joined by semicolons, booleans are 1 and 0."""
        out = io.StringIO()
        table = csv.writer(out, lineterminator="\n")
        table.writerow(COLUMNS)
        for row in self.rows():
            table.writerow([_cell(row[name]) for name in COLUMNS])
        return out.getvalue()

    def to_dict(self) -> dict[str, Any]:
        """Return all figures, as `--json` prints them."""
        tour, problem = self.tour, self.problem
        return {
            "problem": problem.name,
            "units": problem.units,
            "speed": self.speed,
            "tour": None
            if tour is None
            else {
                "length": tour.length,
                "lower_bound": tour.lower_bound,
                "lower_bound_of": tour.lower_bound_of,
                "status": tour.status.value,
                "order": [problem.goal_name(v.goal) for v in tour.tour],
                "longest_tether": max((v.tether_length for v in tour.tour), default=None),
            },
            "tour_note": self.tour_note,
            "paths": [{**self._path_row(p), **_details(problem, p)} for p in self.paths],
        }


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, float):
        return f"{value:.9g}"
    if isinstance(value, list):
        return csv_cell(";".join(str(v) for v in value))
    return csv_cell(str(value))


def _details(problem: Problem, path: ComparedPath) -> dict[str, Any]:
    m = path.measures
    return {
        "is_timed": m.is_timed,
        "speed": m.speed,
        "has_heights": m.has_heights,
        "radius": m.radius,
        "start_gap": m.start_gap,
        "end_gap": m.end_gap,
        "longest_at": m.longest_at,
        "longest_place": list(m.longest_place),
        "end_tether": m.end_tether,
        "end_word": list(m.end_word),
        "fits": m.fits,
        "missing": [problem.goal_name(g) for g in m.missing],
        "order_note": path.order_note,
        "visited_length": path.visited_length,
        "visits": [
            {
                "goal": problem.goal_name(v.goal),
                "first": v.is_first,
                "along": v.along,
                "time_s": v.time_s,
                "miss": v.miss,
                "tether": v.tether,
                "word": list(v.word),
            }
            for v in m.visits
        ],
        "stretches": [
            {
                "kind": s.kind,
                "obstacles": [problem.obstacle_name(k) for k in s.obstacles],
                "start": s.start,
                "end": s.end,
                "depth": s.depth,
                "place": list(s.place),
            }
            for s in m.stretches
        ],
    }


def compare_paths(
    problem: Problem,
    paths: Sequence[FoundPath],
    solution: Solution | None = None,
    *,
    speed: float = PathPolicy.speed,
    policy: PathPolicy | None = None,
    time_limit: float | None = None,
    seed: int = 0,
    on_progress: OnProgress | None = None,
    on_stage: Callable[[str], None] = lambda text: None,
) -> PathComparison:
    """Measure paths, and compare them with the planned tour.

    Parameters
    ----------
    problem : Problem
        The problem.
    paths : sequence of FoundPath
        Paths, as read by `netsp.exchange.maps.path_file.read_paths`.
    solution : Solution, optional
        The planned tour; solved here if None.
    speed : float
        Speed of the tour and of paths without time stamps, in the problem's units per second.
    policy : PathPolicy, optional
        Policy that decides when a goal counts as visited.
    time_limit : float, optional
        Time for the tour, s; the orders of the paths are solved afterwards.
    seed : int
        Random seed of the solver.
    on_progress : callable, optional
        Called with the progress of the tour's solver.
    on_stage : callable
        Called with the name of the next stage.

    Returns
    -------
    PathComparison
        The comparison, with the paths in the order given.

    Raises
    ------
    InputError
        A path cannot be measured, or the solution has no tour or is of another problem.

    Examples
    --------
    >>> import numpy as np
    >>> problem = Problem(base=(0, 0), goals=[(3, 4)], obstacles=[], tether_length=6)
    >>> path = FoundPath("by hand", np.array([[0.0, 0], [0, 4], [3, 4], [0, 0]]))
    >>> compare_paths(problem, [path]).rows()[1]["longer_by"]
    2.0
    """
    if solution is not None and solution.problem.sha256 != problem.sha256:
        raise InputError("--solution: is the solution of another problem (sha256 differs)")
    if solution is not None and solution.length is None:
        raise InputError(f"--solution: has no tour (status {solution.status.value})")
    policy = policy or PathPolicy()
    on_stage("measuring paths")
    measured = _measured(problem, paths, speed, policy)
    clock = Clock(time_limit)
    note, is_infeasible = "", False
    if solution is None:
        on_stage("solving the tour")
        try:
            solution = solve(problem, time_limit=time_limit, seed=seed, on_progress=on_progress)
            if solution.length is None:
                solution, note = None, "no tour was found within the time limit"
        except (InfeasibleError, LimitReachedError) as error:
            note, is_infeasible = str(error), isinstance(error, InfeasibleError)

    def left() -> float | None:
        """Return the remaining time, s, but at least `order_time_share` of the limit."""
        return None if time_limit is None else max(clock.left, policy.order_time_share * time_limit)

    known: dict[tuple[int, ...], tuple[float | None, str]] = {}
    out = []
    for path, m in zip(paths, measured, strict=True):
        if m.order not in known:
            on_stage(f"solving the order of {path.name}")
            known[m.order] = order_length(problem, m.order, time_limit=left())
        visited = None
        if m.missing and m.order:
            visited = _visited_length(problem, m.order, time_limit=left(), seed=seed)
        out.append(ComparedPath(path.name, m, *known[m.order], visited))
    return PathComparison(problem, tuple(out), solution, note, speed, is_infeasible)


def _measured(
    problem: Problem, paths: Sequence[FoundPath], speed: float, policy: PathPolicy
) -> list[PathMeasures]:
    """Return the measures of paths; an error names its path."""
    laid, out = _laid_tether(problem), []
    for path in paths:
        try:
            out.append(
                measure_path(
                    problem, path.points, times=path.times, speed=speed, policy=policy, tether=laid
                )
            )
        except InputError as error:
            raise InputError(f"{path.name}: {error}") from None
    return out


def _laid_tether(problem: Problem) -> Floats | None:
    """Return the line of the tether if the problem starts from a state, else None."""
    if problem.state is None:
        return None
    x, y, z = problem.state.position
    found = Tethers(problem).to(x, y, tuple(problem.state.signature), z)
    if found is None:
        raise InputError("state.signature: no tether of this word reaches state.position")
    return np.asarray(found.path)


def _goals_in_order(problem: Problem, order: Sequence[int]) -> Problem:
    """Return the problem with the goals of an order only, without choices and precedences."""
    free: Mapping[str, Any] = {"after": (), "choice": None}
    goals: tuple[Goal, ...] = tuple(problem.goals[g].model_copy(update=free) for g in order)
    return problem.model_copy(update={"goals": goals})


def order_length(
    problem: Problem, order: Sequence[int], *, time_limit: float | None = None
) -> tuple[float | None, str]:
    """Return the length of the shortest tour that visits goals in an order.

    Parameters
    ----------
    problem : Problem
        Problem with the goals.
    order : sequence of int
        Indices of distinct goals.
    time_limit : float, optional
        Time limit, s.

    Returns
    -------
    (float or None, str)
        Length in the problem's units, and a phrase that says what it is; or None, and the reason.
    """
    if not order:
        return None, "no goal is visited"
    if problem.state is not None:
        return None, "the order is solved for tours from the base only"
    before, cluster_of = problem.precedences, problem.clusters
    for k, later in enumerate(order if len(before) else ()):
        for earlier in order[:k]:
            if before[cluster_of[later], cluster_of[earlier]]:
                first, then = problem.goal_name(later), problem.goal_name(earlier)
                return None, f"the order breaks an 'after': {first} comes before {then}"
    try:
        found = solve(_goals_in_order(problem, order), time_limit=time_limit, keep_order=True)
    except (InfeasibleError, LimitReachedError) as error:
        return None, str(error)
    proven = found.status is Status.OPTIMAL
    note = "shortest tour in this order" if proven else "shortest tour found in this order"
    return found.length, note


def _visited_length(
    problem: Problem, order: tuple[int, ...], *, time_limit: float | None, seed: int
) -> float | None:
    """Return the length of the best tour of the goals in `order`; None if none was found."""
    if problem.state is not None or len(problem.precedences):
        return None
    try:
        return solve(_goals_in_order(problem, order), time_limit=time_limit, seed=seed).length
    except (InfeasibleError, LimitReachedError):
        return None
