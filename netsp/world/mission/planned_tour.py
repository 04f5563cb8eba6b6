"""Tour that was planned for a mission: the paths of the robot from waypoint to waypoint."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from netsp.base.arrays import Floats
from netsp.base.field_types import Name, NonNegative, Point3
from netsp.base.geometry import polylines
from netsp.base.validated import Model
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE, LowerBound, Scope
from netsp.model.solution import Status

PathField = Annotated[tuple[Point3, ...], Field(min_length=2)]


class PlannedVisit(Model):
    """Visit of a planned tour."""

    path: Annotated[
        PathField, Field(description="path from the previous stop to the waypoint, (x, y, z), m")
    ]
    signature: Annotated[
        tuple[int, ...] | None,
        Field(
            description="word of the tether there; missing if there was no time to find the words "
            "of the scene"
        ),
    ] = None
    tether_length: Annotated[NonNegative, Field(description="length of the taut tether there, m")]
    longest_tether: Annotated[
        NonNegative, Field(description="greatest length of the taut tether on the path there, m")
    ]
    given_as: Annotated[
        Annotated[int, Field(ge=0)] | None,
        Field(description="number of the waypoint in the mission that was planned"),
    ] = None


class UnresolvedGap(Model):
    """Passage that the robot fits through but the grid of a mission does not show."""

    position: Annotated[Point3, Field(description="(x, y, z) of the middle of the passage, m")]
    width: Annotated[NonNegative, Field(description="width: twice the distance from solids, m")]

    def __str__(self) -> str:
        """Return width and position, as in "0.24 m at (0, 1.5, -2)"."""
        return f"{self.width:.2g} m at ({', '.join(f'{v:.3g}' for v in self.position)})"


def _within(gap: Any) -> bool:
    """Return whether a gap from a file proves that a tour is the shortest."""
    return isinstance(gap, int | float) and gap <= OPTIMALITY_TOLERANCE


def bound_within_rounding(length: float, bound: float) -> float | None:
    """Return a bound on all tours that is at most the length of a tour; None if it is wrong.

    A tour that is shorter than a bound by more than rounding refutes the bound.

    Parameters
    ----------
    length : float
        Length of a tour that the judge accepts, metres.
    bound : float
        Bound on all tours, metres.

    Examples
    --------
    >>> bound_within_rounding(10.0, 10.0 + 1e-9)
    10.0
    >>> bound_within_rounding(10.0, 10.1) is None
    True
    """
    if bound > length * (1.0 + OPTIMALITY_TOLERANCE):
        return None
    return min(bound, length)


def status_of_tour(
    length: float, of_states: float | None, of_all: float | None, *, is_complete: bool = True
) -> Status:
    """Return the status that bounds prove for a tour.

    Parameters
    ----------
    length : float
        Length of the tour, metres.
    of_states : float or None
        Lower bound on tours along the states and legs found, metres.
    of_all : float or None
        Lower bound on all tours to the same waypoints, metres.
    is_complete : bool
        Whether the tour visits all waypoints; if not, no bound proves it optimal.

    Examples
    --------
    >>> status_of_tour(10.0, 10.0, 9.0).value
    'optimal_of_states'
    >>> status_of_tour(10.0, None, 10.0 - 1e-6).value
    'optimal'
    >>> status_of_tour(10.0, 9.9, 9.0).value
    'feasible'
    """
    if is_complete and of_all is not None and LowerBound(of_all, Scope.ALL_TOURS).proves(length):
        return Status.OPTIMAL
    if of_states is not None and LowerBound(of_states, Scope.STATES).proves(length):
        return Status.OPTIMAL_OF_STATES
    return Status.FEASIBLE


class PlannedTour(Model):
    """Tour through the first waypoints of a mission, with what is proven about it.

    Waypoints that no tether reaches come after all others and have no visit. The status is
    `optimal` if `bound_of_all` (`netsp.plan.space.path_bound`) proves that no tour to these
    waypoints is shorter, in any class of the tether; `optimal_of_states` if the tour is the
    shortest along the states and legs that were found. If `exact`, different words mean different
    classes of paths through the cells of the mission; this says nothing about gaps that the grid
    does not show, or about the length. Tours through unresolved gaps were not considered, but
    `bound_of_all` holds for them, too.
    """

    stops: Annotated[
        tuple[PlannedVisit, ...],
        Field(description="visits, one for each of the first waypoints; others are not reached"),
    ]
    home: Annotated[
        PathField, Field(description="path from the last visit to the start, (x, y, z), m")
    ]
    status: Annotated[
        Status,
        Field(
            description="optimal: no tour is shorter, by bound_of_all; optimal_of_states: none "
            "along the states and legs that were found"
        ),
    ]
    solver: Annotated[Name, Field(description="name of the solver")]
    seed: Annotated[int, Field(description="seed of all random numbers")] = 0
    length: Annotated[NonNegative, Field(description="length of the tour, m")]
    lower_bound: Annotated[
        NonNegative | None,
        Field(description="lower bound on tours along the states and legs that were found, m"),
    ] = None
    gap: Annotated[NonNegative | None, Field(description="(length - lower_bound) / length")] = None
    bound_of_all: Annotated[
        NonNegative | None,
        Field(
            description="lower bound on all tours to these waypoints, in any class of the tether, m"
        ),
    ] = None
    gap_to_all: Annotated[
        NonNegative | None, Field(description="(length - bound_of_all) / length")
    ] = None
    states: Annotated[
        Annotated[int, Field(ge=0)],
        Field(description="number of known states of the tether at the waypoints"),
    ] = 0
    legs: Annotated[
        Annotated[int, Field(ge=0)],
        Field(description="number of legs between these states that were driven"),
    ] = 0
    exact: Annotated[
        bool | None,
        Field(
            description="whether words that differ are of different classes among the cells; "
            "missing if there was no time to find words"
        ),
    ] = None
    unresolved_gaps: Annotated[
        tuple[UnresolvedGap, ...] | None,
        Field(
            description="passages with room for the robot that the cells do not show; missing if "
            "they were not searched for"
        ),
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _older(cls, data: Any) -> Any:
        """Read `optimal` of older files as `optimal_of_states` if only the states prove it."""
        if isinstance(data, dict) and data.get("status") == Status.OPTIMAL.value:
            of_all, of_states = data.get("gap_to_all"), data.get("gap")
            if not _within(of_all) and _within(of_states):
                return {**data, "status": Status.OPTIMAL_OF_STATES.value}
        return data

    def leg(self, index: int) -> Floats | None:
        """Return the path (k, 3) to a waypoint from the visit before, metres; None if the tour does
        not visit the waypoint."""
        return np.array(self.stops[index].path) if index < len(self.stops) else None

    @property
    def line(self) -> Floats:
        """Polyline (n, 3) of the whole tour, metres."""
        legs = [*(stop.path for stop in self.stops), self.home]
        return np.vstack([legs[0][:1], *(leg[1:] for leg in legs)])

    @property
    def longest_tether(self) -> float:
        """Length of the longest tether before the path home, metres."""
        return max((stop.longest_tether for stop in self.stops), default=0.0)

    def without_words(self) -> PlannedTour:
        """Return a copy without words and gaps, which refer to the cells of a grid."""
        stops = tuple(stop.model_copy(update={"signature": None}) for stop in self.stops)
        return self.model_copy(update={"stops": stops, "exact": None, "unresolved_gaps": None})

    def without_bounds(self) -> PlannedTour:
        """Return a copy with the status feasible and no bounds."""
        legs = [*(visit.path for visit in self.stops), self.home]
        return self.model_copy(
            update={
                "length": float(sum(polylines.length(np.array(leg)) for leg in legs)),
                "status": Status.FEASIBLE,
                "lower_bound": None,
                "gap": None,
                "bound_of_all": None,
                "gap_to_all": None,
            }
        )

    def mismatch(
        self, begin: Point3, start: Point3, places: Floats, tolerance: float
    ) -> str | None:
        """Return in one line how the tour contradicts its mission, or None.

        Parameters
        ----------
        begin, start : (x, y, z)
            Positions of the robot when the mission begins and when it is home, metres.
        places : ndarray, shape (n, 3)
            Waypoints, metres.
        tolerance : float
            Largest distance between these points and the ends of paths, metres.
        """
        if len(self.stops) > len(places):
            return (
                f"stops: {len(self.stops)} of them; expected no more than there are waypoints, "
                f"{len(places)}"
            )
        place_before = np.array(begin)
        for k, stop in enumerate(self.stops):
            for name, place, end in (("begins", place_before, 0), ("ends", places[k], -1)):
                distance = float(np.linalg.norm(np.array(stop.path[end]) - place))
                if distance > tolerance:
                    return (
                        f"stops[{k}].path: {name} {distance:.2f} m from "
                        f"{'waypoint' if end else 'the visit before'}"
                        f"{f' #{k}' if end else ''}; expected no more than {tolerance:g}"
                    )
            place_before = places[k]
        for name, place, end in (("begins", place_before, 0), ("ends", np.array(start), -1)):
            distance = float(np.linalg.norm(np.array(self.home[end]) - place))
            if distance > tolerance:
                where = "the start" if end else "the last visit"
                return (
                    f"home: {name} {distance:.2f} m from {where}; expected no more than "
                    f"{tolerance:g}"
                )
        return None


def thinned_path(path: Floats) -> tuple[Point3, ...]:
    """Return a path (k, 3) for a file, without points on the line between their neighbours."""
    keep = [0]
    for k in range(1, len(path) - 1):
        a, b, c = path[keep[-1]], path[k], path[k + 1]
        if polylines.length(np.array([a, b, c])) > np.linalg.norm(c - a) + 1e-9:
            keep.append(k)
    # keep both ends, even if they are the same point
    return tuple((x, y, z) for x, y, z in path[[*keep, max(len(path) - 1, 0)]].tolist())
