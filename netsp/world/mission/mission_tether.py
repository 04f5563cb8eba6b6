"""Tether models of missions: taut, or held by the friction that a mission states."""

from __future__ import annotations

from dataclasses import replace

from netsp.world.mission.mission import Mission
from netsp.world.scene.field import DistanceField
from netsp.world.tether.geodesic import GeodesicTether
from netsp.world.tether.tether_bracket import BracketPolicy, HoldingTether


def mission_tether(
    mission: Mission, field: DistanceField, delta_ratio: float = 1.0
) -> GeodesicTether:
    """Return the tether model of a mission.

    If the mission states the friction of its tether, the model gives the length that the tether has
    at most where friction may hold it (`netsp.world.tether.tether_bracket.HoldingTether`).
    Otherwise the tether is taut.

    Parameters
    ----------
    mission : Mission
        The mission.
    field : DistanceField
        Distance field of its scene.
    delta_ratio : float
        Ratio of the resolution to that of the mission.

    Examples
    --------
    >>> from netsp.world import Scene
    >>> field = Scene(solids=[{"sphere": {"center": [0, 0, 0], "radius": 1}}]).field()
    >>> given = {"scene": "-", "anchor": (3, 0, 0), "start": (3, 1, 0), "waypoints": [(0, 3, 0)]}
    >>> slides = Mission(tether_length=9, **given)
    >>> holds = Mission(tether_length=9, tether={"friction": 0.3}, **given)
    >>> [type(mission_tether(m, field)).__name__ for m in (slides, holds)]
    ['GeodesicTether', 'HoldingTether']
    """
    delta, friction = delta_ratio * mission.delta, mission.tether.friction
    if friction == 0.0:
        return GeodesicTether(field, delta)
    policy = BracketPolicy()
    policy = replace(policy, hold_friction=friction, n_frictions=policy.n_planned_frictions)
    return HoldingTether(field, delta, bracket=policy)
