"""`netsp completion`: what a shell needs to complete commands, options and files."""

from __future__ import annotations

import argparse
from typing import Any


def _names(command: str) -> dict[str, list[str]]:
    """Return the names that options of a command take, including those of other packages."""
    from netsp.exchange.missions.mission_files import FORMATS
    from netsp.plan.random_worlds import FAMILIES
    from netsp.plan.solver_table import ROADMAPS, SOLVERS
    from netsp.world.planner import PLANNERS
    from netsp.world.tether import TETHERS
    from netsp.world.vehicle import VEHICLES

    planners = list(PLANNERS) if command == "simulate" else ["repair", "none"]
    return {
        "--solver": list(SOLVERS),
        "--solvers": list(SOLVERS),
        "--roadmap": list(ROADMAPS),
        "--roadmaps": list(ROADMAPS),
        "--format": list(FORMATS),
        "--planner": planners,
        "--compare": list(PLANNERS),
        "--vehicle": list(VEHICLES),
        "--tether-model": list(TETHERS),
        "--family": list(FAMILIES),
        "--classes": ["taut", "non-looping"],
        "--mip-backend": ["highs", "cbc"],
        "--frame": ["local", "global"],
        "--paths": ["tree", "bitstar", "rrtstar", "prmstar"],
        "--refine": ["none", "paper", "gradient"],
    }


def run(args: argparse.Namespace) -> int:
    """Print the script, and return the exit code."""
    import shtab

    from netsp.command.main import parser_of_all

    parser = parser_of_all()
    for choice in _command_actions(parser):
        choice.help = None  # what has no help in the usage is not completed
    for name, command in (
        pair for choice in _command_actions(parser) for pair in choice.choices.items()
    ):
        names = _names(name)
        for action in command._actions:
            for option in action.option_strings:
                if action.choices is None and option in names:
                    action.choices = names[option]
            takes_one = action.nargs != 0 and action.choices is None and action.type is None
            if takes_one and not hasattr(action, "complete"):
                action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(parser, args.shell))
    return 0


def _command_actions(parser: argparse.ArgumentParser) -> list[argparse._SubParsersAction[Any]]:
    """Return the actions of a parser that choose a command."""
    return [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
