"""A mission's water: its words, where the robot fits, and the tether's model, in one place."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.base.clock import NEVER, Flag, end_if_abandoned
from netsp.base.geometry import polylines
from netsp.plan.space.cells import FREE_CELL, OPEN_CELL
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.passages import GapResolution
from netsp.plan.space.space_signature import SpaceSignature
from netsp.plan.space.word_search import NO_WORD, WordSearch, path_to_slot, shortest_words
from netsp.world.mission.mission import Mission
from netsp.world.mission.planned_tour import UnresolvedGap
from netsp.world.paths.standoff import beside
from netsp.world.paths.tree import OPEN as ALL_FREE
from netsp.world.paths.tree import Grid, free_cells, states_of, taut
from netsp.world.scene.field import DistanceField, pushed_out
from netsp.world.scene.scene import Scene
from netsp.world.simulator.laid_tether import first_tether, present_tether
from netsp.world.simulator.mission_run import grid_of
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.tether.tether_policy import THINNEST

CLEARANCE_TOLERANCE = 0.01
"""Tolerance of clearances that are sampled along a path, metres: largest overstatement."""

DEPTH_TOLERANCE = 1e-3
"""Tolerance for paths inside of solids, metres; the judge accepts the same."""

DIP_RATIO = 0.15
"""Tolerance of the tether model as a share of delta: edges of a tether dip into a surface by up to
an eighth of delta (docs/tether.md)."""


@dataclass(frozen=True)
class PlanningContext:
    """What planning asks of a scene.

    Parameters
    ----------
    mission : Mission
        What is to be visited.
    field : DistanceField
        The scene.
    grid : Grid
        Of `netsp.world.simulator.mission_run.grid_of`: the box and the size of cells.
    words : SpaceSignature
        Its classes of paths, in the tether's water.
    model : GeodesicTether
        The tether.
    bounds : tuple of float, optional
        Bounds (xmin, ymin, zmin, xmax, ymax, zmax) of the scene, metres; None if it has none or is
        not known.
    gaps : Resolved, optional
        Cell size, and the gaps that the grid does not show; None if they were not searched for.
    policy : MissionPolicy
        Effort and limits of planning.
    """

    mission: Mission
    field: DistanceField
    grid: Grid
    words: SpaceSignature
    model: GeodesicTether
    bounds: tuple[float, ...] | None = None
    gaps: GapResolution | None = None
    policy: MissionPolicy = dataclasses.field(default_factory=MissionPolicy)

    @classmethod
    def for_mission(
        cls,
        mission: Mission,
        scene: Scene,
        field: DistanceField,
        policy: MissionPolicy | None = None,
    ) -> PlanningContext:
        """The water of a mission.

        Parameters
        ----------
        mission : Mission
            The mission.
        scene : Scene
            Its scene.
        field : DistanceField
            The scene's field.
        policy : MissionPolicy, optional
            Effort and limits of planning.

        Returns
        -------
        PlanningContext
            The same.

        Raises
        ------
        InputError
            As of `netsp.plan.space.space_signature.SpaceSignature.in_box`.
        """
        return cls.on_grid(mission, field, grid_of(mission, scene, field), scene.bounds, policy)

    @classmethod
    def on_grid(
        cls,
        mission: Mission,
        field: DistanceField,
        grid: Grid,
        bounds: tuple[float, ...] | None = None,
        policy: MissionPolicy | None = None,
    ) -> PlanningContext:
        """The same where a grid is at hand.

        Parameters
        ----------
        mission : Mission
            The mission.
        field : DistanceField
            Its scene's field.
        grid : Grid
            The box and the size of cells.
        bounds : tuple of float, optional
            Bounds of the scene, if known, metres.
        policy : MissionPolicy, optional
            Effort and limits of planning.

        Returns
        -------
        PlanningContext
            The same.

        Raises
        ------
        InputError
            As of `netsp.plan.space.space_signature.SpaceSignature.in_box`.
        """
        policy = policy or MissionPolicy()
        high = grid.low + grid.cell * np.array(grid.free.shape)
        words = SpaceSignature.in_box(
            field,
            grid.low,
            high,
            grid.cell,
            mission.anchor,
            tolerance=DIP_RATIO * mission.delta,
            policy=policy.words,
        )
        model = GeodesicTether(field, mission.delta)
        return cls(mission, field, grid, words, model, bounds, policy=policy)

    @property
    def unresolved_gaps(self) -> tuple[UnresolvedGap, ...] | None:
        """Return the gaps that the grid does not show, as in a tour; None if not searched for."""
        return None if self.gaps is None else self.gaps.in_file

    @cached_property
    def start_tether(self) -> Tether:
        """The tether with the robot at the start."""
        return first_tether(self.mission, self.field, self.model, self.grid)

    @cached_property
    def present_tether(self) -> Tether:
        """The tether when the mission begins."""
        return present_tether(self.mission, self.field, self.model, self.grid)

    @cached_property
    def robot_cells(self) -> Bools:
        """(nx, ny, nz) cells that keep the robot's clearance."""
        c = self.words.cells
        nx, ny, nz = c.flags.shape
        return np.asarray(
            free_cells(c.field.arrays, c.low, c.cell, (nx, ny, nz), self.mission.clearance, NEVER)
        )

    @cached_property
    def tether_cells(self) -> Bools:
        """(nx, ny, nz) all cells: the tether's water."""
        return np.ones(self.words.cells.flags.shape, dtype=np.bool_)

    @cached_property
    def open_cells(self) -> tuple[Bools, Bools]:
        """(nx, ny, nz) cells about which all are free and of one class, for the tether and for the
        robot."""
        flags = self.words.cells.flags
        free = (flags & FREE_CELL) != 0
        both = []
        for mask in (free, free & self.robot_cells):
            inner = states_of(mask)[1:-1, 1:-1, 1:-1] == ALL_FREE
            both.append(inner & ((flags & OPEN_CELL) != 0))
        return both[0], both[1]

    def search_words(
        self,
        robot: bool,
        cell: int,
        most: int,
        within: float | Mapping[int, float],
        stop: Flag = NEVER,
    ) -> WordSearch:
        """The soonest words of cells, from one of them on.

        Parameters
        ----------
        robot : bool
            Whether the robot's clearance is kept.
        cell : int
            Number of the first.
        most : int
            Words of a cell.
        within : float or mapping of int to float
            Metres: all cells that paths no longer than that lead to when pulled taut; or the cells
            that are sought, and how long the paths to each may be.
        stop : ndarray
            Flag of a clock; once it is set, only the soonest word of a cell is sought.

        Returns
        -------
        Found
            The words, by their numbers in the table.
        """
        end_if_abandoned()
        words, cells = self.words, self.words.cells
        shape = np.array(cells.flags.shape)
        root = np.array(np.unravel_index(cell, cells.flags.shape), dtype=np.int64)
        first, last = np.zeros(3, dtype=np.int64), shape - 1
        targets, scale = (
            np.empty((0, 3), dtype=np.int64),
            100.0 * self.policy.max_cell_path_ratio / cells.cell,
        )
        if isinstance(within, float):
            limits = np.array([scale * within], dtype=np.int64)
        else:
            targets = np.column_stack(np.unravel_index(list(within), cells.flags.shape))
            limits = np.array([scale * v for v in within.values()], dtype=np.int64)
            # a path is no farther from where it begins than half its length and what it leads to
            apart = 100.0 * np.abs(targets - root)
            reach = np.ceil(0.005 * (limits[:, None] + apart).max(0)).astype(np.int64) + 1
            first, last = np.maximum(root - reach, 0), np.minimum(root + reach, shape - 1)
        room = self.robot_cells if robot else self.tether_cells
        found, table = shortest_words(
            cells.flags,
            room,
            self.open_cells[robot],
            words.labels,
            words.table,
            words.rules,
            root,
            first,
            last,
            most,
            targets,
            limits,
            stop,
        )
        words.keep_table(table)
        return WordSearch(*found)

    def paths_to(self, found: WordSearch, cell: int) -> list[tuple[int, Floats]]:
        """Words and paths that a search has found to a cell.

        Parameters
        ----------
        found : Found
            Of `search`.
        cell : int
            Number of the cell.

        Returns
        -------
        list of (int, ndarray of shape (m, 3))
            Number of the word, centres of the cells from the first on; shortest first.
        """
        c = self.words.cells
        at = np.array(np.unravel_index(cell, c.flags.shape), dtype=np.int64)
        place = tuple(at - found.first)
        if min(place) < 0 or any(p >= n for p, n in zip(place, found.word.shape, strict=False)):
            return []
        words, far = found.word[place], found.far[place]
        return [
            (int(words[s]), c.centre(path_to_slot(found, at, int(s))))
            for s in np.argsort(far, kind="stable")
            if words[s] != NO_WORD
        ]

    def pull_taut(self, path: Floats) -> Floats:
        """A path of the robot pulled taut in its class, at its clearance.

        Parameters
        ----------
        path : ndarray, shape (k, 3)
            Metres.

        Returns
        -------
        ndarray, shape (m, 3)
            Metres.
        """
        mission = self.mission
        line = taut(self.field, path, mission.clearance, mission.delta)
        if mission.clearance >= 0.5 * mission.delta:
            return line
        room = min(mission.clearance, end_clearance(self.field, path))
        return lift_corners(self.field, line, room, self.policy.max_lifts)

    def pull_taut_nearby(self, line: Floats) -> Floats | None:
        """Pull a tether's line taut as a path of the robot, in the line's class.

        A tether rests on surfaces, so its line is nearer to them than the clearance, and has no
        class among solids grown by the clearance. Pulling it there may move it across a bar. So a
        path with another word is rejected; the line is then moved off the surfaces and pulled
        again.

        Parameters
        ----------
        line : ndarray, shape (k, 3)
            Line that is free or lies on surfaces, metres.

        Returns
        -------
        ndarray, shape (m, 3), or None
            The path, metres; None if no path with room was found in the line's class.
        """
        word = self.word_number(line)
        if word is None:
            return None
        path = self.pull_taut(line)
        if self.word_number(path) == word and keeps_clearance(self.field, path, self.mission):
            return path
        step = min(self.grid.cell, 0.5 * THINNEST * self.mission.delta)
        clear = beside(self.field, polylines.points_along(line, step), self.mission.clearance)
        if self.word_number(clear) != word:
            return None
        for path in (self.pull_taut(clear), clear):
            if self.word_number(path) == word and keeps_clearance(self.field, path, self.mission):
                return path
        return None

    def drive(self, tether: Tether, path: Floats, *, fine: bool = False) -> tuple[Tether, float]:
        """A tether, once the robot has gone a path.

        About solids in space its length is not convex along a straight leg, as it is in the plane
        (docs/theory.md, fact 2): it may be longer there than at both ends. So it is asked for in
        steps (`drive_step`).

        Parameters
        ----------
        tether : Tether
            Before.
        path : ndarray, shape (k, 3)
            From the robot on, metres.
        fine : bool
            In steps of delta.

        Returns
        -------
        tether : Tether
            At the end.
        longest : float
            Metres of it on the way, as far as the steps tell: between two of them it is longer by
            half a step at most, because it gets longer by no more than the robot goes.
        """
        step = self.mission.delta if fine else drive_step(self.mission, self.policy.tether_share)
        after, lengths = self.model.drive(tether, polylines.dense(path, step))
        return after, float(lengths.max(initial=tether.length))

    def word_number(self, path: Floats) -> int | None:
        """Number of a path's word; None where it has none.

        Parameters
        ----------
        path : ndarray, shape (k, 3)
            Metres.

        Returns
        -------
        int or None
            Its number in the table.
        """
        return self.words.word_number(path)[0]


