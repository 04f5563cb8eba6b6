"""netsp: shortest non-entangling tours for tethered underwater robots, with proof.

>>> from netsp import Circle, Problem, solve, verify
>>> pile = Circle(center=(5, 0), radius=1)
>>> problem = Problem(base=(0, 0), goals=[(10, 1), (10, -1)], obstacles=[pile], tether_length=12)
>>> solution = solve(problem)
>>> verify(problem, solution).passed
True
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from netsp.base import moved_modules
from netsp.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from netsp.base.errors import InfeasibleError, InputError, NetspError, VerificationError
    from netsp.gtsp.travel.result import Progress, Result
    from netsp.judge import Verification, verify
    from netsp.model.problem import Circle, Goal, Polygon, Problem, State
    from netsp.model.solution import Solution, Status
    from netsp.plan.solve_problem import solve, solve_graph, travel_graph
    from netsp.roadmap.tether_classes import Tethers
    from netsp.roadmap.travel_graph import TravelGraph

__version__ = "0.1.0"

_PUBLIC = {
    "Circle": "netsp.model.problem",
    "Goal": "netsp.model.problem",
    "InfeasibleError": "netsp.base.errors",
    "InputError": "netsp.base.errors",
    "NetspError": "netsp.base.errors",
    "Polygon": "netsp.model.problem",
    "Problem": "netsp.model.problem",
    "Progress": "netsp.gtsp.travel.result",
    "Result": "netsp.gtsp.travel.result",
    "Solution": "netsp.model.solution",
    "State": "netsp.model.problem",
    "Status": "netsp.model.solution",
    "Tethers": "netsp.roadmap.tether_classes",
    "TravelGraph": "netsp.roadmap.travel_graph",
    "Verification": "netsp.judge",
    "VerificationError": "netsp.base.errors",
    "solve": "netsp.plan.solve_problem",
    "solve_graph": "netsp.plan.solve_problem",
    "travel_graph": "netsp.plan.solve_problem",
    "verify": "netsp.judge",
}

__all__ = [
    "Circle",
    "Goal",
    "InfeasibleError",
    "InputError",
    "NetspError",
    "Polygon",
    "Problem",
    "Progress",
    "Result",
    "Solution",
    "State",
    "Status",
    "Tethers",
    "TravelGraph",
    "Verification",
    "VerificationError",
    "solve",
    "solve_graph",
    "travel_graph",
    "verify",
]


__getattr__, __dir__ = lazy_names(globals(), _PUBLIC)
moved_modules.install()
