"""Problem files, read without netsp: base, goals, obstacles and limits in exact numbers."""

from __future__ import annotations

import json
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

Exact = tuple[Fraction, Fraction]
"""Point of the plane in grid units from the base."""


class Refused(Exception):
    """A file that is not understood, or a proof that does not hold; the message says why."""


@dataclass(frozen=True)
class Obstacle:
    """Obstacle: a circle if it has one corner, else a simple polygon; grown by `growth`."""

    corners: tuple[Exact, ...]
    growth: Fraction

    def span(self) -> tuple[Exact, Exact]:
        """Return the lower left and the upper right corner of a box around the grown obstacle."""
        xs, ys = [x for x, _ in self.corners], [y for _, y in self.corners]
        low, high = (min(xs), min(ys)), (max(xs), max(ys))
        g = self.growth
        return (low[0] - g, low[1] - g), (high[0] + g, high[1] + g)


@dataclass(frozen=True)
class Problem:
    """Problem in grid units from the base; the numbers of the file are taken exactly.

    Attributes
    ----------
    grid : int
        A grid unit is 2^-grid units of the problem.
    places : tuple of (x, y)
        Plan positions of the base, then of the goals.
    heights : tuple of Fraction
        Height of each place above the base.
    cluster : tuple of int
        Number of what each place serves: 0 is the base, and goals of one choice share a number.
    tether : Fraction
        Maximum length of the taut tether.
    bounds : (x0, y0, x1, y1) or None
        Box that robot and tether stay in.
    size : Fraction
        Largest difference of coordinates between the base and a goal.
    left_out : tuple of str
        Rules of the problem that the proof leaves out; a bound without them is a bound with them.
    """

    grid: int
    places: tuple[Exact, ...]
    heights: tuple[Fraction, ...]
    cluster: tuple[int, ...]
    obstacles: tuple[Obstacle, ...]
    tether: Fraction
    bounds: tuple[Fraction, ...] | None
    size: Fraction
    left_out: tuple[str, ...]


FIELDS = frozenset(
    "schema_version name base goals obstacles tether_length clearance bounds units origin site"
    " state".split()
)


def read_problem(text: str, grid: int, margin: float = 0.0, slack: float = 0.0) -> Problem:
    """Return the problem of a JSON text, with obstacles grown by a margin and the tether reduced
    by slack.

    Raises
    ------
    Refused
        The text is no problem in the long form of format version 1.
    """
    data = json.loads(text)
    if unknown := set(data) - FIELDS:
        raise Refused(f"problem: unknown field {min(unknown)!r}")
    if data.get("state") is not None:
        raise Refused("problem: starts from a state; expected one that starts at the base")
    scale = Fraction(2) ** grid
    base = [Fraction(v) for v in [*data["base"], 0.0][:3]]
    plain = [g if isinstance(g, dict) else {"position": g} for g in data["goals"]]
    goals = [place for k, goal in enumerate(plain) for place in _places_of(goal, k)]
    at = [[Fraction(v) for v in [*g["position"], 0.0][:3]] for g in goals]

    def exact(x: float, y: float) -> Exact:
        return (Fraction(x) - base[0]) * scale, (Fraction(y) - base[1]) * scale

    clearance = Fraction(float(data.get("clearance") or 0.0) + margin)
    obstacles = []
    for o in data.get("obstacles", ()):
        if "polygon" in o:
            obstacles.append(
                Obstacle(tuple(exact(x, y) for x, y in o["polygon"]), clearance * scale)
            )
        else:
            radius = Fraction(o["radius"]) + clearance
            obstacles.append(Obstacle((exact(*o["center"]),), radius * scale))
    box = data.get("bounds")
    if box is not None and not all(isinstance(v, int | float) for v in box):
        raise Refused("bounds: are an outline; expected [xmin, ymin, xmax, ymax]")
    places = (exact(*data["base"][:2]), *(exact(float(p[0]), float(p[1])) for p in at))
    return Problem(
        grid=grid,
        places=places,
        heights=(Fraction(0), *((p[2] - base[2]) * scale for p in at)),
        cluster=(0, *_clusters(goals)),
        obstacles=tuple(obstacles),
        tether=Fraction(data["tether_length"] / (1.0 + slack)) * scale,
        bounds=None if box is None else (*exact(*box[:2]), *exact(*box[2:])),
        size=max(abs(v) for place in places for v in place),
        left_out=("precedences",) if any(g.get("after") for g in plain) else (),
    )


def _places_of(goal: dict[str, Any], k: int) -> list[dict[str, Any]]:
    """Return the places of a goal of the file, one of which suffices."""
    if "any_of" in goal:
        choice = object() if goal.get("name") is None else goal["name"]
        places = [p if isinstance(p, dict) else {"position": p} for p in goal["any_of"]]
        return [{"position": p["position"], "choice": choice} for p in places]
    if "position" not in goal:
        raise Refused(f"goals[{k}]: is in a short form; expected a position")
    return [goal]


def _clusters(goals: list[dict[str, Any]]) -> list[int]:
    """Return the cluster of each goal, from 1 in order of first appearance."""
    known: dict[Any, int] = {}
    for k, goal in enumerate(goals):
        choice = goal.get("choice")
        known.setdefault(k if choice is None else ("choice", choice), len(known) + 1)
    return [
        known[k if g.get("choice") is None else ("choice", g["choice"])]
        for k, g in enumerate(goals)
    ]
