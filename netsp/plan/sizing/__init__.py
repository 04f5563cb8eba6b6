"""Questions before a tour: the length of the tether, the place of the base, the margins."""

from netsp.base.deprecated import deprecated_names
from netsp.plan.sizing.base_placement import BaseSearch, Candidate, best_base
from netsp.plan.sizing.tether_margins import Margins, VisitMargin, margins
from netsp.plan.sizing.tether_sizing import Step, TetherCurve, tether_curve

__all__ = [
    "BaseSearch",
    "Candidate",
    "Margins",
    "Step",
    "TetherCurve",
    "VisitMargin",
    "best_base",
    "margins",
    "tether_curve",
]

__getattr__ = deprecated_names(globals(), StopMargin="VisitMargin")
