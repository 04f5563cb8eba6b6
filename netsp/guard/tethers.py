"""The taut tether of every class that is believed, from update to update."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.guard.belief import Hypothesis
from netsp.hsignature import Word, concatenate, crossings, signature
from netsp.online.scene.field import DistanceField, pushed_out
from netsp.online.scene.scene import scene_of
from netsp.online.tether import GeodesicTether, Tether
from netsp.online.tether.resolution import suggested_delta
from netsp.problem import Problem
from netsp.roadmap.tethers import Tethers

ROUNDS = 300
"""Of pulling a tether taut that was just found."""

LONGER = 2.0
"""Times the tether's length: longer ones of a class are not looked for."""


@dataclass(frozen=True)
class Strand:
    """A class, and its tether.

    Parameters
    ----------
    word : Word
        Of the class.
    likely : float
        Its share among those believed.
    tether : Tether
        Taut, to where the robot is in that class.
    """

    word: Word
    likely: float
    tether: Tether


class Strands:
    """Keeps the tethers of classes taut.

    Parameters
    ----------
    problem : Problem
        The site.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem, self.rays = problem, problem.representative_points
        self.field: DistanceField = scene_of(problem).field()
        self.model = GeodesicTether(self.field, suggested_delta(problem))
        longer = problem.model_copy(
            update={"tether_length": LONGER * problem.tether_length, "bounds": None}
        )
        self._exact = Tethers(longer)
        self.all: list[Strand] = []

    def begin(self, robot: Floats) -> None:
        """One straight tether, of a robot near its anchor.

        Parameters
        ----------
        robot : ndarray, shape (3,)
            Where it is, metres.
        """
        self.all = self._of([Hypothesis((), 1.0, np.zeros(2))], robot, most=1)

    def follow(self, hypotheses: list[Hypothesis], robot: Floats, most: int) -> list[Strand]:
        """The tethers of what is believed now.

        Parameters
        ----------
        hypotheses : list of Hypothesis
            The likeliest first.
        robot : ndarray, shape (3,)
            Estimate of its place, metres.
        most : int
            Tethers at most.

        Returns
        -------
        list of Strand
            The likeliest first; classes without a tether of twice its length are left out.
        """
        self.all = self._of(hypotheses, robot, most)
        return self.all

    def _of(self, hypotheses: list[Hypothesis], robot: Floats, most: int) -> list[Strand]:
        out = []
        for h in hypotheses[:most]:
            there = robot.copy()
            there[:2] += h.offset
            place = pushed_out(self.field, there[None], 1e-6)[0]
            word = concatenate(h.word, crossings(np.array([there, place]), self.rays))
            tether = self._tether(word, place)
            if tether is not None:
                out.append(Strand(word, h.likely, tether))
        return out

    def _tether(self, word: Word, place: Floats) -> Tether | None:
        """On from one that hangs already, or, if that is of another class, found anew."""
        for strand in self.all:
            step = np.array([strand.tether.robot, place])
            if concatenate(strand.word, crossings(step, self.rays)) != word:
                continue
            if not self.field.line_of_sight(step[0], step[1], 0.2 * self.model.delta):
                continue
            moved = self.model.update(strand.tether, place)
            if signature(moved.nodes, self.rays) == word:
                return moved
        try:
            found = self._exact.to(place[0], place[1], word, place[2])
        except InputError:
            return None
        return None if found is None else self.model.relaxed(found.path, ROUNDS)
