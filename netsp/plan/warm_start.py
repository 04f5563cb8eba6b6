"""Warm starts from a solution of the problem, or of an older version of it.

Goals are identified by name, or by place if they have none. Obstacles are not identified: words are
read from the crossings of the old path with the rays of the present obstacles. New goals are
inserted where they lengthen the tour least, removed goals are left out, and where a class is not in
the travel graph, the best classes for the order are chosen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.base.deprecated import deprecated_names
from netsp.base.errors import InputError
from netsp.gtsp.instance import cheapest_per_cluster
from netsp.gtsp.search import LayeredInstance, best_classes
from netsp.hsignature import Word, concatenate
from netsp.hsignature.rays import crossings
from netsp.model.arrangement import respects_precedences
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.plan.solve_policy import WarmStartPolicy
from netsp.roadmap.travel_graph import TravelGraph


@dataclass(frozen=True)
class OldTour:
    """The part of an old tour that is left in the present problem.

    Parameters
    ----------
    goals : tuple of int
        Goals of the present problem, from 0, in the order of the visits.
    words : tuple of Word
        Word of the old path at each of them, among the present obstacles.
    gone : int
        Number of visits to goals that no longer exist.
    """

    goals: tuple[int, ...]
    words: tuple[Word, ...]
    gone: int


def old_tour(
    problem: Problem, solution: Solution, policy: WarmStartPolicy = WarmStartPolicy()
) -> OldTour:
    """Identify the goals of a solution in a problem.

    Parameters
    ----------
    problem : Problem
        The present problem.
    solution : Solution
        Solution of it, or of an older version.
    policy : WarmStartPolicy
        How far a goal may have moved.

    Returns
    -------
    OldTour
        Tour without goals if the solution has none.

    Raises
    ------
    InputError
        None of its goals is in the problem.
    """
    if solution.problem.sha256 == problem.sha256:
        same = tuple(tuple(v.signature) for v in solution.tour)
        return OldTour(tuple(v.goal for v in solution.tour), same, 0)
    rays = problem.representative_points
    path = np.array(solution.path).reshape(-1, 3)
    if solution.tour and len(path) < 2:
        raise InputError("warm_start: has no path, by which it could be known in another problem")
    by_name = {g.name: k for k, g in enumerate(problem.goals) if g.name is not None}
    goals: list[int] = []
    words: list[Word] = []
    taken: set[int] = set()
    word: Word = ()
    at = gone = 0
    for visit in solution.tour:
        if visit.position is None:
            continue
        place = np.array(visit.position)
        end = at + int(np.argmin(np.linalg.norm(path[at:] - place, axis=1)))
        word = concatenate(word, crossings(path[at : end + 1, :2], rays))
        at = end
        goal = by_name.get(visit.name, -1) if visit.name is not None else -1
        if goal < 0:
            goal = _nearest(problem, place, taken, policy)
        if goal < 0 or goal in taken:
            gone += 1
            continue
        taken.add(goal)
        goals.append(goal)
        step = np.vstack([path[at], problem.points[goal + 1]])
        words.append(concatenate(word, crossings(step[:, :2], rays)))
    if solution.tour and not goals:
        raise InputError("warm_start: none of its goals is in the problem, by name or by place")
    return OldTour(tuple(goals), tuple(words), gone)


def _nearest(problem: Problem, place: Floats, taken: set[int], policy: WarmStartPolicy) -> int:
    """Return the goal at a place that is not taken yet; -1 for none."""
    distance = np.linalg.norm(problem.points[1:] - place, axis=1)
    distance[list(taken)] = np.inf
    k = int(np.argmin(distance))
    return k if distance[k] <= policy.max_goal_move * problem.scale else -1


def with_old_classes(
    problem: Problem,
    solution: Solution,
    graph: TravelGraph,
    clock: Clock,
    policy: WarmStartPolicy = WarmStartPolicy(),
) -> TravelGraph:
    """Return the graph with the classes of an old tour, if its roadmap left some out.

    No further class is added once the clock is up.

    Raises
    ------
    InputError
        None of the solution's goals is in the problem.
    """
    if graph.is_complete or graph.carrier is None:
        return graph
    found = old_tour(problem, solution, policy)
    wanted = [(goal + 1, word) for goal, word in zip(found.goals, found.words, strict=True)]
    before = graph.before
    graph = graph.carrier.with_classes(wanted, lambda: clock.is_up)
    graph.before = before
    return graph


def tour_from(
    problem: Problem,
    solution: Solution,
    graph: TravelGraph,
    policy: WarmStartPolicy = WarmStartPolicy(),
) -> list[int] | None:
    """Return a warm start from a solution of the problem, or of an older version.

    Returns
    -------
    list of int or None
        Vertices of the graph; None if the solution has no tour, or its order breaks a precedence.

    Raises
    ------
    InputError
        None of the solution's goals is in the problem.
    """
    found = old_tour(problem, solution, policy)
    if not found.goals or graph.start is not None:
        return None
    cluster_of = dict(zip(graph.goal.tolist(), graph.cluster.tolist(), strict=True))
    place_of = {c: k - 1 for k, c in reversed(list(cluster_of.items())) if k > 0}
    order: list[int] = []
    known: list[int] = []
    for goal, word in zip(found.goals, found.words, strict=True):
        cluster = cluster_of.get(goal + 1, 0)
        if cluster and cluster not in order:
            order.append(cluster)
            place_of[cluster] = goal
            known += graph.vertices_of([goal + 1], [word]) or []
    new = [c for c in range(1, graph.goal_count + 1) if c not in order and c in place_of]
    for c in new:
        _insert(order, c, problem.points, place_of)
    if len(order) != graph.goal_count or not respects_precedences(order, graph.before):
        return None
    if len(known) == len(order):
        return [0, *known]
    shortest = cheapest_per_cluster(graph.costs_to_base, graph.cluster, policy.classes_per_goal)
    core = np.union1d(shortest, known)
    instance = LayeredInstance.among(graph, core.astype(np.int64))
    _, tour = best_classes(np.array(order, dtype=np.int64), instance.start, instance.costs)
    return list(instance.original(tour))


def _insert(order: list[int], c: int, points: Floats, place_of: dict[int, int]) -> None:
    """Insert a cluster where it lengthens the tour least, in straight lines."""
    visits = points[[0, *(place_of[k] + 1 for k in order), 0]]
    distances = np.linalg.norm(visits - points[place_of[c] + 1], axis=1)
    increase = distances[:-1] + distances[1:] - np.linalg.norm(np.diff(visits, axis=0), axis=1)
    order.insert(int(np.argmin(increase)), c)


def edit_message(problem: Problem, solution: Solution) -> str | None:
    """Return a message with the numbers of old, new and removed goals; None without an edit."""
    if solution.problem.sha256 == problem.sha256 or not solution.tour:
        return None
    found = old_tour(problem, solution)
    clusters = {int(problem.clusters[g]) for g in found.goals}
    parts = [f"{len(clusters)} of {problem.visits} goals are those of an older version"]
    if len(clusters) < problem.visits:
        parts.append(f"{problem.visits - len(clusters)} new")
    if found.gone:
        parts.append(f"{found.gone} gone")
    return "warm start: " + ", ".join(parts)


__getattr__ = deprecated_names(globals(), told="edit_message")
