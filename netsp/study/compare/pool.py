"""Trials in worker processes. A crash, a hang or a lack of memory costs one trial, not the batch.

Workers start once and get one trial at a time. A worker that dies or does not answer in time is
replaced, and the row of its trial says what happened.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from netsp.base.errors import PluginError
from netsp.base.interrupt_signals import INTERRUPTS
from netsp.study.compare.rows import LOST, TrialRow
from netsp.study.compare.study import Trial
from netsp.study.compare.trial_policy import TrialPolicy


@dataclass
class _Worker:
    process: Any
    pipe: Connection
    trial: Trial | None = None
    deadline: float = float("inf")


def run_all(
    trials: list[Trial], jobs: int, policy: TrialPolicy = TrialPolicy()
) -> Iterator[tuple[Trial, TrialRow]]:
    """Run trials in `jobs` processes, and yield each trial with its row as it finishes.

    Closing the iterator kills the workers.
    """
    context = multiprocessing.get_context("spawn")
    queue = list(reversed(trials))
    workers = [_start(context) for _ in range(min(jobs, len(trials)))]
    try:
        for worker in workers:
            _feed(worker, queue, policy.hung_grace_s)
        while any(w.trial is not None for w in workers):
            soonest = min(w.deadline for w in workers)
            ready = wait(
                [w.pipe for w in workers if w.trial is not None],
                max(0.0, min(soonest - time.monotonic(), 1.0)),
            )
            for k, worker in enumerate(workers):
                if worker.trial is None:
                    continue
                outcome: TrialRow | None = None
                if worker.pipe in ready:
                    try:
                        outcome = worker.pipe.recv()
                    except (EOFError, OSError):
                        worker.process.join(5.0)
                        outcome = _lost(worker.process.exitcode)
                elif time.monotonic() > worker.deadline:
                    outcome = {"status": "timeout", "message": "the solver did not come back"}
                if outcome is None:
                    continue
                trial = worker.trial
                if outcome["status"] in LOST:
                    _stop(worker)
                    workers[k] = worker = _start(context)
                _feed(worker, queue, policy.hung_grace_s)
                yield trial, outcome
    finally:
        for worker in workers:
            _stop(worker)


def _start(context: Any) -> _Worker:
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs,), daemon=True)
    process.start()
    theirs.close()
    return _Worker(process, ours)


def _feed(worker: _Worker, queue: list[Trial], grace_s: float) -> None:
    worker.trial, worker.deadline = None, float("inf")
    if queue:
        worker.trial = queue.pop()
        limit = worker.trial.solver["time_limit"]
        if limit is not None:
            worker.deadline = time.monotonic() + 2.0 * limit + grace_s
        with contextlib.suppress(OSError):  # the closed pipe will show that the worker is dead
            worker.pipe.send(worker.trial)


def _stop(worker: _Worker) -> None:
    worker.pipe.close()
    worker.process.kill()
    worker.process.join()


def _lost(code: int | None) -> TrialRow:
    if code is not None and code < 0:
        name = signal.Signals(-code).name
        return {"status": "killed" if code == -9 else "crashed", "message": f"by {name}"}
    return {"status": "crashed", "message": f"the worker ended with exit code {code}"}


def _work(pipe: Connection) -> None:
    """Run the trials that arrive, until the pipe is closed."""
    from netsp.study.compare.trial import run

    for number in INTERRUPTS:  # the parent handles interrupts, and kills its workers
        signal.signal(number, signal.SIG_IGN)
    limited = False
    while True:
        try:
            trial: Trial = pipe.recv()
        except EOFError:
            return
        if trial.memory_limit is not None and not limited:
            _limit_memory(trial.memory_limit)
            limited = True
        try:
            outcome = run(trial)
        except MemoryError:
            outcome = {"status": "out_of_memory", "message": f"of {trial.memory_limit} GiB"}
        except Exception as error:
            outcome = crashed(error)
        pipe.send(outcome)


def crashed(error: BaseException) -> TrialRow:
    """Return the row of a trial that raised an unexpected error."""
    if isinstance(error, PluginError) and error.__cause__ is not None:
        error = error.__cause__
    at = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{os.path.basename(at.filename)}:{at.lineno}"
    return {"status": "crashed", "message": f"{type(error).__name__}: {error} ({where})"}


def _limit_memory(gib: float) -> None:
    """Limit the memory of the process to its present use and a number of GiB more."""
    import resource

    with open("/proc/self/statm") as file:
        now = int(file.read().split()[0]) * resource.getpagesize()
    max_bytes = now + int(gib * 2**30)
    resource.setrlimit(resource.RLIMIT_AS, (max_bytes, max_bytes))
