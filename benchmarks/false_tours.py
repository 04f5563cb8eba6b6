"""False tours of many kinds, each false by construction, and worlds to make them in.

Each kind is a function of a problem and a right solution of it; it returns a problem and a solution
with one thing wrong, or None where this world has no such tour. What is wrong is known without the
judge: a spur is straight, so its end is as far from the base as it is drawn; a point in an obstacle
is there by its signed distance; everything else is one stated value.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from netsp import Circle, Polygon, Problem, Solution, Status
from netsp.base.errors import InputError
from netsp.model.solution import ProblemReference

Pair = tuple[Problem, Solution]
Kind = Callable[[Problem, Solution, np.random.Generator], Pair | None]
KINDS: dict[str, Kind] = {}

OFF = 1e-5
"""Distance by which a place is missed or a length misstated, as a share of the size: a hundred
tolerances."""


def kind(name: str) -> Callable[[Kind], Kind]:
    """Return a decorator that enters a function as a kind."""

    def enter(function: Kind) -> Kind:
        KINDS[name] = function
        return function

    return enter


def edit(solution: Solution, **changes: object) -> Solution:
    """Return a copy with other values, unchecked."""
    return solution.model_copy(update=changes)


def visit(solution: Solution, k: int, **changes: object) -> Solution:
    """Return a copy in which one visit has other values."""
    tour = list(solution.tour)
    tour[k] = tour[k].model_copy(update=changes)
    return edit(solution, tour=tuple(tour))


def drawn(solution: Solution, path: np.ndarray) -> Solution:
    """Return a copy with another path and its length, without a bound."""
    length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    return edit(
        solution, path=tuple(map(tuple, path.tolist())), length=length, lower_bound=None,
        lower_bound_of=None, gap=None, status=Status.FEASIBLE,
    )  # fmt: skip


def of_problem(problem: Problem, solution: Solution, **changes: object) -> Pair | None:
    """Return the solution as one of a problem with other values; None if that is no problem."""
    fields = {name: getattr(problem, name) for name in Problem.model_fields}
    try:
        other = Problem(**{**fields, **changes})
    except InputError:
        return None
    return other, edit(solution, problem=ProblemReference(name="x", sha256=other.sha256))


def spur(solution: Solution, end: np.ndarray, at: int = 0) -> Solution:
    """Return a copy whose path goes straight to a place and back from one of its points."""
    path = np.array(solution.path)
    return drawn(solution, np.insert(path, at + 1, [end, path[at]], axis=0))


def room(problem: Problem, xy: np.ndarray) -> float:
    """Return how far points stay from all obstacles, less the clearance."""
    far = [float(np.min(o.signed_distance(xy))) for o in problem.obstacles]
    return min(far, default=math.inf) - problem.clearance


def free_end(problem: Problem, rng: np.random.Generator, far: float) -> np.ndarray | None:
    """Return a place so far from the base, straight through free space; None if none is found."""
    base = np.array(problem.base)
    for _ in range(12):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        end = base + far * np.array([math.cos(angle), math.sin(angle), 0.0])
        line = base + np.linspace(0.0, 1.0, 400)[:, None] * (end - base)
        low, high = (problem.bounds or (-math.inf,) * 2 + (math.inf,) * 2)[:2], problem.bounds
        if high is not None and ((line[:, :2] < low) | (line[:, :2] > high[2:])).any():
            continue
        if room(problem, line[1:, :2]) > 0.01 * problem.scale:
            return end
    return None


def into_obstacle(problem: Problem, depth: float) -> np.ndarray | None:
    """Return a place so deep in an obstacle, the first on a straight line from the base."""
    base = np.array(problem.base[:2])
    for o in problem.obstacles:
        step = np.array(o.representative_point) - base
        share = np.linspace(0.0, 1.0, 2001)[1:]
        inside = [room(problem, base + s * step) < -depth for s in share]
        if True in inside and math.hypot(*step) < 0.9 * problem.tether_length:
            k = inside.index(True)
            low, high = share[k] - 1.0 / 2000.0, share[k]
            for _ in range(60):
                middle = 0.5 * (low + high)
                deep = room(problem, base + middle * step) < -depth
                low, high = (low, middle) if deep else (middle, high)
            return np.array([*(base + high * step), problem.base[2]])
    return None


def spur_kind(name: str, share: float) -> None:
    """Enter spurs from the base that are longer than the tether."""

    @kind(name)
    def _(problem: Problem, solution: Solution, rng: np.random.Generator) -> Pair | None:
        end = free_end(problem, rng, share * problem.tether_length)
        return None if end is None else (problem, spur(solution, end))


for _name, _share in (
    ("spur 0.1 % beyond the tether", 1.001),
    ("spur 10 % beyond the tether", 1.1),
    ("spur of 1.9 tethers", 1.9),
):
    spur_kind(_name, _share)


@kind("dive at the base beyond the tether")
def _(problem, solution, rng):
    return problem, spur(solution, np.array(problem.base) - [0, 0, 1.001 * problem.tether_length])


@kind("dive at a goal beyond the tether")
def _(problem, solution, rng):
    first = solution.tour[0]
    place = problem.points[first.goal + 1]
    at = [k for k, p in enumerate(solution.path) if np.allclose(p, place, atol=1e-12)]
    low = place[2] - problem.base[2]
    deep = math.sqrt(max(problem.tether_length**2 - first.tether_length**2 + low**2, 0.0))
    down = place - [0.0, 0.0, low + 1.001 * deep + 0.001 * problem.scale]
    return (problem, spur(solution, down, at[0])) if at else None


def depth_kind(name: str, share: float) -> None:
    """Enter spurs that end in an obstacle."""

    @kind(name)
    def _(problem: Problem, solution: Solution, rng: np.random.Generator) -> Pair | None:
        end = into_obstacle(problem, share * problem.scale)
        return None if end is None else (problem, spur(solution, end))


for _name, _share in (
    ("1e-2 of the size into an obstacle", 1e-2),
    ("1e-3 of the size into an obstacle", 1e-3),
    ("1e-5 of the size into an obstacle", OFF),
):
    depth_kind(_name, _share)


@kind("within half the clearance")
def _(problem, solution, rng):
    if not problem.clearance:
        return None
    end = into_obstacle(problem, 0.5 * problem.clearance)
    return None if end is None else (problem, spur(solution, end))


@kind("through the middle of an obstacle")
def _(problem, solution, rng):
    for o in problem.obstacles:
        end = np.array([*o.representative_point, problem.base[2]])
        if np.linalg.norm(end - problem.base) < 0.9 * problem.tether_length:
            return problem, spur(solution, end)
    return None


@kind("corners cut off")
def _(problem, solution, rng):
    points = problem.points
    keep = [points[0], *(points[v.goal + 1] for v in solution.tour), points[0]]
    line = np.vstack([a + np.linspace(0, 1, 300)[:, None] * (b - a)
                      for a, b in pairwise(keep)])  # fmt: skip
    if room(problem, line[:, :2]) > -1e-3 * problem.scale:
        return None
    return problem, drawn(solution, np.array(keep))


@kind("a letter too many")
def _(problem, solution, rng):
    return problem, visit(solution, 0, signature=(*solution.tour[0].signature, 1))


@kind("another letter's sign")
def _(problem, solution, rng):
    word = solution.tour[0].signature
    return (problem, visit(solution, 0, signature=(-word[0], *word[1:]))) if word else None


@kind("no word where there is one")
def _(problem, solution, rng):
    worded = [k for k, v in enumerate(solution.tour) if v.signature]
    return (problem, visit(solution, worded[-1], signature=())) if worded else None


@kind("an unknown letter")
def _(problem, solution, rng):
    return problem, visit(solution, 0, signature=(len(problem.obstacles) + 1,))


@kind("tether overstated")
def _(problem, solution, rng):
    more = solution.tour[0].tether_length + OFF * problem.tether_length
    return problem, visit(solution, 0, tether_length=more)


@kind("tether understated")
def _(problem, solution, rng):
    less = solution.tour[-1].tether_length - OFF * problem.tether_length
    return (problem, visit(solution, -1, tether_length=less)) if less > 0.0 else None


@kind("tether stated as 0")
def _(problem, solution, rng):
    if solution.tour[0].tether_length == 0.0:  # a goal at the base
        return None
    return problem, visit(solution, 0, tether_length=0.0)


@kind("tether not a number")
def _(problem, solution, rng):
    return problem, visit(solution, 0, tether_length=math.nan)


@kind("a tether that is too short by a hundred-thousandth")
def _(problem, solution, rng):
    longest = max(v.tether_length for v in solution.tour)
    if longest == 0.0:  # every goal is at the base
        return None
    return of_problem(problem, solution, tether_length=longest * (1.0 - OFF))


@kind("slack that does not fit")
def _(problem, solution, rng):
    longest = max(v.tether_length for v in solution.tour)
    if longest == 0.0:
        return None
    slack = problem.tether_length / longest - 1.0 + 1e-3
    return (problem, edit(solution, slack=slack)) if slack <= 1.0 else None


@kind("friction beyond its limit")
def _(problem, solution, rng):
    for v in solution.tour:
        place = problem.points[v.goal + 1]
        if v.tether_length > (1.0 + 1e-4) * np.linalg.norm(place - problem.points[0]):
            return problem, edit(solution, friction=1.0, max_tension_ratio=1.0 + 1e-5)
    return None


@kind("a visit left out")
def _(problem, solution, rng):
    return problem, edit(solution, tour=solution.tour[1:])


@kind("a visit twice")
def _(problem, solution, rng):
    return problem, edit(solution, tour=(*solution.tour, solution.tour[0]))


@kind("a goal that does not exist")
def _(problem, solution, rng):
    return problem, visit(solution, 0, goal=len(problem.goals))


@kind("two visits swapped")
def _(problem, solution, rng):
    if len(solution.tour) < 2:
        return None
    a, b = solution.tour[0].goal, solution.tour[1].goal
    return problem, visit(visit(solution, 0, goal=b), 1, goal=a)


@kind("another place stated for a goal")
def _(problem, solution, rng):
    x, y, z = problem.goals[solution.tour[0].goal].position
    return problem, visit(solution, 0, position=(x + 1e-3 * problem.scale, y, z))


@kind("not in the order that is said to be kept")
def _(problem, solution, rng):
    order = [v.goal for v in solution.tour]
    return None if order == sorted(order) else (problem, edit(solution, kept_order=True))


@kind("a goal before the one that must come first")
def _(problem, solution, rng):
    if len(solution.tour) < 2:
        return None
    first, second = solution.tour[0].goal, solution.tour[1].goal
    goals = list(problem.goals)
    goals[second] = goals[second].model_copy(update={"name": "before"})
    goals[first] = goals[first].model_copy(update={"name": "later", "after": ("before",)})
    return of_problem(problem, solution, goals=goals)


@kind("two alternatives visited")
def _(problem, solution, rng):
    if len(problem.goals) < 2:
        return None
    goals = [g.model_copy(update={"choice": "one"} if k < 2 else {})
             for k, g in enumerate(problem.goals)]  # fmt: skip
    return of_problem(problem, solution, goals=goals)


@kind("a goal more in the problem")
def _(problem, solution, rng):
    end = free_end(problem, rng, 0.3 * problem.tether_length)
    return None if end is None else of_problem(problem, solution, goals=[*problem.goals, end])


@kind("path cut short")
def _(problem, solution, rng):
    if solution.path[-2] == solution.path[-1]:  # every goal is at the base, and the tour is a point
        return None
    return problem, drawn(solution, np.array(solution.path[:-1]))


def moved_kind(name: str, which: Callable[[Problem, Solution], list[int]], by: list[float]) -> None:
    """Enter paths some of whose points are moved."""

    @kind(name)
    def _(problem: Problem, solution: Solution, rng: np.random.Generator) -> Pair | None:
        path = np.array(solution.path)
        path[which(problem, solution)] += OFF * problem.scale * np.array(by)
        return problem, drawn(solution, path)


def at_first_goal(problem: Problem, solution: Solution) -> list[int]:
    """Return the points of the path at the first goal."""
    place = problem.points[solution.tour[0].goal + 1]
    away = np.linalg.norm(np.array(solution.path) - place, axis=1)
    return np.flatnonzero(away <= 1e-6 * problem.scale).tolist()


moved_kind("starts beside the base", lambda *_: [0], [1, 0, 0])
moved_kind("ends beside the base", lambda *_: [-1], [0, -1, 0])
moved_kind("ends above the base", lambda *_: [-1], [0, 0, 1])
moved_kind("passes beside a goal", at_first_goal, [-1, 0, 0])
moved_kind("passes above a goal", at_first_goal, [0, 0, 1])


@kind("length overstated")
def _(problem, solution, rng):
    more = 1.002 * solution.length
    if more == solution.length:  # of a tour that stands still
        return None
    return problem, edit(drawn(solution, np.array(solution.path)), length=more)


@kind("length understated")
def _(problem, solution, rng):
    less = (1.0 - OFF) * solution.length
    if less == solution.length:
        return None
    return problem, edit(drawn(solution, np.array(solution.path)), length=less)


@kind("bound above the length")
def _(problem, solution, rng):
    more = 1.01 * solution.length
    return problem, edit(solution, lower_bound=more, gap=1.0 - 1.01)


@kind("gap of other lengths")
def _(problem, solution, rng):
    return problem, edit(solution, lower_bound=0.9 * solution.length, gap=0.05)


@kind("bound without a gap")
def _(problem, solution, rng):
    return problem, edit(solution, lower_bound=0.9 * solution.length, gap=None)


@kind("optimal with a gap")
def _(problem, solution, rng):
    return problem, edit(
        solution, status=Status.OPTIMAL, lower_bound=0.9 * solution.length, gap=0.1
    )


@kind("infeasible with a tour")
def _(problem, solution, rng):
    return problem, edit(solution, status=Status.INFEASIBLE)


@kind("invalid with nothing wrong")
def _(problem, solution, rng):
    return problem, edit(drawn(solution, np.array(solution.path)), status=Status.INVALID)


def number_kind(name: str, field: str, value: float) -> None:
    """Enter solutions with a number that is none."""

    @kind(name)
    def _(problem: Problem, solution: Solution, rng: np.random.Generator) -> Pair | None:
        return problem, edit(solution, **{field: value})


number_kind("length not a number", "length", math.nan)
number_kind("bound not a number", "lower_bound", math.nan)
number_kind("gap not a number", "gap", math.nan)
number_kind("length infinite", "length", math.inf)


@kind("a point of the path not a number")
def _(problem, solution, rng):
    path = np.array(solution.path)
    path[len(path) // 2, 1] = math.nan
    return problem, edit(solution, path=tuple(map(tuple, path.tolist())))


@kind("another problem's hash")
def _(problem, solution, rng):
    return problem, edit(solution, problem=ProblemReference(name="x", sha256="0" * 64))


@kind("obstacles stated as entangled")
def _(problem, solution, rng):
    return problem, edit(solution, entangled=(0,))


@kind("a tether at the start of a tour from the base")
def _(problem, solution, rng):
    return problem, edit(solution, start_tether=solution.path[:2])


@kind("no path")
def _(problem, solution, rng):
    return problem, edit(solution, path=())


@kind("out of bounds")
def _(problem, solution, rng):
    end = free_end(problem.model_copy(update={"bounds": None}), rng, 0.9 * problem.tether_length)
    if end is None:
        return None
    places = problem.points[:, :2]
    low, high = places.min(axis=0), places.max(axis=0)
    beyond = max((low - end[:2]).max(), (end[:2] - high).max())
    if beyond < 0.1 * problem.scale:
        return None
    edge = 0.5 * beyond
    return of_problem(
        problem, spur(solution, end), bounds=(*(low - edge).tolist(), *(high + edge).tolist())
    )


def box(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    """Return a rectangle."""
    return Polygon(polygon=[(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def added(problem: Problem, solution: Solution, obstacle: Circle | Polygon) -> Pair | None:
    """Return the tour in a world with one obstacle more, whose ray the path does not cross."""
    return of_problem(problem, solution, obstacles=[*problem.obstacles, obstacle])


@kind("through a wall thinner than the tolerance")
def _(problem, solution, rng):
    end = free_end(problem, rng, 0.5 * problem.tether_length)
    if end is None:
        return None
    middle = 0.5 * (end[:2] + problem.base[:2])
    along = (end[:2] - problem.base[:2]) / np.linalg.norm(end[:2] - problem.base[:2])
    side = np.array([-along[1], along[0]])
    wide, thin = 0.005 * problem.scale, 5e-8 * problem.scale
    corners = [middle + a * thin * along + b * wide * side
               for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]  # fmt: skip
    wall = Polygon(polygon=corners)
    return added(problem, spur(solution, end), wall)


@kind("between two obstacles that touch")
def _(problem, solution, rng):
    end = free_end(problem, rng, 0.5 * problem.tether_length)
    if end is None or problem.clearance:
        return None
    middle = 0.5 * (end[:2] + problem.base[:2])
    along = (end[:2] - problem.base[:2]) / np.linalg.norm(end[:2] - problem.base[:2])
    side = np.array([-along[1], along[0]])
    r = 0.004 * problem.scale
    squares = [Polygon(polygon=[middle, middle + s * r * side + r * along,
                                middle + s * 2 * r * side, middle + s * r * side - r * along])
               for s in (1, -1)]  # fmt: skip
    return of_problem(problem, spur(solution, end), obstacles=[*problem.obstacles, *squares])


# worlds


def made(points, obstacles, tether, clearance=0.0, bounds=None) -> Problem | None:
    """Return a problem; None if the draw is none."""
    try:
        return Problem(base=points[0], goals=points[1:], obstacles=obstacles,
                       tether_length=tether, clearance=clearance, bounds=bounds)  # fmt: skip
    except InputError:
        return None


def places(rng: np.random.Generator) -> np.ndarray:
    """Return base and goals on whole numbers."""
    return rng.integers(-1, 13, (rng.integers(2, 5), 2)).astype(float)


def whole_numbers(rng):
    """Boxes and circles anywhere on whole numbers, some with bounds."""
    obstacles: list = []
    for _ in range(rng.integers(1, 5)):
        x, y = rng.integers(0, 10, 2)
        w, h = rng.integers(1, 4, 2)
        ball = Circle(center=(x, y), radius=float(rng.integers(1, 3)))
        obstacles.append(box(x, y, x + w, y + h) if rng.random() < 0.6 else ball)
    bounds = (-1, -1, 13, 13) if rng.random() < 0.3 else None
    clearance = float(rng.choice([0, 0, 0.5, 1]))
    return made(places(rng), obstacles, float(rng.integers(10, 25)), clearance, bounds)


def shared_corners(rng):
    """Two boxes that share a corner."""
    x, y = rng.integers(2, 8, 2)
    a, b, c, d = rng.integers(1, 4, 4)
    below = box(x - c, y - d, x, y) if rng.random() < 0.5 else box(x + a, y - d, x + a + c, y)
    return made(places(rng), [box(x, y, x + a, y + b), below], float(rng.integers(10, 25)))


def touching_boxes(rng):
    """Two boxes that share part of an edge, and a circle that touches one."""
    x, y = rng.integers(2, 8, 2)
    a, b, c, d = rng.integers(1, 4, 4)
    s = int(rng.integers(0, b))
    obstacles: list = [box(x, y, x + a, y + b), box(x + a, y + s, x + a + c, y + s + d)]
    if rng.random() < 0.5:
        obstacles.append(Circle(center=(x - 1, y + 0.5), radius=1))
    return made(places(rng), obstacles, float(rng.integers(10, 25)))


def rooms(rng):
    """A basin with a gap in its wall, perhaps with a pier."""
    w, h = rng.integers(7, 12, 2)
    g = int(rng.integers(2, w - 3))
    e = g + int(rng.integers(1, w - g - 1))
    ring = [(g, h), (0, h), (0, 0), (w, 0), (w, h), (e, h), (e, h - 1), (w - 1, h - 1),
            (w - 1, 1), (1, 1), (1, h - 1), (g, h - 1)]  # fmt: skip
    obstacles = [Polygon(polygon=ring)]
    if rng.random() < 0.5:
        k = int(rng.integers(2, w - 2))
        obstacles.append(box(k, 2, k + 1, int(rng.integers(3, h))))
    return made(places(rng), obstacles, float(rng.integers(12, 35)))


def spirals(rng):
    """A wall that winds inward."""
    import shapely

    p, line, long = np.zeros(2), [np.zeros(2)], 2
    for k in range(int(rng.integers(3, 7))):
        p = p + long * np.array([(1, 0), (0, 1), (-1, 0), (0, -1)][k % 4])
        line.append(p)
        long += 2 if k % 2 else 1
    wall = shapely.LineString(line).buffer(0.5, cap_style="flat", join_style="mitre")
    ring = shapely.get_coordinates(wall.exterior)[:-1]
    points = rng.integers(-7, 8, (rng.integers(2, 4), 2)).astype(float)
    return made(points, [Polygon(polygon=ring)], float(rng.integers(12, 30)))


def hulls(rng, n):
    """Return polygons in general position."""
    out = []
    for _ in range(n):
        angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 8)))
        ring = np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(0.3, 1.5)
        try:
            out.append(Polygon(polygon=ring + rng.uniform(1, 9, 2)))
        except InputError:
            continue
    return out


def lined_up(rng):
    """Base and goals on corners and extended edges, some at bounds."""
    obstacles = hulls(rng, int(rng.integers(1, 4)))
    if not obstacles:
        return None
    points = []
    for _ in range(rng.integers(2, 5)):
        v = np.array(obstacles[rng.integers(len(obstacles))].polygon)
        i = rng.integers(len(v))
        share = rng.choice([0.0, 0.0, 1.0, -1.0, 2.0, 0.5, rng.uniform(-3, 3)])
        points.append(v[i] + share * (v[(i + 1) % len(v)] - v[i]))
    bounds = (0, 0, 10, 10) if rng.random() < 0.4 else None
    if bounds and rng.random() < 0.6:
        points[0] = rng.choice([0.0, 5.0, 10.0], 2)
    return made(np.array(points), obstacles, float(rng.uniform(6, 20)), 0.0, bounds)


def general(rng):
    """Circles and polygons in general position."""
    obstacles: list = hulls(rng, int(rng.integers(1, 4)))
    obstacles += [
        Circle(center=rng.uniform(0, 10, 2), radius=rng.uniform(0.2, 1.2))
        for _ in range(rng.integers(0, 3))
    ]
    points = rng.uniform(-1, 11, (rng.integers(2, 5), 2))
    return made(points, obstacles, float(rng.uniform(8, 20)), float(rng.choice([0, 0, 0.2])))


WORLDS = {
    "whole numbers": whole_numbers,
    "shared corners": shared_corners,
    "touching boxes": touching_boxes,
    "rooms": rooms,
    "spirals": spirals,
    "lined up": lined_up,
    "general position": general,
}
