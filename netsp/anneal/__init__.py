"""Simulated annealing, as in the paper of 2017."""

from netsp.anneal.icra2017 import solve
from netsp.base.deprecated import deprecated_names

__all__ = ["solve"]

__getattr__ = deprecated_names(globals(), solve_2016="netsp.plan.rss2016:solve")
