"""Online planners by name."""

from __future__ import annotations

import math
from collections.abc import Callable

from netsp.base.errors import InputError
from netsp.base.registry import Registry, later, make_part
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
        "repair": later("repair", "netsp.online.execute.mission_repair:RepairPlanner"),
        "react": ReactPlanner,
        "react-draft": ReactDraftPlanner,
        "react-thresholds": ReactThresholdsPlanner,
        "none": Planner,
    },
    later,
)
"""Factories of planners by name, each called with (mission, field, tether model, grid, options)."""


def make_planner(
    name: str | Callable[..., Planner],
    mission: Mission,
    scene: DistanceField,
    tethers: Tethers,
    grid: Grid,
    options: PlannerOptions | None = None,
) -> Planner:
    """Make a planner by name, or by calling a factory such as a class derived from `Planner`.

    Raises
    ------
    InputError
        An unknown name of a planner, of path search or of refinement, a pivot spacing that is not
        positive, or a tether model that the planner cannot use; a factory that takes other
        arguments, or makes no planner.
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
    names = ("mission", "field", "tethers", "grid", "options")
    arguments = dict(zip(names, (mission, scene, tethers, grid, options), strict=True))
    made: Planner = make_part("planner", make, arguments, ("plan", "step"))
    return made


__all__ = ["PLANNERS", "Command", "Planner", "PlannerOptions", "make_planner"]
