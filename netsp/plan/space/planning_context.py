"""Everything that planning knows about a mission: words, free cells, the tether model and the
policy."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.base.bounded_work import end_if_abandoned
from netsp.base.geometry import polylines
from netsp.base.time_flags import NEVER, Flag
from netsp.hsignature.words import Word
from netsp.plan.space.cells import FREE_CELL, OPEN_CELL
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.passages import GapResolution
from netsp.plan.space.space_signature import SpaceSignature
from netsp.plan.space.word_search import (
    NO_WORD,
    SearchBox,
    SearchSpace,
    Targets,
    WordSearch,
    path_to_slot,
    shortest_words,
)
from netsp.world.mission.mission import Mission
from netsp.world.mission.mission_tether import mission_tether
from netsp.world.mission.planned_tour import UnresolvedGap
from netsp.world.paths.standoff import move_off_surfaces
from netsp.world.paths.tree import OPEN as ALL_FREE
from netsp.world.paths.tree import Grid, free_cells, pull_taut, states_of
from netsp.world.scene.field import DistanceField, pushed_out
from netsp.world.scene.scene import Scene
from netsp.world.simulator.laid_tether import first_tether, present_tether
from netsp.world.simulator.mission_run import mission_grid
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.tether.tether_policy import THINNEST

CLEARANCE_TOLERANCE = 0.01
"""Tolerance of clearances that are sampled along a path, metres: largest overstatement."""

DEPTH_TOLERANCE = 1e-3
"""Tolerance for paths inside of solids, metres; the judge accepts the same."""

DIP_RATIO = 0.15
"""Tolerance of the tether model as a share of delta: edges of a tether dip into a surface by up to
an eighth of delta (docs/theory/tether.md)."""


@dataclass
class WordsOnDemand:
    """Words of a scene, found when they are first needed.

    Attributes
    ----------
    find
        Finds the words.
    found
        The words; None until they are found.
    """

    find: Callable[[], SpaceSignature]
    found: SpaceSignature | None = None

    def get(self) -> SpaceSignature:
        """Return the words, and find them if they are not known."""
        if self.found is None:
            self.found = self.find()
        return self.found


@dataclass(frozen=True)
class PlanningContext:
    """Scene of a mission, with the words of its paths, the model of its tether and the policy.

    Attributes
    ----------
    mission, field
        Mission, and distance field of its scene.
    grid
        Box and cell size (`netsp.world.simulator.mission_run.mission_grid`).
    words_on_demand
        Words of paths, in the water of the tether; they may not be known yet.
    model
        Model of the tether.
    bounds
        Bounds (xmin, ymin, zmin, xmax, ymax, zmax) of the scene, metres; None if there are none or
        they are not known.
    gaps
        Cell size, and the gaps that the grid does not show; None if they were not searched for.
    policy
        Effort and limits of planning.
    """

    mission: Mission
    field: DistanceField
    grid: Grid
    words_on_demand: WordsOnDemand
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
        """Return the context of a mission.

        Raises
        ------
        InputError
            As `netsp.plan.space.space_signature.SpaceSignature.in_box`.
        """
        return cls.on_grid(
            mission, field, mission_grid(mission, scene, field), scene.bounds, policy
        )

    @classmethod
    def on_grid(
        cls,
        mission: Mission,
        field: DistanceField,
        grid: Grid,
        bounds: tuple[float, ...] | None = None,
        policy: MissionPolicy | None = None,
    ) -> PlanningContext:
        """Return the context of `without_words`, with the words of paths found at once.

        Raises
        ------
        InputError
            As `netsp.plan.space.space_signature.SpaceSignature.in_box`.
        """
        context = cls.without_words(mission, field, grid, bounds, policy)
        context.words_on_demand.get()
        return context

    @classmethod
    def without_words(
        cls,
        mission: Mission,
        field: DistanceField,
        grid: Grid,
        bounds: tuple[float, ...] | None = None,
        policy: MissionPolicy | None = None,
    ) -> PlanningContext:
        """Return the context of a mission on a known grid; words are found when first needed.

        Parameters
        ----------
        bounds : tuple of float, optional
            Bounds of the scene if they are known, metres.
        """
        policy = policy or MissionPolicy()
        words = WordsOnDemand(
            partial(
                SpaceSignature.in_box,
                field,
                grid.low,
                grid.low + grid.cell * np.array(grid.free.shape),
                grid.cell,
                mission.anchor,
                tolerance=DIP_RATIO * mission.delta,
                policy=policy.words,
            )
        )
        model = mission_tether(mission, field)
        return cls(mission, field, grid, words, model, bounds, policy=policy)

    @property
    def words(self) -> SpaceSignature:
        """Return the words of paths, and find them if they are not known.

        Raises
        ------
        InputError
            As `netsp.plan.space.space_signature.SpaceSignature.in_box`.
        """
        return self.words_on_demand.get()

    @property
    def has_words(self) -> bool:
        """Return whether the words of paths are known."""
        return self.words_on_demand.found is not None

    @property
    def unresolved_gaps(self) -> tuple[UnresolvedGap, ...] | None:
        """Return the gaps that the grid does not show, as in a tour; None if not searched for."""
        return None if self.gaps is None else self.gaps.as_in_tour

    @property
    def max_dip(self) -> float:
        """Return the depth to which the judge lets paths and tethers enter solids, metres.

        A tether does so between its nodes, whose distance is at least a voxel among voxels.
        """
        delta = max(self.mission.delta, self.model.delta)
        return max(2.0 * DEPTH_TOLERANCE, DIP_RATIO * delta)

    @cached_property
    def start_tether(self) -> Tether:
        """Return the tether with the robot at the start."""
        return first_tether(self.mission, self.field, self.model, self.grid)

    @cached_property
    def present_tether(self) -> Tether:
        """Return the tether when the mission begins."""
        return present_tether(self.mission, self.field, self.model, self.grid)

    @cached_property
    def robot_cells(self) -> Bools:
        """Return the mask (nx, ny, nz) of the cells that keep the robot's clearance."""
        c = self.words.cells
        nx, ny, nz = c.flags.shape
        return np.asarray(
            free_cells(c.field.arrays, c.low, c.cell, (nx, ny, nz), self.mission.clearance, NEVER)
        )

    @cached_property
    def tether_cells(self) -> Bools:
        """Return the mask (nx, ny, nz) of the cells of the tether: all."""
        return np.ones(self.words.cells.flags.shape, dtype=np.bool_)

    @cached_property
    def open_cells(self) -> tuple[Bools, Bools]:
        """Return two masks (nx, ny, nz), for the tether and for the robot, of the cells whose
        neighbours are all free and of one class."""
        flags = self.words.cells.flags
        free = (flags & FREE_CELL) != 0
        masks = []
        for mask in (free, free & self.robot_cells):
            inner = states_of(mask)[1:-1, 1:-1, 1:-1] == ALL_FREE
            masks.append(inner & ((flags & OPEN_CELL) != 0))
        return masks[0], masks[1]

    def search_words(
        self,
        for_robot: bool,
        cell: int,
        max_words: int,
        max_length: float | Mapping[int, float],
        stop: Flag = NEVER,
    ) -> WordSearch:
        """Search for the words with the shortest paths from a cell.

        Parameters
        ----------
        for_robot : bool
            Whether paths keep the robot's clearance.
        cell : int
            Number of the cell where paths begin.
        max_words : int
            Maximum number of words of a cell.
        max_length : float or mapping of int to float
            Length of the longest paths, pulled taut, metres; or the cells searched for, with the
            length of the longest paths to each.
        stop : ndarray
            Flag of a clock; once it is set, only the first word of each cell is searched for.

        Returns
        -------
        WordSearch
            Words by their numbers in the table.
        """
        end_if_abandoned()
        words, cells = self.words, self.words.cells
        shape = np.array(cells.flags.shape)
        root = np.array(np.unravel_index(cell, cells.flags.shape), dtype=np.int64)
        first, last = np.zeros(3, dtype=np.int64), shape - 1
        targets = np.empty((0, 3), dtype=np.int64)
        scale = 100.0 * self.policy.max_cell_path_ratio / cells.cell
        if isinstance(max_length, float):
            limits = np.array([scale * max_length], dtype=np.int64)
        else:
            targets = np.column_stack(np.unravel_index(list(max_length), cells.flags.shape))
            limits = np.array([scale * v for v in max_length.values()], dtype=np.int64)
            # along each axis, no place of a path is farther from its begin than half of the sum of
            # its length and the distance of its end
            distances = 100.0 * np.abs(targets - root)
            reach = np.ceil(0.005 * (limits[:, None] + distances).max(0)).astype(np.int64) + 1
            first, last = np.maximum(root - reach, 0), np.minimum(root + reach, shape - 1)
        passable = self.robot_cells if for_robot else self.tether_cells
        found, table = shortest_words(
            SearchSpace(cells.flags, words.labels, passable, self.open_cells[for_robot]),
            words.table,
            words.rules,
            SearchBox(root, first, last),
            Targets(targets, limits),
            max_words,
            stop,
        )
        words.keep_table(table)
        return WordSearch(*found)

    def paths_to(self, found: WordSearch, cell: int) -> list[tuple[int, Floats]]:
        """Return the words and paths that a search found to a cell, shortest first.

        Returns
        -------
        list of (int, ndarray of shape (m, 3))
            Number of the word, and centres of the cells of the path, metres.
        """
        c = self.words.cells
        index = np.array(np.unravel_index(cell, c.flags.shape), dtype=np.int64)
        slot = tuple(index - found.first)
        if min(slot) < 0 or any(p >= n for p, n in zip(slot, found.word.shape, strict=False)):
            return []
        words, distances = found.word[slot], found.far[slot]
        return [
            (int(words[s]), c.centre(path_to_slot(found, index, int(s))))
            for s in np.argsort(distances, kind="stable")
            if words[s] != NO_WORD
        ]

    def pull_taut(self, path: Floats) -> Floats:
        """Return a path (k, 3) of the robot pulled taut in its class, at its clearance, metres."""
        mission = self.mission
        line = pull_taut(self.field, path, mission.clearance, mission.delta)
        if mission.clearance >= 0.5 * mission.delta and keeps_clearance(self.field, line, mission):
            return line
        room = min(mission.clearance, end_clearance(self.field, path))
        return lift_corners(self.field, line, room, self.policy.max_lifts)

    def pull_taut_nearby(self, line: Floats) -> Floats | None:
        """Pull the line of a tether taut as a path of the robot, in the class of the line.

        A tether rests on surfaces, so its line is nearer to them than the clearance, and has no
        class among solids grown by the clearance. Pulling it there may move it across a bar. So a
        path with another word is rejected; the line is then moved off the surfaces and pulled
        again.

        Returns
        -------
        ndarray, shape (m, 3), or None
            The path, metres; None if no path with enough room was found in the class of the line.
        """
        word = self.word_number(line)
        if word is None:
            return None
        path = self.pull_taut(line)
        if self.word_number(path) == word and keeps_clearance(self.field, path, self.mission):
            return path
        step = min(self.grid.cell, 0.5 * THINNEST * self.mission.delta)
        moved = move_off_surfaces(
            self.field, polylines.points_along(line, step), self.mission.clearance
        )
        if self.word_number(moved) != word:
            return None
        for path in (self.pull_taut(moved), moved):
            if self.word_number(path) == word and keeps_clearance(self.field, path, self.mission):
                return path
        return None

    def drive(self, tether: Tether, path: Floats, *, is_fine: bool = False) -> tuple[Tether, float]:
        """Return the tether after the robot has driven along a path, and its maximum length
        meanwhile.

        Around solids in space the length of the tether is not convex along a straight leg, as it is
        in the plane (docs/theory, Proposition 4): it may be longer on the leg than at both ends. So
        the length is computed in steps (`drive_step`).

        Parameters
        ----------
        path : ndarray, shape (k, 3)
            Path from the robot on, metres.
        is_fine : bool
            Whether the steps are as long as delta.

        Returns
        -------
        tether : Tether
            The tether at the end.
        longest : float
            Maximum length at the steps, metres. Between two steps the tether is longer by half a
            step at most, because it does not grow faster than the robot moves.
        """
        step = self.mission.delta if is_fine else drive_step(self.mission, self.policy.tether_share)
        after, lengths = self.model.drive(tether, polylines.dense(path, step))
        return after, float(lengths.max(initial=tether.length))

    def word_number(self, path: Floats) -> int | None:
        """Return the number of the word of a path (k, 3) in the table; None if it has no word."""
        return self.words.word_number(path)[0]

    def words_along(self, paths: Iterable[Floats]) -> list[Word | None]:
        """Return the word of the tether at the end of each path, if the robot follows the paths one
        after the other from where the mission begins.

        Parameters
        ----------
        paths : iterable of ndarray, shape (k, 3)
            Paths, metres; each begins near the end of the one before.

        Returns
        -------
        list of Word or None
            None from the first path on that has no word.
        """
        line = self.present_tether.nodes
        number, words = self.word_number(line), list[Word | None]()
        for path in paths:
            line = np.vstack([line[-1:], path])
            leg = None if number is None else self.word_number(line)
            number = None if leg is None or number is None else self.words.multiply(number, leg)
            words.append(None if number is None else self.words.letters(number))
        return words


