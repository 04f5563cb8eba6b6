"""Solving a problem, by names of roadmaps and solvers."""

from __future__ import annotations

import contextlib
import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from netsp.base.clock import Clock, TimeLimit
from netsp.base.errors import InputError, LimitReachedError, counted
from netsp.base.field_types import checked_argument
from netsp.base.interrupt_signals import until_interrupt
from netsp.base.registry import check_callable, foreign, load
from netsp.base.validated import shown
from netsp.gtsp.instance import BaselessInstance, Instance
from netsp.gtsp.limits import Limits
from netsp.gtsp.params import NoParams, read_params
from netsp.gtsp.travel.result import OnProgress, Progress, Result
from netsp.model.bound_scope import Scope
from netsp.model.problem import Problem
from netsp.model.solution import MAX_FRICTION, ProblemReference, Solution, Timings, max_turning
from netsp.plan import without_base
from netsp.plan.answer import to_solution
from netsp.plan.custom import call, read_options, whole_numbers
from netsp.plan.in_order import solve_in_order
from netsp.plan.solve_policy import SolvePolicy
from netsp.plan.solver_table import ROADMAPS, SOLVERS
from netsp.plan.tether_carry_columns import OnGraph, with_carried
from netsp.plan.warm_start import old_tour, tour_from, with_old_classes
from netsp.roadmap.travel_graph import TravelGraph

SolverLike = str | Callable[..., Any]
"""A solver's name, or a callable that takes a travel graph (`netsp.plan.custom`)."""

RoadmapLike = str | Callable[..., Any]
"""A roadmap's name, or a callable that takes a problem; it returns a travel graph, or an object
with `to_travel_graph()`."""

MAX_SEED = 2**62
"""Format of result tables: largest seed or iteration limit, a signed 64-bit integer."""

MAX_TIME_LIMIT_S = 1e9
"""Tolerance of clocks: largest time limit, s; longer waits overflow in some operating systems."""

CARRIED = ("auto", "lns")
"""Solvers that also search classes along good tours if the roadmap left classes out."""

DEFAULT_SOLVER = "auto"
DEFAULT_ROADMAP = "taut"


def build_roadmap(problem: Problem, roadmap: RoadmapLike = DEFAULT_ROADMAP, **options: Any) -> Any:
    """Return a roadmap over a problem, by name or by calling a factory.

    Raises
    ------
    InputError
        Unknown roadmap or option.
    InfeasibleError
        A goal cannot be reached.
    """
    if not isinstance(problem, Problem):
        raise InputError(f"problem: expected a Problem, got {problem!r}")
    if callable(roadmap):
        return _built(problem, name_of(roadmap), roadmap, options)
    record = ROADMAPS.named(roadmap)
    if record.ours:
        return _built(problem, roadmap, load(record.build), options)
    with foreign(f"roadmap {roadmap!r} failed"):
        return _built(problem, roadmap, load(record.build), options)


def _built(problem: Problem, roadmap: str, build: Any, options: dict[str, Any]) -> Any:
    known = _option_names(build)
    if isinstance(options.get("time_limit"), Clock) and "time_limit" not in known:
        del options["time_limit"]  # a roadmap of another package, which has no clock
    unknown = sorted(set(options) - known)
    if unknown:
        choices = f"expected one of {', '.join(sorted(known))}" if known else "it takes none"
        raise InputError(f"roadmap {roadmap!r}: unknown option {unknown[0]!r}; {choices}")
    check_callable(f"roadmap {roadmap!r}", build, ["problem"], options)
    return build(problem, **options)


def _option_names(build: Callable[..., Any]) -> set[str]:
    """Return the options of a roadmap: the keyword-only parameters of its factory."""
    if not callable(build):
        raise InputError(f"roadmap: expected a callable, got {shown(build)}")
    parameters = inspect.signature(build).parameters
    return {k for k, p in parameters.items() if p.kind == p.KEYWORD_ONLY}


def _takes_seed(roadmap: RoadmapLike) -> bool:
    """Return whether a roadmap is given the run's seed: one of another package is if it has an
    option `seed`."""
    if callable(roadmap):
        return "seed" in _option_names(roadmap)
    record = ROADMAPS.named(roadmap)
    if record.ours:
        return record.seeded
    with foreign(f"roadmap {roadmap!r} failed"):
        return "seed" in _option_names(load(record.build))


