"""Strands: tethers as rows of numbers, with frames, probes of edges and lengths for all models.

Row i of a strand describes node i and the edge from it to node i + 1. The first node is the anchor,
the last one the robot; the others rest on something. Positions are in metres.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.compiled.dynamic_array import write_rows
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.sampling import Field, distance, lowest_along, sample
from netsp.world.tether.tether_policy import PullSettings

Vector = tuple[float, float, float]

X = 0
"""Column of the x coordinate."""

Y = 1
"""Column of the y coordinate."""

Z = 2
"""Column of the z coordinate."""

EX = 3
"""Column of x of the unit direction in which the node may slide: along it, the surface's tangent
plane stays the same, as along the ruling of a cylinder or the edge of a box."""

EY = 4
"""Column of y of that direction."""

EZ = 5
"""Column of z of that direction."""

NX = 6
"""Column of x of the contact's unit normal, which points away from the solid; 0 in all three
columns for a node that rests on nothing."""

NY = 7
"""Column of y of the normal."""

NZ = 8
"""Column of z of the normal."""

EXTRA = 9
"""Column of the length of the surface's arc over the edge, minus that of the edge."""

REACH0 = 10
"""Column of the distance by which the edge's first node alone may move before the edge may be too
deep."""

REACH1 = 11
"""Column of the same distance for the edge's second node."""

USED = 12
"""Column of the sum of both nodes' motions, each as a fraction of `REACH0` or `REACH1`; above 1,
the edge must be probed again."""

STALE = 13
"""Column of the distance that the node has moved since its frame was updated; infinite for a new
node, and for one in the air that waits to land."""

SHARP = 14
"""Column of 1 for a node on an edge or corner of a solid, else 0."""

PART = 15
"""Column of the index of the solid that the node rests on, -1 for voxels."""

CURVE = 16
"""Column of the curvature of the surface along the slide direction, positive where it is convex."""

STEP = 17
"""Column of the node's last Newton step along its slide direction."""

CONE = 18
"""Column of the cone of a contact.

On a sharp edge, it is the cosine of half the angle between the normals of its two faces: the
contact holds only what presses within that cone. Elsewhere, it is +1 or -1 where the surface ends
in an edge close by, along or against the slide direction, else 0.
"""

WIDTH = 19
"""Format of a strand: number of columns."""


@kernel
def with_room(strand: Floats, count: int) -> Floats:
    """Return the strand with room for one more node."""
    if count < len(strand):
        return strand
    out = np.zeros((2 * len(strand) + 8, WIDTH))
    write_rows(out, strand, count)
    return out


@kernel
def insert_node(
    strand: Floats, count: int, at: int, x: float, y: float, z: float
) -> tuple[Floats, int]:
    """Insert a node before row `at`; its frame and both its edges are unknown."""
    strand = with_room(strand, count)
    for i in range(count, at, -1):
        strand[i] = strand[i - 1]
    strand[at] = 0.0
    strand[at, X], strand[at, Y], strand[at, Z] = x, y, z
    strand[at, STALE] = math.inf
    strand[at, PART] = -1.0
    strand[at, REACH0] = strand[at, REACH1] = 1.0
    strand[at, USED] = strand[at - 1, USED] = math.inf
    strand[at - 1, EXTRA] = 0.0
    return strand, count + 1


@kernel
def remove_node(strand: Floats, count: int, at: int) -> int:
    """Remove row `at`; the edge that replaces its two edges is unknown."""
    for i in range(at, count - 1):
        strand[i] = strand[i + 1]
    strand[at - 1, USED] = math.inf
    strand[at - 1, EXTRA] = 0.0
    return count - 1


@kernel
def gap(strand: Floats, i: int, j: int) -> float:
    """Return the distance between two nodes."""
    return math.sqrt(
        (strand[i, X] - strand[j, X]) ** 2
        + (strand[i, Y] - strand[j, Y]) ** 2
        + (strand[i, Z] - strand[j, Z]) ** 2
    )


@kernel
def strand_length(strand: Floats, count: int) -> float:
    """Return the length of a strand, with the arcs over its edges."""
    total = 0.0
    for i in range(count - 1):
        total += gap(strand, i, i + 1) + strand[i, EXTRA]
    return total


@kernel
def note_motion(strand: Floats, count: int, i: int, by: float) -> None:
    """Add a motion of node i to the budgets of its two edges."""
    strand[i, STALE] += by
    if i > 0:
        strand[i - 1, USED] += by / strand[i - 1, REACH1]
    if i < count - 1:
        strand[i, USED] += by / strand[i, REACH0]


