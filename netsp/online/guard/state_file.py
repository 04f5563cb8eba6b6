"""State file of a guard: the class of the tether, from one run to the next."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import Point3
from netsp.base.files import FileModel, write_text
from netsp.base.validated import Model
from netsp.hsignature import Word
from netsp.online.guard.guard_policy import GuardPolicy
from netsp.online.guard.tether_guard import Guard
from netsp.world.tether import Tether
from netsp.world.world_protocol import World

MAX_LETTERS = 10_000
"""Format limit on the letters of a word in a state file. A damaged file may hold a longer word,
which would take hours to process."""


class KnownClass(Model):
    """Class that was believed."""

    word: Annotated[
        tuple[int, ...],
        Field(description="its h-signature, at the position", max_length=MAX_LETTERS),
    ]
    cost: Annotated[
        float, Field(description="negative logarithm of its likelihood", ge=0.0, le=1e6)
    ]
    tether: Annotated[
        Annotated[tuple[Point3, ...], Field(min_length=2, max_length=100_000)] | None,
        Field(description="(x, y, z) along the taut tether, from where it is fixed on, m"),
    ] = None


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
    ]

    def words(
        self, site: World, max_age_s: float = GuardPolicy.max_state_age_s
    ) -> dict[Word, float]:
        """Return the classes and their costs.

        Raises
        ------
        InputError
            The state is of another site, from the future, or its position is out of reach.
        """
        if self.site != site.identity:
            raise InputError("--state: is of another site; expected one of this, or a new file")
        for known in self.classes:
            try:
                site.check_word(known.word)
            except InputError as error:
                raise InputError(f"--state: classes: {error}") from None
        reach = site.policy.max_length_factor * site.tether_length
        if (far := float(np.linalg.norm(self.place - site.anchor))) > reach:
            raise InputError(
                f"--state: position: expected at most {reach:.6g} {site.units} from where the "
                f"tether is fixed, twice its length, got {far:.6g}"
            )
        if self.saved > time.time() + max_age_s:
            raise InputError("--state: saved: lies in the future; is the clock right?")
        return {c.word: c.cost for c in self.classes}

    def tethers(self, site: World) -> dict[Word, Tether]:
        """Return the taut tether of each class, as far as it was saved.

        Raises
        ------
        InputError
            A tether does not begin where it is fixed, or is of another class.
        """
        out = {}
        for k, known in enumerate(self.classes):
            if known.tether is None:
                continue
            nodes = np.array(known.tether, dtype=float)
            apart = float(np.linalg.norm(nodes[0] - site.anchor))
            line = np.vstack([site.anchor, nodes[1:]])
            tether = site.model.relaxed(line, site.policy.relax_rounds)
            if apart > site.model.delta or site.word_of(tether.nodes) not in (known.word, None):
                raise InputError(f"--state: classes[{k}].tether: is not of this site and class")
            out[known.word] = tether
        return out

    @property
    def age(self) -> float:
        """Return the time since the state was saved, s."""
        return max(0.0, time.time() - self.saved)

    @property
    def place(self) -> Floats:
        """Return the position of the robot, shape (3,), m."""
        return np.array(self.position, dtype=float)


def save(guard: Guard, file: str | Path) -> None:
    """Write what a guard believes, replacing the file in one step; nothing while it believes
    nothing."""
    if not guard.strands.all:
        return
    position = guard.strands.all[0].tether.robot
    data = {
        "schema_version": 1,
        "site": guard.site.identity,
        "saved": round(time.time(), 3),
        "position": position.tolist(),
        "classes": _classes(guard, position),
    }
    write_text(file, json.dumps(data, allow_nan=False) + "\n")


def _classes(guard: Guard, position: Floats) -> list[dict[str, Any]]:
    """Return the classes for the state file, all to one position.

    The robot is elsewhere in each class, so the words are those of the steps from there.
    """
    site = guard.site
    likely: dict[Word, float] = {}
    tethers: dict[Word, Floats] = {}
    for strand in guard.strands.all:  # the likeliest first
        nodes = strand.tether.nodes
        end = strand.tether.robot
        (step,) = site.letters.words_of_steps(end[None], position[None])
        if step is None:
            continue
        word = site.letters.join(strand.word, step)
        likely[word] = likely.get(word, 0.0) + strand.likely
        if np.array_equal(end, position):
            tethers[word] = nodes
        elif site.field.line_of_sight(end, position):
            tethers.setdefault(word, np.vstack([nodes, position]))
    out: list[dict[str, Any]] = []
    for word, share in likely.items():
        cost = max(0.0, -math.log(max(share, 1e-9)))
        known: dict[str, Any] = {"word": list(word), "cost": round(cost, 6)}
        if word in tethers:
            known["tether"] = [[round(float(v), 6) for v in p] for p in tethers[word]]
        out.append(known)
    return out


def restore(guard: Guard, file: str | Path) -> GuardState | None:
    """Restore what a guard believed, and return the state; None if the file does not exist.

    Raises
    ------
    InputError
        The file is damaged, of another site, or too old.
    """
    if not Path(file).exists():
        return None
    state = GuardState.load(file)
    max_age_s = guard.policy.max_state_age_s
    words = state.words(guard.site, max_age_s)
    if state.age > max_age_s:
        raise InputError(
            f"--state: {file}: is {state.age / 60.0:.0f} minutes old, and the robot may have gone "
            "anywhere since; delete it if the tether is free, and correct the class if it is not"
        )
    guard.begin_with(words, state.place, state.age, state.tethers(guard.site))
    return state
