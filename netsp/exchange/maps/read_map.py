"""Import of a problem from a map, by the contract of docs/sites.md.

All complaints are collected and raised together. Every feature of the map ends in the ledger: used
as one kind, or left out for a reason.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from pydantic import ValidationError

from netsp.base import progress
from netsp.base.columns import column
from netsp.base.deprecated import renamed_parameters
from netsp.base.errors import InputError, UnansweredError, counted
from netsp.base.field_types import checked_number
from netsp.base.geometry.polygons import union
from netsp.base.units import UNITS
from netsp.base.validated import explain, shown
from netsp.exchange.maps.chart_classes import (
    DEPTH_AREAS,
    EQUIPMENT,
    SOUNDINGS,
    UNSURVEYED,
    chart_radius,
    chart_width,
    depth_range,
    lone_equipment,
    sounding_depth,
)
from netsp.exchange.maps.chart_depths import (
    chart_floor,
    depthless_share,
    shallow_areas,
    shoal_soundings,
    uncharted_share,
)
from netsp.exchange.maps.chart_reader import is_chart, read_chart
from netsp.exchange.maps.contract import (
    FIELDS,
    RADIUS,
    SHAPE_LAYERS,
    WIDTH,
    Decision,
    is_coastline,
    kind_of,
    parse_mappings,
)
from netsp.exchange.maps.crop import CropWindow, cropped
from netsp.exchange.maps.csv_table import from_table
from netsp.exchange.maps.drawing import read_dxf
from netsp.exchange.maps.drawn_shapes import outline_of, simple_polygons, spurs_of
from netsp.exchange.maps.feature import Feature, Map
from netsp.exchange.maps.fence_list import read_fence_list, read_rally_list
from netsp.exchange.maps.geojson import read_geojson, read_geojson_sequence
from netsp.exchange.maps.gpx import read_gpx_map
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.exchange.maps.kml_pages import read_kml
from netsp.exchange.maps.ledger import Ledger
from netsp.exchange.maps.line_work import is_land, lines_of, outlines, widened
from netsp.exchange.maps.options import SiteOptions
from netsp.exchange.maps.projection import Projection
from netsp.exchange.maps.qgc_plan import is_plan, read_plan
from netsp.exchange.maps.sea_floor import SeaFloor
from netsp.exchange.maps.vector import in_degrees, read_vector
from netsp.exchange.maps.waypoint_list import is_waypoint_list, read_waypoint_list
from netsp.model.import_record import KIND_COLUMNS, MAX_NAMED, CropCircle, Site, UsedAs
from netsp.model.problem import Problem

if TYPE_CHECKING:
    import shapely

SEQUENCE_SUFFIXES = (".geojsonl", ".geojsons", ".geojsonseq", ".ndjson", ".ndgeojson", ".jsonl")
"""Extensions of sequences of GeoJSON texts."""

EARTH_READERS = {
    ".plan": read_plan,
    ".waypoints": read_waypoint_list,
    ".wpl": read_waypoint_list,
    ".gpx": read_gpx_map,
    ".fen": read_fence_list,
    ".ral": read_rally_list,
}
"""Readers of formats that are always in degrees, by extension."""


@dataclass(frozen=True)
class ImportedSite:
    """Problem of a map, with what was left out of it.

    Attributes
    ----------
    problem
        The problem; its `site` records the use of every feature.
    left_out
        Shapes of the features left out, in the problem's plane, for the picture.
    notes
        Assumptions, changes and omissions, one line each.
    viewpoints
        Names of the goals that are viewpoints of obstacles.
    floor
        Sea floor, if one was asked for.
    goal_features
        Feature of each goal of the problem; None for viewpoints.
    """

    problem: Problem
    left_out: tuple[shapely.Geometry, ...]
    notes: tuple[str, ...]
    viewpoints: frozenset[str] = frozenset()
    floor: SeaFloor | None = None
    goal_features: tuple[Feature | None, ...] = ()

    def keeping(self, problem: Problem, reason: str) -> ImportedSite:
        """Return the import with fewer goals; features without a remaining goal count as left out.

        Parameters
        ----------
        problem : Problem
            The same problem with some of its goals, in their order.
        reason : str
            Reason to leave out the others.
        """
        import shapely

        kept, staying, omitted = 0, set(), {}
        shapes: list[shapely.Geometry] = []
        for goal, feature in zip(self.problem.goals, self.goal_features, strict=True):
            remaining = problem.goals[kept] if kept < len(problem.goals) else None
            if remaining is not None and (remaining.name, remaining.position[:2]) == (
                goal.name,
                goal.position[:2],
            ):
                kept += 1
                staying.add("" if feature is None else feature.where)
                continue
            shapes.append(shapely.Point(goal.position[:2]))
            if feature is not None:
                omitted[feature.where] = feature.layer
        assert problem.site is not None
        layers = tuple(
            layer.without_goals(
                [w for w in omitted if w not in staying and omitted[w] == layer.layer], reason
            )
            for layer in problem.site.imported
        )
        site = problem.site.model_copy(update={"imported": layers})
        problem = problem.model_copy(update={"site": site})
        return replace(self, problem=problem, left_out=(*self.left_out, *shapes))


def import_site(
    file: str | Path,
    projection: Projection | None = None,
    *,
    options: SiteOptions | None = None,
    name: str | None = None,
) -> ImportedSite:
    """Return the problem of a map, in metres from its base, y towards the projection's heading.

    Parameters
    ----------
    file : str or Path
        GeoJSON, GPX, .plan, .waypoints, KML, KMZ, shapefile, GeoPackage, DXF, S-57, or another
        format that GDAL reads.
    projection : Projection, optional
        Projection around the base; None for the map's own base, with y towards its heading or
        north.
    name : str, optional
        Name of the problem; default: the file's.

    Returns
    -------
    ImportedSite
        Its problem has an origin if the map has a place on the earth.

    Raises
    ------
    InputError
        The file cannot be read or is no site; `SeveralErrors` if more than one thing is wrong.
    """
    options = options or SiteOptions()
    if options.units is not None and options.units not in UNITS:
        raise InputError(f"units: expected one of {', '.join(UNITS)}, got {shown(options.units)}")
    kinds, fields = parse_mappings(options.maps)
    found = read_map(file, options.crs, options.units, options.policy)
    for layer in kinds:
        if layer not in found.layer_names and layer not in SHAPE_LAYERS:
            raise InputError(
                f"--map: {file} has no layer {layer!r}; it has "
                f"{', '.join(k or 'no layers' for k in found.layers)}"
            )
    properties = {str(name).lower() for feature in found.features for name in feature.properties}
    for ours, theirs in fields.items():
        if theirs not in properties:
            listed = sorted(properties)[: options.policy.max_listed_properties]
            raise InputError(
                f"--map: no feature of {file} has the property {theirs!r}, which is to be its "
                f"{ours}; there are {', '.join(listed) or 'none'}"
            )
    site = _Site(file, found, options, kinds, fields, projection)
    problem = site.problem(name or Path(file).stem)
    assert problem.site is not None
    notes = (*found.notes, *site.notes, *problem.site.notes)
    viewpoints = frozenset(site.viewpoints)
    return ImportedSite(
        problem, site.left_out(), notes, viewpoints, site.floor, tuple(site.goal_features)
    )


@renamed_parameters(looking="inspection")
def read_site(
    file: str | Path,
    projection: Projection | None = None,
    *,
    options: SiteOptions | None = None,
    name: str | None = None,
    on_note: Callable[[str], None] | None = None,
    **more: Any,
) -> Problem:
    """Return the problem of a map, as `import_site`; its `site` records the use of every feature.

    Parameters
    ----------
    options : SiteOptions, optional
        Options of the import; its fields may be given by name instead.
    on_note : callable, optional
        Called with assumptions, changes and omissions, one line each.
    **more
        Fields of `SiteOptions`.

    Raises
    ------
    InputError
        As `import_site`.
    """
    found = import_site(file, projection, options=options or SiteOptions(**more), name=name)
    if on_note is not None:
        for note in found.notes:
            on_note(f"{file}: {note}")
    return found.problem


def read_map(
    file: str | Path,
    crs: str | None = None,
    units: str | None = None,
    policy: ImportPolicy = DEFAULT_IMPORT,
) -> Map:
    """Return a map of any format; the file's extension and content decide which.

    Parameters
    ----------
    crs : str, optional
        Coordinate system, ``local`` for a plane without a place on the earth.
    units : str, optional
        Unit of lengths that the user states; None for the file's.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    suffix = Path(file).suffix.lower()
    reader = EARTH_READERS.get(suffix)
    if suffix == ".txt" and is_waypoint_list(file):
        reader = read_waypoint_list
    elif suffix == ".json" and is_plan(file):
        reader = read_plan
    if reader is not None:
        if crs is not None:
            raise InputError(f"--crs: {file} is in degrees always; expected no system")
        return reader(file, policy)
    if is_chart(file, policy.read):
        return read_chart(file, crs, units, policy.read)
    if suffix == ".dxf":
        return read_dxf(file, crs, units, policy)
    if suffix in (".kml", ".kmz"):
        found = read_kml(file, crs, policy.read)
    elif suffix in (".geojson", ".json"):
        found = read_geojson(file, crs, policy.read)
    elif suffix in SEQUENCE_SUFFIXES:
        found = read_geojson_sequence(file, crs, policy.read)
    else:
        return read_vector(file, crs, policy.read)
    return found if crs is None else in_degrees(found, crs, file)


