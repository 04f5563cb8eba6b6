"""Independent judge of a solution: it imports no roadmap and no solver.

Words come from ray crossings (`netsp.hsignature`). A triangulation (`netsp.judge.stringpull`)
checks a second time that the tour is contractible and that each tether fits. Plain distances
(Shapely) check the clearance from obstacles.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from netsp.base.arrays import Floats
from netsp.base.errors import InputError, VerificationError
from netsp.hsignature import Word, concatenate, crossings, entangled, reduce
from netsp.judge.judge_policy import JudgePolicy
from netsp.judge.overstretch import first_overstretch
from netsp.judge.passage import passes
from netsp.judge.solid_distances import Inset, bridges
from netsp.judge.stringpull import PLACE_TOLERANCE, StringPuller, reduce_sleeve
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE, Scope
from netsp.model.problem import Circle, Problem
from netsp.model.solution import Solution, Status, solution_scope, tension_ratio

STAND_OFF_ALLOWANCE = 3e-8
"""Tolerance of lengths along boundaries, as a share of the problem's size: paths of a roadmap keep
a small distance from the obstacles that they touch."""

GAP_TOLERANCE = 1e-6
"""Tolerance of a stated gap, compared with the gap of the stated lengths; files round both."""

CLOSED_GAP_TOLERANCE = 1e-5
"""Tolerance of the gap of a tour with an optimal status; the least accurate proofs are those of
tours from a robot's state."""

LENGTH_TOLERANCE = 1e-3
"""Tolerance of the length of a drawn path, as a share of it; its polyline circumscribes arcs."""

TAUT_TOLERANCE = 1e-7
"""Tolerance of stated lengths, as a share of the tether: paths of a roadmap keep about 1e-8 of the
problem's size from the obstacles that they touch."""


@dataclass(frozen=True)
class Check:
    """Outcome of one check.

    Parameters
    ----------
    name : str
        Condition that is checked, such as 'enters no obstacle'.
    passed : bool
        Whether it holds.
    detail : str
        Measured values, or the reason for the failure.
    was_made : bool
        False if the condition, which the solution states, was not checked; it then counts as
        passed.
    """

    name: str
    passed: bool
    detail: str
    was_made: bool = True

    @property
    def mark(self) -> str:
        """Mark for lists of checks: "ok", "FAIL", or "?" if it was not made."""
        return "FAIL" if not self.passed else "ok" if self.was_made else "?"


@dataclass(frozen=True)
class Verification:
    """Checks of a solution, in order; its truth value is `passed`.

    Examples
    --------
    >>> verdict = Verification((Check("total word is empty", False, "wraps red 1"),))
    >>> verdict.passed
    False
    >>> print(verdict)
    FAIL  total word is empty  wraps red 1
    """

    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """True if every check passed."""
        return all(c.passed for c in self.checks)

    def __bool__(self) -> bool:
        return self.passed

    def __repr__(self) -> str:
        """Return the outcome in one line."""
        failed = ", ".join(c.name for c in self.checks if not c.passed)
        return f"<Verification: {f'fails {failed}' if failed else f'all {len(self.checks)} pass'}>"

    def __str__(self) -> str:
        width = max(len(c.name) for c in self.checks)
        return "\n".join(f"{c.mark:<4}  {c.name:<{width}}  {c.detail}" for c in self.checks)


def verify(
    problem: Problem, solution: Solution, policy: JudgePolicy = JudgePolicy()
) -> Verification:
    """Judge a solution against its problem.

    The checks are: the solution belongs to the problem; the path is a closed polyline from the base
    through every goal in the order of the tour, clear of obstacles and within bounds; its word is
    as stated at every goal, and empty at the end; the tether, pulled taut by another method, is
    within the tether length and as long as stated; length, bound, gap and status are consistent.

    Raises
    ------
    InputError
        The solution names obstacles or goals that the problem does not have.

    Examples
    --------
    >>> from netsp import Problem, solve
    >>> problem = Problem.load("problems/pool.json")
    >>> verdict = verify(problem, solve(problem))
    >>> bool(verdict)
    True
    """
    for name, value, kind in (("problem", problem, Problem), ("solution", solution, Solution)):
        if not isinstance(value, kind):
            raise InputError(f"{name}: expected a {kind.__name__}, got {value!r}")
    # copies of a model are not validated: the status may be a plain string
    solution = solution.model_copy(update={"status": Status(solution.status)})
    return Verification(tuple(_Judge(problem, solution, policy).run()))


