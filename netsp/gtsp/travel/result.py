"""Results and progress of solvers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

from netsp.base.arrays import ComparesArrays, Floats, Ints
from netsp.base.data_frames import frame_of
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE, LowerBound, Scope, gap_of
from netsp.model.solution import Status

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Progress:
    """One row of the progress table.

    Parameters
    ----------
    time : float
        Seconds since the start of the solver.
    stage : str
        What the solver is doing.
    incumbent : float, optional
        Length of the best tour, in the problem's units; None while there is none.
    bound : LowerBound, optional
        Proven lower bound with the tours that it holds for; None while nothing is known.
    cuts : int
        Cuts in the program.
    legs : int
        Legs left after elimination.
    vertices : int
        Vertices left after elimination.
    iteration : int
        Iterations of the solver; each says what one is.
    current : float, optional
        Length of the present state, of solvers that walk from state to state.
    entangled : int, optional
        Obstacles that the present state entangles.
    tour : tuple of int, optional
        Vertices of the best tour, as `Result.tour` has them; None while there is none.

    Examples
    --------
    >>> from netsp import TravelGraph, solve_graph
    >>> rows = []
    >>> graph = TravelGraph.from_costs([[0, 2, 3], [2, 0, 2], [3, 2, 0]], clusters=[0, 1, 2])
    >>> result = solve_graph(graph, on_progress=rows.append)
    >>> rows[-1].incumbent, rows[-1].gap
    (7.0, 0.0)
    """

    time: float
    stage: str
    incumbent: float | None = None
    bound: LowerBound | None = None
    cuts: int = 0
    legs: int = 0
    vertices: int = 0
    iteration: int = 0
    current: float | None = None
    entangled: int | None = None
    tour: tuple[int, ...] | None = None

    @property
    def gap(self) -> float | None:
        """(incumbent - bound) / incumbent, of the scope of the bound."""
        return gap_of(self.incumbent, self.bound)


OnProgress = Callable[[Progress], None]


BoundOfWhole = Callable[[LowerBound | None], LowerBound | None]
"""Callback that turns a bound on the tours over a part of a travel graph into one on all of it."""


def of_part(
    listener: OnProgress | None, chosen: Ints, bound_of_whole: BoundOfWhole
) -> OnProgress | None:
    """Return a listener for a run over a part of a travel graph.

    Parameters
    ----------
    listener : callable, optional
        Listener of the run over the whole graph.
    chosen : ndarray of int
        The part's vertices in the whole graph.
    bound_of_whole : callable
        Turns a bound on the part's tours into one on all tours of the graph; None for none.

    Returns
    -------
    callable or None
        Listener that passes on tours as vertices of the whole graph, and bounds for all of it.
    """
    if listener is None:
        return None

    def pass_on(row: Progress) -> None:
        tour = None if row.tour is None else tuple(int(chosen[v]) for v in row.tour)
        listener(replace(row, tour=tour, bound=bound_of_whole(row.bound)))

    return pass_on


@dataclass(frozen=True, eq=False)
class Trajectory(ComparesArrays):
    """Closed path of a baseline that is no tour of the instance.

    Parameters
    ----------
    order : tuple of int
        Goals (clusters) in the order visited.
    path : ndarray, shape (n, 3)
        Closed polyline, circumscribed to arcs.
    length : float
        Length of the arcs themselves, in the problem's units.
    """

    order: tuple[int, ...]
    path: Floats
    length: float


@dataclass(frozen=True)
class Result:
    """Outcome of a solver on a travel graph.

    Parameters
    ----------
    tour : tuple of int, optional
        Vertices from the base on (the base is not repeated at the end); None without a tour.
    length : float, optional
        Length of the closed tour.
    lower_bound : float, optional
        Proven lower bound on the tours that `lower_bound_of` names.
    status : Status
        What is proven.
    trace : tuple of Progress
        The progress rows, in order.
    walk : tuple of int, optional
        Vertices as they are walked, base to base, where that is longer than the tour because the
        solver retraces its steps; `length` is then that of the walk.
    trajectory : Trajectory, optional
        Path of a baseline with status `invalid`; `tour` is then None.
    lower_bound_of : Scope
        Tours that the lower bound holds for.

    Examples
    --------
    >>> from netsp import TravelGraph, solve_graph
    >>> costs = [[0, 2, 3], [2, 0, 2], [3, 2, 0]]
    >>> result = solve_graph(TravelGraph.from_costs(costs, clusters=[0, 1, 2]))
    >>> result.status.value, result.length, result.lower_bound, result.gap
    ('optimal', 7.0, 7.0, 0.0)
    """

    tour: tuple[int, ...] | None
    length: float | None
    lower_bound: float | None
    status: Status
    trace: tuple[Progress, ...] = ()
    walk: tuple[int, ...] | None = None
    trajectory: Trajectory | None = None
    lower_bound_of: Scope = Scope.TRAVEL_GRAPH

    @property
    def bound(self) -> LowerBound | None:
        """The lower bound with the tours that it holds for; None where nothing is known."""
        if self.lower_bound is None:
            return None
        return LowerBound(self.lower_bound, self.lower_bound_of)

    @property
    def gap(self) -> float | None:
        """(length - lower_bound) / length; None without a tour or a bound."""
        return gap_of(self.length, self.bound)

    def to_frame(self) -> pandas.DataFrame:
        """Return the progress rows as a pandas DataFrame, a column per field of `Progress`; the
        bound is a number, and ``bound_of`` says which tours it holds for.

        Returns
        -------
        pandas.DataFrame
            In the order they were reported.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        return frame_of(
            {
                **{f.name: getattr(row, f.name) for f in fields(row)},
                "bound": None if row.bound is None else row.bound.length,
                "bound_of": None if row.bound is None else row.bound.scope.value,
            }
            for row in self.trace
        )

    def __repr__(self) -> str:
        """Return one line with status, length and bound."""
        length = "no tour" if self.length is None else f"length {self.length:.6g}"
        bound = "" if self.bound is None else f", {self.bound.says(self.length)}"
        visits = "" if self.tour is None else f", tour of {len(self.tour)} vertices"
        return f"<Result: {self.status.value}, {length}{bound}{visits}>"


def relative_gap(length: float | None, bound: float | None) -> float | None:
    """Return the gap of a tour by a bound whose field name states the scope, such as
    ``bound_of_all`` of a mission.

    Parameters
    ----------
    length : float, optional
        Length of a tour.
    bound : float, optional
        Lower bound.

    Returns
    -------
    float or None
        (length - bound) / length, at least 0; None if either is unknown.
    """
    return gap_of(length, None if bound is None else LowerBound(bound, Scope.TRAVEL_GRAPH))


def proven(length: float, bound: float) -> bool:
    """Return whether a bound proves a length optimal.

    Parameters
    ----------
    length : float
        Length of a tour.
    bound : float
        Proven bound on every tour.

    Returns
    -------
    bool
        True if they differ by no more than rounding.
    """
    return length - bound <= OPTIMALITY_TOLERANCE * max(length, 1e-300)
