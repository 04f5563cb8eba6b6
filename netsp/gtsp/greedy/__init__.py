"""Greedy baselines of the two papers."""

from netsp.gtsp.greedy.backtracking import solve, solve_2016
from netsp.gtsp.greedy.blind import solve as solve_blind

__all__ = ["solve", "solve_2016", "solve_blind"]
