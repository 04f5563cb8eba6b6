"""`netsp compare`: solvers side by side, with a progress line."""

from __future__ import annotations

import argparse
import sys
import time
from typing import TYPE_CHECKING, Any, TextIO

from netsp.base.errors import EXIT_INTERRUPTED, InputError
from netsp.command import json_output, messages
from netsp.command.patience import span
from netsp.command.types import length, natural, positive, seconds, shard

if TYPE_CHECKING:
    from netsp.study.compare.rows import TrialRow
    from netsp.study.compare.study import Study
    from netsp.study.compare.study_run import Tally

EXAMPLE = "netsp compare examples/study.toml -o rows.jsonl --jobs 2"


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument(
        "study",
        metavar="STUDY",
        nargs="?",
        help="study file (TOML); without one, the options below describe the study",
    )
    p.add_argument("-o", "--output", required=True, metavar="FILE", help="results (JSON lines)")
    p.add_argument("--goals", type=positive, nargs="+", metavar="N", help="numbers of goals")
    p.add_argument("--tethers", type=length, nargs="+", metavar="L", help="tether lengths")
    p.add_argument("--solvers", nargs="+", metavar="NAME", help="solvers to compare")
    p.add_argument(
        "--roadmaps", nargs="+", metavar="NAME", help="roadmaps to compare; default taut"
    )
    p.add_argument(
        "--worlds",
        type=positive,
        metavar="N",
        help="number of worlds for each number of goals and tether length; default 10",
    )
    p.add_argument("--family", metavar="NAME", help="family of random worlds; default icra2017")
    p.add_argument(
        "--seeds",
        type=natural,
        nargs="+",
        metavar="N",
        help="random seeds of the solvers; default 0",
    )
    p.add_argument("--time-limit", type=seconds, metavar="S", help="seconds per trial; default 120")
    p.add_argument(
        "--memory-limit", type=length, metavar="GIB", help="GiB per trial; default no limit"
    )
    p.add_argument(
        "--jobs",
        type=positive,
        default=1,
        metavar="N",
        help="number of worker processes; default 1",
    )
    p.add_argument(
        "--shard", type=shard, default=(1, 1), metavar="I/N", help="only the I-th of N parts"
    )
    p.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on the Dask cluster at tcp://host:port"
    )
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")
    json_output.json_flag(p)


def run(args: argparse.Namespace) -> int:
    """Run the trials that are not done yet, and return the exit code."""
    from netsp.study.compare.study_run import compare

    study = study_of(args)
    executor = None
    if args.scheduler:
        from netsp.study.compare.cluster import dask_executor

        executor = dask_executor(args.scheduler)
    bar = Bar(sys.stderr, args.quiet)
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
    """One line that is drawn over, on a terminal; a line now and then elsewhere."""

    def __init__(self, stream: TextIO, quiet: bool) -> None:
        self.stream, self.quiet = stream, quiet
        self.begin = self.shown = time.monotonic()
        self.live = stream.isatty()

    def show(self, row: TrialRow, tally: Tally) -> None:
        """After a trial."""
        from netsp.study.compare.rows import FAILED

        if self.quiet:
            return
        if row["status"] in FAILED:
            self._clear()
            print(f"{describe_row(row)}: {row['status']}: {row['message']}", file=self.stream)
        now = time.monotonic()
        if now - self.shown < (0.1 if self.live else 10.0) and tally.done < tally.total:
            return
        self.shown = now
        fresh = tally.done - tally.begun
        left = (now - self.begin) / fresh * (tally.total - tally.done)
        text = (
            f"{tally.done}/{tally.total} trials, {tally.failed} failed, {span(left)} left, "
            f"last {describe_row(row)}"
        )
        self._clear()
        print(text[:118], end="" if self.live else "\n", file=self.stream, flush=True)

    def end(self) -> None:
        """Leave the line."""
        if self.live and not self.quiet:
            print(file=self.stream)

    def _clear(self) -> None:
        if self.live:
            print("\r\x1b[K", end="", file=self.stream)


def describe_row(row: TrialRow) -> str:
    """Return a trial in a few words."""
    world = row["world"]
    return (
        f"{row['solver']['label']} on {world['family']}-{world['seed']}, {world['goals']} goals, "
        f"tether {world['tether_length']:g}"
    )
