"""Warning of a clearance that is too small for the vehicle's position error and the current."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from netsp.command import messages

if TYPE_CHECKING:
    from netsp.model.problem import Problem
    from netsp.plan.sizing.clearance_advice import ClearanceRoom


def warn_of_problem(args: argparse.Namespace, problem: Problem, margin: float) -> None:
    """Warn if the clearance of a tour is too small to be flown.

    Parameters
    ----------
    args : Namespace
        Values of `command_options.CLEARANCE`.
    problem : Problem
        The problem.
    margin : float
        Margin that the tour was planned with, which counts as clearance.
    """
    from netsp.plan.sizing.clearance_advice import clearance_room

    room = clearance_room(problem)
    if room is not None:
        warn_of_clearance(
            args.position_error, args.current, problem.clearance, problem.units, margin, room
        )


def warn_of_clearance(
    position_error: float,
    current: float,
    clearance: float,
    units: str,
    margin: float = 0.0,
    room: ClearanceRoom | None = None,
) -> None:
    """Warn if the clearance of a plan among obstacles is too small to be flown."""
    from netsp.base.units import metres_per_unit
    from netsp.plan.sizing.clearance_advice import ClearancePolicy, clearance_advice

    policy = ClearancePolicy(position_error=position_error, current=current)
    text = clearance_advice(clearance, units, policy, margin=margin, room=room)
    if text is not None:
        messages.warning(text)
    elif (position_error or current) and metres_per_unit(units) is None:
        messages.warning(
            f"units: a clearance in {units} cannot be compared with metres, so --position-error "
            "and --current have no effect; expected a unit of length such as m"
        )
