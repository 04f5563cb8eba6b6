"""What `netsp execute` does: runs, shows, writes."""

from __future__ import annotations

import argparse
import csv
import io
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from netsp.command.simulate import vector
from netsp.errors import EXIT_DEFECT, EXIT_NOT_ALL, EXIT_NOT_VERIFIED, InputError
from netsp.execute.events import Surprises
from netsp.execute.log import Execution, Options, Row
from netsp.execute.run import execute
from netsp.files import cell, write_text
from netsp.pictures.execution import save_execution
from netsp.problem import Problem
from netsp.solution import Solution


def run_execute(args: argparse.Namespace) -> int:
    """`netsp execute PROBLEM SOLUTION`: returns the exit code."""
    problem, solution = Problem.load(args.problem), Solution.load(args.solution)
    surprises = Surprises.load(args.surprise) if args.surprise else None
    if args.planner not in ("repair", "none"):
        raise InputError(f"--planner: expected repair or none, got {args.planner!r}")
    if args.output is not None:
        make_folder(args.output)
    options = Options(
        speed=args.speed, vehicle=args.vehicle, delta=args.delta, repair=args.planner == "repair",
        current=vector(args.current, "--current") if args.current else (0.0, 0.0, 0.0),
        gusts=args.gusts, seed=args.seed, planning_limit=args.planning_limit,
    )  # fmt: skip
    show = not args.quiet and sys.stderr.isatty()
    done = execute(
        problem, solution, options, surprises=surprises, on_step=live(problem) if show else None
    )
    if show:
        print(file=sys.stderr)
    if args.output is not None:
        write_execution(done, args.output)
        save_execution(done, Path(args.output) / "run.png")
    else:
        print(json.dumps(done.summary, indent=1, allow_nan=False))
    if not args.quiet:
        print(describe(done), file=sys.stderr)
    s = done.summary
    if s["defects"]:
        return EXIT_DEFECT
    if s["exceedance_s"] > 0.0 or (s["home"] and not s["tether_free"]):
        return EXIT_NOT_VERIFIED
    return EXIT_NOT_ALL if s["lost"] or s["status"] != "done" else 0


def live(problem: Problem) -> Callable[[Row], None]:
    """Shows how a run goes, in one line."""
    count = [0]

    def on_step(row: Row) -> None:
        count[0] += 1
        if count[0] % 20 == 1:
            name = "base" if row.goal < 0 else f"goal {row.goal}"
            print(
                f"\r{row.time:8.1f} s  to {name:<9} tether {row.tether:8.2f} of {row.limit:g} "
                f"{problem.units}   ",
                end="", file=sys.stderr, flush=True,
            )  # fmt: skip

    return on_step


def describe(done: Execution) -> str:
    """A run in a few lines."""
    s = done.summary
    planned = s["planned_path"] or 0.0
    lines = [
        f"run      {s['problem']}: {s['status']} after {s['time_s']:.1f} s",
        f"visited  {s['visited']} goals, the tether in the planned class at {s['as_planned']} of "
        f"{len(done.arrivals)} stops",
        f"path     {s['path']:.6g} ({100 * (s['path'] / planned - 1):+.2f} % of the plan's)"
        if planned
        else f"path     {s['path']:.6g}",
        f"tether   longest {s['longest_tether']:.6g} of {s['tether_length']:g}, too long for "
        f"{s['exceedance_s']:.1f} s, "
        + ("taken in free at the base" if s["tether_free"] and s["home"] else "not taken in free"),
    ]
    lines += [
        f"event    {e.time:.1f} s, {e.event}: {e.done} ({e.reason}; {e.planning_s:.2f} s)"
        for e in done.entries
    ]
    lines += [f"left out {done.problem.goal_label(x['goal'])}: {x['reason']}" for x in s["lost"]]
    return "\n".join(lines)


def write_execution(done: Execution, folder: str | Path) -> None:
    """log.csv, visits.csv, events.csv, tethers.json, summary.json, and the problem and solution."""
    place = make_folder(folder)
    write_text(place / "log.csv", _table([asdict(r) for r in done.rows]))
    visits = [
        {**asdict(a), "word": " ".join(map(str, a.word)), "planned": " ".join(map(str, a.planned)),
         "as_planned": a.as_planned}
        for a in done.arrivals
    ]  # fmt: skip
    write_text(place / "visits.csv", _table(visits))
    write_text(place / "events.csv", _table([asdict(e) for e in done.entries]))
    write_text(place / "summary.json", json.dumps(done.summary, indent=1, allow_nan=False) + "\n")
    frames = [{"time": t, "nodes": [[round(float(v), 4) for v in p] for p in n]}
              for t, n in done.tethers]  # fmt: skip
    write_text(place / "tethers.json", json.dumps(frames, allow_nan=False) + "\n")
    write_text(place / "problem.json", done.problem.to_json())
    write_text(place / "solution.json", done.solution.to_json())


def make_folder(folder: str | Path) -> Path:
    """The folder, made if need be; InputError if that cannot be done or nothing be written."""
    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
        probe = place / ".netsp"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"{folder}: cannot be written to: {error.strerror or error}") from None
    return place


def _table(rows: Sequence[dict[str, Any]]) -> str:
    if not rows:
        return ""
    text = io.StringIO()
    table = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(
        {
            k: round(v, 6) if isinstance(v, float) else cell(v) if isinstance(v, str) else v
            for k, v in r.items()
        }
        for r in rows
    )
    return text.getvalue()