@kernel
def probe_edge(field: Field, strand: Floats, i: int, tolerance: float) -> tuple[float, float]:
    """Probe edge i for its deepest point; return its distance and its place, as a fraction.

    Record how far the ends may move before the edge must be probed again, and the arc over it.

    Parameters
    ----------
    tolerance : float
        Allowed depth, and minimum distance between two samples, metres.
    """
    ax, ay, az = strand[i, X], strand[i, Y], strand[i, Z]
    bx, by, bz = strand[i + 1, X], strand[i + 1, Y], strand[i + 1, Z]
    length = gap(strand, i, i + 1)
    strand[i, EXTRA] = 0.0
    if length < 1e-9 * tolerance:
        strand[i, REACH0] = strand[i, REACH1] = tolerance
        strand[i, USED] = 0.0
        return 0.0, 0.0
    if length <= 8.0 * tolerance and is_resting(strand, i) and is_resting(strand, i + 1):
        return _probe_short_edge(field, strand, i, length, tolerance)
    low, where, s = math.inf, 0.0, 0.0
    reach0 = reach1 = 1e6 * tolerance
    before, step = 0.0, 0.0
    while True:
        t = s / length
        d = distance(field, ax + t * (bx - ax), ay + t * (by - ay), az + t * (bz - az))
        if d < low:
            low, where = d, t
        if s > 0.0:
            # between two samples the distance is at least that of both cones, because it changes
            # by at most the distance moved. A point at fraction t moves by (1 - t) of the first
            # end's motion and t of the second's.
            room = max(0.5 * (before + d - step) + tolerance, 0.0)
            reach0 = min(reach0, room / (1.0 - (s - step) / length))
            reach1 = min(reach1, room / t)
        if s >= length:
            break
        before, step = d, min(0.7 * max(d, 0.0) + tolerance, length - s)
        s = length if s + step >= length * (1.0 - 1e-12) else s + step
    strand[i, REACH0] = max(reach0, 1e-6 * tolerance)
    strand[i, REACH1] = max(reach1, 1e-6 * tolerance)
    strand[i, USED] = 0.0
    if low < 0.0:
        strand[i, EXTRA] = _arc_over(field, ax, ay, az, bx, by, bz, length, low, where)
    return low, where


@kernel
def is_resting(strand: Floats, i: int) -> bool:
    """Return whether node i rests on something."""
    return bool(strand[i, NX] != 0.0 or strand[i, NY] != 0.0 or strand[i, NZ] != 0.0)


@kernel
def _probe_short_edge(
    field: Field, strand: Floats, i: int, length: float, tolerance: float
) -> tuple[float, float]:
    """Probe a short edge between two contacts at its quarter points.

    No point of the edge is farther than an eighth of it, which is at most the tolerance, from one
    of them.
    """
    low, where, middle = math.inf, 0.5, 0.0
    for k in range(1, 4):
        t = 0.25 * k
        d = distance(
            field,
            strand[i, X] + t * (strand[i + 1, X] - strand[i, X]),
            strand[i, Y] + t * (strand[i + 1, Y] - strand[i, Y]),
            strand[i, Z] + t * (strand[i + 1, Z] - strand[i, Z]),
        )
        if k == 2:
            middle = d
        if d < low:
            low, where = d, t
    strand[i, REACH0] = strand[i, REACH1] = max(low + tolerance, 0.1 * tolerance)
    strand[i, USED] = 0.0
    if middle < 0.0:
        a = 2.0 * math.atan(-2.0 * middle / length)
        strand[i, EXTRA] = length * (a / math.sin(a) - 1.0)
    return low, where


@kernel
def _arc_over(
    field: Field,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    length: float,
    low: float,
    where: float,
) -> float:
    """Return by how much the surface's arc over an edge is longer than the edge.

    With both ends on the surface, the edge is the chord c of an arc of sagitta g. Its half angle is
    a = 2 atan(2 g / c), and its length c a / sin a. With one end on the surface, the edge leaves
    the solid again. The arc over its inner part turns half as far before it goes on along the
    tangent, and is longer by r (a - sin a), about (4/3) g^2 / c.
    """
    if 0.3 < where < 0.7:
        g = -distance(field, 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (az + bz))
        if g <= 0.0:
            return 0.0
        a = 2.0 * math.atan(2.0 * g / length)
        return length * (a / math.sin(a) - 1.0)
    chord = 2.0 * length * min(where, 1.0 - where)
    if chord <= 0.0:
        return 0.0
    return min(4.0 / 3.0 * low * low / chord, 0.5 * -low)


@kernel
def release(strand: Floats, i: int) -> None:
    """Note that node i rests on nothing."""
    for k in range(EX, NZ + 1):
        strand[i, k] = 0.0
    strand[i, SHARP] = strand[i, STALE] = strand[i, CURVE] = strand[i, STEP] = 0.0
    strand[i, PART] = -1.0


