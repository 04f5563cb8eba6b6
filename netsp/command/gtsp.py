"""`netsp gtsp`: any symmetric generalised TSP in the format of GTSPLIB."""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from typing import TYPE_CHECKING

from netsp.base.errors import EXIT_INFEASIBLE, EXIT_NOT_ALL, InputError
from netsp.command import json_output
from netsp.command.command_clock import command_clock
from netsp.command.command_options import given_params

if TYPE_CHECKING:
    from netsp.gtsp.gtsplib import GtsplibInstance
    from netsp.gtsp.travel.result import Result


def run(args: argparse.Namespace) -> int:
    """Solve, write, and return the exit code."""
    from netsp.base.files import STANDARD, write_text
    from netsp.command.progress_table import ProgressTable
    from netsp.gtsp.gtsplib import load
    from netsp.gtsp.gtsplib.tour_file import tour_text
    from netsp.plan.solve_problem import solve_graph

    params = given_params(args)
    clock = command_clock(args.time_limit)
    instance = clock.bounded("reading the instance", lambda: load(args.instance))
    if args.plot and instance.places is None:
        raise InputError(
            f"--plot: {args.instance} is given by its distances, so there is nothing to draw"
        )
    graph = instance.to_instance()
    begin = time.monotonic()
    table = None if args.quiet else ProgressTable(sys.stderr, args.policy)
    with table or contextlib.nullcontext():
        if table:
            table.begin(instance, "looking for a first tour …")
        result = solve_graph(
            graph,
            args.solver,
            time_limit=clock,
            iteration_limit=args.iteration_limit,
            seed=args.seed,
            params=params,
            on_progress=table,
        )
    if result.tour is not None:
        write_text(args.output or STANDARD, tour_text(instance, result))
    if args.plot:
        from netsp.view.pictures import style
        from netsp.view.pictures.gtsp_picture import draw_gtsp

        style.save(draw_gtsp(instance, result).figure, args.plot)
    spent = time.monotonic() - begin
    if table:
        table.end()
        print(_summary(result, spent, args.output, args.plot), file=sys.stderr)
    if args.json:
        json_output.tell(_summary_for_programs(instance, result, spent))
    if result.tour is None:
        return EXIT_INFEASIBLE if result.status.value == "infeasible" else EXIT_NOT_ALL
    return 0


def _summary(result: Result, spent: float, output: str | None, plot: str | None) -> str:
    """Return the result in a few lines."""
    if result.length is None:
        why = "there is no tour" if result.status.value == "infeasible" else "no tour found"
        return f"{why} ({spent:.2f} s)"
    if result.status.is_optimal:
        verdict = result.status.verdict
    elif result.bound is None:
        verdict = "no bound"
    else:
        verdict = result.bound.says(result.length, digits=10)
    lines = [f"tour     {result.length:.10g}, {verdict}", f"time     {spent:.2f} s"]
    if output:
        lines.append(f"written  {output}")
    if plot:
        lines.append(f"picture  {plot}")
    return "\n".join(lines)


def _summary_for_programs(
    instance: GtsplibInstance, result: Result, spent: float
) -> dict[str, object]:
    """Return the result for programs."""
    return {
        "instance": instance.name,
        "vertices": len(instance.clusters),
        "clusters": int(instance.clusters.max()) + 1,
        "status": result.status.value,
        "length": result.length,
        "lower_bound": result.lower_bound,
        "gap": result.gap,
        "lower_bound_of": None if result.bound is None else result.bound.scope.value,
        "tour": None if result.tour is None else [v + 1 for v in result.tour],
        "seconds": round(spent, 3),
    }
