"""Gaps that the cells of a grid do not show: find them, and the cell size that shows them.

A cell is free if its middle has enough room, so a slot that is wide enough for the robot may be
closed on the grid. The search samples finer points between free cells. A gap lies where two
neighbouring points have enough room but their nearest free cells are not connected nearby.
Every plan of a mission begins with this search (`netsp.plan.space.space_plan.prepare_context`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.bounded_work import end_if_abandoned
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.plan.space.mission_policy import GapPolicy, WordPolicy
from netsp.plan.space.potential import Ends, GridBox, Region, possibly_free, steepness
from netsp.world.mission.mission import Mission
from netsp.world.mission.planned_tour import UnresolvedGap
from netsp.world.paths.tree import Grid
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene
from netsp.world.simulator.mission_run import mission_grid_box


@dataclass(frozen=True)
class Gap:
    """Passage that the cells of a grid do not show.

    Attributes
    ----------
    place
        (3,) middle of the gap, metres.
    width
        Twice the distance of `place` from solids, metres.
    sides
        (2, 3) middles of one free cell on each side, metres.
    """

    place: Floats
    width: float
    sides: Floats

    def __str__(self) -> str:
        """Return width and place, as in "0.24 m at (0, 1.5, -2)"."""
        return f"{self.width:.2g} m at ({', '.join(f'{v:.3g}' for v in self.place)})"


@dataclass(frozen=True)
class GapGrid:
    """Grid whose cells are free or not by the distance of their middles from solids.

    Attributes
    ----------
    field
        The scene.
    low, high
        (3,) corners of the box, metres.
    cell
        Cell size, metres.
    clearance
        Clearance of the robot, metres.
    min_room_ratio
        Minimum distance of the middle of a free cell from solids, in cells.
    """

    field: DistanceField
    low: Floats
    high: Floats
    cell: float
    clearance: float
    min_room_ratio: float = WordPolicy.min_room_ratio

    @classmethod
    def in_box(
        cls,
        field: DistanceField,
        box: tuple[Floats, Floats, float],
        clearance: float,
        min_room_ratio: float = WordPolicy.min_room_ratio,
    ) -> GapGrid:
        """Return the cells of a grid by its box and cell size
        (`netsp.world.simulator.mission_run.mission_grid_box`)."""
        low, high, cell = box
        counts = np.maximum(1.0, np.round((high - low) / cell))  # as `Grid` counts
        return cls(field, low, low + cell * counts, cell, clearance, min_room_ratio)

    @classmethod
    def from_grid(
        cls, grid: Grid, clearance: float, min_room_ratio: float = WordPolicy.min_room_ratio
    ) -> GapGrid:
        """Return the cells of a grid for paths."""
        high = grid.low + grid.cell * np.array(grid.free.shape)
        return cls(grid.field, grid.low, high, grid.cell, clearance, min_room_ratio)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of cells along x, y and z, as `netsp.plan.space.cells.Cells` counts them."""
        nx, ny, nz = (max(1, int(n)) for n in np.ceil((self.high - self.low) / self.cell - 1e-9))
        return nx, ny, nz

    @property
    def min_room(self) -> float:
        """Return the least distance of the middle of a free cell from solids, metres."""
        return max(self.clearance, self.min_room_ratio * self.cell)

    def free(self, first: Ints, shape: tuple[int, ...]) -> Bools:
        """Return the mask of free cells in a block, given by its first cell and its shape."""
        axes = [self.low[k] + (first[k] + np.arange(shape[k]) + 0.5) * self.cell for k in range(3)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        return np.asarray(self.field.distance(points) >= self.min_room)

    def connects(self, gap: Gap, around: int) -> bool:
        """Return whether free cells connect the two sides of a gap, at most `around` cells away
        from it."""
        from scipy.ndimage import label

        at = np.floor((gap.sides - self.low) / self.cell).astype(np.int64)
        at = np.clip(at, 0, np.array(self.shape) - 1)
        first = np.maximum(at.min(0) - around, 0)
        last = np.minimum(at.max(0) + around, np.array(self.shape) - 1)
        free = self.free(first, tuple(last - first + 1))
        parts, _ = label(free, np.ones((3, 3, 3)))
        one, other = (_labels_near(parts, place - first) for place in at)
        return bool(one & other)


SEARCHING = "searching for gaps that the cells do not show"
"""Name of the search in messages."""


def _labels_near(parts: Ints, at: Ints) -> set[int]:
    """Return the labels of the connected parts at a cell and its neighbours."""
    box = tuple(slice(max(0, k - 1), k + 2) for k in at)
    return set(np.unique(parts[box]).tolist()) - {0}


def find_hidden_gaps(
    grid: GapGrid, policy: GapPolicy | None = None, clock: Clock | None = None
) -> list[Gap]:
    """Return the gaps that have room for the robot but no free cells through them, the widest
    first.

    Raises
    ------
    LimitReachedError
        The time was up before the search was complete.
    """
    from scipy.ndimage import binary_dilation

    policy, clock = policy or GapPolicy(), clock or Clock()
    shape = grid.shape
    free = grid.free(np.zeros(3, dtype=np.int64), shape)
    if free.all() or not free.any():
        return []
    middle, diagonal = 0.5 * (grid.low + grid.high), float(np.linalg.norm(grid.high - grid.low))
    clock.check(SEARCHING)
    flag, steep = clock.flag, steepness(grid.field)
    box = GridBox(grid.low, grid.high, grid.cell, shape)
    # bounds of the region are those of the box; its reach and the ellipsoid hold the whole box
    region = Region(grid.clearance, np.array([grid.low, grid.high]), middle, 2.0 * diagonal)
    ends = Ends(middle, middle, 4.0 * diagonal)
    possible = clock.interruptible(
        lambda: possibly_free(grid.field.arrays, box, region, ends, steep, 2, flag)
    )
    gaps = _gaps_between(grid, free, free, possible, policy, clock)
    layers = _single_layers(free) & possible
    if layers.any():
        # the free cells on both sides of a single layer are only two cells apart, so leave them out
        apart = free & ~binary_dilation(layers, np.ones((3, 3, 3)))
        min_distance = 2.0 * grid.cell
        gaps += [
            gap
            for gap in _gaps_between(grid, free, apart, possible, policy, clock)
            if all(np.linalg.norm(gap.place - known.place) > min_distance for known in gaps)
            and _is_open(grid, gap, policy)
        ]
    gaps.sort(key=lambda gap: -gap.width)
    return gaps[: policy.max_gaps]


def _single_layers(free: Bools) -> Bools:
    """Return the mask of blocked cells between two free cells along an axis."""
    out = np.zeros(free.shape, dtype=np.bool_)
    for axis in range(3):
        rows, found = np.moveaxis(free, axis, 0), np.moveaxis(out, axis, 0)
        found[1:-1] |= rows[:-2] & ~rows[1:-1] & rows[2:]
    return out


def _gaps_between(
    grid: GapGrid, free: Bools, ends_of: Bools, possible: Bools, policy: GapPolicy, clock: Clock
) -> list[Gap]:
    """Return the gaps between the free cells `ends_of`."""
    from scipy.ndimage import distance_transform_edt

    clock.check(SEARCHING)
    if not ends_of.any():
        return []
    nearest = np.moveaxis(
        distance_transform_edt(~ends_of, return_distances=False, return_indices=True), 0, -1
    )
    cells = np.argwhere(_parting_cells(possible & ~ends_of, nearest))
    if not len(cells):
        return []
    side = int(np.clip((policy.max_points / len(cells)) ** (1.0 / 3.0), 2, policy.finest))
    ends, places, room = _find_links(grid, cells, nearest, side)
    ends, places, room = _unconnected_links(free, ends, places, room, policy, clock)
    return _group_links(grid, ends, places, room)


def _is_open(grid: GapGrid, gap: Gap, policy: GapPolicy) -> bool:
    """Return whether fine points with room for the robot join the two sides of a gap."""
    from scipy.ndimage import label

    low = np.maximum(gap.sides.min(axis=0) - grid.cell, grid.low)
    high = np.minimum(gap.sides.max(axis=0) + grid.cell, grid.high)
    spacing = grid.cell / policy.finest
    counts = np.maximum(2, np.ceil((high - low) / spacing).astype(np.int64) + 1)
    axes = [np.linspace(low[k], high[k], counts[k]) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    parts, _ = label(grid.field.distance(points) >= grid.clearance - 0.5 * spacing)
    at = np.rint((gap.sides - low) / (high - low) * (counts - 1)).astype(np.int64)
    one, other = (_labels_near(parts, place) for place in at)
    return bool(one & other)


def _parting_cells(between: Bools, nearest: Ints) -> Bools:
    """Return the mask of cells in `between` that have a neighbour in `between` whose nearest free
    cell is three or more cells away from their own."""
    out = np.zeros(between.shape, dtype=np.bool_)
    for step in _HALF_STEPS:
        end_if_abandoned()
        unshifted, shifted = _shifted(between.shape, step)
        apart = np.abs(nearest[unshifted] - nearest[shifted]).max(axis=-1) >= 3
        found = between[unshifted] & between[shifted] & apart
        out[unshifted] |= found
        out[shifted] |= found
    return out


_HALF_STEPS = [s for s in np.ndindex(3, 3, 3) if s > (1, 1, 1)]
"""Steps to 13 of the 26 neighbours, one of each opposite pair; 1 along an axis means no step."""


def _shifted(
    shape: tuple[int, ...], step: tuple[int, ...]
) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return the slices of cells and of their neighbours by a step."""
    unshifted, shifted = [], []
    for n, s in zip(shape, step, strict=True):
        d = s - 1
        unshifted.append(slice(max(0, -d), n - max(0, d)))
        shifted.append(slice(max(0, d), n - max(0, -d)))
    return tuple(unshifted), tuple(shifted)


def _find_links(
    grid: GapGrid, cells: Ints, nearest: Ints, side: int
) -> tuple[Ints, Floats, Floats]:
    """Return the links across possible gaps.

    A link joins two neighbouring fine points that have enough room, and whose nearest free cells
    are three or more cells apart. Returned are these pairs (n, 2, 3) of free cells, the places
    (n, 3) of the links, and their distances (n,) from solids.
    """
    spacing = grid.cell / side
    inner = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    fine = (side * cells[:, None] + inner[None]).reshape(-1, 3)
    points = grid.low + (fine + 0.5) * spacing
    room = grid.field.distance(points)
    wide = (room >= grid.clearance - 0.5 * spacing) & (points <= grid.high).all(axis=1)
    fine, points, room = fine[wide], points[wide], room[wide]
    extent = side * np.array(grid.shape, dtype=np.int64) + 2
    key = (fine[:, 0] * extent[1] + fine[:, 1]) * extent[2] + fine[:, 2]
    order = np.argsort(key)
    fine, points, room, key = fine[order], points[order], room[order], key[order]
    ends, places, rooms = [], [], []
    for axis in range(3):
        end_if_abandoned()
        step = (extent[1] * extent[2], extent[2], 1)[axis]
        at = np.searchsorted(key, key + step)
        known = at < len(key)
        known[known] = key[at[known]] == key[known] + step
        one, other = np.flatnonzero(known), at[known]
        pair = np.stack([nearest[tuple((fine[k] // side).T)] for k in (one, other)], axis=1)
        far = np.abs(pair[:, 0] - pair[:, 1]).max(axis=1) >= 3
        ends.append(pair[far])
        places.append(0.5 * (points[one] + points[other])[far])
        rooms.append(np.minimum(room[one], room[other])[far])
    return np.concatenate(ends), np.concatenate(places), np.concatenate(rooms)


def _unconnected_links(
    free: Bools, ends: Ints, places: Floats, room: Floats, policy: GapPolicy, clock: Clock
) -> tuple[Ints, Floats, Floats]:
    """Return the links whose two free cells are not connected nearby."""
    from scipy.ndimage import label

    order = np.argsort(-room, kind="stable")
    ends, places, room = ends[order], places[order], room[order]
    is_apart: dict[tuple[int, ...], bool] = {}
    keep = np.zeros(len(ends), dtype=np.bool_)
    for n, pair in enumerate(ends):
        end_if_abandoned()
        name = tuple(pair.ravel().tolist())
        if name not in is_apart:
            if len(is_apart) >= policy.max_pairs:
                continue
            clock.check(SEARCHING)
            first = np.maximum(pair.min(0) - policy.around, 0)
            last = pair.max(0) + policy.around + 1
            box = tuple(slice(a, b) for a, b in zip(first, last, strict=True))
            parts, _ = label(free[box], np.ones((3, 3, 3)))
            is_apart[name] = bool(parts[tuple(pair[0] - first)] != parts[tuple(pair[1] - first)])
        keep[n] = is_apart[name]
    return ends[keep], places[keep], room[keep]


def _group_links(grid: GapGrid, ends: Ints, places: Floats, room: Floats) -> list[Gap]:
    """Return one gap for each group of links near one another, at the place with the most room."""
    from scipy.ndimage import label

    if not len(places):
        return []
    at = np.clip(((places - grid.low) / grid.cell).astype(np.int64), 0, np.array(grid.shape) - 1)
    first = at.min(0)
    marked = np.zeros(tuple((at.max(0) - first) // 2 + 1), dtype=np.bool_)
    coarse = (at - first) // 2  # cells of twice the size, so that links one cell apart form a group
    marked[tuple(coarse.T)] = True
    parts, count = label(marked, np.ones((3, 3, 3)))
    group = parts[tuple(coarse.T)]
    gaps = []
    for part in range(1, count + 1):
        members = np.flatnonzero(group == part)
        widest = members[room[members] >= room[members].max() - 1e-9]
        middle = places[widest].mean(axis=0)
        n = widest[int(np.linalg.norm(places[widest] - middle, axis=1).argmin())]
        sides = grid.low + (ends[n] + 0.5) * grid.cell
        through = sides[1] - sides[0]
        along = (0.5 * (sides[0] + sides[1]) - places[n]) @ through / (through @ through)
        for start in (places[n] + along * through, places[n]):  # halfway through, if that is free
            place = _widest_place(grid, start, through)
            width = 2.0 * float(grid.field.distance(place))
            if width >= 2.0 * grid.clearance:
                gaps.append(Gap(np.round(place, 3) + 0.0, width, sides))
                break
    return gaps


def _widest_place(grid: GapGrid, place: Floats, through: Floats) -> Floats:
    """Return the place with the most room within half a cell of a place, across the passage."""
    along = through / max(float(np.linalg.norm(through)), 1e-300)
    _, _, across = np.linalg.svd(along[None])
    reach = 0.5 * grid.cell
    while reach > 1e-3 * grid.cell:
        u, v = np.meshgrid(np.linspace(-reach, reach, 7), np.linspace(-reach, reach, 7))
        points = place + u.reshape(-1, 1) * across[1] + v.reshape(-1, 1) * across[2]
        points = np.clip(points, grid.low, grid.high)
        room = grid.field.distance(points)
        # move only to a point with more room than `place`, which is the 25th of the 49 points
        best = int(room.argmax())
        if room[best] > room[24] + 1e-9:
            place = points[best]
        reach *= 0.4
    return place


def find_resolving_cell(
    grid: GapGrid,
    gaps: list[Gap],
    box_of: Callable[[float], tuple[Floats, Floats, float]],
    policy: GapPolicy | None = None,
    clock: Clock | None = None,
) -> float | None:
    """Return the largest cell size whose grid shows as many of the gaps as possible.

    Parameters
    ----------
    gaps : list of Gap
        Gaps that the grid does not show.
    box_of : callable
        Takes a cell size; returns the corners of the box of such a grid and the cell size, metres.

    Returns
    -------
    float or None
        Cell size, metres; None if no size within the limits shows a gap.

    Raises
    ------
    LimitReachedError
        The time was up before a cell size was found.
    """
    policy, clock = policy or GapPolicy(), clock or Clock()
    best, shown, cell = None, 0, grid.cell
    limit = max(policy.max_cells, 1.1 * float(np.prod(grid.shape)))
    while shown < len(gaps) and cell * policy.step >= policy.smallest * grid.cell:
        clock.check(SEARCHING)
        cell *= policy.step
        finer = GapGrid.in_box(grid.field, box_of(cell), grid.clearance, grid.min_room_ratio)
        if float(np.prod(finer.shape)) > limit:
            break
        around = int(np.ceil(policy.around * grid.cell / cell))
        count = sum(finer.connects(gap, around) for gap in gaps)
        if count > shown:
            best, shown = cell, count
    return best


@dataclass(frozen=True)
class GapResolution:
    """Mission with the cell size that shows the gaps of its scene, as far as possible.

    Attributes
    ----------
    mission
        The mission, with a finer cell if that shows more gaps.
    cell
        Cell size of its grid, metres.
    shown
        Gaps that only the finer cell shows.
    left
        Gaps that stay hidden; None if the time was up before they were found.
    """

    mission: Mission
    cell: float
    shown: tuple[Gap, ...] = ()
    left: tuple[Gap, ...] | None = ()

    @property
    def as_in_tour(self) -> tuple[UnresolvedGap, ...] | None:
        """Return the gaps that stay hidden, as in a tour's `unresolved_gaps`."""
        if self.left is None:
            return None
        return tuple(
            UnresolvedGap(position=(x, y, z), width=gap.width)
            for gap in self.left
            for x, y, z in [gap.place.tolist()]
        )


def find_gaps_on(
    mission: Mission,
    grid: Grid,
    policy: GapPolicy | None = None,
    clock: Clock | None = None,
    min_room_ratio: float = WordPolicy.min_room_ratio,
) -> GapResolution:
    """Find the gaps that a given grid does not show, and keep its cell size."""
    policy, clock = policy or GapPolicy(), clock or Clock()
    try:
        gaps = find_hidden_gaps(
            GapGrid.from_grid(grid, mission.clearance, min_room_ratio),
            policy,
            clock.part(policy.time_share),
        )
    except LimitReachedError:
        return GapResolution(mission, grid.cell, (), None)
    return GapResolution(mission, grid.cell, (), tuple(gaps))


def resolve_gaps(
    mission: Mission,
    scene: Scene,
    field: DistanceField,
    policy: GapPolicy | None = None,
    clock: Clock | None = None,
    min_room_ratio: float = WordPolicy.min_room_ratio,
) -> GapResolution:
    """Return a mission whose cells show the gaps of its scene, as far as possible.

    A cell size that the mission states is kept, and its gaps are only reported. The same holds for
    a mission with a tour, because the words of the tour refer to its cells.
    """
    policy = policy or GapPolicy()
    searching = (clock or Clock()).part(policy.time_share)

    def box_of(cell: float) -> tuple[Floats, Floats, float]:
        return mission_grid_box(mission.model_copy(update={"cell": cell}), scene)

    box = mission_grid_box(mission, scene)
    grid = GapGrid.in_box(field, box, mission.clearance, min_room_ratio)
    try:
        gaps = find_hidden_gaps(grid, policy, searching)
    except LimitReachedError:
        return GapResolution(mission, box[2], (), None)
    if not gaps or mission.cell is not None or mission.tour is not None:
        return GapResolution(mission, box[2], (), tuple(gaps))
    try:
        cell = find_resolving_cell(grid, gaps, box_of, policy, searching)
        if cell is None:
            return GapResolution(mission, box[2], (), tuple(gaps))
        finer = GapGrid.in_box(field, box_of(cell), mission.clearance, min_room_ratio)
        still_hidden = find_hidden_gaps(finer, policy, searching)
    except LimitReachedError:
        return GapResolution(mission, box[2], (), tuple(gaps))
    min_distance = 2.0 * grid.cell
    shown = [
        g
        for g in gaps
        if all(np.linalg.norm(g.place - k.place) > min_distance for k in still_hidden)
    ]
    return GapResolution(
        mission.model_copy(update={"cell": cell}), cell, tuple(shown), tuple(still_hidden)
    )
