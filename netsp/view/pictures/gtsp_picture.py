"""Picture of a generalised TSP in the plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from netsp.base.errors import InputError
from netsp.view.pictures import style

if TYPE_CHECKING:
    from netsp.gtsp.gtsplib import GtsplibInstance
    from netsp.gtsp.travel.result import Result


def draw_gtsp(instance: GtsplibInstance, result: Result, *, ax: Any = None) -> Any:
    """Draw vertices, joined to the centres of their clusters, and the tour; return the axes.

    Raises
    ------
    InputError
        The vertices of the instance have no positions.
    """
    if instance.places is None:
        raise InputError(
            f"{instance.name}: is given by its distances, not by places; expected no picture"
        )
    if ax is None:
        from matplotlib.figure import Figure

        ax = Figure(figsize=(7.2, 6.2), layout="constrained").subplots()
    places = instance.places
    for c in range(int(instance.clusters.max()) + 1):
        members = places[instance.clusters == c]
        middle = members.mean(axis=0)
        rays = np.stack([members, np.broadcast_to(middle, members.shape)], axis=1)
        for ray in rays if len(members) > 1 else ():
            ax.plot(*ray.T, color=style.OBSTACLE, lw=1.2, zorder=1)
    ax.plot(*places.T, "o", color=style.EDGE, ms=2.5, zorder=2, label="vertex, with its cluster")
    if result.tour is not None:
        tour = places[[*result.tour, result.tour[0]]]
        ax.plot(*tour.T, "o-", color=style.PATH, ms=4.5, lw=1.6, zorder=3, label="tour")
    ax.set(xlabel="x", ylabel="y", aspect="equal")
    title = "no tour" if result.length is None else f"tour {result.length:.8g}"
    if result.bound is not None:
        title += f", {result.bound.says(digits=8)}"
    ax.set_title(f"{instance.name}: {instance.summary}; {title}", fontsize=9, loc="left")
    ax.figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    return ax
