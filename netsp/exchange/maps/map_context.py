"""Values of the features of a map in the problem's plane, and messages about them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from netsp.base.columns import column
from netsp.base.errors import InputError, UnansweredError
from netsp.base.field_types import checked_number
from netsp.base.units import UNITS
from netsp.base.validated import shown
from netsp.exchange.maps.chart_classes import (
    DEPTH_AREAS,
    SOUNDINGS,
    UNSURVEYED,
    chart_radius,
    chart_width,
    sounding_depth,
)
from netsp.exchange.maps.contract import FIELDS, RADIUS, WIDTH
from netsp.exchange.maps.crop import CropWindow
from netsp.exchange.maps.feature import Feature, Map
from netsp.exchange.maps.ledger import Ledger
from netsp.exchange.maps.options import SiteOptions
from netsp.exchange.maps.projection import Projection

if TYPE_CHECKING:
    import shapely


@dataclass
class MapContext:
    """Map that becomes a problem: values of its features, their use, and what is to be said.

    Attributes
    ----------
    kinds
        Kind of each layer that the user states.
    fields
        Property that holds each of our fields, where the user states one.
    projection
        Projection around the base; None for a map in a plane, or before the base is known.
    complaints
        What is wrong, one line each, with options of the command line that help.
    notes
        Assumptions, changes and omissions, one line each.
    asks
        Names of what the user is to be asked for.
    window
        Reach of the tether that the map is cropped to; None for the whole map.
    """

    file: str | Path
    map: Map
    options: SiteOptions
    kinds: dict[str, str]
    fields: dict[str, str]
    projection: Projection | None
    complaints: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    asks: list[str] = field(default_factory=list)
    window: CropWindow | None = None

    def __post_init__(self) -> None:
        self.is_chart, self.policy = self.map.is_chart, self.options.policy
        for name, value in (
            ("draught", self.options.draught),
            ("floor", self.options.floor or None),
        ):
            if value is not None and not self.is_chart:
                raise InputError(
                    f"{name}: expected a chart (S-57, .000), whose depths are known, got "
                    f"{self.file}"
                )
        self.ledger = Ledger(self.map.layers)

    @property
    def unit(self) -> float:
        """Metres per unit of the file; the unit of the options overrides the file's."""
        if self.is_chart:  # its reader converts lengths
            return 1.0
        return UNITS[self.options.units] if self.options.units else self.map.metres or 1.0

    def plane(self, shape: shapely.Geometry) -> Any:
        """Return a shape in metres in the problem's plane."""
        import shapely

        flat = shapely.force_2d(shape)
        if not self.map.is_geographic:
            return shapely.transform(flat, lambda c: c * self.unit)
        projection = self.projection
        assert projection is not None
        return shapely.transform(flat, lambda c: projection.to_plane(c[:, ::-1]))

    def place(self, point: Any, feature: Feature) -> tuple[float, float, float]:
        """Return a point of a feature in the problem's plane, with its height."""
        place = self.plane(point)
        return (float(place.x), float(place.y), self.height(feature, point))

    def height(self, feature: Feature, point: Any = None) -> float:
        """Return z in metres, of a depth or else of the point itself.

        The height of a point on the earth is in metres by its format.
        """
        depth = self._depth(feature)
        place = point if point is not None else feature.shape
        if depth is not None:
            if depth < 0.0:
                self.complain(
                    f"{self.called(feature)}: depth: counts downwards; expected 0 or more, got "
                    f"{depth:g} m; if it is a height, give it as the z of the point"
                )
            self._note_other_height(feature, place, depth)
            return 0.0 - depth
        if feature.is_above_floor:
            self.complain(
                f"{self.called(feature)}: its height counts from the sea floor, which the map "
                "does not have; expected a height above the water, or a depth"
            )
            return 0.0
        if place.geom_type != "Point" or not place.has_z or place.z != place.z:
            self._note_unread(
                feature,
                [name for name in feature.properties if _is_height(str(name))],
                "expected a depth (downwards), or the height as z of the point",
            )
            return 0.0
        return float(place.z) * (1.0 if self.map.is_geographic else self.unit)

    def _depth(self, feature: Feature) -> float | None:
        """Return the depth in metres that a property of a feature states; None without one."""
        for name in [] if "depth" in self.fields else feature.properties:
            if not str(name).lower().startswith("depth"):
                continue
            try:
                meaning = column(str(name))
            except InputError as error:
                self.complain(f"{feature.where}: {error}")
                return None
            if meaning is not None and meaning.quantity == "z" and meaning.unit:
                value = self.number(feature, "depth", str(name).lower())
                return None if value is None else -meaning.factor * value
        depth = self.number(feature, "depth")
        if depth is None and self.is_chart:
            return sounding_depth(feature)
        return None if depth is None else depth * self.unit

    def _get(self, feature: Feature, ours: str) -> Any:
        mapped = self.fields.get(ours)
        return feature.get(mapped) if mapped is not None else feature.get(*FIELDS[ours])

    def number(self, feature: Feature, ours: str, name: str | None = None) -> float | None:
        """Return the number that a property of a feature states; None without one."""
        value = self._get(feature, ours) if name is None else feature.get(name)
        if value is None:
            return None
        if isinstance(value, str):  # KML and tables hold text
            try:
                value = float(value)
            except ValueError:
                self.complain(f"{feature.where}: {ours}: expected a number, got {shown(value)}")
                return None
        try:
            return float(checked_number(value))
        except ValueError as error:
            self.complain(f"{feature.where}: {ours}: {error}")
            return None

    def length(self, base: Feature | None, ours: str, given: float | None) -> float | None:
        """Return the given length, or else that of a property of the base, m; None without one."""
        if given is not None or base is None:
            return given
        value = self.number(base, ours)
        return None if value is None else value * self.unit

    def name(self, feature: Feature) -> str | None:
        """Return the name of a feature, or None."""
        value = self._get(feature, "name")
        if value is not None:
            return str(value).strip()
        return feature.identity.strip() or None

    def called(self, feature: Feature) -> str:
        """Return the place of a feature in the file, with its name, for messages."""
        label = self.name(feature)
        return feature.where + (f" ({label})" if label else "")

    def radius(self, feature: Feature) -> float | None:
        """Return the radius of a feature in metres; None without one."""
        metres = "radius" not in self.fields and feature.get(RADIUS[0]) is not None
        radius = self.number(feature, "radius")
        if radius is not None:
            return radius * (1.0 if metres else self.unit)
        self._note_unread(
            feature,
            [n for n in feature.properties if str(n).lower().startswith(("radius", "diameter"))],
            "expected radius_m, in metres",
        )
        charted = chart_radius(feature) if self.is_chart else None
        return charted if charted is not None else self.options.radius

    def width(self, feature: Feature) -> float | None:
        """Return the width of a line in metres; None without one."""
        width = self.number(feature, "width")
        if width is None and self.is_chart:
            width = chart_width(feature)
        if width is None:
            return self.options.line_width
        if not width > 0.0:
            self.complain(f"{feature.where}: width_m: expected a positive width, got {width:g}")
        metres = "width" not in self.fields and feature.get(WIDTH[0]) is not None
        return abs(width) * (1.0 if metres else self.unit) or None

    def _note_other_height(self, feature: Feature, point: Any, depth: float) -> None:
        """Add a note if the depth of a feature is used and its point has another height."""
        if self.is_chart or point.geom_type != "Point" or not point.has_z:
            return
        z = float(point.z) * (1.0 if self.map.is_geographic else self.unit)
        # files write 0 where they have no height
        if z and abs(z + depth) > self.policy.max_height_gap:
            self.notes.append(
                f"{self.called(feature)}: its depth of {depth:g} m is taken, and its height of "
                f"{z:g} m is not"
            )

    def _note_unread(self, feature: Feature, names: list[Any], expected: str) -> None:
        """Add one note a layer on properties that look like a height or a size and are not read."""
        for name in names:
            if self.is_chart or feature.properties[name] is None:
                continue
            layer = f"layer {feature.layer!r}: " if feature.layer else ""
            note = f"{layer}property {str(name)!r} is not read: {expected}"
            if note not in self.notes:
                self.notes.append(note)

    def is_shallow(self, feature: Feature) -> bool:
        """Return whether a feature is water that is an obstacle only because of its depth."""
        return self.is_chart and feature.layer.upper() in (*DEPTH_AREAS, UNSURVEYED, SOUNDINGS)

    @property
    def beyond_reach(self) -> str:
        """Reason to leave out features beyond the window."""
        assert self.window is not None
        about = "the base and the candidates" if self.options.candidates is not None else "the base"
        return f"beyond the reach of the tether ({length_text(self.window.radius)} about {about})"

    def is_beyond(self, shape: shapely.Geometry, grown: float) -> bool:
        """Return whether a shape, grown by a length, lies outside of the window."""
        return self.window is not None and self.window.is_beyond(shape, grown)

    def complain(self, text: str, option: str = "", ask: str | None = None) -> None:
        """Add a complaint; options of the command line that help stand apart."""
        self.complaints.append((f"{self.file}: {text.removeprefix(f'{self.file}: ')}", option))
        if ask is not None:
            self.asks.append(ask)

    def refused(self) -> InputError:
        """Return the error with all complaints."""
        whole = [text + option for text, option in self.complaints]
        return UnansweredError(whole, [text for text, _ in self.complaints], self.asks)

    def origin(self) -> dict[str, Any]:
        """Return the field `origin` of a problem on the earth; no field for others."""
        p = self.projection
        if p is None:
            return {}
        return {"origin": {"latitude": p.latitude, "longitude": p.longitude, "heading": p.heading}}


def _is_height(name: str) -> bool:
    """Return whether the name of a property means a height."""
    try:
        meaning = column(name)
    except InputError:
        return False
    return meaning is not None and meaning.quantity == "z"


def area_of(obstacle: dict[str, Any]) -> shapely.Geometry:
    """Return an obstacle of a problem file as an area."""
    import shapely

    if "radius" in obstacle:
        return shapely.Point(obstacle["center"]).buffer(obstacle["radius"])
    return shapely.Polygon(obstacle["polygon"])


def first_of(places: list[str]) -> str:
    """Return the first of some names and how many more there are."""
    return places[0] + (f" and {len(places) - 1} more" if len(places) > 1 else "")


def label(entry: dict[str, Any]) -> str:
    """Return the place of a goal or obstacle in the file, with its name, for messages."""
    return str(entry["where"]) + (f" ({entry['name']})" if entry["name"] else "")


def length_text(length: float) -> str:
    """Return a length in metres or kilometres, for messages."""
    return f"{length / 1e3:.4g} km" if length >= 1e4 else f"{length:.4g} m"
