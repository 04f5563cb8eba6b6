"""Protocol of a site, be it a problem in the plane or a mission in space."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from netsp.base.arrays import ComparesArrays, Floats
from netsp.hsignature import Word
from netsp.online.guard.guard_policy import SitePolicy
from netsp.world.scene.field import DistanceField
from netsp.world.tether import GeodesicTether, Tether


@dataclass(frozen=True, eq=False)
class Loop(ComparesArrays):
    """Loop of a tether.

    Attributes
    ----------
    around
        Indices of the obstacles in the loop.
    line
        Closed polyline from where the loop closes around to there again, shape (k, 2) or (k,
        3), m.
    """

    around: tuple[int, ...]
    line: Floats


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


class Site(Protocol):
    """Site where a tether is watched: a problem in the plane, or a mission in space."""

    policy: SitePolicy
    name: str
    units: str
    tether_length: float
    anchor: Floats
    """Place where the tether is fixed, shape (3,), m."""
    start: Floats
    """Place where the robot begins, shape (3,), m."""
    identity: str
    """Hash that tells this site from others, in state files."""
    field: DistanceField
    model: GeodesicTether
    lookahead_model: GeodesicTether
    """Model that is coarse enough for looks ahead."""
    letters: Letters
    sides: tuple[str, ...]
    """Sides of obstacles, as operators may name them."""
    centres: Floats
    """Centres of obstacles that robots circle, in the plan, shape (n, 2), m."""
    steps_per_update: int
    """Maximum number of steps of looks ahead in one update."""

    def start_word(self) -> Word:
        """Return the word of the tether at the start."""

    def recover_tether(
        self, word: Word, place: Floats, known: Sequence[tuple[Word, Tether]]
    ) -> Tether | None:
        """Return a tether of a class that no straight step from a known tether leads to.

        Parameters
        ----------
        word : Word
            Class of the tether to the place.
        place : ndarray, shape (3,)
            Place of the robot, m.
        known : sequence of (Word, Tether)
            Tethers of other classes at this moment.

        Returns
        -------
        Tether or None
            None if the tether would be longer than `SitePolicy.max_length_factor` allows.
        """

    def word_of(self, nodes: Floats) -> Word | None:
        """Return the word of a tether; None if it has none."""

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

    def loops_in(self, nodes: Floats) -> list[Loop]:
        """Return the loops of a taut tether, the last to be closed first."""

    def loop_closed_by(self, nodes: Floats, place: Floats) -> Loop | None:
        """Return the loop that a robot closes by moving straight to a place; None if none."""

    def safe_prefix(self, tether: Tether, places: Floats) -> int:
        """Return over how many of the next places (k, 3) the robot can surely move without closing
        a loop or running out of tether.
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

    def as_planned(self, robot: Floats, word: Word, off: float) -> bool | None:
        """Return whether the tether is in the class that the tour plans at this visit.

        None if there is no tour, or the robot is at none of its visits, to within `off`, m.
        """

    def check_word(self, word: Word) -> None:
        """Raise InputError for a word that this site does not have."""

    def map_data(self) -> dict[str, Any]:
        """Return base, obstacles and goals for a map, as JSON."""


def beside(side: str, name: str) -> str:
    """Return a side of an obstacle as a phrase, such as "north of A2" or "above A2"."""
    return f"{side} {name}" if side in ("above", "below") else f"{side} of {name}"
