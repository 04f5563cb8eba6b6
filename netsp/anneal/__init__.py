"""Simulated annealing, as in the papers of 2017 (on the travel graph) and 2016 (on free paths)."""

from netsp.anneal.icra2017 import solve
from netsp.anneal.rss2016 import solve as solve_2016

__all__ = ["solve", "solve_2016"]
