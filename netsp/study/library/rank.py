"""Ranking of solvers over the library: run a solver on its problems, and compare lengths."""

from __future__ import annotations

import datetime
import functools
import importlib
import json
import os
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from netsp.base.clock import Clock
from netsp.base.errors import InputError, NetspError
from netsp.base.field_types import Name, NonNegative, Total
from netsp.base.files import read_text
from netsp.base.interrupt_signals import until_interrupt
from netsp.base.number_ranges import check_not_negative
from netsp.base.registry import foreign
from netsp.base.validated import Model, read_model
from netsp.judge import verify
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.study.library.records import SAME_LENGTH_TOLERANCE, Library


@dataclass(frozen=True)
class RankPolicy:
    """Policy of a ranking: when a result is late. All numbers are 0 or more.

    Attributes
    ----------
    max_overtime_ratio, max_overtime_s
        A result does not count if its time exceeds the limit by both this ratio and this many
        seconds, which allow for loading libraries.
    grace_s
        Time limit of a command beyond twice its own limit, s; then it is killed.
    """

    max_overtime_ratio: float = 1.1
    max_overtime_s: float = 5.0
    grace_s: float = 10.0

    def __post_init__(self) -> None:
        check_not_negative(self)


class Row(Model):
    """Result of a solver on a problem."""

    schema_version: Annotated[Literal[1], Field(description="of the row's format")] = 1
    solver: Annotated[Name, Field(description="what it is called in the ranking")]
    problem: Annotated[Name, Field(description="name of the problem")]
    limit: Annotated[NonNegative, Field(description="seconds that it was given")]
    seconds: Annotated[NonNegative, Field(description="seconds that it took, from file to file")]
    length: Annotated[Total | None, Field(description="of its tour; null for none")] = None
    verified: Annotated[bool, Field(description="whether the judge passed it")] = False
    message: Annotated[str, Field(description="why there is none")] = ""
    date: Annotated[Name, Field(description="when")] = "unknown"


Solve = Callable[[Problem, Path, float, Callable[[], bool]], Solution]
"""Function of a problem, its file, the time limit in s, and a callback that says whether to stop;
it returns a solution."""


def by_name(name: str, seed: int) -> Solve:
    """Return a solver by its name, or by an object reference, ``module:attribute``.

    Raises
    ------
    InputError
        There is no such function.
    """
    from netsp.plan.solve_problem import check_solver, solve

    solver: Any = name
    if ":" in name:
        module, _, attribute = name.partition(":")
        sys.path.insert(0, os.getcwd())
        try:
            solver = getattr(importlib.import_module(module), attribute)
        except (ImportError, AttributeError) as error:
            raise InputError(f"--solver: {name}: cannot be imported: {error}") from None
        finally:
            sys.path.remove(os.getcwd())
        if callable(solver):
            solver = _guarded(solver, name)
    check_solver(solver, None)
    return lambda problem, _, limit, should_stop: solve(
        problem, solver, time_limit=limit, seed=seed, should_stop=should_stop
    )


