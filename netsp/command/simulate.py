"""`netsp simulate`: a mission in a scene, with a taut tether."""

from __future__ import annotations

import argparse

from netsp.base.errors import EXIT_DEFECT, EXIT_NOT_ALL, InputError
from netsp.command import json_output
from netsp.command.types import choices, length, natural, vector

EXAMPLE = "netsp simulate missions/basin.json -o run"


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument("mission", metavar="MISSION", help="mission file (JSON)")
    p.add_argument(
        "--planner",
        default="predictive",
        metavar="NAME",
        help=choices(
            "predictive (default), repair, react, react-draft, react-thresholds or none",
            "netsp.planners",
        ),
    )
    p.add_argument(
        "--tether", type=length, metavar="L", help="tether length, instead of the mission's"
    )
    p.add_argument(
        "--vehicle",
        default="kinematic",
        metavar="NAME",
        help="kinematic (default) or bluerov2 (with its dynamics and controller)",
    )
    p.add_argument(
        "--tether-model",
        default="geodesic",
        metavar="NAME",
        help=choices("used by the planner: geodesic (default) or react", "netsp.tethers"),
    )
    p.add_argument("--current", metavar="X,Y,Z", help="current (m/s), instead of the mission's")
    p.add_argument(
        "--paths",
        default="tree",
        metavar="NAME",
        help="how paths are found: tree (default), bitstar, rrtstar or prmstar (OMPL)",
    )
    p.add_argument(
        "--refine", metavar="NAME", help="none, paper or gradient; default is the planner's own"
    )
    p.add_argument(
        "--perturbation",
        choices=("free", "farther"),
        default="free",
        help="random moves that --refine paper keeps: free (default), as the paper says, or those "
        "that lead farther from solids",
    )
    p.add_argument(
        "--seed",
        type=natural,
        default=0,
        metavar="N",
        help="random seed of gusts and of sampling planners; default 0",
    )
    p.add_argument("--compare", metavar="NAME", help="also fly with this planner, for comparison")
    p.add_argument(
        "--surprise",
        metavar="FILE",
        help="surprise file (JSON): solids that appear, vanish or move; waypoints added or "
        "cancelled; a robot carried off",
    )
    p.add_argument("--snap", action="store_true", help="move waypoints out of solids")
    p.add_argument(
        "-o",
        "--output",
        metavar="RUN",
        help="folder for log.csv, summary.json, run.png and (with plotly) run.html",
    )
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")
    json_output.json_flag(p)


def run(args: argparse.Namespace) -> int:
    """Fly the mission, write what happened, and return the exit code."""
    from netsp.command.flight import fly
    from netsp.world.mission.mission import Mission
    from netsp.world.mission.mission_limits import check_names
    from netsp.world.paths.refine import RefineParams
    from netsp.world.planner import PLANNERS, PlannerOptions
    from netsp.world.simulator.surprises import SceneSurprises

    mission = Mission.load(args.mission)
    changes: dict[str, object] = {}
    if args.tether is not None:
        changes["tether_length"] = args.tether
    if args.current is not None:
        changes["current"] = vector(args.current, "--current")
    mission = mission.model_copy(update=changes)
    check_names(args.planner, args.vehicle, args.tether_model)
    if args.compare is not None and args.compare not in PLANNERS:
        raise InputError(f"--compare: expected {', '.join(PLANNERS)}, got {args.compare!r}")
    surprises = SceneSurprises.load(args.surprise) if args.surprise else None
    runs = fly(
        mission,
        [args.planner, args.compare] if args.compare else [args.planner],
        output=args.output,
        quiet=args.quiet,
        as_json=args.json,
        surprises=surprises,
        source=args.surprise,
        inputs=(args.mission, args.surprise),
        vehicle=args.vehicle,
        tether=args.tether_model,
        snap=args.snap,
        seed=args.seed,
        options=PlannerOptions(
            args.paths, args.refine, args.seed, RefineParams(keeps=args.perturbation)
        ),
    )
    if any(r.summary["defects"] for r in runs):
        return EXIT_DEFECT
    s = runs[0].summary
    complete = s["status"] == "done" and not s["left_out"] and s["home"]["tether_free"]
    return 0 if complete else EXIT_NOT_ALL
