"""Which feature of a map is what: the contract of docs/sites.md.

The first that says so decides: the user (`--map`), a property `kind`, the name of the layer, the
tags and object classes of sea charts, the shape.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from netsp.errors import InputError
from netsp.models import shown
from netsp.site.feature import Feature

SHAPES = {
    "base": ("Point",),
    "goal": ("Point", "MultiPoint"),
    "obstacle": (
        "Point", "MultiPoint", "Polygon", "MultiPolygon", "LineString", "MultiLineString",
    ),
    "bounds": ("Polygon", "MultiPolygon", "LineString"),
    "path": ("LineString", "MultiLineString"),
}  # fmt: skip
"""Which shapes a kind may have; lines of obstacles and bounds are closed."""

KINDS = (*SHAPES, "ignore")

WORDS = {
    **dict.fromkeys(("base", "bases", "anchor", "vessel", "ship"), "base"),
    **dict.fromkeys(("goal", "goals", "target", "targets", "inspection points"), "goal"),
    **dict.fromkeys(("obstacle", "obstacles", "structures", "piles"), "obstacle"),
    **dict.fromkeys(("bounds", "boundary", "basin", "workspace"), "bounds"),
    **dict.fromkeys(("path", "paths", "cables"), "path"),
    "ignore": "ignore",
}
"""Names of layers, lower case."""

STANDING = {"pile", "platform", "obstruction"}
"""`seamark:type` of OpenStreetMap's points that stand in the water."""

CHART = {
    "PILPNT", "OFSPLF", "OBSTRN", "WRECKS", "UWTROC", "MORFAC", "PONTON", "LNDARE", "BUISGL",
    "FSHFAC", "HULKES", "CRANES", "SILTNK", "LNDMRK",
}  # fmt: skip
"""Object classes of S-57 (IHO S-57, appendix A) that a tether may catch on; all others of a chart
are left out."""

RADIUS = ("radius_m", "radius")
DEPTH = ("depth_m", "depth")
NAME = ("name", "objnam", "label")

FIELDS = {
    "name": NAME, "radius": RADIUS, "depth": DEPTH, "tether_length": ("tether_length",),
    "clearance": ("clearance",), "heading": ("heading",),
}  # fmt: skip
"""Properties that `--map` may take from others."""


def words_of(maps: Sequence[tuple[str, str]]) -> tuple[dict[str, str], dict[str, str]]:
    """What the user says of layers and of properties.

    Parameters
    ----------
    maps : sequence of (str, str)
        As ``("obstacle", "TURBINES")`` or ``("name", "TURB_ID")``.

    Returns
    -------
    kinds : dict
        Layer, lower case, to kind.
    fields : dict
        Our property to theirs, lower case.

    Raises
    ------
    InputError
        Neither a kind nor a property.
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


def kind_of(feature: Feature, kinds: Mapping[str, str], *, chart: bool) -> str:
    """What a feature is.

    Parameters
    ----------
    feature : Feature
        The feature.
    kinds : mapping
        Layer, lower case, to kind, as the user says.
    chart : bool
        Whether the map is an S-57 chart, of which only known object classes count.

    Returns
    -------
    str
        One of `KINDS`.

    Raises
    ------
    InputError
        No kind fits, or one that cannot have its shape.
    """
    shape = feature.shape.geom_type
    said = feature.get("kind")
    if feature.layer.lower() in kinds:
        kind = kinds[feature.layer.lower()]
    elif said is not None:
        kind = said if isinstance(said, str) else ""
    elif feature.layer.lower() in WORDS:
        kind = WORDS[feature.layer.lower()]
    elif chart:
        kind = "obstacle" if feature.layer in CHART else "ignore"
        if kind == "obstacle" and shape not in SHAPES[kind]:
            kind = "ignore"
    else:
        kind = _by_shape(feature, shape)
    if kind == "ignore":
        return kind
    if kind not in KINDS:
        raise InputError(
            f"{feature.where}: expected a kind of {', '.join(KINDS)}, got {shape!r} of kind "
            f"{shown(said)}"
        )
    if shape not in SHAPES[kind]:
        article = "an" if kind[0] in "aeiou" else "a"
        raise InputError(
            f"{feature.where}: {article} {kind} cannot be a {shape}; expected "
            f"{' or '.join(SHAPES[kind])}"
        )
    if kind in ("obstacle", "bounds") and "Line" in shape and not feature.shape.is_closed:
        if said is None and kind == "obstacle" and feature.layer.lower() in WORDS:
            return "ignore"
        raise InputError(
            f"{feature.where}: a {shape} of kind {kind} that is not closed; expected a closed line "
            "or a polygon"
        )
    return kind


def _by_shape(feature: Feature, shape: str) -> str:
    """Polygons are obstacles, points goals unless they have a radius or a tag of what stands in the
    water, lines paths."""
    if "Polygon" in shape:
        return "obstacle"
    if "Line" in shape:
        return "path"
    standing = (
        feature.get(*RADIUS) is not None
        or str(feature.get("seamark:type")) in STANDING
        or feature.get("seamark:landmark:category") == "windmotor"
    )
    return "obstacle" if standing else "goal"
