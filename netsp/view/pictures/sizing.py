"""Pictures of sizing: the tether curve, and maps of base candidates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from netsp.model.solution import Status
from netsp.view.pictures import style
from netsp.view.pictures.picture_layout import MapLayout
from netsp.view.pictures.problem_picture import draw_obstacles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from netsp.plan.sizing.base_placement import BaseSearch
    from netsp.plan.sizing.tether_sizing import TetherCurve


def draw_tether_curve(
    curve: TetherCurve, *, ax: Axes | None = None, layout: MapLayout = MapLayout()
) -> Any:
    """Draw the shortest tour by tether length on given or new axes, and return the axes."""
    if ax is None:
        from matplotlib.figure import Figure

        ax = Figure(figsize=(7.2, 4.2), layout="constrained").subplots()
    for k, s in enumerate(curve.steps):
        proven = s.status is Status.OPTIMAL
        ax.plot(
            [s.tether, s.until],
            [s.length] * 2,
            color=style.PATH,
            lw=2.2,
            ls="-" if proven else (0, (4, 2)),
            solid_capstyle="butt",
        )
        ax.plot([s.tether], [s.length], "o", color=style.PATH, ms=4.5, zorder=3)
        if k:
            before = curve.steps[k - 1]
            ax.plot([s.tether] * 2, [s.length, before.length], color=style.PATH, lw=0.7, ls=":")
        if not proven:
            ax.fill_between(
                [s.tether, s.until], s.lower_bound, s.length, color=style.PLAN, alpha=0.25, lw=0
            )
        if len(curve.steps) <= layout.max_steps:
            ax.annotate(
                f"{s.tether:.4g}: {s.length:.5g}",
                (s.tether, s.length),
                (4, 5),
                textcoords="offset points",
                fontsize=7,
            )
    ax.axvline(curve.shortest, color=style.LIMIT, lw=1.0, ls="--")
    low, high = ax.get_xlim()
    ax.set_xlim(min(low, curve.shortest - 0.04 * (high - low)), high)
    ax.set_xlabel(f"tether length ({curve.units})")
    ax.set_ylabel(f"shortest tour ({curve.units})")
    proof = (
        "every step proven by this solver" if curve.proven else "dashed: not proven the shortest"
    )
    if not curve.whole:
        proof += "; time ran out before the shortest tether"
    ax.set_title(
        f"{curve.name}: at least {curve.shortest:.6g} {curve.units} of tether; {proof}",
        fontsize=10,
        loc="left",
    )
    ax.margins(y=0.12)
    ax.ticklabel_format(axis="y", useOffset=False)
    return ax


def draw_base_search(search: BaseSearch, *, ax: Any = None, layout: MapLayout = MapLayout()) -> Any:
    """Draw maps of the shortest sufficient tether and the shortest tour at base candidates.

    Contours are drawn if the candidates spread over the plane. Returns both axes.
    """
    problem = search.problem
    if ax is None:
        from matplotlib.figure import Figure

        ax = Figure(figsize=(12.0, 5.4), layout="constrained").subplots(1, 2)
    left, right = ax
    figure: Any = left.figure
    xy = np.array([c.position[:2] for c in search.candidates])
    tether = np.array([c.shortest_tether for c in search.candidates])
    tour = np.array([np.nan if c.length is None else c.length for c in search.candidates])
    possible = np.array([c.possible for c in search.candidates])
    _map(left, problem, xy, tether, possible, "shortest sufficient tether", layout.contours)
    _map(right, problem, xy, tour, possible, "shortest tour", layout.contours)
    only = np.isnan(tour) & possible
    right.plot(
        *xy[only].T,
        "o",
        mfc="none",
        mec=style.EDGE,
        ms=6,
        zorder=4,
        label="proven worse without a tour" if search.proven else "not solved",
    )
    if len(xy) <= layout.max_places:
        for c in search.candidates:
            left.annotate(c.name, c.position[:2], (4, 4), textcoords="offset points", fontsize=7)
    best = search.best
    for ax in (left, right):
        if best is not None:
            ax.plot(
                *best.position[:2],
                "*",
                color=style.BASE,
                mec="white",
                ms=15,
                zorder=6,
                label=f"best: {best.name}",
            )
    if best is not None:
        figure.legend(
            *right.get_legend_handles_labels(),
            loc="outside lower center",
            ncols=4,
            fontsize=8,
            frameon=False,
        )
    proof = "proven the best by this solver" if search.proven else "not proven the best"
    if best is None:
        figure.suptitle(f"{problem.name}: no place has a tour", fontsize=11)
    else:
        x, y = best.position[:2]
        figure.suptitle(
            f"{problem.name}: {best.name} at ({x:.4g}, {y:.4g}), {proof}; tour {best.length:.6g} "
            f"{problem.units}, at least {best.shortest_tether:.5g} {problem.units} of tether",
            fontsize=11,
        )
    return left, right


def _map(
    ax: Axes, problem: Any, xy: Any, values: Any, possible: Any, label: str, contours: int
) -> None:
    """Draw values at places, with contours if the places span the plane."""
    draw_obstacles(ax, problem)
    ok = np.isfinite(values)
    size = float(np.ptp(xy, axis=0).max()) or 1.0
    spread = np.linalg.svd(xy[ok] - xy[ok].mean(0))[1] if ok.sum() >= 4 else np.zeros(2)
    if ok.sum() >= 4 and spread[1] > 1e-3 * size and np.ptp(values[ok]) > 0.0:
        drawn = ax.tricontour(
            *xy[ok].T, values[ok], levels=contours, cmap="viridis", linewidths=1.2, zorder=1
        )
        ax.clabel(drawn, fontsize=7, fmt="%.4g")
    if ok.any():
        dots = ax.scatter(xy[ok, 0], xy[ok, 1], c=values[ok], s=24, cmap="viridis", zorder=5, lw=0)
        ax.figure.colorbar(dots, ax=ax, label=f"{label} ({problem.units})", shrink=0.85)
    ax.plot(*xy[~possible].T, "x", color=style.LEFT_OUT, ms=5, zorder=5, label="no tour from here")
    goals = problem.points[1:, :2]
    ax.plot(*goals.T, "s", mfc=style.GOAL, mec=style.PATH, ms=6, zorder=5, label="goals")
    ax.set_aspect("equal")
    low, high = ax.get_xlim(), ax.get_ylim()
    every = np.vstack([xy, goals, np.column_stack([low, high])])
    room = 0.04 * float(np.ptp(every, axis=0).max())
    ax.set_xlim(every[:, 0].min() - room, every[:, 0].max() + room)
    ax.set_ylim(every[:, 1].min() - room, every[:, 1].max() + room)
    ax.set_title(label, fontsize=9, loc="left")
    ax.set_xlabel(f"x ({problem.units})")
    ax.set_ylabel(f"y ({problem.units})")
