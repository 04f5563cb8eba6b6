"""Figures of a report, as in Fig. 5 of McCammon & Hollinger 2017 and beyond."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from netsp.study.compare.rows import TrialRow
from netsp.view.pictures import style
from netsp.view.report.stats import (
    Cell,
    ReportPolicy,
    Summary,
    gap_over_time,
    over_best,
    profile,
    summary,
)

LINES, MARKERS = ("-", "--", "-.", ":"), "os^Dv<>"


def _figure(columns: int = 1) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * columns + 1.8, 3.6), layout="constrained")
    return figure, figure.subplots(1, columns, sharey=True, squeeze=False)


def _style(k: int) -> dict[str, Any]:
    colours = len(style.SERIES)
    # dashes distinguish curves that coincide, also in grey prints
    look = {"color": style.SERIES[k % colours], "linestyle": LINES[k % len(LINES)]}
    return {**look, "marker": MARKERS[k % len(MARKERS)], "ms": 4.0}


def _legend(panel: Any) -> None:
    """Place the legend beside the panel, where it hides no curve."""
    panel.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.02, 1.0), handlelength=3.0)


def by_goals(
    cells: dict[Cell, list[TrialRow]],
    value: Callable[[TrialRow], float | None],
    label: str,
    *,
    log: bool,
) -> Any:
    """Draw one panel for each tether length: the median of a number against goals, with
    intervals."""
    tethers = sorted({c.tether for c in cells})
    names = list(dict.fromkeys(c.method for c in cells))
    figure, axes = _figure(len(tethers))
    goals = sorted({c.goals for c in cells})
    span = max(goals) - min(goals)
    dodge = 0.012 * span if span else 0.01 * max(goals)
    for panel, tether in zip(axes[0], tethers, strict=True):
        for k, name in enumerate(names):
            points: list[tuple[int, Summary]] = []
            for cell in sorted((c for c in cells if c.method == name), key=lambda c: c.goals):
                found = [v for r in cells[cell] if (v := value(r)) is not None]
                if cell.tether == tether and (s := summary(found)) is not None:
                    points.append((cell.goals, s))
            if points:
                at = [g + dodge * (k - (len(names) - 1) / 2) for g, _ in points]
                mid = np.array([s.median for _, s in points])
                spread = [mid - [s.low for _, s in points], [s.high for _, s in points] - mid]
                panel.errorbar(at, mid, spread, label=name, capsize=2, lw=1.2, **_style(k))
        panel.set(title=f"tether {tether:g}", xlabel="number of goals", xticks=goals)
        if not span:  # a single number is centred
            panel.set_xlim(0.9 * goals[0], 1.1 * goals[0])
        panel.grid(alpha=0.3)
        if log:
            panel.set_yscale("log")
        elif panel.get_ylim()[1] < ReportPolicy.min_axis_range:
            top = ReportPolicy.min_axis_range
            panel.set_ylim(-0.05 * top, top)
    axes[0][0].set_ylabel(label)
    if axes[0][-1].get_legend_handles_labels()[0]:
        _legend(axes[0][-1])
    return figure


def lengths(cells: dict[Cell, list[TrialRow]], best: dict[str, float]) -> Any:
    """Draw the excess over the best known length in per cent, as Fig. 5a to c."""
    return by_goals(cells, lambda r: over_best(r, best), "% over the best known", log=False)


def times(cells: dict[Cell, list[TrialRow]]) -> Any:
    """Draw the time including roadmap and legs, s, as Fig. 5d to f."""
    return by_goals(
        cells, lambda r: r["total_s"] if r.get("length") else None, "time (s)", log=True
    )


def entanglements(cells: dict[Cell, list[TrialRow]]) -> Any | None:
    """Draw the obstacles that tether-blind baselines entangle; None without such baselines."""
    blind = {c: rows for c, rows in cells.items() if any(r["status"] == "invalid" for r in rows)}
    if not blind:
        return None
    return by_goals(blind, lambda r: r.get("entangled"), "obstacles entangled", log=False)


def performance(by_method: dict[str, list[TrialRow]]) -> Any | None:
    """Share of problems proven within a multiple of the fastest time; None if nothing is
    fewer than two methods prove any."""
    from matplotlib.ticker import FixedLocator, NullFormatter, StrMethodFormatter

    ratios = profile(by_method)
    if sum(bool(np.isfinite(r).any()) for r in ratios.values()) < 2:
        return None
    figure, axes = _figure()
    panel = axes[0][0]
    finite = [r[np.isfinite(r)] for r in ratios.values()]
    axis_end = 2.0 * max(float(r.max(initial=1.0)) for r in finite)
    for k, (name, r) in enumerate(ratios.items()):
        held = r[np.isfinite(r)]
        x = np.concatenate([[1.0], np.repeat(held, 2), [axis_end]])
        share = np.repeat(np.arange(len(held) + 1) / len(r), 2)
        style = {**_style(k), "marker": ""}
        panel.plot(x, share, label=name, **style)
    panel.set(
        xscale="log",
        xlim=(1.0, axis_end),
        ylim=(-0.02, 1.02),
        ylabel="share proven",
        xlabel="times the seconds of the fastest",
    )
    panel.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())
    if axis_end < 30.0:  # less than two numbers would stand at powers of ten
        panel.xaxis.set_major_locator(FixedLocator([1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0]))
    panel.grid(alpha=0.3)
    if panel.get_legend_handles_labels()[0]:
        _legend(panel)
    return figure


def anytime(by_method: dict[str, list[TrialRow]], best: dict[str, float]) -> Any | None:
    """Draw the median excess over the best known length by time; None without histories."""
    from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

    last = max((r.get("total_s", 0.0) for rows in by_method.values() for r in rows), default=0.0)
    at = np.geomspace(1e-3, max(last, 1e-2), 120)
    figure, axes = _figure()
    panel, drawn = axes[0][0], False
    for k, (name, rows) in enumerate(by_method.items()):
        curve = gap_over_time(rows, best, at)
        if curve is not None and np.isfinite(curve).any():
            style = {**_style(k), "marker": ""}
            panel.plot(at, np.where(np.isfinite(curve), curve, np.nan), label=name, **style)
            drawn = True
    if not drawn:
        return None
    panel.set(xscale="log", xlabel="time (s)", ylabel="median % over the best known")
    panel.set_yscale("symlog", linthresh=0.1, linscale=0.5)
    panel.yaxis.set_major_locator(FixedLocator([0.0, *(10.0**k for k in range(-1, 7))]))
    panel.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    panel.yaxis.set_minor_locator(NullLocator())
    panel.set_ylim(bottom=-0.02, top=max(panel.get_ylim()[1], ReportPolicy.min_axis_range))
    panel.grid(alpha=0.3)
    if panel.get_legend_handles_labels()[0]:
        _legend(panel)
    return figure
