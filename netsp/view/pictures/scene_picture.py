"""Figures of scenes with path and tether; `netsp.view.pictures.interactive` makes web pages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.view.pictures import style
from netsp.view.pictures.picture_layout import SpaceLayout
from netsp.view.pictures.waypoint_marks import WaypointMarks
from netsp.world.scene.scene import Scene
from netsp.world.scene.shapes import HalfSpace
from netsp.world.scene.surfaces import Triangles, drawn_points, extent, surface_of
from netsp.world.tether import Tether

INTERACTIVE = ".html"


def save(
    scene: Scene,
    file: str | Path,
    *,
    path: npt.ArrayLike | None = None,
    tether: Tether | None = None,
    title: str | None = None,
    stops: WaypointMarks | None = None,
) -> None:
    """Draw a scene, with a path (k, 3), a tether and waypoints if given, to a file.

    The ending of its name chooses a figure (.png, .svg, .pdf) or a self-contained page (.html).

    Raises
    ------
    InputError
        The name has another ending, the file cannot be written, or plotly, which .html needs, is
        not installed.
    """
    style.check_format(file, INTERACTIVE)
    line = np.zeros((0, 3)) if path is None else np.asarray(path, dtype=float).reshape(-1, 3)
    nodes = np.zeros((0, 3)) if tether is None else tether.nodes
    low, high = extent(scene, line, nodes, *(() if stops is None else (stops.every_place,)))
    parts = parts_of(scene, low, high)
    title = title or _title(scene, line, tether)
    if Path(file).suffix.lower() == INTERACTIVE:
        from netsp.view.pictures.interactive import write_scene

        write_scene(scene, parts, line, nodes, title, stops, file)
    else:
        style.save(_figure(scene, parts, line, nodes, (low, high), title, stops), file)


def figure_of(scene: Scene, path: Floats, title: str, stops: WaypointMarks) -> Any:
    """Return the picture of a scene as a Matplotlib figure.

    Parameters
    ----------
    scene : Scene
        Scene to draw.
    path : ndarray, shape (k, 3)
        Path of the robot, metres.
    title : str
        Title of the figure.
    stops : WaypointMarks
        Waypoints.
    """
    low, high = extent(scene, path, stops.every_place)
    nothing = np.zeros((0, 3))
    return _figure(scene, parts_of(scene, low, high), path, nothing, (low, high), title, stops)


def _title(scene: Scene, path: Floats, tether: Tether | None) -> str:
    words = [scene.name]
    if len(path):
        walked = polylines.length(path)
        words.append(f"path {walked:.4g} {scene.units}")
    if tether is not None:
        words.append(f"taut tether {tether.length:.4g} {scene.units}")
    return ", ".join(words)


def parts_of(scene: Scene, low: Floats, high: Floats) -> list[tuple[str, Triangles]]:
    """Return the parts of the scene that are drawn, by name."""
    out = []
    for k, solid in enumerate(scene.all_solids()):
        if isinstance(solid.shape, HalfSpace) and len(scene.all_solids()) > 1:
            continue
        out.append((solid.name or f"solids[{k}]", surface_of(solid.shape, low, high)))
    return out + scene.meshes()


def _figure(
    scene: Scene,
    parts: Sequence[tuple[str, Triangles]],
    path: Floats,
    nodes: Floats,
    box: tuple[Floats, Floats],
    title: str,
    stops: WaypointMarks | None = None,
) -> Any:
    """Return a figure with a view in space, one from above and two from the sides."""
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    low, high = box
    figure = Figure(figsize=(13, 7.5), layout="constrained")
    halves: Any = figure.subfigures(1, 2, width_ratios=[1.15, 1.0])
    left, right = halves
    ax: Any = left.add_subplot(projection="3d")
    draw_space(scene, path, nodes, ax=ax, stops=stops)
    cloud = drawn_points(scene) if scene.cloud is not None else np.zeros((0, 3))
    unit = scene.units
    names = ("x", "y", "z")
    views = ((0, 1, "from above"), (0, 2, "from the south"), (1, 2, "from the east"))
    size = high - low
    if size[2] > SpaceLayout.tall_ratio * max(size[0], size[1]):
        wide = {"width_ratios": [size[a] for a, _, _ in views]}
        panels, room = right.subplots(1, 3, **wide), (1.3, 5.5)
    else:
        panels, room = right.subplots(3, 1), (4.7, 1.7)
    for panel, (a, b, name) in zip(panels, views, strict=True):
        for _, (vertices, faces) in parts:
            flat: Any = vertices[faces][:, :, [a, b]]
            panel.add_collection(PolyCollection(flat, facecolors=style.OBSTACLE, linewidths=0))
        if len(cloud):
            panel.plot(cloud[:, a], cloud[:, b], ".", ms=0.4, color=style.OBSTACLE)
        draw_lines(panel, path, nodes, (a, b))
        if stops is not None:
            draw_stops(panel, stops, (a, b))
        panel.set(xlim=(low[a], high[a]), ylim=(low[b], high[b]), aspect="equal")
        scale = min(room[0] / size[a], room[1] / size[b])  # inches
        for axis, along in ((panel.xaxis, a), (panel.yaxis, b)):
            count = int(np.clip(scale * size[along] / SpaceLayout.tick_spacing, 2, 5))
            axis.set_major_locator(MaxNLocator(count))
        panel.set_title(name, fontsize=9)
        panel.set(xlabel=f"{names[a]} ({unit})", ylabel=f"{names[b]} ({unit})")
    figure.suptitle(title)
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        left.legend(handles, labels, loc="lower left", fontsize=8)
    return figure


def draw_space(
    scene: Scene, path: Floats, nodes: Floats, *, ax: Any = None, stops: WaypointMarks | None = None
) -> Any:
    """Draw solids, path (k, 3), tether (n, 3) and waypoints on given or new 3D axes; return
    them."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    if ax is None:
        ax = Figure(figsize=(8, 7), layout="constrained").add_subplot(projection="3d")
    low, high = extent(scene, path, nodes, *(() if stops is None else (stops.every_place,)))
    for _, (vertices, faces) in parts_of(scene, low, high):
        triangles = vertices[faces]
        ax.add_collection3d(
            Poly3DCollection(triangles, facecolors=shaded(triangles), alpha=0.35, linewidths=0)
        )
    if scene.cloud is not None:
        ax.plot(*drawn_points(scene).T, ".", ms=0.6, color=style.OBSTACLE)
    draw_lines(ax, path, nodes, (0, 1, 2))
    if stops is not None:
        draw_stops(ax, stops, (0, 1, 2))
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low, zoom=0.8)  # room for the labels
    # labels beyond the tick numbers, and farther out along longer sides
    widest = float((high - low).max())
    for name, size in zip("xyz", high - low, strict=True):
        label = getattr(ax, f"set_{name}label")
        more = 20.0 if name == "z" else 12.0  # whose numbers are written along
        label(f"{name} ({scene.units})", labelpad=2.0 + more * float(size) / widest)
    ax.tick_params(labelsize=7)
    for axis, size in zip((ax.xaxis, ax.yaxis, ax.zaxis), high - low, strict=True):
        axis.set_major_locator(MaxNLocator(5 if size > 0.5 * widest else 3))
    return ax


