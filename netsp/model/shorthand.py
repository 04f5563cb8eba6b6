"""Shorthand of problem files, and its expansion.

Structures to inspect, choices and outlines exist in files only; problems have goals and boxes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError

from netsp.base.field_types import Integer, Name, Number, Point2, Positive
from netsp.base.geometry.polygons import check_polygon
from netsp.base.validated import Model, explain, shown, shown_names

MAX_VIEWPOINTS = 1000
"""Format limit of problem files: viewpoints about one structure at one depth."""


class Inspection(Model):
    """Structure to inspect from all sides; it expands to a goal at each viewpoint.

    Attributes
    ----------
    inspect : str
        Name of the obstacle.
    viewpoints : int
        Number of viewpoints at each depth, spaced evenly around a circle or along the outline of a
        polygon.
    standoff : float
        Distance of the viewpoints from the surface, in the problem's units.
    depths : tuple of float
        Heights z of the viewpoints, in the problem's units; negative below the water surface.
    bearing : float
        Direction of the first viewpoint, degrees clockwise from the y axis.
    after : tuple of str
        Names of goals or choices that must be visited before all goals of the structure.
    """

    inspect: Annotated[Name, Field(description="name of the obstacle to look at from all sides")]
    viewpoints: Annotated[Integer, Field(description="at every depth", ge=1, le=MAX_VIEWPOINTS)] = 4
    standoff: Annotated[
        Positive, Field(description="distance of viewpoints from its surface, problem's units")
    ]
    depths: Annotated[
        Annotated[tuple[Number, ...], Field(min_length=1)],
        Field(description="heights z of the viewpoints, in the problem's units"),
    ] = (0.0,)
    bearing: Annotated[
        Number, Field(description="of the first viewpoint, degrees clockwise from the y axis")
    ] = 0.0
    after: Annotated[
        tuple[Name, ...], Field(description="names of goals or choices to be visited before")
    ] = ()

    def goals(self, shape: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Return the goals around an obstacle, `shape`; both are objects as in a problem file.

        The first viewpoint comes first, at each depth, then the second one, and so on.
        """
        places = self._viewpoint_places(shape)
        return [
            {
                "name": f"{self.inspect}/{k}" + (f" z{z:g}" if len(self.depths) > 1 else ""),
                "position": [float(x), float(y), z],
                **({"after": list(self.after)} if self.after else {}),
            }
            for k, (x, y) in enumerate(places, 1)
            for z in self.depths
        ]

    def _viewpoint_places(self, shape: Mapping[str, Any]) -> np.ndarray:
        """Return the viewpoints (n, 2) around the obstacle."""
        turns = np.arange(self.viewpoints) / self.viewpoints
        if "radius" in shape:
            angle = math.radians(self.bearing) + 2.0 * math.pi * turns
            distance = float(shape["radius"]) + self.standoff
            # rounded, so that no coordinate is 1e-16
            directions = np.round(np.column_stack([np.sin(angle), np.cos(angle)]), 15)
            return np.asarray(np.array(shape["center"]) + distance * directions)
        import shapely

        polygon = shapely.Polygon(shape["polygon"])
        line = polygon.buffer(self.standoff, quad_segs=64).exterior
        middle = np.array(polygon.centroid.coords[0])
        off = shapely.get_coordinates(line) - middle
        bearings = np.degrees(np.arctan2(off[:, 0], off[:, 1]))
        first = int(np.argmin(np.abs((bearings - self.bearing + 180.0) % 360.0 - 180.0)))
        start = line.project(shapely.Point(off[first] + middle))
        # clockwise, as bearings are counted
        positions = start + (1.0 if not line.is_ccw else -1.0) * turns * line.length
        return np.array([line.interpolate(s % line.length).coords[0] for s in positions])


