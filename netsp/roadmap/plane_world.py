"""World of a problem in the plane; its words are those of the obstacles' rays."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
import numpy.typing as npt
import shapely

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import index_of
from netsp.hsignature import Word, concatenate, crossings, reduce, signature
from netsp.hsignature.words import invert, least_changed
from netsp.model.problem import Circle, Problem
from netsp.roadmap.tether_classes import Tethers
from netsp.world.scene.scene import scene_of
from netsp.world.side_names import (
    AXIS_SIDES,
    SIDES,
    crosses_ray,
    listed,
    passages,
    side,
    side_direction,
)
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.tether.resolution import suggested_delta
from netsp.world.world_policy import WorldPolicy
from netsp.world.world_protocol import Letters


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
        return invert(word)

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


class PlaneWorld:
    """Problem as a world; its base, obstacles and tether count, and its state if it has one.

    Parameters
    ----------
    problem : Problem
        The problem.
    delta : float, optional
        Resolution of the tether, in the problem's units; by default by the smallest obstacle.
    start_tether : array_like, shape (k, 3), optional
        Taut tether to the robot that is out already, as in its solution; by default that of the
        state's class.
    policy : WorldPolicy
        Limits of searches.
    """

    is_planar = True

    def __init__(
        self,
        problem: Problem,
        delta: float | None = None,
        start_tether: npt.ArrayLike | None = None,
        policy: WorldPolicy = WorldPolicy(),
    ) -> None:
        self.problem = problem
        self.policy, self._start_tether = policy, start_tether
        self.name, self.units = problem.name, problem.units
        self.sides: tuple[str, ...] = tuple(SIDES if problem.origin else AXIS_SIDES)
        self.tether_length = problem.tether_length
        self.anchor = np.asarray(problem.base, dtype=float)
        state = problem.state
        self.start = self.anchor if state is None else np.asarray(state.position, dtype=float)
        self.rays = problem.representative_points
        self.field = scene_of(problem).field()
        self.model = GeodesicTether(self.field, delta or suggested_delta(problem))

    @property
    def identity(self) -> str:
        """Hash of the problem."""
        return self.problem.sha256

    @cached_property
    def letters(self) -> Letters:
        """Words of the rays that steps cross."""
        return RayLetters(self.problem)

    @cached_property
    def exact_tethers(self) -> Tethers:
        """Exact taut tethers, up to the longest that is looked for."""
        longest = self.policy.max_length_factor * self.tether_length
        longer = self.problem.model_copy(update={"tether_length": longest, "bounds": None})
        return Tethers(longer)

    @property
    def present_tether(self) -> Tether:
        """Tether when the robot sets out."""
        if self.problem.state is None:
            return self.model.start(self.anchor, self.anchor)
        if self._start_tether is not None:
            return self.model.lay(self._start_tether)
        found = self.recover_tether(self.start_word(), self.start, ())
        if found is None:
            raise InputError("state: no taut tether of its class leads there")
        return found

    def start_word(self) -> Word:
        """Return the word of the problem's state; the empty word if it has none."""
        return () if self.problem.state is None else tuple(self.problem.state.signature)

    def recover_tether(
        self, word: Word, place: Floats, known: Sequence[tuple[Word, Tether]]
    ) -> Tether | None:
        """Return the exact taut tether of a class, on the nodes of the model."""
        try:
            exact = self.exact_tethers.to(place[0], place[1], word, place[2])
        except InputError:
            return None
        return None if exact is None else self._relaxed(exact.path)

    def _relaxed(self, path: Floats) -> Tether:
        return self.model.relaxed(path, self.policy.relax_rounds)

    def word_of(self, nodes: Floats) -> Word:
        """Return the word of the rays that a tether crosses."""
        return signature(nodes, self.rays)

    def check_word(self, word: Word) -> None:
        """Raise InputError if a letter is no number of an obstacle, or the word is not reduced."""
        count = len(self.problem.obstacles)
        if any(x == 0 or abs(x) > count for x in word):
            raise InputError(f"expected letters from 1 to {count}")
        if reduce(word) != word:
            raise InputError("expected reduced words")

    def paths_between(
        self, before: Floats, after: Floats, max_length: float
    ) -> list[tuple[Word, float]]:
        """Return the words and lengths of paths from one place to another, shortest first.

        Obstacles count without the clearance.
        """
        problem, policy = self.problem, self.policy
        bare = problem.model_copy(update={"clearance": 0.0, "bounds": None})
        begin, end = free_position(bare, before), free_position(bare, after)
        straight = math.dist(begin, end)
        if straight <= 1e-6 * problem.scale:
            end = begin
        # up to ever larger lengths, until there are enough: all paths at once may be too many
        longest, found = max(1.05 * straight, 1e-6 * problem.scale), []
        for _ in range(policy.max_searches):
            free = bare.model_copy(update={"base": begin, "goals": (), "tether_length": longest})
            found = Tethers(free).classes(*end)
            if len(found) >= policy.max_paths or (found and longest >= max_length):
                break
            longer = policy.length_growth * longest + 0.5
            longest = min(longer, max(max_length, longest + 0.5)) if found else longer
        kept = [(t.word, t.length) for t in found if t.length <= max(max_length, found[0].length)]
        if kept:
            return kept[: policy.max_paths]
        # between obstacles that overlap there may be none: then the robot moved straight
        line = np.array([before, after])
        return [(crossings(line, problem.representative_points), math.dist(before, after))]

    def classes_on_side(
        self, believed: Iterable[Word], robot: Floats, side: str, obstacle: int | str
    ) -> dict[Word, Tether]:
        """Return the tethers to the robot that pass an obstacle on a side, by their class.

        Of these, only the classes that differ least from a believed one are returned.

        Raises
        ------
        InputError
            There is no such obstacle, side or class.
        """
        problem = self.problem
        index = index_of(obstacle, list(problem.obstacles), "obstacle")
        tethers = Tethers(problem).classes(*robot)
        agree = {t.word: t.path for t in tethers if self.passes_on_side(t.path, side, index)}
        if not agree:
            raise InputError(
                f"side: no tether within {problem.tether_length:g} {problem.units} reaches the "
                f"robot {side} of {problem.obstacle_name(index)}"
            )
        return {word: self._relaxed(agree[word]) for word in least_changed(agree, believed)}

    def passes_on_side(self, nodes: Floats, side: str, obstacle: int | str) -> bool:
        """Return whether a tether passes an obstacle on one side, and not on the opposite one."""
        index = index_of(obstacle, list(self.problem.obstacles), "obstacle")
        ray, middle, path = side_direction(self.problem, side), self.rays[index], nodes[:, :2]
        return crosses_ray(path, middle, ray) and not crosses_ray(path, middle, -ray)

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


def free_position(problem: Problem, robot: Floats) -> tuple[float, float, float]:
    """Return the robot's place, moved out of obstacles that the tether model's resolution has let
    it enter."""
    place = np.array(robot, dtype=float)
    for _ in range(10):
        depth = [problem.clearance - float(o.signed_distance(place[:2])) for o in problem.obstacles]
        i = int(np.argmax(depth)) if depth else -1
        if i < 0 or depth[i] <= 0.0:
            break
        obstacle, xy = problem.obstacles[i], place[:2].copy()
        rim = obstacle.shape(problem.clearance).exterior
        nearest = np.array(rim.interpolate(rim.project(shapely.Point(xy))).coords[0])
        if isinstance(obstacle, Circle):
            # the rim of a circle is a polygon inside it
            direction = xy - obstacle.center
            size = float(np.hypot(*direction))
            reach = obstacle.radius + problem.clearance
            nearest = obstacle.center + direction * (reach / size) if size else nearest
        direction = nearest - xy
        size = float(np.hypot(*direction))
        place[:2] = nearest + (direction / size if size else 0.0) * 1e-7 * problem.scale
    x, y, z = place.tolist()
    return (x, y, z)
