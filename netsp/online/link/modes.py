"""Modes of ArduSub by number."""

from __future__ import annotations

from enum import IntEnum


class Mode(IntEnum):
    """Mode of ArduSub by its number in the custom mode of heartbeats."""

    STABILIZE = 0
    ACRO = 1
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    CIRCLE = 7
    SURFACE = 9
    POSHOLD = 16
    MANUAL = 19
    MOTOR_DETECT = 20
    SURFTRAK = 21


def mode_name(number: int) -> str:
    """Return the name of a mode, or its number if it is unknown."""
    try:
        return Mode(number).name
    except ValueError:
        return f"mode {number}"
