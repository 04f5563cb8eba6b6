"""Jobs that take hours: each one's outcome is kept in a file as soon as it is known, and jobs whose
outcome is there already are not run again."""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

Outcome = TypeVar("Outcome")


def outcomes(
    jobs: Sequence[tuple[Any, ...]], run: Callable[[Any], Outcome], kind: type[Outcome],
    *, workers: int, file: Path | None,
) -> list[Outcome]:  # fmt: skip
    """Of all jobs, in their order. Each is run in a process of its own: memory is its own, too.

    jobs : tuples of what JSON can hold. kind : of outcomes, a dataclass.
    """
    lines = file.read_text().splitlines() if file is not None and file.exists() else []
    known = {tuple(kept["job"]): kind(**kept["outcome"]) for kept in map(json.loads, lines)}
    pool = ProcessPoolExecutor(
        workers, max_tasks_per_child=1, mp_context=multiprocessing.get_context("spawn")
    )
    with pool:
        running = {pool.submit(run, job): job for job in jobs if job not in known}
        for done in as_completed(running):
            job = running[done]
            known[job] = done.result()
            if file is not None:
                kept = {"job": job, "outcome": asdict(known[job])}
                with file.open("a") as end:
                    end.write(json.dumps(kept) + "\n")
    return [known[job] for job in jobs]
