"""Scheduler of several sources of bounds and tours, each of which can be paused.

Every source is a task: its steps (`netsp.gtsp.resumable`), and an estimate of the time and memory
that it takes. The scheduler gives the next slice of CPU time to the task that promises most, and
measures what the slice has closed of the gap between the incumbent and the bound.

The promise of a task is a length per second: what its last slices have closed per second, or what
its estimate says if that is more. By the estimate a task closes the whole gap in its time; once it
has had more, this promise falls with the square of the time. So tasks of little work come first, a
large task is not judged while it prepares, and none that closes nothing is ever forgotten.

Under a limit of iterations a step counts as a fixed time, so that a seed always gives the same
result.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from netsp.base.number_ranges import check_positive, check_shares
from netsp.base.ram import available_memory
from netsp.gtsp.cost_oracle import Estimate
from netsp.gtsp.resumable import Steps
from netsp.gtsp.solver_run import RunStopped, SolverRun


@dataclass(frozen=True)
class SchedulerPolicy:
    """Policy of the scheduler.

    Attributes
    ----------
    probe_s
        CPU time of the first slice of a task, s.
    growth
        Length of a later slice, as a share of the time that the task has had.
    discount
        Weight of a slice in the rate of a task, relative to the slice after it.
    memory_share
        Maximum share of the available memory for a task.
    min_slice_s
        Minimum time that a slice counts for, s; the clock of a process is no finer.
    step_s
        Time that a step counts for under a limit of iterations, s.
    """

    probe_s: float = 0.05
    growth: float = 0.2
    discount: float = 0.8
    memory_share: float = 0.8
    min_slice_s: float = 1e-4
    step_s: float = 0.01

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "discount", "memory_share")


class Task:
    """Source of bounds or tours that can be paused.

    Parameters
    ----------
    name : str
        Name in tables.
    make_steps : callable
        Returns the steps; called when the task gets its first slice.
    estimate : Estimate
        Time and memory from the first step to the last.

    Attributes
    ----------
    spent : float
        CPU time that the task has had, s.
    closed : float
        Length by which it has narrowed the gap.
    is_over : bool
        Whether there are no more steps.
    """

    def __init__(
        self, name: str, make_steps: Callable[[], Steps[None]], estimate: Estimate
    ) -> None:
        self.name, self.estimate = name, estimate
        self.spent, self.closed, self.is_over = 0.0, 0.0, False
        self._make_steps = make_steps
        self._steps: Steps[None] | None = None
        self._recent_s, self._recent_closed = 0.0, 0.0

    def advance(self) -> None:
        """Make one step."""
        if self._steps is None:
            self._steps = self._make_steps()
        try:
            next(self._steps)
        except StopIteration:
            self.is_over = True

    def note(self, seconds: float, before: float, gap: float, discount: float) -> None:
        """Account for a slice of some seconds, with the gap before it and after it."""
        closed = max(before - gap, 0.0) if before < math.inf else 0.0
        self.spent += seconds
        self.closed += closed
        self._recent_s = discount * self._recent_s + seconds
        self._recent_closed = discount * self._recent_closed + closed

    def promise(self, gap: float, policy: SchedulerPolicy) -> float:
        """Return the length per second by which the task is expected to narrow the gap."""
        expected = max(self.estimate.seconds, policy.probe_s)
        planned = gap * expected / max(expected, self.spent) ** 2
        return max(planned, self._recent_closed / self._recent_s if self._recent_s else 0.0)

    def close(self) -> None:
        """End the steps, so that arrays are free."""
        if self._steps is not None:
            self._steps.close()


class Scheduler:
    """Tasks that narrow the gap of one run.

    Parameters
    ----------
    run : SolverRun
        Run with the incumbent and the bound that all tasks share.
    tasks : sequence of Task
        Tasks in order of priority: before the first tour they run in this order, and among equal
        promises the first one runs.
    gap : callable
        Returns the gap, a length; inf while there is no tour.
    policy : SchedulerPolicy
        Lengths of slices, and weights of promises.

    Examples
    --------
    >>> from netsp import TravelGraph
    >>> from netsp.gtsp.resumable import run_to_end
    >>> gap = 10.0
    >>> def halve():
    ...     global gap
    ...     while gap > 1.0:
    ...         gap /= 2.0
    ...         yield
    >>> run = SolverRun(TravelGraph.from_costs([[0, 1], [1, 0]], [0, 1]))
    >>> tasks = [Task("halve", halve, Estimate(1.0, 0.0))]
    >>> run_to_end(Scheduler(run, tasks, lambda: gap).steps())
    >>> gap
    0.625
    """

    def __init__(
        self,
        run: SolverRun,
        tasks: Sequence[Task],
        gap: Callable[[], float],
        policy: SchedulerPolicy = SchedulerPolicy(),
    ) -> None:
        self.run, self.tasks, self.gap, self.policy = run, tasks, gap, policy

    def steps(self) -> Steps[None]:
        """Give slices to tasks until the gap is closed or no task is left."""
        try:
            while self.gap() > 0.0:
                task = self.next_task()
                if task is None:
                    return
                yield from self._slice(task)
        finally:
            for task in self.tasks:
                task.close()

    def next_task(self) -> Task | None:
        """Return the task that promises most; None if none is left that fits into the memory.

        Before the first tour there is no gap, and tasks come in their order.
        """
        gap = self.gap()
        left = [t for t in self.tasks if not t.is_over and (t.spent or self._fits(t))]
        if gap == math.inf:
            return next(iter(left), None)
        return max(left, key=lambda t: t.promise(gap, self.policy), default=None)

    def _fits(self, task: Task) -> bool:
        return task.estimate.bytes <= self.policy.memory_share * available_memory()

    def _slice(self, task: Task) -> Steps[None]:
        """Advance a task by a slice."""
        policy, before, seconds = self.policy, self.gap(), 0.0
        budget = max(policy.probe_s, policy.growth * task.spent)
        begin = time.process_time()
        while seconds < budget and not task.is_over and self.gap() > 0.0:
            self.run.check()
            try:
                task.advance()
            except RunStopped:
                task.is_over = True  # an LP or a search within the task has ended
            if self.run.iteration_limit < math.inf:
                seconds += policy.step_s
            else:
                seconds = time.process_time() - begin
            yield
        task.note(max(seconds, policy.min_slice_s), before, self.gap(), policy.discount)
