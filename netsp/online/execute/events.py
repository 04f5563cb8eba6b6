"""Surprise file of a tour: what may happen during a run, and what each event does to the
problem."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field

from netsp.base.errors import InputError
from netsp.base.field_types import Point2, Point3, Positive, checked_integer, index_of
from netsp.base.files import FileModel
from netsp.base.validated import Model, shown
from netsp.model.problem import MAX_EXTENT_RATIO, Circle, GoalLike, Obstacle, Polygon, Problem
from netsp.online.execute.execute_policy import ExecutePolicy
from netsp.world.simulator.timed_events import TimedEvent, check_in_turn


def _checked_which(value: Any) -> Any:
    if isinstance(value, str):
        return value
    try:
        index = checked_integer(value)
    except ValueError:
        index = -1
    if 0 <= index < 2**31:
        return index
    raise ValueError(f"expected a name or an index from 0 on, got {shown(value)}")


Which = Annotated[Annotated[int, Field(ge=0)] | str, BeforeValidator(_checked_which)]
"""Index or name of an obstacle or goal; without a name, `#index` as in messages."""


class Move(Model):
    """Move of an obstacle."""

    obstacle: Annotated[Which, Field(description="name or index from 0 of the obstacle")]
    by: Annotated[
        Point2, Field(description="(x, y) by which the obstacle moves, in the problem's units")
    ]


class Event(TimedEvent):
    """Event at a time after the start; one of the other fields says what happens."""

    appear: Annotated[
        Obstacle | None, Field(description="an obstacle that is there from now on")
    ] = None
    vanish: Annotated[
        Which | None, Field(description="name or index from 0 of an obstacle that is gone")
    ] = None
    move: Annotated[Move | None, Field(description="an obstacle that moves")] = None
    add_goal: Annotated[GoalLike | None, Field(description="another goal")] = None
    cancel_goal: Annotated[
        Which | None, Field(description="name or index from 0 of a goal that need not be visited")
    ] = None
    push: Annotated[
        Point3 | None,
        Field(description="(x, y, z) by which the robot is displaced, in the problem's units"),
    ] = None
    tether_length: Annotated[
        Positive | None, Field(description="tether length from now on, in the problem's units")
    ] = None


class Surprises(FileModel):
    """Surprise file of a tour.

    >>> text = '{"schema_version": 1, "events": [{"time": 60, "tether_length": 40}]}'
    >>> Surprises.from_json(text).events[0].kind
    'tether_length'
    """

    file_kind: ClassVar[str] = "surprises"

    model_config = ConfigDict(title="netsp surprises")

    schema_version: Annotated[Literal[1], Field(description="version of the file format")] = 1
    events: Annotated[tuple[Event, ...], Field(description="events in any order")]

    def check(self, problem: Problem, source: str = "") -> None:
        """Raise InputError for events that a problem cannot have.

        These name an obstacle or goal that does not exist when the event comes, or put an obstacle
        onto the base.

        Parameters
        ----------
        source : str
            Name of these surprises in messages; nothing if it is empty.
        """
        check_in_turn(self.events, problem, problem_after, source)


def problem_after(
    problem: Problem, event: Event, policy: ExecutePolicy = ExecutePolicy()
) -> Problem:
    """Return the problem after an event.

    Goals keep their numbers, also cancelled ones, and so do obstacles, except after one vanishes.
    Goals inside obstacles are left to the caller.

    Raises
    ------
    InputError
        The event names something that is not there, or puts an obstacle onto the base.
    """
    obstacles, goals = list(problem.obstacles), list(problem.goals)
    changes: dict[str, object] = {}
    if event.appear is not None:
        obstacles.append(event.appear)
    elif event.vanish is not None:
        del obstacles[index_of(event.vanish, obstacles, "vanish")]
    elif event.move is not None:
        i = index_of(event.move.obstacle, obstacles, "move.obstacle")
        obstacles[i] = moved_obstacle(obstacles[i], event.move.by)
    elif event.add_goal is not None:
        goals.append(event.add_goal)
    elif event.cancel_goal is not None:
        index_of(event.cancel_goal, goals, "cancel_goal")
    elif event.tether_length is not None:
        changes["tether_length"] = event.tether_length
    changes |= {"obstacles": tuple(obstacles), "goals": tuple(goals)}
    changed = problem.model_copy(update=changes)
    if complaint := changed.size_complaint():
        raise InputError(f"{event.kind}: {complaint}")
    if event.appear is not None and problem.origin is not None:
        _check_size(event.appear, problem, policy)
    if event.add_goal is not None:
        distance = float(np.abs(np.array(event.add_goal.position) - np.array(problem.base)).max())
        max_distance = MAX_EXTENT_RATIO * max(problem.tether_length, problem.scale)
        if distance > max_distance:
            raise InputError(
                f"add_goal: is {distance:.4g} from the base; expected at most {max_distance:.4g}, "
                f"{MAX_EXTENT_RATIO:g} times the size of the problem"
            )
    base = np.array([changed.base[:2]])
    for i, o in enumerate(changed.obstacles):
        if float(o.signed_distance(base)[0]) < changed.clearance - changed.tolerance:
            raise InputError(f"{event.kind}: {changed.obstacle_label(i)} would stand on the base")
    return changed


def _check_size(obstacle: Circle | Polygon, problem: Problem, policy: ExecutePolicy) -> None:
    """Raise InputError for an obstacle so small that its coordinates must be degrees."""
    box = obstacle.shape(0.0).bounds
    size = max(box[2] - box[0], box[3] - box[1])
    if size < policy.min_obstacle_ratio * problem.tether_length:
        raise InputError(
            f"appear: is {size:.1g} {problem.units} across; expected coordinates of the problem, "
            "from its base on, not degrees"
        )


def moved_obstacle(obstacle: Circle | Polygon, by: tuple[float, float]) -> Circle | Polygon:
    """Return an obstacle moved by (x, y)."""
    try:
        if isinstance(obstacle, Circle):
            x, y = obstacle.center
            centre = (x + by[0], y + by[1])
            return Circle(center=centre, radius=obstacle.radius, name=obstacle.name)
        corners = tuple((x + by[0], y + by[1]) for x, y in obstacle.polygon)
        return Polygon(polygon=corners, name=obstacle.name)
    except InputError as error:
        raise InputError(f"move: {error}") from None
