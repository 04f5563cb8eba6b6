"""A mission in space, as a guard sees it: the words are those of its cells."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import is_index
from netsp.base.geometry import polylines
from netsp.hsignature import Word
from netsp.online.guard.correct import least_changed
from netsp.online.guard.silhouettes import silhouette
from netsp.online.guard.site import LONGER, ROUNDS, Letters, Loop, beside
from netsp.online.guard.winding import TOUCHING, closing, loops_of
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.space_signature import SpaceSignature
from netsp.world.mission.mission import Mission
from netsp.world.scene.field import pushed_out
from netsp.world.scene.scene import Scene
from netsp.world.side_names import AXES
from netsp.world.tether import Tether

MOST_WAYS = 12
"""Ways that are kept, the shortest."""

ASIDE, MOST_ASIDE = 2.5, 6
"""Metres more than straight that ways to another class of a place beside may be long, around a pile
or so, and how many of them are looked at: more would take seconds."""

AGAIN = 1.0
"""Metres that the robot goes before a class whose tether was not found is looked for again."""

UPRIGHT = 0.7
"""Share of a direction that must be vertical for it to be above or below."""

MEANT = {
    "north": ("+y", "−y"), "east": ("+x", "−x"), "south": ("−y", "+y"), "west": ("−x", "+x"),
    "above": ("above", "below"), "below": ("below", "above"),
}  # fmt: skip
"""The directions that an operator's words mean, and their opposites."""

SURFACE = 1e-6
"""Metres that places are put out of solids."""


class CellLetters:
    """Words of the cells that steps pass.

    Parameters
    ----------
    words : SpaceSignature
        Of the mission's water.
    """

    def __init__(self, words: SpaceSignature) -> None:
        self.words, self.field = words, words.cells.field
        self._letters = lru_cache(maxsize=100_000)(words.letters)

    def written(self, starts: Floats, ends: Floats) -> list[Word | None]:
        """As of `netsp.online.guard.site.Letters`; places in solids are put out of them first."""
        a, b = (pushed_out(self.field, points, SURFACE) for points in (starts, ends))
        # a step through a solid has no word, which a walk along it finds out the hardest way
        far = np.linalg.norm(b - a, axis=1)
        doubt = self.field.distance(a) < far
        through = [
            near and not self.field.line_of_sight(p, q, self.words.tolerance)
            for near, p, q in zip(doubt, a, b, strict=True)
        ]
        return [
            None if hits else self._word(np.stack(pair))
            for hits, *pair in zip(through, a, b, strict=True)
        ]

    def _word(self, step: Floats) -> Word | None:
        number, _ = self.words.word_number(step)
        return None if number is None else self._letters(number)

    def join(self, a: Word, b: Word) -> Word:
        """The word of one path after another."""
        return self.words.product(a, b) if b else a

    def back(self, word: Word) -> Word:
        """The word of a path backwards."""
        return self.words.inverse(word)

    def near(self, points: Floats, reach: float) -> bool:
        """Whether a solid is within reach; water is open around what is not."""
        return bool((self.field.distance(points) <= reach * 1.5).any())

    def depth(self, places: Floats) -> Floats:
        """(k,) metres inside of solids."""
        return np.maximum(0.0, -np.asarray(self.field.distance(places)))


