"""Mission files of Blue Robotics' Cockpit (.cmp), as its mission library imports them.

On upload, Cockpit adds a home item before the waypoints, and sets the file's cruise speed after the
first waypoint. It has no fences. Each waypoint has a place and a list of commands for that place.
"""

from __future__ import annotations

import json
import math
import uuid
from collections.abc import Sequence
from typing import Any

from netsp.exchange.maps.projection import Projection
from netsp.exchange.missions.export_policy import DEFAULT_EXPORT, ExportPolicy
from netsp.exchange.missions.waypoints import Waypoint

NAMESPACE = uuid.UUID("bf7570c1-32a1-54d7-ba10-af9107bb67c8")
"""Namespace of waypoint ids; exporting a mission again gives the same ids."""

DESCRIPTION = (
    "Tour of a tethered vehicle, planned by netsp: keep the order and the places, or the tether "
    "will be wrapped around something."
)

EARTH_PIXEL_M = 156_543.0
"""Format of web maps: size of a pixel at zoom 0 on the equator, metres."""

MIN_ZOOM = 2
"""Format of web maps: lowest zoom level."""

MAX_ZOOM = 19
"""Format of web maps: highest zoom level."""


def cockpit_mission(
    name: str | None,
    points: Sequence[Waypoint],
    holds: Sequence[int],
    altitudes: Sequence[float],
    projection: Projection,
    speed: float | None,
    policy: ExportPolicy = DEFAULT_EXPORT,
) -> str:
    """Return the text of a Cockpit mission file (JSON).

    Parameters
    ----------
    name : str or None
        Name of the mission in Cockpit's library; None for a default.
    points : sequence of Waypoint
        Waypoints, the start first.
    holds : sequence of int
        Hold time at each waypoint, s.
    altitudes : sequence of float
        Altitude of each waypoint above home, metres; negative under water.
    projection : Projection
        Projection from (x, y) to degrees.
    speed : float or None
        Cruise speed, m/s; None keeps the vehicle's own.
    """
    places = projection.to_earth([p.position[:2] for p in points])
    title = name or "netsp tour"
    waypoints: list[dict[str, Any]] = [
        {
            "id": str(uuid.uuid5(NAMESPACE, f"{title} {k}")),
            "coordinates": [round(float(lat), 9), round(float(lon), 9)],
            "altitude": altitude,
            "altitudeReferenceType": "Relative to home",
            "commands": [_command("MAV_CMD_NAV_WAYPOINT", hold, 0, 0, p.heading or 0)],
        }
        for k, (p, hold, altitude, (lat, lon)) in enumerate(
            zip(points, holds, altitudes, places, strict=True)
        )
    ]
    if speed is not None:  # older versions do not add it themselves
        waypoints[0]["commands"].append(_command("MAV_CMD_DO_CHANGE_SPEED", 1, speed, -1, 0))
    south, west = (min(float(c[k]) for c in places) for k in (0, 1))
    north, east = (max(float(c[k]) for c in places) for k in (0, 1))
    mission = {
        "version": 0,
        "name": title,
        "description": DESCRIPTION,
        "vehicleType": "MAV_TYPE_SUBMARINE",
        "createdAt": 0,
        "updatedAt": 0,
        "settings": {
            "mapCenter": [round(0.5 * (south + north), 9), round(0.5 * (west + east), 9)],
            "zoom": _zoom(points, 0.5 * (south + north), policy.map_pixels),
            "currentWaypointAltitude": altitudes[0],
            "currentWaypointAltitudeRefType": "Relative to home",
            "defaultCruiseSpeed": 0 if speed is None else speed,
        },
        "waypoints": waypoints,
        "surveys": [],
    }
    return json.dumps(mission, indent=1, allow_nan=False) + "\n"


def _command(name: str, *params: float) -> dict[str, Any]:
    """Return a command for the list of a waypoint."""
    numbered = {f"param{k}": value for k, value in enumerate(params, 1)}
    return {"type": "MAVLINK_NAV_COMMAND", "command": name, **numbered}


def _zoom(points: Sequence[Waypoint], latitude: float, map_pixels: float) -> int:
    """Return the largest integer zoom level at which all waypoints are on the map."""
    extent = max(
        max(p.position[k] for p in points) - min(p.position[k] for p in points) for k in (0, 1)
    )
    if extent <= 0.0:
        return MAX_ZOOM
    pixel = EARTH_PIXEL_M * math.cos(math.radians(latitude))
    zoom = math.floor(math.log2(pixel * map_pixels / extent))
    return max(MIN_ZOOM, min(MAX_ZOOM, zoom))
