"""Run of a study: trials that the results file lacks are run, and their rows appended."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from netsp.study.compare.pool import run_all
from netsp.study.compare.rows import FAILED, RowsFile, TrialRow
from netsp.study.compare.study import Study, Trial, shard
from netsp.study.compare.trial import check, full_row
from netsp.study.compare.trial_policy import TrialPolicy


class Executor(Protocol):
    """Protocol of what runs trials: processes on this machine, or a cluster."""

    def __call__(self, trials: list[Trial]) -> Iterator[tuple[Trial, TrialRow]]:
        """Yield each trial with its row as it finishes."""


@dataclass(frozen=True)
class Tally:
    """Counts of trials: all, finished (in earlier runs, too), failed and begun in this run."""

    total: int
    done: int
    failed: int
    begun: int


def compare(
    study: Study,
    output: str | Path,
    *,
    jobs: int = 1,
    part: tuple[int, int] = (1, 1),
    executor: Executor | None = None,
    on_row: Callable[[TrialRow, Tally], None] | None = None,
    policy: TrialPolicy = TrialPolicy(),
) -> Tally:
    """Run the trials of a study that the results file lacks, and append their rows.

    A trial that fails has a row and is not run again.

    Parameters
    ----------
    jobs
        Number of processes on this machine, unless an executor is given.
    part
        Shard to run, as (i, n): the i-th of n.
    on_row
        Called with each new row.
    policy
        Time after which a trial counts as hung, unless an executor is given.

    Raises
    ------
    InputError
        The file has content other than rows of this study, or a roadmap has unknown options.
    """
    trials = shard(list(study.trials()), *part)
    for trial in {t.roadmap["label"]: t for t in trials}.values():
        check(trial)
    with RowsFile(output, study.sha256) as rows:
        left = [t for t in trials if t.id not in rows.done]
        begun = done = len(trials) - len(left)
        failed = 0
        outcomes = run_all(left, jobs, policy) if executor is None else executor(left)
        with closing(outcomes):  # type: ignore[type-var]
            for trial, outcome in outcomes:
                row = full_row(trial, outcome, study.sha256, study.name)
                rows.append(row)
                done += 1
                failed += row["status"] in FAILED
                if on_row:
                    on_row(row, Tally(len(trials), done, failed, begun))
        return Tally(len(trials), done, failed, begun)
