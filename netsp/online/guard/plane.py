"""Site of a problem in the plane; its words are those of the obstacles' rays."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.hsignature import Word, concatenate, crossings, reduce, signature
from netsp.model.problem import Problem
from netsp.online.guard.correct import SIDES, classes_on_side, passes_on_side
from netsp.online.guard.dropout import paths_between
from netsp.online.guard.guard_policy import SitePolicy
from netsp.online.guard.loops import loop_closed_by, loops_in
from netsp.online.guard.site import Letters, Loop
from netsp.online.guard.skip_free_water import safe_prefix
from netsp.roadmap.tether_classes import Tethers
from netsp.world.scene.scene import scene_of
from netsp.world.side_names import listed, passages, side
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.tether.resolution import coarsest_delta, suggested_delta


class RayLetters:
    """Words of the rays that steps cross."""

    def __init__(self, problem: Problem) -> None:
        self.rays = problem.representative_points
        self._obstacles = problem.obstacles
        boxes = np.array([o.shape(0.0).bounds for o in self._obstacles]).reshape(-1, 4)
        self._low, self._high = boxes[:, :2], boxes[:, 2:]

    def words_of_steps(self, starts: Floats, ends: Floats) -> list[Word | None]:
        """Return the words of straight steps; all steps are possible."""
        steps = np.stack([starts[:, :2], ends[:, :2]])  # (2, k, 2)
        right = steps[:, :, None, 0] >= self.rays[None, None, :, 0]
        out: list[Word | None] = [()] * len(starts)
        for k in np.flatnonzero((right[0] != right[1]).any(axis=1)):
            out[k] = crossings(steps[:, k], self.rays)
        return out

    def join(self, a: Word, b: Word) -> Word:
        """Return the word of one path after another."""
        return concatenate(a, b) if b else a

    def inverse(self, word: Word) -> Word:
        """Return the word of a path in the other direction."""
        return tuple(-x for x in reversed(word))

    def is_near(self, points: Floats, reach: float) -> bool:
        """Return whether the bounding box of an obstacle is within reach."""
        if not len(self._low):
            return False
        low, high = points[:, :2].min(0) - reach, points[:, :2].max(0) + reach
        return bool(np.any(np.all((self._low <= high) & (self._high >= low), axis=1)))

    def depth(self, places: Floats) -> Floats:
        """Return the depth of places inside of obstacles, shape (k,), m."""
        out = np.zeros(len(places))
        low, high = places[:, :2].min(0), places[:, :2].max(0)
        for i, o in enumerate(self._obstacles):
            if np.all((self._low[i] <= high) & (self._high[i] >= low)):
                out = np.maximum(out, -np.asarray(o.signed_distance(places[:, :2])))
        return out


class PlaneSite:
    """Problem as the site of a guard; its base, obstacles and tether count.

    Parameters
    ----------
    problem : Problem
        The problem.
    policy : SitePolicy
        Resolutions and limits.
    """

    sides: tuple[str, ...] = tuple(SIDES)

    def __init__(self, problem: Problem, policy: SitePolicy = SitePolicy()) -> None:
        self.problem, self.policy = problem, policy
        self.steps_per_update = policy.plane_steps_per_update
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
        coarse = policy.lookahead_coarseness * delta
        self.lookahead_model = GeodesicTether(
            self.field, min(coarse, coarsest_delta(problem) / 1.1)
        )
        max_length = policy.max_length_factor * problem.tether_length
        longer = problem.model_copy(update={"tether_length": max_length, "bounds": None})
        self._exact = Tethers(longer)

    def start_word(self) -> Word:
        """Return the word of the problem's state; the empty word if it has none."""
        return () if self.problem.state is None else tuple(self.problem.state.signature)

    def recover_tether(
        self, word: Word, place: Floats, known: Sequence[tuple[Word, Tether]]
    ) -> Tether | None:
        """Return the exact taut tether of a class, on the nodes of the model."""
        try:
            exact = self._exact.to(place[0], place[1], word, place[2])
        except InputError:
            return None
        return None if exact is None else self._relaxed(exact.path)

    def _relaxed(self, path: Floats) -> Tether:
        return self.model.relaxed(path, self.policy.relax_rounds)

    def word_of(self, nodes: Floats) -> Word:
        """Return the word of the rays that a tether crosses."""
        return signature(nodes, self.rays)

    def paths_between(
        self, before: Floats, after: Floats, max_length: float
    ) -> list[tuple[Word, float]]:
        """Return the words and lengths of paths from one place to another, shortest first."""
        return paths_between(self.problem, before, after, max_length, self.policy)

    def loops_in(self, nodes: Floats) -> list[Loop]:
        """Return the loops of a taut tether in the plan, the last to be closed first."""
        return loops_in(self.problem, nodes[:, :2])

    def loop_closed_by(self, nodes: Floats, place: Floats) -> Loop | None:
        """Return the loop that a robot closes by moving straight to a place; None if none."""
        return loop_closed_by(self.problem, nodes[:, :2], np.array([nodes[-1, :2], place[:2]]))

    def safe_prefix(self, tether: Tether, places: Floats) -> int:
        """Return over how many places the robot can surely move without closing a loop."""
        return safe_prefix(self.field, tether, places, self.tether_length)

    def classes_on_side(
        self, believed: Iterable[Word], robot: Floats, side: str, obstacle: int | str
    ) -> dict[Word, Tether]:
        """Return the tethers to the robot that pass an obstacle on a side, by their class."""
        paths = classes_on_side(self.problem, believed, robot, side, obstacle)
        return {word: self._relaxed(path) for word, path in paths.items()}

    def passes_on_side(self, nodes: Floats, side: str, obstacle: int | str) -> bool:
        """Return whether a tether passes an obstacle on one side, and not on the opposite one."""
        return passes_on_side(self.problem, nodes, side, obstacle)

    def describe_path(self, nodes: Floats, word: Word) -> str:
        """Describe a tether by the obstacles that it rests on, and those whose letters it has."""
        return listed(self.problem, passages(self.problem, nodes, word))

    def turning(self, nodes: Floats) -> float:
        """Return the sum of the angles by which a tether turns in the plan, rad."""
        steps = np.diff(nodes[:, :2], axis=0)
        steps = steps[np.hypot(*steps.T) > 1e-9]
        u, v = steps[:-1], steps[1:]
        turns = np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(1))
        return float(np.abs(turns).sum())

    def name_of(self, obstacle: int) -> str:
        """Return the name of an obstacle, or its number."""
        return self.problem.obstacle_name(obstacle)

    def side_of(self, obstacle: int, place: Floats) -> str:
        """Return the side of an obstacle by the wind, or by the axis if north is unknown."""
        return side(self.problem, place[:2] - self.rays[obstacle])

    def nearest(self, around: Sequence[int], place: Floats) -> int:
        """Return which of the given obstacles has the nearest rim."""
        obstacles = self.problem.obstacles
        far = [float(obstacles[i].signed_distance(place[:2])) for i in around]
        return around[int(np.argmin(far))]

    def as_planned(self, robot: Floats, word: Word, off: float) -> bool | None:
        """Return None: a problem has no tour."""
        return None

    def check_word(self, word: Word) -> None:
        """Raise InputError if a letter is no number of an obstacle, or the word is not reduced."""
        count = len(self.problem.obstacles)
        if any(x == 0 or abs(x) > count for x in word):
            raise InputError(f"expected letters from 1 to {count}")
        if reduce(word) != word:
            raise InputError("expected reduced words")

    def map_data(self) -> dict[str, Any]:
        """Return base, goals, and rims of obstacles without and with the clearance."""
        problem, obstacles = self.problem, []
        for i, o in enumerate(problem.obstacles):
            rim = np.asarray(o.shape(0.0).exterior.coords)[:, :2]
            grown = np.asarray(o.shape(problem.clearance).exterior.coords)[:, :2]
            obstacles.append(
                {
                    "name": problem.obstacle_name(i),
                    "middle": [float(v) for v in self.rays[i]],
                    "rim": rim.round(3).tolist(),
                    "grown": grown.round(3).tolist(),
                }
            )
        return {
            "base": list(problem.base),
            "obstacles": obstacles,
            "goals": [{"name": g.name, "position": list(g.position)} for g in problem.goals],
        }
