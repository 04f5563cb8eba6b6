"""`reduced-mip`: one class for each goal, then an ordinary TSP.

McCammon & Hollinger 2017, section IV-C: every goal is visited in the class of its shortest tether;
two goals are joined by the direct leg if it shares the homotopy class of the path through the base,
else by the shortest leg that does. On the covering space both cases are one: the leg from (i, h_i)
to (j, h_j) is the shortest path of the class ``h_i^-1 h_j``, which is that of the path through the
base. So the reduced graph is the travel graph on the vertices of shortest tether, and its TSP is
solved by `mip`, with equation (2) trivially satisfied.

The paper reports tours within 5 % of the optimum. In worlds with many obstacles its recipe alone is
farther off (docs/notebook/reproduction.md): the classes of shortest tether are too few to pass an
obstacle on one side and come back on the other. So by default three classes are kept for every
goal, and the classes along the order found are chosen again, exactly and from all, by a shortest
path through layers. ``classes=1 polish=0`` is the paper's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from netsp.gtsp.instance import Instance, cheapest_per_cluster
from netsp.gtsp.limits import Limits
from netsp.gtsp.search import LayeredInstance, best_classes
from netsp.gtsp.search.lns_solver import max_classes_per_goal, search_core
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.result import Progress, Result
from netsp.mip.mip_solver import MipRun, Params


@dataclass(frozen=True)
class ReducedParams(Params):
    """Options of the solver, besides those of `mip`.

    Attributes
    ----------
    classes
        Number of classes of each goal; classes of shortest tether are kept.
    polish
        1 to choose the classes along the order found exactly, 0 to keep them, as in the paper.
    max_polished
        Maximum number of classes, those of shortest tether, for that choice; at least 1.
    """

    classes: int = 3
    polish: int = 1
    max_polished: int = 4000

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.classes < 1:
            raise ValueError(f"option 'classes': expected 1 or more, got {self.classes}")
        if self.polish not in (0, 1):
            raise ValueError(f"option 'polish': expected 0 or 1, got {self.polish}")
        if self.max_polished < 1:
            raise ValueError(f"option 'max_polished': expected 1 or more, got {self.max_polished}")


def solve(
    graph: Instance, params: ReducedParams | None = None, limits: Limits | None = None
) -> Result:
    """Solve the TSP over the classes of shortest tether.

    The tour is optimal for those classes only, so no bound is claimed for the problem unless they
    are all that there are. An iteration is one of `mip`: one program solved.
    """
    chosen, limits = params or ReducedParams(), limits or Limits()
    kept = cheapest_per_cluster(graph.costs_to_base, graph.cluster, chosen.classes)
    whole = len(kept) == len(graph)
    inner = replace(limits, warm_start=None, on_progress=None)
    part = MipRun(
        graph.subgraph(kept), inner, search_rounds=chosen.search_rounds, policy=chosen.policy
    )
    outer = SolverRun(graph, limits)

    def pass_on(row: Progress) -> None:
        if part.tour is not None:
            outer.update_incumbent(kept[np.array(part.tour)].tolist())
        if whole and part.bound is not None:
            outer.raise_bound(part.bound)
        outer.iterations = row.iteration
        outer.report(row.stage, cuts=row.cuts, legs=row.legs, vertices=row.vertices)

    part.on_progress = pass_on
    with outer.until_stopped():
        outer.update_incumbent(limits.warm_start)
        if outer.solve_if_trivial():
            return outer.finish("trivial")
        place = {int(v): k for k, v in enumerate(kept)}
        start = [place.get(int(v), -1) for v in limits.warm_start or ()]
        result = part.solve(chosen.backend, start if start and -1 not in start else None)
        outer.was_stopped = part.was_stopped
        if result.tour is not None:
            outer.update_incumbent(kept[np.array(result.tour)].tolist())
            if chosen.polish and not whole:
                outer.check()
                count = max_classes_per_goal(graph, chosen.max_polished)
                instance = LayeredInstance.among(graph, search_core(outer, count))
                order = graph.cluster[kept[np.array(result.tour[1:])]]
                _, tour = best_classes(order, instance.start, instance.costs)
                outer.update_incumbent(instance.original(tour))
    if whole:
        outer.is_infeasible = part.is_infeasible
        if part.bound is not None:
            outer.raise_bound(part.bound)
    return outer.finish("proven" if outer.is_done else "polished" if chosen.polish else "reduced")
