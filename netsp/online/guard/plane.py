"""A problem in the plane, as a guard sees it: the words are those of the rays."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.hsignature import Word, concatenate, crossings, reduce, signature
from netsp.model.problem import Problem
from netsp.online.guard.correct import SIDES, agrees, corrected
from netsp.online.guard.dropout import ways_between
from netsp.online.guard.loops import closed_by, loops_in
from netsp.online.guard.site import LONGER, ROUNDS, Letters, Loop
from netsp.online.guard.skip_free_water import leap
from netsp.roadmap.tether_classes import Tethers
from netsp.world.scene.scene import scene_of
from netsp.world.side_names import listed, passages, side
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.tether.resolution import coarsest_delta, suggested_delta

COARSER = 2.0
"""Times the resolution of the tether, for looks ahead: steps of half a metre take half as long, and
three in a thousand looks see something else, most of them at their horizon."""


class RayLetters:
    """Words of the rays that steps cross.

    Parameters
    ----------
    problem : Problem
        The site.
    """

    def __init__(self, problem: Problem) -> None:
        self.rays = problem.representative_points
        self._obstacles = problem.obstacles
        boxes = np.array([o.shape(0.0).bounds for o in self._obstacles]).reshape(-1, 4)
        self._low, self._high = boxes[:, :2], boxes[:, 2:]

    def written(self, starts: Floats, ends: Floats) -> list[Word | None]:
        """As of `netsp.online.guard.site.Letters`; nothing is impossible."""
        steps = np.stack([starts[:, :2], ends[:, :2]])  # (2, k, 2)
        right = steps[:, :, None, 0] >= self.rays[None, None, :, 0]
        out: list[Word | None] = [()] * len(starts)
        for k in np.flatnonzero((right[0] != right[1]).any(axis=1)):
            out[k] = crossings(steps[:, k], self.rays)
        return out

    def join(self, a: Word, b: Word) -> Word:
        """The word of one path after another."""
        return concatenate(a, b) if b else a

    def back(self, word: Word) -> Word:
        """The word of a path backwards."""
        return tuple(-x for x in reversed(word))

    def near(self, points: Floats, reach: float) -> bool:
        """Whether the boxes of obstacles are within reach."""
        if not len(self._low):
            return False
        low, high = points[:, :2].min(0) - reach, points[:, :2].max(0) + reach
        return bool(np.any(np.all((self._low <= high) & (self._high >= low), axis=1)))

    def depth(self, places: Floats) -> Floats:
        """(k,) metres inside of obstacles."""
        out = np.zeros(len(places))
        low, high = places[:, :2].min(0), places[:, :2].max(0)
        for i, o in enumerate(self._obstacles):
            if np.all((self._low[i] <= high) & (self._high[i] >= low)):
                out = np.maximum(out, -np.asarray(o.signed_distance(places[:, :2])))
        return out


class PlaneSite:
    """A problem.

    Parameters
    ----------
    problem : Problem
        Base, obstacles and tether count.
    """

    sides: tuple[str, ...] = tuple(SIDES)
    look_steps = 60

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.name, self.units = problem.name, problem.units
        self.tether_length = problem.tether_length
        self.anchor = np.asarray(problem.base, dtype=float)
        state = problem.state
        self.start = self.anchor if state is None else np.asarray(state.position, dtype=float)
        self.identity = problem.sha256
        self.rays = self.centres = problem.representative_points
        self.letters: Letters = RayLetters(problem)
        self.field = scene_of(problem).field()
        delta = suggested_delta(problem)
        self.model = GeodesicTether(self.field, delta)
        self.ahead = GeodesicTether(self.field, min(COARSER * delta, coarsest_delta(problem) / 1.1))
        longer = problem.model_copy(
            update={"tether_length": LONGER * problem.tether_length, "bounds": None}
        )
        self._exact = Tethers(longer)

    def start_word(self) -> Word:
        """That of the problem's state; the empty one where there is none."""
        return () if self.problem.state is None else tuple(self.problem.state.signature)

    def found(
        self, word: Word, place: Floats, hanging: Sequence[tuple[Word, Tether]]
    ) -> Tether | None:
        """The exact one (`netsp.roadmap.tether_classes`), as the model has it."""
        try:
            exact = self._exact.to(place[0], place[1], word, place[2])
        except InputError:
            return None
        return None if exact is None else self.model.relaxed(exact.path, ROUNDS)

    def word_of(self, nodes: Floats) -> Word:
        """Of the rays that it crosses."""
        return signature(nodes, self.rays)

    def ways(self, before: Floats, after: Floats, farthest: float) -> list[tuple[Word, float]]:
        """As of `netsp.online.guard.dropout.ways_between`."""
        return ways_between(self.problem, before, after, farthest)

    def loops_in(self, nodes: Floats) -> list[Loop]:
        """As of `netsp.online.guard.loops.loops_in`."""
        return loops_in(self.problem, nodes[:, :2])

    def closed_by(self, nodes: Floats, there: Floats) -> Loop | None:
        """As of `netsp.online.guard.loops.closed_by`."""
        return closed_by(self.problem, nodes[:, :2], np.array([nodes[-1, :2], there[:2]]))

    def leap(self, tether: Tether, places: Floats) -> int:
        """As of `netsp.online.guard.skip_free_water.leap`."""
        return leap(self.field, tether, places, self.tether_length)

    def corrected(
        self, believed: Iterable[Word], robot: Floats, side: str, obstacle: int | str
    ) -> dict[Word, Tether]:
        """As of `netsp.online.guard.correct.corrected`."""
        paths = corrected(self.problem, believed, robot, side, obstacle)
        return {word: self.model.relaxed(path, ROUNDS) for word, path in paths.items()}

    def agrees(self, nodes: Floats, side: str, obstacle: int | str) -> bool:
        """As of `netsp.online.guard.correct.agrees`."""
        return agrees(self.problem, nodes, side, obstacle)

    def passes(self, nodes: Floats, word: Word) -> str:
        """By the obstacles that it rests on, and those whose letters it has."""
        return listed(self.problem, passages(self.problem, nodes, word))

    def turning(self, nodes: Floats) -> float:
        """In the plan."""
        steps = np.diff(nodes[:, :2], axis=0)
        steps = steps[np.hypot(*steps.T) > 1e-9]
        u, v = steps[:-1], steps[1:]
        turns = np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(1))
        return float(np.abs(turns).sum())

    def name_of(self, obstacle: int) -> str:
        """Its name, or its number."""
        return self.problem.obstacle_name(obstacle)

    def side_of(self, obstacle: int, place: Floats) -> str:
        """A wind, or an axis where north is not known."""
        return side(self.problem, place[:2] - self.rays[obstacle])

    def nearest(self, around: Sequence[int], place: Floats) -> int:
        """By the distance to its rim."""
        obstacles = self.problem.obstacles
        far = [float(obstacles[i].signed_distance(place[:2])) for i in around]
        return around[int(np.argmin(far))]

    def as_planned(self, robot: Floats, word: Word, off: float) -> bool | None:
        """A problem has no tour."""
        return None

    def check_word(self, word: Word) -> None:
        """Letters are numbers of obstacles."""
        most = len(self.problem.obstacles)
        if any(x == 0 or abs(x) > most for x in word):
            raise InputError(f"expected letters from 1 to {most}")
        if reduce(word) != word:
            raise InputError("expected reduced words")

    def shown(self) -> dict[str, Any]:
        """Rims of obstacles, without and with the clearance."""
        problem, obstacles = self.problem, []
        for i, o in enumerate(problem.obstacles):
            rim = np.asarray(o.shape(0.0).exterior.coords)[:, :2]
            grown = np.asarray(o.shape(problem.clearance).exterior.coords)[:, :2]
            obstacles.append({
                "name": problem.obstacle_name(i), "middle": [float(v) for v in self.rays[i]],
                "rim": rim.round(3).tolist(), "grown": grown.round(3).tolist(),
            })  # fmt: skip
        return {
            "base": list(problem.base), "obstacles": obstacles,
            "goals": [{"name": g.name, "position": list(g.position)} for g in problem.goals],
        }  # fmt: skip
