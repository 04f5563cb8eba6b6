"""`netsp compare`: solvers side by side, with a progress line."""

from __future__ import annotations

import argparse
import sys
import time
from typing import TYPE_CHECKING, Any, TextIO

from netsp.base.errors import EXIT_INTERRUPTED, InputError
from netsp.command import json_output, messages
from netsp.command.command_policy import CommandPolicy
from netsp.command.patience import span

if TYPE_CHECKING:
    from netsp.study.compare.rows import TrialRow
    from netsp.study.compare.study import Study
    from netsp.study.compare.study_run import Tally


def run(args: argparse.Namespace) -> int:
    """Run the trials that are not done yet, and return the exit code."""
    from netsp.study.compare.study_run import compare

    study = study_of(args)
    executor = None
    if args.scheduler:
        from netsp.study.compare.cluster import dask_executor

        executor = dask_executor(args.scheduler)
    bar = Bar(sys.stderr, args.quiet, args.policy)
    try:
        tally = compare(
            study, args.output, jobs=args.jobs, part=args.shard, executor=executor, on_row=bar.show
        )
    except KeyboardInterrupt:
        bar.end()
        messages.error(f"interrupted; {args.output} holds what is done; the same command resumes")
        return EXIT_INTERRUPTED
    bar.end()
    if not args.quiet:
        print(
            f"{tally.done} trials in {args.output}, {tally.done - tally.begun} of them new, "
            f"{tally.failed} failed",
            file=sys.stderr,
        )
    if args.json:
        json_output.tell(
            {
                "trials": tally.total,
                "done": tally.done,
                "new": tally.done - tally.begun,
                "failed": tally.failed,
                "results": args.output,
            }
        )
    return 0


def study_of(args: argparse.Namespace) -> Study:
    """Return the study in the file, or a study made from the flags."""
    from netsp.study.compare.study import Study

    flags = {
        "goals": args.goals,
        "tether_lengths": args.tethers,
        "solvers": args.solvers and [{"name": name} for name in args.solvers],
        "roadmaps": args.roadmaps and [{"name": name} for name in args.roadmaps],
        "seeds": args.seeds,
        "time_limit": args.time_limit,
        "memory_limit": args.memory_limit,
    }
    given = {name: value for name, value in flags.items() if value is not None}
    worlds = {"count": args.worlds, "family": args.family}
    given_worlds = {name: value for name, value in worlds.items() if value is not None}
    if args.study:
        if given or given_worlds:
            name = next(iter({**given, **given_worlds}))
            raise InputError(
                f"compare: {name} is given both as a flag and in the study file; choose one"
            )
        return Study.load(args.study)
    missing = [name for name in ("goals", "tether_lengths", "solvers") if name not in given]
    if missing:
        flag = {"tether_lengths": "tethers"}.get(missing[0], missing[0])
        raise InputError(f"compare: expected a study file or --{flag}")
    data: dict[str, Any] = {"name": "compare", **given, "worlds": given_worlds}
    return Study.checked(data, "compare")


class Bar:
    """Progress of a study: one line redrawn on a terminal, lines at intervals elsewhere."""

    def __init__(
        self, stream: TextIO, quiet: bool, policy: CommandPolicy = CommandPolicy()
    ) -> None:
        self.stream, self.quiet = stream, quiet
        self.begin = self.shown = time.monotonic()
        self.live = stream.isatty()
        self._interval_s = policy.redraw_interval_s if self.live else policy.trial_interval_s

    def show(self, row: TrialRow, tally: Tally) -> None:
        """Show the progress after a trial, if a line is due."""
        from netsp.study.compare.rows import FAILED

        if self.quiet:
            return
        if row["status"] in FAILED:
            self._clear()
            print(f"{describe_row(row)}: {row['status']}: {row['message']}", file=self.stream)
        now = time.monotonic()
        if now - self.shown < self._interval_s and tally.done < tally.total:
            return
        self.shown = now
        n_new = tally.done - tally.begun
        left_s = (now - self.begin) / n_new * (tally.total - tally.done)
        text = (
            f"{tally.done}/{tally.total} trials, {tally.failed} failed, {span(left_s)} left, "
            f"last {describe_row(row)}"
        )
        self._clear()
        print(text[:118], end="" if self.live else "\n", file=self.stream, flush=True)

    def end(self) -> None:
        """End the redrawn line with a line break."""
        if self.live and not self.quiet:
            print(file=self.stream)

    def _clear(self) -> None:
        if self.live:
            print("\r\x1b[K", end="", file=self.stream)


def describe_row(row: TrialRow) -> str:
    """Return a short description of a trial."""
    world = row["world"]
    return (
        f"{row['solver']['label']} on {world['family']}-{world['seed']}, {world['goals']} goals, "
        f"tether {world['tether_length']:g}"
    )
