"""Mission: the waypoints that a robot on a tether visits in a scene, and its limits."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    WithJsonSchema,
    field_validator,
    model_serializer,
    model_validator,
)

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import (
    POINT3_SCHEMA,
    Name,
    NonNegative,
    Number,
    Point3,
    Positive,
    TrackPoint,
)
from netsp.base.files import FileModel, read_text
from netsp.base.validated import Model
from netsp.world.mission.equipment import Camera, PositionSensor, RangeSensor, TetherPhysics
from netsp.world.mission.planned_tour import PathField, PlannedTour
from netsp.world.scene.field import DistanceField, pushed_out
from netsp.world.scene.scene import Scene

MAX_DWELL_S = 86400.0
"""Format of mission files: longest dwell at a waypoint, s; more is likely a mistake of units."""


class Viewpoint(Model):
    """Alternative position and heading of a waypoint."""

    position: Annotated[Point3, Field(description="(x, y, z), m")]
    heading: Annotated[
        Annotated[Number, Field(ge=-360.0, le=360.0)] | None,
        Field(description="degrees from the x axis towards y; null for any"),
    ] = None


class MissionState(Model):
    """Position of a robot under way, and the line of its tether, which need not be taut."""

    position: Annotated[Point3, Field(description="(x, y, z) of the robot, m")]
    tether: Annotated[
        PathField,
        Field(description="line from the anchor to the robot along which its tether lies, m"),
    ]


class MissionWaypoint(Model):
    """Place to visit, with a heading to turn to and a time to stay.

    Only `netsp.plan.space.space_plan` considers the alternatives; planners visit `position`.
    """

    position: Annotated[Point3, Field(description="(x, y, z) to reach, m")]
    heading: Annotated[
        Annotated[Number, Field(ge=-360.0, le=360.0)] | None,
        Field(description="to turn to there, degrees from the x axis towards y; null for any"),
    ] = None
    dwell: Annotated[
        Annotated[NonNegative, Field(le=MAX_DWELL_S)],
        Field(description="seconds to stay there, at that heading"),
    ] = 0.0
    alternatives: Annotated[
        tuple[Viewpoint, ...], Field(description="other places that would do as well")
    ] = ()

    @model_serializer(mode="wrap")
    def _plain(self, handler: SerializerFunctionWrapHandler) -> Any:
        """Serialise as a bare position if no other field is set."""
        if self.heading is None and not self.dwell and not self.alternatives:
            return self.position
        data = handler(self)
        if not self.alternatives:
            del data["alternatives"]
        return data

    def at(self, choice: int) -> MissionWaypoint:
        """Return the waypoint at one of its alternatives, counted from 1; 0 is its own position.

        The own position then becomes an alternative.
        """
        if choice == 0:
            return self
        replaced = Viewpoint(position=self.position, heading=self.heading)
        chosen, rest = self.alternatives[choice - 1], list(self.alternatives)
        rest[choice - 1] = replaced
        return self.model_copy(
            update={
                "position": chosen.position,
                "heading": chosen.heading,
                "alternatives": tuple(rest),
            }
        )


def _waypoint(value: Any) -> Any:
    return value if isinstance(value, dict | MissionWaypoint) else {"position": value}


WaypointLike = Annotated[
    MissionWaypoint,
    BeforeValidator(_waypoint),
    WithJsonSchema(
        {
            "anyOf": [
                POINT3_SCHEMA,
                {
                    "type": "object",
                    "properties": {
                        "position": {**POINT3_SCHEMA, "description": "(x, y, z) to reach, m"},
                        "heading": {
                            "anyOf": [
                                {"type": "number", "minimum": -360, "maximum": 360},
                                {"type": "null"},
                            ],
                            "default": None,
                            "description": "to turn to there, degrees from the x axis towards y",
                        },
                        "dwell": {
                            "type": "number",
                            "minimum": 0,
                            "maximum": MAX_DWELL_S,
                            "default": 0,
                            "description": "seconds to stay there, at that heading",
                        },
                        "alternatives": {
                            "type": "array",
                            "items": Viewpoint.model_json_schema(),
                            "default": [],
                            "description": "other places that would do as well",
                        },
                    },
                    "required": ["position"],
                    "additionalProperties": False,
                },
            ]
        }
    ),
]


class Mission(FileModel):
    """Waypoints to visit in order, in a scene, with the limits of the robot and its tether.

    With a moving anchor, home is as far from the anchor as the start was, or at the anchor if there
    is no room. With a state, only waypoints still to be visited are listed. The planner
    `predictive` follows a planned tour (`netsp.plan.space.mission_solver`). The current does not
    act on a kinematic vehicle.

    Examples
    --------
    >>> mission = Mission.load("missions/basin.json")
    >>> len(mission.waypoints), mission.tether_length, mission.load_scene().name
    (97, 8.0, 'basin')
    """

    file_kind: ClassVar[str] = "mission"

    model_config = ConfigDict(title="netsp mission")

    schema_version: Annotated[Literal[1], Field(description="version of the file format")] = 1
    name: Annotated[Name, Field(description="name of the mission")] = "mission"
    scene: Annotated[str, Field(description="scene file, relative to this one")]
    anchor: Annotated[Point3, Field(description="(x, y, z) where the tether is fixed, m")]
    start: Annotated[
        Point3, Field(description="(x, y, z) where the robot starts and comes home to, m")
    ]
    track: Annotated[
        tuple[TrackPoint, ...],
        Field(
            description="(t, x, y, z) of a moving anchor after 0 s, s and m; empty if it does "
            "not move"
        ),
    ] = ()
    state: Annotated[
        MissionState | None,
        Field(
            description="present position of the robot and line of its tether; null at the start"
        ),
    ] = None
    waypoints: Annotated[
        Annotated[tuple[WaypointLike, ...], Field(min_length=1)],
        Field(description="(x, y, z) to reach in this order, m, or objects with more to do there"),
    ]
    tether_length: Annotated[Positive, Field(description="maximum length of the taut tether, m")]
    clearance: Annotated[
        NonNegative, Field(description="distance that paths keep from all solids, m")
    ] = 0.2
    reach: Annotated[
        Positive, Field(description="distance at which a waypoint counts as reached, m")
    ] = 0.1
    speed: Annotated[Positive, Field(description="speed of the robot, m/s")] = 0.3
    camera: Annotated[Camera | None, Field(description="camera of the robot; null for none")] = None
    inspect: Annotated[
        Annotated[tuple[Name, ...], Field(min_length=1)] | None,
        Field(description="names of the solids whose surface counts; null for all"),
    ] = None
    current: Annotated[Point3, Field(description="(x, y, z) of the water, m/s")] = (0.0, 0.0, 0.0)
    gusts: Annotated[
        NonNegative, Field(description="standard deviation of the current about its mean, m/s")
    ] = 0.0
    sensor: Annotated[
        PositionSensor, Field(description="noise and delay of positions; none by default")
    ] = PositionSensor()
    range_sensor: Annotated[
        RangeSensor | None,
        Field(
            description="sensor that sees solids which are not on the map; null if all changes "
            "are reported"
        ),
    ] = None
    tether: Annotated[
        TetherPhysics, Field(description="slack, drag and friction of the tether; none by default")
    ] = TetherPhysics()
    delta: Annotated[Positive, Field(description="resolution of the tether, m")] = 0.1
    cell: Annotated[
        Positive | None,
        Field(
            description="of the grid on which paths are sought, m; null for 0.2, or more where the "
            "site is large"
        ),
    ] = None
    tour: Annotated[
        PlannedTour | None,
        Field(
            description="tour that was planned through these waypoints; null to leave it to the "
            "planner"
        ),
    ] = None

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the mission in a file; its scene becomes relative to the working directory.

        Raises
        ------
        InputError
            The file cannot be read or is not valid, in one line.
        """
        mission = cls.from_json(read_text(path), source=str(path))
        return mission.model_copy(update={"scene": str(Path(path).parent / mission.scene)})

    @field_validator("track")
    @classmethod
    def _in_order(cls, rows: tuple[TrackPoint, ...]) -> tuple[TrackPoint, ...]:
        times = [0.0, *(row[0] for row in rows)]
        for k, (before, after) in enumerate(pairwise(times)):
            if after <= before:
                raise ValueError(
                    f"expected ascending times after 0 s, got {after:g} s in row {k} after "
                    f"{before:g} s"
                )
        return rows

    @model_validator(mode="after")
    def _state_fits(self) -> Self:
        if self.state is None:
            return self
        if self.track:
            raise ValueError("state: is for a fixed anchor; expected no track beside it")
        line = self.state.tether
        for name, end, place in (
            ("begins", line[0], self.anchor),
            ("ends", line[-1], self.state.position),
        ):
            off = float(np.linalg.norm(np.array(end) - place))
            if off > self.reach:
                raise ValueError(
                    f"state.tether: {name} {off:.2f} m from "
                    f"{'the anchor' if name == 'begins' else 'the robot'}; expected no more than "
                    f"{self.reach:g}"
                )
        return self

    @model_validator(mode="after")
    def _tour_fits(self) -> Self:
        if self.tour is not None:
            wrong = self.tour.mismatch(self.begin, self.start, self.places, self.reach)
            if wrong is not None:
                raise ValueError(f"tour.{wrong}")
        return self

    @property
    def begin(self) -> Point3:
        """Position of the robot when the mission begins, metres."""
        return self.start if self.state is None else self.state.position

    @property
    def places(self) -> Floats:
        """Positions (n, 3) of the waypoints, metres."""
        return np.array([w.position for w in self.waypoints]).reshape(-1, 3)

    @property
    def every_place(self) -> Floats:
        """Positions (n, 3) of all parts of the mission, metres: anchor and its track, start,
        waypoints, alternatives, and the tether of a state."""
        track = np.array(self.track).reshape(-1, 4)[:, 1:]
        others = [v.position for w in self.waypoints for v in w.alternatives]
        line = () if self.state is None else self.state.tether
        return np.vstack(
            [
                self.anchor,
                self.start,
                self.places,
                np.array(others).reshape(-1, 3),
                track,
                np.array(line).reshape(-1, 3),
            ]
        )

    def checked_waypoints(self, field: DistanceField, *, snap: bool = False) -> Self:
        """Return the mission after checking that no waypoint lies in a solid.

        Parameters
        ----------
        snap : bool
            Whether to move waypoints in solids out to the clearance instead of raising.

        Raises
        ------
        InputError
            A waypoint lies in a solid, and `snap` is false.
        """
        points = self.places
        inside = np.flatnonzero(field.distance(points) < 0.0)
        if not len(inside):
            return self
        if not snap:
            raise InputError(
                f"waypoints {', '.join(f'#{k}' for k in inside[:10])}"
                f"{' …' if len(inside) > 10 else ''} lie inside a solid; expected points in the "
                "water, or snap"
            )
        points[inside] = pushed_out(field, points[inside], self.clearance)
        moved = tuple(
            w.model_copy(update={"position": tuple(p)})
            for w, p in zip(self.waypoints, points.tolist(), strict=True)
        )
        return self.model_copy(update={"waypoints": moved})

    def load_scene(self) -> Scene:
        """Return the scene of the mission; raise InputError if it cannot be read."""
        return Scene.load(self.scene)
