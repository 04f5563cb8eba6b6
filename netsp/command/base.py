"""`netsp base`: rank candidates for the place of the base by their tours."""

from __future__ import annotations

import argparse
import sys

from netsp.base.errors import EXIT_INFEASIBLE, EXIT_NOT_ALL
from netsp.command import messages
from netsp.command.command_clock import command_clock


def run(args: argparse.Namespace) -> int:
    """Print the ranking, write what is asked for, and return the exit code."""
    from netsp.base.files import write_text
    from netsp.exchange.maps.csv_table import from_table
    from netsp.exchange.maps.projection import Projection
    from netsp.model.problem import Problem
    from netsp.plan.sizing.base_placement import Candidate, best_base
    from netsp.plan.sizing.candidates import along_line, over_grid

    clock = command_clock(args.time_limit)
    problem = clock.bounded("reading the problem", lambda: Problem.load(args.problem))
    names: list[str | None] | None = None
    if args.candidates:
        places, names = from_table(args.candidates, Projection.for_problem(problem), messages.note)
    elif args.line:
        places = along_line(args.line)
    else:
        places = over_grid(args.grid, problem)

    def show_candidate(candidate: Candidate, n_open: int) -> None:
        outcome = "no tour" if candidate.length is None else f"tour {candidate.length:.6g}"
        print(f"{candidate.name}: {outcome}; {n_open} may be better", file=sys.stderr)

    search = best_base(
        problem,
        places,
        names=names,
        every=args.every,
        time_limit=clock,
        seed=args.seed,
        on_candidate=None if args.quiet else show_candidate,
    )
    print(f"{'rank':>4}  {'place':<12} {'x':>10} {'y':>10} {'tether':>10} {'tour':>12}  status")
    for k, c in enumerate(search.candidates[: args.top], 1):
        tour = f">= {c.bound.length:.6g}" if c.length is None else f"{c.length:.6g}"
        status = c.why or (c.status.value if c.status is not None else "proven worse")
        if c.why:
            tour = "-"
        elif c.status is None and not search.proven:
            status = "not solved"
        x, y = (f"{v:.6g}" if abs(v) < 1e5 else f"{v:.2f}" for v in c.position[:2])  # UTM: 1 cm
        print(
            f"{k:>4}  {c.name:<12.12} {x:>10} {y:>10} {c.shortest_tether:>10.6g} "
            f"{tour:>12}  {status}"
        )
    solved = sum(c.length is not None for c in search.candidates)
    best = "proven the best by this solver" if search.proven else "not proven the best"
    print(
        f"{len(search.candidates)} places, {sum(c.possible for c in search.candidates)} of them "
        f"possible, {solved} solved" + (f"; the first is {best}" if search.best_problem else "")
    )
    if args.output:
        search.save(args.output)
    if args.plot:
        from netsp.view.pictures import style

        style.save(search.plot()[0].figure, args.plot)
        print(f"picture {args.plot}", file=sys.stderr)
    if search.best_problem is None:
        at_x, at_y = problem.base[:2]
        messages.warning(
            "no place has a tour; places are in the coordinates of the problem, whose base is at "
            f"{at_x:.10g}, {at_y:.10g}"
        )
        return EXIT_INFEASIBLE if not any(c.possible for c in search.candidates) else EXIT_NOT_ALL
    if args.problem_output:
        write_text(args.problem_output, search.best_problem.to_json())
    return 0 if search.proven else EXIT_NOT_ALL
