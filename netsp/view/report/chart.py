"""Map of a page: axes, scale bar, north, obstacles and goals by name, visits by number."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.deprecated import deprecated_method
from netsp.base.geometry import polylines
from netsp.base.number_ranges import check_not_negative
from netsp.model.problem import Circle, Problem
from netsp.model.solution import Solution
from netsp.online.execute.temporary_obstacles import Maps, lasting_problem, temporary_obstacles
from netsp.view.pictures import style
from netsp.view.pictures.film import Film

LEGEND = (
    (f'<path d="M8 1 10 6 15 6 11 9 13 15 8 11 3 15 5 9 1 6 6 6Z" fill="{style.BASE}"/>', "base"),
    (
        f'<circle cx="8" cy="8" r="6" fill="{style.GOAL}" stroke="{style.PATH}" '
        'stroke-width="1.5"/>'
        '<text x="8" y="11" font-size="8" text-anchor="middle">1</text>',
        "goal, with the number of its visit",
    ),
    (
        f'<circle cx="8" cy="8" r="6" fill="{style.VISITED}" stroke="{style.PATH}" '
        'stroke-width="1.5"/>',
        "visited by then",
    ),
    (
        f'<rect x="2" y="3" width="12" height="10" fill="{style.OBSTACLE}" stroke="{style.EDGE}"/>',
        "obstacle",
    ),
    (
        f'<rect x="1" y="2" width="14" height="12" fill="none" stroke="{style.EDGE}" '
        'stroke-dasharray="1 2"/>',
        "clearance",
    ),
    (f'<path d="M0 8H16" stroke="{style.PATH}" stroke-width="2"/>', "tour"),
    (f'<path d="M0 8H16" stroke="{style.PLAN}" stroke-width="3"/>', "gone so far"),
    (f'<path d="M0 8H16" stroke="{style.TETHER}" stroke-width="3"/>', "tether"),
)


MOVING = ("visited by then", "gone so far", "tether")
"""Marks that move with the slider and are not printed."""

MOVES = ' class="noprint"'

_PLANNED = f'<path d="M0 8H16" stroke="{style.PLAN}" stroke-width="2" stroke-dasharray="4 3"/>'


@dataclass(frozen=True)
class ChartLayout:
    """Layout of the map in a page. All numbers are 0 or more.

    Attributes
    ----------
    width
        Width of the map, pixels.
    left, top, bottom
        Space for the numbers of the y axis, for scale bar and north arrow, and for the numbers of
        the x axis, pixels.
    fate_letters
        Number of letters that the fate of a goal adds to its name, beyond those that fit in the
        margin.
    max_named
        Maximum number of goals, and of obstacles, with names; more names would cover each other.
    """

    width: float = 900.0
    left: float = 52.0
    top: float = 44.0
    bottom: float = 46.0
    fate_letters: int = 6
    max_named: int = 40

    def __post_init__(self) -> None:
        check_not_negative(self)


class View:
    """Transformation from the plan to the picture.

    Parameters
    ----------
    problem : Problem
        Problem that is shown.
    more : ndarray, shape (n, 2) or (n, 3)
        Places that are to be seen, too.
    layout : ChartLayout
        Size and margins of the picture.
    """

    def __init__(self, problem: Problem, more: Floats, layout: ChartLayout = ChartLayout()) -> None:
        self.layout = layout
        xy = [problem.points[:, :2], more[:, :2]]
        for o in problem.obstacles:
            c = np.array([o.center]) if isinstance(o, Circle) else np.array(o.polygon)
            r = o.radius if isinstance(o, Circle) else 0.0
            xy += [c - r, c + r]
        every = np.vstack(xy)
        low, high = every.min(axis=0), every.max(axis=0)
        room = 0.04 * float((high - low).max()) + 1e-9
        self.low, self.high = low - room, high + room
        if len(problem.goals) <= layout.max_named:  # names stand to the right of goals
            longest = max((len(goal.name or "") for goal in problem.goals), default=0)
            letters = longest + layout.fate_letters
            self.high[0] += min(0.007 * letters, 0.2) * float((high - low).max())
        lack = 0.25 * float((self.high - self.low).max()) - (self.high - self.low)
        self.low, self.high = (
            self.low - np.maximum(lack, 0.0) / 2,
            self.high + np.maximum(lack, 0.0) / 2,
        )
        self.scale = (layout.width - layout.left - 8.0) / float(self.high[0] - self.low[0])
        self.bottom = layout.top + float(self.high[1] - self.low[1]) * self.scale
        self.height = self.bottom + layout.bottom

    @classmethod
    def of_film(cls, problem: Problem, film: Film) -> View:
        """Return the view that contains a problem and all moments of a film."""
        return cls(problem, np.vstack([m.nodes for m in film.moments]))

    of = deprecated_method("of", "of_film")

    def point(self, p: npt.ArrayLike) -> list[float]:
        """Return the pixel of a place, x and y."""
        x, y = np.asarray(p, dtype=float)[:2]
        return [
            round(self.layout.left + float(x - self.low[0]) * self.scale, 2),
            round(self.layout.top + float(self.high[1] - y) * self.scale, 2),
        ]

    def points(self, line: Floats) -> str:
        """Return the pixels of a line, as the attribute `points` of SVG."""
        return " ".join(f"{x},{y}" for x, y in (self.point(p) for p in line))


def draw(
    problem: Problem,
    solution: Solution,
    view: View,
    fates: dict[int, str],
    maps: Maps = (),
    driven: Floats | None = None,
    order: Mapping[int, int] | None = None,
) -> str:
    """Return the map as SVG, with the elements that the page's script moves.

    Parameters
    ----------
    problem : Problem
        Problem that is shown.
    solution : Solution
        Solution with the tour.
    view : View
        View of the problem.
    fates : dict
        Fates of goals that were not visited.
    maps : sequence of (float, Problem)
        Maps of a run that changed, each with the time, s, from which it applied.
    driven : ndarray, shape (k, 3), optional
        Path of the robot in a run; the tour is then drawn as a plan.
    order : mapping of int to int, optional
        Number of the visit of each goal; by default as in the tour.
    """
    if order is None:
        order = {v.goal: n for n, v in enumerate(solution.tour, 1)}
    shapes = [
        *_frame(problem, view),
        *_obstacles(lasting_problem(maps) if maps else problem, view),
        *_passing(maps, view),
        *(
            _tour(np.array(solution.path), view)
            if driven is None
            else [*_planned(np.array(solution.path), view), *_tour(driven, view)]
        ),
        f'<polyline class="done" fill="none" stroke="{style.PLAN}" stroke-width="3"/>',
        f'<polyline class="tether" fill="none" stroke="{style.TETHER}" stroke-width="3"/>',
        *_goals(problem, order, view, fates),
    ]
    x, y = view.point(problem.base)
    shapes.append(
        f'<polygon points="{_star(x, y)}" fill="{style.BASE}"><title>base</title></polygon>'
    )
    shapes.append(f'<circle class="robot" r="6" fill="{style.ROBOT}" stroke="{style.BASE}"/>')
    return (
        f'<svg class="map" viewBox="0 0 {view.layout.width:g} {view.height:.1f}" role="img" '
        f'aria-label="map">{"".join(shapes)}</svg>'
    )


def legend(*, run: bool = False) -> str:
    """Return the marks of the map and their meanings as a list.

    Parameters
    ----------
    run : bool
        Whether the map is of a run, which has a path and a plan.
    """
    marks = [(mark, "path" if run and text == "tour" else text) for mark, text in LEGEND]
    if run:
        marks.append((_PLANNED, "plan at the start"))
    items = "".join(
        f"<li{MOVES if text in MOVING else ''}>"
        f'<svg viewBox="0 0 16 16" width="16" height="16" aria-hidden="true">{mark}</svg> '
        f"{text}</li>"
        for mark, text in marks
    )
    return f'<ul class="legend">{items}</ul>'


def round_step(span: float, parts: float) -> float:
    """Return a round number (1, 2 or 5 times a power of ten) that divides a span into at most
    `parts` parts.

    Parameters
    ----------
    span : float
        Positive number.
    parts : float
        Maximum number of parts.
    """
    min_step = span / parts
    power = 10.0 ** math.floor(math.log10(min_step))
    return float(
        next(power * k for k in (1.0, 2.0, 5.0, 10.0) if power * k >= min_step * (1 - 1e-9))
    )


def _frame(problem: Problem, view: View) -> list[str]:
    """Return axes with numbers, a light grid, the scale bar and the north arrow."""
    units = html.escape(problem.units)
    step = round_step(float((view.high - view.low).max()), 10.0)
    left, top = view.point([view.low[0], view.high[1]])
    right, bottom = view.point([view.high[0], view.low[1]])
    out = []
    for axis in (0, 1):
        low, high = float(view.low[axis]), float(view.high[axis])
        first = math.ceil(low / step)
        for k in range(first, math.floor(high / step) + 1):
            value = k * step
            place = [value, view.low[1]] if axis == 0 else [view.low[0], value]
            x, y = view.point(place)
            if axis == 0:
                out.append(
                    f'<path d="M{x} {top}V{bottom}" class="grid"/>'
                    f'<text x="{x}" y="{bottom + 16}" text-anchor="middle">{value:g}'
                    "</text>"
                )
            else:
                out.append(
                    f'<path d="M{left} {y}H{right}" class="grid"/>'
                    f'<text x="{left - 5}" y="{y + 4}" text-anchor="end">{value:g}'
                    "</text>"
                )
    out.append(
        f'<rect x="{left}" y="{top}" width="{right - left:.2f}" height="{bottom - top:.2f}" '
        f'fill="none" stroke="{style.EDGE}"/>'
    )
    out.append(
        f'<text x="{(left + right) / 2}" y="{bottom + 36}" text-anchor="middle">x ({units})</text>'
    )
    middle = (top + bottom) / 2
    out.append(
        f'<text x="13" y="{middle}" text-anchor="middle" '
        f'transform="rotate(-90 13 {middle})">y ({units})</text>'
    )
    bar = round_step(float(view.high[0] - view.low[0]), 8.0)
    size = bar * view.scale
    out.append(
        f'<path d="M{left} 24v8h{size:.2f}v-8" fill="none" stroke="{style.BASE}" '
        f'stroke-width="1.5"/><text x="{left + size / 2}" y="22" text-anchor="middle">'
        f"{bar:g} {units}</text>"
    )
    if problem.origin is not None:
        x = right - 24
        out.append(
            f'<g transform="rotate({-problem.origin.heading:g} {x} 24)"><path d="M{x} 6'
            f'l6 16h-4v14h-4v-14h-4z" fill="{style.BASE}"/></g><text x="{x - 18}" y="29" '
            'text-anchor="end">N</text>'
        )
    return out


def _obstacles(problem: Problem, view: View) -> list[str]:
    out = []
    look = f'fill="{style.OBSTACLE}" stroke="{style.EDGE}"'
    around = f'fill="none" stroke="{style.EDGE}" stroke-dasharray="1 3"'
    for i, o in enumerate(problem.obstacles):
        title = f"<title>{html.escape(problem.obstacle_label(i))}</title>"
        x, y = view.point(o.representative_point)
        if isinstance(o, Circle):
            if problem.clearance:
                r = (o.radius + problem.clearance) * view.scale
                out.append(f'<circle cx="{x}" cy="{y}" r="{r:.2f}" {around}/>')
            out.append(
                f'<circle cx="{x}" cy="{y}" r="{o.radius * view.scale:.2f}" {look}>{title}</circle>'
            )
        else:
            if problem.clearance:
                ring = np.array(o.shape(problem.clearance).exterior.coords)
                out.append(f'<polygon points="{view.points(ring)}" {around}/>')
            corners = view.points(np.array(o.polygon))
            out.append(f'<polygon points="{corners}" {look}>{title}</polygon>')
        if len(problem.obstacles) <= view.layout.max_named:
            out.append(
                f'<text x="{x}" y="{y + 4}" class="name" text-anchor="middle">'
                f"{html.escape(problem.obstacle_name(i))}</text>"
            )
    return out


def _passing(maps: Maps, view: View) -> list[str]:
    """Return the obstacles that stood for a part of the run only."""
    out = []
    look = (
        f'fill="{style.OBSTACLE}" fill-opacity="0.6" stroke="{style.EDGE}" stroke-dasharray="5 3"'
    )
    for p in temporary_obstacles(maps) if maps else ():
        rim = np.asarray(p.obstacle.shape(0.0).exterior.coords)[:, :2]
        # above the obstacle, because a goal that was left out lies inside
        x, y = view.point([rim[:, 0].mean(), rim[:, 1].max()])
        name = html.escape(f"{p.name}, {p.when}")
        out.append(
            f'<polygon points="{view.points(rim)}" {look}/>'
            f'<text x="{x}" y="{y - 4}" class="name" text-anchor="middle">{name}</text>'
        )
    return out


def _planned(path: Floats, view: View) -> list[str]:
    """Return the planned path."""
    return [
        f'<polyline points="{view.points(path)}" fill="none" stroke="{style.PLAN}" '
        'stroke-width="1.5" stroke-dasharray="6 4"/>'
    ]


def _tour(path: Floats, view: View) -> list[str]:
    """Return a path, with an arrowhead in the middle of every long piece."""
    path = path[polylines.essential(path, 1e-3 / view.scale)]
    out = [
        f'<polyline points="{view.points(path)}" fill="none" stroke="{style.PATH}" '
        'stroke-width="1.5"/>'
    ]
    places = np.array([view.point(p) for p in path])
    for a, b in pairwise(places):
        if np.hypot(*(b - a)) < 36.0:
            continue
        x, y = 0.5 * (a + b)
        angle = math.degrees(math.atan2(*(b - a)[::-1]))
        out.append(
            f'<path d="M-6 -4 5 0-6 4Z" fill="{style.PATH}" '
            f'transform="translate({x:.1f} {y:.1f}) rotate({angle:.1f})"/>'
        )
    return out


def _goals(
    problem: Problem, visit: Mapping[int, int], view: View, fates: dict[int, str]
) -> list[str]:
    named = len(problem.goals) <= view.layout.max_named
    out = []
    for k, goal in enumerate(problem.goals):
        x, y = view.point(goal.position)
        fate = fates.get(k, "" if k in visit else "not chosen" if goal.choice else "")
        edge = {"left out": style.LEFT_OUT, "cancelled": style.CANCELLED}.get(
            fate, style.PATH if k in visit else style.EDGE
        )
        note = html.escape(f"{problem.goal_label(k)} {fate}".strip())
        out.append(
            f'<circle class="goal" data-goal="{k}" cx="{x}" cy="{y}" r="9" '
            f'fill="{style.GOAL}" stroke="{edge}" '
            f'stroke-width="1.6"><title>{note}</title></circle>'
            f'<text x="{x}" y="{y + 4}" class="visit" text-anchor="middle">'
            f"{visit.get(k, '–')}</text>"
        )
        text = " ".join(t for t in (goal.name or "", fate) if t)
        if text and named:
            out.append(f'<text x="{x + 12}" y="{y + 4}" class="name">{html.escape(text)}</text>')
    return out


def _star(x: float, y: float) -> str:
    """Return the corners of a star, the mark of the base in all pictures."""
    angle = np.pi * (np.arange(10) / 5.0 - 0.5)
    radius = np.where(np.arange(10) % 2, 4.0, 10.0)
    corners = zip(x + radius * np.cos(angle), y + radius * np.sin(angle), strict=True)
    return " ".join(f"{a:.2f},{b:.2f}" for a, b in corners)
