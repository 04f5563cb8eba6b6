"""Measures of a path in the plane of a problem: length, time, goals, tether and word.

`measure_path` computes what `netsp compare-path`, `netsp verify --measures` and the map show.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.deprecated import deprecated_method
from netsp.base.errors import InputError
from netsp.base.field_types import checked_argument
from netsp.base.geometry import polylines
from netsp.base.number_ranges import check_shares
from netsp.base.validated import shown
from netsp.hsignature import Word, concatenate, crossings, entangled, reduce
from netsp.judge.stringpull import StringPuller
from netsp.model.problem import Problem
from netsp.study.paths.carried_tether import CarriedTether
from netsp.study.paths.free_route import FreeLoop, FreeRoutePolicy, FreeSpace, Stretch
from netsp.study.paths.goal_visits import Passing, passings


@dataclass(frozen=True)
class PathPolicy:
    """Policy of measures: when a goal counts as visited, and the accuracy of tether lengths.

    Parameters
    ----------
    radius : float, optional
        Distance from a goal at which it counts as visited, and from the base at which the path
        counts as at home, in the problem's units; by default `radius_share` of the problem's size.
    radius_share : float
        Default radius as a share of the problem's size.
    leave_ratio : float
        Distance by which a path must leave a goal before it can visit the goal again, as a multiple
        of the radius; above 1, so that noisy positions do not count as new visits.
    tether_error : float
        Largest error of the longest tether along the path, as a share of the problem's tether.
    speed : float
        Default speed of tours and of paths without time stamps, in the problem's units per second.
    order_time_share : float
        Share of the time limit that each search for the best tour in the order of a path has at
        least.
    route : FreeRoutePolicy
        Detours around the obstacles that a path enters.

    Examples
    --------
    >>> from netsp import Problem
    >>> problem = Problem(base=(0, 0), goals=[(3, 4)], tether_length=9)
    >>> path = [(0, 0), (3, 3.7), (0, 0)]
    >>> measure_path(problem, path).order, measure_path(problem, path, policy=PathPolicy(0.5)).order
    ((), (0,))
    """

    radius: float | None = None
    radius_share: float = 0.02
    leave_ratio: float = 2.0
    tether_error: float = 1e-6
    speed: float = 0.5
    order_time_share: float = 0.2
    route: FreeRoutePolicy = FreeRoutePolicy()

    def __post_init__(self) -> None:
        if self.radius is not None:
            checked_argument("radius", self.radius, 0.0)
        checked_argument("radius_share", self.radius_share, 0.0, 1.0)
        checked_argument("leave_ratio", self.leave_ratio, 1.0, 1e6)
        checked_argument("tether_error", self.tether_error, 0.0, 1.0)
        checked_argument("speed", self.speed, 0.0)
        check_shares(self, "order_time_share")

    def radius_in(self, problem: Problem) -> float:
        """Return the radius for a problem.

        Parameters
        ----------
        problem : Problem
            The problem; its size gives the default radius.

        Returns
        -------
        float
            In the problem's units; the default is rounded to two digits.
        """
        if self.radius is not None:
            return float(self.radius)
        return float(f"{self.radius_share * problem.scale:.2g}")


@dataclass(frozen=True)
class GoalVisit:
    """Visit of a path to a goal.

    Parameters
    ----------
    goal : int
        Index of the goal.
    is_first : bool
        Whether this is the first visit to any goal of the choice.
    along : float
        Length of the path up to the visit, in the problem's units.
    time_s : float
        Time from the beginning of the path to the visit, s.
    miss : float
        Distance of the path from the goal, in the problem's units.
    tether : float, optional
        Length of the taut tether at the goal, in 3D; None if no free path follows the path up to
        the goal.
    word : Word
        Word of the tether at the goal.

    Examples
    --------
    >>> from netsp import Problem
    >>> problem = Problem(base=(0, 0), goals=[(3, 4)], tether_length=9)
    >>> (visit,) = measure_path(problem, [(0, 0), (3, 0), (3, 4), (0, 0)]).visits
    >>> visit.goal, visit.along, visit.tether, visit.miss
    (0, 7.0, 5.0, 0.0)
    """

    goal: int
    is_first: bool
    along: float
    time_s: float
    miss: float
    tether: float | None
    word: Word


@dataclass(frozen=True)
class PathMeasures:
    """Measures of a path. Lengths are in the problem's units.

    Parameters
    ----------
    problem : Problem
        Problem in whose plane the path runs.
    length : float
        Length in 3D.
    duration_s : float
        Duration, s.
    is_timed : bool
        Whether the duration comes from time stamps; else it comes from `speed`.
    speed : float
        Mean speed, or the given speed of a path without time stamps, in units per second.
    has_heights : bool
        Whether the path has heights; otherwise they change evenly between visited goals.
    radius : float
        Distance at which a goal counts as visited.
    visits : tuple of GoalVisit
        Visits in their order along the path.
    start_gap, end_gap : float
        Distance at the beginning from the base, or from the end of the given tether, and distance
        at the end from the base.
    is_closed : bool
        Whether both gaps are within the radius.
    longest_tether : float, optional
        Largest length of the taut tether along the path, in the class that the path gives it; None
        if no free path follows the path to its end.
    longest_at : float
        Length along the path at which the tether is longest.
    longest_place : (float, float)
        Place at which the tether is longest.
    end_tether : float, optional
        Length of the taut tether at the end.
    end_word : Word
        Word of the tether at the end.
    word : Word
        Word of the path, closed by the straight line to the base.
    entangled : tuple of int
        Obstacles that the closed path is wrapped around.
    stretches : tuple of Stretch
        Parts of the path in obstacles, within their clearance, or out of bounds.
    loop : ndarray, shape (n, 3)
        Path from the base and back, with detours around these parts; words and tethers are measured
        along it.
    loop_end : int
        Index of the point of `loop` at which the path ends.
    loop_lengths : ndarray, shape (loop_end + 1,)
        Length along the path at the points of `loop`.
    points : ndarray, shape (k, 3)
        The path with heights.
    carried : CarriedTether
        Tethers at the points of `loop` up to the end of the path.

    Examples
    --------
    >>> from netsp import Problem
    >>> problem = Problem(base=(0, 0), goals=[(4, 1)], tether_length=9)
    >>> measures = measure_path(problem, [(0, 0), (3, 0), (4, 1), (0, 0)])
    >>> measures.order, round(measures.longest_tether, 2), measures.is_free, measures.fits
    ((0,), 4.12, True, True)
    """

    problem: Problem = field(repr=False)
    length: float
    duration_s: float
    is_timed: bool
    speed: float
    has_heights: bool
    radius: float
    visits: tuple[GoalVisit, ...]
    start_gap: float
    end_gap: float
    is_closed: bool
    longest_tether: float | None
    longest_at: float
    longest_place: tuple[float, float]
    end_tether: float | None
    end_word: Word
    word: Word
    entangled: tuple[int, ...]
    stretches: tuple[Stretch, ...]
    loop: Floats = field(repr=False, compare=False)
    loop_end: int
    loop_lengths: Floats = field(repr=False, compare=False)
    points: Floats = field(repr=False, compare=False)
    carried: CarriedTether = field(repr=False, compare=False)

    route = deprecated_method("route", "loop")
    route_end = deprecated_method("route_end", "loop_end")
    route_lengths = deprecated_method("route_lengths", "loop_lengths")

    @property
    def order(self) -> tuple[int, ...]:
        """Goals in the order of their first visits."""
        return tuple(v.goal for v in self.visits if v.is_first)

    @property
    def revisits(self) -> dict[int, int]:
        """Number of further visits to each goal that is visited more than once."""
        out: dict[int, int] = {}
        for v in self.visits:
            if not v.is_first:
                out[v.goal] = out.get(v.goal, 0) + 1
        return out

    @cached_property
    def missing(self) -> tuple[int, ...]:
        """Goals that the path misses, unless it visits another goal of the choice."""
        cluster = self.problem.clusters
        seen = {int(cluster[v.goal]) for v in self.visits}
        return tuple(g for g in range(len(self.problem.goals)) if int(cluster[g]) not in seen)

    @property
    def is_free(self) -> bool:
        """True if the path comes home and its tether is free there."""
        return self.is_closed and not self.word and self.longest_tether is not None

    @property
    def fits(self) -> bool:
        """True if the tether is long enough everywhere along the path."""
        if self.longest_tether is None:
            return False
        limit = self.problem.tether_length
        return self.longest_tether <= limit * (1.0 + 1e-7) + 1e-9 * self.problem.scale

    def tether_profile(self, count: int = 200) -> Floats:
        """Return the length of the tether along the path.

        Parameters
        ----------
        count : int
            Number of places, spaced evenly along the loop in plan.

        Returns
        -------
        ndarray, shape (count, 2)
            Length along the path, and length of the taut tether; no rows if the tether is unknown.
        """
        if self.longest_tether is None:
            return np.zeros((0, 2))
        loop = self.loop[: self.loop_end + 1]
        rows = self.carried.profile(count)
        s = np.interp(rows[:, 0], polylines.along(loop[:, :2]), self.loop_lengths)
        return np.column_stack([s, rows[:, 1]])

    @property
    def is_inside(self) -> bool:
        """True if the path avoids all obstacles and stays within the bounds."""
        return all(s.kind == "clearance" for s in self.stretches)


def measure_path(
    problem: Problem,
    path: npt.ArrayLike,
    *,
    times: npt.ArrayLike | None = None,
    speed: float = PathPolicy.speed,
    policy: PathPolicy | None = None,
    tether: npt.ArrayLike | None = None,
) -> PathMeasures:
    """Measure a path among a problem's obstacles.

    Parts in an obstacle, within its clearance or out of bounds are reported. For words and tethers,
    free paths around the obstacle replace them (`netsp.study.paths.free_route`). If the path begins
    away from the base, a straight tether leads to its beginning. If it ends away from the base, a
    straight line closes it for `word` and `entangled`.

    Parameters
    ----------
    problem : Problem
        Problem with base, goals, obstacles, bounds and tether.
    path : array_like, shape (n, 2) or (n, 3)
        The path. If it has no heights, they change evenly between visited goals, as along the legs
        of a tour.
    times : array_like, shape (n,), optional
        Time stamps of the points, s, in ascending order.
    speed : float
        Speed of a path without time stamps, in the problem's units per second.
    policy : PathPolicy, optional
        When a goal counts as visited, and the accuracy of tether lengths.
    tether : array_like, shape (k, 2) or (k, 3), optional
        Line of the tether at the beginning, from the base on; by default a straight line.

    Raises
    ------
    InputError
        The path has fewer than two points, or points that are not finite; or times are not in
        ascending order, or not as many as points.

    Examples
    --------
    >>> from netsp import Circle, Problem
    >>> problem = Problem(base=(0, 0), goals=[(4, 0)], tether_length=9,
    ...                   obstacles=[Circle(center=(2, 0), radius=1)])
    >>> round_it = measure_path(problem, [(0, 0), (2, 2), (4, 0), (2, -2), (0, 0)])
    >>> round_it.order, round_it.is_free, round_it.entangled
    ((0,), False, (0,))
    """
    policy = policy or PathPolicy()
    given = _polyline("path", path)
    stamps = _times(times, len(given))
    speed = checked_argument("speed", speed, 1e-9)
    radius = policy.radius_in(problem)
    base, goals = np.array(problem.base, dtype=float), problem.points[1:]
    size = given.shape[1]
    found = passings(given, goals[:, :size], radius, policy.leave_ratio * radius)
    laid = None if tether is None else _polyline("tether", tether)
    start = base if laid is None else np.append(laid[-1], base[len(laid[-1]) :])
    start_gap = float(np.linalg.norm(given[0] - start[:size]))
    end_gap = float(np.linalg.norm(given[-1] - base[:size]))
    led = _Led(problem, given, found, laid, policy.route)
    seen = [p for p in found if led.sees(p, goals[p.goal])]
    heights = given[:, 2] if size == 3 else _heights(problem, given, seen, end_gap <= radius)
    points = np.column_stack([given[:, :2], heights])
    travelled = polylines.along(points)
    length = float(travelled[-1])
    seconds = travelled / speed if stamps is None else stamps - stamps[0]
    duration = float(seconds[-1])
    if stamps is not None:
        speed = length / duration if duration > 0.0 else 0.0

    loop = led.lifted(heights)
    carried = CarriedTether(led.puller, loop[: led.last + 1])
    visits = _visits(problem, led, carried, seen, travelled, seconds)
    is_reached = led.is_reached(led.last)
    error = policy.tether_error * problem.tether_length
    at, longest = carried.longest(error, led.first) if is_reached else (led.first, 0.0)
    word = led.closed_word
    return PathMeasures(
        problem=problem,
        length=length,
        duration_s=duration,
        is_timed=stamps is not None,
        speed=speed,
        has_heights=size == 3,
        radius=radius,
        visits=visits,
        start_gap=start_gap,
        end_gap=end_gap,
        is_closed=max(start_gap, end_gap) <= radius,
        longest_tether=longest if is_reached else None,
        longest_at=float(np.interp(led.loop.along[at], led.flat, travelled)),
        longest_place=(float(loop[at, 0]), float(loop[at, 1])),
        end_tether=carried.length(led.last) if is_reached else None,
        end_word=led.word(led.last),
        word=word,
        entangled=tuple(k - 1 for k in entangled(word)),
        stretches=led.space.stretches(given[:, :2], led.flat),
        loop=loop,
        loop_end=led.last,
        loop_lengths=np.interp(led.loop.along[: led.last + 1], led.flat, travelled),
        points=points,
        carried=carried,
    )


def _heights(problem: Problem, path: Floats, seen: Sequence[Passing], ends_at_base: bool) -> Floats:
    """Return heights that change evenly between the base and the visited goals."""
    base = float(problem.base[2])
    known = [(p.place, float(problem.points[1:][p.goal, 2])) for p in seen]
    end = [(len(path) - 1.0, base)] if ends_at_base else []
    return _rising(path, [(0.0, base), *known, *end])


def _visits(
    problem: Problem,
    led: _Led,
    carried: CarriedTether,
    seen: Sequence[Passing],
    travelled: Floats,
    seconds: Floats,
) -> tuple[GoalVisit, ...]:
    """Return the visits of goals, with length and time on the way to each."""
    place = np.arange(len(travelled))
    goals, clusters, before, visits = problem.points[1:], problem.clusters, set[int](), []
    for p in seen:
        k, goal = led.index(p.place), goals[p.goal]
        visits.append(
            GoalVisit(
                goal=p.goal,
                is_first=int(clusters[p.goal]) not in before,
                along=float(np.interp(p.place, place, travelled)),
                time_s=float(np.interp(p.place, place, seconds)),
                miss=p.miss,
                tether=carried.length_to(k, goal) if led.is_reached(k) else None,
                word=led.word(k, goal),
            )
        )
        before.add(int(clusters[p.goal]))
    return tuple(visits)


class _Led:
    """Free loop along a path: the tether at the beginning, the path, and the straight line home.

    Places on the path are in segments from its beginning. Lengths along it are in plan; they are
    negative on the tether, and exceed the length of the path on the line home.
    """

    def __init__(
        self,
        problem: Problem,
        given: Floats,
        found: list[Passing],
        tether: Floats | None,
        route: FreeRoutePolicy,
    ) -> None:
        xy, base = given[:, :2], np.array(problem.base[:2], dtype=float)
        self.flat = polylines.along(xy)
        self.tether = np.vstack([problem.base[:2], xy[:1]]) if tether is None else tether[:, :2]
        places = np.unique([*range(len(xy)), *(p.place for p in found)])
        self._place = np.arange(len(xy), dtype=float)
        dense = np.column_stack([np.interp(places, self._place, xy[:, k]) for k in range(2)])
        out = polylines.along(self.tether)
        home = float(np.hypot(*(dense[-1] - base)))
        line = np.vstack([self.tether, dense, base])
        along = np.concatenate(
            [out - out[-1], np.interp(places, self._place, self.flat), [self.flat[-1] + home]]
        )
        moves = np.concatenate([[True], np.any(np.diff(line, axis=0) != 0.0, axis=1)])
        reach = float(np.abs(line - base).max())
        self.puller = StringPuller(problem, max(reach, problem.scale))
        self.space = FreeSpace(self.puller, reach, route)
        self.loop: FreeLoop = self.space.free_loop(line[moves], along[moves])
        s = self.loop.along
        self.first = min(int(np.searchsorted(s, 0.0)), len(s) - 1)
        self.last = max(int(np.searchsorted(s, self.flat[-1], side="right")) - 1, self.first)
        rays = problem.representative_points
        self._rays, self._base_z = rays, float(problem.base[2])
        pairs = np.stack([self.loop.xy[:-1], self.loop.xy[1:]], axis=1)
        steps = [crossings(pair, rays) for pair in pairs]
        self._begin = np.concatenate([[0], np.cumsum([len(step) for step in steps], dtype=int)])
        self._letters = [letter for step in steps for letter in step]

    def index(self, place: float) -> int:
        """Return the index of the point of the loop nearest to a place on the path."""
        s = float(np.interp(place, self._place, self.flat))
        return int(np.argmin(np.abs(self.loop.along - s)))

    def sees(self, passing: Passing, goal: Floats) -> bool:
        """Return whether a goal is in sight where the path is nearest to it."""
        return self.space.sees(self.loop.xy[self.index(passing.place)], goal[:2])

    def is_reached(self, k: int) -> bool:
        """Return whether a free path follows the path to a point of the loop."""
        return bool(self.loop.along[k] <= self.loop.shut_in)

    def word(self, k: int, place: Floats | None = None) -> Word:
        """Return the word of the tether at a point of the loop, or at a place in sight of it."""
        letters = self._letters[: self._begin[k]]
        if place is None:
            return reduce(letters)
        return concatenate(letters, crossings([self.loop.xy[k], place[:2]], self._rays))

    @property
    def closed_word(self) -> Word:
        """Word of the path with the straight line home."""
        return reduce(self._letters)

    def lifted(self, heights: Floats) -> Floats:
        """Return the loop (n, 3) with heights interpolated from those of the path's points."""
        s = [self.loop.along[0], *self.flat, self.loop.along[-1]]
        z = [self._base_z, *heights, self._base_z]
        return np.column_stack([self.loop.xy, np.interp(self.loop.along, s, z)])


