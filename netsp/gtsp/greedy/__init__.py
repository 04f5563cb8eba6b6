"""Greedy baselines of the two papers."""

from netsp.base.deprecated import deprecated_names
from netsp.gtsp.greedy.backtracking import solve, solve_2016

__all__ = ["solve", "solve_2016"]

__getattr__ = deprecated_names(globals(), solve_blind="netsp.plan.greedy_blind:solve")
