"""The commands about robots that move: their arguments, and what they call."""

from __future__ import annotations

import argparse
from typing import Any

from netsp.command.types import check_writable, length, natural, positive, seconds


def add_online(commands: Any) -> None:
    """Add simulate, execute, order, export and import."""
    p = commands.add_parser("simulate", help="run a mission in a scene with a taut tether")
    p.add_argument("mission", metavar="MISSION", help="mission file (JSON)")
    p.add_argument(
        "--planner", default="predictive", metavar="NAME",
        help="predictive (default), react, react-draft or none",
    )  # fmt: skip
    p.add_argument("--tether", type=length, metavar="L", help="tether length, in place of its own")
    p.add_argument(
        "--vehicle", default="kinematic", metavar="NAME",
        help="kinematic (default) or bluerov2 (with its dynamics and controller)",
    )  # fmt: skip
    p.add_argument(
        "--tether-model", default="geodesic", metavar="NAME",
        help="that the planner believes: geodesic (default) or react",
    )  # fmt: skip
    p.add_argument("--current", metavar="X,Y,Z", help="current (m/s), in place of the mission's")
    p.add_argument(
        "--ways", default="tree", metavar="NAME",
        help="how ways are found: tree (default), bitstar, rrtstar or prmstar (OMPL)",
    )  # fmt: skip
    p.add_argument(
        "--refine", metavar="NAME", help="none, paper or gradient; default is the planner's own"
    )
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="of gusts and sampling")
    p.add_argument("--compare", metavar="NAME", help="fly with another planner too, side by side")
    p.add_argument("--snap", action="store_true", help="move waypoints out of solids")
    p.add_argument(
        "-o",
        "--output",
        metavar="RUN",
        help="folder for log.csv, summary.json, run.png and (with plotly) run.html",
    )
    p.add_argument("--quiet", action="store_true", help="no progress")
    p.set_defaults(run=_simulate)

    p = commands.add_parser("execute", help="carry a tour out online, and repair it on the way")
    p.add_argument("problem", metavar="PROBLEM", help="problem file (JSON)")
    p.add_argument("solution", metavar="SOLUTION", help="solution file (JSON)")
    p.add_argument("--surprise", metavar="FILE", help="what happens on the way (JSON)")
    p.add_argument("--speed", type=length, default=0.5, metavar="V", help="per second; default 0.5")
    p.add_argument(
        "--vehicle", default="kinematic", metavar="NAME", help="kinematic (default) or bluerov2"
    )
    p.add_argument("--current", metavar="X,Y,Z", help="current (m/s); default none")
    p.add_argument("--gusts", type=length, default=0.0, metavar="S", help="on top of it (m/s)")
    p.add_argument(
        "--planner", default="repair", metavar="NAME",
        help="repair (default): mend what breaks; none: go on with the plan",
    )  # fmt: skip
    p.add_argument(
        "--planning-limit", type=seconds, default=2.0, metavar="S",
        help="for mending a plan, while the robot holds its place; default 2",
    )  # fmt: skip
    p.add_argument("--delta", type=length, metavar="D", help="resolution of the tether")
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="of gusts and solvers")
    p.add_argument("-o", "--output", metavar="RUN", help="folder for logs, summary and run.png")
    p.add_argument("--quiet", action="store_true", help="no progress")
    p.set_defaults(run=_execute)

    p = commands.add_parser("order", help="reorder a mission's waypoints for a short tether")
    p.add_argument("mission", metavar="MISSION", help="mission file (JSON)")
    p.add_argument(
        "--time-limit", type=seconds, default=20.0, metavar="S", help="of the search; default 20"
    )
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="of the search")
    p.add_argument("-o", "--output", metavar="FILE", help="write the mission here (else stdout)")
    p.add_argument("--quiet", action="store_true", help="no progress")
    p.set_defaults(run=_order)

    p = commands.add_parser("export", help="write a tour as a mission file of a ground station")
    p.add_argument("solution", metavar="SOLUTION", help="solution file (JSON)")
    p.add_argument("--problem", required=True, metavar="FILE", help="the problem it solves")
    p.add_argument(
        "--format", metavar="NAME",
        help="plan (QGroundControl), wpl (QGC WPL 110), geojson or csv; default by the file's name",
    )  # fmt: skip
    p.add_argument(
        "--origin", metavar="LAT,LON[,HEADING]",
        help="where the base is, and where the y axis points to (degrees from north)",
    )  # fmt: skip
    p.add_argument(
        "--acceptance", type=length, default=0.0, metavar="R",
        help="acceptance radius of the vehicle (m): corners may be cut by it",
    )  # fmt: skip
    p.add_argument("--hold", type=natural, default=5, metavar="S", help="at goals; default 5")
    p.add_argument("--speed", type=length, default=0.5, metavar="V", help="m/s; default 0.5")
    p.add_argument(
        "--most", type=positive, default=650, metavar="N", help="waypoints at most; default 650"
    )
    p.add_argument(
        "--margin", default="0.3,0.2", metavar="SLACK[,CLEARANCE]",
        help="warn when less tether is left or lines come nearer to an obstacle; default 0.3,0.2",
    )  # fmt: skip
    p.add_argument("-o", "--output", required=True, metavar="FILE")
    p.set_defaults(run=_export)

    p = commands.add_parser("import", help="make a problem of a map (GeoJSON)")
    p.add_argument("site", metavar="SITE", help="GeoJSON file: obstacles and goals")
    p.add_argument(
        "--base", metavar="LAT,LON[,HEADING]", help="where the tether is fixed; default the file's"
    )
    p.add_argument("--tether", type=length, metavar="L", help="tether length; default the file's")
    p.add_argument("--clearance", type=length, metavar="C", help="default the file's, or 0")
    p.add_argument("--radius", type=length, metavar="R", help="of obstacles that have none")
    p.add_argument("-o", "--output", metavar="FILE", help="write the problem here (else stdout)")
    p.set_defaults(run=_import)


def _simulate(args: argparse.Namespace) -> int:
    from netsp.command.simulate import run_mission

    return run_mission(args)


def _execute(args: argparse.Namespace) -> int:
    from netsp.command.execute import run_execute

    return run_execute(args)


def _order(args: argparse.Namespace) -> int:
    from netsp.command.simulate import run_order

    check_writable(args.output, inputs=(args.mission,))
    return run_order(args)


def _export(args: argparse.Namespace) -> int:
    from netsp.command.export import run_export

    check_writable(args.output, inputs=(args.solution, args.problem))
    return run_export(args)


def _import(args: argparse.Namespace) -> int:
    from netsp.command.export import run_import

    check_writable(args.output, inputs=(args.site,))
    return run_import(args)
