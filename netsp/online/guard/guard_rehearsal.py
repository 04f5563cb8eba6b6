"""Rehearsal: a guard watches an example vehicle before the real one.

On a new machine, kernels of a guard are compiled at their first use, some of them only when the
tether touches something. Without the rehearsal, fixes and alarms would wait meanwhile.
"""

from __future__ import annotations

from contextlib import suppress
from functools import cache

import numpy as np

from netsp.base.compiled.compile_policy import compiles, everything_compiled
from netsp.base.errors import InputError
from netsp.model.problem import Problem
from netsp.online.guard.site import Site
from netsp.online.guard.space_site import SpaceSite
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene

_PLANE = {
    "schema_version": 1,
    "base": [0, 0],
    "goals": [[4, 1]],
    "tether_length": 14,
    "obstacles": [
        {"name": "pile", "center": [2, 0], "radius": 0.5},
        {"polygon": [[5, 2], [6, 2], [6, 3], [5, 3]]},
        *({"center": [x, 9], "radius": 0.3} for x in range(-3, 6)),
    ],
}
"""Problem with enough obstacles that they are looked up by place."""

_SCENE = {
    "schema_version": 1,
    "name": "rehearsal",
    "solids": [
        {"name": "pile", "capsule": {"a": [2, 0, -5], "b": [2, 0, 1], "radius": 0.5}},
        {"box": {"center": [5, 3, -1], "size": [1, 1, 1]}},
    ],
}

_MISSION = {
    "schema_version": 1,
    "scene": "-",
    "anchor": [0, 0, 0],
    "start": [0.1, 0, 0],
    "tether_length": 14,
    "waypoints": [[3, 1, -1]],
}


@cache
def rehearse(in_space: bool) -> None:
    """Load everything that a guard of a problem, or of a mission, needs; compile it on a new
    machine."""
    if not compiles():
        return
    with everything_compiled():
        site: Site | Problem = Problem.model_validate(_PLANE)
        if in_space:
            site = SpaceSite(Mission.model_validate(_MISSION), Scene.model_validate(_SCENE))
        guard = Guard(site)
        angle = np.linspace(np.pi, 4.0 * np.pi, 150)
        ring = np.column_stack([2.0 + 1.9 * np.cos(angle), 1.9 * np.sin(angle), -0.01 * angle])
        for k, (x, y, z) in enumerate(ring.tolist()):
            silence = 0.0 if k < 120 else 20.0  # after the silence it is elsewhere
            guard.update(Fix(0.1 * k + silence, (x + 0.1 * silence, y, z), estimate=True))
        with suppress(InputError):  # there may be no such class
            guard.correct("south", "pile")
