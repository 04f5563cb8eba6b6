"""Surprise file of a mission: events that happen while the robot is under way."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field

from netsp.base.errors import InputError
from netsp.base.field_types import Name, Point3, Positive
from netsp.base.files import FileModel
from netsp.base.validated import Model, shown_names
from netsp.world.mission.mission import Mission, WaypointLike
from netsp.world.mission.mission_limits import check_bounds
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene, Solid
from netsp.world.simulator.timed_events import TimedEvent, check_in_turn


class SolidMove(Model):
    """Move of a solid."""

    solid: Annotated[Name, Field(description="name of the solid")]
    by: Annotated[Point3, Field(description="(x, y, z) by which the solid moves, m")]


class SceneEvent(TimedEvent):
    """Event at a time after the start; exactly one of the other fields is set.

    Events at 0 s describe how the scene has been from the beginning. Waypoints are numbered as in
    the mission file; added ones come after all others.
    """

    appear: Annotated[Solid | None, Field(description="a solid that is there from now on")] = None
    vanish: Annotated[Name | None, Field(description="name of a solid that is gone")] = None
    move: Annotated[SolidMove | None, Field(description="a solid that moves")] = None
    add_waypoint: Annotated[
        WaypointLike | None, Field(description="another waypoint: (x, y, z), m, or an object")
    ] = None
    cancel_waypoint: Annotated[
        Annotated[int, Field(ge=0)] | None,
        Field(description="number of a waypoint that need not be visited"),
    ] = None
    push: Annotated[
        Point3 | None, Field(description="(x, y, z) by which the robot is displaced, m")
    ] = None
    tether_length: Annotated[
        Positive | None, Field(description="maximum length of the taut tether from now on, m")
    ] = None

    @property
    def changes_scene(self) -> bool:
        """True if a solid appears, vanishes or moves."""
        return any(v is not None for v in (self.appear, self.vanish, self.move))


class SceneSurprises(FileModel):
    """Surprise file of a mission.

    >>> text = '{"schema_version": 1, "events": [{"time": 60, "vanish": "pile 3"}]}'
    >>> SceneSurprises.from_json(text).events[0].vanish
    'pile 3'
    """

    file_kind: ClassVar[str] = "scene surprises"

    model_config = ConfigDict(title="netsp scene surprises")

    schema_version: Annotated[Literal[1], Field(description="version of the file format")] = 1
    events: Annotated[tuple[SceneEvent, ...], Field(description="events in any order")]

    def by_time(self) -> list[SceneEvent]:
        """Return the events in order of time, and of the file if times are equal."""
        return sorted(self.events, key=lambda e: e.time)

    def check(self, scene: Scene, source: str = "", waypoints: int | None = None) -> None:
        """Raise InputError for events that a scene or a mission cannot have.

        They name a solid or waypoint that does not exist at their time, or use a name twice.

        Parameters
        ----------
        source : str
            Name of the file in messages; empty for none.
        waypoints : int, optional
            Number of waypoints in the mission.
        """

        def after(
            known: tuple[tuple[Solid, ...], int | None], event: SceneEvent
        ) -> tuple[tuple[Solid, ...], int | None]:
            solids, count = solids_after(known[0], event), known[1]
            if count is not None:
                count += event.add_waypoint is not None
                if (event.cancel_waypoint or 0) >= count:
                    raise InputError(
                        f"cancel_waypoint: no waypoint #{event.cancel_waypoint}; expected #0 to "
                        f"#{count - 1}"
                    )
            return solids, count

        check_in_turn(self.events, (scene.all_solids(), waypoints), after, source)

    def check_places(
        self, mission: Mission, scene: Scene, field: DistanceField, source: str = ""
    ) -> None:
        """Raise InputError for waypoints that no mission can have, and for pushes beyond twice the
        tether length.

        Parameters
        ----------
        scene : Scene
            Map at the beginning; solids that appear later are ignored.
        source : str
            Name of the file in messages; empty for none.
        """
        for k, event in enumerate(self.events):
            where = f"{source}: events[{k}]" if source else f"events[{k}]"
            if event.add_waypoint is not None:
                more = mission.model_copy(update={"waypoints": (event.add_waypoint,), "tour": None})
                try:
                    check_bounds(more, scene)
                    more.checked_waypoints(field)
                except InputError as error:
                    raise InputError(f"{where}.add_waypoint: {error}") from None
            if event.push is not None:
                far = float(np.linalg.norm(event.push))
                if far > 2.0 * mission.tether_length:
                    raise InputError(
                        f"{where}.push: carries the robot {far:.4g} m off; expected at most twice "
                        f"the tether's length, {2.0 * mission.tether_length:g}"
                    )


def solids_after(solids: tuple[Solid, ...], event: SceneEvent) -> tuple[Solid, ...]:
    """Return the solids after an event.

    Raises
    ------
    InputError
        The event names a solid that does not exist, or adds one whose name is taken.
    """
    if not event.changes_scene:
        return solids
    names = [s.name for s in solids]
    if event.appear is not None:
        if event.appear.name is not None and event.appear.name in names:
            raise InputError(f"appear: a solid is named {event.appear.name!r} already")
        return (*solids, event.appear)
    name = event.vanish if event.move is None else event.move.solid
    field = "vanish" if event.move is None else "move.solid"
    if name not in names:
        raise InputError(f"{field}: no solid is named {name!r}; there are {shown_names(names)}")
    which = names.index(name)
    new = () if event.move is None else (moved_solid(solids[which], event.move.by),)
    return (*solids[:which], *new, *solids[which + 1 :])


def moved_solid(solid: Solid, by: Point3) -> Solid:
    """Return a solid moved by (x, y, z), metres."""
    kind = next(k for k in type(solid).model_fields if getattr(solid, k) is solid.shape)
    shape = solid.shape.model_dump()
    update: dict[str, Any] = {
        key: tuple(v + d for v, d in zip(place, by, strict=False))
        for key, place in shape.items()
        if key in ("a", "b", "center", "point")
    }
    if "polygon" in shape:
        update["polygon"] = tuple((x + by[0], y + by[1]) for x, y in shape["polygon"])
    return solid.model_copy(update={kind: solid.shape.model_copy(update=update)})
