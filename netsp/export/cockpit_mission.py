"""Mission files of Blue Robotics' Cockpit (.cmp), as its mission library imports them.

Cockpit puts home before the waypoints when it uploads them, and the cruise speed of the file after
the first one. It knows no fence. A waypoint has its place; the commands that are carried out there
take their place from it.
"""

from __future__ import annotations

import json
import math
import uuid
from collections.abc import Sequence
from typing import Any

from netsp.export.waypoints import Waypoint
from netsp.site.projection import Projection

NAMESPACE = uuid.UUID("bf7570c1-32a1-54d7-ba10-af9107bb67c8")
"""Namespace of the ids of waypoints: the same mission has the same ids."""

MAP_PIXELS = 600.0
"""Width of a map, pixels, that all waypoints are to be on when it is opened."""

EARTH_PIXEL_M = 156_543.0
"""Size of a pixel of a web map at zoom 0 at the equator, metres."""

MIN_ZOOM, MAX_ZOOM = 2, 19
"""Zooms that map tiles have."""


def cockpit_mission(
    name: str | None, points: Sequence[Waypoint], holds: Sequence[int],
    altitudes: Sequence[float], projection: Projection, speed: float | None,
) -> str:  # fmt: skip
    """Return a mission of Cockpit as text.

    Parameters
    ----------
    name : str or None
        Name of the mission in Cockpit's library.
    points : sequence of Waypoint
        Waypoints, the start first.
    holds : sequence of int
        Seconds to hold at each.
    altitudes : sequence of float
        Altitude of each above home, metres; negative under water.
    projection : Projection
        From (x, y) to degrees.
    speed : float or None
        Cruise speed, m/s; None leaves the vehicle's own.

    Returns
    -------
    str
        JSON.
    """
    places = projection.to_earth([p.position[:2] for p in points])
    title = name or "netsp tour"
    waypoints: list[dict[str, Any]] = []
    for k, (p, hold, altitude, (lat, lon)) in enumerate(
        zip(points, holds, altitudes, places, strict=True)
    ):
        waypoints.append({
            "id": str(uuid.uuid5(NAMESPACE, f"{title} {k}")),
            "coordinates": [round(float(lat), 9), round(float(lon), 9)],
            "altitude": altitude,
            "altitudeReferenceType": "Relative to home",
            "commands": [_command("MAV_CMD_NAV_WAYPOINT", hold, 0, 0, p.heading or 0)],
        })  # fmt: skip
    if speed is not None:  # older versions do not add it themselves
        waypoints[0]["commands"].append(_command("MAV_CMD_DO_CHANGE_SPEED", 1, speed, -1, 0))
    south, west = (min(float(c[k]) for c in places) for k in (0, 1))
    north, east = (max(float(c[k]) for c in places) for k in (0, 1))
    return json.dumps(
        {
            "version": 0,
            "name": title,
            "description": "Tour of a tethered vehicle, planned by netsp: keep the order and the "
            "places, or the tether will be wrapped around something.",
            "vehicleType": "MAV_TYPE_SUBMARINE",
            "createdAt": 0,
            "updatedAt": 0,
            "settings": {
                "mapCenter": [round(0.5 * (south + north), 9), round(0.5 * (west + east), 9)],
                "zoom": _zoom(points, 0.5 * (south + north)),
                "currentWaypointAltitude": altitudes[0],
                "currentWaypointAltitudeRefType": "Relative to home",
                "defaultCruiseSpeed": 0 if speed is None else speed,
            },
            "waypoints": waypoints,
            "surveys": [],
        },
        indent=1, allow_nan=False,
    ) + "\n"  # fmt: skip


def _command(name: str, *params: float) -> dict[str, Any]:
    """Return a command that is carried out where its waypoint is."""
    numbered = {f"param{k}": value for k, value in enumerate(params, 1)}
    return {"type": "MAVLINK_NAV_COMMAND", "command": name, **numbered}


def _zoom(points: Sequence[Waypoint], latitude: float) -> int:
    """Return the largest whole zoom at which all waypoints are on the map."""
    extent = max(
        max(p.position[k] for p in points) - min(p.position[k] for p in points) for k in (0, 1)
    )
    if extent <= 0.0:
        return MAX_ZOOM
    pixel = EARTH_PIXEL_M * math.cos(math.radians(latitude))
    zoom = math.floor(math.log2(pixel * MAP_PIXELS / extent))
    return max(MIN_ZOOM, min(MAX_ZOOM, zoom))
