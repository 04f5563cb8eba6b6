"""Problem files, read without netsp: base, goals, obstacles and limits in exact numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

Exact = tuple[Fraction, Fraction]
"""Point of the plane in grid units from the base."""

GRID_BITS = 36
"""Format constant: the size of a problem is between 2^35 and 2^36 grid units."""

LONG_FORM = "`netsp verify PROBLEM --problem-output FILE` writes the long form"
"""Advice for a problem file in a short form."""

MAX_NUMBER = 1e15
"""Format limit: numbers of a problem file are smaller."""

FIELDS = {
    "problem": "schema_version name base goals obstacles tether_length clearance bounds units"
    " origin state site",
    "goal": "name position choice after any_of",
    "obstacle": "name center radius polygon",
}
"""Fields that are understood; a proof for a problem with another field is refused."""


class Refused(Exception):
    """Refusal of a file that is not understood, or of a proof that does not hold; says why."""


class Obstacle(NamedTuple):
    """Obstacle: a circle if it has one corner, else a simple polygon; grown by `growth`."""

    corners: tuple[Exact, ...]
    growth: Fraction

    def span(self) -> tuple[Exact, Exact]:
        """Return the lower left and the upper right corner of a box around it."""
        xs, ys, g = [x for x, _ in self.corners], [y for _, y in self.corners], self.growth
        return (min(xs) - g, min(ys) - g), (max(xs) + g, max(ys) + g)


class Problem(NamedTuple):
    """Problem in grid units from the base; the numbers of the file are taken exactly.

    `places` and `heights` are those of the base, then of the goals. `cluster` holds the cluster of
    each place: 0 for the base; goals of one choice share one. `before` holds the pairs of clusters
    of which the first is visited before the second. A grid unit is 2^-grid units of the
    file.
    """

    grid: int
    size: Fraction
    places: tuple[Exact, ...]
    heights: tuple[Fraction, ...]
    cluster: tuple[int, ...]
    before: frozenset[tuple[int, int]]
    obstacles: tuple[Obstacle, ...]
    tether: Fraction
    bounds: tuple[Fraction, ...] | None


def read_json(text: str | bytes) -> dict[str, Any]:
    """Return a JSON object; refuse other values, repeated keys, NaN and infinite numbers."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len(dict(pairs)) < len(pairs):
            raise Refused("a key occurs twice in one object")
        return dict(pairs)

    def refuse(name: str) -> None:
        raise Refused(f"expected finite numbers, got {name}")

    data = json.loads(text, object_pairs_hook=unique, parse_constant=refuse)
    if not isinstance(data, dict):
        raise Refused("expected a JSON object")
    return data


def read_problem(text: str, margin: float = 0.0, slack: float = 0.0) -> Problem:
    """Return the problem of a file in its long form, with obstacles grown by a margin, and with a
    share of the tether's length kept in reserve as slack."""
    data = read_json(text)
    _check_fields(data, "problem")
    if data.get("state") is not None:
        raise Refused("state: expected a tour that starts at the base")
    goals = [place for k, goal in enumerate(data["goals"]) for place in _places(goal, k)]
    base, *at = (_point(p) for p in (data["base"], *(g["position"] for g in goals)))
    tether = _number(data["tether_length"]) / (1.0 + slack)
    size = max((abs(p[i] - base[i]) for p in at for i in (0, 1, 2)), default=Fraction(0))
    size = min(size or Fraction(tether), Fraction(tether))
    grid = GRID_BITS - math.frexp(size)[1]
    unit = Fraction(2) ** -grid

    def exact(point: Any) -> Exact:
        x, y, _ = _point(point)
        return (x - base[0]) / unit, (y - base[1]) / unit

    clearance = Fraction(_number(data.get("clearance", 0.0)) + margin)
    obstacles = []
    for o in data.get("obstacles", ()):
        _check_fields(o, "obstacle")
        growth = clearance + (0 if "polygon" in o else Fraction(_number(o["radius"])))
        corners = tuple(exact(p) for p in (o["polygon"] if "polygon" in o else [o["center"]]))
        obstacles.append(Obstacle(corners, growth / unit))
    box = data.get("bounds")
    if box is not None and (len(box) != 4 or any(isinstance(v, list) for v in box)):
        raise Refused(f"bounds: expected [xmin, ymin, xmax, ymax], no outline; {LONG_FORM}")
    clusters = _clusters(goals)
    return Problem(
        grid=grid,
        size=size / unit,
        places=tuple(((p[0] - base[0]) / unit, (p[1] - base[1]) / unit) for p in (base, *at)),
        heights=tuple((p[2] - base[2]) / unit for p in (base, *at)),
        cluster=(0, *clusters),
        before=_precedences(goals, clusters),
        obstacles=tuple(obstacles),
        tether=Fraction(tether) / unit,
        bounds=None if box is None else (*exact(box[:2]), *exact(box[2:])),
    )


def _check_fields(data: dict[str, Any], kind: str) -> None:
    if unknown := data.keys() - set(FIELDS[kind].split()):
        field = min(unknown)
        raise Refused(f"{kind}: field {field!r} is unknown, or a short form; {LONG_FORM}")


def _number(value: Any) -> float:
    if type(value) not in (int, float) or not abs(value) < MAX_NUMBER:
        raise Refused(f"expected a number below {MAX_NUMBER:g}, got {value!r}")
    return float(value)


def _point(value: Any) -> tuple[Fraction, Fraction, Fraction]:
    """Return the point (x, y, z) of a list of two or three numbers."""
    if not isinstance(value, list) or len(value) not in (2, 3):
        raise Refused(f"expected [x, y] or [x, y, z], got {value!r}")
    x, y, z = (Fraction(_number(v)) for v in (*value, 0.0)[:3])
    return x, y, z


def _places(goal: Any, k: int) -> list[dict[str, Any]]:
    """Return the goals, with one position each, that a goal of the file stands for."""
    if not isinstance(goal, dict):
        return [{"position": goal}]
    _check_fields(goal, "goal")
    if "any_of" not in goal:
        return [goal]
    choice = goal.get("name") or f"choice {k}"
    places = [place for p in goal["any_of"] for place in _places(p, k)]
    return [{**place, "choice": choice, "after": goal.get("after", [])} for place in places]


def _clusters(goals: Sequence[dict[str, Any]]) -> list[int]:
    """Return the cluster of each goal, from 1 in order of first appearance."""
    known: dict[Any, int] = {}
    keys = [k if g.get("choice") is None else str(g["choice"]) for k, g in enumerate(goals)]
    return [known.setdefault(key, len(known) + 1) for key in keys]


def _precedences(
    goals: Sequence[dict[str, Any]], clusters: Sequence[int]
) -> frozenset[tuple[int, int]]:
    """Return the pairs of clusters that `after` orders, transitively closed."""
    out = {
        (clusters[j], clusters[k])
        for k, goal in enumerate(goals)
        for name in goal.get("after", ())
        for j, other in enumerate(goals)
        if name in (other.get("name"), other.get("choice"))
    }
    for h in clusters:
        out |= {(g, i) for g, a in out if a == h for b, i in out if b == h}
    return frozenset(out)
