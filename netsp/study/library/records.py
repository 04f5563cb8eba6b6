"""Problems in a folder, and a file with a record for each: its best known tour and bound."""

from __future__ import annotations

import datetime
import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field

from netsp.base.deprecated import deprecated_method
from netsp.base.errors import InputError, VerificationError
from netsp.base.field_types import Name, NonNegative, Total
from netsp.base.files import FileModel, write_text
from netsp.base.validated import Model
from netsp.hsignature import Word
from netsp.judge import Verification, verify
from netsp.model.bound_scope import LowerBound, Scope, gap_of, strongest
from netsp.model.problem import Problem
from netsp.model.solution import Solution

RECORDS = "records.json"

SAME_LENGTH_TOLERANCE = 1e-6
"""Tolerance, relative, for two lengths that count as equal."""


class Record(Model):
    """Best known tour of a problem, with a lower bound on all tours."""

    problem: Annotated[Name, Field(description="name of the problem, and of its file")]
    sha256: Annotated[str, Field(description="of what its answer depends on")]
    length: Annotated[Total, Field(description="of the best tour known, in the problem's units")]
    lower_bound: Annotated[
        Total | None,
        Field(description="no tour at all is shorter (scope all_tours); null if nothing is known"),
    ] = None
    solver: Annotated[Name, Field(description="what found the tour")]
    by: Annotated[Name, Field(description="who ran it")]
    seconds: Annotated[NonNegative, Field(description="that it took")]
    commit: Annotated[Name, Field(description="of netsp, where that found it")] = "unknown"
    date: Annotated[Name, Field(description="when, as 2026-11-25")]
    verified: Annotated[bool, Field(description="whether the judge passed it")] = True
    tour: Annotated[
        tuple[tuple[int, Word], ...],
        Field(description="goals, numbered from 0, with the word of the tether at each"),
    ] = ()

    @property
    def bound(self) -> LowerBound | None:
        """Lower bound on all tours; None if nothing is known."""
        return None if self.lower_bound is None else LowerBound(self.lower_bound, Scope.ALL_TOURS)

    @property
    def proven(self) -> bool:
        """True if the tour is proven to be the shortest."""
        return self.bound is not None and self.bound.proves(self.length)

    @property
    def gap(self) -> float | None:
        """(length - lower_bound) / length; None without a bound."""
        return gap_of(self.length, self.bound)


class RecordFile(FileModel):
    """File with the records of a library."""

    file_kind: ClassVar[str] = "records"

    model_config = ConfigDict(title="netsp library")

    schema_version: Annotated[Literal[1], Field(description="of the file format")] = 1
    records: Annotated[tuple[Record, ...], Field(description="one for each problem")] = ()


@dataclass(frozen=True)
class Comparison:
    """Comparison of a solution with the record of its problem.

    Parameters
    ----------
    name : str
        Name of the problem.
    verification : Verification
        Verdict of the judge.
    length : float, optional
        Length of the tour, in the problem's units.
    record : Record, optional
        Record of the problem; None if there is none.
    """

    name: str
    verification: Verification
    length: float | None
    record: Record | None

    @property
    def above(self) -> float | None:
        """Excess over the best known length, as a share of it; negative if the tour is shorter."""
        if self.length is None or self.record is None:
            return None
        return self.length / self.record.length - 1.0

    @property
    def better(self) -> bool:
        """True if the tour passed the judge and is shorter than any known one."""
        if not self.verification or self.length is None:
            return False
        return self.above is None or self.above < -SAME_LENGTH_TOLERANCE


