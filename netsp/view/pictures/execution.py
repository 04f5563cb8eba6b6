"""Picture of a tour that was carried out: a map with plan and path, and the tether over time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import counted
from netsp.base.geometry import polylines
from netsp.online.execute.execution_log import Execution
from netsp.online.execute.temporary_obstacles import Maps, lasting_problem, temporary_obstacles
from netsp.view.pictures import style
from netsp.view.pictures.problem_picture import draw_obstacles

RESPONSES = {
    "local": "leg repaired",
    "replan": "planned again",
    "home": "went home",
    "kept": "plan kept",
    "defect": "defect, went home",
    "shorten": "tether shortened",
}
"""Words for the robot's response to an event."""


def save_execution(done: Execution, file: str | Path) -> None:
    """Draw a run to a file; raise InputError if it cannot be written."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.0])
    draw_map(done, ax=left)
    draw_tether(done, ax=right)
    s, units = done.summary, done.problem.units
    tethers = ", then ".join(f"{p.longest:.5g} of {p.limit:g}" for p in done.limit_periods)
    figure.suptitle(
        f"{done.problem.name}: {s['visited']} of {counted(len(done.problem.goals), 'goal')} in "
        f"{s['time_s']:.0f} s, path {s['path']:.5g} {units}, "
        f"longest tether {tethers or 'never out, of'} {units}"
    )
    style.save(figure, file, dpi=120)


def draw_map(done: Execution, *, ax: Any = None) -> Any:
    """Draw obstacles, plan, path and goals on given or new axes, and return the axes."""
    from matplotlib.figure import Figure

    problem = done.problem
    if ax is None:
        ax = Figure(figsize=(7, 6), layout="constrained").subplots()
    is_labelled = len(problem.obstacles) <= 40
    maps = done.maps or [(0.0, problem)]
    at_first = lasting_problem(maps)
    draw_obstacles(ax, at_first, label=at_first.obstacle_name if is_labelled else None)
    plan = np.array(done.solution.path).reshape(-1, 3)
    path = np.array([[r.x, r.y] for r in done.rows]).reshape(-1, 2)
    standing = [o.representative_point for o in at_first.obstacles]
    busy = [problem.points[:, :2], polylines.dense(plan[:, :2], 0.2 * problem.scale / 20.0), path]
    _draw_passing(ax, maps, np.vstack([*busy, np.array(standing).reshape(-1, 2)]))
    ax.plot(plan[:, 0], plan[:, 1], color=style.PLAN, lw=1.0, ls="--", label="plan")
    if len(path):
        ax.plot(path[:, 0], path[:, 1], color=style.PATH, lw=1.3, label="path")
    visited = {a.goal for a in done.arrivals}
    for mark, colour, name, wanted in (
        ("o", style.VISITED, "goal visited", visited),
        ("x", style.LEFT_OUT, "goal left out", set(done.left_out)),
        ("+", style.CANCELLED, "goal cancelled", set(done.cancelled)),
    ):
        places = [g.position for k, g in enumerate(problem.goals) if k in wanted]
        if places:
            ax.plot(*np.array(places)[:, :2].T, mark, color=colour, ms=7, mew=1.8, label=name)
    ax.plot(*problem.base[:2], "*", color=style.BASE, mec="white", ms=14, ls="none", label="base")
    ax.margins(0.05, 0.1)  # names stand above the goals, within the frame
    ax.set(aspect="equal", xlabel=f"x ({problem.units})", ylabel=f"y ({problem.units})")
    if len(problem.goals) <= 40:
        for k, goal in enumerate(problem.goals):
            ax.annotate(
                problem.goal_name(k),
                goal.position[:2],
                xytext=(6, 5),
                fontsize=7,
                textcoords="offset points",
                path_effects=style.halo(),
            )
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=6, fontsize=8, frameon=False)
    return ax


def _draw_passing(ax: Any, maps: Maps, busy: Floats) -> None:
    """Draw temporary obstacles: their outlines, and beside them the times for which they stood.

    `busy` are points (n, 2) that the times avoid. Times are not inside, where a goal may be drawn.
    """
    size = float(np.ptp(busy, axis=0).max())
    for p in temporary_obstacles(maps):
        rim = np.asarray(p.obstacle.shape(0.0).exterior.coords)[:, :2]
        ax.fill(*rim.T, fc=style.OBSTACLE, ec=style.EDGE, ls="--", lw=0.9, alpha=0.6, zorder=1)
        (x0, y0), (x1, y1) = rim.min(0), rim.max(0)
        x, y = (x0 + x1) / 2, (y0 + y1) / 2
        half = 0.008 * size * len(text := f"{p.name}, {p.when}")
        sides = (
            ((x, y1), (0, 3), "center", "bottom", (x, y1 + 0.02 * size)),
            ((x, y0), (0, -3), "center", "top", (x, y0 - 0.02 * size)),
            ((x1, y), (3, 0), "left", "center", (x1 + half, y)),
            ((x0, y), (-3, 0), "right", "center", (x0 - half, y)),
        )

        def room(side: Any, half: float = half) -> float:
            """Return the distance to the nearest busy point; text is wide, so vertical counts
            more."""
            away = np.abs(busy - np.array(side[-1])) / np.array([half, 0.02 * size])
            return float(away.max(axis=1).min())

        place, offset, across, up, _ = max(sides, key=room)
        ax.annotate(
            text,
            place,
            xytext=offset,
            textcoords="offset points",
            ha=across,
            va=up,
            fontsize=6.5,
            path_effects=style.halo(),
            zorder=5,
        )


def draw_tether(done: Execution, *, ax: Any = None) -> Any:
    """Draw tether length, limit and events over time on given or new axes, and return the axes."""
    from matplotlib.figure import Figure

    if ax is None:
        ax = Figure(figsize=(7, 5), layout="constrained").subplots()
    t = [r.time for r in done.rows]
    ax.plot(t, [r.tether for r in done.rows], color=style.TETHER, lw=1.2, label="taut tether")
    ax.plot(t, [r.limit for r in done.rows], color=style.LIMIT, lw=1.0, ls="--", label="limit")
    for e in done.entries:
        ax.axvline(e.time, color=style.EVENT, lw=1.0)
        what = f"{e.event.replace('_', ' ')}: {RESPONSES.get(e.response, e.response)}"
        ax.annotate(
            what,
            (e.time, 0),
            xytext=(3, 4),
            rotation=90,
            textcoords="offset points",
            fontsize=8,
            color=style.EDGE,
        )
    ax.set(xlabel="time (s)", ylabel=f"length ({done.problem.units})", ylim=(0, None))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, fontsize=8, frameon=False)
    return ax
