"""Taut tethers to any place, fast enough to follow a cursor.

The tangents between the arcs and the base are found once. For each place only its tangents are
added, and a search from the place (`netsp.roadmap.explore`) finds the taut paths to the base.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Bools, ComparesArrays, Floats
from netsp.base.errors import NetspError
from netsp.base.field_types import checked_argument
from netsp.hsignature import Word, invert, reduce
from netsp.model.problem import Goal, Problem
from netsp.roadmap.explore import ALL, FoundPaths, run_explore
from netsp.roadmap.outline import STAND_OFF, Outline, build_outline, push_out
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.roadmap_policy import RoadmapPolicy
from netsp.roadmap.tangents import TangentGraph, assemble, tangent_rows
from netsp.roadmap.trie import Trie


@dataclass(frozen=True, eq=False)
class TautTether(ComparesArrays):
    """Taut tether from the base to a place.

    Parameters
    ----------
    word : Word
        H-signature.
    length : float
        Length in 3D, in the problem's units.
    path : ndarray, shape (n, 3)
        Polyline, base first.
    """

    word: Word
    length: float
    path: Floats = field(repr=False)


class Tethers:
    """Taut tethers from a problem's base to any place, in any class, fast enough for a cursor.

    Parameters
    ----------
    problem : Problem
        Problem with base, obstacles, bounds and tether length; its goals are ignored.
    policy : RoadmapPolicy, optional
        Policy of the search for paths.

    Examples
    --------
    >>> from netsp import Circle, Problem
    >>> problem = Problem(base=(0, 0), goals=[(9, 0)], tether_length=20,
    ...                   obstacles=[Circle(center=(5, 0), radius=1)])
    >>> tethers = Tethers(problem)
    >>> [t.word for t in tethers.classes(9, 1)][:2]
    [(1,), ()]
    """

    def __init__(self, problem: Problem, policy: RoadmapPolicy | None = None) -> None:
        self.policy = policy or RoadmapPolicy()
        self.problem = problem.model_copy(update={"state": None})
        whole = build_outline(self.problem)
        self._outline = dataclasses.replace(whole, points=whole.points[:1], places=whole.places[:1])
        near = np.hypot(*(whole.arcs[:, :2] - whole.points[0]).T) - whole.arcs[:, 2]
        close = near <= problem.tether_length
        self._arcs: Floats = whole.arcs[close]
        self._full: Bools = whole.full[close]
        self._rows = tangent_rows(
            self._outline, self._arcs, self._full, problem.tether_length, policy=self.policy.sight
        )

    def to(self, x: float, y: float, word: Word | None = None, z: float = 0.0) -> TautTether | None:
        """Return the taut tether to a place, by default the shortest of all classes.

        Return None if no tether of that class is within the tether length, or if the place lies in
        an obstacle or out of bounds.

        Parameters
        ----------
        x, y, z : float
            Place, in the problem's units.
        word : Word, optional
            Class of the tether.

        Raises
        ------
        InputError
            The place is not finite.
        """
        place = self._place(x, y, z)
        if place is None:
            return None
        if word is not None:
            return place.tether_of_class(reduce(tuple(word)))
        limit = self.policy.tethers.first_ratio * place.distance
        while True:
            found = place.all_paths(min(limit, place.max_planar))
            if len(found.goal):
                return place.tether_along(found, int(np.argmin(found.length)))
            if limit >= place.max_planar or found.capped:
                return None
            limit *= self.policy.tethers.growth

    def classes(self, x: float, y: float, z: float = 0.0) -> list[TautTether]:
        """Return all taut tethers to a place within the tether's length, the shortest first.

        There is one for each class. With a very long tether, the search ends after
        `TetherPolicy.max_states`, and some are missing.

        Parameters
        ----------
        x, y, z : float
            Place, in the problem's units.

        Raises
        ------
        InputError
            The place is not finite.
        """
        place = self._place(x, y, z)
        if place is None:
            return []
        found = place.all_paths(place.max_planar)
        out: dict[Word, TautTether] = {}
        for hit in np.argsort(found.length, kind="stable"):
            tether = place.tether_along(found, int(hit))
            out.setdefault(tether.word, tether)
        return list(out.values())

    def _place(self, x: float, y: float, z: float) -> _PlacePaths | None:
        values = ((n, v) for n, v in (("x", x), ("y", y), ("z", z)))
        px, py, pz = (checked_argument(n, v, -1e12) for n, v in values)
        problem = self.problem
        away = (float(o.signed_distance((px, py))) for o in problem.obstacles)
        if min(away, default=math.inf) < problem.clearance - problem.tolerance:
            return None
        if problem.bounds is not None:
            xmin, ymin, xmax, ymax = problem.bounds
            if not (xmin <= px <= xmax and ymin <= py <= ymax):
                return None
        xy = np.array([px, py]) - self._outline.origin
        free = push_out(xy, self._outline.blockers, STAND_OFF * problem.scale)
        outline = dataclasses.replace(
            self._outline,
            points=np.vstack([self._outline.points, free]),
            places=np.vstack([self._outline.places, xy]),
        )
        new_rows = tangent_rows(
            outline,
            self._arcs,
            self._full,
            problem.tether_length,
            since=1,
            policy=self.policy.sight,
        )
        tangents = assemble(outline, self._arcs, self._full, np.vstack([self._rows, new_rows]))
        goal = Goal.model_construct(position=(px, py, pz), name=None, choice=None, after=())
        return _PlacePaths(
            problem.model_copy(update={"goals": (goal,)}), outline, tangents, self.policy
        )


class _PlacePaths(TautPaths):
    """Taut paths between the base (point 0) and one place (point 1), whose tangents are given."""

    def __init__(
        self, problem: Problem, outline: Outline, tangents: TangentGraph, policy: RoadmapPolicy
    ) -> None:
        self.policy = policy
        self.problem, self.outline, self.tangents = problem, outline, tangents
        self._longest = problem.tether_length
        self.margin = 100.0 * outline.margin
        self._z = problem.points[:, 2]
        self._cache = {}
        self.rise = float(self._z[1] - self._z[0])
        self.distance = math.dist(*outline.points)
        self.max_planar = math.sqrt(max(problem.tether_length**2 - self.rise**2, 0.0))

    def all_paths(self, limit: float) -> FoundPaths:
        """Return all taut paths from the place to the base, up to a planar length."""
        self._trie = Trie.root(limit)
        nowhere = np.zeros(len(self.tangents.target))
        return run_explore(
            self.tangents,
            1,
            self._trie,
            margin=self.outline.margin,
            rule=ALL,
            keeps_tree=True,
            target=(0, nowhere),
            max_states=self.policy.tethers.max_states,
        )

    def tether_along(self, found: FoundPaths, hit: int) -> TautTether:
        """Return the tether along a path found."""
        word = invert(self._trie.word(int(found.word[hit])))
        xy = self._polyline(1, 0, found.pieces(hit))[::-1]
        length = math.hypot(float(found.length[hit]), self.rise)
        return TautTether(tuple(word), length, self._with_heights(0, 1, xy))

    def tether_of_class(self, word: Word) -> TautTether | None:
        """Return the tether of a class; None if there is none within the tether's length."""
        try:
            length = self.length(0, 1, word)
        except NetspError:
            return None
        if length > self.problem.tether_length + self.margin:
            return None
        return TautTether(word, length, self.path(0, 1, word))
