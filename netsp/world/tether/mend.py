"""Repair of edges that are too deep in a solid."""

from __future__ import annotations

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.sampling import Field
from netsp.world.tether.strand import USED, X, Y, Z, exit_point, insert_node, probe_edge
from netsp.world.tether.tether_policy import PullSettings


@kernel
def mend(
    field: Field, strand: Floats, count: int, settings: PullSettings, room: int, deep: float
) -> tuple[Floats, int]:
    """Probe each edge that may be too deep, and put a node on the surface at its deepest point.

    Parameters
    ----------
    room : int
        Maximum number of nodes of the strand. One for every two slips is more than any surface
        needs; a strand that begins inside a solid could otherwise grow in every round.
    deep : float
        Depth at which an edge is too deep, metres. If it is below a slip, all edges are probed.
    """
    slip = settings.slip
    i, budget = 0, min(64 + 2 * count, room - count)
    while i < count - 1:
        if strand[i, USED] > 1.0 or deep < slip:
            low, where = probe_edge(field, strand, i, slip)
            if low < -deep and budget > 0:
                mx, my, mz = exit_point(field, strand, i, where, settings)
                if has_node_near(strand, count, i, mx, my, mz, 0.1 * slip):
                    i += 1  # a node at the same place would not help
                    continue
                strand, count = insert_node(strand, count, i + 1, mx, my, mz)
                budget -= 1
                continue
        i += 1
    return strand, count


@kernel
def has_node_near(
    strand: Floats, count: int, i: int, x: float, y: float, z: float, reach: float
) -> bool:
    """Return whether a node near edge i is closer to a point than `reach`.

    The comparison includes nodes beyond the ends of the edge: in the crease between two solids, a
    node that leaves one solid enters the other, and nodes would be added at the same two places
    without end.
    """
    for j in range(max(0, i - 2), min(count, i + 4)):
        if (strand[j, X] - x) ** 2 + (strand[j, Y] - y) ** 2 + (
            strand[j, Z] - z
        ) ** 2 < reach * reach:
            return True
    return False
