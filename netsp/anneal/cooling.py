"""The temperature schedule.

The papers say that θ decreases and no more. Here it falls geometrically from `hot` to `cold`, both
fractions of the mean length of a leg in the start state, over the iterations or the time allowed.
"""

from __future__ import annotations

from dataclasses import dataclass

from netsp.run import Run


@dataclass(frozen=True)
class Cooling:
    """hot, cold : first and last temperature, in mean legs of the start state."""

    hot: float = 1.0
    cold: float = 1e-3

    def __post_init__(self) -> None:
        if not 0.0 < self.cold <= self.hot:
            raise ValueError(
                f"options 'hot' and 'cold': expected 0 < cold <= hot, got {self.hot} and "
                f"{self.cold}"
            )


class Schedule:
    """Temperature as a function of progress.

    By iterations if there is an iteration limit or no limit at all (then `default` iterations are
    made), so that the same seed gives the same answer; by the clock if only time is limited.
    """

    def __init__(self, cooling: Cooling, run: Run, leg: float, default: int) -> None:
        self.cooling, self.run = cooling, run
        self.unit = max(leg, 1e-300)
        if run.clock.limit is None and run.iteration_limit == float("inf"):
            run.iteration_limit = default
        self.by_clock = run.iteration_limit == float("inf")
        self.end = run.clock.left if self.by_clock else float("inf")

    @property
    def progress(self) -> float:
        """From 0 at the start to 1 at the end."""
        run = self.run
        if self.by_clock:
            return min(1.0, 1.0 - max(run.clock.left, 0.0) / max(self.end, 1e-9))
        return min(1.0, run.iterations / run.iteration_limit)

    @property
    def temperature(self) -> float:
        """θ now, in length."""
        c = self.cooling
        return float(self.unit * c.hot * (c.cold / c.hot) ** self.progress)

    def chunk(self, most: int) -> int:
        """How many iterations to make at this temperature."""
        return int(min(most, self.run.iteration_limit - self.run.iterations))
