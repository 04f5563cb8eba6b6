"""The plane's proof as a bound in space, where solids go from the floor to the surface.

Take away all solids but the upright ones, and shrink these a little: no path, and no tether, gets
longer, so the shortest tour that is left is a bound on all tours. It is that of a problem in the
plane with heights (docs/theory.md, fact 4), which the exact roadmap and its solvers bound, classes
of the tether and all.
"""

from __future__ import annotations

import math

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
"""Share of a length that is taken off the bound, so that rounding never lifts it."""


def bound_of_upright(
    mission: Mission, water: Water, some: list[int], places: Places, clock: Clock
) -> float | None:
    """Return a bound on all tours from the scene's upright solids.

    Parameters
    ----------
    mission : Mission
        Whose tether counts.
    water : Water
        The scene, and how the tether lies at the start.
    some : list of int
        The places that tours go to.
    places : Places
        All places.
    clock : Clock
        When it is up, the bound is what is proven by then.

    Returns
    -------
    float or None
        Metres; None where there are no upright solids, the mission begins in the middle, a waypoint
        has alternatives, or there was no time.
    """
    if places.begin is not None or len(set(places.waypoint[some].tolist())) < len(some):
        return None
    # a path may dip into solids by what the judge allows, a tether between its nodes by more: among
    # obstacles shrunk by that both are free, and the taut tether is no longer than its model
    dip = max(2.0 * DEEPEST, DIP * mission.delta)
    obstacles = upright_obstacles(water, dip)
    if not obstacles or clock.up:
        return None
    # the tether as it is laid, and then the robot's way backwards: from the start on
    laid = float(polylines.length(water.laid.nodes))
    most = mission.tether_length * (1.0 + 1e-6) + laid
    try:
        problem = Problem(
            base=mission.start, goals=places.points[some].tolist(), obstacles=tuple(obstacles),
            tether_length=most,
        )  # fmt: skip
        bound = solve(problem, time_limit=None if math.isinf(clock.left) else clock.left).bound
    except NetspError:
        return None  # what cannot be said of the plane says nothing of space
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
        Metres that they are shrunk by.

    Returns
    -------
    list of Circle or Polygon
        One for each post and prism that is thick enough.
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
    """Return a simple polygon within another one that was grown, or shrunk.

    Parameters
    ----------
    corners : ndarray, shape (n, 2)
        Of the other one.
    by : float
        Metres that it is grown by; negative to shrink it.

    Returns
    -------
    ndarray, shape (m, 2), or None
        None where nothing is left, or not in one piece.
    """
    from shapely.geometry import Polygon as Shape

    # arcs become chords, on the outer side of a hollow when it is shrunk: by a thousandth of it
    shape = Shape(corners).buffer(by if by >= 0.0 else 1.002 * by, quad_segs=16)
    if shape.is_empty or shape.geom_type != "Polygon" or len(shape.interiors):
        return None
    return np.asarray(shape.exterior.coords)[:-1]
