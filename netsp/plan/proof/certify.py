"""Certificates: proofs of lower bounds that `netsp_check` has checked."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from netsp.base.clock import Clock, TimeLimit
from netsp.base.errors import InputError, LimitReachedError, counted
from netsp.base.number_ranges import check_not_negative
from netsp.model.problem import Problem
from netsp.model.solution import EXACT_ROADMAPS, Solution, Status
from netsp.plan.proof.cover_instance import CoverInstance
from netsp.plan.proof.dual_search import DualSearch, DualSearchPolicy, ProofNode, ShorterTourError
from netsp.plan.proof.triangulate import triangulate
from netsp.roadmap.travel_graph import TravelGraph
from netsp_check import Refused, check
from netsp_check.dual_bound import Bound
from netsp_check.leg_bounds import LegBounds
from netsp_check.problem_file import read_problem
from netsp_check.proof_check import cover

Level = Literal["optimal", "bound", "none"]
"""Level of a certificate: the tour is the shortest, a bound on all tours is proven, or nothing."""

TARGET_SHARE = 0.9e-6
"""Tolerance: share of a tour's length by which the target of a proof is below it, to leave room for
the rounding of legs; a bound counts as the length up to a share of 1e-6."""


@dataclass(frozen=True)
class CertifyPolicy:
    """Policy of certificates.

    Attributes
    ----------
    corners
        Corners of the polygons inscribed in circles, one number for each attempt. More corners
        raise the bounds on legs.
    max_shortfall
        Attempts end when a tour over the checker's bounds on legs is shorter than the target by
        more than this share, which more corners would not mend.
    search_share
        Share of the time for the search; the rest is for checking, or for a lower bound.
    max_vertices
        Most classes of all goals for which a proof is tried.
    search
        Policy of the search for duals and of the branching tree.
    """

    corners: tuple[int, ...] = (16, 48, 128)
    max_shortfall: float = 1e-3
    search_share: float = 0.7
    max_vertices: int = 5000
    search: DualSearchPolicy = DualSearchPolicy()

    def __post_init__(self) -> None:
        check_not_negative(self)


@dataclass(frozen=True)
class Certificate:
    """Outcome of `certify`.

    Attributes
    ----------
    level : {"optimal", "bound", "none"}
        "optimal" if the proven bound is the tour's length, up to a share of 1e-6; "bound" if it is
        lower; "none" without a proof.
    reason : str
        Why the level is not "optimal"; empty if it is.
    bound : float or None
        Length, in the problem's units, that no tour falls below; inf if there is no tour.
    proof : bytes or None
        Content of the proof file.

    Examples
    --------
    >>> Certificate("none", "time is up").proof is None
    True
    """

    level: Level
    reason: str = ""
    bound: float | None = None
    proof: bytes | None = None


def certify(
    problem: Problem,
    solution: Solution,
    *,
    graph: TravelGraph | None = None,
    time_limit: TimeLimit = None,
    policy: CertifyPolicy = CertifyPolicy(),
    on_progress: Callable[[str], None] = lambda text: None,
) -> Certificate:
    """Return a certificate for a solution: a proof, checked by `netsp_check`, and its level.

    Parameters
    ----------
    problem, solution : Problem, Solution
        Problem, and a solution of it by the roadmap "taut".
    graph : TravelGraph, optional
        Travel graph of the problem, grown as for the solution; made if it is not given.
    time_limit : float or Clock, optional
        Seconds for the search; `netsp_check` then checks the proof without a limit.
    policy : CertifyPolicy
        Sizes and limits.
    on_progress : callable
        Called with a line of text.

    Raises
    ------
    InputError
        The solution is of another problem.

    Examples
    --------
    >>> from netsp import Problem, solve
    >>> problem = Problem.load("problems/wharf.json")
    >>> certificate = certify(problem, solve(problem))
    >>> certificate.level, round(certificate.bound, 2)
    ('optimal', 51.96)
    """
    if solution.problem.sha256 != problem.sha256:
        raise InputError(f"solution: is of another problem than {problem.name!r}; plan again")
    if reason := _obstruction(problem, solution):
        return Certificate("none", reason)
    attempt = _Attempt(problem, solution, graph, Clock.from_limit(time_limit), policy, on_progress)
    return attempt.run()


def _obstruction(problem: Problem, solution: Solution) -> str:
    """Return why no proof can be tried, or an empty string."""
    if problem.state is not None:
        return "the tour starts from a state, and proofs start at the base"
    if solution.roadmap not in EXACT_ROADMAPS:
        return f"proofs need the roadmap taut; this is {solution.roadmap}"
    if solution.status is Status.INFEASIBLE:
        return ""
    if solution.status is Status.INVALID:
        return "the solver ignores the tether; expected another solver"
    if solution.length is None:
        return "no tour was found"
    return ""


class _Attempt:
    """Attempts at a proof, with more corners each time."""

    def __init__(
        self,
        problem: Problem,
        solution: Solution,
        graph: TravelGraph | None,
        clock: Clock,
        policy: CertifyPolicy,
        on_progress: Callable[[str], None],
    ) -> None:
        self.problem, self.solution, self.policy = problem, solution, policy
        self.clock, self.on_progress = clock, on_progress
        self._graph = graph
        self.text = problem.to_json()
        self.exact = read_problem(self.text, solution.margin, solution.slack)
        self.root_bound = 0.0

    def run(self) -> Certificate:
        """Return the best certificate of all attempts."""
        length = self.solution.length
        target = None
        if length is not None:
            target = int(np.floor(length * (1.0 - TARGET_SHARE) * 2.0**self.exact.grid))
        reason = ""
        for corners in self.policy.corners:
            try:
                return self._certificate(target, corners, "")
            except ShorterTourError as error:
                reason = "a tour may be shorter, by the checker's bounds on legs"
                if target is None or error.length < target * (1.0 - self.policy.max_shortfall):
                    break
            except (LimitReachedError, Refused) as error:
                reason = str(error)
                break
        if self.root_bound <= 0.0:
            return Certificate("none", reason)
        try:
            return self._certificate(int(self.root_bound * (1.0 - TARGET_SHARE)), corners, reason)
        except (LimitReachedError, Refused) as error:
            return Certificate("none", str(error))
        except ShorterTourError:
            return Certificate("none", reason)

    def _certificate(self, target: int | None, corners: int, reason: str) -> Certificate:
        proof: dict[str, Any] = {"format": "netsp-proof 1", "target": target}
        for name in ("margin", "slack"):
            if getattr(self.solution, name):
                proof[name] = getattr(self.solution, name)
        proof |= triangulate(self.exact, corners).to_fields()
        tree = cover(self.text, proof)
        size = f"{counted(len(tree.nodes), 'triangle')} of the cover"
        self.on_progress(f"classes {len(tree.vertices)}, {size}")
        if len(tree.vertices) > self.policy.max_vertices:
            raise LimitReachedError(
                f"there are more than {self.policy.max_vertices} classes; divide the goals"
            )
        legs = LegBounds(tree)
        bound = Bound(tree, legs, target)
        alive = bound.reachable()
        proof["classes"] = [len(tree.vertices), tree.digest()]
        if len({bound.cluster[v] for v in alive}) < bound.clusters:
            proof["tree"] = {}
        elif target is None or bound.clusters == 2:
            raise ShorterTourError(0.0)
        else:
            instance = CoverInstance(self.problem, self.graph, bound, alive, self._check)
            proof |= self._search(instance, target).to_fields(instance, bound.cluster)
        data = zlib.compress(json.dumps(proof, separators=(",", ":")).encode(), 9)
        self.on_progress(f"proof of {len(data)} bytes; checking")
        checked = check(self.text, data)
        return Certificate("bound" if reason else "optimal", reason, checked.bound, data)

    def _search(self, instance: CoverInstance, target: int) -> ProofNode:
        visits, graph = self.solution.tour, self.graph
        found = graph.vertices_of([v.goal + 1 for v in visits], [v.signature for v in visits])
        tour = None if found is None else instance.rows_of([0, *found])
        if tour is None:
            raise LimitReachedError("the checker's cover lacks a class of the tour")

        def on_round(bound: float) -> None:
            self.on_progress(f"bound {bound * 2.0**-self.exact.grid:.6g}")

        clock = self.clock.part(self.policy.search_share)
        search = DualSearch(instance, tour, target, clock, self.policy.search, on_round=on_round)
        try:
            return search.prove()
        finally:
            self.root_bound = max(self.root_bound, search.root_bound)

    @property
    def graph(self) -> TravelGraph:
        """Travel graph of the problem, grown as for the solution."""
        if self._graph is None:
            from netsp.plan.solve_problem import travel_graph

            s = self.solution
            self._graph = travel_graph(self.problem.grown(s.margin, s.slack))
        return self._graph

    def _check(self) -> None:
        if self.clock.is_up:
            raise LimitReachedError("time is up")
