"""Registries of solvers and roadmaps."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.registry import Registry


@dataclass(frozen=True)
class Solver:
    """A solver by name.

    Parameters
    ----------
    name : str
        Name on the command line, in files and in messages.
    function : str
        ``module:attribute`` of `(graph, params, limits) -> Result`, or of any callable that
        `netsp.plan.custom` can call.
    params : str, optional
        ``module:attribute`` of the dataclass of its options; None if it takes none.
    geometric : bool
        Whether it needs the paths of a travel graph, and refuses a graph made from costs.
    blind : bool
        Whether it is a baseline that ignores the tether, whose tours may be `invalid`.
    ordered : bool
        Whether it keeps precedences (`TravelGraph.before`).
    proves : bool
        Whether it looks for a proof.
    """

    name: str
    function: str
    params: str | None = None
    geometric: bool = False
    blind: bool = False
    ordered: bool = False
    proves: bool = False

    @property
    def ours(self) -> bool:
        """True if the solver is part of netsp and takes `(graph, params, limits)`."""
        return self.function.startswith("netsp.")


@dataclass(frozen=True)
class RoadmapKind:
    """A roadmap by name.

    Parameters
    ----------
    name : str
        Name on the command line, in files and in messages.
    build : str
        ``module:attribute`` of a class over a problem with `to_travel_graph()`.
    seeded : bool
        Whether its samples are drawn with the run's seed.
    """

    name: str
    build: str
    seeded: bool = False

    @property
    def ours(self) -> bool:
        """True if the roadmap is part of netsp, so that its exceptions are defects of netsp."""
        return self.build.startswith("netsp.")


SOLVERS: Registry[Solver] = Registry(
    "solver",
    "netsp.solvers",
    {
        s.name: s
        for s in (
            Solver(
                "auto", "netsp.plan.auto:solve", "netsp.plan.auto:Params", ordered=True,
                proves=True,
            ),
            Solver("mip", "netsp.mip.mip_solver:solve", "netsp.mip.mip_solver:Params", proves=True),
            Solver(
                "dp", "netsp.gtsp.dp.dp_solver:solve", "netsp.gtsp.dp.dp_solver:Params",
                ordered=True, proves=True
            ),
            Solver("reduced-mip", "netsp.mip.reduced:solve", "netsp.mip.reduced:ReducedParams"),
            Solver(
                "mip-2017", "netsp.mip.published_program:solve",
                "netsp.mip.published_program:Params",
            ),
            Solver(
                "lns", "netsp.gtsp.search.lns_solver:solve",
                "netsp.gtsp.search.lns_solver:Params", ordered=True,
            ),
            Solver("anneal", "netsp.anneal.icra2017:solve", "netsp.anneal.icra2017:Params"),
            Solver(
                "anneal-2016", "netsp.plan.rss2016:solve", "netsp.plan.rss2016:Params",
                geometric=True,
            ),
            Solver(
                "greedy", "netsp.gtsp.greedy.backtracking:solve",
                "netsp.gtsp.greedy.backtracking:Params"
            ),
            Solver(
                "greedy-2016", "netsp.gtsp.greedy.backtracking:solve_2016",
                "netsp.gtsp.greedy.backtracking:Params2016",
            ),
            Solver("greedy-tsp", "netsp.plan.greedy_blind:solve", geometric=True, blind=True),
        )
    },
    lambda name, where: Solver(name, where),
)  # fmt: skip

ROADMAPS: Registry[RoadmapKind] = Registry(
    "roadmap",
    "netsp.roadmaps",
    {
        r.name: r
        for r in (
            RoadmapKind("taut", "netsp.roadmap.taut:TautRoadmap"),
            RoadmapKind("prm", "netsp.roadmap.prm:PrmRoadmap", seeded=True),
        )
    },
    lambda name, where: RoadmapKind(name, where),
)
