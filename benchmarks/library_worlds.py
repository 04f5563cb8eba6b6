"""The recipes of `problems/library`: which problems there are, and how each is made.

    python benchmarks/library_worlds.py        write the problems (they are committed)

Random, clustered and harbour worlds are those of `netsp.plan.random_worlds`; wind farms, jetties,
jacket sections and mazes are built here, with goals at what is inspected. All draws are of
`random.Random`; lengths are rounded to millimetres, or a thousandth of the unit.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from table import ROOT

from netsp.model.problem import Circle, Goal, Obstacle, Polygon, Problem
from netsp.plan.random_worlds import reachable_world
from netsp.roadmap.outline import build_outline
from netsp.roadmap.shortest import ContactGraph

FOLDER = ROOT / "problems" / "library"

Place = tuple[float, ...]


@dataclass(frozen=True)
class Recipe:
    """One problem: its name, a number of the world, and what makes it."""

    name: str
    number: int
    make: Callable[[str, int], Problem]

    def problem(self) -> Problem:
        return self.make(self.name, self.number)


def numbered(stem: str, count: int, make: Callable[[str, int], Problem]) -> Iterator[Recipe]:
    """So many problems of a kind."""
    for k in range(count):
        yield Recipe(f"{stem}-{k}", k, make)


def recipes() -> Iterator[Recipe]:
    """All problems."""
    sizes = (
        (5, 350, 5), (10, 300, 5), (20, 300, 5), (20, 350, 5), (50, 300, 5), (50, 350, 5),
        (100, 300, 4), (100, 350, 2), (200, 300, 2), (60, 500, 2),
    )  # fmt: skip
    for goals, tether, count in sizes:
        yield from numbered(f"random-{goals}-{tether}", count, drawn("icra2017", goals, tether, 20))
    yield from numbered("random-500-300", 2, drawn("icra2017", 500, 300, 50))
    for family in ("clustered", "harbour"):
        for goals, count in ((10, 7), (20, 7), (50, 6), (100, 4)):
            yield from numbered(f"{family}-{goals}", count, drawn(family, goals, 300, 20))
    for side, count in ((3, 6), (4, 6), (5, 5), (7, 4), (9, 3)):
        yield from numbered(f"windfarm-{side * side}", count, windfarm(side))
    for rows, columns, count in (
        (2, 4, 7),
        (2, 7, 5),
        (3, 6, 5),
        (3, 10, 4),
        (4, 12, 3),
        (5, 20, 2),
    ):
        yield from numbered(f"jetty-{rows * columns}", count, jetty(rows, columns))
    for legs, goals, count in ((3, 6, 7), (4, 8, 8), (4, 16, 7), (4, 32, 5)):
        yield from numbered(f"jacket-{goals}", count, jacket(legs, goals))
    for side, goals, count in (
        (3, 5, 6),
        (4, 10, 6),
        (5, 15, 6),
        (6, 20, 6),
        (8, 30, 5),
        (10, 50, 4),
    ):
        yield from numbered(f"maze-{goals}", count, maze(side, goals))


def drawn(family: str, goals: int, tether: float, obstacles: int) -> Callable[[str, int], Problem]:
    """A world of `netsp.plan.random_worlds`."""

    def make(name: str, number: int) -> Problem:
        problem, _ = reachable_world(
            number, family=family, goals=goals, tether_length=float(tether), obstacles=obstacles
        )
        return problem.model_copy(update={"name": name})

    return make


def windfarm(side: int) -> Callable[[str, int], Problem]:
    """Turbines in staggered rows, each a little off, a cable entry at a random side of each."""

    def make(name: str, number: int) -> Problem:
        draw = random.Random(f"{name}")
        pitch, radius, off = 400.0, 5.0, 60.0
        places = [
            (pitch * (c + 0.5 * (r % 2)) + off * (2 * draw.random() - 1),
             0.8 * pitch * r + off * (2 * draw.random() - 1))
            for r in range(side) for c in range(side)
        ]  # fmt: skip
        base = (-0.5 * pitch, -0.5 * pitch)
        goals = [beside(p, radius + 2.0, draw) for p in places]
        return sized(name, base, goals, [Circle(center=rounded(p), radius=radius) for p in places],
                     1.1 + 0.3 * draw.random(), clearance=1.0)  # fmt: skip

    return make


def jetty(rows: int, columns: int) -> Callable[[str, int], Problem]:
    """Piles in rows beneath a deck, with a fender wall along the berth; a point at each pile."""

    def make(name: str, number: int) -> Problem:
        draw = random.Random(f"{name}")
        dx, dy, radius = 5.0, 4.0, 0.4
        places = [(dx * c + 0.4 * draw.random(), dy * r + 0.4 * draw.random())
                  for r in range(rows) for c in range(columns)]  # fmt: skip
        obstacles: list[Obstacle] = [Circle(center=rounded(p), radius=radius) for p in places]
        front = dy * (rows - 1) + 2.2
        for c in range(0, columns - 1, 2):
            x = dx * c + 1.0
            obstacles.append(
                Polygon(polygon=((x, front), (x + 3.0, front), (x + 3.0, front + 0.4),
                                 (x, front + 0.4)))
            )  # fmt: skip
        goals = [(*beside(p, radius + 0.6, draw), -1.0 - round(3.0 * draw.random(), 1))
                 for p in places]  # fmt: skip
        return sized(name, (-3.0, -3.0, -0.5), goals, obstacles, 1.05 + 0.35 * draw.random(),
                     clearance=0.3)  # fmt: skip

    return make


def jacket(legs: int, goals: int) -> Callable[[str, int], Problem]:
    """A jacket cut at some depth: legs at the corners, braces between them cut somewhere along
    their way, conductors within; points about legs and braces, inside and outside."""

    def make(name: str, number: int) -> Problem:
        draw = random.Random(f"{name}")
        half = 6.0 + 4.0 * draw.random()
        turn = 2.0 * math.pi * draw.random()
        corners = [
            (half * math.cos(turn + 2 * math.pi * k / legs),
             half * math.sin(turn + 2 * math.pi * k / legs)) for k in range(legs)
        ]  # fmt: skip
        round_: list[tuple[Place, float]] = [(c, 0.6) for c in corners]
        for k in range(legs):
            a, b = corners[k], corners[(k + 1) % legs]
            share = 0.15 + 0.3 * draw.random()
            round_ += [
                ((a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])), 0.3)
                for t in (share, 1.0 - share)
            ]  # fmt: skip
        conductors = range(int(3 * draw.random()))
        round_ += [((1.8 * k - 1.8, 1.2 * draw.random()), 0.5) for k in conductors]
        places, k = [], 0
        while len(places) < goals:
            centre, radius = round_[k % len(round_)]
            place = beside(centre, radius + 0.7, draw)
            clear = all(math.dist(place, c) > r + 0.45 for c, r in round_)
            if clear and all(math.dist(place, p[:2]) > 0.1 for p in places):
                places.append((*place, -10.0))
                k += 1
        far = 1.6 * half
        angle = 2.0 * math.pi * draw.random()
        base = rounded((far * math.cos(angle), far * math.sin(angle), -8.0))
        circles = [Circle(center=rounded(c), radius=r) for c, r in round_]
        return sized(name, base, places, circles, 1.05 + 0.45 * draw.random(), clearance=0.25)

    return make


def maze(side: int, goals: int) -> Callable[[str, int], Problem]:
    """Rooms of a maze, whose walls are those that a random spanning tree of the rooms leaves; a
    third of these are taken away, so that there are ways around."""

    def make(name: str, number: int) -> Problem:
        draw = random.Random(f"{name}")
        size, thick = 10.0, 0.5
        doors, seen, stack = set(), {(0, 0)}, [(0, 0)]
        while stack:
            x, y = stack[-1]
            near = [
                (x + a, y + b)
                for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))
                if 0 <= x + a < side and 0 <= y + b < side and (x + a, y + b) not in seen
            ]
            if not near:
                stack.pop()
                continue
            there = near[int(len(near) * draw.random())]
            doors.add(frozenset(((x, y), there)))
            seen.add(there)
            stack.append(there)
        walls = []
        for x in range(side):
            for y in range(side):
                for there in ((x + 1, y), (x, y + 1)):
                    inside = there[0] < side and there[1] < side
                    if inside and frozenset(((x, y), there)) not in doors and draw.random() > 1 / 3:
                        walls.append(((x, y), there))
        obstacles = []
        for (x, y), (a, _) in walls:
            if a > x:
                low, high = (size * a - thick / 2, size * y), (size * a + thick / 2, size * (y + 1))
            else:
                low, high = (size * x, size * (y + 1) - thick / 2), (
                    size * (x + 1), size * (y + 1) + thick / 2)  # fmt: skip
            # a little short of the corners: walls that meet there still touch once they are grown
            obstacles.append(Polygon(polygon=(low, (high[0], low[1]), high, (low[0], high[1]))))
        rooms = [(x, y) for x in range(side) for y in range(side) if (x, y) != (0, 0)]
        draw.shuffle(rooms)
        places = []
        for k in range(goals):
            x, y = rooms[k % len(rooms)]
            places.append((size * (x + 0.25 + 0.5 * draw.random()),
                           size * (y + 0.25 + 0.5 * draw.random())))  # fmt: skip
        edge = size * side
        return sized(name, (0.5 * size, 0.5 * size), places, obstacles, 1.02 + 0.15 * draw.random(),
                     clearance=0.2, bounds=(0.0, 0.0, edge, edge))  # fmt: skip

    return make


def beside(place: Place, distance: float, draw: random.Random) -> tuple[float, float]:
    """A point at a distance, in one of sixteen directions."""
    angle = math.pi * int(16 * draw.random()) / 8.0
    return place[0] + distance * math.cos(angle), place[1] + distance * math.sin(angle)


def rounded(place: Place) -> tuple[float, ...]:
    """To a thousandth."""
    return tuple(round(float(v), 3) for v in place)


def sized(
    name: str, base: Place, goals: list[Place], obstacles: list[Obstacle], share: float,
    clearance: float, bounds: Place | None = None,
) -> Problem:  # fmt: skip
    """The problem, with a tether of so many times the longest of the shortest tethers."""
    problem = Problem(
        name=name, base=rounded(base), goals=tuple(Goal(position=rounded(g)) for g in goals),
        obstacles=tuple(obstacles), tether_length=1e6, clearance=clearance, bounds=bounds,
    )  # fmt: skip
    flat = ContactGraph(build_outline(problem)).lengths([0])[0]
    dz = problem.points[:, 2] - problem.points[0, 2]
    longest = float(np.hypot(flat, dz).max())
    if not math.isfinite(longest):
        raise ValueError(f"{name}: a goal is cut off")
    return problem.model_copy(update={"tether_length": round(share * longest, 1)})


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    names = []
    for recipe in recipes():
        problem = recipe.problem()
        names.append(recipe.name)
        (FOLDER / f"{recipe.name}.json").write_text(problem.to_json(), encoding="utf-8")
    assert len(set(names)) == len(names)
    print(f"{len(names)} problems in {FOLDER.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
