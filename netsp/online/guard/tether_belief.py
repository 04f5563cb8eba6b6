"""The taut tether of every class that is believed, from update to update."""

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
    """A class, and its tether.

    Parameters
    ----------
    word : Word
        Of the class.
    likely : float
        Its share among those believed.
    tether : Tether
        Taut, to where the robot is in that class.
    believed : Word
        Of the class, as the belief has it: to where the robot is if it may be in obstacles, too.
    """

    word: Word
    likely: float
    tether: Tether
    believed: Word = ()


class Strands:
    """Keeps the tethers of classes taut.

    Parameters
    ----------
    site : Site
        Where.
    """

    def __init__(self, site: Site) -> None:
        self.site = site
        self.all: list[Strand] = []

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
            The likeliest first; classes without a tether of twice its length are left out, and
            shares are among the others.
        """
        strands = self._of(hypotheses, robot, most)
        total = sum(s.likely for s in strands)
        self.all = [replace(s, likely=s.likely / total) for s in strands]
        return self.all

    def _of(self, hypotheses: list[Hypothesis], robot: Floats, most: int) -> list[Strand]:
        site, out = self.site, []
        for h in hypotheses[:most]:
            there = robot.copy()
            there[:2] += h.offset
            place = pushed_out(site.field, there[None], 1e-6)[0]
            (step,) = site.letters.written(there[None], place[None])
            if step is None:
                continue
            word = site.letters.join(h.word, step)
            tether = self._tether(word, place)
            if tether is not None:
                out.append(Strand(word, h.likely, tether, h.word))
        return out

    def _tether(self, word: Word, place: Floats) -> Tether | None:
        """On from one that hangs already, or, if that is of another class, found anew."""
        site = self.site
        for strand in self.all:
            step = np.array([strand.tether.robot, place])
            (letters,) = site.letters.written(step[:1], step[1:])
            if letters is None or site.letters.join(strand.word, letters) != word:
                continue
            if not site.field.line_of_sight(step[0], step[1], 0.2 * site.model.delta):
                continue
            moved = site.model.update(strand.tether, place)
            hangs = site.word_of(moved.nodes)
            if hangs is None or hangs == word:  # it dips too deep for a word, where it bends most
                return moved
        return site.found(word, place, [(s.word, s.tether) for s in self.all])