def expand_shorthand(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the fields of a problem with all shorthand expanded.

    Other fields need not be valid. Data without shorthand are returned unchanged, not copied.

    Raises
    ------
    ValueError
        Shorthand that cannot be expanded; the message names its field.
    """
    return _with_goals(_with_walls(data))


def _with_goals(data: Mapping[str, Any]) -> Mapping[str, Any]:
    goals = data.get("goals")
    if not isinstance(goals, Sequence) or isinstance(goals, str):
        return data
    inspections = [
        isinstance(g, Inspection) or (isinstance(g, dict) and "inspect" in g) for g in goals
    ]
    choices = [isinstance(g, dict) and "any_of" in g for g in goals]
    if not any(inspections) and not any(choices):
        return data
    obstacles = [o.model_dump() if isinstance(o, Model) else o for o in data.get("obstacles") or ()]
    named = {o["name"]: o for o in obstacles if isinstance(o, dict) and o.get("name") is not None}
    out: list[Any] = []
    inspected: dict[str, list[str]] = {}
    for k, goal in enumerate(goals):
        if choices[k]:
            out += _alternatives(goal, k)
            continue
        if not inspections[k]:
            out.append(goal)
            continue
        try:
            inspection = Inspection.model_validate(goal)
        except ValidationError as error:
            raise ValueError(f"goals[{k}].{explain(error)}") from None
        obstacle = named.get(inspection.inspect)
        if obstacle is None:
            raise ValueError(
                f"goals[{k}].inspect: expected the name of an obstacle, got "
                f"{shown(inspection.inspect)}; there are {shown_names(named)}"
            )
        try:
            made = inspection.goals(obstacle)
        except (KeyError, TypeError, ValueError):
            # the obstacle is not valid, and validation will report it instead of its goals
            made = [{"name": inspection.inspect, "position": [0.0, 0.0]}]
        inspected.setdefault(inspection.inspect, []).extend(g["name"] for g in made)
        out += made
    return {**data, "goals": [_after_all_of(inspected, g) for g in out]}


def _alternatives(goal: Mapping[str, Any], k: int) -> list[dict[str, Any]]:
    """Return the goals of one choice."""
    places = goal["any_of"]
    unknown = sorted(goal.keys() - {"any_of", "name", "after"})
    if unknown:
        raise ValueError(f"goals[{k}].{unknown[0]}: unknown field; expected any_of, name, after")
    if not isinstance(places, Sequence) or isinstance(places, str) or not places:
        raise ValueError(
            f"goals[{k}].any_of: expected places, of which one suffices, got {shown(places)}"
        )
    name = goal.get("name") or f"choice {k}"
    out = []
    for j, place in enumerate(places):
        one = dict(place) if isinstance(place, dict) else {"position": place}
        if extra := sorted(one.keys() - {"position", "name"}):
            raise ValueError(
                f"goals[{k}].any_of[{j}].{extra[0]}: unknown field; expected position, name"
            )
        one = {"name": f"{name}/{j + 1}", **one, "choice": name}
        out.append({**one, "after": goal["after"]} if goal.get("after") else one)
    return out


def _after_all_of(inspected: Mapping[str, list[str]], goal: Any) -> Any:
    """Return a goal in whose `after` the name of a structure is replaced by its goals."""
    after = goal.get("after") if isinstance(goal, dict) else None
    if not isinstance(after, Sequence) or isinstance(after, str):
        return goal
    names = (inspected.get(n, [n]) if isinstance(n, str) else [n] for n in after)
    return {**goal, "after": [n for several in names for n in several]}


def _with_walls(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the data with an outline as bounds replaced by its bounding box and walls.

    The walls extend beyond the box, so that no path leads around them. They are obstacles, so
    robots keep their clearance from them.
    """
    bounds = data.get("bounds")
    if isinstance(bounds, np.ndarray):
        bounds = bounds.tolist()
    if (
        not isinstance(bounds, Sequence)
        or isinstance(bounds, str)
        or not all(isinstance(c, Sequence) and not isinstance(c, str) for c in bounds)
        or not bounds
    ):
        return data
    try:
        corners = _Outline.model_validate({"corners": bounds}).corners
        check_polygon(corners)
    except ValidationError as error:
        raise ValueError(f"bounds{explain(error).removeprefix('corners')}") from None
    except ValueError as error:
        raise ValueError(f"bounds: {error}") from None
    xy = np.array(corners)
    box, walls = _box_and_walls(xy)
    taken = {o.get("name") for o in data.get("obstacles") or () if isinstance(o, dict)}
    free = (n for n in (f"wall {k}" for k in itertools.count(1)) if n not in taken)
    return {
        **data,
        "bounds": box.ravel().tolist(),
        "obstacles": [
            *(data.get("obstacles") or ()),
            *({"name": next(free), "polygon": wall} for wall in walls),
        ],
    }


class _Outline(Model):
    corners: Annotated[tuple[Point2, ...], Field(min_length=3)]


def _box_and_walls(
    xy: np.ndarray, margin_share: float = 0.05
) -> tuple[np.ndarray, list[list[list[float]]]]:
    """Return the bounding box (low, high) of an outline, and the walls that fill it up.

    The walls are four polygons. They meet where the outline touches the sides of the box, and
    extend beyond the box by a share of its longer side.
    """
    import shapely

    low, high = xy.min(0), xy.max(0)
    margin = margin_share * float((high - low).max())
    outer = shapely.box(*(low - margin), *(high + margin))
    cuts = []
    for axis in (0, 1):
        for edge, end in ((low, -margin), (high, margin)):
            at = xy[int(np.argmin(np.abs(xy[:, axis] - edge[axis])))]
            beyond = at.copy()
            beyond[axis] = edge[axis] + end
            cuts.append(shapely.LineString([at, beyond]))
    outline = shapely.Polygon(xy)
    lines = shapely.union_all([outer.exterior, outline.exterior, *cuts])
    middle = outline.representative_point()
    walls = [
        shapely.get_coordinates(face.exterior)[:-1].tolist()
        for face in shapely.polygonize([lines]).geoms
        if not face.contains(middle)
    ]
    return np.array([low, high]), walls