def travel_graph(
    problem: Problem, roadmap: RoadmapLike = DEFAULT_ROADMAP, **options: Any
) -> TravelGraph:
    """Return the travel graph of a problem by a roadmap.

    Parameters
    ----------
    problem : Problem
        Problem.
    roadmap : str or callable
        Name of the roadmap, or callable `f(problem) -> TravelGraph`, whose keyword-only parameters
        are its options.
    **options : Any
        Options of the roadmap, as `roadmap_options` of `solve`.

    Raises
    ------
    InputError
        Unknown name, or bad option.
    InfeasibleError
        Some goal is out of the tether's reach.

    Examples
    --------
    >>> from netsp import Problem
    >>> graph = travel_graph(Problem.load("problems/pool.json"))
    >>> graph.goal_count, len(graph.cluster)
    (5, 135)
    """
    if not isinstance(problem, Problem):
        raise InputError(f"problem: expected a Problem, got {problem!r}")
    if problem.visits < len(problem.goals):
        from netsp.roadmap.class_alternatives import graph_of_choices

        return graph_of_choices(problem, lambda p: travel_graph(p, roadmap, **options))
    return _graph_of_places(problem, roadmap, options)


def _graph_of_places(
    problem: Problem, roadmap: RoadmapLike, options: dict[str, Any]
) -> TravelGraph:
    """Return the travel graph whose goals are the places of the problem."""
    if problem.state is not None:
        if roadmap != "taut":
            raise InputError(f"state: needs roadmap 'taut', got {name_of(roadmap)!r}")
        from netsp.roadmap.from_state import graph_from_state

        return graph_from_state(problem, **options)
    built = build_roadmap(problem, roadmap, **options)
    if isinstance(roadmap, str) and ROADMAPS.named(roadmap).ours:
        graph: TravelGraph = built.to_travel_graph()
    elif callable(roadmap):
        graph = _foreign_graph(built, name_of(roadmap), len(problem.goals))
    else:
        with foreign(f"roadmap {roadmap!r} failed"):
            graph = _foreign_graph(built, roadmap, len(problem.goals))
    graph.before = problem.precedences
    return graph


def _foreign_graph(built: Any, name: str, n_goals: int) -> TravelGraph:
    """Return the travel graph of a roadmap of another package, for some number of goals.

    Its bounds hold along this roadmap: netsp cannot check that the graph has all tours.
    """
    graph = built if isinstance(built, TravelGraph) else None
    if hasattr(built, "to_travel_graph"):
        graph = built.to_travel_graph()
    if not isinstance(graph, TravelGraph):
        got = shown(built if graph is None else graph)
        raise InputError(f"roadmap {name!r}: expected a TravelGraph from it, got {got}")
    if graph.goal_count != n_goals:
        raise InputError(
            f"roadmap {name!r}: its travel graph has {counted(graph.goal_count, 'goal')}; expected "
            f"those of the problem, {n_goals}"
        )
    graph.declared_scope, graph.roadmap = Scope.ROADMAP, name
    return graph


