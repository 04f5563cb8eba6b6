"""What may change in a scene while a robot is under way: the surprise file of a mission."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from netsp.errors import InputError
from netsp.fields import Name, NonNegative, Point3
from netsp.files import FileModel
from netsp.models import Model
from netsp.online.scene.scene import Scene, Solid


class SolidMove(Model):
    """A solid is somewhere else from now on."""

    solid: Annotated[Name, Field(description="its name")]
    by: Annotated[Point3, Field(description="(x, y, z) to move it by, m")]


class SceneEvent(Model):
    """Something that happens at a time after the start; one of the other fields says what.

    Attributes
    ----------
    time : float
        Seconds since the start; what happens at 0 was there, or not, from the beginning.
    appear : Solid or None
        A solid that is not on the map.
    vanish : str or None
        Name of a solid that is not there after all.
    move : SolidMove or None
        A solid that moves.
    """

    time: Annotated[NonNegative, Field(description="seconds after the start")]
    appear: Annotated[Solid | None, Field(description="a solid that is there from now on")] = None
    vanish: Annotated[Name | None, Field(description="name of a solid that is gone")] = None
    move: Annotated[SolidMove | None, Field(description="a solid that moves")] = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        given = [k for k in ("appear", "vanish", "move") if getattr(self, k) is not None]
        if len(given) != 1:
            raise ValueError(
                f"expected one of appear, vanish, move, got {', '.join(given) or 'none'}"
            )
        return self


class SceneSurprises(FileModel):
    """The surprise file of a mission.

    >>> text = '{"schema_version": 1, "events": [{"time": 60, "vanish": "pile 3"}]}'
    >>> SceneSurprises.from_json(text).events[0].vanish
    'pile 3'
    """

    file_kind: ClassVar[str] = "scene surprises"

    model_config = ConfigDict(title="netsp scene surprises")

    schema_version: Annotated[Literal[1], Field(description="of the file format")] = 1
    events: Annotated[tuple[SceneEvent, ...], Field(description="in any order")]

    def in_order(self) -> list[SceneEvent]:
        """The events by time.

        Returns
        -------
        list of SceneEvent
            Those of one time as in the file.
        """
        return sorted(self.events, key=lambda e: e.time)

    def check(self, scene: Scene, source: str = "") -> None:
        """Refuse events that a scene cannot have.

        Parameters
        ----------
        scene : Scene
            The map.
        source : str
            What messages call these surprises; nothing if it is empty.

        Raises
        ------
        InputError
            A solid that is not there when the event comes, or a name that two would have.
        """
        solids = scene.all_solids()
        for k, event in sorted(enumerate(self.events), key=lambda e: e[1].time):
            try:
                solids = changed(solids, event)
            except InputError as error:
                where = f"{source}: " if source else ""
                raise InputError(f"{where}events[{k}]: {error}") from None


def changed(solids: tuple[Solid, ...], event: SceneEvent) -> tuple[Solid, ...]:
    """The solids after an event.

    Parameters
    ----------
    solids : tuple of Solid
        Before.
    event : SceneEvent
        What happens.

    Returns
    -------
    tuple of Solid
        After.

    Raises
    ------
    InputError
        It names a solid that is not there, or one appears by a name that is taken.
    """
    names = [s.name for s in solids]
    if event.appear is not None:
        if event.appear.name is not None and event.appear.name in names:
            raise InputError(f"appear: a solid is named {event.appear.name!r} already")
        return (*solids, event.appear)
    name = event.vanish if event.move is None else event.move.solid
    field = "vanish" if event.move is None else "move.solid"
    if name not in names:
        known = ", ".join(repr(n) for n in names[:8] if n) or "none with a name"
        raise InputError(f"{field}: no solid is named {name!r}; there are {known}")
    which = names.index(name)
    new = () if event.move is None else (moved(solids[which], event.move.by),)
    return (*solids[:which], *new, *solids[which + 1 :])


def moved(solid: Solid, by: Point3) -> Solid:
    """A solid somewhere else.

    Parameters
    ----------
    solid : Solid
        The solid.
    by : (x, y, z)
        To move it by, metres.

    Returns
    -------
    Solid
        The same solid there.
    """
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
