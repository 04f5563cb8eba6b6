"""Random worlds by the papers' recipes and others, the same on every machine.

All draws come from `random.Random`, whose `random()` is guaranteed to give the same sequence for
the same seed in every version of Python; numpy draws nothing. Draws are only added, scaled and
compared, and square roots taken of them, all of which IEEE 754 rounds correctly. (Which goals are
in reach is decided by lengths of arcs: a platform whose sine differs in the last bit could decide
otherwise for a goal at the very end of the tether.)
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator

import numpy as np

from netsp.base.errors import InputError
from netsp.model.problem import Circle, Goal, Obstacle, Polygon, Problem

Place = tuple[float, float]
Draw = Callable[[random.Random, int, float, tuple[float, float]], list[Obstacle]]

MAX_DRAWS = 20_000
"""Format of random worlds: draws after which a world is too full. With another number, a seed would
give another world."""

MIN_GAP_SHARE = 1e-3
"""Format of random worlds: minimum gap between obstacles, as a share of the side."""

MAX_COUNT = 10_000
"""Format limit of random worlds: goals, and obstacles."""


class DoesNotFitError(InputError):
    """A draw that left no room for an obstacle or a goal; another draw may."""


def icra2017(
    draw: random.Random, count: int, side: float, radii: tuple[float, float]
) -> list[Obstacle]:
    """Draw disjoint circles anywhere, radii uniform between two limits.

    Source: McCammon & Hollinger 2017, section V-A; the paper gives no radii.
    """

    def candidates() -> Iterator[tuple[float, float, float]]:
        while True:
            x, y = draw.random() * side, draw.random() * side
            yield x, y, _radius(draw, radii)

    return _circles(candidates(), count, side)


def clustered(
    draw: random.Random, count: int, side: float, radii: tuple[float, float]
) -> list[Obstacle]:
    """Draw circles around three to five centres, dense within and open water between."""
    centers = [
        (side * (0.15 + 0.7 * draw.random()), side * (0.15 + 0.7 * draw.random()))
        for _ in range(3 + int(3 * draw.random()))
    ]
    spread = 0.45 * side

    def candidates() -> Iterator[tuple[float, float, float]]:
        while True:
            x, y = centers[int(len(centers) * draw.random())]
            # three uniform draws: a bell without a logarithm, so the same on every machine
            dx, dy = (spread * (sum(draw.random() for _ in range(3)) / 3.0 - 0.5) for _ in "xy")
            r = _radius(draw, radii)
            if 0.0 <= x + dx <= side and 0.0 <= y + dy <= side:
                yield x + dx, y + dy, r

    return _circles(candidates(), count, side)


def array(
    draw: random.Random, count: int, side: float, radii: tuple[float, float]
) -> list[Obstacle]:
    """Draw circles of one radius in staggered rows, each a little off its place.

    Arrays of wave-energy converters look like this (Beels et al. 2010, as in the 2016 paper).
    """
    radius = _radius(draw, radii)
    rows = max(1, math.isqrt(count))
    columns = -(-count // rows)
    pitch, row_pitch = side / (columns + 0.5), side / rows
    max_offset = 0.5 * min(pitch, row_pitch) - radius - MIN_GAP_SHARE * side
    if max_offset <= 0.0:
        raise DoesNotFitError(
            f"obstacles: {count} circles of radius {radius:.3g} do not fit into rows in a square "
            f"of side {side:g}"
        )
    max_offset = min(max_offset, 0.15 * pitch)
    out: list[Obstacle] = []
    for k in range(count):
        row, column = divmod(k, columns)
        x = pitch * (column + 0.5 + 0.5 * (row % 2)) + max_offset * (2.0 * draw.random() - 1.0)
        y = row_pitch * (row + 0.5) + max_offset * (2.0 * draw.random() - 1.0)
        out.append(Circle(center=(x, y), radius=radius))
    return out


def harbour(
    draw: random.Random, count: int, side: float, radii: tuple[float, float]
) -> list[Obstacle]:
    """Draw polygons: piers from the southern edge, and barges at any angle in the basin."""
    piers = min(max(1, count // 4), 6)
    out: list[Obstacle] = []
    for k in range(min(piers, count)):
        width = (0.02 + 0.03 * draw.random()) * side
        length = (0.15 + 0.35 * draw.random()) * side
        x = side * (k + 0.2 + 0.6 * draw.random()) / piers
        x = min(max(x, 0.5 * width), side - 0.5 * width)
        out.append(_rectangle((x, 0.5 * length), (1.0, 0.0), 0.5 * width, 0.5 * length))
    for _ in range(MAX_DRAWS):
        if len(out) >= count:
            return out
        place = (draw.random() * side, draw.random() * side)
        half = _radius(draw, radii)
        long = half * (1.0 + 2.0 * draw.random())
        # a rotation by rational numbers: no sine that could differ between machines
        t = 2.0 * draw.random() - 1.0
        barge = _rectangle(
            place, ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t)), long, half
        )
        if all(_apart(barge, other, MIN_GAP_SHARE * side) for other in out):
            out.append(barge)
    raise DoesNotFitError(f"obstacles: {count} polygons do not fit into a square of side {side:g}")


def _radius(draw: random.Random, radii: tuple[float, float]) -> float:
    return radii[0] + draw.random() * (radii[1] - radii[0])


FAMILIES: dict[str, Draw] = {
    "icra2017": icra2017,
    "rss2016": icra2017,
    "clustered": clustered,
    "array": array,
    "harbour": harbour,
}
"""Functions that draw obstacles, by name.

