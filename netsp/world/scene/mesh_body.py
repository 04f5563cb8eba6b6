"""Body of a mesh: the faces that bound a solid, and the sheets, which have water on both sides.

Many meshes are open, inside out, or soups of faces. Closed parts bound solids. An
open part does, too, if its winding number just behind its faces is nearly 1: its holes are small,
and flat fans close them. Faces whose edges do not meet may still enclose a solid together; if so,
their winding number is nearly 1 behind them, and it decides what is inside. All other faces are
sheets.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.bounded_work import end_if_abandoned
from netsp.base.errors import counted
from netsp.world.scene.face_tree import FaceTree
from netsp.world.scene.mesh_edges import edges_of, open_loops, parts_of, pieces_of, welded
from netsp.world.scene.scene_policy import MeshPolicy

Surface = Literal["solid", "sheet"]
"""Kind of an open part of a mesh."""


@dataclass(frozen=True)
class MeshBody:
    """Body of a mesh.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Vertices, metres, with the middles of the fans that close holes.
    solid : ndarray, shape (m, 3)
        Faces of a closed surface about the solid, normals outwards; fans come last.
    fans : int
        Number of faces at the end of `solid` that close holes.
    sheet : ndarray, shape (k, 3)
        Faces with water on both sides.
    turned : int
        Number of closed parts that were inside out.
    notes : tuple of str
        Defects of the mesh and what was made of them, one line each.
    thickness : float, optional
        Thickness of sheets and of parts that no voxel shows, metres; None for four voxels.
    loose : ndarray, shape (j, 3)
        Faces about a solid whose edges do not meet, normals outwards. A place is inside where their
        winding number is 0.5 or more.
    """

    vertices: Floats
    solid: Ints
    fans: int
    sheet: Ints
    turned: int
    notes: tuple[str, ...]
    thickness: float | None = None
    loose: Ints = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))

    @property
    def triangles(self) -> Floats:
        """Triangles (n, 3, 3) of all faces, with the fans that close holes."""
        return np.asarray(self.vertices[np.concatenate([self.solid, self.loose, self.sheet])])

    def holds(self, places: Floats) -> Bools:
        """Return whether places (n, 3) lie inside the solid, by its winding numbers."""
        inside = np.zeros(len(places), dtype=bool)
        for faces in (self.solid, self.loose):
            if len(faces) and len(places):
                tree = FaceTree.build(self.vertices[faces])
                inside |= np.abs(tree.windings(places)) >= 0.5
        return inside


def body_of_mesh(
    vertices: Floats,
    faces: Ints,
    *,
    surface: Surface | None = None,
    policy: MeshPolicy | None = None,
) -> MeshBody:
    """Return the body of a mesh.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Vertices, metres.
    faces : ndarray, shape (m, 3)
        Corners of the faces.
    surface : {"solid", "sheet"}, optional
        What open parts are; None for a choice by their winding numbers.
    policy : MeshPolicy, optional
        Policy of open and doubtful meshes.

    Examples
    --------
    >>> import numpy as np
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> body = body_of_mesh(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    >>> len(body.solid), len(body.sheet), body.notes
    (4, 0, ())
    """
    policy = policy or MeshPolicy()
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    same = welded(vertices, max(policy.weld_share * diagonal, 1e-12))
    g = same[faces]
    good = (g[:, 0] != g[:, 1]) & (g[:, 1] != g[:, 2]) & (g[:, 2] != g[:, 0])
    if not good.any():
        return MeshBody(vertices, faces[:0], 0, faces, 0, ())
    builder = _Builder(vertices, faces[good], g[good], surface, policy)
    return builder.body()


class _Builder:
    """Builder of a body from faces, by the vertices of the file and by welded vertices."""

    def __init__(
        self,
        vertices: Floats,
        faces: Ints,
        welded_faces: Ints,
        surface: Surface | None,
        policy: MeshPolicy,
    ) -> None:
        self.vertices, self.surface, self.policy = vertices, surface, policy
        self.faces, self.welded_faces = faces, welded_faces
        self.notes: list[str] = []
        self.solid: list[Ints] = []
        self.sheet: list[Ints] = []
        self.sheet_rows: list[Ints] = []
        self.loose: Ints = faces[:0]
        self.fans: list[Ints] = []
        self.apexes: list[Floats] = []
        self.turned = 0
        self.holes: list[float] = []
        self.open_inverted = 0

    def body(self) -> MeshBody:
        """Return the body."""
        share, edge_count = self._boundary()
        self._drop_doubles()
        part = parts_of(self.welded_faces)
        is_closed = self._closed_parts(part)
        closed = is_closed[part]
        if closed.any():
            faces, self.turned = outward_parts(self.faces[closed], part[closed], self.vertices)
            self.solid.append(faces)
        if not closed.all():
            solid_parts = self._open_parts(part, np.flatnonzero(~is_closed))
            loose_parts = self._loose_solid(part)
            self._note_open(share, edge_count, (solid_parts, loose_parts, len(self.sheet)))
        none = self.faces[:0]
        fans = np.vstack(self.fans) if self.fans else none
        vertices = np.vstack([self.vertices, *self.apexes]) if self.apexes else self.vertices
        return MeshBody(
            vertices,
            np.vstack([none, *self.solid, fans]),
            len(fans),
            np.vstack([none, *self.sheet]),
            self.turned,
            tuple(self.notes),
            loose=self.loose,
        )

    def _boundary(self) -> tuple[float, int]:
        """Return the share and the number of edges with one face only."""
        edges = edges_of(self.welded_faces)
        return edges.open_count / max(len(edges.ends), 1), edges.open_count

    def _drop_doubles(self) -> None:
        """Keep one of faces that lie back to back with water on both sides."""
        key = np.sort(self.welded_faces, axis=1)
        _, first, index, count = np.unique(
            key, axis=0, return_index=True, return_inverse=True, return_counts=True
        )
        double = count[index.ravel()] > 1
        if not double.any():
            return
        tree = FaceTree.build(self.vertices[self.faces])
        at = np.flatnonzero(double)
        front, behind = _sides(self.vertices[self.faces[at]], self.policy)
        alike = np.rint(tree.windings(front)) == np.rint(tree.windings(behind))
        outside = np.abs(tree.windings(front)) < 0.5
        keep = np.ones(len(self.faces), dtype=bool)
        keep[at[alike & outside]] = False
        keep[first[index.ravel()[at[alike & outside]]]] = True
        lost = int((~keep).sum())
        if lost:
            self.notes.append(
                f"{counted(lost, 'face')} of {len(keep)} lie on the back of others: left out"
            )
            self.faces, self.welded_faces = self.faces[keep], self.welded_faces[keep]

    def _closed_parts(self, part: Ints) -> Bools:
        """Return whether each part is closed with one outside."""
        edges = edges_of(self.welded_faces)
        owner = part[_face_of_edge(edges.index, len(edges.ends))]
        count = int(part.max()) + 1
        if edges.uneven_count:
            self.notes.append(
                f"faces at {counted(edges.uneven_count, 'edge')} disagree on the outside: turned"
            )
        is_even = (edges.uses % 2 == 0) & (edges.balance == 0)
        return np.asarray(np.bincount(owner, ~is_even, minlength=count) == 0)

    def _open_parts(self, part: Ints, numbers: Ints) -> int:
        """Sort open parts into solids and sheets; return the number of solids."""
        order = np.argsort(part, kind="stable")
        begin = np.searchsorted(part[order], np.arange(int(part.max()) + 2))
        count = 0
        for number in numbers.tolist():
            rows = order[begin[number] : begin[number + 1]]
            end_if_abandoned()
            is_solid = False
            if self.surface != "sheet" and len(rows) >= self.policy.min_solid_faces:
                is_solid = self._close(rows)
            if not is_solid:
                self.sheet.append(self.faces[rows])
                self.sheet_rows.append(rows)
            count += is_solid
        return count

    def _loose_solid(self, part: Ints) -> int:
        """Take sheets that enclose a solid together as its surface; return how many parts."""
        if self.surface == "sheet" or len(self.sheet) < 2:
            return 0
        rows = np.concatenate(self.sheet_rows)
        piece, turn, one_sided = pieces_of(self.welded_faces[rows])
        if one_sided.any():
            return 0
        faces = np.where(turn[:, None], self.faces[rows][:, ::-1], self.faces[rows])
        is_inward = facing_inward(self.vertices[faces], piece, self.policy)
        faces = np.where(is_inward[:, None], faces[:, ::-1], faces)
        triangles = self.vertices[faces]
        front, behind = _sides(triangles, self.policy)
        likely = FaceTree.build(triangles).windings(behind) >= self.policy.min_loose_winding
        if likely.sum() < self.policy.min_solid_faces:
            return 0
        if self.surface is None:
            doubt = winding_doubt(triangles[likely], self.policy)
            if doubt > 1.0 - self.policy.min_closedness:
                return 0
        tree = FaceTree.build(triangles[likely])
        is_solid_behind, is_solid_before = tree.windings(behind) >= 0.5, tree.windings(front) >= 0.5
        is_bound = likely | (is_solid_behind & ~is_solid_before)
        is_buried = ~is_bound & is_solid_behind & is_solid_before
        if is_buried.any():
            self.notes.append(f"{counted(int(is_buried.sum()), 'face')} lie in the solid: left out")
        self.loose = faces[is_bound]
        before, kept = len(self.sheet), rows[~is_bound & ~is_buried]
        self.sheet = [self.faces[kept[part[kept] == k]] for k in np.unique(part[kept])]
        return before - len(self.sheet)

    def _close(self, rows: Ints) -> bool:
        """Close the holes of an open part if it bounds a solid; return whether it does."""
        piece, turn, one_sided = pieces_of(self.welded_faces[rows])
        if one_sided.any():
            return False
        faces = np.where(turn[:, None], self.faces[rows][:, ::-1], self.faces[rows])
        same = np.where(turn[:, None], self.welded_faces[rows][:, ::-1], self.welded_faces[rows])
        is_inward = facing_inward(self.vertices[faces], piece, self.policy)
        faces = np.where(is_inward[:, None], faces[:, ::-1], faces)
        same = np.where(is_inward[:, None], same[:, ::-1], same)
        if self.surface is None:
            around = closedness(self.vertices[faces], self.policy)
            if around < self.policy.min_closedness:
                return False
        self.open_inverted += bool((is_inward ^ turn).mean() > 0.5)
        self.solid.append(faces)
        self._add_fans(faces, same)
        return True

    def _add_fans(self, faces: Ints, same: Ints) -> None:
        """Close the holes of faces by fans about the middles of their loops."""
        place = dict(zip(same.ravel().tolist(), faces.ravel().tolist(), strict=True))
        for loop in open_loops(same):
            corners = np.array([place[v] for v in loop])
            middle = self.vertices[corners].mean(axis=0)
            self.holes.append(float(np.linalg.norm(np.ptp(self.vertices[corners], axis=0))))
            apex = len(self.vertices) + len(self.apexes)
            self.apexes.append(middle[None])
            fan = np.column_stack([corners, np.roll(corners, -1), np.full(len(corners), apex)])
            self.fans.append(fan)

    def _note_open(self, share: float, edges: int, counts: tuple[int, int, int]) -> None:
        """Note what was made of open parts: the numbers of solid, loose and sheet ones."""
        made, (solids, loose, sheets) = [], counts
        if solids:
            made.append(f"{counted(solids, 'part')} taken as solid")
            if self.holes:
                widest = max(self.holes)
                made[0] += f", {counted(len(self.holes), 'hole')} closed, the widest {widest:.3g}"
        if loose:
            part = len(self.loose) / len(self.faces)
            made.append(
                f"{counted(loose, 'part')} ({percent(part)} of its faces) taken together as solid "
                "by the winding number"
            )
        if sheets:
            part = sum(len(f) for f in self.sheet) / len(self.faces)
            made.append(
                f"{counted(sheets, 'part')} ({percent(part)} of its faces) taken as sheets with "
                "water on both sides"
            )
        if edges:
            cause = f"the mesh is open, {percent(share)} of its edges have one face only"
        else:
            cause = "parts of the mesh have no clear outside"
        self.notes.append(f"{cause}: {'; '.join(made)}")
        if self.open_inverted:
            self.notes.append(f"{counted(self.open_inverted, 'open part')} inside out: turned")


def percent(share: float) -> str:
    """Return a share as a percentage of two digits.

    Examples
    --------
    >>> percent(0.0051), percent(1.0)
    ('0.51 %', '100 %')
    """
    return f"{100 * share:.0f} %" if share >= 0.095 else f"{100 * share:.2g} %"


def outward_parts(faces: Ints, part: Ints, vertices: Floats) -> tuple[Ints, int]:
    """Return closed parts with their normals outwards, and the number of parts turned.

    So overlapping parts never cancel, and cavities are solid.
    """
    a, b, c = (vertices[faces[:, k]] - vertices.mean(0) for k in range(3))
    volume = np.bincount(part, np.einsum("ij,ij->i", a, np.cross(b, c)))
    wrong = volume[part] < 0.0
    return np.where(wrong[:, None], faces[:, ::-1], faces), int((volume < 0.0).sum())


def facing_inward(triangles: Floats, piece: Ints, policy: MeshPolicy) -> Bools:
    """Return whether each triangle belongs to a piece whose normals point inwards.

    Outside is the side of a piece from which more rays meet no triangle (Takayama et al. 2014).
    """
    tree = FaceTree.build(triangles)
    chosen = _samples(triangles, policy.samples, piece)
    front, behind = _sides(triangles[chosen], policy)
    ahead = sphere_points(policy.rays)
    normals = front - behind
    free = np.zeros(len(chosen))
    for sign, starts in ((1.0, front), (-1.0, behind)):
        directions = np.where(
            sign * (normals @ ahead.T)[:, :, None] > 0.0, ahead[None], -ahead[None]
        )
        lengths = tree.ray_lengths(np.repeat(starts, len(ahead), axis=0), directions.reshape(-1, 3))
        free += sign * np.isinf(lengths).reshape(len(chosen), -1).sum(axis=1)
    weights = _areas(triangles[chosen])
    votes = np.bincount(piece[chosen], free * weights, minlength=int(piece.max()) + 1)
    return np.asarray(votes[piece] < 0.0)


def closedness(triangles: Floats, policy: MeshPolicy) -> float:
    """Return the mean winding number just behind triangles (m, 3, 3) with one outside.

    1 for a closed surface; about 0.95 if a tenth of a ball is missing, and 0.5 for a flat sheet.
    """
    tree = FaceTree.build(triangles)
    chosen = _samples(triangles, policy.samples)
    _, behind = _sides(triangles[chosen], policy)
    areas = _areas(triangles[chosen])
    return float(np.average(tree.windings(behind), weights=areas))


def winding_doubt(triangles: Floats, policy: MeshPolicy) -> float:
    """Return how far winding numbers beside triangles (m, 3, 3) are from whole ones on average.

    0 for closed surfaces, even if they overlap; about 0.25 for random triangles, and 0.5 for a
    flat sheet.
    """
    tree = FaceTree.build(triangles)
    chosen = _samples(triangles, policy.samples)
    around = np.array([tree.windings(side) for side in _sides(triangles[chosen], policy)])
    far = np.abs(around - np.rint(around)).mean(axis=0)
    return float(np.average(far, weights=_areas(triangles[chosen])))


def sphere_points(count: int) -> Floats:
    """Return directions (count, 3) spread evenly over the sphere, on a spiral."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    turn = np.pi * (3.0 - np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - z * z)
    return np.column_stack([ring * np.cos(turn), ring * np.sin(turn), z])


def _areas(triangles: Floats) -> Floats:
    """Return the areas (m,) of triangles."""
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.asarray(0.5 * np.linalg.norm(np.cross(u, v), axis=1))


def _sides(triangles: Floats, policy: MeshPolicy) -> tuple[Floats, Floats]:
    """Return points (m, 3) just before and just behind the middles of triangles."""
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normals = np.cross(u, v)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.maximum(length, 1e-300)
    far = policy.side_share * float(np.linalg.norm(np.ptp(triangles.reshape(-1, 3), axis=0)))
    middle = triangles.mean(axis=1)
    return middle + far * normals, middle - far * normals


def _samples(triangles: Floats, count: int, piece: Ints | None = None) -> Ints:
    """Return the largest triangles of each piece, and others spread by area, `count` or more."""
    areas = _areas(triangles)
    total = float(areas.sum())
    steps = (np.arange(count) + 0.5) * total / count
    spread = np.searchsorted(np.cumsum(areas), steps)
    chosen = [np.minimum(spread, len(areas) - 1)]
    if piece is not None:
        order = np.lexsort((-areas, piece))
        chosen.append(order[np.r_[True, np.diff(piece[order]) > 0]])
    return np.unique(np.concatenate(chosen))


def _face_of_edge(index: Ints, count: int) -> Ints:
    """Return one face (count,) at each edge, from the edges (3, m) of faces."""
    out = np.zeros(count, dtype=np.int64)
    out[index.ravel()] = np.tile(np.arange(index.shape[1]), 3)
    return out
