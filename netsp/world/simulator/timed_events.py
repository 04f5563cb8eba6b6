"""Events of a surprise file: what all of them have in common, in the plane and in space."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Self, TypeVar

from pydantic import Field, model_validator

from netsp.base.errors import InputError
from netsp.base.field_types import NonNegative
from netsp.base.validated import Model

Value = TypeVar("Value")


class TimedEvent(Model):
    """Event at a time after the start; one of the other fields says what happens."""

    time: Annotated[NonNegative, Field(description="seconds after the start")]

    @model_validator(mode="after")
    def _one(self) -> Self:
        kinds = [k for k in type(self).model_fields if k != "time"]
        given = [k for k in kinds if getattr(self, k) is not None]
        if len(given) != 1:
            raise ValueError(
                f"expected one of {', '.join(kinds)}, got {', '.join(given) or 'none'}"
            )
        return self

    @property
    def kind(self) -> str:
        """Name of the field that says what happens."""
        fields = type(self).model_fields
        return next(k for k in fields if k != "time" and getattr(self, k) is not None)


def check_in_turn(
    events: Sequence[Any], value: Value, after: Callable[[Value, Any], Value], source: str
) -> None:
    """Let all events of a file happen by time to what they change.

    Parameters
    ----------
    value
        Value before the first event.
    after
        Returns the value after an event; raises InputError if the event cannot be.
    source
        Name of the file in messages; nothing if it is empty.

    Raises
    ------
    InputError
        An event cannot be; names its number in the file.
    """
    for k, event in sorted(enumerate(events), key=lambda pair: pair[1].time):
        try:
            value = after(value, event)
        except InputError as error:
            where = f"{source}: " if source else ""
            raise InputError(f"{where}events[{k}]: {error}") from None
