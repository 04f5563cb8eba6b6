"""`netsp schema`: the JSON Schemas of the file formats."""

from __future__ import annotations

import argparse
import json

FORMATS = {
    "problem": "netsp.model.problem:Problem",
    "solution": "netsp.model.solution:Solution",
    "scene": "netsp.world.scene.scene:Scene",
    "mission": "netsp.world.mission.mission:Mission",
    "surprises": "netsp.online.execute.events:Surprises",
    "run-state": "netsp.online.execute.run_record:RunState",
    "scene-surprises": "netsp.world.simulator.surprises:SceneSurprises",
    "study": "netsp.study.compare.study:Study",
}
"""Model of each format, as `module:class`."""


def run(args: argparse.Namespace) -> int:
    """Print the schema, and return the exit code."""
    from netsp.base.registry import load

    print(json.dumps(load(FORMATS[args.format]).model_json_schema(), indent=1))
    return 0
