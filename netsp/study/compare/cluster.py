"""Trials on a Dask cluster, whose workers may join and leave at any time.

If a worker dies, another worker runs its trial again, up to `ALLOWED_FAILURES` times; then the row
of the trial has the status `killed`. This machine needs `pip install "netsp[cluster]"`, and each
worker needs netsp.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from netsp.base.errors import InputError
from netsp.study.compare.pool import crashed
from netsp.study.compare.rows import TrialRow
from netsp.study.compare.study import Trial
from netsp.study.compare.study_run import Executor
from netsp.study.compare.trial_policy import TrialPolicy

if TYPE_CHECKING:
    from distributed import Client


def dask_executor(address: str, policy: TrialPolicy = TrialPolicy()) -> Executor:
    """Return an executor on the scheduler at ``tcp://host:port``.

    Raises InputError if Dask is not installed or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            'a scheduler needs Dask; install it with: pip install "netsp[cluster]"'
        ) from None
    try:
        client = Client(address, timeout=policy.connect_s)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"scheduler: no Dask scheduler at {address!r} ({type(error).__name__}); expected "
            "tcp://host:port of a running `dask scheduler`"
        ) from None

    def execute(trials: list[Trial]) -> Iterator[tuple[Trial, TrialRow]]:
        try:
            yield from _execute(client, trials, policy)
        finally:
            client.close()

    return execute


def _execute(
    client: Client, trials: list[Trial], policy: TrialPolicy
) -> Iterator[tuple[Trial, TrialRow]]:
    from distributed import as_completed

    queue = iter(trials)
    running: dict[str, Trial] = {}

    def submit() -> Any | None:
        trial = next(queue, None)
        if trial is None:
            return None
        running[trial.id] = trial
        # pure=False: Dask does not reuse the result of an equal trial of an earlier run
        return client.submit(guarded, trial, policy, key=f"netsp-{trial.id}", pure=False, retries=0)

    threads = max(sum(client.nthreads().values()), 1)
    first = [
        f for f in (submit() for _ in range(policy.queued_per_worker * threads)) if f is not None
    ]
    pending = as_completed(first)
    for future in pending:
        trial = running.pop(future.key.removeprefix("netsp-"))
        if future.status == "finished":
            outcome: TrialRow = future.result()
        else:
            error = future.exception()
            lost = type(error).__name__ == "KilledWorker"
            outcome = {
                "status": "killed" if lost else "crashed",
                "message": f"{type(error).__name__}: {str(error).splitlines()[0][:200]}",
            }
        future.release()
        if (more := submit()) is not None:
            pending.add(more)
        yield trial, outcome


def guarded(trial: Trial, policy: TrialPolicy = TrialPolicy()) -> TrialRow:
    """Run a trial on a worker; return a row even if it raises an error or does not answer."""
    import threading

    from netsp.study.compare.trial import run

    outcome: list[TrialRow] = []

    def body() -> None:
        try:
            outcome.append(run(trial))
        except MemoryError:
            outcome.append({"status": "out_of_memory", "message": "on a Dask worker"})
        except Exception as error:
            outcome.append(crashed(error))

    thread = threading.Thread(target=body, daemon=True)
    thread.start()
    limit = trial.solver["time_limit"]
    thread.join(None if limit is None else 2.0 * limit + policy.hung_grace_s)
    if not outcome:
        return {"status": "timeout", "message": "the solver did not come back"}
    return outcome[0]
