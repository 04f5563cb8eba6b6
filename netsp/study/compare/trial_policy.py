"""Policy of studies: how trials are queued, when one counts as hung, and what a row holds."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class TrialPolicy:
    """Policy of the trials of a study. All numbers are positive.

    Attributes
    ----------
    max_trials
        Maximum number of trials of a study.
    max_progress_rows
        Maximum number of incumbents in the row of a trial; 2 or more.
    hung_grace_s
        Time limit of a trial beyond twice its own limit, s; then it counts as hung. The time
        includes building the roadmap and compiling kernels.
    connect_s
        Time limit for the first answer of a Dask scheduler, s.
    queued_per_worker
        Number of trials queued for each thread of a cluster, so that no thread waits.
    """

    max_trials: int = 500_000
    max_progress_rows: int = 200
    hung_grace_s: float = 60.0
    connect_s: float = 10.0
    queued_per_worker: int = 4

    def __post_init__(self) -> None:
        check_positive(self)