They take a generator of random numbers, the number of obstacles, the side of the square, and the
minimum and maximum radius (of a barge: half its width). `rss2016` draws 5 to 10 obstacles and goals
if it is not told how many (McCammon & Hollinger 2016, section IV-A).
"""


def random_world(
    seed: int,
    *,
    family: str = "icra2017",
    goals: int | None = None,
    obstacles: int | tuple[int, int] | None = None,
    tether_length: float = 300.0,
    side: float = 500.0,
    radii: tuple[float, float] = (10.0, 30.0),
    attempt: int = 0,
) -> Problem:
    """Return a world of a family: obstacles, a random base, and goals within reach of the tether.

    All lengths are in the units of the problem.

    Parameters
    ----------
    seed : int
        Seed of all draws.
    family : str
        One of `FAMILIES`.
    goals : int, optional
        Number of goals; by default 20, in `rss2016` 5 to 10.
    obstacles : int or (int, int), optional
        Number of obstacles, or its minimum and maximum (inclusive), between which it is drawn
        uniformly; by default 20, in `rss2016` 5 to 10. Studies of the 2017 paper, which has "up to
        20", draw 1 to 20.
    tether_length : float
        Length of the tether.
    side : float
        Side of the square.
    radii : tuple of float
        Minimum and maximum radius of the obstacles.
    attempt : int
        Number of the world among the worlds of the seed, from 0; for when one does not fit.

    Raises
    ------
    InputError
        An unknown family, numbers out of range.
    DoesNotFitError
        The obstacles, the base or the goals do not fit.
    """
    _check(family, goals, obstacles, tether_length, side, radii)
    # text is hashed by Python into a seed of its own, the same in every version
    draw = random.Random(seed if attempt == 0 else f"{seed}/{attempt}")
    obstacles, goals = _counts(draw, family, obstacles, goals)

    def place() -> Place:
        x = draw.random() * side
        return x, draw.random() * side

    shapes = FAMILIES[family](draw, obstacles, side, radii)

    def free(x: float, y: float) -> bool:
        return not any(_holds(shape, x, y) for shape in shapes)

    base = next((p for _ in range(MAX_DRAWS) if free(*(p := place()))), None)
    if base is None:
        raise DoesNotFitError("obstacles: no room for the base")

    def world(places: list[Place]) -> Problem:
        return Problem(
            name=f"{family}-{seed}" if family != "icra2017" else f"random-{seed}",
            base=(*base, 0.0),
            goals=tuple(Goal(position=(x, y, 0.0)) for x, y in places),
            obstacles=tuple(shapes),
            tether_length=tether_length,
        )

    found: list[Place] = []
    for _ in range(MAX_DRAWS // 100):
        drawn = [place() for _ in range(4 * goals)]
        drawn = [p for p in drawn if free(*p) and math.dist(p, base) <= tether_length]
        for batch in (drawn[: 2 * goals], drawn[2 * goals :]):
            if batch and len(found) < goals:
                reach = _reach(world(batch))
                found += [p for p, d in zip(batch, reach, strict=True) if d <= tether_length]
        if len(found) >= goals:
            return world(found[:goals])
    raise DoesNotFitError(
        f"goals: only {len(found)} of {goals} places within reach of the tether found"
    )


def _counts(
    draw: random.Random, family: str, obstacles: int | tuple[int, int] | None, goals: int | None
) -> tuple[int, int]:
    """Return the numbers of obstacles and of goals, drawn where they are not given."""
    if obstacles is None:
        obstacles = (5, 10) if family == "rss2016" else 20
    if isinstance(obstacles, tuple):
        low, high = obstacles
        obstacles = low + int((high - low + 1) * draw.random())
    if goals is None:
        goals = 5 + int(6 * draw.random()) if family == "rss2016" else 20
    return obstacles, goals


def reachable_world(seed: int, *, max_worlds: int = 50, **recipe: object) -> tuple[Problem, int]:
    """Return the first world of a seed that fits.

    Parameters
    ----------
    seed : int
        Seed of all draws.
    max_worlds : int
        Maximum number of worlds that are drawn.
    **recipe : object
        Arguments of `random_world`.

    Returns
    -------
    world : Problem
        The world.
    drawn : int
        Number of unreachable worlds drawn before it.

    Raises
    ------
    InputError
        None of `max_worlds` worlds fits, or an argument is wrong, whatever is drawn.
    """
    for attempt in range(max_worlds):
        try:
            return random_world(seed, attempt=attempt, **recipe), attempt  # type: ignore[arg-type]
        except DoesNotFitError:
            if attempt == max_worlds - 1:
                raise
    raise AssertionError("unreachable")


def _check(
    family: str,
    goals: int | None,
    obstacles: int | tuple[int, int] | None,
    tether_length: float,
    side: float,
    radii: tuple[float, float],
) -> None:
    if family not in FAMILIES:
        raise InputError(f"family: unknown {family!r}; expected one of {', '.join(FAMILIES)}")
    if goals is not None and not 1 <= goals <= MAX_COUNT:
        raise InputError(f"world: goals: expected 1 to {MAX_COUNT}, got {goals}")
    low, high = obstacles if isinstance(obstacles, tuple) else (obstacles or 0, obstacles or 0)
    for count in (low, high):
        if not 0 <= count <= MAX_COUNT:
            raise InputError(f"world: obstacles: expected 0 to {MAX_COUNT}, got {count}")
    if low > high:
        raise InputError(f"world: obstacles: expected minimum <= maximum, got {low} and {high}")
    for name, value in (("tether_length", tether_length), ("side", side), ("radii", radii[1])):
        if not 0.0 < value <= 1e11:
            raise InputError(f"world: {name}: expected more than 0 and at most 1e11, got {value:g}")
    if not 0.0 < radii[0] <= radii[1]:
        raise InputError(
            f"world: radii: expected 0 < minimum <= maximum, got {radii[0]:g} and {radii[1]:g}"
        )


def _circles(
    candidates: Iterator[tuple[float, float, float]], count: int, side: float
) -> list[Obstacle]:
    """Return circles of the first candidates that keep the minimum gap, `count` of them."""
    taken: list[tuple[float, float, float]] = []
    for _ in range(MAX_DRAWS):
        if len(taken) == count:
            return [Circle(center=(x, y), radius=r) for x, y, r in taken]
        x, y, r = next(candidates)
        gap = r + MIN_GAP_SHARE * side
        if all(math.hypot(x - a, y - b) > q + gap for a, b, q in taken):
            taken.append((x, y, r))
    raise DoesNotFitError(f"obstacles: {count} circles do not fit into a square of side {side:g}")


def _rectangle(center: Place, along: Place, long: float, half: float) -> Polygon:
    """Return the rectangle of half lengths `long` along a unit vector and `half` across it."""
    (x, y), (c, s) = center, along
    corners = ((-long, -half), (long, -half), (long, half), (-long, half))
    return Polygon(polygon=tuple((x + a * c - b * s, y + a * s + b * c) for a, b in corners))


def _holds(shape: Obstacle, x: float, y: float) -> bool:
    """Return whether a circle or a convex polygon covers a point; its boundary counts."""
    if isinstance(shape, Circle):
        return math.hypot(x - shape.center[0], y - shape.center[1]) <= shape.radius
    corners = shape.polygon
    turns = [
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)
    ]
    return all(t >= 0.0 for t in turns) or all(t <= 0.0 for t in turns)


def _apart(shape: Polygon, other: Obstacle, gap: float) -> bool:
    """Return whether an edge of one of two convex polygons separates them by more than a gap."""
    assert isinstance(other, Polygon)
    for one, two in ((shape.polygon, other.polygon), (other.polygon, shape.polygon)):
        for a, b in zip(one, (*one[1:], one[0]), strict=True):
            nx, ny = b[1] - a[1], a[0] - b[0]
            size = math.sqrt(nx * nx + ny * ny)
            projected = [nx * p[0] + ny * p[1] for p in one]
            other_projected = [nx * p[0] + ny * p[1] for p in two]
            if (
                min(other_projected) - max(projected) > gap * size
                or min(projected) - max(other_projected) > gap * size
            ):
                return True
    return False


def _reach(problem: Problem) -> list[float]:
    """Return the length of the shortest tether that reaches each goal."""
    from netsp.roadmap.outline import build_outline
    from netsp.roadmap.shortest import ContactGraph

    planar = ContactGraph(build_outline(problem)).lengths([0])[0]
    dz = problem.points[:, 2] - problem.points[0, 2]
    return [float(d) for d in np.hypot(planar, dz)[1:]]
