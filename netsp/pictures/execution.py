"""The picture of a run: the map with the plan, the way that was gone, and the tether over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from netsp.errors import InputError
from netsp.execute.log import Execution
from netsp.pictures.literal import literal
from netsp.problem import Circle


def save_execution(done: Execution, file: str | Path) -> None:
    """Draw a run. InputError if the file cannot be written."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle as Disk
    from matplotlib.patches import Polygon as Face

    problem = done.problem
    figure = Figure(figsize=(13, 6), layout="constrained")
    ax, right = figure.subplots(1, 2, width_ratios=[1.0, 1.0])
    for k, o in enumerate(problem.obstacles):
        label = "obstacle" if k == 0 else None
        if isinstance(o, Circle):
            ax.add_patch(Disk(o.center, o.radius, facecolor="#d0d7de", edgecolor="#868e96",
                              label=label))  # fmt: skip
        else:
            ax.add_patch(Face(o.polygon, facecolor="#d0d7de", edgecolor="#868e96", label=label))
    plan = np.array(done.solution.path).reshape(-1, 3)
    way = np.array([[r.x, r.y] for r in done.rows])
    ax.plot(plan[:, 0], plan[:, 1], color="#adb5bd", lw=1.0, ls="--", label="plan")
    if len(way):
        ax.plot(way[:, 0], way[:, 1], color="#1971c2", lw=1.3, label="way that was gone")
    visited = {a.goal for a in done.arrivals}
    for mark, colour, name, wanted in (
        ("o", "#2b8a3e", "visited", visited),
        ("x", "#c92a2a", "left out", set(done.lost)),
        ("+", "#868e96", "cancelled", done.cancelled),
    ):
        places = [g.position for k, g in enumerate(problem.goals) if k in wanted]
        if places:
            ax.plot(*np.array(places)[:, :2].T, mark, color=colour, ms=6, label=name)
    ax.plot(*problem.base[:2], "k*", ms=12, label="base")
    ax.set(aspect="equal", xlabel=f"x ({problem.units})", ylabel=f"y ({problem.units})")
    ax.legend(loc="best", fontsize=8)
    t = [r.time for r in done.rows]
    right.plot(t, [r.tether for r in done.rows], color="#c2255c", lw=1.2, label="taut tether")
    right.plot(t, [r.limit for r in done.rows], color="#495057", lw=1.0, ls="--", label="limit")
    for e in done.entries:
        right.axvline(e.time, color="#f08c00", lw=1.0)
        right.annotate(f"{e.event}: {e.done}", (e.time, 0), xytext=(3, 4), rotation=90,
                       textcoords="offset points", fontsize=8, color="#e8590c")  # fmt: skip
    right.set(xlabel="time (s)", ylabel=f"length ({problem.units})", ylim=(0, None))
    right.legend(loc="upper right", fontsize=8)
    s = done.summary
    figure.suptitle(
        f"{problem.name}: {s['visited']} goals in {s['time_s']:.0f} s, path {s['path']:.5g}, "
        f"tether at most {s['longest_tether']:.5g} of {s['tether_length']:g}"
    )
    try:
        literal(figure).savefig(file, dpi=120)
    except OSError as error:
        raise InputError(f"{file}: cannot be written: {error.strerror or error}") from None
