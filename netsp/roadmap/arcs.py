"""Tangent graph for string pulling: departures by pair of nodes, arcs by obstacle.

The graph of `netsp.roadmap.tangents` lists the departures of a node in order, for a search. Pulling
a path taut needs the tangent between two given nodes, the arcs of an obstacle, and the letters
between two departures of an arc.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.model.problem import Circle, Problem
from netsp.roadmap.outline import Outline
from netsp.roadmap.roadmap_policy import PathPolicy
from netsp.roadmap.slits import Slits
from netsp.roadmap.tangents import TangentGraph

CX, CY, RADIUS, BEGIN, END = range(5)
"""Columns of a disk: a directed arc, or a point of no radius. BEGIN to END are the angles that
show; END is infinite where all do."""

LETTERS, AFTER_LETTERS, OWNER = range(3)
"""Columns of the integers of a node: where the letters of its whole arc begin and end, and an
obstacle whose arc it is, -1 for points."""

LENGTH, LEAVES, ARRIVES, TURN, ALONG = range(5)
"""Columns of the floats of a departure: length, angles at both ends, angle from the arrival to the
first departure there, and from the first departure of its own arc to itself."""

FIRST, SEGMENT, AFTER_SEGMENT, ARRIVAL, AFTER_ARRIVAL, GAPS = range(6)
"""Columns of the integers of a departure: the first departure at its end, and rows into the letters
of the segment, of the arc to that departure, and of the arc before itself."""

XMIN, YMIN, XMAX, YMAX, ROUND, RAY_X, RAY_Y, RANK = range(8)
FIRST_EDGE, AFTER_EDGES, GROWTH, MIDDLE_X, MIDDLE_Y = range(8, 13)
"""Columns of an obstacle: its box; radius of a circle, negative for a polygon; representative point
and rank of its line; its edges, and by how much they are grown; centre of a circle."""


class Arcs(NamedTuple):
    """Tangent graph in the form over which paths are pulled.

    There are few arrays with many columns, because compiled functions hand each array over in seven
    parts or more.

    Attributes
    ----------
    numbers, row
        Arcs of each obstacle: numbers[row[o]] … numbers[row[o + 1] - 1].
    disk, span
        (nodes, 5) and (nodes, 3) columns CX … and LETTERS ….
    table
        (slots, 2) hash table of departures by `source * nodes + target`, -1 where empty.
    edge_floats, edge_ints
        (e, 5) and (e, 6) columns LENGTH … and FIRST … of the departures.
    letters
        Letters of segments and arcs.
    solid
        (n, 13) columns XMIN ….
    edges
        (k, 4) edges of polygons.
    points
        Number of nodes that are directed arcs; points follow.
    max_bends, max_backward_turn
        Those of `PathPolicy`.
    """

    numbers: Ints
    row: Ints
    disk: Floats
    span: Ints
    table: Ints
    edge_floats: Floats
    edge_ints: Ints
    letters: Ints
    solid: Floats
    edges: Floats
    points: int
    max_bends: int
    max_backward_turn: float


def build_arcs(
    problem: Problem,
    outline: Outline,
    graph: TangentGraph,
    slits: Slits,
    policy: PathPolicy | None = None,
) -> Arcs:
    """Return a tangent graph in the form that string pulling needs."""
    policy = policy or PathPolicy()
    arcs, nodes = len(graph.arcs), len(graph.start) - 1
    disk = np.zeros((nodes, 5))
    disk[: 2 * arcs] = np.repeat(graph.arcs, 2, axis=0)
    disk[2 * arcs :, :2] = graph.points
    disk[: 2 * arcs, END][np.repeat(graph.full, 2)] = np.inf
    owner = np.full(nodes, -1, dtype=np.int64)
    numbers, row = [np.zeros(0, dtype=np.int64)], [0]
    arcs_of_disk: dict[tuple[float, ...], list[int]] = {}
    for k, (x, y, r) in enumerate(graph.arcs[:, :3].tolist()):
        arcs_of_disk.setdefault((x, y, r), []).append(k)
    for o, obstacle in enumerate(problem.obstacles):
        if isinstance(obstacle, Circle):
            corners, radius = np.array([obstacle.center]), outline.blockers.circles[o, 2]
        else:
            corners, radius = np.array(obstacle.polygon), outline.blockers.grow[o]
        disks = dict.fromkeys((x, y, float(radius)) for x, y in (corners - outline.origin).tolist())
        members = np.array(
            [k for disk in disks for k in arcs_of_disk.get(disk, [])], dtype=np.int64
        )
        owner[2 * members] = owner[2 * members + 1] = o
        numbers.append(members)
        row.append(row[-1] + len(members))
    source = np.repeat(np.arange(nodes), np.diff(graph.start))
    gap_letters, gaps, begin = _gap_letters(graph)
    edge_floats = np.column_stack([graph.length, graph.angle, graph.turn, _angles_along(graph)])
    table = np.full((1 << max(4, (3 * len(source)).bit_length()), 2), -1, dtype=np.int64)
    _fill_table(source * nodes + graph.target, table)
    edge_ints = np.column_stack([graph.first, graph.segment_row, graph.arrival_row, gaps])
    blockers = outline.blockers
    solid = np.column_stack(
        [
            blockers.box,
            blockers.circles[:, 2],
            graph.rays,
            slits.rank,
            blockers.edge_start[:-1],
            blockers.edge_start[1:],
            blockers.grow - blockers.eps,
            blockers.circles[:, :2],
        ]
    )
    return Arcs(
        np.concatenate(numbers),
        np.array(row),
        disk,
        np.column_stack([begin, owner]),
        table,
        edge_floats,
        edge_ints,
        np.concatenate([graph.letters.astype(np.int64), gap_letters]),
        solid,
        blockers.edges,
        2 * arcs,
        policy.max_bends,
        policy.max_backward_turn,
    )


def _angles_along(graph: TangentGraph) -> Floats:
    """Return the (e,) angles from the first departure of an arc to each."""
    step = np.maximum(graph.gap, 0.0)
    before = np.concatenate([[0.0], np.cumsum(step)])
    first = np.repeat(graph.start[:-1], np.diff(graph.start))
    return np.asarray(before[:-1] - before[first])


def _gap_letters(graph: TangentGraph) -> tuple[Ints, Ints, Ints]:
    """Return the letters of whole arcs, each in one row, to come after those of the graph; (e,)
    where in them each departure is; and (nodes, 2) where those of each node begin and end."""
    count = graph.gap_row[:, 1] - graph.gap_row[:, 0]
    base = len(graph.letters)
    begin = base + np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    letters = [graph.letters[a:b] for a, b in graph.gap_row[count > 0].tolist()]
    span = np.column_stack([begin[graph.start[:-1]], begin[graph.start[1:]]])
    together = np.concatenate([*letters, np.zeros(0)]).astype(np.int64)
    return together, begin[:-1], span.astype(np.int64)


@kernel
def _first_slot(code: int, slots: int) -> int:
    """Return the first slot for a code, by Knuth's multiplicative hashing."""
    return int(((code * 0x9E3779B1) >> 7) & (slots - 1))


@kernel
def _fill_table(code: Ints, table: Ints) -> None:
    slots = len(table)
    for e in range(len(code)):
        slot = _first_slot(code[e], slots)
        while table[slot, 0] >= 0:
            slot = (slot + 1) & (slots - 1)
        table[slot, 0], table[slot, 1] = code[e], e


@kernel
def find_tangent(code: int, table: Ints) -> int:
    """Return the departure of a code; -1 if there is none."""
    slots = len(table)
    slot = _first_slot(code, slots)
    while table[slot, 0] >= 0:
        if table[slot, 0] == code:
            return int(table[slot, 1])
        slot = (slot + 1) & (slots - 1)
    return -1
