"""The plane's proof as a bound in space, where solids go from the floor to the surface.

Remove all solids but the upright ones, and shrink the upright ones a little. No path and no tether
gets longer by that, so the shortest tour of the reduced scene bounds all tours. The reduced scene
is a problem in the plane with heights (docs/theory.md, fact 4). The exact roadmap and its solvers
bound its tours over all homotopy classes of the tether.
"""

from __future__ import annotations

import numpy as np

from netsp.arrays import Floats
from netsp.clock import Clock
from netsp.errors import NetspError
from netsp.geometry import polylines
from netsp.lower_bound import Scope
from netsp.online.mission import Mission
from netsp.online.scene import solids
from netsp.online.scene.packing import COUNT, ROW, ROWS
from netsp.problem import Circle, Polygon, Problem
from netsp.solvers.solve import solve
from netsp.space.places import Places
from netsp.space.water import DEEPEST, DIP, Water

ROUNDING = 1e-9
"""Relative reduction of the bound, which covers the rounding of lengths."""


def bound_of_upright(
    mission: Mission, water: Water, some: list[int], places: Places, clock: Clock
) -> float | None:
    """Return a bound on all tours from the scene's upright solids.

    Parameters
    ----------
    mission : Mission
        Mission with the tether.
    water : Water
        Scene, and tether at the start.
    some : list of int
        Numbers of the places that tours visit.
    places : Places
        All places.
    clock : Clock
        Clock of the run; when it is up, the bound proven so far is returned.

    Returns
    -------
    float or None
        Lower bound, metres; None if there are no upright solids, the mission begins under way, a
        waypoint has alternatives, or there was no time.
    """
    if places.begin is not None or len(set(places.waypoint[some].tolist())) < len(some):
        return None
    # the judge lets a path dip into solids a little, and a tether between its nodes a little more:
    # among obstacles shrunk by the larger depth both are free, and the taut tether is no longer
    # than its model
    dip = max(2.0 * DEEPEST, DIP * mission.delta)
    obstacles = upright_obstacles(water, dip)
    if not obstacles or clock.up:
        return None
    # the problem begins at the start: a tether there is at most the tether from the anchor and the
    # tether laid from the anchor to the start
    laid = float(polylines.length(water.laid.nodes))
    max_length = mission.tether_length * (1.0 + 1e-6) + laid
    try:
        problem = Problem(
            base=mission.start, goals=places.points[some].tolist(), obstacles=tuple(obstacles),
            tether_length=max_length,
        )  # fmt: skip
        bound = solve(problem, time_limit=clock).bound
    except NetspError:
        return None  # no bound in the plane, so none in space
    if bound is None or bound.scope is not Scope.ALL_TOURS:
        return None
    return bound.length * (1.0 - ROUNDING)


def upright_obstacles(water: Water, dip: float) -> list[Circle | Polygon]:
    """Return obstacles of the plane that lie within a scene's upright solids.

    Parameters
    ----------
    water : Water
        The scene.
    dip : float
        Distance by which the obstacles are shrunk, metres.

    Returns
    -------
    list of Circle or Polygon
        One for each post and prism that is thicker than twice `dip`.
    """
    arrays = water.field.arrays
    data, offset = arrays.data, float(arrays.offset)
    found: list[Circle | Polygon] = []
    for n in range(int(data[COUNT])):
        at = ROWS + ROW * n
        kind = int(data[at])
        if kind == solids.POST:
            radius = float(data[at + 3]) + offset - dip
            if radius > 0.0:
                found.append(
                    Circle(center=(float(data[at + 1]), float(data[at + 2])), radius=radius)
                )
        elif kind == solids.PRISM:
            begin, end, grow = int(data[at + 1]), int(data[at + 2]), float(data[at + 3]) + offset
            shrunk = grown_within(data[begin:end].reshape(-1, 2), grow - dip)
            if shrunk is not None:
                found.append(Polygon(polygon=tuple((float(x), float(y)) for x, y in shrunk)))
    return found


def grown_within(corners: Floats, by: float) -> Floats | None:
    """Return a simple polygon within a polygon that was grown or shrunk.

    Parameters
    ----------
    corners : ndarray, shape (n, 2)
        Corners of the polygon before.
    by : float
        Growth, metres; negative to shrink.

    Returns
    -------
    ndarray, shape (m, 2), or None
        Corners; None if nothing or more than one piece is left.
    """
    from shapely.geometry import Polygon as Shape

    # arcs become chords, which lie outside of a hollow that is shrunk by up to a thousandth of `by`
    shape = Shape(corners).buffer(by if by >= 0.0 else 1.002 * by, quad_segs=16)
    if shape.is_empty or shape.geom_type != "Polygon" or len(shape.interiors):
        return None
    return np.asarray(shape.exterior.coords)[:-1]
