"""Shortest tour as a function of the tether's length.

A taut tether is longest at the ends of a leg: unrolled class by class, the plane without its
obstacles is a space (its universal cover, which is CAT(0)) in which the length of the shortest path
from the base is convex along shortest paths. So a tour's longest tether is that of one of its
vertices, the shortest tour f(L) with a tether of length L is the shortest over the vertices whose
tether is at most L, and f is a falling staircase.

Its steps are found from above: the shortest tour with the longest tether stays the shortest down to
the longest tether t that it needs; below t, the vertices with tethers of t and more are gone, and
the shortest remaining tour is the next step. Every step takes one solve, and the last ends at the
shortest sufficient tether, below which some goal is out of reach. Tethers longer than half of a
known tour never matter (`_max_useful_tether`).
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock, TimeLimit
from netsp.base.data_frames import frame_of
from netsp.base.errors import InputError, LimitReachedError
from netsp.base.field_types import checked_argument
from netsp.base.files import write_text
from netsp.base.interrupt_signals import until_interrupt
from netsp.base.reprs import Drawn
from netsp.gtsp.travel.kept import with_classes_left_out
from netsp.gtsp.travel.result import Result
from netsp.model.bound_scope import LowerBound, Scope
from netsp.model.problem import Problem
from netsp.model.solution import Status
from netsp.plan.sizing.sizing_policy import SizingPolicy
from netsp.plan.solve_problem import solve_graph, travel_graph
from netsp.roadmap.explain_unreachable import shortest_tethers
from netsp.roadmap.travel_graph import TravelGraph

if TYPE_CHECKING:
    import pandas

REQUEST_TOLERANCE = 1e-7
"""Tolerance of a tether for which a roadmap is built, relative: it is made so much longer."""

STEP_TOLERANCE = 1e-9
"""Tolerance of lengths of tours and of tethers that are the same, relative."""


@dataclass(frozen=True)
class Step:
    """Step of the staircase.

    Parameters
    ----------
    tether : float
        Shortest tether length that allows this tour.
    until : float
        Tether length from which on another tour is shorter; for the last step the longest asked
        for.
    length : float
        Length of the tour.
    lower_bound : float
        Lower bound on tours with a tether shorter than `until`.
    status : Status
        What is proven of the tour.
    order : tuple of int
        Goals (from 0) in the order of their visits.
    """

    tether: float
    until: float
    length: float
    lower_bound: float
    status: Status
    order: tuple[int, ...]

    @property
    def bound(self) -> LowerBound:
        """Return the lower bound, on all tours with such a tether."""
        return LowerBound(self.lower_bound, Scope.ALL_TOURS)

    @property
    def gap(self) -> float:
        """Return (length - lower_bound) / length."""
        return self.bound.gap(self.length)


@dataclass(frozen=True)
class TetherCurve(Drawn):
    """Shortest tour for every tether length up to the longest asked for.

    Parameters
    ----------
    name : str
        Name of the problem.
    units : str
        Units of length.
    steps : tuple of Step
        Steps from the shortest tether up.
    shortest : float
        Shortest sufficient tether: with less, some goal cannot be reached.
    needs : int
        Goal (from 0) that needs it.
    whole : bool
        Whether the staircase goes down to the shortest sufficient tether; otherwise the time was
        up.
    """

    picture: ClassVar[str] = "netsp.view.pictures.sizing:draw_tether_curve"

    name: str
    units: str
    steps: tuple[Step, ...]
    shortest: float
    needs: int
    whole: bool

    def to_frame(self) -> pandas.DataFrame:
        """Return the staircase as a pandas DataFrame, with a column for each field of `Step`.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        return frame_of(self.steps)

    @property
    def proven(self) -> bool:
        """Return whether every step is the shortest tour of its tether lengths."""
        return self.whole and all(s.status is Status.OPTIMAL for s in self.steps)

    def length_at(self, tether: float) -> float:
        """Return the length of the shortest tour with a tether of some length; inf if no tour is
        known."""
        fits = [s.length for s in self.steps if s.tether <= tether * (1.0 + STEP_TOLERANCE)]
        return min(fits, default=np.inf)

    def to_json(self) -> str:
        """Return the curve as a JSON object with the steps in a list."""
        steps = [
            {
                **vars(s),
                "lower_bound_of": s.bound.scope.value,
                "status": s.status.value,
                "order": list(s.order),
            }
            for s in self.steps
        ]
        data = {
            "problem": self.name,
            "units": self.units,
            "shortest_tether": self.shortest,
            "needed_by_goal": self.needs,
            "whole": self.whole,
            "steps": steps,
        }
        return json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n"

    def to_csv(self) -> str:
        """Return the curve as a CSV table, with a row for every step."""
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(
            ["tether", "until", "length", "lower_bound", "lower_bound_of", "status", "order"]
        )
        for s in self.steps:
            table.writerow(
                [
                    f"{s.tether:.9g}",
                    f"{s.until:.9g}",
                    f"{s.length:.9g}",
                    f"{s.bound.length:.9g}",
                    s.bound.scope.value,
                    s.status.value,
                    " ".join(map(str, s.order)),
                ]
            )
        return text.getvalue()

    def save(self, file: str | Path) -> None:
        """Write the curve: a table if the name ends in ``.csv``, otherwise JSON.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        write_text(file, self.to_csv() if Path(file).suffix.lower() == ".csv" else self.to_json())


def tether_curve(
    problem: Problem,
    longest: float | None = None,
    *,
    solver: str = "auto",
    time_limit: TimeLimit = None,
    seed: int = 0,
    on_step: Callable[[Step], None] | None = None,
    policy: SizingPolicy | None = None,
) -> TetherCurve:
    """Return the shortest tour of a problem as a function of its tether's length.

    Parameters
    ----------
    longest : float, optional
        Longest tether, in the problem's units; by default that of the problem.
    solver : str
        Name of the solver for every step.
    time_limit : float or Clock, optional
        Seconds in all; the steps found so far are returned when they are up, or at Ctrl-C.
    on_step : callable, optional
        Called with every step, from the longest tether down.
    policy : SizingPolicy, optional
        Limit of the number of classes measured at the start.

    Raises
    ------
    InputError
        Bad arguments, or a problem whose robot is already out.
    InfeasibleError
        Some goal is out of the longest tether's reach.
    """
    if problem.state is not None:
        raise InputError(
            "state: a tether's length is chosen before the robot is out; expected none"
        )
    if longest is not None:
        longest = checked_argument("longest", longest, 1e-9)
        is_cropped = problem.site is not None and problem.site.cropped is not None
        if is_cropped and longest > problem.tether_length:
            raise InputError(
                f"longest: expected at most {problem.tether_length:g}, the tether that the map was "
                f"imported for, got {longest:g}"
            )
        problem = problem.model_copy(update={"tether_length": longest})
    with until_interrupt(time_limit) as clock:
        return _staircase(problem, solver, clock, seed, on_step, policy or SizingPolicy())


def _staircase(
    problem: Problem,
    solver: str,
    clock: Clock,
    seed: int,
    on_step: Callable[[Step], None] | None,
    policy: SizingPolicy,
) -> TetherCurve:
    """Solve for shorter and shorter tethers, until the time is up or no tour is left."""
    shortest = _nearest_of_choices(problem, shortest_tethers(problem))
    useful = _max_useful_tether(problem, float(shortest.max()), solver, clock, seed)
    graph = travel_graph(problem.model_copy(update={"tether_length": useful}), time_limit=clock)
    curve: list[Step] = []
    limit, bound, whole = problem.tether_length, 0.0, False
    if len(graph) <= policy.max_measured_classes:
        with graph.on_clock(clock):
            _ = graph.costs
    while True:
        first = not curve
        fits = graph.tethers <= limit if first else graph.tethers < limit * (1.0 - STEP_TOLERANCE)
        fits[0] = True
        if len(np.unique(graph.cluster[fits])) <= graph.goal_count:
            whole = True
            break
        if clock.is_up:
            break
        try:
            result, vertices = _solve_step(graph, fits, solver, clock, seed, limit)
        except LimitReachedError:
            break
        if result.tour is None or result.length is None:
            break
        tour = vertices[list(result.tour)]
        needs = float(graph.tethers[tour].max())
        # a longer tether never makes the shortest tour longer
        bound = min(max(bound, result.lower_bound or 0.0), result.length)
        order = tuple(int(g) - 1 for g in graph.goal[tour[1:]])
        step = Step(needs, limit, result.length, bound, result.status, order)
        limit = needs
        if curve and step.length <= curve[-1].length * (1.0 + STEP_TOLERANCE):
            step = replace(curve.pop(), tether=needs, order=order)
        curve.append(step)
        if on_step is not None:
            on_step(step)
    k = int(np.argmax(shortest))
    steps = tuple(reversed(curve))
    return TetherCurve(problem.name, problem.units, steps, float(shortest[k]), k, whole)


def _nearest_of_choices(problem: Problem, tethers: Floats) -> Floats:
    """Return the tethers with 0 for every goal that has a nearer alternative."""
    out = tethers.copy()
    for c in range(1, problem.visits + 1):
        members = np.flatnonzero(problem.clusters == c)
        out[np.setdiff1d(members, members[np.argmin(tethers[members])])] = 0.0
    return out


def _max_useful_tether(
    problem: Problem, shortest: float, solver: str, clock: Clock, seed: int
) -> float:
    """Return the longest tether that can matter. A tour goes out to its longest tether and back, so
    with a tether longer than half of a known tour it is longer than that tour. A tour is known from
    the shortest sufficient tether."""
    if not shortest < problem.tether_length:
        return problem.tether_length  # out of reach, which will be said; or no choice
    min_tether = min(shortest * (1.0 + REQUEST_TOLERANCE), problem.tether_length)
    graph = travel_graph(problem.model_copy(update={"tether_length": min_tether}), time_limit=clock)
    with graph.on_clock(clock):
        known = solve_graph(graph, solver, time_limit=clock, seed=seed).length
    if known is None:
        return problem.tether_length
    return min(max(0.5 * known * (1.0 + REQUEST_TOLERANCE), min_tether), problem.tether_length)


def _solve_step(
    graph: TravelGraph, fits: np.ndarray, solver: str, clock: Clock, seed: int, limit: float
) -> tuple[Result, np.ndarray]:
    """Return the shortest tour over some vertices, with what holds for all classes of such tethers,
    and the vertices."""
    vertices = np.flatnonzero(fits)
    with graph.on_clock(clock):
        result = solve_graph(graph.subgraph(vertices), solver, time_limit=clock, seed=seed)
    left_out = graph.min_tether_left_out
    bound_left_out = graph.min_length_by_tether(left_out) if left_out <= limit else math.inf
    because = "a tour through a class left out goes along its tether and back"
    return with_classes_left_out(result, bound_left_out, Scope.ALL_TOURS, because), vertices
