"""Pictures of waypoints that see a structure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from netsp.plan.cover import Cover
from netsp.view.pictures import style
from netsp.view.pictures.picture_layout import SpaceLayout
from netsp.world.scene.scene import Scene


def save(found: Cover, scene: Scene, file: str | Path, layout: SpaceLayout = SpaceLayout()) -> None:
    """Draw the patches by whether they are seen, left out or invisible, and the waypoints.

    There is a view in space, one from above and one from a side.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 7), layout="constrained")
    halves: Any = figure.subfigures(1, 2, width_ratios=[1.2, 1.0])
    space = halves[0].add_subplot(projection="3d")
    unit, places = scene.units, found.viewpoints.places
    patches, sees = found.patches, found.viewpoints.sees
    seen = sees.any(axis=0)
    step = max(1, len(patches.areas) // layout.max_patches)
    kinds = (
        (seen, style.OBSTACLE, "seen"),
        (~seen & found.visible_patches, style.LIMIT, "left out"),
        (~found.visible_patches, style.ROBOT, "cannot be seen"),
    )
    for chosen, colour, label in kinds:
        shown_centres = patches.centres[chosen][::step]
        if len(shown_centres):
            space.scatter(*shown_centres.T, s=1.5, color=colour, label=label, depthshade=False)
    ahead = layout.heading_length * np.column_stack(
        [np.cos(found.viewpoints.headings), np.sin(found.viewpoints.headings)]
    )
    space.scatter(*places.T, s=10, color=style.TETHER, label="waypoints", depthshade=False)
    space.scatter(*found.mission.anchor, marker="*", s=70, color=style.BASE, label="anchor")
    space.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", zlabel=f"z ({unit})", aspect="equal")
    space.legend(loc="upper left", fontsize=8)
    names = ("x", "y", "z")
    views = ((0, 1, "from above"), (0, 2, "from the side"))
    for panel, (a, b, name) in zip(halves[1].subplots(2, 1), views, strict=True):
        for chosen, colour, _ in kinds:
            panel.plot(*patches.centres[chosen][::step][:, [a, b]].T, ".", ms=1.2, color=colour)
        panel.plot(places[:, a], places[:, b], ".", ms=5, color=style.TETHER)
        rise = ahead[:, 1] if b == 1 else np.zeros(len(ahead))
        for p, dx, dy in zip(places, ahead[:, 0], rise, strict=True):
            panel.plot([p[a], p[a] + dx], [p[b], p[b] + dy], color=style.TETHER, lw=0.7)
        panel.plot(found.mission.anchor[a], found.mission.anchor[b], "*", color=style.BASE)
        panel.set(xlabel=f"{names[a]} ({unit})", ylabel=f"{names[b]} ({unit})", aspect="equal")
        panel.set_title(name, fontsize=9)
    figure.suptitle(
        f"{found.mission.name}: {len(places)} waypoints see {100 * found.seen:.1f} % of the "
        f"surface; {100 * found.visible:.1f} % can be seen at all"
    )
    style.save(figure, file, dpi=120)
