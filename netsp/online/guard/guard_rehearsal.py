"""A made-up vehicle, watched before there is a real one.

On a machine that never watched, everything that a guard needs is compiled at its first use, some of
it not before the tether touches something: fixes would wait meanwhile, and alarms with them.
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
    "schema_version": 1, "base": [0, 0], "goals": [[4, 1]], "tether_length": 14,
    "obstacles": [
        {"name": "pile", "center": [2, 0], "radius": 0.5},
        {"polygon": [[5, 2], [6, 2], [6, 3], [5, 3]]},
        *({"center": [x, 9], "radius": 0.3} for x in range(-3, 6)),
    ],
}  # fmt: skip
"""With as many obstacles as it takes to be looked up by place."""

_SCENE = {
    "schema_version": 1, "name": "rehearsal",
    "solids": [
        {"name": "pile", "capsule": {"a": [2, 0, -5], "b": [2, 0, 1], "radius": 0.5}},
        {"box": {"center": [5, 3, -1], "size": [1, 1, 1]}},
    ],
}  # fmt: skip

_MISSION = {
    "schema_version": 1, "scene": "-", "anchor": [0, 0, 0], "start": [0.1, 0, 0],
    "tether_length": 14, "waypoints": [[3, 1, -1]],
}  # fmt: skip


@cache
def rehearse(in_space: bool) -> None:
    """Have everything loaded that a guard needs, and compiled on a machine that never watched.

    Parameters
    ----------
    in_space : bool
        Whether the site is a mission's.
    """
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
            after = 0.0 if k < 120 else 20.0  # it is silent for a while, and elsewhere then
            guard.take(Fix(0.1 * k + after, (x + 0.1 * after, y, z), estimate=True))
        with suppress(InputError):  # what the operator says may be impossible
            guard.correct("south", "pile")
