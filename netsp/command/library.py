"""`netsp library`: problems for the field, what is known of them, and how solvers rank."""

from __future__ import annotations

import argparse
import fnmatch
import sys
import time
from typing import TYPE_CHECKING

from netsp.base.errors import EXIT_NOT_VERIFIED, InputError, VerificationError, counted
from netsp.base.files import read_bytes
from netsp.command import json_output, messages
from netsp.command.patience import span
from netsp.command.types import check_writable
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE, Scope

if TYPE_CHECKING:
    from netsp.model.solution import Solution
    from netsp.study.library import Library, Record
    from netsp.study.library.records import Comparison


def run(args: argparse.Namespace) -> int:
    """List, check or rank, and return the exit code."""
    from netsp.study.library import Library

    if args.files and args.action != "check":
        raise InputError(f"FILE: expected none with {args.action}, got {args.files[0]!r}")
    if args.proof and (args.action != "check" or len(args.files) != 1):
        raise InputError(
            f"--proof: expected `check` and one FILE, got `{args.action}` and {len(args.files)}"
        )
    library = Library(args.folder)
    actions = {"list": _list, "check": _check, "proofs": _proofs, "rank": _rank}
    return actions[args.action](args, library)


def _chosen(args: argparse.Namespace, library: Library) -> list[str]:
    names = [name for name in library if fnmatch.fnmatchcase(name, args.only)]
    if not names:
        raise InputError(f"--only: no problem of {args.folder} is named {args.only!r}")
    return names


def _list(args: argparse.Namespace, library: Library) -> int:
    names = _chosen(args, library)
    if args.json:
        rows = [{"problem": name} | _fields(library.records.get(name)) for name in names]
        json_output.tell({"problems": rows})
        return 0
    print(f"bounds are on {Scope.ALL_TOURS.tours}")
    print(
        f"{'problem':<20} {'goals':>6} {'best':>12} {'bound':>12} {'gap':>9}  certified  found by"
    )
    for name in names:
        goals = library.problem(name).visits
        r = library.records.get(name)
        if r is None:
            print(f"{name:<20} {goals:>6} {'-':>12} {'-':>12} {'-':>9}  -")
            continue
        bound, gap = "-", "-"
        if r.bound is not None:
            bound = f"{r.bound.length:.6g}"
            gap = "proven" if r.proven else r.bound.percent(r.length, 3)
        print(
            f"{name:<20} {goals:>6} {r.length:>12.6g} {bound:>12} {gap:>9}  {r.certified:<9}  "
            f"{r.solver}, {r.by}"
        )
    return 0


def _fields(r: Record | None) -> dict[str, object]:
    """Return what `netsp library list --json` says of a record; nothing if there is none."""
    if r is None:
        return {}
    return {
        "length": r.length,
        "lower_bound": r.lower_bound,
        "gap": r.gap,
        "lower_bound_of": None if r.bound is None else r.bound.scope.value,
        "certified": r.certified,
        "certified_bound": None if r.proof is None else r.proof.bound,
        "solver": r.solver,
        "by": r.by,
        "date": r.date,
    }


def _proofs(args: argparse.Namespace, library: Library) -> int:
    """Check the published proofs, and return the exit code."""
    failed, answers = [], []
    for name in _chosen(args, library):
        begin = time.monotonic()
        try:
            checked = library.check_published(name)
        except VerificationError as error:
            failed.append(name)
            answers.append({"problem": name, "holds": False, "reason": str(error)})
            if not args.json:
                print(error)
            continue
        if checked is None:
            continue
        answers.append({"problem": name, "holds": True, "certified_bound": checked.bound})
        if not args.json and not args.quiet:
            gaps = f"; {counted(checked.closed_gaps, 'gap')} closed" if checked.closed_gaps else ""
            took = f"{time.monotonic() - begin:.1f} s"
            print(f"{name}: no tour is shorter than {checked.bound:.9g}: holds{gaps}; {took}")
    if args.json:
        json_output.tell({"proofs": answers})
    else:
        print(f"published proofs that hold: {len(answers) - len(failed)} of {len(answers)}")
    return EXIT_NOT_VERIFIED if failed else 0