class Library:
    """Folder with problems and their records.

    Parameters
    ----------
    folder : str or Path
        The folder.

    Raises
    ------
    InputError
        The folder has no library.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        files = self.folder.glob("*.json") if self.folder.is_dir() else iter(())
        self.paths = {p.stem: p for p in sorted(files) if p.name != RECORDS}
        if not self.paths:
            raise InputError(
                f"{folder}: there are no problems here; expected the folder problems/library of "
                "the project (it is not part of the package)"
            )
        path = self.folder / RECORDS
        known = RecordFile.load(path).records if path.exists() else ()
        self.records = {r.problem: r for r in known}

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the problems, by family and size."""
        return iter(sorted(self.paths, key=_by_size))

    def __len__(self) -> int:
        return len(self.paths)

    def problem(self, name: str) -> Problem:
        """Return the problem with a name.

        Raises
        ------
        InputError
            There is no such problem, or its file is invalid.
        """
        if name not in self.paths:
            raise InputError(f"problem: there is no {name!r} in {self.folder}")
        return Problem.load(self.paths[name])

    @cached_property
    def names(self) -> dict[str, str]:
        """Name of each problem by its sha256."""
        return {self.problem(name).sha256: name for name in self}

    def compared(self, solution: Solution) -> Comparison:
        """Judge a solution, and compare it with the record of its problem.

        Parameters
        ----------
        solution : Solution
            Solution of a problem of the library, without margin and slack.

        Raises
        ------
        InputError
            The solution is of no problem of the library, or has a margin or slack.
        """
        name = self.names.get(solution.problem.sha256)
        if name is None:
            raise InputError(
                f"solution: is of {solution.problem.name!r}, which is none of the problems in "
                f"{self.folder} as they are there"
            )
        if solution.margin or solution.slack:
            raise InputError("solution: was found with margin or slack; expected neither")
        verification = verify(self.problem(name), solution)
        return Comparison(name, verification, solution.length, self.records.get(name))

    def submit(
        self, solution: Solution, by: str, commit: str = "unknown", bound: LowerBound | None = None
    ) -> Comparison:
        """Judge a solution, and make it the record if it is better; `save` writes the records.

        Parameters
        ----------
        solution : Solution
            Solution of a problem of the library.
        by : str
            Name of the contributor.
        commit : str
            Commit of netsp that found it.
        bound : LowerBound, optional
            Lower bound on all tours by a trusted solver. The bound of the solution itself is
            ignored, because the judge cannot check it.

        Returns
        -------
        Comparison
            Comparison with the record before the submission.

        Raises
        ------
        InputError
            `compared` raises it, or the bound has another scope than all tours.
        VerificationError
            The judge rejects the tour.
        """
        found = self.compared(solution)
        if not found.verification or solution.length is None:
            failed = [c.name for c in found.verification.checks if not c.passed]
            raise VerificationError(f"{found.name}: the judge did not pass: {', '.join(failed)}")
        old = found.record
        if bound is not None and bound.scope is not Scope.ALL_TOURS:
            raise InputError(
                f"bound: holds for {bound.scope.tours}; expected one on {Scope.ALL_TOURS.tours}"
            )
        best = strongest(bound, None if old is None else old.bound)
        low = None if best is None else best.length
        if found.better:
            self.records[found.name] = Record(
                problem=found.name,
                sha256=solution.problem.sha256,
                length=solution.length,
                lower_bound=None if low is None else min(low, solution.length),
                solver=solution.solver,
                by=by,
                seconds=round(solution.timings.total_s, 3),
                commit=commit,
                date=str(datetime.date.today()),
                tour=tuple((v.goal, v.signature) for v in solution.tour),
            )
        elif old is not None and low is not None and low > (old.lower_bound or 0.0):
            self.records[found.name] = old.model_copy(update={"lower_bound": min(low, old.length)})
        return found

    take = deprecated_method("take", "submit")

    def save(self) -> None:
        """Write the records to the file, one on each line.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        rows = [
            json.dumps(self.records[name].model_dump(mode="json"), ensure_ascii=False)
            for name in self
            if name in self.records
        ]
        body = ",\n".join("  " + row for row in rows)
        write_text(
            self.folder / RECORDS, f'{{\n "schema_version": 1,\n "records": [\n{body}\n ]\n}}\n'
        )


def _by_size(name: str) -> tuple[object, ...]:
    family, *numbers = name.split("-")
    return (family, *(int(n) if n.isdigit() else 0 for n in numbers), name)
