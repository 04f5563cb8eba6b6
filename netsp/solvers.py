"""Names of roadmaps and solvers, and the one call that takes a problem to a solution."""

from __future__ import annotations

import importlib
import importlib.metadata
import inspect
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from netsp.errors import InputError
from netsp.problem import Problem
from netsp.result import OnProgress, Result, relative_gap
from netsp.solution import ProblemReference, Solution, Timings, Visit
from netsp.travel import TravelGraph

SOLVERS: dict[str, str] = {"mip": "netsp.mip:solve"}
"""Solver name → where its `solve(graph, …) -> Result` lives."""

ROADMAPS: dict[str, str] = {
    "taut": "netsp.roadmap.taut:TautRoadmap",
    "prm": "netsp.roadmap.prm:PrmRoadmap",
}
"""Roadmap name → class with `travel_graph()`."""

SEEDED_ROADMAPS = frozenset({"prm"})

DEFAULT_SOLVER = "mip"
DEFAULT_ROADMAP = "taut"


def _load(table: Mapping[str, str], kind: str, name: str) -> Any:
    if name not in table:
        raise InputError(f"{kind}: unknown {name!r}; expected one of {', '.join(sorted(table))}")
    module, attribute = table[name].split(":")
    return getattr(importlib.import_module(module), attribute)


def build_roadmap(problem: Problem, roadmap: str = DEFAULT_ROADMAP, **options: Any) -> Any:
    """The named roadmap over a problem.

    Raises InputError for an unknown roadmap or option, InfeasibleError if a goal cannot be reached.
    """
    build = _load(ROADMAPS, "roadmap", roadmap)
    known = {k for k, p in inspect.signature(build).parameters.items() if p.kind == p.KEYWORD_ONLY}
    unknown = sorted(set(options) - known)
    if unknown:
        raise InputError(
            f"roadmap {roadmap!r}: unknown option {unknown[0]!r}; expected one of "
            f"{', '.join(sorted(known))}"
        )
    return build(problem, **options)


def travel_graph(problem: Problem, roadmap: str = DEFAULT_ROADMAP, **options: Any) -> TravelGraph:
    """The travel graph of a problem by the named roadmap; errors as `build_roadmap`."""
    graph: TravelGraph = build_roadmap(problem, roadmap, **options).travel_graph()
    return graph


def solve_graph(
    graph: TravelGraph,
    solver: str = DEFAULT_SOLVER,
    *,
    time_limit: float | None = None,
    seed: int = 0,
    params: Mapping[str, Any] | None = None,
    warm_start: Sequence[int] | None = None,
    on_progress: OnProgress | None = None,
) -> Result:
    """Run a solver on a travel graph."""
    run: Callable[..., Result] = _load(SOLVERS, "solver", solver)
    return run(
        graph,
        time_limit=time_limit,
        rng=np.random.default_rng(seed),
        params=params,
        warm_start=warm_start,
        on_progress=on_progress,
    )


def solve(
    problem: Problem,
    solver: str = DEFAULT_SOLVER,
    *,
    roadmap: str = DEFAULT_ROADMAP,
    roadmap_options: Mapping[str, Any] | None = None,
    time_limit: float | None = None,
    seed: int = 0,
    params: Mapping[str, Any] | None = None,
    warm_start: Solution | None = None,
    on_progress: OnProgress | None = None,
) -> Solution:
    """Find the shortest non-entangling tour of a problem.

    Parameters
    ----------
    roadmap_options : for ``taut``: ``max_classes``; for ``prm``: ``samples``, ``shortcut``.
    time_limit : seconds for the whole call; the best tour so far is returned when it is up.
    seed : feeds the solver's random generator, and the sampling of a roadmap that samples.
    warm_start : a solution of the same problem to start from.
    on_progress : called with a `netsp.result.Progress` now and then.

    Raises
    ------
    InputError : unknown names, bad limits, a warm start for another problem.
    InfeasibleError : some goal is out of the tether's reach; says which and by how much.
    LimitReachedError : the time was up before the travel graph was complete.

    >>> from netsp import Problem, solve
    >>> problem = Problem(base=(0, 0), goals=[(3, 4)], obstacles=[], tether_length=6)
    >>> solve(problem).length
    10.0
    """
    if time_limit is not None and not time_limit > 0:
        raise InputError(f"time_limit: expected a positive number of seconds, got {time_limit!r}")
    if warm_start is not None and warm_start.problem.sha256 != problem.sha256:
        raise InputError("warm_start: it is the solution of another problem (sha256 differs)")
    _load(SOLVERS, "solver", solver)
    begin = time.monotonic()
    options: dict[str, Any] = {"time_limit": time_limit, **(roadmap_options or {})}
    if roadmap in SEEDED_ROADMAPS:
        options.setdefault("seed", seed)
    graph = travel_graph(problem, roadmap, **options)
    built = time.monotonic()
    graph.costs  # noqa: B018 - computed here so that its time is told apart
    measured = time.monotonic()
    result = solve_graph(
        graph,
        solver,
        time_limit=None if time_limit is None else max(time_limit - (measured - begin), 1e-3),
        seed=seed,
        params=params,
        warm_start=_tour_of(warm_start, graph) if warm_start is not None else None,
        on_progress=on_progress,
    )
    solved = time.monotonic()
    timings = Timings(
        roadmap_s=round(built - begin, 6),
        matrix_s=round(measured - built, 6),
        solve_s=round(solved - measured, 6),
        total_s=round(solved - begin, 6),
    )
    return to_solution(problem, graph, result, solver, seed, timings)


def to_solution(
    problem: Problem,
    graph: TravelGraph,
    result: Result,
    solver: str,
    seed: int | None,
    timings: Timings | None = None,
) -> Solution:
    """Write a solver's result as a solution of the problem, its path drawn."""
    tour = result.tour or ()
    path: list[tuple[float, float, float]] = []
    for u, v in zip(tour, (*tour[1:], 0), strict=False):
        leg = [(float(x), float(y), float(z)) for x, y, z in graph.path(u, v)]
        path.extend(leg if not path else leg[1:])
    return Solution(
        problem=ProblemReference(name=problem.name, sha256=problem.sha256),
        solver=solver,
        roadmap=graph.roadmap,
        seed=seed,
        status=result.status,
        length=result.length,
        lower_bound=result.lower_bound,
        gap=relative_gap(result.length, result.lower_bound),
        tour=tuple(
            Visit(
                goal=int(graph.cluster[v]) - 1,
                signature=graph.signatures[v],
                tether_length=float(graph.tethers[v]),
            )
            for v in tour[1:]
        ),
        path=tuple(path),
        timings=timings or Timings(),
        versions=versions(),
    )


def _tour_of(solution: Solution, graph: TravelGraph) -> list[int] | None:
    """The vertices of a solution's tour, or None if a class of it is not in the graph."""
    place = {
        (int(c), w): v for v, (c, w) in enumerate(zip(graph.cluster, graph.signatures, strict=True))
    }
    tour = [place.get((visit.goal + 1, tuple(visit.signature)), -1) for visit in solution.tour]
    return None if -1 in tour or not tour else [0, *tour]


def versions() -> dict[str, str]:
    """Versions of what computed a solution."""
    names = ("netsp", "numpy", "numba", "highspy", "pulp", "ompl")
    out = {"python": platform.python_version()}
    for name in names:
        try:
            out[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return out
