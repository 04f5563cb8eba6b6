"""Classes and legs among walls with hooks, against a brute force that prunes no word.

    python benchmarks/hooked_walls.py [--worlds 240] [--seed 0] [--no-brute-force]

Rooms, spirals, combs, hooks, harbours with moles, and slanted bars, with posts between them, in any
orientation. A visibility graph is searched with words (tests/brute.py), without any rule of what a
taut path may do. It must find the same classes, and each leg as long as the search for its word
does. Whole-number worlds follow, with base and goals on corners and edges of boxes and on rays;
theirs is a brute force in whole numbers, so that no rounding decides a word. Without the brute
force every leg must be found by the search, and be as long as in the matrix.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from table import head, heading, row

sys.path.insert(0, str(Path(__file__).parent.parent))

from netsp import Circle, Polygon, Problem
from netsp.base.errors import InfeasibleError, InputError, NetspError
from netsp.hsignature import Word
from netsp.roadmap.taut import TautRoadmap
from tests.brute import BruteForce
from tests.whole_numbers import WholeNumbers, whole_number_world

TOLERANCE = 1e-5
"""Largest difference of two equal lengths, in units of worlds about ten units wide."""

MAX_CLASSES = 25
"""Largest number of classes of a world; a world with more gets a shorter tether, so that the brute
force ends."""

MAX_REPEATS = 40
"""Largest number of turns about an obstacle in the brute force, more than the tethers here
allow."""

Ring = list[tuple[float, float]]


def room(rng: np.random.Generator) -> list[Ring]:
    """A basin with a door somewhere, and a hook at one side of it, inside or outside."""
    w, h, t = rng.integers(5, 9), rng.integers(5, 9), rng.choice([0.5, 1.0])
    door = rng.uniform(0.3, 0.6) * (w - 2 * t - 1)
    gap = rng.uniform(0.6, 1.6)
    left, right = t + door, min(t + door + gap, w - t)
    ring = [(0, 0), (w, 0), (w, h), (right, h), (right, h - t), (w - t, h - t), (w - t, t), (t, t),
            (t, h - t), (left, h - t), (left, h), (0, h)]  # fmt: skip
    if rng.random() < 0.4:
        deep = rng.uniform(1.0, 0.6 * h)
        ring[9:10] = [(left - 0.4, h - t), (left - 0.4, h - t - deep), (left, h - t - deep)]
    return [[(float(x), float(y)) for x, y in ring]]


def thick(line: Ring, by: float) -> Ring:
    """A wall along a line."""
    wall = shapely.LineString(line).buffer(by / 2, cap_style="flat", join_style="mitre")
    if wall.geom_type != "Polygon" or len(wall.interiors):
        raise ValueError("the wall touches itself")
    return [(float(x), float(y)) for x, y in wall.exterior.coords[:-1]]


def spiral(rng: np.random.Generator) -> list[Ring]:
    """A wall that winds inwards."""
    step, turns = rng.uniform(1.0, 1.6), int(rng.integers(4, 9))
    line, at, long = [(0.0, 0.0)], np.zeros(2), step * (turns // 2 + 1)
    for k in range(turns):
        at = at + long * np.array([(1, 0), (0, 1), (-1, 0), (0, -1)][k % 4])
        line.append((float(at[0]), float(at[1])))
        long -= step / 2 if k % 2 else 0.0
        if long < step:
            break
    return [thick(line, rng.uniform(0.1, 0.4))]


def comb(rng: np.random.Generator) -> list[Ring]:
    """A spine with teeth, some of them with a hook at the end."""
    lines = [[(0.0, 0.0), (8.0, 0.0)]]
    for x in np.linspace(0.5, 7.5, int(rng.integers(3, 6))):
        long, hook = rng.uniform(1.5, 4.0), rng.choice([-0.6, 0.0, 0.6])
        lines.append([(x, 0.0), (x, long)] + ([(x + hook, long)] if hook else []))
    walls = [shapely.LineString(line).buffer(0.12, cap_style="flat", join_style="mitre")
             for line in lines]  # fmt: skip
    ring = shapely.union_all(walls)
    return [[(float(x), float(y)) for x, y in ring.exterior.coords[:-1]]]


def hook(rng: np.random.Generator) -> list[Ring]:
    """Two walls of three to five pieces each, at right angles or not."""
    rings = []
    while len(rings) < 2:
        at, turn = rng.uniform(1, 8, 2), rng.uniform(0, 2 * np.pi)
        line = [at]
        for _ in range(int(rng.integers(2, 5))):
            turn += rng.choice([-1, 1, 1]) * rng.choice([np.pi / 2, rng.uniform(0.7, 2.0)])
            at = at + rng.uniform(1.0, 4.0) * np.array([np.cos(turn), np.sin(turn)])
            line.append(at)
        if shapely.LineString(line).is_simple:
            try:
                rings.append(thick([(float(x), float(y)) for x, y in line], 0.3))
            except ValueError:
                continue
    return rings


def harbour(rng: np.random.Generator) -> list[Ring]:
    """A quay, and two moles from it that nearly meet, each with a bent head."""
    a, b = rng.uniform(2.0, 3.5), rng.uniform(4.5, 6.5)
    left = [(0.0, 0.0), (0.0, b), (a, b + rng.uniform(-1, 1))]
    right = [(9.0, 0.0), (9.0, b), (a + rng.uniform(0.6, 1.5), b + rng.uniform(-0.5, 2.0))]
    for mole, way in ((left, 1.0), (right, -1.0)):
        x, y = mole[-1]
        mole.append((x + way * rng.uniform(-0.5, 0.3), y + rng.uniform(-2.0, -0.8)))
    quay = [(0.0, 0.0), (9.0, 0.0)]
    if rng.random() < 0.5:
        return [thick([*left[::-1], *quay, *right], 0.3)]
    return [thick(left, 0.3), thick(right, 0.3), thick([(0.3, 0.0), (8.7, 0.0)], 0.3)]


def bars(rng: np.random.Generator) -> list[Ring]:
    """Return long slanted bars and triangles: convex, but the part beyond a ray reaches far
    below."""
    rings: list[Ring] = []
    for _ in range(int(rng.integers(2, 5))):
        x, y = rng.uniform(1, 9, 2)
        turn, long = rng.uniform(0, np.pi), rng.uniform(2.0, 7.0)
        dx, dy = long * math.cos(turn), long * math.sin(turn)
        if rng.random() < 0.5:
            rings.append(thick([(x, y), (x + dx, y + dy)], 0.2))
        else:
            rings.append([(x, y), (x + dx, y + dy), (x + dx / 2 - dy / 4, y + dy / 2 + dx / 4)])
    return rings


FAMILIES: dict[str, Callable[[np.random.Generator], list[Ring]]] = {
    "rooms": room, "spirals": spiral, "combs": comb, "hooks": hook, "harbours": harbour,
    "bars": bars,
}  # fmt: skip


def hooked_world(family: str, seed: int) -> Problem | None:
    """A world of a family; None if the draw is no problem."""
    rng = np.random.default_rng([sorted(FAMILIES).index(family), seed])
    rings = FAMILIES[family](rng)
    turn = rng.integers(4) * np.pi / 2 if rng.random() < 0.6 else rng.uniform(0, 2 * np.pi)
    flip = rng.choice([-1.0, 1.0])

    def placed(xy: Ring) -> Ring:
        c, s = math.cos(turn), math.sin(turn)
        return [(round(flip * (c * x - s * y), 4), round(s * x + c * y, 4)) for x, y in xy]

    obstacles: list[Circle | Polygon] = []
    try:
        obstacles += [Polygon(polygon=placed(ring)) for ring in rings]
    except (InputError, ValueError):
        return None
    solid = shapely.union_all([o.shape() for o in obstacles])
    low, high = np.array(solid.bounds[:2]), np.array(solid.bounds[2:])

    def clear(distance: float) -> tuple[float, float] | None:
        for _ in range(100):
            p = np.round(rng.uniform(low - 1.0, high + 1.0), 2)
            if solid.distance(shapely.Point(p)) > distance:
                return float(p[0]), float(p[1])
        return None

    for _ in range(int(rng.integers(1, 4))):
        at, r = clear(0.55), round(rng.uniform(0.15, 0.5), 2)
        if at is not None:
            x, y = at
            post = [(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r)]
            obstacles.append(Polygon(polygon=post))
            solid = solid.union(shapely.Polygon(post))
    places = [clear(0.05) for _ in range(3)]
    if None in places:
        return None
    return Problem(
        base=places[0], goals=places[1:], obstacles=obstacles,
        tether_length=float(rng.uniform(6.0, 18.0)),
    )  # fmt: skip


@dataclass
class Outcome:
    """Result for a world.

    Attributes
    ----------
    classes, legs
        How many were compared.
    wrong
        What is wrong first; empty if nothing is.
    """

    classes: int = 0
    legs: int = 0
    wrong: str = ""


def roadmap_of(problem: Problem) -> TautRoadmap | None:
    """The roadmap with a tether short enough for `MAX_CLASSES`; None if no goal can be reached."""
    tether = problem.tether_length
    for _ in range(12):
        try:
            roadmap = TautRoadmap(problem.model_copy(update={"tether_length": tether}))
        except InfeasibleError as error:
            needed = str(error).rsplit(" ", 1)[1]
            try:
                tether = 1.0001 * float(needed)
            except ValueError:
                return None
            continue
        if len(roadmap.cluster) <= MAX_CLASSES:
            return roadmap
        tether *= 0.9
    return None


def compared(roadmap: TautRoadmap, brute: BruteForce | WholeNumbers | None) -> Outcome:
    """Compare all classes, and all legs, with those of a brute force, if there is one."""
    out = Outcome()
    limit = roadmap.problem.tether_length
    slack = TOLERANCE * max(1.0, roadmap.problem.scale / 10.0)
    exact = {
        (int(g), w): float(d)
        for g, w, d in zip(roadmap.cluster, roadmap.signatures, roadmap.planar, strict=True)
        if g > 0
    }
    out.classes = len(exact)
    found = exact
    if brute is not None:
        found = {k: d for k, d in brute.lengths(0, limit + slack, MAX_REPEATS).items() if k[0]}
    for k, d in exact.items():
        if k not in found or abs(found[k] - d) > slack:
            out.wrong = f"class {k}: {d} and by brute force {found.get(k)}"
            return out
    for k, d in found.items():
        if d < limit - slack and k not in exact:
            out.wrong = f"class {k} of {d} is missing"
            return out
    us, vs = np.nonzero((roadmap.cluster[:, None] == 1) & (roadmap.cluster[None] == 2))
    legs, worst = {}, 0.0
    for u, v in zip(us.tolist(), vs.tolist(), strict=True):
        word = roadmap.legs.relative_word(u, v)
        most = float(roadmap.planar[u] + roadmap.planar[v])
        sought = roadmap.paths._search_word(1, 2, word, most)
        legs[u, v] = None if sought is None else sought[0]
        worst = max(worst, most if sought is None else sought[0])
    true: dict[tuple[int, Word], float] = {}
    if brute is not None:
        true = brute.lengths(1, worst + slack, MAX_REPEATS)
    for (u, v), length in legs.items():
        out.legs += 1
        want = true.get((2, roadmap.legs.relative_word(u, v)))
        if length is None:
            out.wrong = f"no leg of {roadmap.legs.relative_word(u, v)}; by brute force {want}"
            return out
        if brute is not None and (want is None or abs(want - length) > slack):
            out.wrong = f"leg {roadmap.legs.relative_word(u, v)}: {length}, by brute force {want}"
            return out
    try:
        costs = roadmap.to_travel_graph().costs
    except NetspError as error:
        out.wrong = str(error)
        return out
    for (u, v), length in legs.items():
        if length is not None and abs(costs[u, v] - length) > slack:
            out.wrong = f"leg {roadmap.legs.relative_word(u, v)} in the matrix: {costs[u, v]}"
    return out


def trials(worlds: int, seed: int, brute: bool) -> Iterator[tuple[str, int, Outcome]]:
    """Family, seed and outcome of each world."""
    for family in FAMILIES:
        for k in range(seed, seed + -(-worlds // len(FAMILIES))):
            try:
                problem = hooked_world(family, k)
            except (ValueError, InputError):
                continue
            roadmap = None if problem is None else roadmap_of(problem)
            if roadmap is not None:
                force = BruteForce(roadmap.problem) if brute else None
                yield family, k, compared(roadmap, force)
    for k in range(seed, seed + worlds):
        problem = whole_number_world(k)
        roadmap = None if problem is None else roadmap_of(problem)
        if roadmap is not None:
            force = WholeNumbers(roadmap.problem) if brute else None
            yield "whole numbers", k, compared(roadmap, force)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--worlds", type=int, default=240, help="of each of both kinds")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-brute-force", action="store_true")
    args = parser.parse_args()
    worlds, classes, legs, wrong = Counter(), Counter(), Counter(), Counter()
    for family, seed, outcome in trials(args.worlds, args.seed, not args.no_brute_force):
        worlds[family] += 1
        classes[family] += outcome.classes
        legs[family] += outcome.legs
        if outcome.wrong:
            wrong[family] += 1
            print(f"{family}, seed {seed}: {outcome.wrong}", flush=True)
    heading("Walls with hooks and whole-number worlds")
    head("family", "worlds", "classes", "legs", "worlds that differ")
    for family in worlds:
        row(family, worlds[family], classes[family], legs[family], wrong[family])


if __name__ == "__main__":
    main()
