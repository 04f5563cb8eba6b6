"""`netsp schema`: the JSON Schemas of the file formats."""

from __future__ import annotations

import argparse
import json
import re
from typing import Any

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


SECTION = re.compile(r"\n\n((Parameters|Attributes|Raises|Examples)\n-{3,}\n|>{3} ).*", re.DOTALL)
"""Sections and examples of a docstring, which are about Python."""


def schema_of(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a format, whose descriptions say nothing about Python."""
    from netsp.base.registry import load

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {
                key: SECTION.sub("", v) if key == "description" and isinstance(v, str) else plain(v)
                for key, v in value.items()
            }
        return [plain(v) for v in value] if isinstance(value, list) else value

    schema: dict[str, Any] = plain(load(FORMATS[name]).model_json_schema())
    return schema


def run(args: argparse.Namespace) -> int:
    """Print the schema, and return the exit code."""
    print(json.dumps(schema_of(args.format), indent=1))
    return 0
