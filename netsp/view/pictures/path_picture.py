"""Pictures that compare paths with the planned tour: a map and the tether along each path."""

from __future__ import annotations

from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.study.compare.path_comparison import ComparedPath, PathComparison
from netsp.study.paths import PathMeasures
from netsp.view.pictures import style
from netsp.view.pictures.picture_layout import MapLayout
from netsp.view.pictures.problem_picture import draw_obstacles


def draw_comparison(found: PathComparison, layout: MapLayout = MapLayout()) -> Any:
    """Draw paths with the planned tour.

    Parameters
    ----------
    found : PathComparison
        The comparison.
    layout : MapLayout
        Sizes, and how many goals and obstacles have names.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with a row for each path.
    """
    from matplotlib.figure import Figure

    rows = len(found.paths)
    figure = Figure(figsize=(13.0, layout.row_height * rows + 0.4), layout="constrained")
    axes = figure.subplots(rows, 2, squeeze=False, width_ratios=[1.15, 1.0])
    for (left, right), path in zip(axes, found.paths, strict=True):
        draw_path_map(found, path, ax=left, layout=layout)
        draw_tether_along(path.measures, ax=right, layout=layout)
        left.set_title(_title(found, path), fontsize=10, loc="left")
    tour = (
        f"no tour ({found.tour_note})"
        if found.tour_length is None
        else (f"planned tour of {found.tour_length:.6g} {found.problem.units}, {found.proof}")
    )
    figure.suptitle(
        f"{found.problem.name}: paths beside the {tour}"[: layout.title_letters], fontsize=11
    )
    return figure


def _title(found: PathComparison, path: ComparedPath) -> str:
    m, u = path.measures, found.problem.units
    percent = found.percent(m.length)
    beside = "" if percent is None else f", {percent:+.1f} % beside the tour"
    home = (
        "comes home free"
        if m.is_free
        else ("does not come home" if not m.is_closed else "comes home entangled")
    )
    return (
        f"{path.name}: {m.length:.4g} {u}{beside}\n"
        f"{len(m.order)} of {found.problem.visits} goals, {home}"
    )


def draw_path_map(
    found: PathComparison, path: ComparedPath, *, ax: Any = None, layout: MapLayout = MapLayout()
) -> Any:
    """Draw one path over the tour, on axes of the caller or on new ones; return the axes."""
    from matplotlib.figure import Figure

    problem, m = found.problem, path.measures
    if ax is None:
        ax = Figure(figsize=(7, 6), layout="constrained").subplots()
    label = problem.obstacle_name if len(problem.obstacles) <= layout.max_named else None
    draw_obstacles(ax, problem, label=label, wrapped=m.entangled)
    if problem.bounds is not None:
        xmin, ymin, xmax, ymax = problem.bounds
        corners = np.array([[xmin, ymin], [xmax, ymin], [xmax, ymax], [xmin, ymax], [xmin, ymin]])
        ax.plot(*corners.T, color=style.EDGE, lw=1.0)
    if found.tour is not None and found.tour.path:
        tour = np.array(found.tour.path)
        ax.plot(*tour[:, :2].T, color=style.PLAN, lw=1.6, ls="--", label="planned tour", zorder=3)
    ax.plot(*m.points[:, :2].T, color=style.PATH, lw=1.5, label=path.name, zorder=3.5)
    flat = polylines.along(m.points[:, :2])
    for k, s in enumerate(s for s in m.stretches if s.kind != "clearance"):
        part = _part(m.points[:, :2], flat, s.start, s.end)
        name = "through an obstacle or out of bounds" if k == 0 else None
        ax.plot(*part.T, color=style.LEFT_OUT, lw=4.0, zorder=3.6, label=name)
    number = {g: k for k, g in enumerate(m.order, 1)}
    for mark, colour, name, wanted in (
        ("o", style.GOAL, "goal visited, with its number", set(number)),
        ("x", style.LEFT_OUT, "goal missed", set(m.missing)),
    ):
        places = [g.position[:2] for k, g in enumerate(problem.goals) if k in wanted]
        if places:
            edge = style.PATH if mark == "o" else colour
            ax.plot(
                *np.array(places).T,
                mark,
                color=colour,
                mec=edge,
                ms=12 if mark == "o" else 8,
                mew=1.6,
                label=name,
                zorder=5,
                ls="none",
            )
    for k, goal in enumerate(problem.goals):
        place = goal.position[:2]
        if k in number:
            ax.annotate(str(number[k]), place, ha="center", va="center", fontsize=7, zorder=6)
        if len(problem.goals) <= layout.max_named and goal.name:
            ax.annotate(
                goal.name,
                place,
                xytext=(8, 4),
                textcoords="offset points",
                fontsize=7,
                zorder=6,
                color=style.EDGE,
                path_effects=style.halo(),
            )
    ax.plot(
        *problem.base[:2],
        "*",
        color=style.BASE,
        mec="white",
        ms=15,
        ls="none",
        label="base",
        zorder=7,
    )
    ax.margins(0.05, 0.08)
    ax.set(aspect="equal", xlabel=f"x ({problem.units})", ylabel=f"y ({problem.units})")
    ax.tick_params(labelsize=8)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, fontsize=8, frameon=False)
    return ax


def draw_tether_along(m: PathMeasures, *, ax: Any = None, layout: MapLayout = MapLayout()) -> Any:
    """Draw the taut tether along a path, on axes of the caller or on new ones; return the axes."""
    from matplotlib.figure import Figure

    problem = m.problem
    if ax is None:
        ax = Figure(figsize=(7, 5), layout="constrained").subplots()
    rows = m.tether_profile()
    if len(rows):
        ax.plot(*rows.T, color=style.TETHER, lw=1.4, label="taut tether")
    ax.axhline(problem.tether_length, color=style.LIMIT, lw=1.0, ls="--", label="tether length")
    visits = [(v.along, v.tether) for v in m.visits if v.tether is not None]
    if visits:
        ax.plot(
            *np.array(visits).T,
            "o",
            color=style.GOAL,
            mec=style.PATH,
            ms=6,
            ls="none",
            label="at a goal",
        )
    if len(problem.goals) <= layout.max_named:
        for v in m.visits:
            if v.tether is not None:
                ax.annotate(
                    problem.goal_name(v.goal),
                    (v.along, v.tether),
                    xytext=(0, 6),
                    fontsize=7,
                    textcoords="offset points",
                    ha="center",
                    path_effects=style.halo(),
                )
    if not len(rows):
        ax.annotate(
            "unknown: obstacles enclose a part of the path",
            (0.5, 0.5),
            xycoords="axes fraction",
            ha="center",
            fontsize=9,
        )
    ax.set(
        xlabel=f"along the path ({problem.units})",
        ylabel=f"length ({problem.units})",
        ylim=(0, None),
        xlim=(0, m.length or None),
    )
    ax.margins(y=0.12)
    ax.tick_params(labelsize=8)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, fontsize=8, frameon=False)
    return ax


def _part(line: Floats, along: Floats, start: float, end: float) -> Floats:
    """Return the part of a path between two lengths along it."""
    ends = [[float(np.interp(s, along, line[:, k])) for k in range(2)] for s in (start, end)]
    return np.vstack([ends[:1], line[(along > start) & (along < end)], ends[1:]])
