"""What every solver run shares: the incumbent, the bound, the limits and the report."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from netsp.base.clock import Clock
from netsp.base.errors import InputError, LimitReachedError, MemoryLimitError, interrupted
from netsp.gtsp.limits import Limits
from netsp.gtsp.travel.graph import UNTIMED, BaselessGraph, TravelGraph, least_tethers
from netsp.gtsp.travel.result import Progress, Result, proven
from netsp.model.bound_scope import LowerBound
from netsp.model.solution import Status


class RunStopped(Exception):
    """A limit is reached."""


SLIVER = 1e-4
"""Where lengths are multiples of a grain, a bound is rounded up to the next, but not by so small a
part of it: bounds are off by rounding themselves."""


class SolverRun:
    """One run of a solver on a travel graph.

    `RunStopped` and Ctrl-C both end it with the best tour so far.

    Attributes
    ----------
    iterations
        How many the solver has done; each solver says what one is.
    known_length
        Length of a tour from elsewhere: a bound that reaches it is all that is wanted.
    """

    def __init__(self, graph: TravelGraph, limits: Limits | None = None) -> None:
        limits = limits or Limits()
        if isinstance(graph, BaselessGraph):
            raise InputError("graph: has no base; expected solve_graph to be called with it")
        # compiled loops take it for granted that every goal has a class
        lost = np.flatnonzero(np.bincount(graph.cluster) == 0)
        if len(lost):
            raise InputError(f"graph: no class of goal {lost[0]}; expected one of every goal")
        self.graph = graph
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
        """Take a tour as incumbent if it is one and is shorter; whether it was taken.

        Parameters
        ----------
        walk
            The vertices as they are walked, base to base, when that is not just the tour.
        length
            Of the walk, if the caller knows it already.
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
        """Run the body until it is done, a limit is reached, also while legs are measured, or
        Ctrl-C is pressed. Where it has no tour yet by then, it gets the nearest one that there is,
        unless it is blind: then its own is all that it may show."""
        try:
            if not blind and not self.graph.complete and self.clock.limit is not None:
                # a roadmap that was cut short says that nothing here is quick
                self.ensure_tour()
            yield
        except MemoryLimitError:
            raise
        except (RunStopped, LimitReachedError, KeyboardInterrupt, SystemError) as error:
            if interrupted(error):
                self.clock.end()  # for the run that this one is a part of, too
            elif isinstance(error, SystemError):
                raise
            self.was_stopped = True
            if not blind:
                self.ensure_tour()

    def finish(self, stage: str, **more: Any) -> Result:
        """The last report, which says so if the run was stopped, and the outcome."""
        with suppress(KeyboardInterrupt):
            self.report("stopped" if self.was_stopped else stage, **more)
        return self.result()

    def solve_if_trivial(self) -> bool:
        """Settle problems of no goal or one, where the answer is known."""
        if self.graph.goal_count > 1:
            return False
        if self.graph.goal_count == 0:
            self.update_incumbent([0])
        else:
            there = self.graph.members(1)
            self.update_incumbent([0, int(there[np.argmin(self.graph.costs_to_base[there])])])
        self.bound = self.length
        return True

    def ensure_tour(self) -> None:
        """Take a first tour, whatever the time: the goals in the class of least tether, each the
        nearest to the one before, by the bounds of legs where goals are many."""
        graph = self.graph
        if self.tour is not None or not graph.roadmapped:
            return
        core = least_tethers(graph.costs_to_base, graph.cluster, 1)
        if not graph.quick_legs:
            # out and back to every goal: those legs are the tethers, which are known; a goal has
            # fewer goals before it than any goal after it
            out = core[1:].tolist()
            if len(graph.before):
                out.sort(key=lambda v: int(graph.before[:, graph.cluster[v]].sum()))
            walk = [0, *(w for v in out for w in (v, 0))]
            self.update_incumbent(
                [0, *out], walk=walk, length=2.0 * float(graph.costs_to_base[out].sum())
            )
            return
        # a few legs; without them there would be nothing to show. A clock without a limit, not
        # none: a part of another graph would take that one's instead
        with graph.on_clock(Clock()):
            few = len(core) <= UNTIMED
            near = graph.costs_among(core) if few else graph.lower_bounds(core)
            tour, left = [0], np.ones(len(core), dtype=bool)
            left[0] = False
            before = graph.before[np.ix_(graph.cluster[core], graph.cluster[core])] if len(
                graph.before
            ) else np.zeros((len(core), len(core)), dtype=bool)  # fmt: skip
            while left.any():
                ready = left & ~before[left].any(axis=0)
                k = int(np.argmin(np.where(ready, near[tour[-1]], np.inf)))
                tour.append(k)
                left[k] = False
            self.update_incumbent(core[tour].tolist())

    def raise_bound(self, bound: float) -> None:
        """Take a lower bound if it is better; never above the incumbent."""
        grain = self.graph.grain
        if grain and np.isfinite(bound):
            bound = max(bound, grain * float(np.ceil(bound / grain - SLIVER)))
        self.bound = min(max(self.bound or 0.0, bound), self.length)

    def check(self) -> None:
        """Raise `RunStopped` when a limit is reached."""
        if self.clock.is_up or self.iterations >= self.iteration_limit:
            raise RunStopped

    @property
    def is_done(self) -> bool:
        """Whether the incumbent is proven optimal, or no shorter than what is known."""
        if self.tour is None or self.bound is None:
            return False
        return proven(min(self.length, self.known_length), self.bound)

    def report(self, stage: str, **more: Any) -> None:
        """Add a row to the trace and hand it on; `more` are further fields of `Progress`."""
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
        """The outcome as it stands."""
        if self.tour is None:
            status = Status.INFEASIBLE if self.is_infeasible else Status.NO_SOLUTION_FOUND
            return Result(
                None, None, self.bound or None, status, tuple(self.trace),
                lower_bound_of=self.graph.scope,
            )  # fmt: skip
        optimal = self.bound is not None and proven(self.length, self.bound)
        status = Status.OPTIMAL if optimal else Status.FEASIBLE
        return Result(
            self.tour, self.length, self.bound, status, tuple(self.trace), walk=self.walk,
            lower_bound_of=self.graph.scope,
        )  # fmt: skip
