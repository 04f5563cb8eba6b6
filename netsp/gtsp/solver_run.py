"""A run of a solver: incumbent, bound, limits and progress."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.base.errors import InputError, LimitReachedError, MemoryLimitError, is_interrupt
from netsp.gtsp.gtsp_policy import CostPolicy
from netsp.gtsp.instance import BaselessInstance, Instance, cheapest_per_cluster
from netsp.gtsp.limits import Limits
from netsp.gtsp.travel.result import Progress, Result, proven
from netsp.model.bound_scope import LowerBound
from netsp.model.solution import Status


class RunStopped(Exception):
    """A limit is reached, and the run ends with the best tour so far."""


BOUND_ROUNDING = 1e-4
"""Tolerance of a bound, as a share of the grain that all lengths are multiples of. A bound that is
above a multiple by less is not rounded up to the next, because it may be off by rounding."""


class SolverRun:
    """One run of a solver on a travel graph.

    Parameters
    ----------
    policy
        How costs are measured.

    Attributes
    ----------
    iterations
        Iterations so far; each solver defines what one is.
    known_length
        Length of a tour from elsewhere, inf for none: a bound that reaches it ends the run.
    walk
        Vertices as they are walked, base to base, if that is not just the tour.
    """

    def __init__(
        self, graph: Instance, limits: Limits | None = None, *, policy: CostPolicy = CostPolicy()
    ) -> None:
        limits = limits or Limits()
        if isinstance(graph, BaselessInstance):
            raise InputError("graph: has no base; expected solve_graph to be called with it")
        # compiled loops rely on a vertex in every cluster
        lost = np.flatnonzero(np.bincount(graph.cluster) == 0)
        if len(lost):
            raise InputError(f"graph: no class of goal {lost[0]}; expected one of every goal")
        self.graph, self.cost_policy = graph, policy
        self.known_length = limits.cutoff
        self.clock = Clock.from_limit(limits.time)
        self.iterations = 0
        self.iteration_limit = math.inf if limits.iterations is None else limits.iterations
        self.on_progress = limits.on_progress
        self.rng = limits.rng
        self.trace: list[Progress] = []
        self.tour: tuple[int, ...] | None = None
        self.walk: tuple[int, ...] | None = None
        self.length = math.inf
        self.bound: float | None = None
        self.is_infeasible = False
        self.was_stopped = False

    def update_incumbent(
        self,
        tour: Sequence[int] | None,
        walk: Sequence[int] | None = None,
        length: float | None = None,
    ) -> bool:
        """Make a tour the incumbent if it is valid and shorter, and return whether it was.

        Parameters
        ----------
        walk
            Vertices as they are walked, base to base, if that is not just the tour.
        length
            Length of the walk, if it is known.
        """
        if tour is None or not self.graph.is_tour(tour):
            return False
        if length is None:
            length = self.graph.walk_length(walk) if walk else self.graph.tour_length(tour)
        if not length < self.length:
            return False
        self.tour, self.length = tuple(int(v) for v in tour), length
        self.walk = None if walk is None else tuple(int(v) for v in walk)
        return True

    @contextmanager
    def until_stopped(self, *, blind: bool = False) -> Iterator[None]:
        """Run the body until it is done, a limit is reached, or Ctrl-C is pressed.

        If there is no tour by then, the run gets the nearest-neighbour tour, unless it is `blind`:
        a baseline that shows nothing except its own tour.
        """
        try:
            if not blind and not self.graph.is_complete and self.clock.limit is not None:
                # a roadmap that was cut short is too large for anything to be quick
                self.ensure_tour()
            yield
        except MemoryLimitError:
            raise
        except (RunStopped, LimitReachedError, KeyboardInterrupt, SystemError) as error:
            if is_interrupt(error):
                self.clock.end()  # also ends the run that this one is a part of
            elif isinstance(error, SystemError):
                raise
            self.was_stopped = True
            if not blind:
                self.ensure_tour()

    def finish(self, stage: str, **more: Any) -> Result:
        """Report a last time and return the result."""
        with suppress(KeyboardInterrupt):
            self.report("stopped" if self.was_stopped else stage, **more)
        return self.result()

    def solve_if_trivial(self) -> bool:
        """Solve a problem of at most one goal, and return whether it was one."""
        if self.graph.goal_count > 1:
            return False
        if self.graph.goal_count == 0:
            self.update_incumbent([0])
        else:
            members = self.graph.members(1)
            nearest = int(members[np.argmin(self.graph.costs_to_base[members])])
            self.update_incumbent([0, nearest])
        self.bound = self.length
        return True

    def ensure_tour(self) -> None:
        """Build a first tour if there is none, even if time is up.

        It visits the vertex of each cluster nearest to the base, by nearest neighbour; where a leg
        takes long to measure, it returns to the base after each.
        """
        graph = self.graph
        if self.tour is not None or graph.has_cost_matrix:
            return
        core = cheapest_per_cluster(graph.costs_to_base, graph.cluster, 1)
        if self.cost_policy.allows_single(graph.oracle.estimate(2).seconds):
            self._build_nearest_neighbour_tour(core)
        else:
            self._build_star_tour(core)

    def _build_star_tour(self, core: Ints) -> None:
        """Go out to each vertex and back: these legs are known without measuring."""
        graph = self.graph
        out = core[1:].tolist()
        if len(graph.before):
            # a cluster has fewer predecessors than any cluster that must follow it
            out.sort(key=lambda v: int(graph.before[:, graph.cluster[v]].sum()))
        walk = [0, *(w for v in out for w in (v, 0))]
        length = 2.0 * float(graph.costs_to_base[out].sum())
        self.update_incumbent([0, *out], walk=walk, length=length)

    def _build_nearest_neighbour_tour(self, core: Ints) -> None:
        """Visit vertices by nearest neighbour, by costs if they are few and by bounds otherwise."""
        graph = self.graph
        # a clock without a limit instead of None: a subgraph would use its graph's clock for None
        with graph.on_clock(Clock()):
            is_small = len(core) <= self.cost_policy.untimed_vertices
            near = graph.costs_among(core) if is_small else graph.lower_bounds(core)
            tour, left = [0], np.ones(len(core), dtype=bool)
            left[0] = False
            before = np.zeros((len(core), len(core)), dtype=bool)
            if len(graph.before):
                before = graph.before[np.ix_(graph.cluster[core], graph.cluster[core])]
            while left.any():
                ready = left & ~before[left].any(axis=0)
                k = int(np.argmin(np.where(ready, near[tour[-1]], np.inf)))
                tour.append(k)
                left[k] = False
            self.update_incumbent(core[tour].tolist())

    def raise_bound(self, bound: float) -> None:
        """Raise the lower bound, at most to the length of the incumbent."""
        grain = self.graph.grain
        if grain and np.isfinite(bound):
            bound = max(bound, grain * float(np.ceil(bound / grain - BOUND_ROUNDING)))
        self.bound = min(max(self.bound or 0.0, bound), self.length)

    def check(self) -> None:
        """Raise `RunStopped` if a limit is reached."""
        if self.clock.is_up or self.iterations >= self.iteration_limit:
            raise RunStopped

    @property
    def is_done(self) -> bool:
        """True if no tour is shorter than the incumbent, or than the known length."""
        if self.tour is None or self.bound is None:
            return False
        return proven(min(self.length, self.known_length), self.bound)

    def report(self, stage: str, **more: Any) -> None:
        """Add a row to the trace and pass it on; `more` are further fields of `Progress`."""
        row = Progress(
            self.clock.elapsed,
            stage,
            None if self.tour is None else self.length,
            None if self.bound is None else LowerBound(self.bound, self.graph.scope),
            iteration=self.iterations,
            tour=self.tour,
            **more,
        )
        self.trace.append(row)
        if self.on_progress:
            self.on_progress(row)

    def result(self) -> Result:
        """Return the result as it stands."""
        if self.tour is None:
            status = Status.INFEASIBLE if self.is_infeasible else Status.NO_SOLUTION_FOUND
            trace, scope = tuple(self.trace), self.graph.scope
            return Result(None, None, self.bound or None, status, trace, lower_bound_of=scope)
        optimal = self.bound is not None and proven(self.length, self.bound)
        status = Status.OPTIMAL if optimal else Status.FEASIBLE
        return Result(
            self.tour,
            self.length,
            self.bound,
            status,
            tuple(self.trace),
            walk=self.walk,
            lower_bound_of=self.graph.scope,
        )
