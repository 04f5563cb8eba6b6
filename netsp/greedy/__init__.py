"""Greedy baselines of the two papers."""

from netsp.greedy.backtracking import solve, solve_2016
from netsp.greedy.blind import solve as solve_blind

__all__ = ["solve", "solve_2016", "solve_blind"]
