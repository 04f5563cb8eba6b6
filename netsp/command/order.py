"""`netsp order`: another name of `netsp solve` for missions."""

from __future__ import annotations

import argparse

from netsp.base.errors import InputError
from netsp.command import solve_mission


def run(args: argparse.Namespace) -> int:
    """Plan, write the mission, and return the exit code."""
    from netsp.base.files import is_mission_file, read_text

    if not is_mission_file(args.problem):
        read_text(args.problem)
        raise InputError(
            f"{args.problem}: is not a mission; expected one, or netsp solve for problems"
        )
    return solve_mission.run(args)
