"""Problem: the goals that a robot must visit, the obstacles, and the length of its tether.

Problems are frozen, and validated when they are created, so no other code has to check them. The
JSON format is version 1: `netsp schema problem` prints its schema, problems/README.md explains it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import (
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
    model_validator,
)

from netsp.base.arrays import Bools, Ints
from netsp.base.errors import InputError, counted
from netsp.base.field_types import (
    POINT3_SCHEMA,
    Integer,
    Name,
    NonNegative,
    Number,
    Point2,
    Point3,
    Positive,
    checked_argument,
    checked_number,
)
from netsp.base.files import FileModel
from netsp.base.geometry.polygons import (
    check_polygon,
    polygon_interior_point,
    polygon_signed_distance,
)
from netsp.base.reprs import Drawn
from netsp.base.validated import Model, explain, read_model, shown
from netsp.model.arrangement import arrangement_complaint, cluster_numbers, precedence_matrix
from netsp.model.import_record import Site
from netsp.model.shorthand import Inspection, expand_shorthand

if TYPE_CHECKING:
    import shapely


MAX_EXTENT_RATIO = 1e4
"""Tolerance for the extent of an obstacle within reach, as a multiple of the distance to the
farthest goal: beyond it, tolerances would be comparable to the distances between goals."""

MIN_WIDTH_RATIO = 1e-7
"""Tolerance for the width of an obstacle within reach, as a share of the problem's size: below it,
widths would be comparable to tolerances, and a tether could wrap the obstacle without end."""

RELATIVE_TOLERANCE = 1e-9
"""Tolerance for lengths that count as zero, such as gaps between touching shapes, as a share of the
problem's size."""


