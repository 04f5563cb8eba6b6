"""Tours of the latest version, from a process of its own: the page never waits for a proof.

The worker begins again whenever a newer version is there, which it notices within a few hundredths
of a second (`solve(should_stop=…)`); one that dies is replaced.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import threading
import time
from collections.abc import Callable
from itertools import pairwise
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from netsp.app.app_policy import AppPolicy

if TYPE_CHECKING:
    from netsp.model.bound_scope import LowerBound
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution, Status

OnMessage = Callable[[dict[str, Any]], None]


class Worker:
    """Solves the latest version that it is given.

    Parameters
    ----------
    told : callable
        Called in a thread with what the worker says: version, stage, and a tour or an error.
    time_limit : float
        Seconds for one version.
    policy : AppPolicy
        Time between two tours, and number of places at which the tether is measured.
    """

    def __init__(
        self, told: OnMessage, time_limit: float = 60.0, policy: AppPolicy = AppPolicy()
    ) -> None:
        self.told, self.time_limit, self._policy = told, time_limit, policy
        self._lock = threading.Lock()
        self._closed = False
        self._latest: tuple[int, str] | None = None
        self._start()

    def solve(self, version: int, problem: str) -> None:
        """Solve this version from now on.

        Parameters
        ----------
        version : int
            Its number.
        problem : str
            Text of its problem file.
        """
        with self._lock:
            self._latest = version, problem
            if not self._process.is_alive():
                self._start()
            self._ours.send((version, problem, self.time_limit))

    def close(self) -> None:
        """End the worker."""
        self._closed = True
        with self._lock:
            self._process.kill()
            self._process.join()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._ours, theirs = context.Pipe()
        self._process = context.Process(target=work, args=(theirs, self._policy), daemon=True)
        self._process.start()
        theirs.close()
        threading.Thread(
            target=self._listen, args=(self._ours,), daemon=True, name="netsp-app-solving"
        ).start()

    def _listen(self, connection: Connection) -> None:
        while True:
            try:
                said = connection.recv()
            except (EOFError, OSError):
                break
            self.told(said)
        with self._lock:  # it died: whoever asked last is served by the next
            if not self._closed and connection is self._ours and self._latest is not None:
                version, _ = self._latest
                self.told(
                    {
                        "version": version,
                        "stage": "failed",
                        "error": "the solver's process died; it is started again",
                    }
                )
                self._latest = None
                self._start()


def work(connection: Connection, policy: AppPolicy = AppPolicy()) -> None:
    """Solve the versions that arrive until the other end closes."""
    last: Solution | None = None
    try:
        while True:
            job = connection.recv()
            while connection.poll():
                job = connection.recv()
            version, text, limit = job
            last = _solve(connection, version, text, limit, last, policy) or last
    except (EOFError, OSError, KeyboardInterrupt):
        return


def _solve(
    connection: Connection,
    version: int,
    text: str,
    time_limit: float,
    before: Solution | None,
    policy: AppPolicy = AppPolicy(),
) -> Solution | None:
    """Solve one version, and tell the tours found on the way: first what is left of the tour before
    (`netsp.plan.warm_start`), which an edit rarely changes much. Returns the solution if there is
    one.
    """
    from netsp.app.facts import facts
    from netsp.base.clock import Clock
    from netsp.base.errors import InfeasibleError, InputError, NetspError
    from netsp.gtsp.travel.graph import TravelGraph
    from netsp.gtsp.travel.result import Progress
    from netsp.judge import checked
    from netsp.model.problem import Problem
    from netsp.model.solution import Status
    from netsp.plan.answer import to_solution
    from netsp.plan.solve_problem import DEFAULT_SOLVER as SOLVER
    from netsp.plan.solve_problem import solve_over, travel_graph
    from netsp.plan.warm_start import old_tour

    problem = Problem.from_json(text)
    told: list[Any] = [0.0, None]
    graphs: list[TravelGraph] = []

    def drawn(graph: TravelGraph, tour: tuple[int, ...]) -> dict[str, Any]:
        legs = [graph.path(u, v) for u, v in pairwise((*tour, 0))]
        path = [p[:3].tolist() for leg in legs for p in leg]
        visits = [
            {
                "goal": int(graph.goal[v]) - 1,
                "tether": float(graph.tethers[v]),
                "word": list(graph.signatures[v]),
            }
            for v in tour[1:]
        ]
        return {"path": path, "visits": visits}

    def tell(row: Progress) -> None:
        graph = graphs[-1]
        if row.tour is None or row.incumbent is None:
            return
        if row.incumbent == told[1] or time.monotonic() < told[0] + policy.tour_interval_s:
            return
        told[:] = time.monotonic(), row.incumbent
        said = bound_message(Status.FEASIBLE, row.incumbent, row.bound)
        if not said["lower_bound"]:
            said["proof"] = "searching"  # a bound may still come
        connection.send(
            {
                "version": version,
                "stage": "searching",
                "length": row.incumbent,
                **said,
                **drawn(graph, row.tour),
            }
        )

    start: Solution | None = None
    clock = Clock(time_limit, should_stop=connection.poll)
    try:
        graph = travel_graph(problem, time_limit=clock)
        graphs.append(graph)
        if before is not None:
            with contextlib.suppress(InputError):
                old_tour(problem, before)
                start = before  # else nothing is left of it
        graph, result = solve_over(
            problem,
            graph,
            SOLVER,
            clock,
            warm_start=start,
            on_progress=tell,
            on_graph=graphs.append,
        )
        if clock.is_stopped:
            return None
        if result.tour is None:
            connection.send({"version": version, "stage": "done", "error": result.status.value})
            return None
        found = checked(problem, to_solution(problem, graph, result, SOLVER, 0))
        connection.send(
            {
                "version": version,
                "stage": "done",
                "status": result.status.value,
                "length": result.length,
                **bound_message(result.status, result.length, result.bound),
                "solution": found.to_json(),
                **drawn(graph, result.tour),
            }
        )
        known = facts(problem, found, connection.poll, policy)
        if known is not None:
            connection.send({"version": version, "facts": known})
        return found
    except InfeasibleError as error:
        connection.send(
            {
                "version": version,
                "stage": "done",
                "error": str(error),
                "enclosing": list(error.enclosing),
                **_out_of_reach(problem),
            }
        )
    except NetspError as error:
        if not clock.is_stopped:
            connection.send({"version": version, "stage": "done", "error": str(error)})
    finally:
        clock.close()
    return None


def bound_message(status: Status, length: float | None, bound: LowerBound | None) -> dict[str, Any]:
    """Return the fields of a tour's bound for the page: length, scope and the words shown."""
    from netsp.model.solution import proof

    return {
        "lower_bound": None if bound is None else bound.length,
        "lower_bound_of": None if bound is None else bound.scope.value,
        "proof": proof(status, length, bound),
    }


def _out_of_reach(problem: Problem) -> dict[str, Any]:
    """Goals that the tether does not reach, with what each needs (None: nothing leads there), and
    the tether that would do for all."""
    from netsp.app.facts import needed, plain, shortest_sufficient
    from netsp.base.errors import InputError

    if problem.state is not None:
        return {"unreached": [], "needed": None}
    try:
        lengths = needed(problem)
    except InputError:  # too far apart to be measured: the error itself says which goal, and why
        return {"unreached": [], "needed": None}
    far = [
        {"goal": k, "needed": plain(float(t))}
        for k, t in enumerate(lengths)
        if t > problem.tether_length
    ]
    return {"unreached": far, "needed": shortest_sufficient(problem)}
