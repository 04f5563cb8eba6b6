"""Edges of a mesh, by which faces belong together, agree on an outside, and leave holes."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel


@dataclass(frozen=True)
class Edges:
    """Edges of a mesh with m faces.

    Parameters
    ----------
    ends : ndarray, shape (k, 2)
        Vertices at the ends of each edge, the smaller first.
    uses : ndarray, shape (k,)
        Number of faces at each edge.
    balance : ndarray, shape (k,)
        Number of faces that pass the edge from its first end, minus the number that pass it back.
    index : ndarray, shape (3, m)
        Number of the first, second and third edge of each face.
    """

    ends: Ints
    uses: Ints
    balance: Ints
    index: Ints

    @property
    def open_count(self) -> int:
        """Number of edges with an odd number of faces."""
        return int((self.uses % 2 == 1).sum())

    @property
    def uneven_count(self) -> int:
        """Number of edges at which an even number of faces disagrees on the outside."""
        return int(((self.uses % 2 == 0) & (self.balance != 0)).sum())


def welded(vertices: Floats, tolerance: float) -> Ints:
    """Return a number (n,) for each vertex, the same for vertices at one place.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Vertices; STL files repeat them for each face.
    tolerance : float
        Width of a place, metres.
    """
    places = np.round((vertices - vertices.min(axis=0)) / tolerance)
    _, same = np.unique(places, axis=0, return_inverse=True)
    return np.asarray(same.ravel())


def edges_of(faces: Ints) -> Edges:
    """Return the edges of faces (m, 3) of welded vertices."""
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    sign = np.where(directed[:, 0] > directed[:, 1], -1, 1)
    ends, index = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    index = index.ravel()
    uses = np.bincount(index, minlength=len(ends))
    balance = np.bincount(index, sign, minlength=len(ends)).astype(np.int64)
    return Edges(ends, uses, balance, index.reshape(3, -1))


def parts_of(faces: Ints) -> Ints:
    """Return the number (m,) of the part of each face; the faces of a part share vertices."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = int(faces.max()) + 1
    a, b = np.r_[faces[:, 0], faces[:, 1]], np.r_[faces[:, 1], faces[:, 2]]
    links = coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
    _, part = connected_components(links, directed=False)
    _, number = np.unique(part[faces[:, 0]], return_inverse=True)
    return np.asarray(number.ravel())


def pieces_of(faces: Ints) -> tuple[Ints, Bools, Bools]:
    """Return pieces of faces that meet two by two at edges, and which faces to turn in each.

    Returns
    -------
    piece : ndarray, shape (m,)
        Number of the piece of each face.
    is_turned : ndarray of bool, shape (m,)
        Whether a face must be turned so that its piece has one outside.
    is_one_sided : ndarray of bool, shape (m,)
        Whether a face belongs to a piece with no two sides, as a Moebius strip.
    """
    edges = edges_of(faces)
    flat = edges.index.ravel()
    owner = np.tile(np.arange(len(faces)), 3)
    order = np.argsort(flat, kind="stable")
    first = np.searchsorted(flat[order], np.arange(len(edges.ends)))
    pairs = np.flatnonzero(edges.uses == 2)
    a, b = owner[order[first[pairs]]], owner[order[first[pairs] + 1]]
    root, turn, wrong = join_faces(len(faces), a, b, edges.balance[pairs] != 0)
    _, piece = np.unique(root, return_inverse=True)
    piece = piece.ravel()
    one_sided = np.zeros(int(piece.max(initial=-1)) + 1, dtype=bool)
    one_sided[piece[wrong]] = True
    return piece, turn, one_sided[piece]


@kernel
def join_faces(count: int, a: Ints, b: Ints, disagrees: Bools) -> tuple[Ints, Bools, Bools]:
    """Join pairs of faces into pieces; return root, whether to turn it, and whether it cannot be.

    A face and its neighbour must be turned alike unless they disagree.
    """
    parent = np.arange(count)
    parity = np.zeros(count, dtype=np.bool_)
    wrong = np.zeros(count, dtype=np.bool_)
    for k in range(len(a)):
        i, turn_i = find_root(parent, parity, a[k])
        j, turn_j = find_root(parent, parity, b[k])
        turned = turn_i ^ turn_j ^ disagrees[k]
        if i != j:
            parent[max(i, j)], parity[max(i, j)] = min(i, j), turned
        elif turned:
            wrong[a[k]] = True
    for i in range(count):
        find_root(parent, parity, i)
    return parent, parity, wrong


@kernel
def find_root(parent: Ints, parity: Bools, start: int) -> tuple[int, bool]:
    """Return the root of a face and whether to turn the face against it; shorten its chain."""
    root, turn = start, False
    while parent[root] != root:
        turn ^= parity[root]
        root = parent[root]
    at, left = start, turn
    while parent[at] != root and at != root:
        after, before = parent[at], parity[at]
        parent[at], parity[at] = root, left
        left ^= before
        at = after
    return root, turn


def open_loops(faces: Ints) -> list[list[int]]:
    """Return the loops of vertices round the holes of faces (m, 3) with one outside.

    The boundary of any set of oriented faces is a sum of loops. Each loop is in the direction of
    the faces that are missing.
    """
    edges = edges_of(faces)
    after: dict[int, list[int]] = defaultdict(list)
    for (u, v), balance in zip(edges.ends.tolist(), edges.balance.tolist(), strict=True):
        if balance > 0:
            after[v] += [u] * balance
        elif balance < 0:
            after[u] += [v] * -balance
    loops = []
    for start in list(after):
        while after[start]:
            walk, place = [start], {start: 0}
            while True:
                following = after[walk[-1]].pop()
                if following in place:
                    begin = place[following]
                    loops.append(walk[begin:])
                    for vertex in walk[begin + 1 :]:
                        del place[vertex]
                    del walk[begin + 1 :]
                    if begin == 0 and not after[walk[0]]:
                        break
                    if begin == 0:
                        continue
                else:
                    place[following] = len(walk)
                    walk.append(following)
    return loops
