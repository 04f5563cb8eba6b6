"""Self-contained web pages with a view in space that can be turned (plotly).

The pages contain plotly, 4.8 MB of text, in compressed form.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.errors import InputError
from netsp.base.files import write_text
from netsp.base.geometry import polylines
from netsp.view.pictures import style
from netsp.view.pictures.picture_layout import PageLayout
from netsp.view.pictures.waypoint_marks import WaypointMarks
from netsp.world.scene.scene import Scene
from netsp.world.scene.surfaces import Triangles, drawn_points

EYE = {"x": 1.5, "y": -1.6, "z": 1.0}
"""Point of view of a scene, in units of its size: from the south-east, as in figures."""

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>html, body, #figure {{ margin: 0; width: 100%; height: 100% }}
body {{ font-family: sans-serif }} #wait {{ padding: 2em }}</style></head>
<body><div id="figure"><p id="wait">unpacking {title} …</p></div>
<script>
const packed = {packed};
async function unpack(text) {{
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}}
(async () => {{
  try {{
    const [library, figure] = await Promise.all(packed.map(unpack));
    const script = document.createElement("script");
    script.textContent = library;
    document.head.append(script);
    document.getElementById("wait").remove();
    await Plotly.newPlot("figure", JSON.parse(figure));
  }} catch (error) {{
    document.getElementById("wait").textContent =
      `This page needs a browser of 2023 or later (${{error}}).`;
  }}
}})();
</script></body></html>
"""


def write_figure(
    figure: Any, title: str, file: str | Path, frames: Sequence[dict[str, Any]] = ()
) -> None:
    """Write a figure of plotly as a self-contained page.

    Parameters
    ----------
    figure : plotly.graph_objects.Figure
        Figure without frames.
    frames : sequence of dict
        Frames in plotly's JSON: plotly would need seconds to validate them as objects.
    title : str
        Title of the page.
    file : str or Path
        File to write; an existing one is replaced.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    trace_fields = {
        "data": figure.data,
        "layout": figure.layout,
        "frames": frames,
        "config": {"responsive": True, "displaylogo": False},
    }
    packed = json.dumps([_packed_library(), _packed(json.dumps(_plain(trace_fields)))])
    write_text(file, PAGE.format(title=html.escape(title), packed=packed))


@cache
def _packed_library() -> str:
    from plotly.offline import get_plotlyjs

    return _packed(get_plotlyjs())


def _packed(text: str) -> str:
    """Compress a text to the same bytes every time, without a time stamp."""
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


def _plain(value: Any) -> Any:
    """Return a value for plotly's JSON: short decimals compress better than its binary arrays."""
    if hasattr(value, "to_plotly_json"):
        value = value.to_plotly_json()
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        value = (
            np.round(value, PageLayout.digits).tolist()
            if value.dtype.kind == "f"
            else value.tolist()
        )
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float):
        return round(value, PageLayout.digits)
    return value


def write_scene(
    scene: Scene,
    parts: Sequence[tuple[str, Triangles]],
    path: Floats,
    nodes: Floats,
    title: str,
    stops: WaypointMarks | None,
    file: str | Path,
) -> None:
    """Write a page of a scene, as `netsp.view.pictures.scene_picture.save` does."""
    go = plotly_objects()
    figure = go.Figure()
    for name, (vertices, faces) in parts:
        figure.add_trace(mesh_trace(name, vertices, faces))
    if scene.cloud is not None:
        x, y, z = drawn_points(scene).T
        marker = {"size": 1.2, "color": style.OBSTACLE}
        figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name="cloud"))
    if len(path):
        figure.add_trace(line_trace("path", path, style.PATH, 3))
    if len(nodes):
        figure.add_trace(line_trace("tether", nodes, style.TETHER, 6))
        for name, point, colour in (
            ("anchor", nodes[0], style.BASE),
            ("robot", nodes[-1], style.ROBOT),
        ):
            figure.add_trace(point_trace(name, point, colour))
    if stops is not None:
        for trace in stop_traces(stops):
            figure.add_trace(trace)
        if stops.anchor is not None:
            figure.add_trace(point_trace("anchor", np.array(stops.anchor), style.BASE))
    figure.update_layout(**layout(title, scene.units))
    write_figure(figure, title, file)


