"""Worlds of boxes in whole numbers, and a brute force in whole numbers: no rounding decides a word.

Boxes are grown by one `GRAIN` with square corners, so that what touches is closed, as in the
roadmap. Shares no code with the roadmap.
"""

from __future__ import annotations

import heapq
import itertools
import math

import numpy as np

from netsp import Polygon, Problem
from netsp.base.errors import InputError
from netsp.hsignature import Word, concatenate, invert

UNIT = 2_000_000_000
"""Grains of a unit: halves, which representative points of boxes are at, are whole, too."""

AROUND = [(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)]
"""The grains around a place."""

Point = tuple[int, int]


class WholeNumbers:
    """Shortest lengths by class, as `tests.brute.BruteForce` has them."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.boxes = []
        for o in problem.obstacles:
            x, y = np.array(o.polygon).T
            low = int(x.min() * UNIT) - 1, int(y.min() * UNIT) - 1
            self.boxes.append((*low, int(x.max() * UNIT) + 1, int(y.max() * UNIT) + 1))
        self.rays = [(int(x * UNIT), int(y * UNIT)) for x, y in problem.representative_points]
        places = [(int(x * UNIT), int(y * UNIT)) for x, y in problem.points[:, :2]]
        corners = {
            p for a, b, c, d in self.boxes for p in ((a, b), (c, b), (c, d), (a, d))
            if not self.inside(p)
        }  # fmt: skip
        self.points: list[Point] = [*places, *sorted(corners)]
        # where a place on an outline stands free
        self.stands = [self.free_around(p) for p in places] + [[p] for p in sorted(corners)]
        n = len(self.points)
        self.near: list[list[tuple[int, float, Word]]] = [[] for _ in range(n)]
        for a, b in itertools.combinations(range(n), 2):
            if any(self.sees(p, q) for p in self.stands[a] for q in self.stands[b]):
                word = self.letters(self.points[a], self.points[b])
                d = math.dist(self.points[a], self.points[b]) / UNIT
                self.near[a].append((b, d, word))
                self.near[b].append((a, d, invert(word)))

    def inside(self, p: Point) -> bool:
        return any(a < p[0] < c and b < p[1] < d for a, b, c, d in self.boxes)

    def free_around(self, p: Point) -> list[Point]:
        """The place itself, or the grains around it that are free."""
        if not self.inside(p):
            return [p]
        around = [(p[0] + i, p[1] + j) for i, j in AROUND]
        return [q for q in around if not self.inside(q)]

    def pinched(self, k: int) -> bool:
        """Return whether a place lies between two boxes that touch there, so that it has two
        sides."""
        p = self.points[k]
        free = [not self.inside((p[0] + i, p[1] + j)) for i, j in AROUND]
        return sum(free[j] and not free[j - 1] for j in range(8)) > 1

    def sees(self, p: Point, q: Point) -> bool:
        """Return whether the segment avoids the inside of all boxes."""
        for a, b, c, d in self.boxes:
            if max(p[0], q[0]) <= a or min(p[0], q[0]) >= c:
                continue
            if max(p[1], q[1]) <= b or min(p[1], q[1]) >= d:
                continue
            side = [
                (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])
                for x, y in ((a, b), (c, b), (c, d), (a, d))
            ]
            if min(side) < 0 < max(side):
                return False
        return True

    def letters(self, p: Point, q: Point) -> Word:
        """The rays that a segment crosses, in order."""
        out = []
        step = 1 if q[0] > p[0] else -1
        for i, (x, y) in enumerate(self.rays):
            if (p[0] >= x) == (q[0] >= x):
                continue
            across = (p[1] - y) * (q[0] - p[0]) + (x - p[0]) * (q[1] - p[1])
            if across * step > 0:
                out.append((x * step, i * step, step * (i + 1)))
        return tuple(letter for _, _, letter in sorted(out))

    def lengths(self, source: int, limit: float, repeats: int = 8) -> dict[tuple[int, Word], float]:
        """Shortest length of every class from a point to every other, up to the limit; words that
        repeat a signed letter more than `repeats` times are not followed."""
        goals = len(self.problem.points)
        best: dict[tuple[int, Word], float] = {(source, ()): 0.0}
        queue = [(0.0, source, ())]
        while queue:
            d, v, word = heapq.heappop(queue)
            if d > best[v, word]:
                continue
            for w, step, letters in self.near[v]:
                onward = concatenate(word, letters)
                if any(onward.count(a) > repeats for a in set(onward)):
                    continue
                if d + step <= limit and d + step < best.get((w, onward), math.inf) - 1e-12:
                    best[w, onward] = d + step
                    heapq.heappush(queue, (d + step, w, onward))
        return {k: d for k, d in best.items() if k[0] < goals}


def whole_number_world(seed: int) -> Problem | None:
    """Boxes that are apart, touch, share corners or overlap, with base and goals on corners, edges
    and rays; None if a place is inside a box or has two sides."""
    rng = np.random.default_rng(seed)
    boxes = []
    for _ in range(int(rng.integers(1, 5))):
        x, y = rng.integers(0, 8, 2)
        w, h = rng.integers(1, 4, 2)
        boxes.append([(x, y), (x + w, y), (x + w, y + h), (x, y + h)])
        if rng.random() < 0.4:  # one more that shares an edge or a corner with it
            dx, dy = [(w, 0), (0, h), (w, h), (-w, h)][rng.integers(4)]
            boxes.append([(px + dx, py + dy) for px, py in boxes[-1]])
    places: list[tuple[int, int]] = []
    while len(places) < 3:
        box = boxes[rng.integers(len(boxes))]
        kind = rng.integers(4)
        if kind == 0:
            p = box[rng.integers(4)]
        elif kind == 1:
            p = (rng.integers(box[0][0], box[1][0] + 1), box[rng.choice([0, 2])][1])
        elif kind == 2:
            p = ((box[0][0] + box[1][0]) / 2, rng.integers(-1, 12))
        else:
            p = tuple(rng.integers(-1, 12, 2))
        places.append((float(p[0]), float(p[1])))
    try:
        problem = Problem(
            base=places[0], goals=places[1:], tether_length=float(rng.uniform(6.0, 20.0)),
            obstacles=[Polygon(polygon=[(float(x), float(y)) for x, y in box]) for box in boxes],
        )  # fmt: skip
    except (ValueError, InputError):
        return None
    brute = WholeNumbers(problem)
    if any(not brute.stands[k] or brute.pinched(k) for k in range(3)):
        return None
    return problem
