"""`netsp order`: a mission's waypoints in an order that keeps the tether short."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from netsp.command import messages
from netsp.command.types import (
    check_writable,
    natural,
    seconds,
)

EXAMPLE = "netsp order missions/basin.json -o better.json"


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument("mission", metavar="MISSION", help="mission file (JSON)")
    p.add_argument(
        "--time-limit",
        type=seconds,
        default=20.0,
        metavar="S",
        help="seconds for the search; default 20",
    )
    p.add_argument(
        "--seed", type=natural, default=0, metavar="N", help="random seed of the search; default 0"
    )
    p.add_argument(
        "-o", "--output", metavar="FILE", help="write the mission to this file (default: stdout)"
    )
    p.add_argument("--quiet", action="store_true", help="no progress")


def run(args: argparse.Namespace) -> int:
    """Reorder, write the mission, and return the exit code."""
    check_writable(args.output, inputs=(args.mission,))
    from netsp.files import read_text, write_text
    from netsp.online.mission import Mission
    from netsp.space.order import reorder

    mission = Mission.load(args.mission)
    scene_file = Mission.from_json(read_text(args.mission)).scene
    say = None if args.quiet else lambda text: print(f"{text} …", file=sys.stderr)
    found = reorder(mission, time_limit=args.time_limit, seed=args.seed, on_progress=say)
    kept = found.order == tuple(range(len(mission.waypoints)))
    if not args.quiet:
        for name, run in (("given", found.before), ("new", found.after)):
            s = run.summary
            print(
                f"{name:<6} inspection {s['inspection_s']:.1f} s, with tether recovery "
                f"{s['total_s']['tether']:.1f} s, longest tether {s['longest_tether']:.2f} of "
                f"{s['tether_length']:g} m, {s['visited']} of {s['waypoints']} visited",
                file=sys.stderr,
            )
        if (p := found.plan) is not None:
            proven = "proven shortest" if p.result.status.value == "optimal" else "the best found"
            print(
                f"tour   {p.length:.2f} m, {proven} of those along {p.legs} legs between "
                f"{p.states} ways that the tether can hang",
                file=sys.stderr,
            )
        if kept:
            messages.note("no better order was found")
    placed = scene_file
    if args.output is not None and not Path(scene_file).is_absolute():
        there = Path(args.mission).parent / scene_file
        placed = os.path.relpath(there, Path(args.output).parent)
    full = found.mission.model_copy(update={"scene": placed, "camera": mission.camera})
    text = json.dumps(full.model_dump(mode="json", exclude_none=True), indent=1) + "\n"
    if args.output is None:
        sys.stdout.write(text)
    else:
        write_text(args.output, text)
    return 0
