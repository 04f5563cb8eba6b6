"""Put edges back that have gone too deep into a solid."""

from __future__ import annotations

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.sampling import Field
from netsp.world.tether.strand import USED, X, Y, Z, insert, look_along, path_out


@kernel
def mend(
    field: Field, strand: Floats, count: int, slip: float, room: int, deep: float
) -> tuple[Floats, int]:
    """Look again along every edge that may have gone too deep; where it has, its deepest point
    becomes a node on the surface.

    Parameters
    ----------
    slip
        Metres: how far apart the samples are, and from which depth an edge is looked at again.
    room
        Most nodes that the strand may have. One for every two slips of its length is more than any
        surface asks for; a strand that is handed over inside a solid could ask for more in every
        round.
    deep
        Metres from which an edge is too deep: `slip`, or less; then all edges are looked at.
    """
    i, budget = 0, min(64 + 2 * count, room - count)
    while i < count - 1:
        if strand[i, USED] > 1.0 or deep < slip:
            low, where = look_along(field, strand, i, slip)
            if low < -deep and budget > 0:
                mx, my, mz = path_out(field, strand, i, where, slip)
                if is_there(strand, count, i, mx, my, mz, 0.1 * slip):
                    i += 1  # nothing is gained by a node upon another
                    continue
                strand, count = insert(strand, count, i + 1, mx, my, mz)
                budget -= 1
                continue
        i += 1
    return strand, count


@kernel
def is_there(
    strand: Floats, count: int, i: int, x: float, y: float, z: float, reach: float
) -> bool:
    """Whether a node about edge i is nearer to a point than `reach`. Not only its ends are asked:
    in the crease between two solids, out of the one is into the other, and nodes would be put to
    and fro between the same two places without end."""
    for j in range(max(0, i - 2), min(count, i + 4)):
        if (strand[j, X] - x) ** 2 + (strand[j, Y] - y) ** 2 + (
            strand[j, Z] - z
        ) ** 2 < reach * reach:
            return True
    return False
