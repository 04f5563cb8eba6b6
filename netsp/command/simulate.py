"""`netsp simulate`: a mission in a scene, with a taut tether."""

from __future__ import annotations

import argparse

from netsp.base.errors import EXIT_DEFECT, EXIT_NOT_ALL
from netsp.command.types import vector


def run(args: argparse.Namespace) -> int:
    """Fly the mission, write what happened, and return the exit code."""
    from netsp.command.flight import fly
    from netsp.world.mission.mission import Mission
    from netsp.world.mission.mission_limits import check_names
    from netsp.world.paths.refine import RefineParams
    from netsp.world.planner import PlannerOptions

    changes: dict[str, object] = {}
    if args.tether is not None:
        changes["tether_length"] = args.tether
    if args.current is not None:
        changes["current"] = vector(args.current, "--current")
    mission = Mission.load(args.mission).model_copy(update=changes)
    check_names(args.planner, args.vehicle, args.tether_model)
    if args.compare is not None:
        check_names(args.compare, args.vehicle, args.tether_model)
    refinement = RefineParams(keeps=args.perturbation)
    runs = fly(
        mission,
        [args.planner, args.compare] if args.compare else [args.planner],
        args,
        vehicle=args.vehicle,
        tether=args.tether_model,
        snap=args.snap,
        seed=args.seed,
        options=PlannerOptions(args.paths, args.refine, args.seed, refinement),
    )
    if any(r.summary["defects"] for r in runs):
        return EXIT_DEFECT
    s = runs[0].summary
    is_complete = s["status"] == "done" and not s["left_out"] and s["home"]["tether_free"]
    return 0 if is_complete else EXIT_NOT_ALL