def draw_stops(ax: Any, stops: WaypointMarks, axes: tuple[int, ...]) -> None:
    """Draw waypoints on two or three of the axes (0, 1, 2), with numbers if they are few."""
    columns = list(axes)
    is_left_out = np.isin(np.arange(len(stops.places)), stops.left_out)
    to_visit = {"marker": "o", "ms": 4, "color": style.GOAL, "mec": style.PATH, "mew": 1.0}
    visited = {"marker": "o", "ms": 4, "color": style.VISITED}
    for chosen, look, label in (
        (~is_left_out, visited if stops.visited else to_visit, stops.name),
        (is_left_out, {"marker": "x", "ms": 6, "mew": 1.8, "color": style.LEFT_OUT}, "not visited"),
    ):
        chosen_places = stops.places[chosen][:, columns]
        if len(chosen_places):
            ax.plot(*chosen_places.T, ls="none", label=label, **look)
    if len(columns) == 2 and len(stops.places) <= SpaceLayout.max_numbered:
        for k, (x, y) in enumerate(stops.places[:, columns]):
            ax.annotate(
                str(k),
                (x, y),
                xytext=(3, 3),
                textcoords="offset points",
                fontsize=7,
                path_effects=style.halo(),
            )
    if stops.anchor is not None:
        place = np.array(stops.anchor)[columns]
        ax.plot(*place[:, None], "*", color=style.BASE, ms=9, ls="none", label="anchor")


def shaded(triangles: Floats) -> Floats:
    """Return the grey of each triangle by how much it faces the light."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(normals, axis=1)
    light = np.array([0.4, -0.5, 0.77])
    facing = np.abs(normals @ light) / np.where(size > 0.0, size, 1.0)
    grey = 0.45 + 0.4 * facing
    return np.column_stack([grey, grey, np.minimum(1.0, grey + 0.04)])


def draw_lines(ax: Any, path: Floats, nodes: Floats, axes: tuple[int, ...]) -> None:
    """Draw path and tether, with its ends, on two or three of the axes (0, 1, 2) of space."""
    columns = list(axes)
    if len(path):
        ax.plot(*path[:, columns].T, color=style.PATH, lw=0.9, alpha=0.8, label="path")
    if len(nodes):
        ax.plot(*nodes[:, columns].T, color=style.TETHER, lw=1.8, label="tether")
        # the anchor last: at home the robot is there, too
        ends = (nodes[-1], style.ROBOT, "o", "robot"), (nodes[0], style.BASE, "*", "anchor")
        for point, colour, marker, name in ends:
            ax.plot(*point[columns][:, None], marker, color=colour, ms=8, label=name)