def _rising(given: Floats, known: list[tuple[float, float]]) -> Floats:
    """Return heights that change evenly along a path between places of known height."""
    flat = polylines.along(given[:, :2])
    place = np.arange(len(given), dtype=float)
    known = sorted(known)
    s = np.interp([p for p, _ in known], place, flat)
    return np.asarray(np.interp(flat, s, [z for _, z in known]))


def _polyline(name: str, value: npt.ArrayLike) -> Floats:
    try:
        line = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        line = np.zeros(0)
    if line.ndim != 2 or line.shape[1] not in (2, 3) or len(line) < 2:
        raise InputError(
            f"{name}: expected two points (x, y) or (x, y, z) or more, got {shown(value)}"
        )
    if not (np.abs(line) <= 1e12).all():
        raise InputError(f"{name}: expected finite coordinates of at most 1e12")
    return line


def _times(value: npt.ArrayLike | None, count: int) -> Floats | None:
    if value is None:
        return None
    times = np.asarray(value, dtype=float)
    if times.shape != (count,) or not np.isfinite(times).all():
        raise InputError(f"times: expected one number of seconds for each of {count} points")
    if (np.diff(times) < 0.0).any():
        k = int(np.argmax(np.diff(times) < 0.0)) + 1
        raise InputError(
            f"times: expected times that never fall, got {times[k]:g} after {times[k - 1]:g}"
        )
    return times