def checked(problem: Problem, solution: Solution) -> Solution:
    """Return a solution if it passes the judge, and raise otherwise.

    Solutions without a tour or with the status `invalid` are not judged.

    Raises
    ------
    VerificationError
        The tour fails a check.
    """
    if solution.length is None or solution.status is Status.INVALID:
        return solution
    failed = [c for c in verify(problem, solution).checks if not c.passed]
    if failed:
        raise VerificationError(
            f"the tour that was found fails its check {failed[0].name!r}: {failed[0].detail}; "
            "it is not kept. Please report the problem file, or the package whose roadmap it is"
        )
    return solution


NOT_OF_PROBLEMS = frozenset({Scope.TRAVEL_GRAPH, Scope.PART, Scope.STATES, Scope.STATES_IN_ORDER})
"""Scopes that no solution of a planar problem has: of travel graphs, and of missions in space."""

MAX_TURNING_ERROR = 1e-6
"""Tolerance of the turning of a tether, radians; contacts with obstacles are found exactly."""

CONTACT_REACH = 8.0
"""Tolerance of the distance by which a path may pass a contact of two obstacles before it comes
back, as a multiple of the place tolerance."""


@dataclass
class _PulledTour:
    """Taut lengths along a tour.

    Attributes
    ----------
    pieces
        Triangle edges that each segment of the path crosses.
    sleeve
        Reduced sequence of edges of the whole tour.
    total
        Sum of the legs.
    lengths
        Tether at the path vertex of each visit.
    longest, turning, error
        Largest tether, turning, and difference from a stated length beyond the tolerance, each with
        the label of its goal.
    """

    pieces: list[list[tuple[int, bool]]]
    sleeve: list[tuple[int, bool]] = field(default_factory=list)
    total: float = 0.0
    lengths: dict[int, float] = field(default_factory=dict)
    longest: tuple[float, str] = (-np.inf, "")
    turning: tuple[float, str] = (0.0, "")
    error: tuple[float, str] = (-np.inf, "")


