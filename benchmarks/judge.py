"""The judge against false tours, over hostile worlds.

    python benchmarks/judge.py [--worlds 1000]
    python benchmarks/judge.py --by-kind 150     kinds of worlds and of false tours (false_tours.py)

Every world is solved; its tour must be accepted, and every falsification of it refused: paths
through walls, a wrong word, wrong lengths, obstacles stated as entangled where nothing is, a tether
too short by a millionth, goals swapped, a path cut short. Worlds have walls as thin as the format
admits, needles, combs, circles from specks to bigger than the site, obstacles that touch and
overlap, any scale from a millimetre to a thousand kilometres, and origins as far off as on a map.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from false_tours import KINDS, WORLDS
from table import head, heading, row

from netsp import Circle, Polygon, Problem, Solution, Status, solve, verify
from netsp.base.errors import InputError, NetspError
from netsp.model.solution import ProblemReference

FEW = {"max_classes": 1000}
"""Specks of obstacles have tens of thousands of classes; the judge need not wait for them."""


def hostile_world(seed: int) -> Problem | None:
    """A world of a kind that a judge may get wrong; None if the draw is no problem."""
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-3, 6)
    origin = np.zeros(2) if rng.random() < 0.5 else rng.uniform(-1e3, 1e3, 2) * scale
    turn = rng.uniform(0, 2 * np.pi)
    spin = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def place(xy) -> list[tuple[float, float]]:
        return [tuple(p) for p in np.atleast_2d(xy) @ spin.T * scale + origin]

    obstacles: list[Circle | Polygon] = []
    for _ in range(int(rng.integers(1, 6))):
        x, y = rng.uniform(0.15, 0.85, 2)
        kind = rng.integers(7)
        thin = 10.0 ** rng.uniform(-9, -1)
        try:
            if kind == 0:  # a speck, a pile, an island
                radius = 10.0 ** rng.uniform(-6, -0.6)
                obstacles.append(Circle(center=place((x, y))[0], radius=radius * scale))
            elif kind == 1:  # a wall
                long = rng.uniform(0.2, 0.6)
                wall = [(x, y), (x + thin, y), (x + thin, y + long), (x, y + long)]
                obstacles.append(Polygon(polygon=place(wall)))
            elif kind == 2:  # a needle
                needle = [(x, y), (x + rng.uniform(0.2, 0.6), y + thin), (x, y + 2 * thin)]
                obstacles.append(Polygon(polygon=place(needle)))
            elif kind == 3:  # a body with a thin fin
                fin = [(x, y), (x + 0.1, y), (x + 0.1, y + 0.1), (x + 0.05 + thin, y + 0.1),
                       (x + 0.05 + thin, y + 0.4), (x + 0.05, y + 0.4), (x + 0.05, y + 0.1),
                       (x, y + 0.1)]  # fmt: skip
                obstacles.append(Polygon(polygon=place(fin)))
            elif kind == 4:  # two circles that touch
                r, q = rng.uniform(0.02, 0.12, 2)
                a = rng.uniform(0, 2 * np.pi)
                there = (x + (r + q) * np.cos(a), y + (r + q) * np.sin(a))
                obstacles.append(Circle(center=place((x, y))[0], radius=r * scale))
                obstacles.append(Circle(center=place(there)[0], radius=q * scale))
            elif kind == 5:  # two walls in a T that touch
                bar = [(x, y), (x + 0.3, y), (x + 0.3, y + thin), (x, y + thin)]
                stem = [(x + 0.1, y + thin), (x + 0.1 + thin, y + thin),
                        (x + 0.1 + thin, y + 0.3), (x + 0.1, y + 0.3)]  # fmt: skip
                obstacles += [Polygon(polygon=place(bar)), Polygon(polygon=place(stem))]
            else:  # a hull
                n = int(rng.integers(3, 9))
                angle = np.sort(rng.uniform(0, 2 * np.pi, n))
                ring = np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(0.02, 0.15)
                obstacles.append(Polygon(polygon=place(ring + np.array([x, y]))))
        except InputError:
            continue  # too thin for the format
    clearance = 0.0 if rng.random() < 0.6 else 10.0 ** rng.uniform(-8, -1.5) * scale
    points = place(rng.uniform(0, 1, (1 + int(rng.integers(1, 4)), 2)))
    try:
        return Problem(
            base=points[0], goals=points[1:], obstacles=obstacles, clearance=clearance,
            tether_length=rng.uniform(0.9, 1.8) * scale,
        )  # fmt: skip
    except InputError:
        return None


def falsified(problem: Problem, solution: Solution) -> Iterator[tuple[str, Problem, Solution]]:
    """False tours made from a right one, each with what is false."""

    def edit(**changes: object) -> Solution:
        return solution.model_copy(update=changes)

    def visit(k: int, **changes: object) -> Solution:
        tour = list(solution.tour)
        tour[k] = tour[k].model_copy(update=changes)
        return edit(tour=tuple(tour))

    # what the shortest tour would be without an obstacle that stands in its way
    proven = solution.status is Status.OPTIMAL
    for i in range(len(problem.obstacles) if proven else 0):
        rest = problem.obstacles[:i] + problem.obstacles[i + 1 :]
        try:
            without = problem.model_copy(update={"obstacles": rest})
            other = solve(without, roadmap_options=FEW, time_limit=10.0)
        except NetspError:
            continue
        assert other.length is not None
        assert solution.length is not None
        if other.length < solution.length * (1.0 - 1e-4):
            reference = ProblemReference(name="x", sha256=problem.sha256)
            words = [tuple(a + (a > i) - (a < -i) for a in v.signature) for v in other.tour]
            tour = tuple(
                v.model_copy(update={"signature": w})
                for v, w in zip(other.tour, words, strict=True)
            )
            yield (
                "through an obstacle", problem,
                other.model_copy(update={"problem": reference, "tour": tour}),
            )  # fmt: skip
    if problem.obstacles:
        word = solution.tour[0].signature
        yield "wrong word", problem, visit(0, signature=(*word, 1))
        yield "entangled", problem, edit(entangled=(0,))
    assert solution.length is not None
    for factor in (1.0 + 2e-3, 1.0 - 1e-5):
        length = solution.length * factor
        # the bound goes along, so that only the length is wrong
        yield "wrong length", problem, edit(length=length, lower_bound=length, gap=0.0)
    tether = solution.tour[0].tether_length
    yield "wrong tether", problem, visit(0, tether_length=tether + 1e-5 * problem.tether_length)
    longest = max(v.tether_length for v in solution.tour)
    shorter = problem.model_copy(update={"tether_length": longest * (1.0 - 1e-6)})
    yield (
        "tether too long", shorter,
        edit(problem=ProblemReference(name="x", sha256=shorter.sha256)),
    )  # fmt: skip
    yield "path cut short", problem, edit(path=solution.path[:-1])
    if len(solution.tour) > 1:
        tour = list(solution.tour)
        first, second = tour[0].goal, tour[1].goal
        tour[0] = tour[0].model_copy(update={"goal": second})
        tour[1] = tour[1].model_copy(update={"goal": first})
        yield "goals swapped", problem, edit(tour=tuple(tour))
    bound = solution.length * 1.01
    yield "bound above length", problem, edit(lower_bound=bound, gap=0.0)


def count(worlds: int, first: int = 0) -> tuple[int, int, list[str], list[str]]:
    """Tours judged right and falsifications judged false over so many worlds that have a tour;
    right ones refused and false ones accepted, as lines."""
    right = false = found = 0
    refused: list[str] = []
    accepted: list[str] = []
    seed = first
    while found < worlds:
        problem = hostile_world(seed)
        seed += 1
        if problem is None:
            continue
        try:
            solution = solve(problem, roadmap_options=FEW, time_limit=10.0)
        except NetspError:
            continue
        found += 1
        verdict = verify(problem, solution)
        right += bool(verdict)
        if not verdict:
            bad = next(c for c in verdict.checks if not c.passed)
            refused.append(f"world {seed - 1}: {bad.name}: {bad.detail}")
        for what, there, lie in falsified(problem, solution):
            if verify(there, lie):
                accepted.append(f"world {seed - 1}: {what}")
            else:
                false += 1
    return right, false, refused, accepted


@dataclass
class Tally:
    """Verdicts of the judge on the worlds of one kind."""

    worlds: int = 0
    refused: list[str] = field(default_factory=list)
    false: Counter[str] = field(default_factory=Counter)
    accepted: list[str] = field(default_factory=list)


def tally(worlds: int, per_world: int, first: int = 0) -> dict[str, Tally]:
    """Judge right tours of several worlds of each kind, and some false tours in each world, which
    go through all kinds of `false_tours` in turn."""
    out = {name: Tally() for name in WORLDS}
    turn = 0
    names = list(KINDS)
    for name, draw in WORLDS.items():
        mine, seed = out[name], first
        while mine.worlds < worlds:
            rng = np.random.default_rng(seed)
            seed += 1
            problem = draw(rng)
            if problem is None:
                continue
            try:
                solution = solve(problem, roadmap_options=FEW, time_limit=10.0)
            except NetspError:
                continue
            mine.worlds += 1
            verdict = verify(problem, solution)
            if not verdict:
                bad = next(c for c in verdict.checks if not c.passed)
                mine.refused.append(f"{name} {seed - 1}: {bad.name}: {bad.detail}")
            made = 0
            for _ in range(len(names)):
                if made == per_world:
                    break
                turn += 1
                what = names[turn % len(names)]
                lie = KINDS[what](problem, solution, rng)
                if lie is None:
                    continue
                made += 1
                mine.false[what] += 1
                if _accepts(*lie):
                    mine.accepted.append(f"{name} {seed - 1}: {what}")
    return out


def _accepts(problem: Problem, solution: Solution) -> bool:
    try:
        return bool(verify(problem, solution))
    except InputError:
        return False


def by_kind(worlds: int, per_world: int) -> None:
    """Print tables by kind of world and kind of false tour, and name the wrong verdicts."""
    found = tally(worlds, per_world)
    head("worlds", "right ones", "refused", "false ones", "accepted", name="judge-worlds")
    for name, t in found.items():
        row(name, t.worlds, len(t.refused), t.false.total(), len(t.accepted))
    false: Counter[str] = sum((t.false for t in found.values()), Counter())
    accepted = Counter(line.split(": ")[1] for t in found.values() for line in t.accepted)
    print()
    head("false by", "tours", "accepted", name="judge-kinds")
    for name in KINDS:
        row(name, false[name], accepted[name])
    print()
    for t in found.values():
        for line in (*t.refused, *t.accepted):
            print(f"- {line}")


def main() -> None:
    """Count, and name what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=1000)
    parser.add_argument(
        "--by-kind", type=int, default=0, metavar="N",
        help="instead, right and false tours of N worlds of each kind of false_tours.py",
    )  # fmt: skip
    parser.add_argument(
        "--false", type=int, default=8, metavar="M", help="false tours of each such world"
    )
    args = parser.parse_args()
    heading("The judge")
    if args.by_kind:
        by_kind(args.by_kind, args.false)
        return
    right, false, refused, accepted = count(args.worlds)
    head("worlds", "right ones accepted", "right ones refused", "false ones refused",
         "false ones accepted", name="judge")  # fmt: skip
    row(args.worlds, right, len(refused), false, len(accepted))
    print()
    for line in [*refused, *accepted]:
        print(f"- {line}")
    print(Counter(line.split(": ")[1] for line in [*refused, *accepted]))


if __name__ == "__main__":
    main()
