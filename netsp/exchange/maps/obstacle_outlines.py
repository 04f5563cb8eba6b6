"""Obstacles of the features of a map: outlines, joined lines, and points with a radius."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from netsp.base import progress
from netsp.base.errors import counted
from netsp.base.geometry.polygons import union
from netsp.exchange.maps.contract import is_coastline
from netsp.exchange.maps.crop import cropped
from netsp.exchange.maps.drawn_shapes import outline_of, simple_polygons, spurs_of
from netsp.exchange.maps.feature import Feature
from netsp.exchange.maps.line_work import is_land, lines_of, outlines, widened
from netsp.exchange.maps.map_context import MapContext, first_of, length_text
from netsp.model.import_record import MAX_NAMED, CropCircle

if TYPE_CHECKING:
    import shapely


@dataclass
class ObstacleOutlines:
    """Obstacles of the features of a map, cropped to the reach of the tether.

    Attributes
    ----------
    free
        Places that must stay free: holes around them are cut open.
    beyond
        Features that lie beyond the window, by their places.
    cut_off
        Places of the features that the window cuts.
    cropped
        Circle of the window, if it leaves out or cuts an obstacle.
    joined
        Features of each joined outline, by the place of the one that names it.
    drawn
        Open lines by layer, each with its feature.
    pointlike
        Points without a radius.
    """

    context: MapContext
    free: Sequence[Any]
    beyond: dict[str, Feature] = field(default_factory=dict)
    cut_off: set[str] = field(default_factory=set)
    cropped: CropCircle | None = None
    joined: dict[str, list[Feature]] = field(default_factory=dict)
    drawn: dict[str, list[tuple[Feature, shapely.LineString]]] = field(default_factory=dict)
    pointlike: list[Feature] = field(default_factory=list)

    def __post_init__(self) -> None:
        import shapely

        self._spots = shapely.MultiPoint([place[:2] for place in self.free])

    def obstacles(self, features: list[Feature]) -> list[dict[str, Any]]:
        """Return the obstacles of features within the reach of the tether."""
        out: list[dict[str, Any]] = []
        for feature in progress.track(features):
            for shape in _blocks_of(feature.shape):
                out += self._obstacle(feature, shape)
        self._complain_of_points()
        for pieces in self.drawn.values():
            out += self._line_work(pieces)
        return self._within_crop(self._named(out))

    def _obstacle(self, feature: Feature, shape: shapely.Geometry) -> list[dict[str, Any]]:
        """Return the obstacles of a shape; defer open lines and points without a radius."""
        if "Point" in shape.geom_type:
            return self._circles(feature, shape)
        plane = self.context.plane(shape)
        if "Line" not in shape.geom_type:
            return self._areas(feature, plane)
        lines = lines_of(plane)
        if not lines:
            self.context.complain(
                f"{self.context.called(feature)}: is a line without length; expected two places"
            )
        out: list[dict[str, Any]] = []
        for line in lines:
            if line.is_closed and not (is_coastline(feature) and not is_land(line)):
                out += self._areas(feature, self._with_rim(line, [(feature, line)]))
            else:
                self.drawn.setdefault(feature.layer, []).append((feature, line))
        return out

    def _circles(self, feature: Feature, points: shapely.Geometry) -> list[dict[str, Any]]:
        """Return the circles of points; defer points without a radius."""
        radius = self.context.radius(feature)
        if self.context.is_beyond(self.context.plane(points), radius or 0.0):
            self.beyond[feature.where] = feature
            return []
        if radius is None:
            self.pointlike.append(feature)
            return []
        places = [self.context.plane(point) for point in getattr(points, "geoms", [points])]
        return [{"feature": feature, "center": (p.x, p.y), "radius": radius} for p in places]

    def _areas(self, feature: Feature, shape: shapely.Geometry) -> list[dict[str, Any]]:
        """Return the obstacles of an area; parts without an area become lines.

        Holes in which a place must stay free are cut open.
        """
        context = self.context
        if context.window is not None:
            if context.window.is_beyond(shape):
                self.beyond[feature.where] = feature
                return []
            if "Polygon" in shape.geom_type:
                shape, is_cut = context.window.cut(shape)
                if is_cut:
                    self.cut_off.add(feature.where)
                if shape.is_empty:
                    self.beyond[feature.where] = feature
                    return []
        polygons, notes = simple_polygons(shape, lambda p: p.intersects(self._spots))
        context.notes += [f"{context.called(feature)}: {note}" for note in notes]
        walls = spurs_of(shape, polygons, context.options.join_tolerance)
        self.drawn.setdefault(feature.layer, []).extend((feature, wall) for wall in walls)
        if not polygons and not walls:
            context.complain(
                f"{context.called(feature)}: encloses nothing; expected a polygon with an area"
            )
        return [
            {"feature": feature, **outline_of(polygon, context.policy.outlines)}
            for polygon in polygons
        ]

    def _line_work(self, pieces: list[tuple[Feature, shapely.LineString]]) -> list[dict[str, Any]]:
        """Return the obstacles of a layer's open lines: joined outlines, and lines with a width."""
        out: list[dict[str, Any]] = []
        areas, rest = outlines([line for _, line in pieces], self.context.options.join_tolerance)
        for polygon, members in areas:
            features = [pieces[k][0] for k in members]
            coast = all(map(is_coastline, features))
            if coast and not any(is_land(pieces[k][1], polygon) for k in members):
                rest += members  # a shore around water is a wall
                continue
            named = next((f for f in features if self.context.name(f) is not None), features[0])
            found = self._areas(named, self._with_rim(polygon, [pieces[k] for k in members]))
            self.joined.setdefault(named.where, []).extend(features)
            if found:
                self._note_names(features)
            out += found
        return out + self._walls([pieces[k] for k in rest])

    def _note_names(self, features: list[Feature]) -> None:
        """Add a note if lines with several names are joined to one outline."""
        found = (self.context.name(feature) for feature in features)
        names = list(dict.fromkeys(name for name in found if name is not None))
        if len(names) > 1:
            self.context.notes.append(
                f"{first_of([f.where for f in features])}: lines joined to one outline, named "
                f"{names[0]!r}; their other names: {', '.join(map(repr, names[1:MAX_NAMED]))}"
                + (", …" if len(names) > MAX_NAMED else "")
            )

    def _walls(self, pieces: list[tuple[Feature, shapely.LineString]]) -> list[dict[str, Any]]:
        """Return the obstacles of lines with a width; complain of the other lines."""
        out: list[dict[str, Any]] = []
        narrow: list[Feature] = []
        for feature, line in pieces:
            width = self.context.width(feature)
            if self.context.is_beyond(line, width or 0.0):
                self.beyond[feature.where] = feature
            elif width is None:
                narrow.append(feature)
            else:
                out += self._areas(feature, widened(line, width, self.context.policy.outlines))
        if narrow:
            layer = narrow[0].layer
            places = list(dict.fromkeys(f.where for f in narrow))
            called = f"layer {layer!r}: " if layer else ""
            pick = layer or "lines"
            self.context.complain(
                f"{called}{counted(len(narrow), 'open line')} ({first_of(places)}); expected a "
                "width for them",
                f" (--line-width W), or --map path={pick} or --map ignore={pick} to leave them out",
                "line_width",
            )
        return out

    def _with_rim(
        self, outline: shapely.Geometry, pieces: list[tuple[Feature, shapely.LineString]]
    ) -> shapely.Geometry:
        """Return an outline together with the area of its lines that state a width."""
        import shapely

        rims = [
            widened(line, width, self.context.policy.outlines)
            for feature, line in pieces
            if self.context.number(feature, "width") is not None
            and (width := self.context.width(feature))
        ]
        if not rims:
            return outline
        inner = shapely.Polygon(outline.coords) if "Line" in outline.geom_type else outline
        return union([*shapely.get_parts(shapely.make_valid(inner)), *rims])

    def _named(self, entries: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Return obstacles named after their features, numbered if a feature has several."""
        size = Counter(entry["feature"].where for entry in entries)
        number: Counter[str] = Counter()
        out = []
        for entry in entries:
            feature = entry["feature"]
            number[feature.where] += 1
            name = self.context.name(feature)
            if name is not None and size[feature.where] > 1:
                name = f"{name} {number[feature.where]}"
            out.append({"name": name, **entry, "where": feature.where})
        return out

    def _within_crop(self, obstacles: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Return the obstacles within the reach of the tether; the others go to the ledger."""
        if self.context.window is None:
            return obstacles
        kept, dropped, cut_off = cropped(obstacles, self.context.window)
        self.beyond |= {obstacle["where"]: obstacle["feature"] for obstacle in (*dropped, *cut_off)}
        self.cut_off |= {obstacle["where"] for obstacle in cut_off}
        if not self.beyond and not self.cut_off:
            return kept
        self.cropped = CropCircle(
            center=self.context.window.center, radius=self.context.window.radius
        )
        staying = {obstacle["where"] for obstacle in kept}
        for where, feature in self.beyond.items():
            if where not in staying:
                for piece in (feature, *self.joined.get(where, ())):
                    if piece.where not in staying:
                        self.context.ledger.leave_out(piece, self.context.beyond_reach)
        # some parts of a feature may lie beyond while others stay
        if cut_count := len((self.cut_off | set(self.beyond)) & staying):
            self.context.notes.append(
                f"{counted(cut_count, 'obstacle')} cut off where the reach of the tether ends "
                f"({length_text(self.context.window.radius)})"
            )
        return kept

    def _complain_of_points(self) -> None:
        """Complain of points without a radius, one line a layer."""
        by_layer: dict[str, list[str]] = {}
        for feature in self.pointlike:
            by_layer.setdefault(feature.layer, []).append(feature.where)
        for layer, places in by_layer.items():
            description = "an obstacle" if len(places) == 1 else "obstacles"
            ignore = f", or --map ignore={layer} to leave them out" if layer else ""
            self.context.complain(
                f"{first_of(places)}: {description} without radius_m; expected one, or a radius "
                "for all that have none",
                f" (--radius R){ignore}",
                "radius",
            )


def _blocks_of(shape: shapely.Geometry) -> list[shapely.Geometry]:
    """Return the shapes of a block of a drawing, or the shape alone."""
    return list(shape.geoms) if shape.geom_type == "GeometryCollection" else [shape]  # type: ignore[attr-defined]
