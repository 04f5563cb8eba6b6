"""Flags on the vehicle's position and the current, and the warning of a clearance that is too small
for them."""

from __future__ import annotations

import argparse

from netsp.command import messages
from netsp.command.types import length


def clearance_flags(p: argparse.ArgumentParser) -> None:
    """Add the flags to a command."""
    p.add_argument(
        "--position-error", type=length, default=0.0, metavar="M",
        help="error of the vehicle's position (m): the clearance should be larger; default 0",
    )  # fmt: skip
    p.add_argument(
        "--current", type=length, default=0.0, metavar="V",
        help="speed of the current (m/s), which takes the vehicle off its path; default 0",
    )  # fmt: skip


def warn_of_clearance(
    position_error: float, current: float, clearance: float, units: str, has_obstacles: bool
) -> None:
    """Warn if the clearance of a plan is too small to be flown."""
    from netsp.sizing.clearance_advice import ClearancePolicy, clearance_advice

    policy = ClearancePolicy(position_error=position_error, current=current)
    text = clearance_advice(clearance, units, policy) if has_obstacles else None
    if text is not None:
        messages.warning(text)
