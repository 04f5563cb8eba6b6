"""Path beside a tether: in its class, but off the surfaces that the tether touches."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.base.compiled.interpretation import interprets
from netsp.base.compiled.kernel import kernel
from netsp.world.paths.path_policy import StandoffPolicy
from netsp.world.scene.field import DistanceField
from netsp.world.scene.sampling import Field, lowest_along, lowest_along_each


def move_off_surfaces(
    field: DistanceField, line: Floats, clearance: float, policy: StandoffPolicy = StandoffPolicy()
) -> Floats:
    """Return a line (n, 3) moved off surfaces to the clearance, as far as its class allows.

    All points climb the distance field in small steps. A step is rejected if neighbours would no
    longer see each other. The gradient is taken over a stencil, so that points between two solids
    move along the middle to where there is room, instead of jumping to one side. The ends stay.

    Parameters
    ----------
    line : ndarray, shape (n, 3)
        Line in free water or on surfaces, metres. Its points must be no farther apart than the
        thinnest solid.
    """
    path, scale = np.array(line, dtype=float), max(clearance, policy.min_scale)
    arms = policy.stencil_share * scale * np.vstack([np.eye(3), -np.eye(3)])
    for _ in range(policy.max_sweeps):
        d = field.distance(path)
        short = d < clearance - 1e-6
        short[[0, -1]] = False
        if not short.any():
            break
        around = field.distance((path[short, None] + arms).reshape(-1, 3)).reshape(-1, 6)
        rise = around[:, :3] - around[:, 3:]
        rise /= np.maximum(np.linalg.norm(rise, axis=1), 1e-12)[:, None]
        step = np.minimum(policy.step_share * scale, clearance - d[short])
        moved = path.copy()
        moved[short] += step[:, None] * rise
        better = field.distance(moved[short]) >= d[short] + policy.min_gain * step
        moved[short] = np.where(better[:, None], moved[short], path[short])
        blocked = ~are_in_sight(field.arrays, moved[:-1], moved[1:], 1e-2)
        blocked &= are_in_sight(field.arrays, path[:-1], path[1:], 1e-2)
        undone = np.zeros(len(path), dtype=bool)
        undone[:-1] |= blocked
        undone[1:] |= blocked
        moved[undone] = path[undone]
        if np.array_equal(moved, path):
            break
        path = moved
    return path


@kernel
def are_in_sight(field: Field, a: Floats, b: Floats, depth: float) -> Bools:
    """Return the mask (n,) of pairs a[k], b[k] that see each other, up to a depth in solids."""
    out = np.empty(len(a), dtype=np.bool_)
    for k in range(len(a)):
        low, _ = lowest_along(
            field, a[k, 0], a[k, 1], a[k, 2], b[k, 0], b[k, 1], b[k, 2], 0.5 * depth
        )
        out[k] = low > -depth
    return out


@interprets(are_in_sight)
def _sees_in_numpy(field: Field, a: Floats, b: Floats, depth: float) -> Bools:
    """Vectorise `are_in_sight` over all points."""
    return np.asarray(lowest_along_each(field, a, b, 0.5 * depth) > -depth)
