"""Online planners by name."""

from __future__ import annotations

import math
from collections.abc import Callable

from netsp.base.errors import InputError
from netsp.base.registry import Registry, later
from netsp.world.mission.mission import Mission
from netsp.world.paths.refine import REFINEMENTS
from netsp.world.paths.sampled import OMPL_PLANNERS
from netsp.world.paths.tree import Grid
from netsp.world.planner.planner import Command, Planner, PlannerOptions, Tethers
from netsp.world.planner.predictive import PredictivePlanner
from netsp.world.planner.react_draft import ReactDraftPlanner, ReactThresholdsPlanner
from netsp.world.planner.react_planner import ReactPlanner
from netsp.world.scene.field import DistanceField
from netsp.world.tether import GeodesicTether

PLANNERS: Registry[Callable[..., Planner]] = Registry(
    "planner",
    "netsp.planners",
    {
        "predictive": PredictivePlanner,
        "repair": later("repair", "netsp.plan.space.mission_repair:RepairPlanner"),
        "react": ReactPlanner,
        "react-draft": ReactDraftPlanner,
        "react-thresholds": ReactThresholdsPlanner,
        "none": Planner,
    },
    later,
)
"""Name → what makes a planner of (mission, field, tether model, grid, options)."""


def make_planner(
    name: str | Callable[..., Planner], mission: Mission, scene: DistanceField, tethers: Tethers,
    grid: Grid, options: PlannerOptions | None = None,
) -> Planner:  # fmt: skip
    """A planner by name, or made by a callable.

    Parameters
    ----------
    name : str or callable
        One of `PLANNERS`, or a callable such as a class derived from `Planner`.
    mission : Mission
        What is flown.
    scene : DistanceField
        The map.
    tethers : TetherModel
        The tether model that the planner believes.
    grid : Grid
        The grid that paths are sought on.
    options : PlannerOptions, optional
        How paths are found.

    Returns
    -------
    Planner
        The planner.

    Raises
    ------
    InputError
        No planner, or none of the options, has that name.
    """
    options = options or PlannerOptions()
    make = name if callable(name) else PLANNERS.named(name)
    if options.paths not in (known := ("tree", *OMPL_PLANNERS)):
        raise InputError(f"paths: expected {', '.join(known)}, got {options.paths!r}")
    if options.refine not in (None, *REFINEMENTS):
        raise InputError(f"refine: expected {', '.join(REFINEMENTS)}, got {options.refine!r}")
    if options.pivot_spacing is not None and not 0.0 < options.pivot_spacing < math.inf:
        raise InputError(f"pivot_spacing: expected more than 0, got {options.pivot_spacing!r}")
    if name in ("predictive", "repair") and not isinstance(tethers, GeodesicTether):
        raise InputError(f"tether: planner {name!r} needs geodesic, got {tethers.name!r}")
    return make(mission, scene, tethers, grid, options)


__all__ = ["PLANNERS", "Command", "Planner", "PlannerOptions", "make_planner"]
