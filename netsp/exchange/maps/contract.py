"""Contract of docs/reference/maps.md: the kind of each feature of a map.

The first rule that matches decides: the user's `--map`, a property `kind`, the layer's name, object
classes of charts or tags of OpenStreetMap, the shape.
"""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

from netsp.base.errors import InputError
from netsp.base.validated import shown
from netsp.exchange.maps.chart_classes import chart_kind
from netsp.exchange.maps.feature import Feature
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.exchange.maps.word_tables import tags

SHAPES = {
    "base": ("Point",),
    "goal": ("Point", "MultiPoint"),
    "obstacle": (
        "Point",
        "MultiPoint",
        "Polygon",
        "MultiPolygon",
        "LineString",
        "MultiLineString",
        "GeometryCollection",
    ),
    "bounds": ("Polygon", "MultiPolygon", "LineString", "MultiLineString"),
    "path": ("LineString", "MultiLineString", "GeometryCollection"),
}
"""Shapes of each kind. Lines of bounds must be closed; open lines of obstacles need a width.

A `GeometryCollection` is a block of a drawing.
"""

KINDS = (*SHAPES, "ignore")

WORDS = {
    **dict.fromkeys(("base", "bases", "anchor", "vessel", "ship"), "base"),
    **dict.fromkeys(("goal", "goals", "target", "targets", "inspection points"), "goal"),
    **dict.fromkeys(
        (
            "obstacle",
            "obstacles",
            "structure",
            "structures",
            "pile",
            "piles",
            "pier",
            "piers",
            "quay",
            "quays",
            "breakwater",
            "breakwaters",
            "jetty",
            "jetties",
            "wall",
            "walls",
            "column",
            "columns",
            "pontoon",
            "pontoons",
            "moorings",
            "rocks",
            "wrecks",
        ),
        "obstacle",
    ),
    **dict.fromkeys(("bounds", "boundary", "basin", "workspace"), "bounds"),
    **dict.fromkeys(("path", "paths", "cables"), "path"),
    "ignore": "ignore",
}
"""Kinds by names of layers, in lower case."""


STANDING_POINTS = tags("""
    seamark:type = pile platform obstruction rock wreck mooring pylon hulk pontoon
    seamark:type = beacon_cardinal beacon_lateral beacon_isolated_danger beacon_special_purpose
    seamark:type = beacon_safe_water marine_farm production_area landmark
    man_made = piling offshore_platform mooring lighthouse beacon dolphin bollard wind_turbine
    man_made = crane
    natural = rock stone
    historic = wreck
    generator:source = wind
    seamark:landmark:category = windmotor
    mooring = dolphin pile yes commercial wall buoy
""")
"""Tags of OpenStreetMap's points that stand in the water: key to values."""

STANDING_LINES = tags("""
    man_made = pier quay breakwater groyne jetty dyke embankment pontoon mooring dolphin reef
    man_made = wharf
    natural = coastline reef cliff rock bare_rock
    waterway = dam weir lock_gate
    seamark:type = shoreline_construction pontoon obstruction mooring bridge gate
    seamark:type = floating_barrier causeway dyke wreck rock platform pile hulk marine_farm
    seamark:type = fishing_facility
    mooring = yes commercial wall private ferry cruise pile dolphin
    floating = yes
    barrier = wall fence retaining_wall boom net
    bridge = yes movable viaduct
""")
"""Tags of OpenStreetMap's lines that a tether may catch on: key to values."""

PATH_LINES = tags("""
    route = ferry
    power = cable
    communication = line cable
    man_made = pipeline
    seamark:type = cable_submarine cable_overhead pipeline_submarine ferry_route fairway
    seamark:type = navigation_line recommended_track recommended_route_centreline
    seamark:type = separation_boundary separation_line depth_contour
""")
"""Tags of OpenStreetMap's lines that a tether passes: key to values."""

WATER_AREAS = tags("""
    natural = water bay strait
    water = harbour basin lagoon river lake reservoir
    place = sea ocean
    leisure = marina
    landuse = harbour port basin
    seamark:type = harbour harbour_basin anchorage restricted_area depth_area fairway
    seamark:type = dredged_area sea_area military_area dumping_ground cable_area pipeline_area
    seamark:type = precautionary_area separation_zone
""")
"""Tags of OpenStreetMap's areas of open water: key to values."""

LAYER_SUFFIX = re.compile(r"(\s*\(#\d+\)|\.(kml|kmz|dxf|shp|gpkg|geojson|csv|tab|mif|gml|fgb))+$")
"""Endings of layers' names that do not count: numbers that GDAL adds, extensions of files."""

RADIUS = ("radius_m", "radius")
WIDTH = ("width_m", "width")
DEPTH = ("depth_m", "depth")
NAME = ("name", "objnam", "label")

FIELDS = {
    "name": NAME,
    "radius": RADIUS,
    "width": WIDTH,
    "depth": DEPTH,
    "tether_length": ("tether_length",),
    "clearance": ("clearance",),
    "heading": ("heading",),
}
"""Properties of the contract with their names in files; `--map` adds other names."""


def parse_mappings(maps: Sequence[tuple[str, str]]) -> tuple[dict[str, str], dict[str, str]]:
    """Return the kinds of layers and the names of properties that the user states.

    Parameters
    ----------
    maps : sequence of (str, str)
        Pairs such as ``("obstacle", "TURBINES")`` or ``("name", "TURB_ID")``.

    Returns
    -------
    kinds : dict
        Layers, in lower case, with their kinds.
    fields : dict
        Properties of the contract with their names in the file, in lower case.

    Raises
    ------
    InputError
        The first of a pair is neither a kind nor a property.
    """
    kinds: dict[str, str] = {}
    fields: dict[str, str] = {}
    for ours, theirs in maps:
        if ours in KINDS:
            kinds[theirs.lower()] = ours
        elif ours in FIELDS:
            fields[ours] = theirs.lower()
        else:
            raise InputError(
                f"--map: expected one of {', '.join((*KINDS, *FIELDS))} before the =, got {ours!r}"
            )
    return kinds, fields


