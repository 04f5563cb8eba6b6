"""What a guard must not forget: the class, from one run to the next."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.fields import Point3
from netsp.files import FileModel, write_text
from netsp.guard.guard import Guard
from netsp.hsignature import Word, reduce
from netsp.models import Model
from netsp.problem import Problem

LONGEST_S = 600.0
"""Seconds without us after which the robot may be anywhere: then the memory is of no use."""


class KnownClass(Model):
    """A class that was believed."""

    word: Annotated[tuple[int, ...], Field(description="its h-signature, at the position")]
    cost: Annotated[
        float, Field(description="negative logarithm of its likelihood", ge=0.0, le=1e6)
    ]  # fmt: skip


class GuardState(FileModel):
    """The state file of `netsp guard`."""

    file_kind: ClassVar[str] = "guard state"

    model_config = ConfigDict(title="netsp guard state")

    schema_version: Annotated[Literal[1], Field(description="of the file format")] = 1
    site: Annotated[str, Field(description="sha256 of the site")]
    saved: Annotated[
        float, Field(description="seconds since 1970", ge=0.0, le=1e11, allow_inf_nan=False)
    ]
    position: Annotated[Point3, Field(description="of the robot, in the site's frame")]
    classes: Annotated[
        tuple[KnownClass, ...], Field(description="the likeliest first", min_length=1)
    ]  # fmt: skip

    def words(self, problem: Problem) -> dict[Word, float]:
        """Classes and their costs.

        Parameters
        ----------
        problem : Problem
            The site.

        Returns
        -------
        dict of Word to float
            As `Guard.remember` takes them.

        Raises
        ------
        InputError
            The state is of another site.
        """
        if self.site != problem.sha256:
            raise InputError("--state: is of another site; expected one of this, or a new file")
        most = len(problem.obstacles)
        if any(x == 0 or abs(x) > most for c in self.classes for x in c.word):
            raise InputError(f"--state: classes: expected letters from 1 to {most}")
        if any(reduce(c.word) != c.word for c in self.classes):
            raise InputError("--state: classes: expected reduced words")
        if self.saved > time.time() + LONGEST_S:
            raise InputError("--state: saved: lies in the future; is the clock right?")
        return {c.word: c.cost for c in self.classes}

    @property
    def age(self) -> float:
        """Seconds since it was saved."""
        return max(0.0, time.time() - self.saved)

    @property
    def place(self) -> Floats:
        """(3,) the position."""
        return np.array(self.position, dtype=float)


def save(guard: Guard, file: str | Path) -> None:
    """Write down what a guard believes; nothing while it does not know where the robot is.

    Parameters
    ----------
    guard : Guard
        The guard.
    file : str or Path
        Is replaced in one step.
    """
    words = guard.words
    if not words:
        return
    x, y, z = guard.strands.all[0].tether.robot.tolist()
    data = {
        "schema_version": 1, "site": guard.problem.sha256, "saved": round(time.time(), 3),
        "position": [x, y, z],
        "classes": [
            {"word": list(w), "cost": round(max(0.0, c), 6)}
            for w, c in words.items() if math.isfinite(c)
        ],
    }  # fmt: skip
    write_text(file, json.dumps(data, allow_nan=False) + "\n")


def restore(guard: Guard, file: str | Path) -> GuardState | None:
    """Have a guard go on from what was saved; None where nothing was.

    Parameters
    ----------
    guard : Guard
        A new one.
    file : str or Path
        The state file.

    Returns
    -------
    GuardState or None
        What was saved.

    Raises
    ------
    InputError
        The file is damaged, of another site, or too old.
    """
    if not Path(file).exists():
        return None
    state = GuardState.load(file)
    words = state.words(guard.problem)
    if state.age > LONGEST_S:
        raise InputError(
            f"--state: {file}: is {state.age / 60.0:.0f} minutes old, and the robot may have gone "
            "anywhere since; delete it if the tether is free, and correct the class if it is not"
        )
    guard.remember(words, state.place, state.age)
    return state