class SpaceSite:
    """A mission.

    Parameters
    ----------
    mission : Mission
        Anchor, start, scene and tether count; its state and its tour, if it has them, too.
    scene : Scene, optional
        Its scene, when it is at hand.

    Raises
    ------
    InputError
        A moving anchor, an anchor out of the water; as of
        `netsp.plan.space.space_signature.SpaceSignature`.
    """

    sides: tuple[str, ...] = tuple(MEANT)
    look_steps = 24

    def __init__(self, mission: Mission, scene: Scene | None = None) -> None:
        if mission.track:
            raise InputError("track: a moving anchor cannot be watched; expected one that stays")
        scene = scene or mission.load_scene()
        self.mission = mission
        self.name, self.units = mission.name, scene.units
        self.tether_length = mission.tether_length
        self.field = scene.field()
        self.water = PlanningContext.for_mission(mission, scene, self.field)
        self.model = self.water.model
        self.ahead = self.model
        self.anchor = np.asarray(mission.anchor, dtype=float)
        self._first = self.water.present_tether
        self.start = self._first.robot
        self.identity = hashlib.sha256(
            (mission.model_dump_json() + scene.model_dump_json()).encode()
        ).hexdigest()
        self.letters: Letters = CellLetters(self.water.words)
        self.centres = np.zeros((0, 2))
        self._solids = scene.solids
        self._missed: dict[Word, Floats] = {}

    def start_word(self) -> Word:
        """Of the tether that the mission begins with."""
        return self.water.words.word(self._first.nodes)

    def found(
        self, word: Word, place: Floats, hanging: Sequence[tuple[Word, Tether]]
    ) -> Tether | None:
        """From one at hand by a way that is not straight; where none is at hand, from the anchor,
        which takes seconds."""
        words = self.water.words
        end = words.visible_cell(place)
        missed = self._missed.get(word)
        if end is None or (missed is not None and math.dist(missed, place) < AGAIN):
            return None
        for other, tether in list(hanging) or [(self.start_word(), self._first)]:
            begin = words.visible_cell(tether.robot)
            far = math.dist(tether.robot, place)
            if begin is None or far > ASIDE:
                continue
            for number, way in self._ways(begin, end, far + ASIDE, MOST_ASIDE):
                if words.product(other, words.letters(number)) != word:
                    continue
                moved = self._relaxed(np.vstack([tether.nodes, way, place]), word)
                if moved is not None:
                    return moved
            break  # those of other classes hang at nearly the same place
        self._missed[word] = place
        if hanging:
            return None
        root = int(np.ravel_multi_index(tuple(words.root), words.cells.flags.shape))
        for number, way in self._ways(root, end, self.tether_length):
            if words.letters(number) == word:
                return self._relaxed(np.vstack([self.anchor, way, place]), word)
        return None

    def _ways(
        self, begin: int, end: int, farthest: float, most: int = MOST_WAYS
    ) -> list[tuple[int, Floats]]:
        water = self.water
        return water.paths_to(water.search_words(False, begin, most, {end: farthest}), end)

    def _relaxed(self, line: Floats, word: Word) -> Tether | None:
        tether = self.model.relaxed(line, ROUNDS)
        good = tether.length <= LONGER * self.tether_length and self.word_of(tether.nodes) == word
        return tether if good else None

    def word_of(self, nodes: Floats) -> Word | None:
        """Of the cells that it passes."""
        word, broken = self.water.words.try_word(nodes)
        return word if broken is None else None

    def ways(self, before: Floats, after: Floats, farthest: float) -> list[tuple[Word, float]]:
        """By a search over words; straight where it finds none."""
        words = self.water.words
        a, b = pushed_out(self.field, np.stack([before, after]), SURFACE)
        begin, end = words.visible_cell(a), words.visible_cell(b)
        out: dict[Word, float] = {}
        straight = math.dist(a, b)
        if begin is not None and end is not None:
            most = max(1.5 * straight, farthest) + 2.0 * words.cells.cell
            for number, way in self._ways(begin, end, most):
                # pulled taut it may pass another side of what cells show as one
                path = self.water.pull_taut(np.vstack([a, way, b]))
                letters = words.letters(number)
                out[letters] = min(out.get(letters, math.inf), polylines.length(path))
        (direct,) = self.letters.written(a[None], b[None])
        if direct is not None or not out:
            out[direct or ()] = min(out.get(direct or (), math.inf), straight)
        order = sorted(out.items(), key=lambda pair: pair[1])
        return [p for p in order if p[1] <= max(farthest, order[0][1])][:MOST_WAYS]

    def loops_in(self, nodes: Floats) -> list[Loop]:
        """As of `netsp.online.guard.winding.loops_of`."""
        return loops_of(self.field, self.model, nodes)

    def closed_by(self, nodes: Floats, there: Floats) -> Loop | None:
        """As of `netsp.online.guard.winding.closing`."""
        return closing(self.field, self.model, nodes, there)

    def leap(self, tether: Tether, places: Floats) -> int:
        """None: in space a tether comes off its contacts in ways that its ends do not tell."""
        return 0

    def corrected(
        self, believed: Iterable[Word], robot: Floats, side: str, obstacle: int | str
    ) -> dict[Word, Tether]:
        """Of all classes that the tether reaches the robot in, those whose taut tether passes a
        solid on that side (`agrees`), and of them those that differ least from one believed.

        Parameters
        ----------
        believed : iterable of Word
            Classes that were believed.
        robot : ndarray, shape (3,)
            Where the robot is, metres.
        side : str
            One of `sides`: north is the y axis.
        obstacle : int or str
            The solid's index or name.

        Returns
        -------
        dict of Word to Tether
            One or more, and how the tether hangs.

        Raises
        ------
        InputError
            No such solid or side; no class agrees.
        """
        index = self._index(obstacle)
        end = self.water.words.visible_cell(robot)
        agree: dict[Word, Tether] = {}
        if end is not None:
            shape = self.water.words.cells.flags.shape
            root = int(np.ravel_multi_index(tuple(self.water.words.root), shape))
            for _, way in self._ways(root, end, self.tether_length, MOST_ASIDE):
                tether = self.model.relaxed(np.vstack([self.anchor, way, robot]), ROUNDS)
                word = self.word_of(tether.nodes)
                short = tether.length <= self.tether_length
                if word is not None and short and self.agrees(tether.nodes, side, index):
                    agree.setdefault(word, tether)
        if not agree:
            raise InputError(
                f"side: no tether within {self.tether_length:g} {self.units} was found that "
                f"reaches the robot {beside(side, self.name_of(index))}"
            )
        return {word: agree[word] for word in least_changed(agree, believed)}

    def agrees(self, nodes: Floats, side: str, obstacle: int | str) -> bool:
        """A tether passes a solid on the side where it comes nearest to it."""
        if side not in self.sides:
            raise InputError(f"side: expected {', '.join(self.sides)}, got {side!r}")
        alone = self._of(self._index(obstacle))
        places = polylines.dense(nodes, 0.5 * self.model.delta)
        distance = np.asarray(alone.distance(places))
        near = distance <= max(float(distance.min()), 0.0) + TOUCHING * self.model.delta
        sides = {s for away in alone.gradient(places[near]) for s in _direction(away).split()}
        meant, opposite = MEANT[side]
        return meant in sides and opposite not in sides

    def _index(self, obstacle: int | str) -> int:
        names = [self.name_of(k) for k in range(len(self._solids))]
        if isinstance(obstacle, str) and obstacle in names:
            return names.index(obstacle)
        if is_index(obstacle, len(names)):
            return int(obstacle)
        raise InputError(f"obstacle: expected a name or an index of a solid, got {obstacle!r}")

    def _of(self, solid: int) -> Any:
        """The field of one solid."""
        return _alone(self._solids[solid])

    def passes(self, nodes: Floats, word: Word) -> str:
        """By the solids that it rests on."""
        inner = nodes[1:-1]
        touching = inner[self.field.distance(inner) <= TOUCHING * self.model.delta]
        out: list[str] = []
        before = None
        for place, solid in zip(touching, self.field.nearest(touching), strict=True):
            if solid != before:
                side = _direction(self.field.gradient(place))
                out.append(f"{beside(side, self.name_of(int(solid)))} (rests on it)")
            before = solid
        return ", ".join(out) or "straight from the anchor"

    def turning(self, nodes: Floats) -> float:
        """In space."""
        steps = np.diff(nodes, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        ahead = steps[lengths > 1e-9] / lengths[lengths > 1e-9][:, None]
        return float(np.arccos(np.clip((ahead[:-1] * ahead[1:]).sum(1), -1.0, 1.0)).sum())

    def name_of(self, obstacle: int) -> str:
        """Its name, or its number; -1 is the mesh, cloud or sea floor."""
        if not 0 <= obstacle < len(self._solids):
            return "the structure"
        return self._solids[obstacle].name or f"solid {obstacle + 1}"

    def side_of(self, obstacle: int, place: Floats) -> str:
        """An axis, above or below."""
        known = 0 <= obstacle < len(self._solids)
        return _direction((self._of(obstacle) if known else self.field).gradient(place))

    def nearest(self, around: Sequence[int], place: Floats) -> int:
        """By the distance to its surface."""
        known = [k for k in around if 0 <= k < len(self._solids)]
        if not known:
            return around[0]
        return min(known, key=lambda k: float(self._of(k).distance(place)))

    def as_planned(self, robot: Floats, word: Word, off: float) -> bool | None:
        """By the word at the nearest stop that is within reach."""
        tour = self.mission.tour
        if tour is None:
            return None
        ends = np.array([stop.path[-1] for stop in tour.stops]).reshape(-1, 3)
        far = np.linalg.norm(ends - robot, axis=1)
        at = np.flatnonzero(far <= max(self.mission.reach, self.model.delta) + off)
        if not len(at):
            return None
        # stops may be near one another
        meant = []
        for k in at:
            (letters,) = self.letters.written(ends[k][None], robot[None])
            if letters is not None:
                meant.append(self.letters.join(tuple(tour.stops[k].signature), letters))
        return word in meant if meant else None

    def check_word(self, word: Word) -> None:
        """Letters are those of the group."""
        group = self.water.words.group
        if any(x == 0 or abs(x) > group.rank for x in word):
            raise InputError(f"expected letters from 1 to {group.rank}")
        if group.normal(word) != word:
            raise InputError("expected reduced words")

    def shown(self) -> dict[str, Any]:
        """Solids from above."""
        obstacles = []
        for k, solid in enumerate(self._solids):
            for rim in silhouette(solid.shape):
                middle = rim.mean(0)
                obstacles.append({
                    "name": self.name_of(k), "middle": middle.round(3).tolist(),
                    "rim": rim.round(3).tolist(), "grown": rim.round(3).tolist(),
                })  # fmt: skip
        return {
            "base": self.anchor[:2].tolist(), "obstacles": obstacles,
            "goals": [
                {"name": f"waypoint {n}", "position": list(w.position)}
                for n, w in enumerate(self.mission.waypoints, 1)
            ],
        }  # fmt: skip


@lru_cache(maxsize=4096)
def _alone(solid: Any) -> Any:
    return Scene(solids=(solid,)).field()


def _direction(away: Floats) -> str:
    """The name of a direction."""
    x, y, z = (float(v) for v in away)
    if abs(z) >= UPRIGHT:
        return "above" if z > 0.0 else "below"
    angle = math.degrees(math.atan2(x, y))
    return AXES[int((angle + 22.5) // 45.0) % 8]