@kernel
def to_surface(
    field: Field, x: float, y: float, z: float, tolerance: float
) -> tuple[float, float, float]:
    """Return the point of the surface near a point that is not deep.

    Leaving one solid may mean entering another: in the crease between two solids, the point moves
    back and forth in ever smaller steps.
    """
    for turn in range(12):
        d, nx, ny, nz, _ = sample(field, x, y, z)
        if -tolerance <= d and (turn > 0 or d <= tolerance):
            break
        x, y, z = x - d * nx, y - d * ny, z - d * nz
    return x, y, z


@kernel
def edge_point(
    a: Vector, na: Vector, da: float, b: Vector, nb: Vector, db: float, p: Vector
) -> tuple[float, float, float, float]:
    """Return the point nearest to p on two tangent planes of a solid, and the sine of their angle.

    The planes belong to the points a and b with distances da and db and normals na and nb. Where
    they are parallel, the point is p.
    """
    (ax, ay, az), (bx, by, bz), (px, py, pz) = a, b, p
    cosine = na[0] * nb[0] + na[1] * nb[1] + na[2] * nb[2]
    det = 1.0 - cosine * cosine
    if det < 1e-9:
        return px, py, pz, 0.0
    # q = p + s na + t nb on both planes
    r = -da - (px - ax) * na[0] - (py - ay) * na[1] - (pz - az) * na[2]
    q = -db - (px - bx) * nb[0] - (py - by) * nb[1] - (pz - bz) * nb[2]
    s, t = (r - cosine * q) / det, (q - cosine * r) / det
    return (
        px + s * na[0] + t * nb[0],
        py + s * na[1] + t * nb[1],
        pz + s * na[2] + t * nb[2],
        math.sqrt(det),
    )


@kernel
def exit_point(
    field: Field, strand: Floats, i: int, where: float, settings: PullSettings
) -> tuple[float, float, float]:
    """Return where a strand comes out of a solid at fraction `where` of edge i, which is too deep.

    That is on the sharp edge of the solid that the strand cuts off, else straight out.
    """
    slip = settings.slip
    ux = strand[i + 1, X] - strand[i, X]
    uy = strand[i + 1, Y] - strand[i, Y]
    uz = strand[i + 1, Z] - strand[i, Z]
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    mx = strand[i, X] + where * ux
    my = strand[i, Y] + where * uy
    mz = strand[i, Z] + where * uz
    s = min(slip, 0.5 * length * min(where, 1.0 - where)) / length
    ax, ay, az = mx - s * ux, my - s * uy, mz - s * uz
    bx, by, bz = mx + s * ux, my + s * uy, mz + s * uz
    da, fx, fy, fz, _ = sample(field, ax, ay, az)
    db, gx, gy, gz, _ = sample(field, bx, by, bz)
    qx, qy, qz, sine = edge_point(
        (ax, ay, az), (fx, fy, fz), da, (bx, by, bz), (gx, gy, gz), db, (mx, my, mz)
    )
    near = (qx - mx) ** 2 + (qy - my) ** 2 + (qz - mz) ** 2 <= (4.0 * slip) ** 2
    if sine > settings.min_sharp_sine and near and abs(distance(field, qx, qy, qz)) < 0.1 * slip:
        return qx, qy, qz
    return to_surface(field, mx, my, mz, 0.01 * slip)


