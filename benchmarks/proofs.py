"""Proofs of optima: how many, how large and how fast, and whether a false one is accepted.

    python benchmarks/proofs.py [--keep] [--goals 40] [--time-limit 600]
    python benchmarks/proofs.py --attacks [--keep] [--mutations 5000] [--proofs 50]

The first command solves the shipped problems, ten worlds each of 10, 20 and 40 goals with tethers
of 250 and 350, five of 60 goals and three of 100 with a tether of 350, and certifies each optimum.
`--goals` leaves out worlds of more goals. A proof is written from the problem and its solution
alone, so the time to write it includes that of the travel graph, and that of a check at the end.

The second one changes proofs and problems at random (`tests/proof_attacks.py`), and checks forged
proofs. A proof is false if it is accepted and its bound is above the length of a tour.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from table import ROOT, head, heading, row

from netsp import Problem, Status, solve
from netsp.base.errors import InputError
from netsp.plan.proof.certify import certify
from netsp.plan.random_worlds import random_world
from netsp_check import Refused, check

FAMILIES = ("icra2017", "rss2016", "clustered", "array", "harbour")

SIZES = (
    *((goals, tether, 10) for goals in (10, 20, 40) for tether in (250.0, 350.0)),
    (60, 350.0, 5),
    (100, 350.0, 3),
)
"""Goals, tether, and number of random worlds."""


@dataclass(frozen=True)
class Measured:
    """Proof of one problem; without a proof, `reason` says why."""

    solve_s: float
    write_s: float = 0.0
    check_s: float = 0.0
    size: int = 0
    classes: int = 0
    reason: str = ""


@dataclass
class Group:
    """Problems of one row of the table."""

    name: str
    problems: Callable[[], Iterator[Problem]]
    goals: int = 0
    found: list[Measured] = field(default_factory=list)

    @property
    def certified(self) -> list[Measured]:
        """Problems that are certified."""
        return [m for m in self.found if not m.reason]

    def most(self, name: str) -> float:
        """Return the largest value of a measure over what is certified."""
        return float(max((getattr(m, name) for m in self.certified), default=0.0))

    def text(self, name: str, unit: float = 1.0) -> str:
        """Return median and maximum of a measure over what is certified."""
        values = [getattr(m, name) / unit for m in self.certified]
        return f"{statistics.median(values):.3g}, {max(values):.3g}" if values else "–"


def groups(max_goals: int) -> Iterator[Group]:
    """Yield the groups of problems up to a number of goals."""
    for path in sorted((ROOT / "problems").glob("*.json")):
        yield Group(path.stem, lambda path=path: iter([Problem.load(path)]))  # type: ignore[misc]
    yield Group("problems/known", known)
    for goals, tether, count in SIZES:
        if goals <= max_goals:
            yield Group(
                f"{goals} goals, tether {tether:g}",
                lambda g=goals, t=tether, n=count: (  # type: ignore[misc]
                    random_world(seed, goals=g, tether_length=t) for seed in range(n)
                ),
                goals,
            )


def known() -> Iterator[Problem]:
    """Yield the problems with known optima."""
    for path in sorted((ROOT / "problems" / "known").glob("*.json")):
        if path.stem != "optima":
            yield Problem.load(path)


def measured(problem: Problem, limit: float) -> Measured:
    """Return how long it takes to solve a problem, to write a proof and to check it."""
    begin = time.monotonic()
    solution = solve(problem, time_limit=limit)
    solve_s = time.monotonic() - begin
    if solution.status is not Status.OPTIMAL:
        return Measured(solve_s, reason=f"not solved in {limit:g} s")
    begin = time.monotonic()
    certificate = certify(problem, solution, time_limit=limit)
    write_s = time.monotonic() - begin
    if certificate.level != "optimal" or certificate.proof is None:
        return Measured(solve_s, reason=certificate.reason)
    text = problem.to_json()
    begin = time.monotonic()
    found = check(text, certificate.proof)
    check_s = time.monotonic() - begin
    length = solution.length or 0.0
    if not 0.0 <= length - found.bound <= 1e-6 * length:
        return Measured(solve_s, reason=f"bound {found.bound}, tour {length}")
    return Measured(solve_s, write_s, check_s, len(certificate.proof), found.vertices)


def print_proofs(max_goals: int, limit: float) -> list[Group]:
    """Print a row for each group, and return the groups."""
    heading("Proofs of optima")
    solve(random_world(0, goals=5))  # compiled before it counts
    head("problems", "certified", "classes", "kB", "solve s", "write s", "check s",
         name="proofs")  # fmt: skip
    out = []
    for group in groups(max_goals):
        for problem in group.problems():
            group.found.append(measured(problem, limit))
            if group.found[-1].reason:
                print(f"{problem.name}: {group.found[-1].reason}", file=sys.stderr)
        row(
            group.name, f"{len(group.certified)} of {len(group.found)}", group.text("classes"),
            group.text("size", 1000.0), group.text("solve_s"), group.text("write_s"),
            group.text("check_s"),
        )  # fmt: skip
        out.append(group)
    return out


def print_asks(found: list[Group]) -> None:
    """Print what was asked for and what was measured."""

    def of(goals: Callable[[int], bool]) -> Group:
        some = [g for g in found if goals(g.goals)]
        return Group("", lambda: iter(()), found=[m for g in some for m in g.found])

    def ratio(group: Group) -> str:
        return f"{len(group.certified)} of {len(group.found)}"

    upto40, at20, at40, at60, at100 = (
        of(lambda n: n <= 40), of(lambda n: n == 20), of(lambda n: n == 40),
        of(lambda n: n == 60), of(lambda n: n == 100),
    )  # fmt: skip
    slow = [
        m for m in of(lambda n: True).certified if m.write_s > max(3.0 * m.solve_s, 60.0)
    ]  # fmt: skip
    most = max((g.goals for g in found if g.goals <= 40), default=0)
    rows = [
        (f"certified up to {most} goals", "all", ratio(upto40),
         len(upto40.certified) == len(upto40.found)),
        ("certified of 60 goals, tether 350", "4 of 5", ratio(at60), len(at60.certified) >= 4),
        ("certified of 100 goals, tether 350", "2 of 3", ratio(at100), len(at100.certified) >= 2),
        ("largest proof at 40 goals, kB", "50", f"{at40.most('size') / 1000.0:.3g}",
         at40.most("size") <= 50_000),
        ("written later than 60 s and 3 times the solve", "0", str(len(slow)), not slow),
        ("slowest check at 20 goals, s", "30", f"{at20.most('check_s'):.3g}",
         at20.most("check_s") <= 30.0),
        ("slowest check at 60 goals, s", "300", f"{at60.most('check_s'):.3g}",
         at60.most("check_s") <= 300.0),
    ]  # fmt: skip
    print()
    head("measure", "asked", "measured", "met", name="proofs-asks")
    groups_of = (upto40, at60, at100, at40, of(lambda n: True), at20, at60)
    for group, (name, asked, value, is_met) in zip(groups_of, rows, strict=True):
        if group.found:
            row(name, asked, value, "yes" if is_met else "no")


def proven_worlds(count: int) -> Iterator[object]:
    """Yield small random problems with their proofs."""
    from tests.proof_attacks import honest

    made = seed = 0
    while made < count:
        try:
            yield honest(
                random_world(
                    seed, family=FAMILIES[seed % len(FAMILIES)], goals=2 + seed % 4,
                    obstacles=1 + seed % 6, tether_length=300.0,
                )
            )  # fmt: skip
            made += 1
        except (InputError, ValueError) as error:
            print(f"world {seed}: {error}", file=sys.stderr)
        seed += 1


def print_mutations(count: int, proofs: int, folder: Path | None) -> int:
    """Print a row for each kind of mutation, and return the number of false proofs accepted."""
    from tests.proof_attacks import MUTATIONS, attack, save

    heading("Mutated proofs")
    tally: dict[str, Counter[str]] = {m.__name__: Counter() for m in MUTATIONS}
    for k, proven in enumerate(proven_worlds(proofs)):
        for j in range(count // proofs):
            number = k * (count // proofs) + j
            found = attack(proven, number)
            tally[found.first][found.kind] += 1
            if found.kind in ("false", "open", "crash"):
                print(f"{number}: {found.kind}: {found.names}: {found.detail}", file=sys.stderr)
                if folder is not None:
                    save(found, folder / f"{found.kind}-{number}")
    head("first mutation", "tried", "no problem", "refused", "true", "false", "errors",
         name="proofs-mutations")  # fmt: skip
    total: Counter[str] = Counter()
    for name, kinds in tally.items():
        total += kinds
        _mutation_row(name.replace("_", " "), kinds)
    _mutation_row("all", total)
    return total["false"] + total["open"] + total["crash"]


def _mutation_row(name: str, kinds: Counter[str]) -> None:
    false = kinds["false"] + kinds["open"]
    row(name, kinds.total(), kinds["void"], kinds["refused"], kinds["true"], false, kinds["crash"])


def print_forgeries() -> int:
    """Print a row for each forged proof, and return the number of those accepted."""
    from tests.proof_attacks import FORGERIES

    print()
    heading("Forged proofs")
    head("forgery", "what it tries", "answer", name="proofs-forgeries")
    accepted = 0
    for name, forge in FORGERIES.items():
        text, proof = forge()
        try:
            answer = f"ACCEPTED: {check(text, proof).bound}"
            accepted += 1
        except Refused as error:
            answer = str(error).replace("|", "/")
        row(name.replace("_", " "), (forge.__doc__ or "").strip(), answer)
    return accepted


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=100)
    parser.add_argument("--time-limit", type=float, default=600.0)
    parser.add_argument("--attacks", action="store_true")
    parser.add_argument("--mutations", type=int, default=5000)
    parser.add_argument("--proofs", type=int, default=50)
    parser.add_argument("--save", type=Path, metavar="FOLDER", help="keep what is false there")
    args = parser.parse_args()
    if args.attacks:
        bad = print_mutations(args.mutations, args.proofs, args.save)
        return 1 if bad + print_forgeries() else 0
    print_asks(print_proofs(args.goals, args.time_limit))
    return 0


if __name__ == "__main__":
    sys.exit(main())