class Circle(Model):
    """Vertical cylinder of unlimited height, given by its plan: centre and radius.

    Examples
    --------
    >>> pile = Circle(center=(2, 0), radius=0.5, name="pile")
    >>> pile.signed_distance([(3, 0), (2, 0)])
    array([ 0.5, -0.5])
    """

    center: Annotated[Point2, Field(description="(x, y) of the axis, in the problem's units")]
    radius: Annotated[Positive, Field(description="radius of the circle, in the problem's units")]
    name: Annotated[Name | None, Field(description="name in pictures and messages")] = None

    @property
    def representative_point(self) -> tuple[float, float]:
        """Start of the obstacle's ray: the centre."""
        return self.center

    def signed_distance(self, xy: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return the distance of points (..., 2) to the outline, negative inside."""
        d = np.asarray(xy, dtype=float) - self.center
        return np.asarray(np.hypot(d[..., 0], d[..., 1]) - self.radius)

    def shape(self, grow: float = 0.0) -> shapely.Polygon:
        """Return the plan grown by a clearance, as an inscribed polygon of 256 sides."""
        import shapely

        return shapely.Point(self.center).buffer(self.radius + grow, quad_segs=64)


class Polygon(Model):
    """Vertical prism of unlimited height over a simple polygon, convex or not.

    Examples
    --------
    >>> pier = Polygon(polygon=[(0, 0), (4, 0), (4, 1), (0, 1)], name="pier")
    >>> pier.representative_point
    (2.0, 0.5)
    """

    polygon: Annotated[
        Annotated[tuple[Point2, ...], Field(min_length=3)],
        Field(description="corners (x, y) in order, not closed, in the problem's units"),
    ]
    name: Annotated[Name | None, Field(description="name in pictures and messages")] = None

    @model_validator(mode="after")
    def _simple(self) -> Self:
        check_polygon(self.polygon)
        return self

    @cached_property
    def representative_point(self) -> tuple[float, float]:
        """Start of the obstacle's ray: the centroid if it lies inside, else the middle of the
        widest horizontal chord at a fixed set of heights."""
        return polygon_interior_point(self.polygon)

    def signed_distance(self, xy: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return the distance of points (..., 2) to the outline, negative inside."""
        return polygon_signed_distance(self.polygon, xy)

    def shape(self, grow: float = 0.0) -> shapely.Polygon:
        """Return the plan grown by a clearance, with rounded corners."""
        import shapely

        shape = shapely.Polygon(self.polygon)
        return shape.buffer(grow, quad_segs=64) if grow > 0.0 else shape


def _obstacle_kind(value: Any) -> str | None:
    if isinstance(value, Circle):
        return "circle"
    if isinstance(value, Polygon):
        return "polygon"
    if isinstance(value, dict):
        if "polygon" in value:
            return "polygon"
        return "circle" if {"center", "radius"} & value.keys() else None
    return None


Obstacle = Annotated[
    Annotated[Circle, Tag("circle")] | Annotated[Polygon, Tag("polygon")],
    Discriminator(
        _obstacle_kind,
        custom_error_type="obstacle",
        custom_error_message='expected {"center": [x, y], "radius": r} or {"polygon": [[x, y], …]}',
    ),
]


class Goal(Model):
    """Point to inspect; of the goals of one choice, one suffices.

    Examples
    --------
    >>> Goal(position=(4, 0), name="anode").position
    (4.0, 0.0, 0.0)
    """

    position: Annotated[
        Point3, Field(description="(x, y) or (x, y, z) to visit, in the problem's units; z is up")
    ]
    name: Annotated[Name | None, Field(description="name in pictures and messages")] = None
    choice: Annotated[
        Name | None, Field(description="name of what it is an alternative for; null for none")
    ] = None
    after: Annotated[
        tuple[Name, ...], Field(description="names of goals or choices to be visited before it")
    ] = ()


def _goal(value: Any) -> Any:
    return value if isinstance(value, dict | Goal) else {"position": value}


GoalLike = Annotated[
    Goal,
    BeforeValidator(_goal),
    WithJsonSchema(
        {
            "anyOf": [
                POINT3_SCHEMA,
                {
                    "type": "object",
                    "properties": {
                        "name": {"type": "string"},
                        "position": POINT3_SCHEMA,
                        "choice": {"type": ["string", "null"]},
                        "after": {"type": "array", "items": {"type": "string"}},
                    },
                    "required": ["position"],
                    "additionalProperties": False,
                },
                {
                    "type": "object",
                    "properties": {
                        "name": {"type": "string"},
                        "any_of": {"type": "array", "minItems": 1},
                        "after": {"type": "array", "items": {"type": "string"}},
                    },
                    "required": ["any_of"],
                    "additionalProperties": False,
                },
                Inspection.model_json_schema(),
            ]
        }
    ),
]


class State(Model):
    """State of a robot on a tether: its position, and the word of the taut tether there.

    Examples
    --------
    >>> state = State(position=(4, 0), signature=[1])  # the tether passes obstacle 1 on its left
    >>> problem = Problem(base=(0, 0), goals=[(6, 0)], tether_length=9, state=state,
    ...                   obstacles=[Circle(center=(2, 0), radius=0.5)])
    >>> problem.state.signature
    (1,)
    """

    position: Annotated[Point3, Field(description="(x, y, z) of the robot, in the problem's units")]
    signature: Annotated[
        tuple[Integer, ...],
        Field(
            description="h-signature of its tether: obstacles numbered from 1 in the "
            "order their rays are crossed, negative from right to left"
        ),
    ] = ()


class Origin(Model):
    """Position of the base on the earth, and direction of the y axis."""

    latitude: Annotated[Number, Field(description="latitude of the base, degrees", ge=-90, le=90)]
    longitude: Annotated[
        Number, Field(description="longitude of the base, degrees", ge=-180, le=180)
    ]
    heading: Annotated[
        Number,
        Field(
            description="heading of the y axis, degrees clockwise from true north", ge=-360, le=360
        ),
    ] = 0.0


def _width(o: Circle | Polygon) -> float:
    """Return the extent of an obstacle along x or y, whichever is larger."""
    if isinstance(o, Circle):
        return 2.0 * o.radius
    return float(np.ptp(np.array(o.polygon), axis=0).max())


RUN_CONTEXT = {"of": "a run"}
"""Context that validates the map of a run, in which goals may lie in obstacles that appeared."""


class Problem(Drawn, FileModel):
    """Instance of the Non-Entangling Travelling Salesperson Problem.

    Source: McCammon & Hollinger 2017, section III.

    Attributes
    ----------
    base : (x, y) or (x, y, z)
        Position where the tether is fixed, and the tour starts and ends; z is up.
    goals : tuple of Goal
        Points to visit. A bare ``[x, y]`` or ``[x, y, z]`` is accepted, too, an `Inspection`, which
        becomes the goals around an obstacle, and ``{"any_of": […]}``, which becomes the goals of
        one choice.
    obstacles : tuple of Circle or Polygon
        Vertical projections of circles or simple polygons.
    tether_length : float
        Maximum length of the taut tether, measured in 3D from the base.
    clearance : float
        Length by which every obstacle is grown: the vehicle's radius.
    bounds : (xmin, ymin, xmax, ymax) or None
        Box that the robot's centre and the tether stay in. The corners of an outline are accepted
        instead: its bounding box is used, and four walls around it become obstacles.
    state : State or None
        Start of the tour; None if the robot starts at the base. From a state, the tour is the
        shortest path through all goals back to the base, with the whole tether recovered. Only at
        the start may the tether be longer than `tether_length`.
    units : str
        Name of the unit of length.
    origin : Origin or None
        Position of the base on the earth, and direction of the y axis, for exports.
    site : Site or None
        Map that the problem was imported from, and what each of its features became.

    Raises
    ------
    InputError
        A value breaks the format; `load` and `from_json` raise it, too.

    Examples
    --------
    >>> problem = Problem(base=(0, 0), goals=[(4, 0)], tether_length=5,
    ...                   obstacles=[Circle(center=(2, 0), radius=1)])
    >>> problem.goals[0].position
    (4.0, 0.0, 0.0)
    """

    picture: ClassVar[str] = "netsp.view.pictures.problem_picture:draw_map"
    file_kind: ClassVar[str] = "problem"

    model_config = ConfigDict(title="netsp problem")

    schema_version: Annotated[Literal[1], Field(description="version of the file format")] = 1
    name: Annotated[Name, Field(description="name of the problem")] = "problem"
    base: Annotated[
        Point3,
        Field(description="(x, y) or (x, y, z) where the tether is fixed, in the problem's units"),
    ]
    goals: Annotated[
        Annotated[tuple[GoalLike, ...], Field(min_length=1)], Field(description="places to visit")
    ]
    obstacles: Annotated[
        tuple[Obstacle, ...],
        Field(
            description="circles and polygons that stand vertically through all "
            "depths; the tether and the robot keep out"
        ),
    ] = ()
    tether_length: Annotated[
        Positive, Field(description="maximum length of the taut tether, in the problem's units")
    ]
    clearance: Annotated[
        NonNegative, Field(description="distance kept from all obstacles, in the problem's units")
    ] = 0.0
    bounds: Annotated[
        Annotated[
            tuple[float, float, float, float] | None,
            WithJsonSchema(
                {
                    "anyOf": [
                        {
                            "type": "array",
                            "items": {"type": "number"},
                            "minItems": 4,
                            "maxItems": 4,
                        },
                        {
                            "type": "array",
                            "items": {
                                "type": "array",
                                "items": {"type": "number"},
                                "minItems": 2,
                                "maxItems": 2,
                            },
                            "minItems": 3,
                        },
                        {"type": "null"},
                    ]
                }
            ),
        ],
        Field(
            description="[xmin, ymin, xmax, ymax] of the workspace or corners of its outline, "
            "whose outside becomes obstacles; in the problem's units; null for none"
        ),
    ] = None
    units: Annotated[Name, Field(description="name of the unit of length")] = "m"
    origin: Annotated[
        Origin | None, Field(description="position of the base on the earth; null if unknown")
    ] = None
    state: Annotated[
        State | None,
        Field(
            description="start away from the base, with the tether out; null to start at the base"
        ),
    ] = None
    site: Annotated[
        Site | None,
        Field(description="the map that was imported, and what became of it; null for none"),
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _expand(cls, data: Any) -> Any:
        return expand_shorthand(data) if isinstance(data, dict) else data

    @field_validator("bounds", mode="before")
    @classmethod
    def _box(cls, value: Any) -> Any:
        if value is None:
            return None
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 4:
            raise ValueError(f"expected [xmin, ymin, xmax, ymax], got {shown(value)}")
        box = tuple(checked_number(v) for v in value)
        if not (box[0] < box[2] and box[1] < box[3]):
            raise ValueError(f"expected xmin < xmax and ymin < ymax, got {list(box)}")
        return box

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> Self:
        self._check_distinct_goals()
        if complaint := arrangement_complaint(self.goals) or self.size_complaint():
            raise ValueError(complaint)
        self._check_free(goals=info.context != RUN_CONTEXT)
        self._check_state()
        self._check_crop()
        return self

    def _check_crop(self) -> None:
        """Raise ValueError if the tether reaches beyond the part of the map that was imported."""
        circle = None if self.site is None else self.site.cropped
        if circle is None:
            return
        away = float(np.hypot(*np.subtract(self.base[:2], circle.center)))
        room = circle.radius - away - self.clearance
        if self.tether_length > room * (1.0 + 1e-9):
            raise ValueError(
                f"tether_length: {self.tether_length:g} reaches beyond the part of the map that "
                f"was imported; expected at most {room:.6g}, or another import with this tether"
            )

    def _check_state(self) -> None:
        """Raise ValueError if the robot is not in free space, or a letter of its word is no
        obstacle."""
        if self.state is None:
            return
        xy = np.array(self.state.position[:2])
        for i, o in enumerate(self.obstacles):
            depth = self.clearance - float(o.signed_distance(xy))
            if depth > self.tolerance:
                raise ValueError(
                    f"state.position: {_point_text(self.state.position)} lies inside "
                    f"{self._obstacle_field(i)} (by {depth:.6g}); expected a point in free space"
                )
        for a in self.state.signature:
            if not 1 <= abs(a) <= len(self.obstacles):
                raise ValueError(
                    f"state.signature: expected letters from 1 to {len(self.obstacles)} or their "
                    f"negatives, got {a}"
                )

    def _check_distinct_goals(self) -> None:
        seen: dict[tuple[float, float, float], int] = {}
        for k, goal in enumerate(self.goals):
            first = seen.setdefault(goal.position, k)
            if first != k:
                raise ValueError(
                    f"{self._goal_field(k)}: same position {_point_text(goal.position)} as "
                    f"{self._goal_field(first)}; expected distinct goals"
                )

    def size_complaint(self) -> str | None:
        """Return what is wrong with the size of an obstacle within reach, or None.

        Tolerances are shares of the largest size. An obstacle that is too large would merge goals
        beside it, and one that is too small would vanish.
        """
        reach = self.tether_length + self.clearance
        away = float(np.abs(self.points - np.array(self.base)).max())
        for i, o in enumerate(self.obstacles):
            near, far = self._span(o)
            if near <= reach and far > MAX_EXTENT_RATIO * max(away, 1e-3 * reach):
                return (
                    f"{self._obstacle_field(i)}: reaches {far:.6g} from the base, and no goal is "
                    f"farther than {away:.6g}; expected at most {MAX_EXTENT_RATIO:g} times as far"
                )
        min_width = MIN_WIDTH_RATIO * self.scale
        for i, o in enumerate(self.obstacles):
            near, _ = self._span(o)
            width = 2.0 * self.clearance + _width(o)
            if near <= reach and width < min_width:
                return (
                    f"{self._obstacle_field(i)}: is {width:.3g} wide, too little for a problem of "
                    f"size {self.scale:.6g}; expected at least {min_width:.3g}"
                )
        return None

    def _check_free(self, *, goals: bool) -> None:
        """Raise ValueError if the base is outside the bounds or in a grown obstacle.

        Goals are checked, too, if `goals` is true.
        """
        xy, tolerance = self.points[: None if goals else 1, :2], self.tolerance
        outside: npt.NDArray[np.bool_] = np.zeros(len(xy), dtype=bool)
        if self.bounds is not None:
            low, high = np.array(self.bounds[:2]), np.array(self.bounds[2:])
            outside = np.any((xy < low - tolerance) | (xy > high + tolerance), axis=1)
        distances = np.array([o.signed_distance(xy) for o in self.obstacles]).reshape(-1, len(xy))
        inside = distances < self.clearance - tolerance
        for k in np.flatnonzero(outside | inside.any(axis=0)):
            position = self.base if k == 0 else self.goals[k - 1].position
            label = "base" if k == 0 else self._goal_field(int(k) - 1)
            if outside[k]:
                raise ValueError(
                    f"{label}: {_point_text(position)} is outside bounds {list(self.bounds or ())}"
                )
            i = int(np.argmax(inside[:, k]))
            grown = f" grown by the clearance {self.clearance:g}" if self.clearance else ""
            raise ValueError(
                f"{label}: {_point_text(position)} lies inside {self._obstacle_field(i)}{grown} "
                f"(by {self.clearance - distances[i, k]:.6g}); expected a point in free space"
            )

    @cached_property
    def scale(self) -> float:
        """Size of the problem, the unit of every tolerance.

        It is the largest difference along x or y between the base and any goal, or any obstacle
        within the tether's reach. Geometry is computed relative to the base, so large coordinates
        (UTM) lose no precision.
        """
        reach = self.tether_length + self.clearance
        away = [float(np.abs(self.points[:, :2] - np.array(self.base[:2])).max())]
        for o in self.obstacles:
            near, far = self._span(o)
            if near <= reach:
                away.append(far)
        return max(*away, 1e-9 * self.tether_length)

    def _span(self, o: Circle | Polygon) -> tuple[float, float]:
        """Return the distance from the base to an obstacle, and to its farthest point along x or
        y."""
        base = np.array(self.base[:2])
        if isinstance(o, Circle):
            off = np.abs(np.array(o.center) - base)
            return float(np.hypot(*off)) - o.radius, float(off.max()) + o.radius
        near = max(float(o.signed_distance(base)), 0.0)
        return near, float(np.abs(np.array(o.polygon) - base).max())

    @property
    def tolerance(self) -> float:
        """Length below which a depth, gap or penetration counts as zero."""
        resolution = 4.0 * float(np.spacing(np.abs(self.points[:, :2]).max()))
        return max(RELATIVE_TOLERANCE * self.scale, resolution)

    @property
    def representative_points(self) -> npt.NDArray[np.float64]:
        """Starts (n, 2) of the obstacles' rays."""
        return np.array([o.representative_point for o in self.obstacles]).reshape(-1, 2)

    @property
    def points(self) -> npt.NDArray[np.float64]:
        """Positions (1 + m, 3) of the base, then of the goals."""
        return np.array([self.base, *(g.position for g in self.goals)], dtype=float)

    @cached_property
    def clusters(self) -> Ints:
        """Cluster (m,) of each goal, from 1; goals of one choice share a cluster."""
        return cluster_numbers(self.goals)

    @cached_property
    def precedences(self) -> Bools:
        """Matrix (c + 1, c + 1) of precedences, true at (a, b) if cluster a comes before b; (0, 0)
        without precedences."""
        return precedence_matrix(self.goals)

    @property
    def visits(self) -> int:
        """Number of visits of a tour, which visits one goal of each choice."""
        return int(self.clusters.max())

    def goal_name(self, k: int) -> str:
        """Return the name of a goal in tables and pictures, ``#k`` if it has none."""
        return self.goals[k].name or f"#{k}"

    def obstacle_name(self, i: int) -> str:
        """Return the name of an obstacle in tables and pictures, ``#i`` if it has none."""
        return self.obstacles[i].name or f"#{i}"

    def goal_label(self, k: int) -> str:
        """Return the label of a goal in messages: ``goal B1``, or ``goal #k`` if it has no name."""
        return f"goal {self.goal_name(k)}"

    def obstacle_label(self, i: int) -> str:
        """Return the label of an obstacle in messages: ``obstacle pier``, or ``obstacle #i``
        without name."""
        return f"obstacle {self.obstacle_name(i)}"

    def _goal_field(self, k: int) -> str:
        """Return the field of a goal in the file, for complaints."""
        name = self.goals[k].name
        return f"goals[{k}]" + (f" ({name})" if name else "")

    def _obstacle_field(self, i: int) -> str:
        name = self.obstacles[i].name
        return f"obstacles[{i}]" + (f" ({name})" if name else "")

    def grown(self, margin: float, slack: float = 0.0) -> Problem:
        """Return the problem with obstacles grown by a margin, and with a part of the tether kept
        in reserve.

        Parameters
        ----------
        margin : float
            Additional clearance, not negative, in the problem's units.
        slack : float
            Slack tether that may be out, as a share of the taut length, 0 to 1.

        Raises
        ------
        InputError
            The margin is negative, or base or a goal lies inside a grown obstacle.
        """
        more = checked_argument("margin", margin, 0.0)
        length = self.tether_length / (1.0 + checked_argument("slack", slack, 0.0, 1.0))
        try:
            fields = {name: getattr(self, name) for name in Problem.model_fields}
            return Problem.model_validate(
                {**fields, "clearance": self.clearance + more, "tether_length": length}
            )
        except ValidationError as error:
            raise InputError(f"margin {more:g}: {explain(error)}") from None

    # JSON in and out

    @classmethod
    def from_run(cls, text: str | bytes, source: str) -> Self:
        """Return the map of a run, in which goals may lie in obstacles that appeared.

        Parameters
        ----------
        text : str or bytes
            JSON of a problem file.
        source : str
            Name of the text in messages.

        Raises
        ------
        InputError
            The text is not valid, in one line.
        """
        return read_model(cls, text, source, RUN_CONTEXT)

    @property
    def summary(self) -> str:
        """Phrase with the numbers of goals and obstacles and the length of the tether."""
        return (
            f"{self._goals_in_words}, {counted(len(self.obstacles), 'obstacle')}, "
            f"tether {self.tether_length:g} {self.units}"
        )

    @property
    def _goals_in_words(self) -> str:
        goals = counted(self.visits, "goal")
        return goals if self.visits == len(self.goals) else f"{goals} of {len(self.goals)} places"

    def __repr__(self) -> str:
        """Return the name and the summary in one line."""
        return f"<Problem {self.name!r}: {self.summary}>"

    __str__ = __repr__

    def to_json(self) -> str:
        """Return the problem as JSON of format version 1; reading it gives an equal problem."""
        data = self.model_dump(mode="json", exclude_none=True)
        for goal in data["goals"]:
            if not goal["after"]:
                del goal["after"]
        return json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n"

    @property
    def sha256(self) -> str:
        """Hash of all values that the tour depends on: names, units and origin do not count."""
        data = self.model_dump(mode="json", exclude={"name", "units", "origin", "site"})
        if data["state"] is None:  # as in older versions, whose hashes must stay valid
            del data["state"]
        for k, goal in enumerate(data["goals"]):  # likewise for relations between goals
            cluster = self.clusters[k]
            if goal.pop("choice") is not None and (self.clusters == cluster).sum() > 1:
                goal["cluster"] = int(cluster)
            if goal.pop("after"):
                goal["after"] = np.flatnonzero(self.precedences[:, cluster]).tolist()
        for item in (*data["goals"], *data["obstacles"]):
            item.pop("name", None)
        text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()


def _point_text(position: Sequence[float]) -> str:
    return "(" + ", ".join(f"{v:g}" for v in position) + ")"
