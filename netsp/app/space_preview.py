"""Preview in space: solids, goals, path and tether as a plotly figure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.base.errors import InputError
from netsp.view.pictures import style
from netsp.view.pictures.interactive import layout, line_trace, mesh_trace, plotly_objects
from netsp.view.pictures.scene_picture import parts_of
from netsp.world.scene.scene import Scene
from netsp.world.scene.surfaces import extent


def script() -> Path:
    """Return the path of plotly's script, which its package contains.

    Raises
    ------
    InputError
        Plotly is not installed.
    """
    plotly_objects()
    import plotly

    return Path(plotly.__file__).parent / "package_data" / "plotly.min.js"


def figure(
    scene: Scene, data: dict[str, Any], path: npt.ArrayLike, tether: npt.ArrayLike = ()
) -> dict[str, Any]:
    """Return solids, goals, path and tether as a plotly figure.

    Parameters
    ----------
    scene : Scene
        The solids.
    data : dict
        Problem, in the format of problem files.
    path : array_like, shape (n, 3)
        Path of the robot; may be empty.
    tether : array_like, shape (m, 3)
        Tether; may be empty.

    Returns
    -------
    dict
        ``data`` and ``layout`` of plotly; the tether is the last of the data.

    Raises
    ------
    InputError
        Plotly is not installed.
    """
    go = plotly_objects()
    flown = np.array(path, dtype=float).reshape(-1, 3)
    nodes = np.array(tether, dtype=float).reshape(-1, 3)
    base = np.array([*data["base"], 0.0, 0.0][:3], dtype=float)
    places = np.array([[*_position(g), 0.0, 0.0][:3] for g in data["goals"]], dtype=float).reshape(
        -1, 3
    )
    low, high = extent(scene, np.vstack([flown, places, base]), np.zeros((0, 3)))
    drawn = go.Figure()
    for name, (vertices, faces) in parts_of(scene, low, high):
        trace = mesh_trace(name, vertices, faces)
        trace.showlegend = False
        drawn.add_trace(trace)
    names = [_name(g, k) for k, g in enumerate(data["goals"])]
    x, y, z = places.T
    drawn.add_trace(
        go.Scatter3d(
            x=x,
            y=y,
            z=z,
            mode="markers",
            name="goals",
            text=names,
            hoverinfo="text",
            marker={"size": 4, "color": style.PATH},
        )
    )
    drawn.add_trace(
        go.Scatter3d(
            x=base[:1],
            y=base[1:2],
            z=base[2:],
            mode="markers",
            name="base",
            marker={"size": 6, "color": style.BASE, "symbol": "diamond"},
        )
    )
    drawn.add_trace(line_trace("path", flown, style.PATH, 3))
    drawn.add_trace(line_trace("tether", nodes, style.TETHER, 6))
    drawn.update_layout(**layout("", str(data.get("units", "m"))))
    return dict(json.loads(drawn.to_json()))


def _position(goal: Any) -> list[float]:
    place = goal["position"] if isinstance(goal, dict) else goal
    if not isinstance(place, list):
        raise InputError("there is no tour yet")
    return place


def _name(goal: Any, k: int) -> str:
    return str(goal.get("name") or f"#{k}") if isinstance(goal, dict) else f"#{k}"