class _Judge:
    def __init__(self, problem: Problem, solution: Solution, policy: JudgePolicy) -> None:
        self.policy = policy
        self.sha256 = problem.sha256
        # a solution with a margin is valid among obstacles that are grown by it
        if solution.margin or solution.slack:
            problem = problem.grown(solution.margin, solution.slack)
        self.problem, self.solution = problem, solution
        # a path that starts from a state continues its tether
        before: Floats = np.array(solution.start_tether, dtype=float).reshape(-1, 3)
        walked: Floats = np.array(solution.path, dtype=float).reshape(-1, 3)
        self.path: Floats = np.vstack([before, walked])
        self.out = len(before)
        self.place = max(PLACE_TOLERANCE * problem.scale, problem.tolerance)
        self.tiny = 5.0 * problem.tolerance
        xy = problem.points[:, :2]
        near = [float(o.signed_distance(xy).min()) - problem.clearance for o in problem.obstacles]
        if min(near, default=np.inf) < self.place:
            # near a boundary, roadmaps move the ends of their paths off it
            self.tiny += STAND_OFF_ALLOWANCE * problem.scale
        self.visits: list[int] = []

    @cached_property
    def puller(self) -> StringPuller:
        """Triangulated free space that covers the path."""
        problem = self.problem
        return StringPuller(problem, problem.tether_length, self.place, self.path, self.policy)

    def run(self) -> list[Check]:
        checks = [self._belongs()]
        if self.solution.length is None:
            checks.append(Check("has a tour", False, f"status {self.solution.status.value}"))
            return checks
        if not self._is_finite():
            checks.append(Check("numbers are finite", False, "one is not a number, or infinite"))
            return checks
        if self.problem.state is not None or self.out:
            checks.append(self._starts())
        checks += [self._closed(), self._every_goal()]
        if not all(c.passed for c in checks[1:]):
            return checks
        judged = len(checks)
        checks += [self._visited(), self._clear(), *self._bounds()]
        if not checks[judged].passed:
            return checks
        checks += [self._words(), self._empty(), *self._tethers(), self._length(), self._status()]
        if self.solution.status is Status.INVALID and all(c.passed for c in checks):
            checks[-1] = Check(
                checks[-1].name, False, "invalid, yet nothing is wrong with the tour"
            )
        return checks

    def _belongs(self) -> Check:
        same = self.sha256 == self.solution.problem.sha256
        return Check(
            "belongs to the problem",
            same,
            f"sha256 {self.sha256[:12]}…"
            + (f", obstacles grown by {self.solution.margin:g}" if self.solution.margin else "")
            + (f", tether less {100.0 * self.solution.slack:g} % slack" * (self.solution.slack > 0))
            if same
            else f"solution is for another problem or another version of it "
            f"({self.solution.problem.sha256[:12]}…, this is {self.sha256[:12]}…); plan "
            "again, or take the problem that it was planned for",
        )

    def _is_finite(self) -> bool:
        """Return whether all numbers are finite; copies of a model are not validated."""
        s = self.solution
        numbers = [s.length, s.lower_bound, s.gap, *(v.tether_length for v in s.tour)]
        return bool(np.isfinite(self.path).all()) and all(
            x is None or math.isfinite(x) for x in numbers
        )

    def _starts(self) -> Check:
        """Check that the path starts at the problem's state, with a tether of the state's word."""
        name, state = "starts at the state", self.problem.state
        if state is None or self.out < 2 or len(self.path) < self.out + 1:
            return Check(name, False, "only one of problem and solution has a starting state")
        tether = self.path[: self.out]
        miss = max(
            np.linalg.norm(self.path[k] - np.array(state.position))
            for k in (self.out - 1, self.out)
        )
        if miss <= self.place:
            self.path[[self.out - 1, self.out]] = state.position
        word = reduce(crossings(tether, self.problem.representative_points))
        if word != reduce(state.signature):
            return Check(name, False, f"the tether there has the word {list(word)}")
        return Check(name, bool(miss <= self.place), self._off(float(miss)))

    def _closed(self) -> Check:
        if len(self.path) < 2:
            return Check("starts and ends at the base", False, "the path has fewer than 2 points")
        base = self.problem.points[0]
        miss = max(np.linalg.norm(self.path[0] - base), np.linalg.norm(self.path[-1] - base))
        if miss <= self.place:
            self.path[[0, -1]] = base
        return Check(
            "starts and ends at the base", bool(miss <= self.place), self._off(float(miss))
        )

    def _off(self, miss: float) -> str:
        return f"off by {miss:.3g} {self.problem.units}" if miss else "exactly"

    def _every_goal(self) -> Check:
        order = [v.goal for v in self.solution.tour]
        goals = range(len(self.problem.goals))
        cluster = self.problem.clusters
        visited = {int(cluster[g]) for g in order if g in goals}
        missing = [g for g in goals if int(cluster[g]) not in visited]
        known = set(order) & set(goals)
        too_many = [g for g in sorted(known) if sum(cluster[h] == cluster[g] for h in known) > 1]
        repeated = sorted({g for g in order if order.count(g) > 1})
        unknown = sorted(set(order) - set(goals))
        if missing or repeated or unknown or too_many:
            parts = [
                f"{what}: {', '.join(map(self._goal, which))}"
                for what, which in (
                    ("missing", missing),
                    ("repeated", repeated),
                    ("unknown", unknown),
                    ("several of one choice", too_many),
                )
                if which
            ]
            return Check("names every goal once", False, "; ".join(parts))
        before = self.problem.precedences
        for i, j in itertools.combinations(range(len(order) if len(before) else 0), 2):
            if before[cluster[order[j]], cluster[order[i]]]:
                wrong = f"{self._goal(order[i])} before {self._goal(order[j])}"
                return Check("names every goal once", False, f"the wrong way round: {wrong}")
        if self.solution.kept_order and list(cluster[order]) != sorted(cluster[order]):
            return Check("names every goal once", False, "not in the order of the problem")
        kept = ", in the order of the problem" if self.solution.kept_order else ""
        return Check("names every goal once", True, f"{len(order)} goals{kept}")

    def _goal(self, k: int) -> str:
        """Return the label of a goal of the solution, also if the problem has no such goal."""
        return self.problem.goal_label(k) if k < len(self.problem.goals) else f"goal #{k}"

    def _visited(self) -> Check:
        """Find the path vertex of each visit, in order, and move it to the goal.

        Of several vertices at a goal, the first with the stated word counts. Words and lengths are
        then those of the exact position.
        """
        name = "visits every goal in order"
        rays = self.problem.representative_points
        vertex = 0
        word: Word = ()
        visits: list[tuple[int, Floats]] = []
        if self.out:  # goals along the tether at the start do not count as visited
            vertex = self.out
            word = reduce(crossings(self.path[: vertex + 1], rays))
        place = self.path[vertex]
        for visit in self.solution.tour:
            label = self.problem.goal_label(visit.goal)
            target = self.problem.points[visit.goal + 1]
            if visit.position is not None and (
                np.linalg.norm(np.array(visit.position) - target) > self.place
            ):
                return Check(name, False, f"{label} is not at {list(visit.position)}, as stated")
            gaps = np.linalg.norm(self.path[vertex:] - target, axis=1)
            candidates = vertex + np.flatnonzero(gaps <= self.place)
            if len(candidates) == 0:
                detail = f"no path point at {label} after point {vertex}; nearest misses by "
                return Check(name, False, f"{detail}{gaps.min():.3g}")
            words = [
                concatenate(
                    word, crossings(np.vstack([place, self.path[vertex + 1 : k], target]), rays)
                )
                for k in candidates
            ]
            pick = next((i for i, w in enumerate(words) if w == reduce(visit.signature)), 0)
            vertex, word, place = int(candidates[pick]), words[pick], target
            visits.append((vertex, target))
        self._run_through(visits)
        return Check(name, True, f"{len(self.path)} path points")

    def _run_through(self, visits: list[tuple[int, Floats]]) -> None:
        """Replace the path vertex of each visit by its goal."""
        ends = {0, len(self.path) - 1, self.out}
        rows: list[Floats] = []
        waiting = deque(visits)
        for k, point in enumerate(self.path):
            points = [] if waiting and waiting[0][0] == k and k not in ends else [point]
            if k == len(self.path) - 1:
                points = []
            while waiting and waiting[0][0] == k:
                points.append(waiting.popleft()[1])
                self.visits.append(len(rows) + len(points) - 1)
            if k == len(self.path) - 1:
                points.append(point)
            rows += points
        self.path = np.array(rows)

    def _clear(self) -> Check:
        name = "enters no obstacle"
        if not self.problem.obstacles:
            return Check(name, True, "there are none")
        line = shapely.LineString(self.path[:, :2] - self.puller.origin)
        shapely.prepare(line)
        nearest, where = np.inf, ""
        for i, solid in enumerate(self.puller.solids):
            room = self._room(i, line)
            label = self.problem.obstacle_label(i)
            if room < -solid.depth or self._pierced(i, solid, line):
                how = f"by {-room:.3g}" if room < -solid.depth else "and leaves it elsewhere"
                return Check(name, False, f"enters {label} {how}")
            if room < nearest:
                nearest, where = room, label
        for bridge in bridges(self.problem, self.puller.solids, self.puller.origin, self.place):
            if line.dwithin(shapely.LineString(bridge.line), self.place) and passes(
                bridge, self.path[:, :2] - self.puller.origin, CONTACT_REACH * self.place
            ):
                one, other = map(self.problem.obstacle_label, (bridge.first, bridge.second))
                return Check(name, False, f"passes between {one} and {other}, which touch")
        if not where:
            return Check(name, True, "there is none")
        near = f"{nearest:.3g} {self.problem.units} from" if nearest > self.place else "touches"
        return Check(name, True, f"{near} {where}, the nearest")

    def _room(self, i: int, line: shapely.LineString) -> float:
        """Return the distance from the path to an obstacle that is grown by the clearance.

        It is negative inside the grown obstacle, but at least minus the clearance for a polygon.
        """
        o, origin = self.problem.obstacles[i], self.puller.origin
        if isinstance(o, Circle):
            centre = shapely.Point(np.array(o.center) - origin)
            return float(line.distance(centre)) - o.radius - self.problem.clearance
        shape = shapely.Polygon(np.array(o.polygon) - origin)
        return float(line.distance(shape)) - self.problem.clearance

    def _pierced(self, i: int, solid: Inset, line: shapely.LineString) -> bool:
        """Return whether the path meets the inset of a polygon."""
        return not isinstance(self.problem.obstacles[i], Circle) and bool(
            line.intersects(solid.shape)
        )

    def _bounds(self) -> list[Check]:
        if self.problem.bounds is None:
            return []
        xmin, ymin, xmax, ymax = self.problem.bounds
        x, y = self.path[:, 0], self.path[:, 1]
        out = max(xmin - x.min(), x.max() - xmax, ymin - y.min(), y.max() - ymax)
        return [
            Check("stays within bounds", bool(out <= self.place), f"outside by {max(out, 0):.3g}")
        ]

    def _words(self) -> Check:
        rays = self.problem.representative_points
        word: Word = ()
        before = 0
        for visit, vertex in zip(self.solution.tour, self.visits, strict=True):
            word = concatenate(word, crossings(self.path[before : vertex + 1], rays))
            before = vertex
            if word != tuple(visit.signature):
                return Check(
                    "tether word at every goal",
                    False,
                    f"at {self.problem.goal_label(visit.goal)} the path writes {list(word)}, "
                    f"the solution says {list(visit.signature)}",
                )
        return Check("tether word at every goal", True, f"{len(self.visits)} words agree")

    def _empty(self) -> Check:
        word = reduce(crossings(self.path, self.problem.representative_points))
        if self.solution.entangled and not word:
            known = range(len(self.problem.obstacles))
            stated = ", ".join(
                self.problem.obstacle_name(k) if k in known else f"#{k}"
                for k in self.solution.entangled
            )
            return Check(
                "total word is empty",
                False,
                f"yet the solution states entangled obstacles {stated}",
            )
        if word:
            names = ", ".join(self.problem.obstacle_label(i - 1) for i in entangled(word))
            return Check("total word is empty", False, f"{list(word)}: entangles {names}")
        return Check("total word is empty", True, "nothing is wrapped")

    def _tethers(self) -> list[Check]:
        """Check tethers a second time: pull each prefix and each leg taut over the triangles."""
        limit = self.problem.tether_length
        pulled = self._pulled()
        self.pulled_total = pulled.total
        known = {len(self.path) - 1: 0.0, **pulled.lengths}
        excess = pulled.longest[0] - limit
        fit = excess <= 1e-9 * limit + self.tiny
        longest = f"longest {pulled.longest[0]:.6g} of {limit:g}, at {pulled.longest[1]}"
        error, at = pulled.error
        return [
            Check(
                "contractible over triangles",
                not pulled.sleeve,
                f"{len(pulled.sleeve)} edges remain"
                if pulled.sleeve
                else "the tour shrinks to the base",
            ),
            self._along(pulled.pieces, known, longest)
            if fit and not pulled.sleeve
            else Check("taut tether fits", fit, longest),
            Check(
                "taut lengths as stated",
                error <= 0.0,
                f"within {TAUT_TOLERANCE:g} of the tether length"
                if error <= 0.0
                else f"off by {error + TAUT_TOLERANCE * limit + self.tiny:.6g} at {at}",
            ),
            *self._tension(*pulled.turning),
        ]

    def _pulled(self) -> _PulledTour:
        """Pull the tether at each visit, and each leg, taut."""
        problem, puller = self.problem, self.puller
        pieces = puller.crossings(self.path)
        points = problem.points
        # the tether at the start is not a leg
        sleeve = reduce_sleeve([c for piece in pieces[: self.out] for c in piece])
        before, place = self.out, 0
        if problem.state is not None:
            points = np.vstack([points, problem.state.position])
            place = len(points) - 1
        out = _PulledTour(pieces)
        slack = TAUT_TOLERANCE * problem.tether_length + self.tiny
        goals = [v.goal + 1 for v in self.solution.tour]
        visits = [*zip(goals, self.visits, strict=True), (0, len(self.path) - 1)]
        for k, (point, vertex) in enumerate(visits):
            leg = [c for piece in pieces[before:vertex] for c in piece]
            sleeve = reduce_sleeve(sleeve + leg)
            taut = puller.pull(points[place], points[point], reduce_sleeve(leg))
            out.total += float(np.hypot(taut.low, points[point, 2] - points[place, 2]))
            before, place = vertex, point
            if point == 0:
                break
            tether = puller.pull(points[0], points[point], sleeve)
            dz = points[point, 2] - points[0, 2]
            low, high = np.hypot(tether.low, dz), np.hypot(tether.high, dz)
            label = problem.goal_label(point - 1)
            stated = self.solution.tour[k].tether_length
            out.lengths[vertex] = float(high)
            out.longest = max(out.longest, (float(low), label))
            out.turning = max(out.turning, (tether.turning, label))
            out.error = max(out.error, (float(max(low - stated, stated - high) - slack), label))
        out.sleeve = sleeve
        return out

    def _along(
        self, pieces: list[list[tuple[int, bool]]], known: dict[int, float], longest: str
    ) -> Check:
        """Check that the tether, which fits at the goals, also fits between them."""
        name, limit = "taut tether fits", self.problem.tether_length
        found = first_overstretch(
            self.puller,
            self.path,
            pieces,
            limit * (1.0 + 1e-9) + self.tiny,
            known,
            self._arc_distance,
            self.out,
        )
        if found is None:
            return Check(name, True, longest)
        x, y, z = self.path[found.vertex]
        at = f"({x:.6g}, {y:.6g})" if z == self.problem.base[2] else f"({x:.6g}, {y:.6g}, {z:.6g})"
        return Check(name, False, f"{found.length:.6g} of {limit:g} on the way, at {at}")

    def _arc_distance(self, point: Floats) -> float:
        """Return the distance from a corner of the drawn path to the arc that the path
        circumscribes.

        The arc is part of a taut leg, so the tether fits on it. At a corner of the circumscribed
        polyline the tether is longer by the distance of the corner from the arc. The polyline is
        longer than its arc by at most the share `LENGTH_TOLERANCE`, so its corners are off by at
        most 1.5 times that share of the radius: with x half the angle between two contacts,
        tan x = x (1 + x²/3 + …) and sec x = 1 + x²/2 + ….
        """
        disks = self.puller.disks
        if not len(disks):
            return 0.0
        centre = disks[:, :2] + self.puller.origin
        out = np.hypot(*(point[:2] - centre).T) - disks[:, 2]
        on_arc = out <= 1.5 * LENGTH_TOLERANCE * disks[:, 2]
        return max(float(out[on_arc].max(initial=0.0)), 0.0)

    def _tension(self, turning: float, label: str) -> list[Check]:
        """Check the limit on the tension ratio, if any, by the capstan equation."""
        s = self.solution
        if s.max_tension_ratio is None:
            return []
        ratio = tension_ratio(s.friction, turning)
        return [
            Check(
                "tension ratio is kept",
                turning <= s.max_turning + MAX_TURNING_ERROR,
                f"{ratio:.4g} of {s.max_tension_ratio:g}, at {label}" if label else "no turning",
            )
        ]

    def _length(self) -> Check:
        stated = float(self.solution.length or 0.0)
        drawn = float(np.linalg.norm(np.diff(self.path[self.out :], axis=0), axis=1).sum())
        tiny = self.tiny * (len(self.visits) + 1)
        ok = (
            self.pulled_total <= stated * (1.0 + 1e-7) + tiny
            and stated <= drawn * (1.0 + 1e-7) + tiny
            and drawn <= stated * (1.0 + LENGTH_TOLERANCE) + tiny
        )
        return Check(
            "length is right",
            bool(ok),
            f"stated {stated:.6f}, drawn {drawn:.6f}, legs pulled taut {self.pulled_total:.6f}",
        )

    def _status(self) -> Check:
        s = self.solution
        fault = self._fault_of_bound()
        bound = "no bound" if s.bound is None else s.bound.says(s.length, self.problem.units)
        return Check(
            "bound, gap and status agree", fault is None, fault or f"{s.status.value}, {bound}"
        )

    def _fault_of_bound(self) -> str | None:
        """Return what is inconsistent in the stated bound, gap and status, or None."""
        s = self.solution
        length, gap, status = float(s.length or 0.0), s.gap, s.status
        if status in (Status.INFEASIBLE, Status.NO_SOLUTION_FOUND):
            return f"{status.value}, yet has a tour"
        if (s.lower_bound is None) != (gap is None):
            return "bound without gap or gap without bound"
        if s.bound is None:
            if s.certified != "none":
                return f"certified: {s.certified}, but there is no bound"
            return f"{status.value}, but there is no bound" if status.is_optimal else None
        bound, scope = s.bound.length, s.bound.scope
        if scope in NOT_OF_PROBLEMS:
            return f"a bound on {scope.tours}, which no solution of a problem has"
        if bound > length + 1e-9 * max(length, self.problem.scale):
            return f"bound {bound:g} above length {length:g}"
        if gap is None or abs(gap - s.bound.gap(length)) > GAP_TOLERANCE:
            return f"the stated gap is not that of the bound, {s.bound.percent(length, 6)}"
        provable = solution_scope(s.roadmap, s.classes, kept_order=s.kept_order)
        if not provable.includes(scope) or scope.keeps_order != s.kept_order:
            return f"a bound on {scope.tours}, but a run like this can bound {provable.tours}"
        if fault := self._fault_of_certificate(length):
            return fault
        closed = gap <= CLOSED_GAP_TOLERANCE
        if status.is_optimal and status is not Status.OPTIMAL_OF_KEPT and not closed:
            return f"{status.value}, but the gap is {s.bound.percent(length, 6)}"
        if status.is_optimal and closed and status is not Status.optimal_of(scope):
            return f"{status.value}, but the bound is one on {scope.tours}"
        return None

    def _fault_of_certificate(self, length: float) -> str | None:
        """Return how the stated certificate contradicts the other fields, or None."""
        s, shown = self.solution, self.solution.certified_lower_bound
        says = f"certified: {s.certified}"
        if (s.certified == "none") != (shown is None):
            return f"{says}, {'yet with' if shown else 'but without'} certified_bound"
        if shown is None:
            return None
        if shown.length > length * (1.0 + OPTIMALITY_TOLERANCE):
            return f"certified_bound {shown.length:g} above length {length:g}"
        if s.certified == "optimal" and not (s.status.is_optimal and shown.proves(length)):
            return (
                f"{says}, but the status is {s.status.value}, and certified_bound is "
                f"{shown.percent(length, 4)} below the length"
            )
        return None