def _check(args: argparse.Namespace, library: Library) -> int:
    from netsp.model.solution import Solution

    if not args.files:
        raise InputError("FILE: expected solutions to check, got none")
    failed, answers, has_changed = False, [], False
    proof = read_bytes(args.proof) if args.proof else None
    for file in args.files:
        solution = Solution.load(file)
        result = library.compared(solution)
        record = result.record
        failed |= not result.verification or result.length is None
        text = _compared_in_words(result)
        certified = None
        if proof is not None and result.verification:
            certified = library.checked_proof(result.name, proof).bound
            text += f"; the proof holds: no tour is shorter than {certified:.9g}"
        elif result.verification and _states_higher(solution, record):
            text += "; its bound is not taken: --proof FILE takes one with its proof"
        if args.keep and result.verification and (result.better or certified is not None):
            library.submit(solution, args.by, proof=proof)
            has_changed = True
        answers.append(
            {
                "file": file,
                "problem": result.name,
                "verified": bool(result.verification),
                "length": result.length,
                "best_known": None if record is None else record.length,
                "better": result.better,
                "certified_bound": certified,
            }
        )
        if not args.json:
            print(f"{file}: {result.name}: {text}")
    if has_changed:
        library.save()
    if args.json:
        json_output.tell({"checked": answers})
    return EXIT_NOT_VERIFIED if failed else 0


def _compared_in_words(result: Comparison) -> str:
    """Return in words how a solution compares with the record of its problem."""
    record = result.record
    if not result.verification or result.length is None:
        why = next((c.name for c in result.verification.checks if not c.passed), "no tour")
        return f"not verified: {why}"
    if record is None or result.above is None:
        return f"{result.length:.9g}, verified; no tour of this problem was known"
    if result.better:
        return f"{result.length:.9g}, verified, {-100 * result.above:.4f} % shorter than known"
    proven = ", which is proven" if record.proven else ""
    return (
        f"{result.length:.9g}, verified, {100 * max(result.above, 0.0):.4f} % above the "
        f"best known, {record.length:.9g}{proven}"
    )


def _states_higher(solution: Solution, record: Record | None) -> bool:
    """Return whether a solution states a higher bound on all tours than its record has."""
    if solution.bound is None or solution.bound.scope is not Scope.ALL_TOURS:
        return False
    known = 0.0 if record is None else record.lower_bound or 0.0
    return solution.bound.length > known * (1.0 + OPTIMALITY_TOLERANCE)


def _rank(args: argparse.Namespace, library: Library) -> int:
    from netsp.study.library import rank

    output = args.output or f"{args.folder}/ranking.jsonl"
    rows = rank.read_rows(output)
    if args.solver or args.command:
        check_writable(*filter(None, (args.output,)))
        solve = (
            rank.by_name(args.solver, args.seed) if args.solver else rank.by_command(args.command)
        )
        label = args.label or args.solver or args.command.split()[0].rsplit("/", 1)[-1]
        ranked_before = {(r.solver, r.limit, r.problem) for r in rows}
        names = [
            n for n in _chosen(args, library) if (label, args.time_limit, n) not in ranked_before
        ]
        skipped = len(_chosen(args, library)) - len(names)
        if skipped and not args.quiet:
            messages.note(
                f"{counted(skipped, 'problem')} of {label!r} with this limit are in {output} and "
                "are not run again; another --label, or another file, runs them"
            )
        begin = time.monotonic()
        for k, row in enumerate(rank.run(library, names, label, solve, args.time_limit), 1):
            rows.append(row)
            if args.output:
                rank.append_row(args.output, row)
            if not args.quiet:
                left_s = (time.monotonic() - begin) / k * (len(names) - k)
                record = library.records.get(row.problem)
                outcome = row.message or "no tour"
                if row.verified and row.length is not None:
                    outcome = f"{row.length:.6g}"
                    if record:
                        outcome += (
                            f", {100 * (row.length / record.length - 1):z.3f} % above the best"
                        )
                print(
                    f"[{k}/{len(names)}] {row.problem}: {outcome}, {row.seconds:.1f} s; "
                    f"{span(left_s)} left",
                    file=sys.stderr,
                    flush=True,
                )
    entries = rank.ranking(library, rows)
    if len({e["problems"] for e in entries}) > 1 and not args.quiet:
        messages.note("not all ran on the same problems: do not compare their means")
    if args.json:
        json_output.tell({"ranking": entries})
        return 0
    if not entries:
        raise InputError(f"{output}: there is nothing to rank; expected --solver or --command")
    print(
        f"{'solver':<16} {'limit s':>8} {'problems':>9} {'verified':>9} {'as the best':>12} "
        f"{'above, mean %':>14} {'worst %':>9} {'median s':>9}"
    )
    for e in entries:
        print(
            f"{e['solver']:<16.16} {e['limit']:>8g} {e['problems']:>9} {e['verified']:>9} "
            f"{e['best']:>12} {100 * e['above']:>z14.3f} {100 * e['worst']:>z9.2f} "
            f"{e['seconds']:>9.2f}"
        )
    return 0
