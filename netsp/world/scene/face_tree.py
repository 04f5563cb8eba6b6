"""Tree of boxes about the faces of a mesh, for winding numbers and rays. Compiled.

The generalised winding number of a mesh about a point is the solid angle that the mesh takes up
there, over 4 pi: 1 inside a closed mesh whose normals point outwards, 0 outside, and in between
near the holes of an open one (Jacobson et al. 2013). Far from a node of the tree, one dipole stands
for all its faces (Barill et al. 2018).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.bounded_work import end_if_abandoned
from netsp.base.compiled.kernel import kernel

LEFT, RIGHT, BEGIN, END = range(4)
"""Columns of a node: its two children, -1 for none, and the range of its faces."""

CENTRE, NORMAL, REACH = 0, 3, 6
"""Columns of a dipole: centre (3) and sum of the area vectors (3) of the faces of a node, and the
distance from the centre to the farthest corner."""

Tree = tuple[Floats, Ints, Floats, Floats]
"""Triangles in the order of the tree, its nodes, their boxes and their dipoles."""


@dataclass(frozen=True)
class FaceTree:
    """Tree of the faces of a mesh.

    Parameters
    ----------
    arrays : Tree
        Arrays of the tree, for kernels.
    """

    arrays: Tree

    @classmethod
    def build(cls, triangles: Floats) -> FaceTree:
        """Return the tree of triangles (m, 3, 3), m at least 1."""
        order, nodes = split_faces(np.ascontiguousarray(triangles.mean(axis=1)))
        inner = np.ascontiguousarray(triangles[order])
        boxes, dipoles = measure_nodes(inner, nodes)
        return cls((inner, nodes, boxes, dipoles))

    def windings(self, points: Floats, accuracy: float = 2.0) -> Floats:
        """Return the generalised winding numbers (n,) about points (n, 3).

        Parameters
        ----------
        points : ndarray, shape (n, 3)
            Points, metres.
        accuracy : float
            Distance from a node, in radii of its faces, from which on a dipole stands for them. At
            2 the error is about 0.02.
        """
        end_if_abandoned()
        return np.asarray(windings_about(self.arrays, np.ascontiguousarray(points), accuracy))

    def ray_lengths(self, starts: Floats, directions: Floats) -> Floats:
        """Return how far (n,) rays go from their starts (n, 3) before they meet a face.

        Infinite if they meet none. Lengths are in units of the directions (n, 3).
        """
        end_if_abandoned()
        rays = np.ascontiguousarray(np.hstack([starts, directions]))
        return np.asarray(first_hits(self.arrays, rays))

    def blocks(self, eye: Floats, places: Floats) -> Bools:
        """Return whether a face lies between a point (3,) and each of places (n, 3)."""
        return np.asarray(are_blocked(self.arrays, eye, np.ascontiguousarray(places)))


LEAF_FACES = 6
"""Format of the tree: maximum number of faces of a node without children."""


@kernel
def split_faces(middles: Floats) -> tuple[Ints, Ints]:
    """Return the order of faces in a tree, and its nodes, from the middles (m, 3) of the faces."""
    count = len(middles)
    order = np.arange(count)
    nodes = np.full((2 * count + 1, 4), -1, dtype=np.int64)
    nodes[0, BEGIN], nodes[0, END] = 0, count
    used, at = 1, 0
    while at < used:
        begin, end = nodes[at, BEGIN], nodes[at, END]
        if end - begin > LEAF_FACES:
            axis, widest = 0, -1.0
            for a in range(3):
                values = middles[order[begin:end], a]
                width = values.max() - values.min()
                if width > widest:
                    axis, widest = a, width
            part = order[begin:end]
            order[begin:end] = part[np.argsort(middles[part, axis], kind="mergesort")]
            middle = (begin + end) // 2
            nodes[at, LEFT], nodes[at, RIGHT] = used, used + 1
            nodes[used, BEGIN], nodes[used, END] = begin, middle
            nodes[used + 1, BEGIN], nodes[used + 1, END] = middle, end
            used += 2
        at += 1
    return order, nodes[:used].copy()


@kernel
def measure_nodes(triangles: Floats, nodes: Ints) -> tuple[Floats, Floats]:
    """Return the boxes (k, 6) and dipoles (k, 7) of the nodes of a tree."""
    boxes = np.empty((len(nodes), 6))
    dipoles = np.zeros((len(nodes), 7))
    for n in range(len(nodes)):
        boxes[n, :3], boxes[n, 3:] = math.inf, -math.inf
        total = 0.0
        for s in range(nodes[n, BEGIN], nodes[n, END]):
            nx, ny, nz = area_vector(triangles, s)
            area = math.sqrt(nx * nx + ny * ny + nz * nz) + 1e-300
            total += area
            dipoles[n, NORMAL] += nx
            dipoles[n, NORMAL + 1] += ny
            dipoles[n, NORMAL + 2] += nz
            for a in range(3):
                x, y, z = triangles[s, 0, a], triangles[s, 1, a], triangles[s, 2, a]
                dipoles[n, CENTRE + a] += area * (x + y + z) / 3.0
                boxes[n, a] = min(boxes[n, a], x, y, z)
                boxes[n, 3 + a] = max(boxes[n, 3 + a], x, y, z)
        far = 0.0
        for a in range(3):
            dipoles[n, CENTRE + a] /= total
            centre = dipoles[n, CENTRE + a]
            span = max(centre - boxes[n, a], boxes[n, 3 + a] - centre)
            far += span * span
        dipoles[n, REACH] = math.sqrt(far)
    return boxes, dipoles


@kernel
def area_vector(t: Floats, s: int) -> tuple[float, float, float]:
    """Return the normal of triangle t[s], as long as its area."""
    ux, uy, uz = t[s, 1, 0] - t[s, 0, 0], t[s, 1, 1] - t[s, 0, 1], t[s, 1, 2] - t[s, 0, 2]
    vx, vy, vz = t[s, 2, 0] - t[s, 0, 0], t[s, 2, 1] - t[s, 0, 1], t[s, 2, 2] - t[s, 0, 2]
    return 0.5 * (uy * vz - uz * vy), 0.5 * (uz * vx - ux * vz), 0.5 * (ux * vy - uy * vx)


@kernel
def windings_about(tree: Tree, points: Floats, accuracy: float) -> Floats:
    """Return the winding numbers (n,) about points (n, 3)."""
    out = np.empty(len(points))
    for i in range(len(points)):
        out[i] = winding_about(tree, points[i, 0], points[i, 1], points[i, 2], accuracy)
    return out


@kernel
def winding_about(tree: Tree, x: float, y: float, z: float, accuracy: float) -> float:
    """Return the winding number about a point."""
    triangles, nodes, _, dipoles = tree
    waiting = np.empty(128, dtype=np.int64)
    waiting[0] = 0
    left, total = 1, 0.0
    while left > 0:
        left -= 1
        n = waiting[left]
        dx, dy, dz = (
            dipoles[n, CENTRE] - x,
            dipoles[n, CENTRE + 1] - y,
            dipoles[n, CENTRE + 2] - z,
        )
        square = dx * dx + dy * dy + dz * dz
        near = accuracy * dipoles[n, REACH]
        if square > near * near:
            flux = dx * dipoles[n, NORMAL] + dy * dipoles[n, NORMAL + 1]
            flux += dz * dipoles[n, NORMAL + 2]
            total += flux / (square * math.sqrt(square))
        elif nodes[n, LEFT] >= 0:
            waiting[left], waiting[left + 1] = nodes[n, LEFT], nodes[n, RIGHT]
            left += 2
        else:
            for s in range(nodes[n, BEGIN], nodes[n, END]):
                total += solid_angle(triangles, s, x, y, z)
    return float(total / (4.0 * math.pi))


@kernel
def solid_angle(t: Floats, s: int, x: float, y: float, z: float) -> float:
    """Return the solid angle that triangle t[s] takes up at a point, positive from behind.

    By van Oosterom and Strackee 1983.
    """
    ax, ay, az = t[s, 0, 0] - x, t[s, 0, 1] - y, t[s, 0, 2] - z
    bx, by, bz = t[s, 1, 0] - x, t[s, 1, 1] - y, t[s, 1, 2] - z
    cx, cy, cz = t[s, 2, 0] - x, t[s, 2, 1] - y, t[s, 2, 2] - z
    la = math.sqrt(ax * ax + ay * ay + az * az)
    lb = math.sqrt(bx * bx + by * by + bz * bz)
    lc = math.sqrt(cx * cx + cy * cy + cz * cz)
    volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    beside = la * lb * lc
    beside += (ax * bx + ay * by + az * bz) * lc
    beside += (bx * cx + by * cy + bz * cz) * la
    beside += (cx * ax + cy * ay + cz * az) * lb
    return 2.0 * math.atan2(volume, beside)


@kernel
def first_hits(tree: Tree, rays: Floats) -> Floats:
    """Return the length (n,) of rays (n, 6) from start and direction up to the first face."""
    out = np.empty(len(rays))
    for i in range(len(rays)):
        out[i] = _hit_within(tree, rays, i, math.inf, False)
    return out


@kernel
def _hit_within(tree: Tree, rays: Floats, i: int, max_length: float, stops_at_any: bool) -> float:
    """Return the length of ray i up to the first face within a maximum length; that without one.

    With `stops_at_any`, return the length up to any such face.
    """
    triangles, nodes, boxes, _ = tree
    waiting = np.empty(128, dtype=np.int64)
    waiting[0] = 0
    left, best = 1, max_length
    while left > 0:
        left -= 1
        n = waiting[left]
        if not _meets_box(boxes, n, rays, i, best):
            continue
        if nodes[n, LEFT] >= 0:
            waiting[left], waiting[left + 1] = nodes[n, LEFT], nodes[n, RIGHT]
            left += 2
            continue
        for s in range(nodes[n, BEGIN], nodes[n, END]):
            best = min(best, _face_hit(triangles, s, rays, i))
        if stops_at_any and best < max_length:
            break
    return float(best)


@kernel
def are_blocked(tree: Tree, eye: Floats, places: Floats) -> Bools:
    """Return whether a face lies between a point (3,) and each of places (n, 3)."""
    out = np.empty(len(places), dtype=np.bool_)
    rays = np.empty((1, 6))
    rays[0, :3] = eye
    for i in range(len(places)):
        rays[0, 3:] = places[i] - eye
        out[i] = _hit_within(tree, rays, 0, 1.0, True) < 1.0
    return out


@kernel
def _meets_box(boxes: Floats, n: int, rays: Floats, i: int, far: float) -> bool:
    """Return whether ray i meets box n within a length."""
    low, high = 0.0, far
    for a in range(3):
        start, ahead = rays[i, a], rays[i, 3 + a]
        if ahead == 0.0:
            if start < boxes[n, a] or start > boxes[n, 3 + a]:
                return False
            continue
        u, v = (boxes[n, a] - start) / ahead, (boxes[n, 3 + a] - start) / ahead
        low, high = max(low, min(u, v)), min(high, max(u, v))
    return low <= high


@kernel
def _face_hit(t: Floats, s: int, rays: Floats, i: int) -> float:
    """Return the length of ray i up to triangle t[s]; infinite if it misses it.

    By Moeller and Trumbore 1997.
    """
    bx, by, bz = t[s, 1, 0] - t[s, 0, 0], t[s, 1, 1] - t[s, 0, 1], t[s, 1, 2] - t[s, 0, 2]
    cx, cy, cz = t[s, 2, 0] - t[s, 0, 0], t[s, 2, 1] - t[s, 0, 1], t[s, 2, 2] - t[s, 0, 2]
    dx, dy, dz = rays[i, 3], rays[i, 4], rays[i, 5]
    px, py, pz = dy * cz - dz * cy, dz * cx - dx * cz, dx * cy - dy * cx
    det = bx * px + by * py + bz * pz
    if det == 0.0:
        return math.inf
    ax, ay, az = rays[i, 0] - t[s, 0, 0], rays[i, 1] - t[s, 0, 1], rays[i, 2] - t[s, 0, 2]
    u = (ax * px + ay * py + az * pz) / det
    if u < 0.0 or u > 1.0:
        return math.inf
    qx, qy, qz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    v = (dx * qx + dy * qy + dz * qz) / det
    if v < 0.0 or u + v > 1.0:
        return math.inf
    length = (cx * qx + cy * qy + cz * qz) / det
    return float(length) if length > 0.0 else math.inf
