"""`netsp schema`: the JSON Schemas of the file formats."""

from __future__ import annotations

import argparse

EXAMPLE = "netsp schema problem > problem.schema.json"


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument("format", choices=("problem", "solution", "scene", "mission", "surprises"))


def run(args: argparse.Namespace) -> int:
    """Print the schema, and return the exit code."""
    import json

    if args.format == "problem":
        from netsp.problem import Problem as Model
    elif args.format == "mission":
        from netsp.online.mission import Mission as Model  # type: ignore[assignment]
    elif args.format == "surprises":
        from netsp.execute.events import Surprises as Model  # type: ignore[assignment]
    elif args.format == "scene":
        from netsp.online.scene.scene import Scene as Model  # type: ignore[assignment]
    else:
        from netsp.solution import Solution as Model  # type: ignore[assignment]
    print(json.dumps(Model.model_json_schema(), indent=1))
    return 0
