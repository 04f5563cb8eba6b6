"""Proofs of the library's records: makes each, checks it, and publishes it beside the records.

python benchmarks/library_proofs.py [--limit 120] [--only 'maze-*'] [--failures FILE]  make
python benchmarks/library_proofs.py --max-bytes 60000                         remove larger ones

Problems with few goals come first. A run that was interrupted resumes: certified records are
skipped, and so are problems that the file of failures names. To make all proofs again, for example
for a new format, remove the folder `problems/library/proofs` and run with --again.
"""

from __future__ import annotations

import argparse
import fnmatch
import hashlib
import signal
import time
from pathlib import Path
from types import SimpleNamespace

from library_worlds import FOLDER

from netsp import Problem, Solution, solve
from netsp.base.errors import LimitReachedError, NetspError
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE
from netsp.plan.proof.certify import certify
from netsp.study.library import Library, Record

SOLVE_S = 30.0
"""Time limit of a solve before each proof, s."""

MAX_OVERTIME_RATIO = 2.0
"""Limit of a proof and its check, relative to the time limit; then the problem is given up."""


def give_up(*_: object) -> None:
    """End a proof that does not heed its time limit.

    Raises
    ------
    LimitReachedError
        Always.
    """
    raise LimitReachedError("time is up")


def best_known(problem: Problem, record: Record) -> Solution:
    """Return a solution as short as the record: a new one, or the visits of the record."""
    found = solve(problem, time_limit=SOLVE_S)
    if found.length is not None and found.length <= record.length * (1.0 + OPTIMALITY_TOLERANCE):
        return found
    visits = tuple(SimpleNamespace(goal=g, signature=word) for g, word in record.tour)
    return found.model_copy(update={"length": record.length, "tour": visits})


def prove(library: Library, name: str, limit: float) -> str:
    """Publish a proof for a record, and return why it is not optimal; empty if it is."""
    problem, record = library.problem(name), library.records[name]
    begin = time.perf_counter()
    signal.alarm(round(SOLVE_S + MAX_OVERTIME_RATIO * limit))
    try:
        found = certify(problem, best_known(problem, record), time_limit=limit)
        if found.proof is not None:
            library.publish(name, found.proof)
    except NetspError as error:
        print(f"{name}: {error}", flush=True)
        return str(error)
    finally:
        signal.alarm(0)
    took, size = time.perf_counter() - begin, len(found.proof or b"")
    print(f"{name}: {found.level}, {size} bytes, {took:.1f} s {found.reason}", flush=True)
    return "" if found.level == "optimal" else f"{found.level}: {found.reason}"


def make(limit: float, only: str, failures: Path | None, *, again: bool) -> None:
    """Make the proofs that are missing."""
    library = Library(FOLDER)
    signal.signal(signal.SIGALRM, give_up)
    if again:
        bare = {"proof": None}
        library.records = {n: r.model_copy(update=bare) for n, r in library.records.items()}
    is_known = failures is not None and failures.exists()
    failed = failures.read_text().splitlines() if failures is not None and is_known else []
    skipped = {line.split(":")[0] for line in failed}
    names = [
        n for n in library
        if fnmatch.fnmatchcase(n, only) and n in library.records
        and library.records[n].certified != "optimal" and n not in skipped
    ]  # fmt: skip
    for name in sorted(names, key=lambda n: library.problem(n).visits):
        reason = prove(library, name, limit)
        library.save()
        if reason and failures is not None:
            with failures.open("a") as stream:
                stream.write(f"{name}: {reason}\n")


def keep_small(max_bytes: int) -> None:
    """Remove proofs of more than a number of bytes, and print the size of the others."""
    library, total = Library(FOLDER), 0
    for name, record in library.records.items():
        path = library.proof_path(name)
        if record.proof is None or not path.exists():
            continue
        data = path.read_bytes()
        assert hashlib.sha256(data).hexdigest() == record.proof.sha256, name
        if len(data) > max_bytes:
            path.unlink()
            library.records[name] = record.model_copy(update={"proof": None})
            print(f"{name}: {len(data)} bytes, removed")
        else:
            total += len(data)
    library.save()
    print(f"{total} bytes in {sum(r.proof is not None for r in library.records.values())} proofs")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--limit", type=float, default=120.0)
    parser.add_argument("--only", default="*")
    parser.add_argument("--failures", type=Path)
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--max-bytes", type=int)
    args = parser.parse_args()
    if args.max_bytes is not None:
        keep_small(args.max_bytes)
    else:
        make(args.limit, args.only, args.failures, again=args.again)


if __name__ == "__main__":
    main()
