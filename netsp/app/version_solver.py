"""Tours of one version of a problem, sent to the page while they are found."""

from __future__ import annotations

import contextlib
import time
from itertools import pairwise
from multiprocessing.connection import Connection
from typing import Any

from netsp.app.app_policy import AppPolicy
from netsp.app.facts import bound_message, facts, needed, plain, shortest_sufficient
from netsp.base.clock import Clock
from netsp.base.errors import InfeasibleError, InputError, NetspError
from netsp.gtsp.travel.result import Progress
from netsp.judge import checked
from netsp.model.problem import Problem
from netsp.model.solution import Solution, Status
from netsp.plan.answer import to_solution
from netsp.plan.solve_problem import DEFAULT_SOLVER, solve_over, travel_graph
from netsp.plan.warm_start import old_tour
from netsp.roadmap.travel_graph import TravelGraph


class VersionSolver:
    """Solver of one version, whose tours, facts and errors are sent over a connection.

    Parameters
    ----------
    connection : Connection
        Connection to the page's server; a new job on it ends the work.
    version : int
        Number of the version.
    text : str
        Text of its problem file.
    policy : AppPolicy
        Time between two tours, and number of places at which the tether is measured.
    """

    def __init__(
        self, connection: Connection, version: int, text: str, policy: AppPolicy = AppPolicy()
    ) -> None:
        self.problem = Problem.from_json(text)
        self._connection, self._version, self._policy = connection, version, policy
        self._graph: TravelGraph | None = None
        self._shown_at = 0.0
        self._shown_length: float | None = None

    def solve(self, time_limit: float, before: Solution | None) -> Solution | None:
        """Solve the version, and return its solution; None without one or if stopped.

        The search starts from the previous tour, adapted to the edit (`netsp.plan.warm_start`),
        because an edit rarely changes much.
        """
        clock = Clock(time_limit, should_stop=self._connection.poll)
        try:
            return self._solve(clock, before)
        except InfeasibleError as error:
            enclosing = list(error.enclosing)
            unreached = out_of_reach(self.problem)
            self._send(stage="done", error=str(error), enclosing=enclosing, **unreached)
        except NetspError as error:
            if not clock.is_stopped:
                self._send(stage="done", error=str(error))
        finally:
            clock.close()
        return None

    def _solve(self, clock: Clock, before: Solution | None) -> Solution | None:
        problem, start = self.problem, None
        self._graph = travel_graph(problem, time_limit=clock)
        if before is not None:
            with contextlib.suppress(InputError):  # nothing is left of the tour before
                old_tour(problem, before)
                start = before
        graph, result = solve_over(
            problem,
            self._graph,
            DEFAULT_SOLVER,
            clock,
            warm_start=start,
            on_progress=self._on_progress,
            on_graph=self._on_graph,
        )
        if clock.is_stopped:
            return None
        if result.tour is None:
            self._send(stage="done", error=result.status.value)
            return None
        solution = checked(problem, to_solution(problem, graph, result, DEFAULT_SOLVER, 0))
        self._send(
            stage="done",
            status=result.status.value,
            length=result.length,
            **bound_message(result.status, result.length, result.bound),
            solution=solution.to_json(),
            **_drawn(graph, result.tour),
        )
        tour_facts = facts(problem, solution, self._connection.poll, self._policy)
        if tour_facts is not None:
            self._send(facts=tour_facts)
        return solution

    def _send(self, **values: Any) -> None:
        self._connection.send({"version": self._version, **values})

    def _on_graph(self, graph: TravelGraph) -> None:
        self._graph = graph

    def _on_progress(self, row: Progress) -> None:
        """Send a better tour, not sooner than the policy allows after the last one."""
        if row.tour is None or row.incumbent is None or row.incumbent == self._shown_length:
            return
        if time.monotonic() < self._shown_at + self._policy.tour_interval_s:
            return
        assert self._graph is not None
        self._shown_at, self._shown_length = time.monotonic(), row.incumbent
        bound = bound_message(Status.FEASIBLE, row.incumbent, row.bound)
        if not bound["lower_bound"]:
            bound["proof"] = "searching"  # a bound may still come
        drawn = _drawn(self._graph, row.tour)
        self._send(stage="searching", length=row.incumbent, **bound, **drawn)


def _drawn(graph: TravelGraph, tour: tuple[int, ...]) -> dict[str, Any]:
    """Return the path and the visits of a tour."""
    legs = [graph.path(u, v) for u, v in pairwise((*tour, 0))]
    visits = [
        {
            "goal": int(graph.goal[v]) - 1,
            "tether": float(graph.tethers[v]),
            "word": list(graph.signatures[v]),
        }
        for v in tour[1:]
    ]
    return {"path": [p[:3].tolist() for leg in legs for p in leg], "visits": visits}


def out_of_reach(problem: Problem) -> dict[str, Any]:
    """Return the goals that the tether does not reach, with the tether that each needs, and the
    shortest tether that reaches all.

    None stands for a goal to which nothing leads.
    """
    if problem.state is not None:
        return {"unreached": [], "needed": None}
    try:
        lengths = needed(problem)
    except InputError:  # too far apart to be measured: the error itself says which goal, and why
        return {"unreached": [], "needed": None}
    unreached = [
        {"goal": k, "needed": plain(float(t))}
        for k, t in enumerate(lengths)
        if t > problem.tether_length
    ]
    return {"unreached": unreached, "needed": shortest_sufficient(problem)}
