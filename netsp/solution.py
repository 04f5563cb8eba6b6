"""The solution of a problem, and what is honestly known of it. JSON format version 1."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field

from netsp.fields import STRICT, Name, NonNegative, Number, Point3
from netsp.files import read_text, write_text
from netsp.models import read_model


class Status(StrEnum):
    """What is proven. `OPTIMAL` speaks of the travel graph; with the exact roadmap and all classes
    the travel graph holds every admissible tour of the continuous world. `OPTIMAL_OF_KEPT` is the
    shortest tour over the homotopy classes that the roadmap kept, where it had to leave some out:
    they were too many, or the time was too short. `INVALID` marks the tour of a baseline that is
    blind to the tether: it entangles obstacles or overstretches the tether."""

    OPTIMAL = "optimal"
    OPTIMAL_OF_KEPT = "optimal_of_kept"
    FEASIBLE = "feasible"
    INFEASIBLE = "infeasible"
    NO_SOLUTION_FOUND = "no_solution_found"
    INVALID = "invalid"


KeptClasses = Literal["all", "non-looping", "shortest"]
"""Which homotopy classes a roadmap held."""


class ProblemReference(BaseModel):
    """Which problem a solution belongs to."""

    model_config = STRICT
    name: Name
    sha256: str


class Visit(BaseModel):
    """One stop of the tour: the goal (0-based), the word of the tether there, its taut length."""

    model_config = STRICT
    goal: Annotated[int, Field(ge=0)]
    signature: tuple[int, ...]
    tether_length: NonNegative


class Timings(BaseModel):
    """Wall-clock seconds by stage."""

    model_config = STRICT
    roadmap_s: float = 0.0
    matrix_s: float = 0.0
    solve_s: float = 0.0
    total_s: float = 0.0


class Solution(BaseModel):
    """A tour with its proof status; `path` is a closed polyline from the base to the base, or from
    the problem's state to the base; `start_tether` is then the taut tether at its start.

    Lengths are in the problem's units. `lower_bound` is a proven bound on every admissible tour,
    `gap` is (length - lower_bound) / length. `classes` says which homotopy classes the roadmap
    held: `all`, `non-looping`, or `shortest`, the shortest of every goal. Without a tour, `length`
    and `gap` are None.
    `entangled` lists the obstacles (0-based) that the path is wrapped around; only an `invalid`
    tour has any.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", title="netsp solution")

    schema_version: Literal[1] = 1
    problem: ProblemReference
    solver: str
    roadmap: str
    classes: KeptClasses | None = None
    seed: int | None = None
    status: Status
    length: Number | None
    lower_bound: Number | None
    gap: Number | None
    entangled: tuple[int, ...] = ()
    tour: tuple[Visit, ...] = ()
    path: tuple[Point3, ...] = ()
    start_tether: tuple[Point3, ...] = ()
    timings: Timings = Timings()
    versions: dict[str, str] = {}

    @classmethod
    def from_json(cls, text: str | bytes, *, source: str = "solution") -> Self:
        """Parse and validate; `InputError` with one line for anything wrong."""
        return read_model(cls, text, source)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a solution file; `InputError` if it cannot be read or is not valid."""
        return cls.from_json(read_text(path), source=str(path))

    def to_json(self) -> str:
        """The solution as version-1 JSON."""
        data = self.model_dump(mode="json")
        path = data.pop("path")
        if not self.start_tether:
            del data["start_tether"]
        if self.classes is None:
            del data["classes"]
        text = json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False)
        rows = ",\n".join("  " + json.dumps(p, allow_nan=False) for p in path)
        return f'{text[:-2]},\n "path": [\n{rows}\n ]\n}}\n'

    def save(self, path: str | Path) -> None:
        """Write the solution file whole or not at all; `InputError` if it cannot be written."""
        write_text(path, self.to_json())
