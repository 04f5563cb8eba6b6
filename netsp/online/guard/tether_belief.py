"""Taut tethers of the believed classes, from update to update."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from netsp.base.arrays import Floats
from netsp.hsignature import Word
from netsp.online.guard.belief import Hypothesis
from netsp.online.guard.site import Site
from netsp.world.scene.field import pushed_out
from netsp.world.tether import Tether


@dataclass(frozen=True)
class Strand:
    """Class that is believed, and its tether.

    Attributes
    ----------
    word
        Word of the class.
    likely
        Share among the classes believed.
    tether
        Taut tether to the robot in that class.
    believed
        Word of the class in the belief: to the place of the robot if that may be in an
        obstacle.
    """

    word: Word
    likely: float
    tether: Tether
    believed: Word = ()


class Strands:
    """Taut tethers of the classes that are believed."""

    def __init__(self, site: Site) -> None:
        self.site = site
        self.all: list[Strand] = []

    def follow(self, hypotheses: list[Hypothesis], robot: Floats, max_count: int) -> list[Strand]:
        """Return the tethers of the classes that are believed now, the likeliest first.

        Classes whose tether would be over the limit are left out; shares are among the others.

        Parameters
        ----------
        hypotheses : list of Hypothesis
            Classes, the likeliest first.
        robot : ndarray, shape (3,)
            Estimate of the robot's place, m.
        max_count : int
            Maximum number of tethers.
        """
        strands = self._strands(hypotheses[:max_count], robot)
        total = sum(s.likely for s in strands)
        self.all = [replace(s, likely=s.likely / total) for s in strands]
        return self.all

    def _strands(self, hypotheses: list[Hypothesis], robot: Floats) -> list[Strand]:
        site, out = self.site, []
        for h in hypotheses:
            believed_place = robot.copy()
            believed_place[:2] += h.offset
            place = pushed_out(site.field, believed_place[None], 1e-6)[0]
            (step,) = site.letters.words_of_steps(believed_place[None], place[None])
            if step is None:
                continue
            word = site.letters.join(h.word, step)
            tether = self._tether(word, place)
            if tether is not None:
                out.append(Strand(word, h.likely, tether, h.word))
        return out

    def _tether(self, word: Word, place: Floats) -> Tether | None:
        """Return a known tether moved to a place, or a recovered one if none is of the class."""
        site = self.site
        for strand in self.all:
            step = np.array([strand.tether.robot, place])
            (letters,) = site.letters.words_of_steps(step[:1], step[1:])
            if letters is None or site.letters.join(strand.word, letters) != word:
                continue
            if not site.field.line_of_sight(step[0], step[1], 0.2 * site.model.delta):
                continue
            moved = site.model.update(strand.tether, place)
            moved_word = site.word_of(moved.nodes)
            if (
                moved_word is None or moved_word == word
            ):  # None where it bends too deep into a solid
                return moved
        return site.recover_tether(word, place, [(s.word, s.tether) for s in self.all])
