"""A mission: what a robot on a tether is to visit in a scene, and within what limits."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from netsp.errors import InputError
from netsp.fields import STRICT, Name, NonNegative, Point3, Positive
from netsp.files import read_text
from netsp.models import read_model
from netsp.online.scene.field import DistanceField, pushed_out
from netsp.online.scene.scene import Scene


class Camera(BaseModel):
    """What the robot sees with.

    range : metres. field_of_view : degrees, both ways. tilt : degrees that it turns up or down at
    most. patch : metres; pieces of surface that coverage is counted in.
    """

    model_config = STRICT

    range: Positive = 2.0
    field_of_view: Annotated[float, Field(gt=0.0, lt=180.0)] = 70.0
    tilt: Annotated[float, Field(ge=0.0, le=90.0)] = 90.0
    patch: Positive = 0.1


class Mission(BaseModel):
    """Waypoints to visit in their order.

    Attributes
    ----------
    scene : scene file, relative to the mission file.
    anchor : where the tether is fixed; start : where the robot is at first, in sight of it.
    waypoints : to be visited in this order.
    tether_length : metres of taut tether that must never be exceeded.
    clearance : metres that the robot keeps from solids, where it can.
    reach : metres; a waypoint this near counts as visited.
    speed : metres per second.
    camera : what coverage is counted for; none without. inspect : names of the solids to be seen,
        default all.
    current : m/s, a steady current; gusts : m/s, standard deviation of what comes and goes on top.
        A kinematic vehicle feels neither.
    delta : metres; resolution of the tether. cell : metres; of the grid that ways are sought on.

    Raises
    ------
    InputError : from `load`, in one line.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", title="netsp mission")

    schema_version: Literal[1] = 1
    name: Name = "mission"
    scene: str
    anchor: Point3
    start: Point3
    waypoints: Annotated[tuple[Point3, ...], Field(min_length=1)]
    tether_length: Positive
    clearance: NonNegative = 0.2
    reach: Positive = 0.1
    speed: Positive = 0.3
    camera: Camera | None = None
    inspect: Annotated[tuple[Name, ...], Field(min_length=1)] | None = None
    current: Point3 = (0.0, 0.0, 0.0)
    gusts: NonNegative = 0.0
    delta: Positive = 0.1
    cell: Positive = 0.2

    @classmethod
    def from_json(cls, text: str | bytes, *, source: str = "mission") -> Self:
        """Parse and validate; `InputError` with one line for anything wrong."""
        return read_model(cls, text, source)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a mission file; the scene's name becomes relative to the working directory."""
        mission = cls.from_json(read_text(path), source=str(path))
        return mission.model_copy(update={"scene": str(Path(path).parent / mission.scene)})

    def checked_waypoints(self, field: DistanceField, *, snap: bool = False) -> Self:
        """The mission with every waypoint outside of solids: those inside are moved out to the
        clearance with `snap`, else refused with their numbers (InputError)."""
        points = np.array(self.waypoints)
        inside = np.flatnonzero(field.distance(points) < 0.0)
        if not len(inside):
            return self
        if not snap:
            raise InputError(
                f"waypoints {', '.join(map(str, inside[:10]))}"
                f"{' …' if len(inside) > 10 else ''} lie inside a solid; move them out with --snap"
            )
        points[inside] = pushed_out(field, points[inside], self.clearance)
        return self.model_copy(update={"waypoints": tuple(map(tuple, points.tolist()))})

    def load_scene(self) -> Scene:
        """The scene it takes place in."""
        return Scene.load(self.scene)
