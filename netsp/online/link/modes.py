"""Modes of ArduSub by number."""

from __future__ import annotations

MODES = {
    0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 7: "CIRCLE", 9: "SURFACE",
    16: "POSHOLD", 19: "MANUAL", 20: "MOTOR_DETECT", 21: "SURFTRAK",
}  # fmt: skip
"""As ArduSub numbers them in the custom mode of its heartbeat."""

ALT_HOLD, GUIDED, SURFACE, POSHOLD = 2, 4, 9, 16


def mode_name(number: int) -> str:
    """The name of a mode; its number, where it has none that we know."""
    return MODES.get(number, f"mode {number}")
