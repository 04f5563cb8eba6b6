"""Protocol of what runs on a tether: a problem in the plane or a mission in space.

Callers that follow a tether, such as the guard, pictures and repairs, ask a world and need not know
which of the two it is. `netsp.roadmap.plane_world.PlaneWorld` and
`netsp.plan.space.space_world.SpaceWorld` are the worlds of netsp.

What is not alike in the two, and so is not asked of a world:

- Planning. In the plane the taut tether of a class is computed exactly from its word. In space
  words are those of a grid, and a tether may slip off the end of a body, so it has to be driven
  along the robot's path.
- Judging. Each judge checks by means that the planner of its world does not use.
- Sizing. That a tour needs its longest tether at a goal is proven in the plane only, so curves and
  margins of tethers, and the choice of the base, are for problems in the plane.
- Clocks. `execute` steps from one node of the tether to the next, `simulate` by a fixed time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

from netsp.base.arrays import Floats
from netsp.hsignature import Word
from netsp.world.scene.field import DistanceField
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.world_policy import WorldPolicy


class Letters(Protocol):
    """Words of the robot's steps."""

    def words_of_steps(self, starts: Floats, ends: Floats) -> list[Word | None]:
        """Return the words of straight steps; None for a step that no robot can make.

        Parameters
        ----------
        starts, ends : ndarray, shape (k, d)
            Ends of the steps, m; d is 2 or 3 in the plane, and 3 in space.
        """

    def join(self, a: Word, b: Word) -> Word:
        """Return the word of one path after another."""

    def inverse(self, word: Word) -> Word:
        """Return the word of a path in the other direction."""

    def is_near(self, points: Floats, reach: float) -> bool:
        """Return whether there may be an obstacle within reach of points (k, d), m."""

    def depth(self, places: Floats) -> Floats:
        """Return the depth of places (k, d) inside of obstacles, shape (k,), m; 0 outside."""


class World(Protocol):
    """Obstacles, base and tether of a problem in the plane or a mission in space."""

    name: str
    units: str
    tether_length: float
    anchor: Floats
    """Place where the tether is fixed, shape (3,), m."""
    is_planar: bool
    field: DistanceField
    """Free space."""
    model: GeodesicTether
    sides: tuple[str, ...]
    """Sides of obstacles, in the words of alarms."""

    @property
    def policy(self) -> WorldPolicy:
        """Limits of searches."""

    @property
    def start(self) -> Floats:
        """Place where the robot begins, shape (3,), m."""

    @property
    def identity(self) -> str:
        """Hash that tells this world from others."""

    @property
    def letters(self) -> Letters:
        """Words of the robot's steps."""

    @property
    def present_tether(self) -> Tether:
        """Tether when the robot sets out."""

    def start_word(self) -> Word:
        """Return the word of the tether when the robot sets out."""

    def word_of(self, nodes: Floats) -> Word | None:
        """Return the word of a tether; None if it has none."""

    def check_word(self, word: Word) -> None:
        """Raise InputError for a word that this world does not have."""

    def recover_tether(
        self, word: Word, place: Floats, known: Sequence[tuple[Word, Tether]]
    ) -> Tether | None:
        """Return the taut tether of a class to a place.

        Parameters
        ----------
        word : Word
            Class of the tether to the place.
        place : ndarray, shape (3,)
            Place of the robot, m.
        known : sequence of (Word, Tether)
            Tethers of other classes at this moment, from which the search may go on.

        Returns
        -------
        Tether or None
            None if the tether would be longer than `WorldPolicy.max_length_factor` allows.
        """

    def paths_between(
        self, before: Floats, after: Floats, max_length: float
    ) -> list[tuple[Word, float]]:
        """Return the words and lengths of paths from one place to another, shortest first.

        Parameters
        ----------
        before, after : ndarray, shape (3,)
            Places, m.
        max_length : float
            Largest length, m; the shortest path counts at any length, so there is at least one.
        """

    def classes_on_side(
        self, believed: Iterable[Word], robot: Floats, side: str, obstacle: int | str
    ) -> dict[Word, Tether]:
        """Return the tethers to the robot that pass an obstacle on a side, by their class.

        Of these, only the classes that differ least from a believed one are returned. Raise
        InputError if there is no such side, obstacle or class.
        """

    def passes_on_side(self, nodes: Floats, side: str, obstacle: int | str) -> bool:
        """Return whether a tether passes an obstacle on one side, and not on the opposite one."""

    def describe_path(self, nodes: Floats, word: Word) -> str:
        """Describe how a taut tether runs."""

    def turning(self, nodes: Floats) -> float:
        """Return the sum of the angles by which a tether turns, rad."""

    def name_of(self, obstacle: int) -> str:
        """Return the name of an obstacle, or its number."""

    def side_of(self, obstacle: int, place: Floats) -> str:
        """Return the side of an obstacle that a place is on."""

    def nearest(self, around: Sequence[int], place: Floats) -> int:
        """Return which of the given obstacles is nearest to a place."""
