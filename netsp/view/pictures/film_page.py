"""Web page of films in space: views can be turned, and a slider moves robots and tethers."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from netsp.view.pictures import style
from netsp.view.pictures.film import Film, steps_of
from netsp.view.pictures.interactive import (
    layout,
    line_trace,
    marks_trace,
    mesh_trace,
    plotly_objects,
    point_trace,
    write_figure,
)
from netsp.view.pictures.moments import LEFT_OUT, VISITED, Moment
from netsp.view.pictures.picture_layout import PageLayout
from netsp.view.pictures.scene_picture import parts_of
from netsp.world.scene.surfaces import extent


def save_page(
    films: Sequence[Film], title: str, file: str | Path, page: PageLayout = PageLayout()
) -> None:
    """Write a self-contained page with one slider for all films.

    Parameters
    ----------
    films : sequence of Film
        Films in space, from left to right.
    title : str
        Title of the page.
    file : str or Path
        File to write; an existing one is replaced.
    page : PageLayout
        Number of moments and their duration.

    Raises
    ------
    InputError
        Plotly is not installed, or the file cannot be written.
    """
    plotly_objects()
    from plotly.subplots import make_subplots

    columns = len(films)
    # plotly treats titles as HTML and does not wrap them
    titles = [
        "<br>".join(
            html.escape(part)
            for line in film.title.split("\n")[film.title.startswith(f"{title}\n") :]
            for part in textwrap.wrap(line, page.title_letters // columns)
        )
        for film in films
    ]
    figure = make_subplots(
        rows=1,
        cols=columns,
        specs=[[{"type": "scene"}] * columns],
        subplot_titles=titles,
        horizontal_spacing=0.01,
    )
    figure.update_annotations(font={"size": 13}, yanchor="bottom")
    what, found = steps_of(films, page.frames)
    changing: list[list[dict[str, Any]]] = [[] for _ in found]
    numbers: list[int] = []
    for k, film in enumerate(films):
        assert film.scene is not None
        low, high = extent(film.scene, film.moments[-1].path, film.places)
        for name, (vertices, faces) in parts_of(film.scene, low, high):
            trace = mesh_trace(name, vertices, faces)
            trace.showlegend = False
            figure.add_trace(trace, row=1, col=k + 1)
        for f, step in enumerate(found):
            moving = _moving(film, film.moments[step.moments[k]])
            if f == 0:
                for trace in moving:
                    trace["showlegend"] = k == 0
                    numbers.append(len(figure.data))
                    figure.add_trace(trace, row=1, col=k + 1)
            changing[f] += moving
    names = [step.name for step in found]
    frames = [
        {"data": traces, "name": name, "traces": numbers}
        for name, traces in zip(names, changing, strict=True)
    ]
    now = {"frame": {"duration": 0, "redraw": True}, "mode": "immediate"}
    steps = [{"args": [[name], now], "label": name, "method": "animate"} for name in names]
    base = layout(title, "")
    scenes = {
        f"scene{k + 1 if k else ''}": layout("", film.scene.units if film.scene else "")["scene"]
        for k, film in enumerate(films)
    }
    lines = max(text.count("<br>") + 1 for text in titles)
    figure.update_layout(
        title={"text": html.escape(title), "x": 0.01, "y": 0.985, "yanchor": "top"},
        margin={"l": 0, "r": 0, "t": 45 + 18 * lines, "b": 115},
        legend=base["legend"],
        sliders=[
            {
                "steps": steps,
                "currentvalue": {"prefix": f"{what} "},
                "pad": {"t": 20},
                "x": 0.17,
                "len": 0.81,
            }
        ],
        updatemenus=[_play(page)],
        **scenes,
    )
    write_figure(figure, title, file, frames)


def _moving(film: Film, moment: Moment) -> list[dict[str, Any]]:
    """Return the traces that change with each moment."""
    visited, left = (list(moment.fates.get(fate, ())) for fate in (VISITED, LEFT_OUT))
    rest = sorted(set(range(len(film.places))) - {*visited, *left})
    return [
        _marks(film, "waypoint", rest, color=style.PATH, size=4, symbol="circle-open"),
        _marks(film, "waypoint visited", visited, color=style.VISITED, size=4),
        _marks(film, "waypoint left out", left, color=style.LEFT_OUT, size=4, symbol="x"),
        line_trace("path", moment.path, style.PATH, 3),
        line_trace("taut tether", moment.nodes, style.TETHER, 6),
        point_trace("robot", moment.nodes[-1], style.ROBOT),
        point_trace("anchor", moment.nodes[0], style.BASE),
    ]


def _marks(film: Film, name: str, which: list[int], **marker: Any) -> dict[str, Any]:
    """Return the trace of waypoints of one kind.

    If there are none, it has an invisible point, so that the kind is in the legend.
    """
    x, y, z = film.places[which].T if which else ([None], [None], [None])
    return marks_trace(name, (x, y, z), marker, [f"#{k}" for k in which])


def _play(page: PageLayout) -> dict[str, Any]:
    """Return the buttons that play and pause the film."""
    on = {
        "frame": {"duration": page.duration_ms // page.frames, "redraw": True},
        "fromcurrent": True,
        "transition": {"duration": 0},
    }
    stop = {"frame": {"duration": 0, "redraw": False}, "mode": "immediate"}
    buttons = [
        {"label": "▶ play", "method": "animate", "args": [None, on]},
        {"label": "❚❚ pause", "method": "animate", "args": [[None], stop]},
    ]
    return {
        "type": "buttons",
        "direction": "left",
        "buttons": buttons,
        "showactive": False,
        "x": 0.0,
        "xanchor": "left",
        "y": 0.0,
        "yanchor": "top",
        "pad": {"t": 40, "l": 8},
    }