def keeps_clearance(field: DistanceField, path: Floats, mission: Mission) -> bool:
    """Return whether a path (k, 3) keeps the mission's clearance, or the room at its ends if that
    is less.

    Corners of a taut path may be nearer by `max_corner_dip`.
    """
    room = min(mission.clearance, end_clearance(field, path))
    return min_clearance_along(field, path) >= max(
        room - max_corner_dip(mission.delta), -DEPTH_TOLERANCE
    )


def max_corner_dip(delta: float) -> float:
    """Return how much nearer to solids than the clearance corners of a taut path may be, metres.

    Most taut paths dip by less than 0.2 of delta; corners of the others are lifted.
    """
    return 0.25 * delta


def end_clearance(field: DistanceField, path: Floats) -> float:
    """Return the distance from solids of the nearer end of a path (k, 3), metres."""
    return float(field.distance(path[[0, -1]]).min())


def lift_corners(field: DistanceField, path: Floats, room: float, max_lifts: int) -> Floats:
    """Lead a taut path around the outside of the corners that it cuts off.

    Parameters
    ----------
    room : float
        Clearance that the path should keep, metres; its ends have it.
    max_lifts : int
        Maximum number of rounds.

    Returns
    -------
    ndarray, shape (m, 3)
        Path of the same class; longer, as arcs are longer than their chords.
    """
    for _ in range(max_lifts):
        corners, is_low = [path[0]], False
        for a, b in pairwise(path):
            between = polylines.dense(np.array([a, b]), CLEARANCE_TOLERANCE)[:-1]
            depth = field.distance(between) if len(between) else np.empty(0)
            if len(depth) and depth.min() < room - 0.5 * DEPTH_TOLERANCE:
                lowest = between[int(depth.argmin())][None]
                corners.append(pushed_out(field, lowest, room + 0.1 * DEPTH_TOLERANCE)[0])
                is_low = True
            corners.append(b)
        path = np.array(corners)
        path[1:-1] = pushed_out(field, path[1:-1], room + 0.1 * DEPTH_TOLERANCE)
        if not is_low:
            break
    return path


def min_clearance_along(field: DistanceField, path: Floats) -> float:
    """Return the least distance of a path (k, 3) from solids, metres.

    The distance is overstated by `CLEARANCE_TOLERANCE` at most, or by a millionth of the length of
    the path if that is more.
    """
    step = max(2.0 * CLEARANCE_TOLERANCE, polylines.length(path) / 1e6)
    return float(field.distance(np.vstack([path[:1], polylines.dense(path, step)])).min())


def drive_step(mission: Mission, tether_share: float) -> float:
    """Return the step of the robot after which the length of the tether is computed, metres.

    Between two steps the tether is longer by no more than the part of it that plans leave unused.

    Parameters
    ----------
    tether_share : float
        Share of the tether that legs may need.
    """
    return max(mission.delta, 2.0 * (1.0 - tether_share) * mission.tether_length)


def is_straight_clear(field: DistanceField, a: Floats, b: Floats, clearance: float) -> bool:
    """Return whether a straight path keeps the clearance, or the room at its ends if that is
    less."""
    ends = float(field.distance(np.array([a, b])).min())
    room = max(0.0, min(clearance, ends) - 1e-3)
    return field.grown(room).line_of_sight(a, b, depth=1e-3)
