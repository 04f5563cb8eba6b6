"""Travel graph of a problem with choices among goals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from netsp.base.errors import InfeasibleError, InputError
from netsp.model.problem import Problem
from netsp.roadmap.explain_unreachable import shortest_tethers
from netsp.roadmap.goal_choices import with_choices
from netsp.roadmap.reachable_goals import REACH_TOLERANCE
from netsp.roadmap.travel_graph import TravelGraph


def nearest_places(problem: Problem) -> list[int]:
    """Return, for each choice, the index of the goal that the shortest tether reaches, in order.

    Solvers that cannot choose among goals visit these.
    """
    tethers, clusters = shortest_tethers(problem), problem.clusters
    members = (np.flatnonzero(clusters == c) for c in range(1, problem.visits + 1))
    return sorted(int(m[np.argmin(tethers[m])]) for m in members)


def graph_of_choices(problem: Problem, build: Callable[[Problem], TravelGraph]) -> TravelGraph:
    """Return the travel graph over all goals in reach, with the goals of a choice in one cluster.

    Parameters
    ----------
    build : callable
        Function that makes the travel graph of a problem without choices.

    Raises
    ------
    InfeasibleError
        All goals of some choice are out of the tether's reach.
    InputError
        The problem starts from a state. It is then known which goals were visited, and the others
        of their choices should be removed from the problem.
    """
    if problem.state is not None:
        raise InputError(
            "state: alternatives are chosen before the robot is out; expected one of each choice"
        )
    within = shortest_tethers(problem) <= problem.tether_length * (1.0 + REACH_TOLERANCE)
    clusters = problem.clusters
    for c in range(1, problem.visits + 1):
        if not within[clusters == c].any():
            within |= clusters == c  # out of reach, but kept: an error then reports it
    kept = np.flatnonzero(within)
    goals = [problem.goals[k].model_copy(update={"choice": None, "after": ()}) for k in kept]
    try:
        graph = build(problem.model_copy(update={"goals": tuple(goals)}))
    except InfeasibleError as error:
        goal = None if error.goal is None else int(kept[error.goal])
        raise InfeasibleError(
            error, goal=goal, needed=error.needed, enclosing=error.enclosing
        ) from None
    out = with_choices(graph, np.concatenate([[0], clusters[kept]]))
    out.goal = np.concatenate([[0], kept + 1])[graph.cluster]
    out.before = problem.precedences
    return out
