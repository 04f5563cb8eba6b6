"""What a guard asks of a site, be it a problem in the plane or a mission in space."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from netsp.base.arrays import ComparesArrays, Floats
from netsp.hsignature import Word
from netsp.world.scene.field import DistanceField
from netsp.world.tether import GeodesicTether, Tether

LONGER = 2.0
"""Times the tether's length: longer ones of a class are not looked for."""

ROUNDS = 300
"""Of pulling a tether taut that was just found, or written down."""


@dataclass(frozen=True, eq=False)
class Loop(ComparesArrays):
    """A loop of a tether.

    Parameters
    ----------
    around : tuple of int
        Indices of obstacles.
    line : ndarray, shape (k, 2) or (k, 3)
        From where it closes around to there again, metres.
    """

    around: tuple[int, ...]
    line: Floats


class Letters(Protocol):
    """Words of the robot's steps."""

    def written(self, starts: Floats, ends: Floats) -> list[Word | None]:
        """The words of straight steps.

        Parameters
        ----------
        starts : ndarray, shape (k, d)
            Metres; d is 2 or 3 in the plane, and 3 in space.
        ends : ndarray, shape (k, d)
            Metres.

        Returns
        -------
        list of Word or None
            None for a step that nothing can have gone.
        """

    def join(self, a: Word, b: Word) -> Word:
        """The word of one path after another."""

    def back(self, word: Word) -> Word:
        """The word of a path backwards."""

    def near(self, points: Floats, reach: float) -> bool:
        """Whether within reach of places something is that may be passed on two sides.

        Parameters
        ----------
        points : ndarray, shape (k, d)
            Metres.
        reach : float
            Metres.

        Returns
        -------
        bool
            Whether there is, or may be.
        """

    def depth(self, places: Floats) -> Floats:
        """(k,) how deep places (k, d) are inside of obstacles, metres; 0 outside."""


class Site(Protocol):
    """Where a tether is watched."""

    name: str
    units: str
    tether_length: float
    anchor: Floats
    """(3,) where the tether is fixed, metres."""
    start: Floats
    """(3,) where the robot begins, metres."""
    identity: str
    """Tells it from others, in state files."""
    field: DistanceField
    model: GeodesicTether
    ahead: GeodesicTether
    """As the model, and as coarse as does for looks ahead."""
    letters: Letters
    sides: tuple[str, ...]
    """Of obstacles, as operators may name them."""
    centres: Floats
    """(n, 2) of what robots circle, in the plan, metres."""
    look_steps: int
    """Of looks ahead, in one update, which is to take 50 ms at most: with fewer, a look in several
    classes tells of what was ahead a second ago."""

    def start_word(self) -> Word:
        """The word of the tether when it begins at the start."""

    def found(self, word: Word, place: Floats, hanging: Sequence[tuple[Word, Tether]]) -> (
        Tether | None
    ):  # fmt: skip
        """A tether of a class that none of those at hand leads to by a straight step.

        Parameters
        ----------
        word : Word
            The class, at the place.
        place : ndarray, shape (3,)
            Of the robot, metres.
        hanging : sequence of (Word, Tether)
            Those at hand, of this moment.

        Returns
        -------
        Tether or None
            None where there is none of twice the tether's length.
        """

    def word_of(self, nodes: Floats) -> Word | None:
        """The word of a tether; None where it has none."""

    def ways(self, before: Floats, after: Floats, farthest: float) -> list[tuple[Word, float]]:
        """The classes of ways from one place to another.

        Parameters
        ----------
        before : ndarray, shape (3,)
            Metres.
        after : ndarray, shape (3,)
            Metres.
        farthest : float
            Metres that they are long at most; the shortest counts whatever it is.

        Returns
        -------
        list of (Word, float)
            Words and lengths, shortest first; at least one.
        """

    def loops_in(self, nodes: Floats) -> list[Loop]:
        """The loops that a taut tether has, the last to be closed first."""

    def closed_by(self, nodes: Floats, there: Floats) -> Loop | None:
        """The loop that a robot closes by going straight to a place; None where it closes none."""

    def leap(self, tether: Tether, places: Floats) -> int:
        """Over how many places (k, 3) on its way, one after the other, the robot can go of which is
        known without its tether there that it closes no loop and has tether enough."""

    def corrected(
        self, believed: Iterable[Word], robot: Floats, side: str, obstacle: int | str
    ) -> dict[Word, Tether]:
        """The classes that agree with what an operator says
        (`netsp.online.guard.correct.corrected`), and how the tether hangs in them."""

    def agrees(self, nodes: Floats, side: str, obstacle: int | str) -> bool:
        """Whether a tether passes an obstacle on that side, and not on the other one as well."""

    def passes(self, nodes: Floats, word: Word) -> str:
        """How a taut tether runs, in words."""

    def turning(self, nodes: Floats) -> float:
        """Radians that a tether turns by, all in all."""

    def name_of(self, obstacle: int) -> str:
        """The name of an obstacle."""

    def side_of(self, obstacle: int, place: Floats) -> str:
        """On which side of an obstacle a place is."""

    def nearest(self, around: Sequence[int], place: Floats) -> int:
        """Which of some obstacles is nearest to a place."""

    def as_planned(self, robot: Floats, word: Word, off: float) -> bool | None:
        """Whether the tether is in the class that a tour means it to be in; None where the robot is
        at none of its stops, or there is no tour. It may be off by so many metres."""

    def check_word(self, word: Word) -> None:
        """Raises InputError for what is no word of this site."""

    def shown(self) -> dict[str, Any]:
        """What a map shows of it."""


def beside(side: str, name: str) -> str:
    """A side of an obstacle as a phrase.

    Parameters
    ----------
    side : str
        As of `Site.side_of`.
    name : str
        Of the obstacle.

    Returns
    -------
    str
        Such as "north of A2", or "above A2".
    """
    return f"{side} {name}" if side in ("above", "below") else f"{side} of {name}"
