"""netsp: shortest non-entangling tours for tethered underwater robots, with proof.

>>> from netsp import Circle, Problem, solve, verify
>>> pile = Circle(center=(5, 0), radius=1)
>>> problem = Problem(base=(0, 0), goals=[(10, 1), (10, -1)], obstacles=[pile], tether_length=12)
>>> solution = solve(problem)
>>> verify(problem, solution).passed
True
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from netsp.base.errors import InfeasibleError, InputError, NetspError, VerificationError
    from netsp.gtsp.travel.graph import TravelGraph
    from netsp.gtsp.travel.result import Progress, Result
    from netsp.judge import Verification, verify
    from netsp.model.problem import Circle, Goal, Polygon, Problem, State
    from netsp.model.solution import Solution, Status
    from netsp.plan.solve_problem import solve, solve_graph, travel_graph
    from netsp.roadmap.tether_classes import Tethers

__version__ = "0.1.0"

_PUBLIC = {
    "Circle": "model.problem",
    "Goal": "model.problem",
    "InfeasibleError": "base.errors",
    "InputError": "base.errors",
    "NetspError": "base.errors",
    "Polygon": "model.problem",
    "Problem": "model.problem",
    "Progress": "gtsp.travel.result",
    "Result": "gtsp.travel.result",
    "Solution": "model.solution",
    "State": "model.problem",
    "Status": "model.solution",
    "Tethers": "roadmap.tether_classes",
    "TravelGraph": "gtsp.travel.graph",
    "Verification": "judge",
    "VerificationError": "base.errors",
    "solve": "plan.solve_problem",
    "solve_graph": "plan.solve_problem",
    "travel_graph": "plan.solve_problem",
    "verify": "judge",
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


def __getattr__(name: str) -> Any:
    """Public names are imported when first used, so that `import netsp` is instant."""
    if name in _PUBLIC:
        value = getattr(importlib.import_module(f"netsp.{_PUBLIC[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'netsp' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC})
