"""Temperature schedule.

The papers say only that θ decreases. Here it falls geometrically from `hot` to `cold`, in mean legs
of the start state, over the iterations or the time allowed.
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
        First and last temperature, in mean legs of the start state.
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
    """Temperature as a function of progress: the larger of the used shares of iterations and time.

    Without a limit, `default` iterations are made. The same seed gives the same result only if the
    iteration limit is reached first.
    """

    def __init__(self, cooling: Cooling, run: SolverRun, leg: float, default: int) -> None:
        self.cooling, self.run = cooling, run
        self.unit = max(leg, 1e-300)
        if run.clock.limit is None and run.iteration_limit == float("inf"):
            run.iteration_limit = default
        self.begin = run.clock.elapsed

    @property
    def progress(self) -> float:
        """Progress, from 0 at the start to 1 at the end."""
        run = self.run
        by_clock = 0.0
        if run.clock.limit is not None:
            spent = run.clock.elapsed - self.begin
            by_clock = spent / max(run.clock.limit - self.begin, 1e-9)
        return min(1.0, max(by_clock, run.iterations / run.iteration_limit))

    @property
    def temperature(self) -> float:
        """Present θ, as a length."""
        c = self.cooling
        return float(self.unit * c.hot * (c.cold / c.hot) ** self.progress)

    def chunk(self, limit: int) -> int:
        """Return the number of iterations to make at this temperature."""
        return int(min(limit, self.run.iteration_limit - self.run.iterations))
