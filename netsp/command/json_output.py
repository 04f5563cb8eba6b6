"""Summaries as JSON, for programs: `--json`."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING, Any

from netsp.base.errors import InfeasibleError

if TYPE_CHECKING:
    from netsp.judge import Verification
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution
    from netsp.plan.space.mission_solver import SolvedMission
    from netsp.world.mission.mission import Mission


def tell(summary: Mapping[str, Any]) -> None:
    """Print a summary."""
    sys.stdout.write(json.dumps(summary, indent=1, allow_nan=False) + "\n")
    sys.stdout.flush()


def of_solution(problem: Problem, solution: Solution) -> dict[str, Any]:
    """Return the output of `netsp solve` for a problem."""
    return {
        "problem": problem.name,
        "units": problem.units,
        "status": solution.status.value,
        "length": solution.length,
        "lower_bound": solution.lower_bound,
        "gap": solution.gap,
        "lower_bound_of": None if solution.bound is None else solution.bound.scope.value,
        "certified": solution.certified,
        "certified_reason": solution.certified_reason,
        "certified_bound": solution.certified_bound,
        "order": [problem.goal_name(v.goal) for v in solution.tour],
        "longest_tether": max((v.tether_length for v in solution.tour), default=None),
        "tether_length": problem.tether_length,
        "entangled": [problem.obstacle_name(k) for k in solution.entangled],
        "roadmap": solution.roadmap,
        "solver": solution.solver,
        "timings": solution.timings.model_dump(mode="json"),
    }


def of_infeasible(problem: Problem, error: InfeasibleError, none: Solution) -> dict[str, Any]:
    """Return the output of `netsp solve` for a problem without a tour, and what its proof shows."""
    return {
        "problem": problem.name,
        "units": problem.units,
        "status": "infeasible",
        "message": str(error),
        "certified": none.certified,
        "certified_reason": none.certified_reason,
        "tether_length": problem.tether_length,
        "goal": None if error.goal is None else problem.goal_name(error.goal),
        "needed": error.needed if error.needed is not None and isfinite(error.needed) else None,
    }


def of_mission(mission: Mission, found: SolvedMission, units: str) -> dict[str, Any]:
    """Return the output of `netsp solve` for a mission."""
    tour = found.tour
    return {
        "mission": mission.name,
        "units": units,
        "status": tour.status.value,
        "length": tour.length,
        "lower_bound": tour.lower_bound,
        "gap": tour.gap,
        "bound_of_all": tour.bound_of_all,
        "gap_to_all": tour.gap_to_all,
        "unresolved_gaps": None
        if tour.unresolved_gaps is None
        else [gap.model_dump(mode="json") for gap in tour.unresolved_gaps],
        "cell": None if found.gaps is None else found.gaps.cell,
        "order": list(found.order[: len(tour.stops)]),
        "left_out": list(found.left_out),
        "longest_tether": tour.longest_tether,
        "tether_length": mission.tether_length,
        "exact_words": tour.exact,
        "solver": tour.solver,
        "interrupted": found.interrupted,
        "flight": None if found.run is None else found.run.summary,
    }


def of_verdict(verdict: Verification) -> dict[str, Any]:
    """Return the output of `netsp verify`."""
    return {
        "verified": verdict.passed,
        "checks": [
            {"name": c.name, "passed": c.passed if c.was_made else None, "detail": c.detail}
            for c in verdict.checks
        ],
    }
