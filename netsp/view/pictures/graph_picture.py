"""The picture of a travel graph: how long the tether is in every class of every goal."""

from __future__ import annotations

from typing import Any

from netsp.gtsp.travel.graph import TravelGraph
from netsp.view.pictures import style


def draw_classes(graph: TravelGraph, *, ax: Any = None) -> Any:
    """Mark each class by goal and tether length, on the given or on new axes, and return the axes.
    Graphs of given costs have no tethers; their leg from the base is shown instead."""
    from matplotlib.figure import Figure

    if ax is None:
        ax = Figure(figsize=(7, 3.5), layout="constrained").subplots()
    shown = graph.tethers if graph.roadmapped else graph.costs_to_base
    ax.plot(graph.cluster[1:] - 1, shown[1:], "_", color=style.TETHER, ms=9, mew=1.2)
    ax.set(
        xlabel="goal",
        ylim=(0, None),
        ylabel="tether length of each class" if graph.roadmapped else "leg from the base",
    )
    ax.set_title(repr(graph).strip("<>"), fontsize=9, loc="left")
    return ax