SKIP_OPTION = "; leave out what is out of reach with --skip-unreachable"


@dataclass
class _Site:
    """Map that becomes a problem."""

    file: str | Path
    map: Map
    options: SiteOptions
    kinds: dict[str, str]
    fields: dict[str, str]
    projection: Projection | None
    complaints: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    asks: list[str] = field(default_factory=list)
    cropped: CropCircle | None = None
    window: CropWindow | None = None
    viewpoints: list[str] = field(default_factory=list)
    goal_features: list[Feature | None] = field(default_factory=list)
    floor: SeaFloor | None = None

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
        self.beyond: dict[str, Feature] = {}
        self.cut_off: set[str] = set()
        self.joined: dict[str, list[Feature]] = {}  # by the feature that names the outline

    def problem(self, name: str) -> Problem:
        """Return the problem, or raise all complaints."""
        self.complaints += [(text, "") for text in self.map.complaints]
        parts = self._parts()
        base = self._base(parts)
        if base is None:
            raise self._refused()
        anchor, base_feature = base
        tether = self._length(base_feature, "tether_length", self.options.tether)
        if tether is None:
            self._complain(
                "has no tether length; expected tether_length of the base",
                ", or --tether L",
                "tether",
            )
        clearance = self._length(base_feature, "clearance", self.options.clearance) or 0.0
        goals = self._goals(parts["goal"]) + self._table_goals()
        candidates = [
            place for _, place in self._table_places("candidate", self.options.candidates)
        ]
        reach = self._reach([anchor, *candidates], tether, clearance)
        if self.is_chart:
            places = {"base": anchor, **{_label(goal): goal["position"] for goal in goals}}
            self._chart_depths(parts, places, reach)
        free = [anchor, *candidates, *(g["position"] for g in goals)]
        obstacles = self._within_crop(self._obstacles(parts["obstacle"], free))
        bounds, islands = self._bounds(parts["bounds"])
        obstacles += islands
        self._check_names(obstacles, "obstacles")
        goals += self._inspections(obstacles, anchor, tether, clearance)
        self._check_names(goals, "goals")
        self.viewpoints = [str(goal["name"]) for goal in goals if "layer" in goal]
        if not goals:
            self._complain_of_no_goal()
        if tether is not None:
            self._check_scale(goals, obstacles, anchor, tether)
            goals = self._within_reach(goals, anchor, tether)
        if self.complaints:
            raise self._refused()
        self.goal_features = [goal.get("source") for goal in goals]
        return self._made(
            {
                "schema_version": 1,
                "name": name,
                "base": list(anchor),
                "goals": [_bare(g) for g in goals],
                "obstacles": [_bare(o) for o in obstacles],
                "tether_length": tether,
                "clearance": clearance,
                **({"bounds": bounds} if bounds else {}),
                **self._origin(),
                "site": Site(
                    file=Path(self.file).name[: self.policy.max_file_name_length],
                    imported=self.ledger.records(),
                    cropped=self.cropped,
                ),
            },
            goals,
            obstacles,
        )

    def _reach(self, bases: list[Any], tether: float | None, clearance: float) -> CropWindow | None:
        """Return the window of the tether's reach; the map is cropped to it if it should be."""
        if tether is None:
            return None
        margin = self.options.crop_margin
        reach = CropWindow.about(bases, tether + clearance, margin, self.policy.outlines)
        if self.is_chart if self.options.crop is None else self.options.crop:
            self.window = reach
        return reach

    def _made(self, data: dict[str, Any], goals: list[Any], obstacles: list[Any]) -> Problem:
        """Return the problem of checked data; its errors name features of the map."""
        try:
            return Problem.model_validate(data)
        except ValidationError as error:
            wheres = {"goals": goals, "obstacles": obstacles}

            def own_name(found: re.Match[str]) -> str:
                entries, k = wheres[found[1]], int(found[2])
                return str(entries[k]["where"]) if k < len(entries) else found[0]

            text = re.sub(r"\b(goals|obstacles)\[(\d+)\]", own_name, explain(error))
            raise InputError(f"{self.file}: {text}") from None

    # Kinds of features

    def _parts(self) -> dict[str, list[Feature]]:
        parts: dict[str, list[Feature]] = {k: [] for k in KIND_COLUMNS}
        for unread in self.map.unread:
            self.ledger.leave_out(unread, unread.reason)
        wrong: dict[str, list[str]] = {}
        layers = self.map.layer_names
        lone = lone_equipment(self.map.features, self.policy) if self.is_chart else set()
        for feature in self.map.features:
            try:
                decision = kind_of(
                    feature, self.kinds, is_chart=self.is_chart, layers=layers, policy=self.policy
                )
            except InputError as error:
                complaint = str(error).removeprefix(feature.where)
                wrong.setdefault(complaint, []).append(feature.where)
                continue
            if decision.reason == EQUIPMENT and feature.where in lone:
                decision = Decision("obstacle")
            if decision.kind in parts:
                kind = cast("UsedAs", decision.kind)
                parts[kind].append(_marked(feature) if kind in ("base", "goal") else feature)
                self.ledger.use(feature, kind)
            else:
                self.ledger.leave_out(feature, decision.reason)
        for complaint, places in wrong.items():  # probably one slip in all of them
            self._complain(f"{_first_of(places)}{complaint}")
        for layer, size in self.map.layers.items():
            if layer and not size:
                self.notes.append(f"layer {layer!r} is empty")
        return parts

    def _chart_depths(
        self, parts: dict[str, list[Feature]], places: Mapping[str, Any], reach: CropWindow | None
    ) -> None:
        """Make obstacles of shallow areas, and the sea floor, if the options ask for them."""
        free = [f for f in self.map.features if self.kinds.get(f.layer.lower()) != "ignore"]
        left_out = [
            f for f in free if self.ledger.is_left_out(f) and f.layer.lower() not in self.kinds
        ]
        draught = self.options.draught
        if draught is not None:
            shallow = shallow_areas(left_out, draught)
            self._check_depth(shallow, places, draught)
            shoals = shoal_soundings(left_out, draught, shallow)
            for feature in (*shallow, *shoals):
                self.ledger.use(feature, "obstacle")
            parts["obstacle"] += [*shallow, *shoals]
        if reach is not None:
            if draught is not None:
                self._note_share(
                    depthless_share(self.map.features, self._plane, reach),
                    "is water whose depth the chart does not give; --draught makes no obstacle of "
                    "it",
                )
            self._note_share(
                uncharted_share(self.map.features, self._plane, reach),
                "is not on this chart, and free of obstacles in the problem",
            )
        if not self.options.floor or self.complaints:
            return
        self.floor, found = chart_floor(
            free, self._plane, self.window, self.options.floor_cell, self.policy
        )
        for feature in found.used:  # shallow areas stay obstacles
            if self.ledger.is_left_out(feature):
                self.ledger.use(feature, "floor")
        for feature in found.beyond:
            if self.ledger.is_left_out(feature):
                self.ledger.leave_out(feature, self._beyond_reach)
        for feature in found.depthless:
            self.ledger.leave_out(feature, "a depth that the chart does not give")

    def _check_depth(
        self, shallow: list[Feature], places: Mapping[str, Any], draught: float
    ) -> None:
        """Complain of a base or goals that lie in water that may be too shallow."""
        import shapely

        areas = [self._plane(feature.shape) for feature in shallow]
        tree = shapely.STRtree(areas)
        for called, place in places.items():
            held = tree.query(shapely.Point(place[:2]), predicate="within").tolist()
            if not held:
                continue
            area = shallow[min(held)]
            min_depth, _ = depth_range(area)
            depth = (
                "of unknown depth"
                if min_depth is None
                else f"from {_metres(min_depth)} of depth on"
            )
            self._complain(
                f"{called}: lies in {self._called(area)}, {depth}, and the draught is "
                f"{_metres(draught)}; expected a place in deeper water, or a smaller draught"
            )

    def _note_share(self, share: float, description: str) -> None:
        if share >= self.policy.min_noted_share:
            self.notes.append(f"{100.0 * share:.2g} % of the tether's reach {description}")

    def _table_places(
        self, kind: UsedAs, file: str | Path | None
    ) -> list[tuple[Feature, tuple[float, float, float]]]:
        """Return the rows of a table of goals or candidates, and their places in the plane."""
        import shapely

        if file is None:
            return []
        found, names = from_table(file, self.projection, self.notes.append)
        places = np.column_stack([found, np.zeros(len(found))])[:, :3]  # at the surface without z
        layer = self.ledger.add_layer(Path(file).name, len(places))
        out = []
        for k, (place, name) in enumerate(zip(places.tolist(), names, strict=True)):
            # as in the map: in degrees or in its unit
            spot = (
                tuple(self.projection.to_earth([place[:2]])[0][::-1])
                if self.projection is not None
                else (place[0] / self._unit, place[1] / self._unit)
            )
            row = Feature(f"{layer}[{k}]", layer, "", {"name": name}, shapely.Point(spot))
            self.ledger.use(row, kind)
            out.append((row, (place[0], place[1], place[2])))
        return out

    def _table_goals(self) -> list[dict[str, Any]]:
        return [
            {"name": self._name(row), "position": place, "where": row.where, "source": row}
            for row, place in self._table_places("goal", self.options.goals)
        ]

    def left_out(self) -> tuple[shapely.Geometry, ...]:
        """Return the shapes that were left out, in the plane."""
        return tuple(self._plane(shape) for shape in self.ledger.left_out_shapes)

    def _base(self, parts: dict[str, list[Feature]]) -> tuple[Any, Feature | None] | None:
        """Return the place of the tether's anchor and its feature; set the projection."""
        bases = parts["base"]
        if len(bases) > 1:
            self._complain(
                f"expected one base, got {len(bases)}: {', '.join(b.where for b in bases)[:100]}"
            )
            return None
        feature = bases[0] if bases else None
        if not self.map.is_geographic:
            if feature is None:
                if not self.complaints:  # a damaged feature may be the base
                    self._complain("has no base; expected a Point of kind base")
                return None
            return self._place(feature.shape, feature), feature
        if self.projection is None:
            if feature is None:
                if not self.complaints:
                    self._complain(
                        "has no base; expected a Point of kind base", ", or --base LAT,LON", "base"
                    )
                return None
            heading = self._number(feature, "heading") or 0.0
            try:
                self.projection = Projection(
                    feature.shape.y, feature.shape.x, heading, name=feature.where
                )
            except InputError as error:
                self._complain(str(error))
                return None
        x, y = self.projection.base.tolist()
        z = self._height(feature) if feature is not None else 0.0
        if feature is not None:
            place = self._plane(feature.shape)
            shift = float(np.hypot(place.x - x, place.y - y))
            if shift > self.policy.max_base_shift:
                self.notes.append(
                    f"{feature.where}: the base is at the place that was given, {_metres(shift)} "
                    "away; only the properties of the file's base are used"
                )
        return (x, y, z), feature

    # Places and lengths

    @property
    def _unit(self) -> float:
        """Metres per unit of the file; the unit of the options overrides the file's."""
        if self.is_chart:  # its reader converts lengths
            return 1.0
        return UNITS[self.options.units] if self.options.units else self.map.metres or 1.0

    def _plane(self, shape: shapely.Geometry) -> Any:
        """Return a shape in metres in the problem's plane."""
        import shapely

        flat = shapely.force_2d(shape)
        if not self.map.is_geographic:
            return shapely.transform(flat, lambda c: c * self._unit)
        projection = self.projection
        assert projection is not None
        return shapely.transform(flat, lambda c: projection.to_plane(c[:, ::-1]))

    def _place(self, point: Any, feature: Feature) -> tuple[float, float, float]:
        place = self._plane(point)
        return (float(place.x), float(place.y), self._height(feature, point))

    def _height(self, feature: Feature, point: Any = None) -> float:
        """Return z in metres, of a depth or else of the point itself.

        The height of a point on the earth is in metres by its format.
        """
        depth = self._depth(feature)
        place = point if point is not None else feature.shape
        if depth is not None:
            if depth < 0.0:
                self._complain(
                    f"{self._called(feature)}: depth: counts downwards; expected 0 or more, got "
                    f"{depth:g} m; if it is a height, give it as the z of the point"
                )
            self._note_other_height(feature, place, depth)
            return 0.0 - depth
        if feature.is_above_floor:
            self._complain(
                f"{self._called(feature)}: its height counts from the sea floor, which the map "
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
        return float(place.z) * (1.0 if self.map.is_geographic else self._unit)

    def _depth(self, feature: Feature) -> float | None:
        """Return the depth in metres that a property of a feature states; None without one."""
        for name in [] if "depth" in self.fields else feature.properties:
            if not str(name).lower().startswith("depth"):
                continue
            try:
                meaning = column(str(name))
            except InputError as error:
                self._complain(f"{feature.where}: {error}")
                return None
            if meaning is not None and meaning.quantity == "z" and meaning.unit:
                value = self._number(feature, "depth", str(name).lower())
                return None if value is None else -meaning.factor * value
        depth = self._number(feature, "depth")
        if depth is None and self.is_chart:
            return sounding_depth(feature)
        return None if depth is None else depth * self._unit

    def _get(self, feature: Feature, ours: str) -> Any:
        mapped = self.fields.get(ours)
        return feature.get(mapped) if mapped is not None else feature.get(*FIELDS[ours])

    def _number(self, feature: Feature, ours: str, name: str | None = None) -> float | None:
        value = self._get(feature, ours) if name is None else feature.get(name)
        if value is None:
            return None
        if isinstance(value, str):  # KML and tables hold text
            try:
                value = float(value)
            except ValueError:
                self._complain(f"{feature.where}: {ours}: expected a number, got {shown(value)}")
                return None
        try:
            return float(checked_number(value))
        except ValueError as error:
            self._complain(f"{feature.where}: {ours}: {error}")
            return None

    def _length(self, base: Feature | None, ours: str, given: float | None) -> float | None:
        if given is not None or base is None:
            return given
        value = self._number(base, ours)
        return None if value is None else value * self._unit

    def _name(self, feature: Feature) -> str | None:
        value = self._get(feature, "name")
        if value is not None:
            return str(value).strip()
        return feature.identity.strip() or None

    # Goals and obstacles

    def _goals(self, features: list[Feature]) -> list[dict[str, Any]]:
        goals: list[dict[str, Any]] = []
        for feature in features:
            points = getattr(feature.shape, "geoms", [feature.shape])
            for k, point in enumerate(points, 1):
                name = self._name(feature)
                if name is not None and len(points) > 1:
                    name = f"{name} {k}"
                place = self._place(point, feature)
                goals.append(
                    {"name": name, "position": place, "where": feature.where, "source": feature}
                )
        return goals

    def _obstacles(self, features: list[Feature], free: list[Any]) -> list[dict[str, Any]]:
        """Return the obstacles of features; holes in which a place must stay free are cut open."""
        import shapely

        spots = shapely.MultiPoint([p[:2] for p in free])
        drawn: dict[str, list[tuple[Feature, shapely.LineString]]] = {}
        out: list[dict[str, Any]] = []

        def area(feature: Feature, shape: shapely.Geometry) -> list[dict[str, Any]]:
            """Return the obstacles of an area; parts without an area become lines."""
            if self.window is not None:
                if self.window.is_beyond(shape):
                    self.beyond[feature.where] = feature
                    return []
                if "Polygon" in shape.geom_type:
                    shape, is_cut = self.window.cut(shape)
                    if is_cut:
                        self.cut_off.add(feature.where)
                    if shape.is_empty:
                        self.beyond[feature.where] = feature
                        return []
            polygons, notes = simple_polygons(shape, lambda p: p.intersects(spots))
            self.notes += [f"{self._called(feature)}: {note}" for note in notes]
            walls = spurs_of(shape, polygons, self.options.join_tolerance)
            drawn.setdefault(feature.layer, []).extend((feature, wall) for wall in walls)
            if not polygons and not walls:
                self._complain(
                    f"{self._called(feature)}: encloses nothing; expected a polygon with an area"
                )
            return [
                {"feature": feature, **outline_of(polygon, self.policy.outlines)}
                for polygon in polygons
            ]

        pointlike: list[Feature] = []
        for feature in progress.track(features):
            for shape in _blocks_of(feature.shape):
                out += self._obstacle(feature, shape, area, drawn, pointlike)
        self._complain_of_points(pointlike)
        for pieces in drawn.values():
            out += self._line_work(pieces, area)
        return self._named(out)

    def _obstacle(
        self,
        feature: Feature,
        shape: shapely.Geometry,
        area: Callable[[Feature, shapely.Geometry], list[dict[str, Any]]],
        drawn: dict[str, list[tuple[Feature, shapely.LineString]]],
        pointlike: list[Feature],
    ) -> list[dict[str, Any]]:
        """Return the obstacles of a shape; defer open lines and points without a radius."""
        kind = shape.geom_type
        out: list[dict[str, Any]] = []
        if "Point" in kind:
            radius = self._radius(feature)
            if self._is_beyond(self._plane(shape), radius or 0.0):
                self.beyond[feature.where] = feature
                return out
            if radius is None:
                pointlike.append(feature)
                return out
            for point in getattr(shape, "geoms", [shape]):
                place = self._plane(point)
                out.append({"feature": feature, "center": (place.x, place.y), "radius": radius})
        elif "Line" in kind:
            lines = lines_of(self._plane(shape))
            if not lines:
                self._complain(
                    f"{self._called(feature)}: is a line without length; expected two places"
                )
            for line in lines:
                if line.is_closed and not (is_coastline(feature) and not is_land(line)):
                    out += area(feature, self._with_rim(line, [(feature, line)]))
                else:
                    drawn.setdefault(feature.layer, []).append((feature, line))
        else:
            out += area(feature, self._plane(shape))
        return out

    def _line_work(
        self,
        pieces: list[tuple[Feature, shapely.LineString]],
        area: Callable[[Feature, shapely.Geometry], list[dict[str, Any]]],
    ) -> list[dict[str, Any]]:
        """Return the obstacles of a layer's open lines: joined outlines, and lines with a width."""
        out: list[dict[str, Any]] = []
        areas, rest = outlines([line for _, line in pieces], self.options.join_tolerance)
        for polygon, members in areas:
            features = [pieces[k][0] for k in members]
            coast = all(map(is_coastline, features))
            if coast and not any(is_land(pieces[k][1], polygon) for k in members):
                rest += members  # a shore around water is a wall
                continue
            named = next((f for f in features if self._name(f) is not None), features[0])
            found = area(named, self._with_rim(polygon, [pieces[k] for k in members]))
            self.joined.setdefault(named.where, []).extend(features)
            names = list(dict.fromkeys(n for f in features if (n := self._name(f)) is not None))
            if found and len(names) > 1:
                self.notes.append(
                    f"{_first_of([f.where for f in features])}: lines joined to one outline, named "
                    f"{names[0]!r}; their other names: {', '.join(map(repr, names[1:MAX_NAMED]))}"
                    + (", …" if len(names) > MAX_NAMED else "")
                )
            out += found
        narrow: list[Feature] = []
        for k in rest:
            feature, line = pieces[k]
            width = self._width(feature)
            if self._is_beyond(line, width or 0.0):
                self.beyond[feature.where] = feature
                continue
            if width is None:
                narrow.append(feature)
            else:
                out += area(feature, widened(line, width, self.policy.outlines))
        if narrow:
            layer = narrow[0].layer
            places = list(dict.fromkeys(f.where for f in narrow))
            called = f"layer {layer!r}: " if layer else ""
            pick = layer or "lines"
            self._complain(
                f"{called}{counted(len(narrow), 'open line')} ({_first_of(places)}); expected a "
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
            widened(line, width, self.policy.outlines)
            for feature, line in pieces
            if self._number(feature, "width") is not None and (width := self._width(feature))
        ]
        if not rims:
            return outline
        inner = shapely.Polygon(outline.coords) if "Line" in outline.geom_type else outline
        return union([*shapely.get_parts(shapely.make_valid(inner)), *rims])

    def _is_beyond(self, shape: shapely.Geometry, grown: float) -> bool:
        return self.window is not None and self.window.is_beyond(shape, grown)

    def _width(self, feature: Feature) -> float | None:
        width = self._number(feature, "width")
        if width is None and self.is_chart:
            width = chart_width(feature)
        if width is None:
            return self.options.line_width
        if not width > 0.0:
            self._complain(f"{feature.where}: width_m: expected a positive width, got {width:g}")
        metres = "width" not in self.fields and feature.get(WIDTH[0]) is not None
        return abs(width) * (1.0 if metres else self._unit) or None

    def _named(self, entries: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Return obstacles named after their features, numbered if a feature has several."""
        size = Counter(entry["feature"].where for entry in entries)
        number: Counter[str] = Counter()
        out = []
        for entry in entries:
            feature = entry["feature"]
            number[feature.where] += 1
            name = self._name(feature)
            if name is not None and size[feature.where] > 1:
                name = f"{name} {number[feature.where]}"
            out.append({"name": name, **entry, "where": feature.where})
        return out

    @property
    def _beyond_reach(self) -> str:
        """Return the reason to leave out features beyond the window."""
        assert self.window is not None
        about = "the base and the candidates" if self.options.candidates is not None else "the base"
        return f"beyond the reach of the tether ({_metres(self.window.radius)} about {about})"

    def _within_crop(self, obstacles: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Return the obstacles within the reach of the tether; the others go to the ledger."""
        if self.window is None:
            return obstacles
        kept, dropped, cut_off = cropped(obstacles, self.window)
        self.beyond |= {obstacle["where"]: obstacle["feature"] for obstacle in (*dropped, *cut_off)}
        self.cut_off |= {obstacle["where"] for obstacle in cut_off}
        if not self.beyond and not self.cut_off:
            return kept
        self.cropped = CropCircle(center=self.window.center, radius=self.window.radius)
        staying = {obstacle["where"] for obstacle in kept}
        for where, feature in self.beyond.items():
            if where not in staying:
                for piece in (feature, *self.joined.get(where, ())):
                    if piece.where not in staying:
                        self.ledger.leave_out(piece, self._beyond_reach)
        # some parts of a feature may lie beyond while others stay
        if cut_count := len((self.cut_off | set(self.beyond)) & staying):
            self.notes.append(
                f"{counted(cut_count, 'obstacle')} cut off where the reach of the tether ends "
                f"({_metres(self.window.radius)})"
            )
        return kept

    def _called(self, feature: Feature) -> str:
        label = self._name(feature)
        return feature.where + (f" ({label})" if label else "")

    def _radius(self, feature: Feature) -> float | None:
        metres = "radius" not in self.fields and feature.get(RADIUS[0]) is not None
        radius = self._number(feature, "radius")
        if radius is not None:
            return radius * (1.0 if metres else self._unit)
        self._note_unread(
            feature,
            [n for n in feature.properties if str(n).lower().startswith(("radius", "diameter"))],
            "expected radius_m, in metres",
        )
        charted = chart_radius(feature) if self.is_chart else None
        return charted if charted is not None else self.options.radius

    def _note_other_height(self, feature: Feature, point: Any, depth: float) -> None:
        """Add a note if the depth of a feature is used and its point has another height."""
        if self.is_chart or point.geom_type != "Point" or not point.has_z:
            return
        z = float(point.z) * (1.0 if self.map.is_geographic else self._unit)
        # files write 0 where they have no height
        if z and abs(z + depth) > self.policy.max_height_gap:
            self.notes.append(
                f"{self._called(feature)}: its depth of {depth:g} m is taken, and its height of "
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

    def _complain_of_points(self, features: list[Feature]) -> None:
        """Complain of points without a radius, one line a layer."""
        by_layer: dict[str, list[str]] = {}
        for feature in features:
            by_layer.setdefault(feature.layer, []).append(feature.where)
        for layer, places in by_layer.items():
            description = "an obstacle" if len(places) == 1 else "obstacles"
            ignore = f", or --map ignore={layer} to leave them out" if layer else ""
            self._complain(
                f"{_first_of(places)}: {description} without radius_m; expected one, or a radius "
                "for all that have none",
                f" (--radius R){ignore}",
                "radius",
            )

    def _complain_of_no_goal(self) -> None:
        if self.complaints:
            if self.options.inspection is None:
                self.asks.append("inspect")  # so that the user can answer all at once
            return
        self._complain(
            "has no goal; expected a point without radius_m, a layer of goals, a table of goals, "
            "or obstacles to inspect",
            " (--map goal=LAYER, --goals TABLE, --inspect N --standoff S)",
            "inspect",
        )

    def _inspections(
        self, obstacles: list[dict[str, Any]], anchor: Any, tether: float | None, clearance: float
    ) -> list[dict[str, Any]]:
        """Return the viewpoints of the obstacles to be inspected."""
        from netsp.model.shorthand import Inspection

        goals: list[dict[str, Any]] = []
        chosen = self._chosen(obstacles)
        for k, obstacle in enumerate(obstacles):
            feature, inspection = (
                obstacle["feature"],
                self.options.inspection if k in chosen else None,
            )
            stated = feature.get("viewpoints", "inspect")
            if stated is None and inspection is None:
                continue
            standoff = feature.get("standoff")
            heights = feature.get("depths")
            try:
                parsed = Inspection.model_validate(
                    {
                        "inspect": obstacle["name"] or f"#{k}",
                        "viewpoints": _whole(stated)
                        if stated is not None
                        else inspection and inspection.viewpoints,
                        "standoff": inspection.standoff
                        if standoff is None and inspection is not None
                        else _real(standoff) * self._unit,
                        "depths": [h * self._unit for h in _list(heights)]
                        if heights is not None
                        else (inspection.depths if inspection is not None else (0.0,)),
                    }
                )
            except (ValidationError, ValueError, TypeError) as error:
                text = explain(error) if isinstance(error, ValidationError) else str(error)
                self._complain(f"{feature.where}: {text}")
                continue
            goals += [
                {**g, "where": feature.where, "layer": feature.layer}
                for g in parsed.goals(obstacle)
            ]
        if self.options.inspection is not None:
            goals = self._free_viewpoints(goals, obstacles, anchor, tether, clearance)
        return goals

    def _chosen(self, obstacles: list[dict[str, Any]]) -> set[int]:
        """Return the indices of the obstacles that the user wants to inspect."""
        import shapely

        inspection = self.options.inspection
        if inspection is None:
            return set()
        rule = inspection.chosen
        areas = [shapely.box(*box) for box in rule.boxes]
        if rule.earth_boxes and self.projection is None:
            raise InputError(
                f"{self.file}: has no place on the earth; expected a box in its plane (m)"
            )
        for south, west, north, east in rule.earth_boxes:
            corners = [(south, west), (south, east), (north, east), (north, west)]
            assert self.projection is not None
            areas.append(shapely.Polygon(self.projection.to_plane(corners)))
        found = {
            k
            for k, obstacle in enumerate(obstacles)
            if (rule.layers or not self._is_shallow(obstacle["feature"]))
            and any(
                rule.matches(layer, self._name(obstacle["feature"]) or obstacle["name"])
                for layer in (obstacle["feature"].layer, *obstacle["feature"].folders)
            )
            and rule.is_in_boxes(_shape(obstacle), areas)
        }
        if not found and obstacles:
            layers = dict.fromkeys(obstacle["feature"].layer for obstacle in obstacles)
            self._complain(
                "no obstacle within the tether's reach is among those chosen to be inspected; "
                f"there are obstacles of the layers {', '.join(n or '(none)' for n in layers)}"
            )
        return found

    def _is_shallow(self, feature: Feature) -> bool:
        """Return whether a feature is water that is an obstacle only because of its depth."""
        return self.is_chart and feature.layer.upper() in (*DEPTH_AREAS, UNSURVEYED, SOUNDINGS)

    def _free_viewpoints(
        self,
        goals: list[dict[str, Any]],
        obstacles: list[dict[str, Any]],
        anchor: Any,
        tether: float | None,
        clearance: float,
    ) -> list[dict[str, Any]]:
        """Return the viewpoints with room for the robot; note the others by layer and cause."""
        if not goals:
            return goals
        places = np.array([g["position"] for g in goals])
        distance = np.linalg.norm(places - np.array(anchor), axis=1)
        is_far = (
            (distance > tether)
            if self.window is not None and tether is not None
            else distance < 0.0
        )
        is_in = _distance(places[:, :2], obstacles) < max(clearance, 1e-9)
        seen: set[tuple[float, ...]] = set()
        kept: list[dict[str, Any]] = []
        groups: dict[tuple[str, str], list[str]] = {}
        for k, goal in enumerate(goals):
            cause = ""
            if is_in[k]:
                cause = "within an obstacle or its clearance"
            elif is_far[k]:
                cause = "farther from the base than the tether is long"
            elif (place := tuple(places[k])) in seen:
                cause = "in the same place as another"
            else:
                seen.add(place)
                kept.append(goal)
                continue
            groups.setdefault((goal["layer"], cause), []).append(str(goal["name"]))
        for (layer, cause), names in groups.items():
            shown_names = ", ".join(names[:MAX_NAMED]) + (", …" if len(names) > MAX_NAMED else "")
            called = f"layer {layer!r}: " if layer else ""
            self.notes.append(
                f"{called}{counted(len(names), 'viewpoint')} left out: {cause} ({shown_names})"
            )
        if not kept and not self._complains_of_base(anchor, obstacles):
            number: Counter[str] = Counter()
            for (_, cause), names in groups.items():
                number[cause] += len(names)
            causes = ", ".join(f"{n} {cause}" for cause, n in number.items())
            self._complain(
                f"no viewpoint about an obstacle is left ({causes}); expected another standoff, "
                "base or tether"
            )
        return kept

    def _complains_of_base(self, anchor: Any, obstacles: list[dict[str, Any]]) -> bool:
        """Complain of a base within an obstacle, and return whether it is."""
        import shapely

        spot = shapely.Point(anchor[:2])
        for obstacle in obstacles:
            if self._is_shallow(obstacle["feature"]):
                continue  # reported with its depth already
            if _shape(obstacle).contains(spot):
                self._complain(
                    f"base: lies inside {self._called(obstacle['feature'])}; expected a place in "
                    "the water"
                )
                return True
        return False

    def _bounds(self, features: list[Feature]) -> tuple[list[list[float]] | None, list[Any]]:
        """Return the outline of the bounds, and the islands in it: obstacles without a name."""
        import shapely

        if not features:
            return None, []
        shapes = [self._plane(f.shape) for f in features]
        lines = [line for shape in shapes if "Line" in shape.geom_type for line in lines_of(shape)]
        areas, rest = outlines(lines, self.options.join_tolerance)
        whole = [area for area, _ in areas] + [s for s in shapes if "Polygon" in s.geom_type]
        places = ", ".join(f.where for f in features)[:100]
        if rest:
            self._complain(
                f"{places}: bounds that are not closed; expected a closed line or a polygon"
            )
            return None, []
        if len(whole) > 1 and all(f.get("fence") == "inclusion" for f in features):
            common = shapely.intersection_all(list(map(shapely.make_valid, whole)))
            parts = [g for g in shapely.get_parts(common) if g.geom_type == "Polygon"]
            whole = [shapely.MultiPolygon(parts)]
            self.notes.append(
                f"{len(features)} inclusion fences ({places}): the bounds are where all of them "
                "overlap, because the vehicle stays within each"
            )
            if whole[0].area <= 0.0:
                self._complain(f"{places}: inclusion fences that do not overlap; expected one area")
                return None, []
        if len(whole) != 1:
            self._complain(
                f"expected one outline of kind bounds, got {len(whole)}: {places}; keep one, or "
                "make obstacles of what lies between them",
                "; --map ignore=LAYER leaves out a layer",
            )
            return None, []
        return self._bounds_of(features[0], whole[0])

    def _bounds_of(
        self, feature: Feature, area: shapely.Geometry
    ) -> tuple[list[list[float]] | None, list[Any]]:
        """Return the outline of an area, and its holes as islands."""
        import shapely

        drawn = shapely.get_parts(area)
        holes = [shapely.Polygon(ring) for part in drawn for ring in part.interiors]
        filled = shapely.MultiPolygon([shapely.Polygon(part.exterior) for part in drawn])
        polygons, notes = simple_polygons(filled, lambda p: False)
        self.notes += [f"{feature.where}: {note}" for note in notes]
        if len(polygons) != 1:
            self._complain(f"{feature.where}: expected bounds in one piece, got {len(polygons)}")
            return None, []
        ring: list[list[float]] = shapely.get_coordinates(polygons[0].exterior)[:-1].tolist()
        islands = [
            {
                "feature": feature,
                "name": None,
                "where": feature.where,
                **outline_of(polygon, self.policy.outlines),
            }
            for hole in holes
            for polygon in simple_polygons(hole, lambda p: False)[0]
        ]
        if islands:
            self.notes.append(
                f"{feature.where}: {counted(len(islands), 'hole')} in the bounds: an obstacle each"
            )
        return ring, islands

    # Checks of the whole map

    def _check_names(self, entries: list[dict[str, Any]], kind: str) -> None:
        """Number the names that several goals or obstacles share, and add a note."""
        _number_parts(entries)
        numbered = _number_names(entries)
        if numbered:
            shown_names = ", ".join(
                f"{old!r} is {new!r} ({where})" for old, new, where in numbered[:MAX_NAMED]
            )
            self.notes.append(
                f"names that several {kind} share are numbered: {shown_names}"
                + (f", and {len(numbered) - MAX_NAMED} more" if len(numbered) > MAX_NAMED else "")
            )

    def _check_scale(
        self,
        goals: list[dict[str, Any]],
        obstacles: list[dict[str, Any]],
        anchor: Any,
        tether: float,
    ) -> None:
        """Complain of coordinates in a plane that look like degrees, for the tether's length."""
        if self.map.is_geographic or not goals:
            return
        places = np.array([anchor, *(g["position"] for g in goals)])[:, :2] / self._unit
        span = float(np.ptp(places * self._unit, axis=0).max())
        small = bool((np.abs(places) <= [180.0, 90.0]).all())
        whole = bool((places == np.round(places)).all())
        if small and not whole and span <= self.policy.max_degrees_span * tether:
            self._complain(
                f"coordinates span {span:g} m, and the tether is {_metres(tether)} long: they look "
                "like degrees; expected metres",
                ", or --crs EPSG:4326",
                "crs",
            )

    def _within_reach(
        self, goals: list[dict[str, Any]], anchor: Any, tether: float
    ) -> list[dict[str, Any]]:
        """Return the goals within a straight tether; complain of the others, or leave them out."""
        near: list[dict[str, Any]] = []
        far: list[tuple[float, dict[str, Any]]] = []
        for goal in goals:
            distance = float(np.linalg.norm(np.array(goal["position"]) - np.array(anchor)))
            if distance <= tether:
                near.append(goal)
            else:
                far.append((distance, goal))
        if self.options.skip_unreachable and near:
            staying = {goal["where"] for goal in near}
            for distance, goal in far:
                feature = goal.get("source")
                if feature is None or goal["where"] in staying:  # one of several goals of a feature
                    self.notes.append(
                        f"{_label(goal)}: is {_metres(distance)} from the base: left out"
                    )
                else:
                    self.ledger.leave_out(
                        feature,
                        f"farther from the base than the tether is long ({_metres(tether)})",
                    )
        elif len(far) > self.policy.max_listed_goals:
            distance, goal = max(far, key=lambda f: f[0])
            self._complain(
                f"{len(far)} goals are farther from the base than the tether is long "
                f"({_metres(tether)}), {_label(goal)} {_metres(distance)}"
                f"{self._cause(goal, tether)}",
                SKIP_OPTION,
            )
        else:
            for distance, goal in far:
                self._complain(
                    f"{_label(goal)}: is {_metres(distance)} from the base, and the tether "
                    f"{_metres(tether)} long{self._cause(goal, tether)}",
                    SKIP_OPTION,
                )
        return near

    def _cause(self, goal: dict[str, Any], tether: float) -> str:
        """Return a likely cause for a goal that is far away, or an empty text."""
        if self.projection is None:
            return ""
        ((lat, lon),) = self.projection.to_earth([goal["position"][:2]])
        if abs(lon) <= 90.0:
            ((x, y),) = self.projection.to_plane([[lon, lat]])
            as_read, swapped = (
                np.hypot(*(np.array(place) - self.projection.base))
                for place in (goal["position"][:2], (x, y))
            )
            if swapped <= 10.0 * tether < as_read:
                return ": latitude and longitude look swapped"
        return ""

    def _origin(self) -> dict[str, Any]:
        p = self.projection
        if p is None:
            return {}
        return {"origin": {"latitude": p.latitude, "longitude": p.longitude, "heading": p.heading}}

    def _complain(self, text: str, option: str = "", ask: str | None = None) -> None:
        """Add a complaint; options of the command line that help stand apart."""
        self.complaints.append((f"{self.file}: {text.removeprefix(f'{self.file}: ')}", option))
        if ask is not None:
            self.asks.append(ask)

    def _refused(self) -> InputError:
        whole = [text + option for text, option in self.complaints]
        return UnansweredError(whole, [text for text, _ in self.complaints], self.asks)


def _blocks_of(shape: shapely.Geometry) -> list[shapely.Geometry]:
    """Return the shapes of a block of a drawing, or the shape alone."""
    return list(shape.geoms) if shape.geom_type == "GeometryCollection" else [shape]  # type: ignore[attr-defined]


def _marked(feature: Feature) -> Feature:
    """Return a goal or a base as a point; a symbol stands where it marks."""
    if feature.marker is None or "Point" in feature.shape.geom_type:
        return feature
    return replace(feature, shape=feature.marker)


def _bare(entry: dict[str, Any]) -> dict[str, Any]:
    """Return the data of a goal or obstacle without its origin, and without a missing name."""
    internal = ("where", "feature", "source", "layer")
    return {k: v for k, v in entry.items() if k not in internal and v is not None}


def _shape(obstacle: dict[str, Any]) -> shapely.Geometry:
    """Return an obstacle of a problem file as an area."""
    import shapely

    if "radius" in obstacle:
        return shapely.Point(obstacle["center"]).buffer(obstacle["radius"])
    return shapely.Polygon(obstacle["polygon"])


def _distance(places: np.ndarray, obstacles: list[dict[str, Any]]) -> np.ndarray:
    """Return the distance of each place from the nearest obstacle, 0 or less within one."""
    import shapely

    out = np.full(len(places), np.inf)
    circles = [
        (*obstacle["center"], obstacle["radius"]) for obstacle in obstacles if "radius" in obstacle
    ]
    for x, y, radius in circles:
        out = np.minimum(out, np.hypot(places[:, 0] - x, places[:, 1] - y) - radius)
    polygons = [
        shapely.Polygon(obstacle["polygon"]) for obstacle in obstacles if "polygon" in obstacle
    ]
    if polygons:
        tree = shapely.STRtree(polygons)
        points = shapely.points(places)
        (near, _), distances = tree.query_nearest(points, return_distance=True, all_matches=False)
        out[near] = np.minimum(out[near], distances)
    return out


def _first_of(places: list[str]) -> str:
    """Return the first of some names and how many more there are."""
    return places[0] + (f" and {len(places) - 1} more" if len(places) > 1 else "")


def _is_height(name: str) -> bool:
    """Return whether the name of a property means a height."""
    try:
        meaning = column(name)
    except InputError:
        return False
    return meaning is not None and meaning.quantity == "z"


def _number_parts(entries: list[dict[str, Any]]) -> None:
    """Number the names of things that are parts of one collection: "pier 1", "pier 2"."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for entry in entries:
        whole, dot, _ = entry["where"].partition(".geometries[")
        if entry["name"] is not None and dot:
            groups.setdefault((whole, entry["name"]), []).append(entry)
    for (_, name), parts in groups.items():
        for number, part in enumerate(parts, 1):
            part["name"] = f"{name} {number}" if len(parts) > 1 else name


def _number_names(entries: list[dict[str, Any]]) -> list[tuple[str, str, str]]:
    """Number names that occur more than once ("pier", "pier 2"); return old, new and place."""
    used = {entry["name"] for entry in entries}
    seen: Counter[str] = Counter()
    changed = []
    for entry in entries:
        name = entry["name"]
        if name is None:
            continue
        seen[name] += 1
        number = seen[name]
        while number > 1:
            other = f"{name} {number}"
            if other not in used:
                entry["name"] = other
                used.add(other)
                changed.append((name, other, str(entry["where"])))
                break
            number += 1
        seen[name] = number
    return changed


def _label(entry: dict[str, Any]) -> str:
    return str(entry["where"]) + (f" ({entry['name']})" if entry["name"] else "")


def _metres(length: float) -> str:
    return f"{length / 1e3:.4g} km" if length >= 1e4 else f"{length:.4g} m"


def _whole(value: Any) -> int:
    number = _real(value)
    if number != int(number):
        raise ValueError(f"viewpoints: expected a whole number, got {shown(value)}")
    return int(number)


def _real(value: Any) -> float:
    if value is None:
        raise ValueError("standoff: missing; expected a distance from its surface")
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"expected a number, got {shown(value)}") from None


def _list(value: Any) -> list[float]:
    """Return the heights of a list, or of a text with commas or spaces as in tables."""
    values = value.replace(",", " ").split() if isinstance(value, str) else value
    return [_real(v) for v in (values if isinstance(values, list) else [values])]