SHAPE_LAYERS = {"points": "Point", "lines": "Line", "polygons": "Polygon"}
"""Words of ``--map`` for all features of a shape, unless a layer has that name."""


@dataclass(frozen=True)
class Decision:
    """Kind of a feature, and the reason if it is left out.

    Attributes
    ----------
    kind
        One of `KINDS`; ``ignore`` for a feature that is left out.
    """

    kind: str
    reason: str = ""


def kind_of(
    feature: Feature,
    kinds: Mapping[str, str],
    *,
    is_chart: bool,
    layers: Container[str] = (),
    policy: ImportPolicy = DEFAULT_IMPORT,
) -> Decision:
    """Return the kind of a feature.

    Parameters
    ----------
    kinds : mapping
        Kinds that the user states, by layer or word of `SHAPE_LAYERS`, in lower case.
    is_chart : bool
        Whether the map is an S-57 chart, whose object classes decide.
    layers : container of str
        Names of the map's layers, in lower case; a word of `SHAPE_LAYERS` among them is a layer.

    Returns
    -------
    Decision
        Kind or reason. An open line may be an obstacle; it needs a width.

    Raises
    ------
    InputError
        No kind fits, or a feature of this kind cannot have its shape.
    """
    decision = _decision(feature, kinds, is_chart=is_chart, layers=layers, policy=policy)
    kind, shape = decision.kind, feature.shape.geom_type
    if kind == "ignore":
        return decision
    if kind not in KINDS:
        raise InputError(
            f"{feature.where}: expected a kind of {', '.join(KINDS)}, got {shape!r} of kind "
            f"{shown(feature.get('kind'))}"
        )
    marked = shape if feature.marker is None else feature.marker.geom_type
    if shape not in SHAPES[kind] and marked not in SHAPES[kind]:
        article = "an" if kind[0] in "aeiou" else "a"
        raise InputError(
            f"{feature.where}: {article} {kind} cannot be a {shape}; expected "
            f"{' or '.join(SHAPES[kind])}"
        )
    return Decision(kind)


def _decision(
    feature: Feature,
    kinds: Mapping[str, str],
    *,
    is_chart: bool,
    layers: Container[str],
    policy: ImportPolicy,
) -> Decision:
    """Return the decision of the first rule that matches, which may name an unknown kind."""
    shape = feature.shape.geom_type
    stated = feature.get("kind")
    names = [name.strip().lower() for name in (feature.layer, *feature.folders)]
    by_layer = next((kinds[name] for name in names if name in kinds), None)
    if by_layer is not None:
        return Decision(by_layer, "as asked for")
    for word, part in SHAPE_LAYERS.items():
        if word in kinds and word not in layers and part in shape:
            return Decision(kinds[word], "as asked for")
    if stated is not None:
        why = str(feature.get("why") or "its kind is ignore")[: policy.max_reason_length]
        return Decision(stated if isinstance(stated, str) else "", why)
    for name in names:
        for word in words_in(name):
            if word in WORDS:
                return Decision(WORDS[word], "its layer is named ignore")
    if feature.kind:
        return Decision(feature.kind)
    if is_chart:
        charted = chart_kind(feature)
        return Decision(charted.kind, charted.reason)
    return _by_tags(feature, shape) or _by_shape(feature, shape)


def is_coastline(feature: Feature) -> bool:
    """Return whether a feature is a coastline of OpenStreetMap, which has land on its left."""
    return str(feature.get("natural")).lower() == "coastline"


def words_in(name: str) -> tuple[str, ...]:
    """Return the words of a layer's name that may state its kind, the innermost folder first.

    Parameters
    ----------
    name : str
        Name in lower case; GDAL calls a second layer ``piles (#2)``, and slashes separate folders.

    Examples
    --------
    >>> words_in("piles (#2)"), words_in("piles/north")
    (('piles',), ('piles/north', 'north', 'piles'))
    """
    whole = _bare_name(name)
    parts = [_bare_name(part) for part in whole.split("/")]
    return (whole,) if len(parts) == 1 else (whole, *reversed(parts))


def _bare_name(name: str) -> str:
    """Return a name without the number of a second layer and the extension of a file."""
    return LAYER_SUFFIX.sub("", name.strip())


def _by_tags(feature: Feature, shape: str) -> Decision | None:
    """Return the decision by tags of OpenStreetMap; None if no tag is known."""

    def has(table: Mapping[str, frozenset[str]]) -> bool:
        return any(str(feature.get(key)).lower() in values for key, values in table.items())

    if "Point" in shape:
        return Decision("obstacle") if has(STANDING_POINTS) or has(STANDING_LINES) else None
    if has(STANDING_LINES):
        return Decision("obstacle")
    if "Line" in shape:
        return Decision("path") if has(PATH_LINES) else None
    return Decision("ignore", "an area of water") if has(WATER_AREAS) else None


def _by_shape(feature: Feature, shape: str) -> Decision:
    """Return the decision by shape: points without a radius are goals, the rest obstacles."""
    if "Point" not in shape:
        return Decision("obstacle")
    return Decision("obstacle" if feature.get(*RADIUS) is not None else "goal")
