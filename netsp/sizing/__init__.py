"""What is asked before there is a problem: how long a tether, and where to stand."""

from netsp.sizing.base import BaseSearch, Candidate, best_base
from netsp.sizing.tether import Step, TetherCurve, tether_curve

__all__ = ["BaseSearch", "Candidate", "Step", "TetherCurve", "best_base", "tether_curve"]
