"""Run of one trial in this process: a world, a roadmap, a solver, and the outcome as a row."""

from __future__ import annotations

import datetime
import functools
import os
import platform
import time
from typing import Any

from netsp.base.errors import (
    InfeasibleError,
    InputError,
    LimitReachedError,
    MemoryLimitError,
    NetspError,
    PluginError,
)
from netsp.gtsp.travel.result import Progress
from netsp.model.problem import Goal, Problem
from netsp.model.solution import Status
from netsp.study.compare.rows import SCHEMA, TrialRow
from netsp.study.compare.study import Trial
from netsp.study.compare.trial_policy import TrialPolicy


@functools.lru_cache(maxsize=4)
def _world(recipe: tuple[tuple[str, Any], ...]) -> tuple[Problem, int]:
    from netsp.plan.random_worlds import reachable_world

    return reachable_world(**dict(recipe))


def world_of(trial: Trial) -> tuple[Problem, int]:
    """Return the problem of a trial, and the number of unreachable worlds drawn before it."""
    recipe = {k: tuple(v) if isinstance(v, list) else v for k, v in trial.world.items()}
    return _world(tuple(sorted(recipe.items())))


def run(trial: Trial) -> TrialRow:
    """Run a trial and return its row; a `NetspError` becomes the status `error` and the message.

    Each trial builds its own roadmap and measures its own legs, so its times are those of a user.
    The worker handles other exceptions (`netsp.study.compare.pool`).
    """
    from netsp.plan.solve_problem import solve

    row: TrialRow = {"status": "error", "message": ""}
    history: list[tuple[float, float | None, float | None]] = []

    def listen(p: Progress) -> None:
        bound = None if p.bound is None else p.bound.length
        if not history or (p.incumbent, bound) != history[-1][1:]:
            history.append((round(p.time, 4), p.incumbent, bound))

    begin, cpu_begin = time.perf_counter(), _cpu_s()
    try:
        problem, row["redrawn"] = world_of(trial)
        row["problem_sha256"] = problem.sha256
        begin, cpu_begin = time.perf_counter(), _cpu_s()
        solution = solve(
            problem,
            trial.solver["name"],
            roadmap=trial.roadmap["name"],
            roadmap_options=trial.roadmap["options"],
            time_limit=trial.solver["time_limit"],
            iteration_limit=trial.solver["iteration_limit"],
            seed=trial.seed,
            params=trial.solver["options"],
            on_progress=listen,
        )
    except InfeasibleError as error:
        row |= {"status": "infeasible", "message": str(error)}
    except MemoryLimitError as error:
        row["message"] = str(error)
    except LimitReachedError as error:  # also: a sampled roadmap that does not reach a goal
        row |= {"status": Status.NO_SOLUTION_FOUND.value, "message": str(error)}
    except PluginError:
        raise
    except NetspError as error:
        row["message"] = str(error)
    else:
        row |= {
            "status": solution.status.value,
            "length": solution.length,
            "lower_bound": solution.lower_bound,
            "lower_bound_of": None if solution.bound is None else solution.bound.scope.value,
            "gap": solution.gap,
            "entangled": len(solution.entangled),
            "longest_tether": max((v.tether_length for v in solution.tour), default=0.0),
            **solution.timings.model_dump(),
            "history": thinned(history),
            "versions": solution.versions,
        }
    row.setdefault("total_s", round(time.perf_counter() - begin, 6))
    row["cpu_s"] = round(_cpu_s() - cpu_begin, 6)
    return row


def _cpu_s() -> float:
    """Return the CPU time, s, of this process and of its finished child processes."""
    t = os.times()
    return t.user + t.system + t.children_user + t.children_system


def thinned(history: list[Any], policy: TrialPolicy = TrialPolicy()) -> list[Any]:
    """Return at most `max_progress_rows` entries, evenly spaced, with the first and the last."""
    n, limit = len(history), policy.max_progress_rows
    return history if n <= limit else [history[k * (n - 1) // (limit - 1)] for k in range(limit)]


def full_row(trial: Trial, outcome: TrialRow, study: str, study_name: str) -> TrialRow:
    """Return the complete row of a trial: its inputs, its outcome, the machine and the time."""
    return {
        "schema": SCHEMA,
        "study": study,
        "study_name": study_name,
        "trial": trial.id,
        "world": trial.world,
        "roadmap": trial.roadmap,
        "solver": trial.solver,
        "seed": trial.seed,
        **outcome,
        "finished": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "machine": _machine(),
    }


@functools.cache
def _machine() -> str:
    return f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"


def check(trial: Trial) -> None:
    """Raise InputError if options of the roadmap are unknown or invalid, before any trial runs.

    To find out, build the roadmap of a problem with one goal.
    """
    from netsp.plan.solve_problem import build_roadmap

    name, options = trial.roadmap["name"], trial.roadmap["options"]
    goal = Goal(position=(1.0, 0.0, 0.0))
    problem = Problem(base=(0.0, 0.0, 0.0), goals=(goal,), obstacles=(), tether_length=3.0)
    try:
        build_roadmap(problem, name, **options)
    except InfeasibleError:
        pass  # too few samples to reach the goal here, but perhaps not in a trial
    except (TypeError, ValueError) as error:
        raise InputError(f"roadmap {name!r}: options {options}: {error}") from None