def keeps_clearance(field: DistanceField, path: Floats, mission: Mission) -> bool:
    """Whether a path keeps the clearance, or what its ends have of it; corners that were pulled
    taut dip below it by half of delta at most.

    Parameters
    ----------
    field : DistanceField
        The scene.
    path : ndarray, shape (k, 3)
        Metres.
    mission : Mission
        Its clearance and delta count.

    Returns
    -------
    bool
        Whether it does.
    """
    return min_clearance_along(field, path) >= max(
        min(mission.clearance, end_clearance(field, path)) - 0.5 * mission.delta, -DEPTH_TOLERANCE
    )


def end_clearance(field: DistanceField, path: Floats) -> float:
    """How near the ends of a path are to solids.

    Parameters
    ----------
    field : DistanceField
        The scene.
    path : ndarray, shape (k, 3)
        Metres.

    Returns
    -------
    float
        Metres.
    """
    return float(field.distance(path[[0, -1]]).min())


def lift_corners(field: DistanceField, path: Floats, room: float, max_lifts: int) -> Floats:
    """A taut path whose corners dip below a clearance, led around the outside of them.

    Parameters
    ----------
    field : DistanceField
        The scene.
    path : ndarray, shape (k, 3)
        Metres.
    room : float
        Clearance that it is to keep, metres; its ends have it.
    max_lifts : int
        Maximum number of rounds.

    Returns
    -------
    ndarray, shape (m, 3)
        The same class, longer by what arcs are longer than their chords.
    """
    for _ in range(max_lifts):
        out, low = [path[0]], False
        for a, b in pairwise(path):
            between = polylines.dense(np.array([a, b]), CLEARANCE_TOLERANCE)[:-1]
            depth = field.distance(between) if len(between) else np.empty(0)
            if len(depth) and depth.min() < room - 0.5 * DEPTH_TOLERANCE:
                lowest = between[int(depth.argmin())][None]
                out.append(pushed_out(field, lowest, room + 0.1 * DEPTH_TOLERANCE)[0])
                low = True
            out.append(b)
        path = np.array(out)
        path[1:-1] = pushed_out(field, path[1:-1], room + 0.1 * DEPTH_TOLERANCE)
        if not low:
            break
    return path


