"""Turning of the tether about obstacles, and the classes in which it stays within a limit.

Friction on obstacles holds a tether: the tension changes by the factor exp(mu * turning) between
the anchor and the robot (the capstan equation of Euler and Eytelwein). A limit on this factor is a
limit on the turning.

Along a leg the tether turns no farther than at one of its ends. The tethers to both ends and the
leg bound a geodesic triangle: up to where the two tethers part they are one, and from there they
bulge towards each other. The tether to a point of the leg follows one of them and leaves it on a
tangent, between the directions of the edges that it leaves; so it has turned no farther than that
tether has turned one edge later.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InfeasibleError, LimitReachedError, counted, warn_left_out
from netsp.model.bound_scope import Scope
from netsp.model.problem import Problem
from netsp.roadmap.paths import TautPaths, UnknownPathError
from netsp.roadmap.travel_graph import TravelGraph

TURNING_TOLERANCE = 1e-9
"""Tolerance for rounding in the sum of angles by which a tether turns, radians."""


def tether_turnings(problem: Problem, graph: TravelGraph) -> Floats:
    """Return the sums of angles in the plan by which the tether turns in every class, radians.

    In 3D a tether turns no farther than in the plan. A class whose taut path is not found gets NaN,
    with a warning.

    Raises
    ------
    LimitReachedError
        The graph's clock was up.
    """
    paths = TautPaths(problem, clock=graph.clock)
    out = np.zeros(len(graph))
    for v in range(1, len(graph)):
        if graph.clock is not None:
            graph.clock.check("measuring how far tethers turn")
        try:
            out[v] = paths.turning(0, int(graph.goal[v]), graph.signatures[v])
        except UnknownPathError:
            out[v] = np.nan
    if missing := int(np.isnan(out).sum()):
        states = counted(missing, "state")
        warn_left_out(f"{states} of the tether left out: the taut path was not found")
    return out


def limit_turning(problem: Problem, graph: TravelGraph, max_turning: float) -> TravelGraph:
    """Return the travel graph without the classes in which the tether turns farther than allowed.

    Parameters
    ----------
    graph : TravelGraph
        Graph from the base.
    max_turning : float
        Largest sum of angles, radians; inf returns the same graph. Classes of unknown turning are
        left out.

    Raises
    ------
    InfeasibleError
        No class of some goal is left.
    LimitReachedError
        The clock was up, or the turning of all classes of some goal is unknown.
    """
    if math.isinf(max_turning):
        return graph
    turning = tether_turnings(problem, graph)
    part = graph.subgraph(np.flatnonzero(turning <= max_turning + TURNING_TOLERANCE))
    # the limit is the problem's: no class that breaks it is in an admissible tour
    part.declared_scope = graph.scope
    part.classes, part.min_tether_left_out = graph.classes, graph.min_tether_left_out
    unknown = np.isnan(turning)
    if unknown.any():
        # classes of unknown turning may be admissible
        if graph.scope is Scope.ALL_TOURS:
            part.declared_scope = Scope.KEPT_CLASSES
        part.classes = "shortest"
        part.min_tether_left_out = min(
            graph.min_tether_left_out, float(graph.tethers[unknown].min())
        )
    part.excluded_by_rule = graph.excluded_by_rule
    lost = sorted(set(graph.cluster.tolist()) - set(part.cluster.tolist()))
    if lost:
        members = graph.members(lost[0])
        if unknown[members].any():
            raise LimitReachedError(
                f"it is unknown how far the tether to {problem.goal_label(lost[0] - 1)} turns: the "
                "taut path was not found"
            )
        best = int(members[np.argmin(turning[members])])
        raise InfeasibleError(
            f"{problem.goal_label(int(graph.goal[best]) - 1)} is reached in no class in which the "
            f"tether turns by at most {math.degrees(max_turning):.4g} degrees; the least is "
            f"{math.degrees(turning[best]):.4g}",
            goal=int(graph.goal[best]) - 1,
        )
    return part