def solve_graph(
    graph: Instance,
    solver: SolverLike = DEFAULT_SOLVER,
    *,
    time_limit: TimeLimit = None,
    iteration_limit: int | None = None,
    seed: int = 0,
    params: Mapping[str, Any] | None = None,
    warm_start: Sequence[int] | None = None,
    on_progress: OnProgress | None = None,
) -> Result:
    """Run a solver on a travel graph, from a roadmap or from `TravelGraph.from_costs`.

    Parameters
    ----------
    graph : Instance
        Travel graph of a roadmap, or an instance from a matrix of costs.
    solver : str or callable
        Name, or callable `f(graph) -> tour`, which may have parameters named `params`, `limits`,
        `rng` and more (`netsp.plan.custom.call`).
    time_limit : float or Clock, optional
        Seconds, or the clock of a run that this one is a part of. When time is up, the best tour so
        far is returned.
    iteration_limit : int, optional
        Maximum number of iterations; each solver defines what one is. Under an iteration limit
        alone, the same seed gives the same result.
    seed : int
        Seed of the solver's random generator.
    params : mapping, optional
        Options of the solver by name, such as ``{"policy": SolvePolicy(...)}`` for ``auto`` or
        ``{"policy.routes.max_walk_goals": 10}``.
    warm_start : sequence of int, optional
        Tour to start from, as vertices from 0.
    on_progress : callable, optional
        Called with a `netsp.gtsp.travel.result.Progress` from time to time.

    Returns
    -------
    Result
        Best tour found, and its bound.

    Raises
    ------
    InputError
        Unknown name, bad limit, a warm start that is no tour of the graph, or a solver that needs
        geometry (`geometric` in `netsp.plan.solver_table`) on a graph that has none.

    Examples
    --------
    >>> from netsp import TravelGraph, solve_graph
    >>> costs = [[0, 1, 5, 4], [1, 0, 2, 9], [5, 2, 0, 2], [4, 9, 2, 0]]
    >>> solve_graph(TravelGraph.from_costs(costs, clusters=[0, 1, 2, 2])).length
    8.0
    """
    check_solver(solver, params)
    _check_limits(time_limit, iteration_limit)
    if not isinstance(graph, Instance):
        raise InputError(f"graph: expected a TravelGraph or an Instance, got {graph!r}")
    tour = None if warm_start is None else _as_tour(warm_start, graph)
    rng = np.random.default_rng(_seed(seed))
    clock = Clock.from_limit(time_limit)
    with graph.on_clock(clock):
        limits = Limits(clock, iteration_limit, rng, tour, graph.progress_listener(on_progress))
        if isinstance(graph, BaselessInstance):
            return without_base.solve(
                graph,
                lambda part, limits: _run(part, solver, params, limits),
                limits,
                proves=isinstance(solver, str) and SOLVERS.named(solver).proves,
                policy=policy_of(solver, params).baseless,
            )
        result = _run(graph, solver, params, limits)
    return graph.for_problem(result)


def _run(
    graph: Instance, solver: SolverLike, params: Mapping[str, Any] | None, limits: Limits
) -> Result:
    """Call a solver of netsp with its options checked, or another with the parameters it names."""
    if callable(solver):
        return call(solver, name_of(solver), graph, params, limits)
    record = SOLVERS.named(solver)
    if len(graph.before) and record.ours and not record.ordered:
        able = ", ".join(r.name for r in SOLVERS.values() if r.ordered)
        raise InputError(
            f"solver {solver!r}: cannot keep the order that goals ask for with 'after'; expected "
            f"one of {able}"
        )
    if record.geometric and not isinstance(graph, TravelGraph):
        raise InputError("solver: needs the geometry of a problem, and this instance has none")
    if record.ours:
        kind = load(record.params) if record.params else NoParams
        run: Callable[..., Result] = load(record.function)
        return run(graph, read_params(kind, solver, params), limits)
    function = load(record.function)
    with foreign(f"solver {solver!r} failed"):
        return call(function, solver, graph, params, limits)


def policy_of(solver: SolverLike, params: Mapping[str, Any] | None) -> SolvePolicy:
    """Return the policy among a solver's options; the default if the solver has none."""
    record = SOLVERS.named(solver) if isinstance(solver, str) else None
    if record is None or not record.ours or not record.params:
        return SolvePolicy()
    policy = getattr(read_params(load(record.params), record.name, params), "policy", None)
    return policy if isinstance(policy, SolvePolicy) else SolvePolicy()


def name_of(part: SolverLike | RoadmapLike) -> str:
    """Return the name of a solver or roadmap in solution files."""
    return part if isinstance(part, str) else getattr(part, "__name__", "custom")


