"""World of a mission in space; its words are those of the cells of its water."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import is_index
from netsp.base.geometry import polylines
from netsp.base.validated import shown_names
from netsp.hsignature import Word
from netsp.hsignature.words import least_changed
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.space_signature import SpaceSignature
from netsp.world.mission.mission import Mission
from netsp.world.mission.mission_tether import mission_tether
from netsp.world.paths.tree import Grid
from netsp.world.scene.field import DistanceField, pushed_out
from netsp.world.scene.scene import Scene
from netsp.world.side_names import AXES, beside
from netsp.world.simulator.laid_tether import present_tether
from netsp.world.simulator.mission_run import mission_grid
from netsp.world.tether import Tether
from netsp.world.world_policy import WorldPolicy
from netsp.world.world_protocol import Letters

DIRECTIONS = {
    "+y": ("+y", "−y"),
    "+x": ("+x", "−x"),
    "−y": ("−y", "+y"),
    "−x": ("−x", "+x"),
    "above": ("above", "below"),
    "below": ("below", "above"),
}
"""Direction that each side means, and its opposite."""

WINDS = {"north": "+y", "east": "+x", "south": "−y", "west": "−x"}
"""Sides that are understood, too: missions do not say where north is, so it is the y axis."""

PUSH_OUT_DISTANCE = 1e-6
"""Tolerance to which places are moved out of solids, m."""


class CellLetters:
    """Words of the cells that steps pass.

    Parameters
    ----------
    words : SpaceSignature
        Words of the mission's water.
    """

    def __init__(self, words: SpaceSignature) -> None:
        self.words, self.field = words, words.cells.field
        self._letters = lru_cache(maxsize=100_000)(words.letters)

    def words_of_steps(self, starts: Floats, ends: Floats) -> list[Word | None]:
        """Return the words of straight steps, None through solids; ends in solids are moved out."""
        a, b = (pushed_out(self.field, points, PUSH_OUT_DISTANCE) for points in (starts, ends))
        # a step through a solid has no word, which is slow to find out from cells
        step_lengths = np.linalg.norm(b - a, axis=1)
        is_unsure = self.field.distance(a) < step_lengths
        hits_solid = [
            unsure and not self.field.line_of_sight(p, q, self.words.tolerance)
            for unsure, p, q in zip(is_unsure, a, b, strict=True)
        ]
        return [
            None if hits else self._word(np.stack(pair))
            for hits, *pair in zip(hits_solid, a, b, strict=True)
        ]

    def _word(self, step: Floats) -> Word | None:
        number, _ = self.words.word_number(step)
        return None if number is None else self._letters(number)

    def join(self, a: Word, b: Word) -> Word:
        """Return the word of one path after another."""
        return self.words.product(a, b) if b else a

    def inverse(self, word: Word) -> Word:
        """Return the word of a path in the other direction."""
        return self.words.inverse(word)

    def is_near(self, points: Floats, reach: float) -> bool:
        """Return whether a solid may be within reach."""
        return bool((self.field.distance(points) <= reach * 1.5).any())

    def depth(self, places: Floats) -> Floats:
        """Return the depth of places inside of solids, shape (k,), m."""
        return np.maximum(0.0, -np.asarray(self.field.distance(places)))


class SpaceWorld:
    """Mission as a world; its state counts if it has one.

    Parameters
    ----------
    mission : Mission
        The mission.
    scene : Scene, optional
        Scene of the mission; loaded if it is not given.
    policy : WorldPolicy
        Limits of searches.
    field : DistanceField, optional
        Distance field of the scene; computed if it is not given.
    """

    sides: tuple[str, ...] = tuple(DIRECTIONS)
    is_planar = False

    def __init__(
        self,
        mission: Mission,
        scene: Scene | None = None,
        policy: WorldPolicy = WorldPolicy(),
        field: DistanceField | None = None,
    ) -> None:
        self.mission, self.policy = mission, policy
        self.scene = scene or mission.load_scene()
        self.name, self.units = mission.name, self.scene.units
        self.tether_length = mission.tether_length
        self.anchor = np.asarray(mission.anchor, dtype=float)
        self.field = field or self.scene.field()
        self.model = mission_tether(mission, self.field)
        self._missed: dict[Word, Floats] = {}

    @cached_property
    def context(self) -> PlanningContext:
        """Words of the water, and its grid.

        Raises
        ------
        InputError
            The anchor is out of the water, or the scene has no words
            (`netsp.plan.space.space_signature.SpaceSignature`).
        """
        return PlanningContext.on_grid(self.mission, self.field, self._grid, self.scene.bounds)

    @cached_property
    def _grid(self) -> Grid:
        return mission_grid(self.mission, self.scene, self.field)

    @cached_property
    def present_tether(self) -> Tether:
        """Tether when the robot sets out."""
        return present_tether(self.mission, self.field, self.model, self._grid)

    @cached_property
    def start(self) -> Floats:
        """Place where the robot begins, shape (3,), m."""
        return self.present_tether.robot

    @cached_property
    def identity(self) -> str:
        """Hash of mission and scene."""
        text = self.mission.model_dump_json() + self.scene.model_dump_json()
        return hashlib.sha256(text.encode()).hexdigest()

    @cached_property
    def letters(self) -> Letters:
        """Words of the cells that steps pass."""
        return CellLetters(self.context.words)

    def start_word(self) -> Word:
        """Return the word of the tether that the mission begins with."""
        return self.context.words.word(self.present_tether.nodes)

    def recover_tether(
        self, word: Word, place: Floats, known: Sequence[tuple[Word, Tether]]
    ) -> Tether | None:
        """Return a tether of a class that no straight step from a known tether leads to.

        It goes on from a known one by a detour. Without known ones it begins at the anchor, which
        takes seconds.
        """
        words, policy = self.context.words, self.policy
        end = words.visible_cell(place)
        missed = self._missed.get(word)
        if end is None or (missed is not None and math.dist(missed, place) < policy.retry_distance):
            return None
        for other, tether in list(known) or [(self.start_word(), self.present_tether)]:
            begin = words.visible_cell(tether.robot)
            distance = math.dist(tether.robot, place)
            if begin is None or distance > policy.max_detour:
                continue
            max_length = distance + policy.max_detour
            for number, path in self._paths(begin, end, max_length, policy.max_nearby_paths):
                if words.product(other, words.letters(number)) != word:
                    continue
                recovered = self._relaxed(np.vstack([tether.nodes, path, place]), word)
                if recovered is not None:
                    return recovered
            break  # tethers of other classes end at nearly the same place
        self._missed[word] = place
        if known:
            return None
        for number, path in self._paths(self._root_cell, end, self.tether_length, policy.max_paths):
            if words.letters(number) == word:
                return self._relaxed(np.vstack([self.anchor, path, place]), word)
        return None

    @property
    def _root_cell(self) -> int:
        """Return the index of the cell at the anchor."""
        words = self.context.words
        return int(np.ravel_multi_index(tuple(words.root), words.cells.flags.shape))

    def _paths(
        self, begin: int, end: int, max_length: float, max_count: int
    ) -> list[tuple[int, Floats]]:
        """Return the numbers of words, and the paths, from one cell to another."""
        context = self.context
        return context.paths_to(
            context.search_words(False, begin, max_count, {end: max_length}), end
        )

    def _relaxed(self, line: Floats, word: Word) -> Tether | None:
        """Return a line pulled taut; None if it is too long, or of another class."""
        tether = self.model.relaxed(line, self.policy.relax_rounds)
        is_short = tether.length <= self.policy.max_length_factor * self.tether_length
        return tether if is_short and self.word_of(tether.nodes) == word else None

    def word_of(self, nodes: Floats) -> Word | None:
        """Return the word of the cells that a tether passes; None if it passes none."""
        word, broken = self.context.words.try_word(nodes)
        return word if broken is None else None

    def paths_between(
        self, before: Floats, after: Floats, max_length: float
    ) -> list[tuple[Word, float]]:
        """Return the words and lengths of paths from one place to another, shortest first.

        They come from a search over words; the straight path is taken if it finds none.
        """
        words, max_paths = self.context.words, self.policy.max_paths
        a, b = pushed_out(self.field, np.stack([before, after]), PUSH_OUT_DISTANCE)
        begin, end = words.visible_cell(a), words.visible_cell(b)
        lengths: dict[Word, float] = {}
        straight = math.dist(a, b)
        if begin is not None and end is not None:
            searched = max(1.5 * straight, max_length) + 2.0 * words.cells.cell
            for number, path in self._paths(begin, end, searched, max_paths):
                # pulled taut it may pass another side of what cells show as one
                taut = self.context.pull_taut(np.vstack([a, path, b]))
                letters = words.letters(number)
                lengths[letters] = min(lengths.get(letters, math.inf), polylines.length(taut))
        (direct,) = self.letters.words_of_steps(a[None], b[None])
        if direct is not None or not lengths:
            lengths[direct or ()] = min(lengths.get(direct or (), math.inf), straight)
        order = sorted(lengths.items(), key=lambda pair: pair[1])
        return [p for p in order if p[1] <= max(max_length, order[0][1])][:max_paths]

    def classes_on_side(
        self, believed: Iterable[Word], robot: Floats, side: str, obstacle: int | str
    ) -> dict[Word, Tether]:
        """Return the tethers to the robot that pass a solid on a side, by their class.

        Of these, only the classes that differ least from a believed one are returned.

        Raises
        ------
        InputError
            There is no such solid, side or class.
        """
        index, policy = self._index(obstacle), self.policy
        end = self.context.words.visible_cell(robot)
        agree: dict[Word, Tether] = {}
        if end is not None:
            for _, path in self._paths(
                self._root_cell, end, self.tether_length, policy.max_nearby_paths
            ):
                line = np.vstack([self.anchor, path, robot])
                tether = self.model.relaxed(line, policy.relax_rounds)
                word = self.word_of(tether.nodes)
                is_short = tether.length <= self.tether_length
                if word is not None and is_short and self.passes_on_side(tether.nodes, side, index):
                    agree.setdefault(word, tether)
        if not agree:
            raise InputError(
                f"side: no tether within {self.tether_length:g} {self.units} was found that "
                f"reaches the robot {beside(side, self.name_of(index))}"
            )
        return {word: agree[word] for word in least_changed(agree, believed)}

    def passes_on_side(self, nodes: Floats, side: str, obstacle: int | str) -> bool:
        """Return whether a tether comes nearest to a solid on one side, not on the opposite one."""
        side = WINDS.get(side, side)
        if side not in DIRECTIONS:
            raise InputError(f"side: expected {', '.join(self.sides)}, got {side!r}")
        solid_field = self._field_of(self._index(obstacle))
        places = polylines.dense(nodes, 0.5 * self.model.delta)
        distance = np.asarray(solid_field.distance(places))
        is_touching = distance <= max(float(distance.min()), 0.0) + self._contact_distance
        sides = {
            s
            for gradient in solid_field.gradient(places[is_touching])
            for s in self._direction(gradient).split()
        }
        meant, opposite = DIRECTIONS[side]
        return meant in sides and opposite not in sides

    def _index(self, obstacle: int | str) -> int:
        names = [self.name_of(k) for k in range(len(self.scene.solids))]
        if isinstance(obstacle, str) and obstacle in names:
            return names.index(obstacle)
        if is_index(obstacle, len(names)):
            return int(obstacle)
        raise InputError(
            f"obstacle: expected a name or an index of a solid, got {obstacle!r}; there are "
            f"{shown_names(names)}"
        )

    def _field_of(self, solid: int) -> Any:
        """Return the distance field of one solid."""
        return _field_of_solid(self.scene.solids[solid])

    @property
    def _contact_distance(self) -> float:
        """Return the distance from a solid within which a tether rests on it, m."""
        return self.policy.contact_share * self.model.delta

    def _direction(self, away: Floats) -> str:
        """Return the name of a direction."""
        x, y, z = (float(v) for v in away)
        if abs(z) >= self.policy.min_vertical_share:
            return "above" if z > 0.0 else "below"
        angle = math.degrees(math.atan2(x, y))
        return AXES[int((angle + 22.5) // 45.0) % 8]

    def describe_path(self, nodes: Floats, word: Word) -> str:
        """Describe a tether by the solids that it rests on."""
        inner = nodes[1:-1]
        touching = inner[self.field.distance(inner) <= self._contact_distance]
        descriptions: list[str] = []
        before = None
        for place, solid in zip(touching, self.field.nearest(touching), strict=True):
            if solid != before:
                side = self._direction(self.field.gradient(place))
                descriptions.append(f"{beside(side, self.name_of(int(solid)))} (rests on it)")
            before = solid
        return ", ".join(descriptions) or "straight from the anchor"

    def turning(self, nodes: Floats) -> float:
        """Return the sum of the angles by which a tether turns, rad."""
        steps = np.diff(nodes, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        ahead = steps[lengths > 1e-9] / lengths[lengths > 1e-9][:, None]
        return float(np.arccos(np.clip((ahead[:-1] * ahead[1:]).sum(1), -1.0, 1.0)).sum())

    def name_of(self, obstacle: int) -> str:
        """Return the name of a solid, or its number; -1 is the mesh, cloud or sea floor."""
        if not 0 <= obstacle < len(self.scene.solids):
            return "the structure"
        return self.scene.solids[obstacle].name or f"solid {obstacle + 1}"

    def side_of(self, obstacle: int, place: Floats) -> str:
        """Return the side of a solid by an axis, or above or below."""
        is_known = 0 <= obstacle < len(self.scene.solids)
        field = self._field_of(obstacle) if is_known else self.field
        return self._direction(field.gradient(place))

    def nearest(self, around: Sequence[int], place: Floats) -> int:
        """Return which of the given solids has the nearest surface."""
        known = [k for k in around if 0 <= k < len(self.scene.solids)]
        if not known:
            return around[0]
        return min(known, key=lambda k: float(self._field_of(k).distance(place)))

    def check_word(self, word: Word) -> None:
        """Raise InputError if a letter is not of the group, or the word is not reduced."""
        group = self.context.words.group
        if any(x == 0 or abs(x) > group.rank for x in word):
            raise InputError(f"expected letters from 1 to {group.rank}")
        if group.normal(word) != word:
            raise InputError("expected reduced words")


@lru_cache(maxsize=4096)
def _field_of_solid(solid: Any) -> Any:
    return Scene(solids=(solid,)).field()
