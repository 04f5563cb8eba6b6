"""Cooling schedule.

The papers only say that θ decreases. Here it falls geometrically from `hot` to `cold` over the
iterations or the time allowed. Its unit is the mean length of a leg of the first tour.
"""

from __future__ import annotations

from dataclasses import dataclass

from netsp.gtsp.solver_run import SolverRun


@dataclass(frozen=True)
class Cooling:
    """Temperatures of a schedule.

    Attributes
    ----------
    hot, cold
        First and last temperature, as multiples of the mean length of a leg of the first tour.
    """

    hot: float = 1.0
    cold: float = 1e-3

    def __post_init__(self) -> None:
        if not 0.0 < self.cold <= self.hot:
            raise ValueError(
                f"options 'hot' and 'cold': expected 0 < cold <= hot, got {self.hot} and "
                f"{self.cold}"
            )


class Schedule:
    """Temperature as a function of progress, the used share of iterations or time, if larger.

    Without any limit, the iteration limit is `default`. One seed gives one result only if the
    iteration limit is reached before the time limit.
    """

    def __init__(self, cooling: Cooling, run: SolverRun, leg: float, default: int) -> None:
        self.cooling, self.run = cooling, run
        self.unit = max(leg, 1e-300)
        if run.clock.limit is None and run.iteration_limit == float("inf"):
            run.iteration_limit = default
        self.begin = run.clock.elapsed

    @property
    def progress(self) -> float:
        """Progress, 0 at the start and 1 at the end."""
        run = self.run
        by_clock = 0.0
        if run.clock.limit is not None:
            spent = run.clock.elapsed - self.begin
            by_clock = spent / max(run.clock.limit - self.begin, 1e-9)
        return min(1.0, max(by_clock, run.iterations / run.iteration_limit))

    @property
    def temperature(self) -> float:
        """Current θ, in units of length."""
        c = self.cooling
        return float(self.unit * c.hot * (c.cold / c.hot) ** self.progress)

    def chunk(self, limit: int) -> int:
        """Return the number of iterations at the current temperature, at most `limit`."""
        return int(min(limit, self.run.iteration_limit - self.run.iterations))