def solve(
    problem: Problem,
    solver: SolverLike = DEFAULT_SOLVER,
    *,
    roadmap: RoadmapLike = DEFAULT_ROADMAP,
    roadmap_options: Mapping[str, Any] | None = None,
    time_limit: TimeLimit = None,
    iteration_limit: int | None = None,
    seed: int = 0,
    params: Mapping[str, Any] | None = None,
    warm_start: Solution | None = None,
    margin: float = 0.0,
    slack: float = 0.0,
    friction: float = 0.0,
    max_tension_ratio: float | None = None,
    keep_order: bool = False,
    on_progress: OnProgress | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Solution:
    """Find the shortest non-entangling tour of a problem.

    Parameters
    ----------
    problem : Problem
        Problem.
    solver : str or callable
        Solver, as in `solve_graph`.
    roadmap : str or callable
        Name of the roadmap: `taut` (exact), `prm`, or one of another package; or a callable, as in
        `travel_graph`.
    roadmap_options : mapping, optional
        For ``taut``: ``classes``, ``max_classes``; for ``prm``: ``samples``, ``shortcut``.
    time_limit : float or Clock, optional
        Seconds for the whole call, or the clock of a run that this one is a part of. When time is
        up, the best tour so far is returned.
    iteration_limit : int, optional
        Maximum number of iterations; each solver defines what one is.
    seed : int
        Seed of the solver's random generator, and of a roadmap that samples.
    params : mapping, optional
        Options of the solver by name, as in `solve_graph`.
    warm_start : Solution, optional
        Solution of the problem, or of an older version of it, by any solver
        (`netsp.plan.warm_start`).
    margin : float
        Distance by which obstacles may be misplaced (`netsp.plan.sizing.tether_margins`); all are
        grown by it, in the problem's units.
    slack : float
        Share of the taut length that must remain of the tether beyond it, up to 1.
    friction : float
        Coefficient of friction of the tether on obstacles.
    max_tension_ratio : float, optional
        Maximum factor of friction on the tension, anywhere on the tour; None for no limit.
    keep_order : bool
        Whether goals are visited in the problem's order. Then only their classes are chosen, with
        proof, whatever the solver.
    on_progress : callable, optional
        Called with a `netsp.gtsp.travel.result.Progress` from time to time.
    should_stop : callable, optional
        Called every 20 ms in its own thread. Once it returns true, the run ends as at its time
        limit, with the best tour so far.

    Returns
    -------
    Solution
        Best tour found, and its bound.

    Raises
    ------
    InputError
        Unknown name, bad limit, or a warm start without any goal of the problem.
    InfeasibleError
        Some goal is out of the tether's reach; the message says which, and by how much.
    LimitReachedError
        Time was up before the travel graph was complete.

    Examples
    --------
    >>> from netsp import Problem, solve
    >>> problem = Problem(base=(0, 0), goals=[(3, 4)], obstacles=[], tether_length=6)
    >>> solve(problem).length
    10.0
    """
    if not isinstance(problem, Problem):
        raise InputError(f"problem: expected a Problem, got {problem!r}")
    if warm_start is not None and not isinstance(warm_start, Solution):
        raise InputError(f"warm_start: expected a Solution, got {warm_start!r}")
    _seed(seed)
    _check_limits(time_limit, iteration_limit)
    if warm_start is not None:
        old_tour(problem, warm_start)
    check_solver(solver, params)  # before the long work
    if margin or slack:
        grown = problem.grown(margin, slack)
        found = solve(
            grown,
            solver,
            roadmap=roadmap,
            roadmap_options=roadmap_options,
            time_limit=time_limit,
            iteration_limit=iteration_limit,
            seed=seed,
            params=params,
            warm_start=None if warm_start is None else _for_grown(warm_start, problem, grown),
            friction=friction,
            max_tension_ratio=max_tension_ratio,
            keep_order=keep_order,
            on_progress=on_progress,
            should_stop=should_stop,
        )
        reference = ProblemReference(name=problem.name, sha256=problem.sha256)
        return found.model_copy(
            update={"problem": reference, "margin": float(margin), "slack": float(slack)}
        )
    if problem.visits < len(problem.goals) and _walks_between_places(solver):
        return _over_nearest_places(
            problem,
            solver,
            roadmap=roadmap,
            roadmap_options=roadmap_options,
            time_limit=time_limit,
            iteration_limit=iteration_limit,
            seed=seed,
            params=params,
            on_progress=on_progress,
            should_stop=should_stop,
        )
    limits = {
        "friction": checked_argument("friction", friction, 0.0, MAX_FRICTION),
        "max_tension_ratio": _tension_ratio(max_tension_ratio, friction),
    }
    seconds, within = (None, time_limit) if isinstance(time_limit, Clock) else (time_limit, None)
    clock = Clock(seconds, within=within, should_stop=should_stop)
    with contextlib.closing(clock):
        options: dict[str, Any] = dict(roadmap_options or {})
        if _takes_seed(roadmap):
            options.setdefault("seed", seed)
        max_turn_rad = max_turning(friction, max_tension_ratio)
        with until_interrupt(clock) as rest:
            try:
                graph = rest.bounded(
                    "making the roadmap",
                    lambda: _within_turning(
                        problem,
                        travel_graph(problem, roadmap, **{"time_limit": rest, **options}),
                        max_turn_rad,
                        rest,
                    ),
                    winds_down=True,
                )
            except LimitReachedError:
                if rest.is_stopped and not clock.is_up:  # by Ctrl-C
                    raise KeyboardInterrupt from None
                raise
        rest = rest if rest.is_stopped else clock
        built = clock.elapsed
        if keep_order:
            listener = graph.progress_listener(on_progress)
            result = graph.for_problem(solve_in_order(graph, rest, listener))
            found = to_solution(problem, graph, result, "in-order", seed)
            return found.model_copy(
                update={"kept_order": True, "timings": _timings(clock, built, graph), **limits}
            )
        graph, result = solve_over(
            problem,
            graph,
            solver,
            rest,
            iteration_limit=iteration_limit,
            seed=seed,
            params=params,
            warm_start=warm_start,
            on_progress=on_progress,
        )
        timings = _timings(clock, built, graph)
        found = to_solution(problem, graph, result, name_of(solver), seed, timings)
        return found.model_copy(update=limits) if friction else found


def solve_over(
    problem: Problem,
    graph: TravelGraph,
    solver: SolverLike,
    clock: Clock,
    *,
    iteration_limit: int | None = None,
    seed: int = 0,
    params: Mapping[str, Any] | None = None,
    warm_start: Solution | None = None,
    on_progress: OnProgress | None = None,
    on_graph: OnGraph | None = None,
) -> tuple[TravelGraph, Result]:
    """Solve a problem over its travel graph, as `solve` does.

    Parameters
    ----------
    problem : Problem
        The problem.
    graph : TravelGraph
        Travel graph of the problem.
    solver : str or callable
        Solver, as in `solve_graph`.
    clock : Clock
        Clock of the run.
    iteration_limit, seed, params, warm_start : int, int, mapping, Solution
        As in `solve`.
    on_progress : callable, optional
        Called with a `netsp.gtsp.travel.result.Progress` at each report of the solver.
    on_graph : callable, optional
        Called with each new graph; tours of later progress rows refer to it.

    Returns
    -------
    graph : TravelGraph
        The graph, with more classes if the roadmap left some out.
    result : Result
        Result whose tour refers to the returned graph.
    """
    policy = policy_of(solver, params)
    # keep time to draw a tour of a problem that is too large for its limit
    drawing_s = policy.drawing_time_share * (clock.limit or 0.0)
    spare = 0.0 if graph.is_complete else min(drawing_s, policy.max_drawing_s)
    start: Sequence[int] | None = None
    if warm_start is not None:
        graph = with_old_classes(problem, warm_start, graph, clock, policy.warm_start)
        start = tour_from(problem, warm_start, graph, policy.warm_start)
        if on_graph is not None:
            on_graph(graph)
        if on_progress is not None and start is not None:
            length = graph.tour_length(start)
            on_progress(Progress(clock.elapsed, "edited", length, tour=tuple(start)))
    if solver in CARRIED:
        rng = np.random.default_rng(seed)
        with until_interrupt(clock) as stoppable:
            carried = with_carried(
                graph, stoppable, rng, on_progress, on_graph, start, policy.carry
            )
        graph, start = carried.graph, carried.tour
        clock = stoppable if stoppable.is_stopped else clock
    if on_graph is not None:
        on_graph(graph)
    result = solve_graph(
        graph,
        solver,
        time_limit=Clock(clock.left - spare, within=clock) if spare else clock,
        iteration_limit=iteration_limit,
        seed=seed,
        params=params,
        warm_start=start,
        on_progress=on_progress,
    )
    return graph, result


def _walks_between_places(solver: SolverLike) -> bool:
    return isinstance(solver, str) and SOLVERS.named(solver).geometric


def _over_nearest_places(problem: Problem, solver: SolverLike, **more: Any) -> Solution:
    """Solve over one place of each goal with alternatives; the bound is dropped."""
    from netsp.roadmap.class_alternatives import nearest_places

    chosen = nearest_places(problem)
    goals = tuple(problem.goals[k].model_copy(update={"choice": None}) for k in chosen)
    found = solve(problem.model_copy(update={"goals": goals}), solver, **more)
    visits = tuple(v.model_copy(update={"goal": chosen[v.goal]}) for v in found.tour)
    reference = ProblemReference(name=problem.name, sha256=problem.sha256)
    no_bound = {"lower_bound": None, "lower_bound_of": None, "gap": None}
    return found.model_copy(update={"problem": reference, "tour": visits, **no_bound})


def _tension_ratio(value: float | None, friction: float) -> float | None:
    if value is None:
        return None
    if not friction:
        raise InputError("max_tension_ratio: expected friction > 0 with it, got none")
    return checked_argument("max_tension_ratio", value, 1.0 + 1e-9, 1e6)


def _within_turning(
    problem: Problem, graph: TravelGraph, max_turn_rad: float, clock: Clock
) -> TravelGraph:
    """Return the graph without classes that turn the tether by more than an angle, radians."""
    if math.isinf(max_turn_rad):
        return graph
    if graph.start is not None:
        raise InputError("max_tension_ratio: a tour from a state has no such limit; expected none")
    from netsp.roadmap.turning import limit_turning

    with graph.on_clock(clock):
        return limit_turning(problem, graph, max_turn_rad)


def _timings(clock: Clock, built: float, graph: TravelGraph) -> Timings:
    total = clock.elapsed
    return Timings(
        roadmap_s=round(built, 6),
        matrix_s=round(graph.legs_s, 6),
        solve_s=round(max(total - built - graph.legs_s, 0.0), 6),
        total_s=round(total, 6),
    )


def _for_grown(warm: Solution, problem: Problem, grown: Problem) -> Solution:
    """Return a warm start of a problem as one of the problem with its obstacles grown."""
    if warm.problem.sha256 != problem.sha256:
        return warm
    reference = ProblemReference(name=grown.name, sha256=grown.sha256)
    return warm.model_copy(update={"problem": reference})


def check_solver(solver: SolverLike, params: Mapping[str, Any] | None) -> None:
    """Raise InputError if a solver, or an option of it, is unknown or out of range."""
    if callable(solver):
        read_options(solver, name_of(solver), params)
        return
    record = SOLVERS.named(solver)
    if record.ours:
        read_params(load(record.params) if record.params else NoParams, solver, params)
    else:
        function = load(record.function)
        with foreign(f"solver {solver!r} failed"):
            read_options(function, solver, params)


def _check_limits(time_limit: TimeLimit, iteration_limit: int | None) -> None:
    if time_limit is not None and not isinstance(time_limit, Clock):
        number = isinstance(time_limit, (int, float, np.number)) and time_limit is not True
        if not (number and (0 < time_limit <= MAX_TIME_LIMIT_S or time_limit == np.inf)):
            raise InputError(
                f"time_limit: expected a positive number of seconds, got {shown(time_limit)}"
            )
    if iteration_limit is not None:
        whole = isinstance(iteration_limit, (int, np.integer)) and iteration_limit is not True
        if not (whole and 1 <= iteration_limit < MAX_SEED):
            raise InputError(
                f"iteration_limit: expected a whole number from 1 on, got {shown(iteration_limit)}"
            )


def _seed(seed: int) -> int:
    whole = isinstance(seed, (int, np.integer)) and seed is not True
    if not (whole and 0 <= seed <= MAX_SEED):
        raise InputError(f"seed: expected a whole number from 0 to {MAX_SEED}, got {shown(seed)}")
    return int(seed)


def _as_tour(vertices: Sequence[int], graph: Instance) -> tuple[int, ...]:
    tour = whole_numbers(vertices)
    if not tour or not graph.is_tour(tour):
        raise InputError(
            "warm_start: expected vertices from 0 on, one of every cluster, got "
            f"{str(vertices)[:80]}"
        )
    return tour
