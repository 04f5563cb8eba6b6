"""Picture of a travel graph: the tether length in each class of each goal."""

from __future__ import annotations

from typing import Any

from netsp.roadmap.travel_graph import TravelGraph
from netsp.view.pictures import style


def draw_classes(graph: TravelGraph, *, ax: Any = None) -> Any:
    """Draw each class by goal and tether length on given or new axes, and return the axes.

    Graphs from costs have no tethers; the leg from the base is shown instead.
    """
    from matplotlib.figure import Figure

    if ax is None:
        ax = Figure(figsize=(7, 3.5), layout="constrained").subplots()
    shown = graph.tethers if not graph.has_cost_matrix else graph.costs_to_base
    ax.plot(graph.cluster[1:] - 1, shown[1:], "_", color=style.TETHER, ms=9, mew=1.2)
    ax.set(
        xlabel="goal",
        ylim=(0, None),
        ylabel="tether length of each class" if not graph.has_cost_matrix else "leg from the base",
    )
    ax.set_title(repr(graph).strip("<>"), fontsize=9, loc="left")
    return ax
