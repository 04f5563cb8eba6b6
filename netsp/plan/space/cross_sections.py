"""Cross-sections of the solids that stand upright through a range of depths.

A certain cross-section lies within the solid at every height of the range, and deeper below the
surface of the solid than a given depth. A path or tether that enters solids by less than that depth
stays outside of all certain cross-sections (docs/theory, Section 22).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.model.problem import Circle, Polygon
from netsp.plan.space.prisms import wall_corners
from netsp.world.scene import solids
from netsp.world.scene.field import DistanceField
from netsp.world.scene.packing import COUNT, ROW, ROWS

MAX_LEAN = 1e-3
"""Tolerance for the lean of upright solids: maximum tangent of the angle between the axis and the
vertical. Depths across the axis and horizontal depths then differ by less than `LEAN_MARGIN`."""

LEAN_MARGIN = 1e-6
"""Tolerance for depths in leaning solids: relative increase of a depth, which covers the difference
between depths across the axis and horizontal depths, at most the square of `MAX_LEAN`."""

MIN_EXCESS_RATIO = 2.0
"""Tolerance of the proof: minimum height by which a solid exceeds the range at both ends, as a
multiple of the depth to which paths may enter solids. A point of the range that is less deep in the
solid is then near the side of the solid, not near its end."""


@dataclass(frozen=True)
class Depths:
    """Range of heights in which paths and tethers stay.

    Attributes
    ----------
    low, high
        Ends of the range, metres.
    anchor
        (3,) anchor of the tether, metres.
    reach
        Greatest distance of paths and tethers from the anchor, metres.
    """

    low: float
    high: float
    anchor: Floats
    reach: float

    @property
    def middle(self) -> float:
        """Return the height in the middle of the range, metres."""
        return 0.5 * (self.low + self.high)

    @property
    def half(self) -> float:
        """Return half the height of the range, metres."""
        return 0.5 * (self.high - self.low)


def cross_sections(
    field: DistanceField, depths: Depths, dip: float
) -> tuple[list[Circle | Polygon], bool]:
    """Return certain cross-sections of a scene's upright solids.

    Parameters
    ----------
    dip : float
        Depth to which paths and tethers may enter solids, metres.

    Returns
    -------
    obstacles : list of Circle or Polygon
        Cross-sections that are not empty.
    all_upright : bool
        True if every solid that the range and the reach meet stands upright through the range, or
        is a horizontal floor or ceiling.
    """
    offset, all_upright = float(field.arrays.offset), field.voxel is None
    found: list[Circle | Polygon] = []
    for kind, row in solid_rows(field):
        if kind == solids.HALF_SPACE and _is_level(row[3:6]):
            continue
        is_upright, obstacle = _section(field.arrays.data, kind, row, depths, dip, offset)
        if is_upright:
            found += [] if obstacle is None else [obstacle]
        elif not _is_out_of_reach(kind, row, depths, dip + offset):
            all_upright = False
    return found, all_upright


def level_range(field: DistanceField, dip: float) -> tuple[float, float]:
    """Return the heights between horizontal floors and ceilings, metres; infinite without them.

    Parameters
    ----------
    dip : float
        Depth to which paths and tethers may enter solids, metres.
    """
    low, high, offset = -math.inf, math.inf, float(field.arrays.offset)
    for kind, row in solid_rows(field):
        if kind == solids.HALF_SPACE and _is_level(row[3:6]):
            if row[5] > 0.0:
                low = max(low, row[2] + offset - dip)
            else:
                high = min(high, row[2] - offset + dip)
    return low, high


def solid_rows(field: DistanceField) -> Iterator[tuple[int, Floats]]:
    """Yield the kind and the numbers of each solid of a field (`netsp.world.scene.solids`)."""
    data = field.arrays.data
    for n in range(int(data[COUNT])):
        at = ROWS + ROW * n
        yield int(data[at]), data[at + 1 : at + ROW]


def _is_level(normal: Floats) -> bool:
    """Return whether a unit normal is vertical, without any rounding."""
    return bool(normal[0] == 0.0 and normal[1] == 0.0)


def _section(
    data: Floats, kind: int, row: Floats, depths: Depths, dip: float, offset: float
) -> tuple[bool, Circle | Polygon | None]:
    """Return whether a solid stands upright through a range, and its certain cross-section; None
    for a solid that is too thin."""
    deep = dip * (1.0 + LEAN_MARGIN)
    if kind == solids.POST:
        return True, _circle(row[:2], row[2] + offset - deep)
    if kind == solids.PRISM:
        corners = data[int(row[0]) : int(row[1])].reshape(-1, 2)
        return True, _polygon(corners, row[2] + offset - deep)
    if kind in (solids.CYLINDER, solids.CAPSULE):
        a = row[:3]
        b = a + row[7] * row[3:6] if kind == solids.CYLINDER else row[3:6]
        lean, radius = _lean(b - a), float(row[6])
        if lean > MAX_LEAN:
            return False, None
        within, cap = radius + offset - deep, 0.0
        if kind == solids.CYLINDER:
            if not _spans((a[2], b[2]), depths, MIN_EXCESS_RATIO * dip + lean * radius):
                return False, None
        else:
            cap = _height_in_cap((a[2], b[2]), depths, lean * radius)
            if cap > 0.0 and within <= cap:
                return False, None
        middle = a + (depths.middle - a[2]) / (b[2] - a[2]) * (b - a)
        # a cap of the capsule is narrowest at the end of the range
        narrowest = math.sqrt(max(0.0, within * abs(within) - cap**2))
        return True, _circle(middle[:2], narrowest - lean * (depths.half + cap))
    if kind == solids.BOX:
        return _box_section(row, depths, dip, offset - deep)
    if kind == solids.HALF_SPACE:
        point, normal = row[:3], row[3:6]
        across = math.hypot(*normal[:2])
        lean = abs(normal[2]) / max(across, 1e-300)
        if lean > MAX_LEAN:
            return False, None
        face = point[:2] - (depths.middle - point[2]) * normal[2] / across**2 * normal[:2]
        wall = wall_corners(face, normal[:2] / across, depths.anchor, depths.reach)
        return True, _polygon(np.array(wall), offset - deep - lean * depths.half)
    return False, None


def _box_section(
    row: Floats, depths: Depths, dip: float, growth: float
) -> tuple[bool, Circle | Polygon | None]:
    """Return whether a box stands upright through a range, and its certain cross-section."""
    centre, half, axes = row[:3], row[3:6], row[6:15].reshape(3, 3)
    up = int(np.abs(axes[:, 2]).argmax())
    sides = [k for k in range(3) if k != up]
    lean = _lean(axes[up])
    if lean > MAX_LEAN:
        return False, None
    # a leaning box ends at the lowest corner of its upper face
    end = half[up] * abs(axes[up, 2]) - sum(half[k] * abs(axes[k, 2]) for k in sides)
    if not _spans((centre[2] - end, centre[2] + end), depths, MIN_EXCESS_RATIO * dip):
        return False, None
    middle = centre[:2] + (depths.middle - centre[2]) / axes[up, 2] * axes[up, :2]
    across = np.linalg.inv(axes[sides, :2])
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    corners = middle + (signs * half[sides]) @ across.T
    return True, _polygon(corners, growth - lean * depths.half)


def _lean(axis: Floats) -> float:
    """Return the tangent of the angle between an axis and the vertical; infinite for a point."""
    if axis[2] == 0.0:
        return math.inf
    return math.hypot(axis[0], axis[1]) / abs(float(axis[2]))


def _height_in_cap(ends: tuple[float, float], depths: Depths, spare: float) -> float:
    """Return the height by which a range exceeds the axis of an upright capsule, and so reaches
    into its caps, metres; 0 if the axis exceeds the range by `spare`."""
    below, above = min(ends) - depths.low, depths.high - max(ends)
    return max(0.0, below + spare, above + spare)


def _spans(ends: tuple[float, float], depths: Depths, spare: float) -> bool:
    """Return whether a solid between two heights exceeds a range at both ends."""
    return min(ends) <= depths.low - spare and max(ends) >= depths.high + spare


def _is_out_of_reach(kind: int, row: Floats, depths: Depths, margin: float) -> bool:
    """Return whether a solid is farther than a margin from all places in a range and in reach."""
    if kind in (solids.CYLINDER, solids.CAPSULE):
        a = row[:3]
        b = a + row[7] * row[3:6] if kind == solids.CYLINDER else row[3:6]
        low, high = np.minimum(a, b) - row[6], np.maximum(a, b) + row[6]
    elif kind == solids.BOX:
        half = np.abs(row[6:15].reshape(3, 3)).T @ row[3:6]
        low, high = row[:3] - half, row[:3] + half
    elif kind == solids.TORUS:
        low, high = row[:3] - row[9] - row[10], row[:3] + row[9] + row[10]
    else:
        return False
    if low[2] - margin > depths.high or high[2] + margin < depths.low:
        return True
    nearest = np.clip(depths.anchor, low, high)
    return bool(np.linalg.norm(nearest - depths.anchor) > depths.reach + margin)


def _circle(centre: Floats, radius: float) -> Circle | None:
    """Return a circle; None if its radius is not positive."""
    if not radius > 0.0:
        return None
    return Circle(center=(float(centre[0]), float(centre[1])), radius=radius)


def _polygon(corners: Floats, growth: float) -> Polygon | None:
    """Return a polygon grown by a distance, or less; None if nothing, or more than one piece, is
    left."""
    grown = grown_within(corners, growth)
    return None if grown is None else Polygon(polygon=tuple((float(x), float(y)) for x, y in grown))


def grown_within(corners: Floats, by: float) -> Floats | None:
    """Return a simple polygon (m, 2) within a polygon that was grown, or shrunk by a negative
    distance; None if nothing or more than one piece is left."""
    from shapely.geometry import Polygon as Shape

    # arcs become chords, which lie outside of a hollow that is shrunk by up to a thousandth of `by`
    shape = Shape(corners).buffer(by if by >= 0.0 else 1.002 * by, quad_segs=16)
    if shape.is_empty or shape.geom_type != "Polygon" or len(shape.interiors):
        return None
    return np.asarray(shape.exterior.coords)[:-1]
