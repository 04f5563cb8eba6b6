"""A problem from a map: obstacles and goals of a GeoJSON file.

Obstacles are polygons, and points with `radius_m` or with tags that sea charts give to what stands
in the water (`seamark:type` pile, platform or obstruction, `seamark:landmark:category` windmotor);
other points are goals. A `kind` property of base, goal, obstacle or path decides before all that.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from netsp.errors import InputError
from netsp.files import read_text
from netsp.models import explain, parse_json_object
from netsp.problem import Problem
from netsp.site.projection import Projection

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
    InputError
        Not GeoJSON, no base, no tether length, no goal, obstacles without radius, or what
        `Problem` refuses.
    """
    data = parse_json_object(read_text(file), str(file))
    features = data.get("features")
    if data.get("type") != "FeatureCollection" or not isinstance(features, list):
        raise InputError(f"{file}: expected a GeoJSON FeatureCollection")
    crs = data.get("crs")
    if crs is not None and "CRS84" not in json.dumps(crs) and "4326" not in json.dumps(crs):
        raise InputError(f"{file}: crs: expected WGS 84 as RFC 7946 has it, got {crs}"[:200])
    found = [_part(f, k, file) for k, f in enumerate(features)]
    parts = [p for p in found if p is not None]
    bases = [p for p in parts if p["kind"] == "base"]
    if len(bases) > 1:
        raise InputError(f"{file}: expected one base, got {len(bases)}")
    base = bases[0] if bases else None
    if projection is None:
        if base is None:
            raise InputError(
                f"{file}: has no base; expected a Point of kind base, or lat,lon given besides"
            )
        lon, lat = base["coordinates"][:2]
        projection = Projection(lat, lon)
    own = base["properties"] if base is not None else {}
    tether = tether if tether is not None else own.get("tether_length")
    if tether is None:
        raise InputError(
            f"{file}: has no tether length; expected tether_length of the base, or one besides"
        )

    def place(c: list[float]) -> tuple[float, ...]:
        ((x, y),) = projection.to_plane([[c[1], c[0]]])
        return (float(x), float(y), *(float(v) for v in c[2:3]))

    goals: list[Any] = []
    obstacles: list[Any] = []
    sources: dict[str, list[int]] = {"goals": [], "obstacles": []}
    for k, part in enumerate(found):
        if part is None:
            continue
        label = {"name": str(part["properties"]["name"])} if part["properties"].get("name") else {}
        if part["kind"] == "goal":
            goals.append({"position": place(part["coordinates"]), **label})
            sources["goals"].append(k)
        elif part["kind"] == "obstacle" and part["shape"] == "Point":
            r = part["properties"].get("radius_m", radius)
            if r is None:
                raise InputError(
                    f"{file}: features[{k}]: an obstacle without radius_m; expected one, or a "
                    "radius for all that have none"
                )
            obstacles.append({"center": place(part["coordinates"])[:2], "radius": r, **label})
            sources["obstacles"].append(k)
        elif part["kind"] == "obstacle":
            several = len(part["coordinates"]) > 1 and bool(label)
            for j, rings in enumerate(part["coordinates"], 1):
                corners = [place(c)[:2] for c in rings[0]]
                corners = [c for c, d in zip(corners, [*corners[1:], corners[0]], strict=True)
                           if not np.allclose(c, d, atol=1e-6)]  # fmt: skip
                own_label = {"name": f"{label['name']} {j}"} if several else label
                obstacles.append({"polygon": corners, **own_label})
                sources["obstacles"].append(k)
    for what, things in (("goals", goals), ("obstacles", obstacles)):
        names = [t["name"] for t in things if "name" in t]
        twice = next((n for n in names if names.count(n) > 1), None)
        if twice is not None:
            raise InputError(f"{file}: two {what} are named {twice!r}; expected names of their own")
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

        def feature(found: re.Match[str]) -> str:  # the file knows of no goals and obstacles
            return f"features[{sources[found[1]][int(found[2])]}]"

        text = re.sub(r"\b(goals|obstacles)\[(\d+)\]", feature, explain(error))
        raise InputError(f"{file}: {text}") from None


KINDS = {
    "base": ("Point",),
    "goal": ("Point",),
    "obstacle": ("Point", "Polygon", "MultiPolygon"),
    "path": ("LineString", "MultiLineString"),
}
"""Which shapes a kind may have."""


def _part(feature: Any, k: int, file: str | Path) -> dict[str, Any] | None:
    """What a feature is: kind, shape, coordinates, properties; None if it is nowhere."""
    where = f"{file}: features[{k}]"
    if not isinstance(feature, dict) or "geometry" not in feature:
        raise InputError(f"{where}: expected a feature with a geometry")
    geometry, properties = feature["geometry"], feature.get("properties") or {}
    if geometry is None:
        return None  # RFC 7946: a feature without a place
    if not isinstance(geometry, dict) or not isinstance(properties, dict):
        raise InputError(f"{where}: expected an object as geometry and as properties")
    shape, coordinates = geometry.get("type"), geometry.get("coordinates")
    standing = (
        "radius_m" in properties
        or str(properties.get("seamark:type")) in STANDING
        or properties.get("seamark:landmark:category") == "windmotor"
    )
    usual = {
        "Point": "obstacle" if standing else "goal", "Polygon": "obstacle",
        "MultiPolygon": "obstacle", "LineString": "path", "MultiLineString": "path",
    }  # fmt: skip
    kind = properties.get("kind", usual.get(str(shape)))
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(
            f"{where}: expected a {', '.join(usual)} of kind {', '.join(KINDS)}, got {shape!r} of "
            f"kind {kind!r}"
        )
    if shape not in KINDS[kind]:
        raise InputError(
            f"{where}: a {kind} cannot be a {shape}; expected {' or '.join(KINDS[kind])}"
        )
    if kind != "path":
        if shape == "Point":
            _check_place(coordinates, where)
        else:
            coordinates = [coordinates] if shape == "Polygon" else coordinates
            _check_polygons(coordinates, where)
    return {"kind": kind, "shape": shape, "coordinates": coordinates, "properties": properties}


def _check_polygons(polygons: Any, where: str) -> None:
    """InputError unless they are lists of one closed ring each."""
    if not isinstance(polygons, list) or not polygons:
        raise InputError(f"{where}: expected a polygon with an outer ring")
    for rings in polygons:
        if not isinstance(rings, list) or not rings or not isinstance(rings[0], list):
            raise InputError(f"{where}: expected a polygon with an outer ring")
        if len(rings) > 1:
            raise InputError(
                f"{where}: expected a polygon without holes, got {len(rings) - 1}; an obstacle "
                "with a pool inside must be split"
            )
        for place in rings[0]:
            _check_place(place, where)
        if len(rings[0]) < 4 or rings[0][0] != rings[0][-1]:
            raise InputError(f"{where}: expected a closed ring of four positions or more")


def _check_place(c: Any, where: str) -> None:
    """InputError unless it is a longitude, a latitude and perhaps a height."""
    good = isinstance(c, list) and len(c) >= 2 and all(
        isinstance(v, (int, float)) and not isinstance(v, bool) and -1e12 <= v <= 1e12 for v in c
    )  # fmt: skip
    if not good or abs(c[0]) > 180.0 or abs(c[1]) > 90.0:
        raise InputError(
            f"{where}: expected [longitude, latitude] within 180 and 90 degrees, got "
            f"{json.dumps(c)[:60]}"
        )
