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
    from netsp.errors import InfeasibleError, InputError, NetspError, VerificationError
    from netsp.judge import Verification, verify
    from netsp.problem import Circle, Goal, Polygon, Problem, State
    from netsp.roadmap.tethers import Tethers
    from netsp.solution import Solution, Status
    from netsp.solvers.solve import solve, solve_graph, travel_graph
    from netsp.travel.graph import TravelGraph
    from netsp.travel.result import Progress, Result

__version__ = "0.1.0"

_PUBLIC = {
    "Circle": "problem",
    "Goal": "problem",
    "InfeasibleError": "errors",
    "InputError": "errors",
    "NetspError": "errors",
    "Polygon": "problem",
    "Problem": "problem",
    "Progress": "travel.result",
    "Result": "travel.result",
    "Solution": "solution",
    "State": "problem",
    "Status": "solution",
    "Tethers": "roadmap.tethers",
    "TravelGraph": "travel.graph",
    "Verification": "judge",
    "VerificationError": "errors",
    "solve": "solvers.solve",
    "solve_graph": "solvers.solve",
    "travel_graph": "solvers.solve",
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
