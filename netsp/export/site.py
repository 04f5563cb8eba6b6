"""A problem from a map: obstacles and goals of a GeoJSON file.

Obstacles are polygons, and points with `radius_m` or with tags that sea charts give to what stands
in the water (`seamark:type` pile, platform or obstruction, `seamark:landmark:category` windmotor);
other points are goals. A `kind` property of base, goal, obstacle or path decides before all that.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from netsp.errors import InputError
from netsp.export.projection import Projection
from netsp.problem import Problem, explain, parse_json_object, read_text

STANDING = {"pile", "platform", "obstruction"}


def read_site(
    file: str | Path, projection: Projection | None, *, tether: float | None = None,
    clearance: float | None = None, radius: float | None = None, name: str | None = None,
) -> Problem:  # fmt: skip
    """The problem of a GeoJSON site, in metres from its base, y to the projection's heading.

    projection : about the base; None takes the file's own base, north up. tether, clearance :
    default the file's. radius : of obstacles that are points and have none.

    Raises
    ------
    InputError : not GeoJSON, no base, no tether length, no goal, obstacles without radius, or
        what `Problem` refuses.
    """
    data = parse_json_object(read_text(file), str(file))
    features = data.get("features")
    if data.get("type") != "FeatureCollection" or not isinstance(features, list):
        raise InputError(f"{file}: expected a GeoJSON FeatureCollection")
    parts = [_part(f, k, file) for k, f in enumerate(features)]
    base = next((p for p in parts if p["kind"] == "base"), None)
    if projection is None:
        if base is None:
            raise InputError(f"{file}: has no base; expected --base lat,lon")
        lon, lat = base["coordinates"][:2]
        projection = Projection(lat, lon)
    own = base["properties"] if base is not None else {}
    tether = tether if tether is not None else own.get("tether_length")
    if tether is None:
        raise InputError(f"{file}: has no tether length; expected --tether")

    def place(c: list[float]) -> tuple[float, ...]:
        ((x, y),) = projection.to_plane([[c[1], c[0]]])
        return (float(x), float(y), *(float(v) for v in c[2:3]))

    goals: list[Any] = []
    obstacles: list[Any] = []
    for k, part in enumerate(parts):
        label = {"name": str(part["properties"]["name"])} if part["properties"].get("name") else {}
        if part["kind"] == "goal":
            goals.append({"position": place(part["coordinates"]), **label})
        elif part["kind"] == "obstacle" and part["shape"] == "Point":
            r = part["properties"].get("radius_m", radius)
            if r is None:
                raise InputError(
                    f"{file}: features[{k}]: an obstacle without radius_m; expected --radius"
                )
            obstacles.append({"center": place(part["coordinates"])[:2], "radius": r, **label})
        elif part["kind"] == "obstacle":
            for rings in part["coordinates"]:
                corners = [place(c)[:2] for c in rings[0]]
                if len(corners) > 1 and np.allclose(corners[0], corners[-1], atol=1e-9):
                    corners.pop()
                obstacles.append({"polygon": corners, **label})
    if not goals:
        raise InputError(f"{file}: has no goal: a Point without radius_m")
    z = base["coordinates"][2:3] if base is not None else []
    try:
        return Problem.model_validate(
            {
                "schema_version": 1, "name": name or Path(file).stem,
                "base": (*projection.base.tolist(), *z), "goals": goals, "obstacles": obstacles,
                "tether_length": tether,
                "clearance": clearance if clearance is not None else own.get("clearance", 0.0),
            }
        )  # fmt: skip
    except ValidationError as error:
        raise InputError(f"{file}: {explain(error)}") from None


def _part(feature: Any, k: int, file: str | Path) -> dict[str, Any]:
    """What a feature is: kind, shape, coordinates, properties."""
    where = f"{file}: features[{k}]"
    geometry = feature.get("geometry") if isinstance(feature, dict) else None
    if not isinstance(geometry, dict) or "coordinates" not in geometry:
        raise InputError(f"{where}: expected a feature with a geometry")
    properties = feature.get("properties") or {}
    shape, coordinates = geometry.get("type"), geometry["coordinates"]
    kind = properties.get("kind")
    if shape in ("Polygon", "MultiPolygon"):
        coordinates = [coordinates] if shape == "Polygon" else coordinates
        kind = kind or "obstacle"
        flat = [c for rings in coordinates for ring in rings for c in ring]
    elif shape == "Point":
        standing = (
            "radius_m" in properties
            or properties.get("seamark:type") in STANDING
            or properties.get("seamark:landmark:category") == "windmotor"
        )
        kind = kind or ("obstacle" if standing else "goal")
        flat = [coordinates]
    else:
        return {"kind": "other", "shape": shape, "coordinates": [], "properties": properties}
    for c in flat:
        good = isinstance(c, list) and len(c) >= 2 and all(
            isinstance(v, (int, float)) and not isinstance(v, bool) for v in c
        )  # fmt: skip
        if not good or abs(c[0]) > 180.0 or abs(c[1]) > 90.0:
            raise InputError(
                f"{where}: expected [longitude, latitude] within 180 and 90 degrees, got "
                f"{json.dumps(c)[:60]}"
            )
    return {"kind": kind, "shape": shape, "coordinates": coordinates, "properties": properties}
