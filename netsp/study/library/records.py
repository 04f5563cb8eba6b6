"""Problems in a folder, with the best known tour, bound and proof of each."""

from __future__ import annotations

import contextlib
import datetime
import hashlib
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
from netsp_check import Checked, Refused, check

RECORDS = "records.json"

PROOFS = "proofs"
"""Name of the folder of proofs beside the problems."""

CertifiedLevel = Literal["optimal", "bound", "none"]
"""Level of a proof: the tour is the shortest, a lower bound holds, or nothing is proven."""

SAME_LENGTH_TOLERANCE = 1e-6
"""Tolerance, relative, for two lengths that count as equal."""


class PublishedProof(Model):
    """Proof of a lower bound that is published beside the records, as `proofs/PROBLEM.proof`."""

    bound: Annotated[
        Total, Field(description="no tour is shorter, as netsp_check finds; in the problem's units")
    ]
    sha256: Annotated[str, Field(description="sha256 of the proof file")]


class Record(Model):
    """Best known tour of a problem, with a lower bound on all tours."""

    problem: Annotated[Name, Field(description="name of the problem, and of its file")]
    sha256: Annotated[str, Field(description="of what its answer depends on")]
    length: Annotated[Total, Field(description="of the best tour known, in the problem's units")]
    lower_bound: Annotated[
        Total | None,
        Field(description="no tour at all is shorter (scope all_tours); null if nothing is known"),
    ] = None
    proof: Annotated[
        PublishedProof | None, Field(description="published proof of a bound; null for none")
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
    def certified(self) -> CertifiedLevel:
        """Level of the published proof; `Library.check_published` confirms it."""
        if self.proof is None:
            return "none"
        proves = LowerBound(self.proof.bound, Scope.ALL_TOURS).proves(self.length)
        return "optimal" if proves else "bound"

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

    def proof_path(self, name: str) -> Path:
        """Return the path at which the proof of a problem's record is published."""
        return self.folder / PROOFS / f"{name}.proof"

    def checked_proof(self, name: str, proof: bytes) -> Checked:
        """Check that a proof holds for a problem of the library, without margin and slack.

        Raises
        ------
        InputError
            There is no such problem.
        VerificationError
            The proof does not hold, or it is about grown obstacles or a shorter tether.
        """
        if name not in self.paths:
            raise InputError(f"problem: there is no {name!r} in {self.folder}")
        try:
            checked = check(self.paths[name].read_text(encoding="utf-8"), proof)
        except Refused as error:
            raise VerificationError(f"{name}: the proof is refused: {error}") from None
        for field in ("margin", "slack"):
            if value := getattr(checked, field):
                raise VerificationError(
                    f"{name}: the proof is for {field} {value:g}; expected {field} 0"
                )
        return checked

    def check_published(self, name: str) -> Checked | None:
        """Check the published proof of a record; return None if the record has none.

        Raises
        ------
        VerificationError
            The proof does not hold, or differs from what the record says about it.
        """
        record, path = self.records.get(name), self.proof_path(name)
        if record is None or record.proof is None:
            if path.exists():
                raise VerificationError(
                    f"{name}: the record names no proof; remove {path}, or publish it"
                )
            return None
        if not path.exists():
            raise VerificationError(
                f"{name}: {path}, which the record names, is missing; restore it"
            )
        data = path.read_bytes()
        if hashlib.sha256(data).hexdigest() != record.proof.sha256:
            raise VerificationError(
                f"{name}: {path} has another sha256 than the record; restore it"
            )
        checked = self.checked_proof(name, data)
        _check_stated(record, checked.bound)
        return checked

    def publish(self, name: str, proof: bytes) -> bool:
        """Check a proof, write it beside the records, and raise the bound of the record.

        Nothing changes if the published proof shows more. `save` writes the records.

        Returns
        -------
        bool
            True if the proof was published.

        Raises
        ------
        InputError
            There is no such problem or record.
        VerificationError
            The proof does not hold, or its bound is above the length of the record's tour.
        """
        checked = self.checked_proof(name, proof)
        record = self.records.get(name)
        if record is None:
            raise InputError(f"problem: {name!r} has no record; submit a tour before its proof")
        if record.proof is not None and checked.bound < record.proof.bound:
            with contextlib.suppress(
                VerificationError
            ):  # a published proof that does not hold is replaced
                self.check_published(name)
                return False
        stated = PublishedProof(bound=checked.bound, sha256=hashlib.sha256(proof).hexdigest())
        low = max(checked.bound, record.lower_bound or 0.0)
        record = record.model_copy(update={"proof": stated, "lower_bound": low})
        _check_stated(record, checked.bound)
        path = self.proof_path(name)
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(proof)
        self.records[name] = record
        return True

    def submit(
        self,
        solution: Solution,
        by: str,
        commit: str = "unknown",
        bound: LowerBound | None = None,
        proof: bytes | None = None,
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
        proof : bytes, optional
            Proof of a bound, which is checked and published.

        Returns
        -------
        Comparison
            Comparison with the record before the submission.

        Raises
        ------
        InputError
            `compared` raises it, or the bound has another scope than all tours.
        VerificationError
            The judge rejects the tour, or the proof does not hold.
        """
        found = self.compared(solution)
        if not found.verification or solution.length is None:
            failed = [c.name for c in found.verification.checks if not c.passed]
            raise VerificationError(f"{found.name}: the judge did not pass: {', '.join(failed)}")
        if proof is not None:
            self.checked_proof(found.name, proof)
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
                proof=None if old is None else old.proof,
                solver=solution.solver,
                by=by,
                seconds=round(solution.timings.total_s, 3),
                commit=commit,
                date=str(datetime.date.today()),
                tour=tuple((v.goal, v.signature) for v in solution.tour),
            )
        elif old is not None and low is not None and low > (old.lower_bound or 0.0):
            self.records[found.name] = old.model_copy(update={"lower_bound": min(low, old.length)})
        if proof is not None:
            self.publish(found.name, proof)
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


def _check_stated(record: Record, bound: float) -> None:
    """Check the bound of a proof against its record.

    Raises
    ------
    VerificationError
        The record states another bound, or its tour or bound contradicts the proof.
    """
    assert record.proof is not None
    if bound != record.proof.bound:
        raise VerificationError(
            f"{record.problem}: the proof shows the bound {bound!r}; the record says "
            f"{record.proof.bound!r}"
        )
    if bound > record.length or bound > (record.lower_bound or 0.0):
        raise VerificationError(
            f"{record.problem}: the proof's bound {bound:.9g} is above the record's length "
            f"{record.length:.9g} or bound"
        )


def _by_size(name: str) -> tuple[object, ...]:
    family, *numbers = name.split("-")
    return (family, *(int(n) if n.isdigit() else 0 for n in numbers), name)
