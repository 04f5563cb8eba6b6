"""Online planners by name."""

from __future__ import annotations

from collections.abc import Callable

from netsp.errors import InputError
from netsp.online.field import DistanceField
from netsp.online.mission import Mission
from netsp.online.planner.base import Command, Planner
from netsp.online.planner.predictive import PredictivePlanner
from netsp.online.planner.react import ReactPlanner
from netsp.online.tether import GeodesicTether, ReactTether
from netsp.online.tree import Grid


def _draft(
    mission: Mission, scene: DistanceField, tethers: GeodesicTether | ReactTether, grid: Grid
) -> Planner:
    return ReactPlanner(mission, scene, tethers, grid, draft=True)


PLANNERS: dict[str, Callable[..., Planner]] = {
    "predictive": PredictivePlanner,
    "react": ReactPlanner,
    "react-draft": _draft,
    "none": Planner,
}


def make_planner(
    name: str, mission: Mission, scene: DistanceField, tethers: GeodesicTether | ReactTether,
    grid: Grid,
) -> Planner:  # fmt: skip
    """A planner by name. InputError for a name that is none."""
    if name not in PLANNERS:
        raise InputError(f"--planner: expected {', '.join(PLANNERS)}, got {name!r}")
    return PLANNERS[name](mission, scene, tethers, grid)


__all__ = ["PLANNERS", "Command", "Planner", "make_planner"]