def _guarded(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Return a function with the same parameters whose errors become PluginErrors.

    An error then costs one row, not the whole run.
    """

    @functools.wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        with foreign(f"{name} failed"):
            return function(*args, **options)

    return call


def by_command(command: str, policy: RankPolicy = RankPolicy()) -> Solve:
    """Return a solver that runs a command with ``{problem}``, ``{solution}`` and ``{seconds}``
    filled in.

    Raises
    ------
    InputError
        The command lacks ``{problem}`` or ``{solution}``.
    """
    words = shlex.split(command)
    for place in ("{problem}", "{solution}"):
        if not any(place in w for w in words):
            raise InputError(f"--command: expected {place} in it, got {command!r}")

    def solve(
        problem: Problem, path: Path, limit: float, should_stop: Callable[[], bool]
    ) -> Solution:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "solution.json"
            filled = [
                w.replace("{problem}", str(path))
                .replace("{solution}", str(out))
                .replace("{seconds}", f"{limit:g}")
                for w in words
            ]
            try:
                done = subprocess.run(
                    filled,
                    timeout=2.0 * limit + policy.grace_s,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE,
                    text=True,
                    errors="replace",
                )
            except OSError as error:
                raise InputError(f"--command: {words[0]}: {error.strerror or error}") from None
            except subprocess.TimeoutExpired:
                raise NetspError(f"did not end within {2.0 * limit + policy.grace_s:g} s") from None
            if not out.exists():
                last = (done.stderr.strip().splitlines() or ["nothing said"])[-1]
                raise NetspError(f"wrote no solution; exit code {done.returncode}: {last[:120]}")
            return Solution.load(out)

    return solve


def run(
    library: Library,
    names: Sequence[str],
    label: str,
    solve: Solve,
    limit: float,
    policy: RankPolicy = RankPolicy(),
) -> Iterator[Row]:
    """Run a solver over problems, one after the other.

    Ctrl-C ends the run, and the problem that it interrupts gets no row.

    Parameters
    ----------
    library : Library
        Library with the problems.
    names : sequence of str
        Names of the problems.
    label : str
        Name of the solver in the ranking.
    solve : callable
        The solver.
    limit : float
        Time limit for each problem, s.
    policy : RankPolicy
        When a result is late.

    Yields
    ------
    Row
        Result for each problem; without a tour, it states the reason.

    Raises
    ------
    InputError
        The command cannot be run at all.
    """
    with until_interrupt(None) as clock:
        for name in names:
            row = _run(library, name, label, solve, limit, clock, policy)
            if clock.is_stopped:
                return
            yield row


def _run(
    library: Library,
    name: str,
    label: str,
    solve: Solve,
    limit: float,
    clock: Clock,
    policy: RankPolicy,
) -> Row:
    """Solve one problem, and return its row."""
    problem = library.problem(name)
    begin = time.perf_counter()
    row: dict[str, Any] = {
        "solver": label,
        "problem": name,
        "limit": limit,
        "date": str(datetime.date.today()),
    }
    try:
        solution = solve(problem, library.paths[name], limit, lambda: clock.is_stopped)
        row["seconds"] = round(time.perf_counter() - begin, 3)
        if row["seconds"] > policy.max_overtime_ratio * limit + policy.max_overtime_s:
            row["message"] = f"late: answered after {row['seconds']:.1f} s of {limit:g}"
        elif solution.length is None:
            row["message"] = solution.status.value
        elif solution.problem.sha256 != problem.sha256:
            row["message"] = "a solution of another problem"
        else:
            verdict = verify(problem, solution)
            row |= {"length": solution.length, "verified": bool(verdict)}
            if not verdict:
                row["message"] = next(c.name for c in verdict.checks if not c.passed)
    except NetspError as error:
        if isinstance(error, InputError) and str(error).startswith("--"):
            raise
        row |= {"seconds": round(time.perf_counter() - begin, 3), "message": str(error)[:200]}
    return Row(**row)


def read_rows(path: str | Path) -> list[Row]:
    """Return the rows of a file, one on each line; none if the file does not exist.

    Raises
    ------
    InputError
        A line is not a row.
    """
    if not Path(path).exists():
        return []
    lines = [line for line in read_text(path).splitlines() if line.strip()]
    return [read_model(Row, line, f"{path}: line {k}") for k, line in enumerate(lines, 1)]


def append_row(path: str | Path, row: Row) -> None:
    """Append a row to a file.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    try:
        with open(path, "a", encoding="utf-8") as stream:
            stream.write(json.dumps(row.model_dump(mode="json"), ensure_ascii=False) + "\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def ranking(library: Library, rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Return one entry for each solver and time limit, the best first.

    The order is by the mean excess over the best known length, as a share of it. A problem without
    a verified tour counts as twice the best known length.

    Parameters
    ----------
    library : Library
        Library with the records.
    rows : iterable of Row
        Results; those of problems without a record are ignored.

    Returns
    -------
    list of dict
        ``solver``, ``limit``, ``problems``, ``verified``, ``best`` (number of tours as
        short as the best known), ``above`` (mean excess), ``worst``, ``seconds`` (median).
    """
    groups: dict[tuple[str, float], list[Row]] = {}
    for row in rows:
        if row.problem in library.records:
            groups.setdefault((row.solver, row.limit), []).append(row)
    out = []
    for (solver, limit), group in groups.items():
        above = [_above(row, library.records[row.problem].length) for row in group]
        out.append(
            {
                "solver": solver,
                "limit": limit,
                "problems": len(group),
                "verified": sum(row.verified for row in group),
                "best": sum(a <= SAME_LENGTH_TOLERANCE for a in above),
                "above": statistics.fmean(above),
                "worst": max(above),
                "seconds": statistics.median(row.seconds for row in group),
            }
        )
    return sorted(out, key=lambda e: (e["above"], e["seconds"]))


def _above(row: Row, best: float) -> float:
    return row.length / best - 1.0 if row.verified and row.length is not None else 1.0
