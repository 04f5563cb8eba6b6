"""Reserve of tether that repairs keep, because flown paths are not exactly the planned ones."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.field_types import checked_argument
from netsp.model.problem import Problem
from netsp.model.solution import Solution


@dataclass(frozen=True)
class ReservePolicy:
    """Policy of how much tether repairs keep in reserve.

    Attributes
    ----------
    reserve
        Length to keep, in the problem's units; 0 or more. None for that of the plan: the slack that
        it was planned with (`solve --slack`), or else what its longest tether leaves of the limit.
    max_share
        Largest share of the limit that counts as the reserve of a plan, 0 to 1. Where all goals are
        near the base, a plan leaves much more unused than anybody chose; a repair that kept all of
        it would take detours for nothing.
    """

    reserve: float | None = None
    max_share: float = 0.1

    def __post_init__(self) -> None:
        if self.reserve is not None:
            checked_argument("reserve", self.reserve, 0.0)
        checked_argument("max_share", self.max_share, 0.0, 1.0)

    def of_plan(self, problem: Problem, solution: Solution) -> float:
        """Return the reserve that repairs of a plan keep, in the problem's units."""
        if self.reserve is not None:
            return self.reserve
        limit = problem.tether_length
        if solution.slack:
            return limit * solution.slack / (1.0 + solution.slack)
        longest = max((v.tether_length for v in solution.tour), default=limit)
        return min(max(limit - longest, 0.0), self.max_share * limit)


@dataclass(frozen=True)
class ReservedLimit:
    """Length of tether that a repair may use.

    Attributes
    ----------
    length
        Limit less the reserve that can be kept, in the problem's units.
    reserve, wanted
        Lengths that are kept, and that should be kept.
    goal
        Number of the goal whose tether leaves less than that; None if all is kept.
    """

    length: float
    reserve: float
    wanted: float
    goal: int | None = None

    def describe(self, problem: Problem) -> str:
        """Return words for what is kept in reserve, empty if nothing was to be."""
        units = problem.units
        if self.wanted <= 0.0:
            return ""
        if self.goal is None:
            return f"{self.reserve:.4g} {units} of tether kept in reserve"
        return (
            f"only {self.reserve:.4g} instead of {self.wanted:.4g} {units} of tether kept in "
            f"reserve, because {problem.goal_label(self.goal)} needs {self.length:.4g} of "
            f"{problem.tether_length:g} {units}"
        )