def stop_traces(stops: WaypointMarks) -> list[dict[str, Any]]:
    """Return the traces of visited and other waypoints on an interactive page."""
    out = []
    left = np.isin(np.arange(len(stops.places)), stops.left_out)
    visited = {"color": style.VISITED, "size": 3}
    to_visit = {"color": style.PATH, "size": 4, "symbol": "circle-open"}
    for chosen, name, marker in (
        (~left, stops.name, visited if stops.visited else to_visit),
        (left, "not visited", {"color": style.LEFT_OUT, "size": 4, "symbol": "x"}),
    ):
        if chosen.any():
            x, y, z = stops.places[chosen].T
            names = [f"#{k}" for k in np.flatnonzero(chosen)]
            out.append(marks_trace(name, (x, y, z), marker, names))
    return out


def plotly_objects() -> Any:
    """Return `plotly.graph_objects`; raise InputError if plotly is not installed."""
    try:
        import plotly.graph_objects as go
    except ImportError:
        raise InputError("interactive pages need plotly: pip install 'netsp[online]'") from None
    return go


def mesh_trace(name: str, vertices: Floats, faces: npt.NDArray[np.int64]) -> Any:
    """Return a part of the scene on an interactive page."""
    x, y, z = np.round(vertices, 4).T
    i, j, k = faces.T
    return plotly_objects().Mesh3d(
        x=x,
        y=y,
        z=z,
        i=i,
        j=j,
        k=k,
        color=style.OBSTACLE,
        flatshading=True,
        name=name,
        hoverinfo="name",
        lighting={"ambient": 0.55, "diffuse": 0.7, "specular": 0.1},
    )


def seen(points: Floats) -> Ints:
    """Return the indices of the points of a line (k, 3) that make a visible difference."""
    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    return np.flatnonzero(polylines.essential(points, PageLayout.min_deviation * size))


def line_trace(name: str, points: Floats, colour: str, width: float) -> dict[str, Any]:
    """Return a polyline on an interactive page, as plotly's JSON has it."""
    x, y, z = points[seen(points)].T
    line = {"color": colour, "width": width}
    return {
        "line": line,
        "mode": "lines",
        "name": name,
        "x": x,
        "y": y,
        "z": z,
        "type": "scatter3d",
    }


def point_trace(name: str, point: Floats, colour: str) -> dict[str, Any]:
    """Return a point on an interactive page, as plotly's JSON has it."""
    x, y, z = ([float(v)] for v in point)
    return marks_trace(name, (x, y, z), {"color": colour, "size": 5})


def marks_trace(
    name: str, places: Sequence[Any], marker: dict[str, Any], texts: Sequence[str] | None = None
) -> dict[str, Any]:
    """Return points on an interactive page, as plotly's JSON has them.

    Parameters
    ----------
    name : str
        Name in the legend.
    places : sequence
        Coordinates x, y and z of all points.
    marker : dict
        Colour, size and symbol.
    texts : sequence of str, optional
        Text that is shown at each point under the cursor.
    """
    x, y, z = places
    text = {} if texts is None else {"text": list(texts)}
    return {
        "marker": marker,
        "mode": "markers",
        "name": name,
        **text,
        "x": x,
        "y": y,
        "z": z,
        "type": "scatter3d",
    }


def layout(title: str, units: str) -> dict[str, Any]:
    """Return the layout of an interactive page."""
    axes = {f"{a}axis": {"title": {"text": f"{a} ({units})"}} for a in "xyz"}
    return {
        "title": {"text": title},
        "scene": {"aspectmode": "data", "camera": {"eye": EYE}, **axes},
        "margin": {"l": 0, "r": 0, "t": 50, "b": 0},
        "legend": {"x": 0.01, "y": 0.99},
    }