@kernel
def update_frame(field: Field, strand: Floats, i: int, settings: PullSettings) -> float:
    """Update the slide direction and normal of contact i from samples of the surface before and
    after it.

    The two normals span the plane in which the tether turns over the surface. Their cross product
    is the direction conjugate to the tether. Where the normals differ much, the contact is on a
    sharp edge, and the node is put on it: on both tangent planes. Otherwise the node is put on the
    surface.

    Returns how far the node was moved.
    """
    spread, reach = settings.spread, settings.stride
    px, py, pz = strand[i, X], strand[i, Y], strand[i, Z]
    ux, uy, uz = px - strand[i - 1, X], py - strand[i - 1, Y], pz - strand[i - 1, Z]
    wx, wy, wz = strand[i + 1, X] - px, strand[i + 1, Y] - py, strand[i + 1, Z] - pz
    lu = math.sqrt(ux * ux + uy * uy + uz * uz)
    lw = math.sqrt(wx * wx + wy * wy + wz * wz)
    if lu == 0.0 or lw == 0.0:
        return 0.0
    ux, uy, uz, wx, wy, wz = ux / lu, uy / lu, uz / lu, wx / lw, wy / lw, wz / lw
    s, t = min(spread, 0.5 * lu), min(spread, 0.5 * lw)
    d1, ax, ay, az, _ = sample(field, px - s * ux, py - s * uy, pz - s * uz)
    d2, bx, by, bz, _ = sample(field, px + t * wx, py + t * wy, pz + t * wz)
    ex, ey, ez = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    sine = math.sqrt(ex * ex + ey * ey + ez * ez)
    cosine = ax * bx + ay * by + az * bz
    qx, qy, qz = px, py, pz
    strand[i, SHARP] = 0.0
    if sine > settings.min_sharp_sine and cosine > -0.95:
        first = (px - s * ux, py - s * uy, pz - s * uz)
        second = (px + t * wx, py + t * wy, pz + t * wz)
        qx, qy, qz, _ = edge_point(first, (ax, ay, az), d1, second, (bx, by, bz), d2, (px, py, pz))
        if (qx - px) ** 2 + (qy - py) ** 2 + (qz - pz) ** 2 <= reach * reach:
            strand[i, SHARP] = 1.0
        else:
            qx, qy, qz = px, py, pz
    d, nx, ny, nz, part = sample(field, qx, qy, qz)
    if d > reach:
        release(strand, i)
        return 0.0
    if abs(d) > 1e-4 * reach:
        qx, qy, qz = to_surface(field, qx, qy, qz, 1e-3 * reach)
    if strand[i, SHARP] == 1.0:
        nx, ny, nz = ax + bx, ay + by, az + bz
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        strand[i, CONE] = 0.5 * length
        nx, ny, nz = nx / length, ny / length, nz / length
    # the mean direction of the tether
    tx, ty, tz = ux + wx, uy + wy, uz + wz
    length = math.sqrt(tx * tx + ty * ty + tz * tz)
    if length > 1e-9:
        tx, ty, tz = tx / length, ty / length, tz / length
    along = (ex * tx + ey * ty + ez * tz) / sine if sine > 0.0 else 1.0
    if sine <= settings.flat or (strand[i, SHARP] == 0.0 and abs(along) > 0.95):
        ex, ey, ez = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        sine = math.sqrt(ex * ex + ey * ey + ez * ez)
    if sine > 1e-12:
        strand[i, EX], strand[i, EY], strand[i, EZ] = ex / sine, ey / sine, ez / sine
        if strand[i, SHARP] == 0.0:
            _note_curvature(field, strand, i, (qx, qy, qz), settings)
        else:
            strand[i, CURVE] = 0.0
    strand[i, NX], strand[i, NY], strand[i, NZ] = nx, ny, nz
    strand[i, X], strand[i, Y], strand[i, Z] = qx, qy, qz
    strand[i, PART] = part
    strand[i, STALE] = 0.0
    return math.sqrt((qx - px) ** 2 + (qy - py) ** 2 + (qz - pz) ** 2)


@kernel
def _note_curvature(
    field: Field, strand: Floats, i: int, point: Vector, settings: PullSettings
) -> None:
    """Note the curvature of the surface along the slide direction of node i, and edges near it."""
    qx, qy, qz = point
    ex, ey, ez = strand[i, EX], strand[i, EY], strand[i, EZ]
    spread = settings.spread
    _, ax, ay, az, _ = sample(field, qx - spread * ex, qy - spread * ey, qz - spread * ez)
    _, bx, by, bz, _ = sample(field, qx + spread * ex, qy + spread * ey, qz + spread * ez)
    before, after = ax * ex + ay * ey + az * ez, bx * ex + by * ey + bz * ez
    strand[i, CURVE] = (after - before) / (2.0 * spread)
    strand[i, CONE] = 0.0
    if after > settings.min_sharp_sine and before > -0.1:
        strand[i, CONE] = 1.0
    elif before < -settings.min_sharp_sine and after < 0.1:
        strand[i, CONE] = -1.0


@kernel
def sweep_is_free(
    field: Field,
    cx: float,
    cy: float,
    cz: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    tolerance: float,
) -> bool:
    """Return whether the triangle is free that an edge from c sweeps when its other end moves from
    a to b.

    A point at fraction t of the edge moves by t |ab|. Depths up to `tolerance` count as free.
    """
    motion = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2 + (bz - az) ** 2)
    length = math.sqrt((bx - cx) ** 2 + (by - cy) ** 2 + (bz - cz) ** 2)
    if length == 0.0:
        return motion <= tolerance
    s = 0.0
    while True:
        t = s / length
        d = distance(field, cx + t * (bx - cx), cy + t * (by - cy), cz + t * (bz - cz))
        room = d - t * motion + tolerance
        if room < 0.0:
            return False
        if s >= length:
            return True
        s = min(length, s + max(room, 0.25 * tolerance) / (1.0 + motion / length))


@kernel
def is_segment_free(
    field: Field,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    depth: float,
    step: float,
) -> bool:
    """Return whether no point of a segment is deeper than `depth`, to within `step`.

    A negative depth is a distance to keep.
    """
    return lowest_along(field, ax, ay, az, bx, by, bz, step)[0] >= -depth