def min_clearance_along(field: DistanceField, path: Floats) -> float:
    """How near a path comes to solids.

    Parameters
    ----------
    field : DistanceField
        The scene.
    path : ndarray, shape (k, 3)
        Metres.

    Returns
    -------
    float
        Metres, right to a hundredth of one, or to a millionth of the path's length.
    """
    step = max(2.0 * CLEARANCE_TOLERANCE, polylines.length(path) / 1e6)
    return float(field.distance(np.vstack([path[:1], polylines.dense(path, step)])).min())


def drive_step(mission: Mission, tether_share: float) -> float:
    """Metres after which the tether's length is asked for on a leg: so many that it can be longer
    in between by no more than what is spared of the tether.

    Parameters
    ----------
    mission : Mission
        Whose tether counts.
    tether_share : float
        Share of the tether that legs may need.

    Returns
    -------
    float
        At least its delta.
    """
    return max(mission.delta, 2.0 * (1.0 - tether_share) * mission.tether_length)


def is_straight_clear(field: DistanceField, a: Floats, b: Floats, clearance: float) -> bool:
    """Whether a straight path keeps the clearance, or what its ends have of it.

    Parameters
    ----------
    field : DistanceField
        The scene.
    a : ndarray, shape (3,)
        Where it begins, metres.
    b : ndarray, shape (3,)
        Where it ends, metres.
    clearance : float
        Metres.

    Returns
    -------
    bool
        Whether it does.
    """
    ends = float(field.distance(np.array([a, b])).min())
    room = max(0.0, min(clearance, ends) - 1e-3)
    return field.grown(room).line_of_sight(a, b, depth=1e-3)
