"""Pictures of missions: what was seen and how long the tether was over time (as in Figs. 4 and 7 of
Amer et al. 2025), and the paths in space, of one run or of two side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.arrays import Floats
from netsp.online.laid import present_tether
from netsp.online.log import Run
from netsp.online.scene.scene import Scene
from netsp.online.scene.surfaces import extent
from netsp.online.simulate import grid_of
from netsp.online.tether import GeodesicTether, Tether
from netsp.online.track import Track
from netsp.pictures import style
from netsp.pictures.interactive import (
    layout,
    line_trace,
    mesh_trace,
    plotly_objects,
    point_trace,
    seen,
    stop_traces,
    write_figure,
)
from netsp.pictures.scene import (
    Stops,
    draw_space,
    parts_of,
)

FRAMES, FILM_MS = 120, 12_000
"""Of a page: moments that its slider knows, and milliseconds in which they go by."""


DASHES = ("-", "-.")
"""Of two runs side by side, so that they can be told apart in grey."""


def path_of(run: Run) -> Floats:
    """(n, 3) where the robot was."""
    return np.array([[r.x, r.y, r.z] for r in run.log])


def title_of(run: Run) -> str:
    """A run in one line."""
    s = run.summary
    return (
        f"{s['planner']}: {s['visited']} of {s['waypoints']} in {s['inspection_s']:.0f} s"
        + (
            f", home after {s['inspection_s'] + s['home']['seconds']:.0f} s"
            if s["home"]["reached"]
            else ""
        )
        + f", longest tether {s['longest_tether']:.2f} of {s['tether_length']:g} m; "
        + ("tether free at home" if s["home"]["tether_free"] else "tether not free at the end")
    )


def stops_of(run: Run) -> Stops:
    """Its waypoints, and which of them were not visited."""
    visited = {int(stop["waypoint"]) for stop in run.summary["stops"]}
    left = tuple(sorted(set(range(len(run.mission.waypoints))) - visited))
    return Stops(run.mission.places, left, name="waypoint visited")


def save_runs(runs: Sequence[Run], scene: Scene, file: str | Path) -> None:
    """Tether length and coverage over time, and each run in space.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    from matplotlib.figure import Figure

    seen = runs[0].summary["coverage"] is not None
    figure = Figure(figsize=(13, 5.5 + 4.5 * (len(runs) - 1)), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[1.0, 1.1])  # type: ignore[misc]
    charts = np.atleast_1d(left.subplots(2 if seen else 1, 1, sharex=True))
    draw_tether(runs, ax=charts[0], units=scene.units)
    if seen:
        draw_coverage(runs, ax=charts[1])
        charts[0].set_xlabel("")
    axes = right.subplots(len(runs), 1, subplot_kw={"projection": "3d"}, squeeze=False)[:, 0]
    for run, ax in zip(runs, axes, strict=True):
        draw_space(scene, path_of(run), run.tether.nodes, ax=ax, stops=stops_of(run))
        track = Track.of(run.mission)
        if track is not None:
            gone = track.between(0.0, run.log[-1].time)
            ax.plot(*gone.T, color=style.BASE, lw=1.2, ls="--", label="anchor's track")
        ax.set_title(title_of(run), fontsize=9)
        ax.legend(loc="upper left", fontsize=7)
    figure.suptitle(runs[0].mission.name)
    style.save(figure, file, dpi=120)


def draw_tether(runs: Sequence[Run], *, ax: Any = None, units: str = "m") -> Any:
    """The length of the taut tether over time, with slack and sag where there are any, on axes of
    the caller or on new ones; returns the axes. Of one run tether recovery is marked."""
    from matplotlib.figure import Figure

    if ax is None:
        ax = Figure(figsize=(8, 4), layout="constrained").subplots()
    colours = style.RUNS if len(runs) > 1 else (style.TETHER,)
    for run, colour, dashes in zip(runs, colours, DASHES, strict=False):
        t = np.array([r.time for r in run.log])
        recovering = [r.mode == "recovery" for r in run.log]
        if len(runs) == 1 and any(recovering):
            ax.fill_between(
                t, 0, 1, where=recovering, color=style.RECOVERY,
                transform=ax.get_xaxis_transform(), label="tether recovery",
            )  # fmt: skip
        ax.plot(t, [r.payout for r in run.log], color=colour, lw=1.3, ls=dashes, label=run.planner)
    longest = max(runs, key=lambda run: len(run.log))
    ax.plot(
        [r.time for r in longest.log], [r.limit for r in longest.log], color=style.LIMIT, lw=1.0,
        ls="--", label="limit",
    )  # fmt: skip
    what = "payout" if any(r.payout > r.tether for run in runs for r in run.log) else "taut tether"
    most = max(max(r.payout, r.limit) for run in runs for r in run.log)
    ax.set(xlabel="time (s)", ylabel=f"{what} ({units})", ylim=(0, 1.06 * most))
    ax.legend(loc="best", fontsize=8)
    return ax


def draw_run(run: Run, *, ax: Any = None) -> Any:
    """The length of the taut tether of one run over time; see `draw_tether`."""
    return draw_tether([run], ax=ax)


def draw_coverage(runs: Sequence[Run], *, ax: Any = None) -> Any:
    """What the camera has seen over time, on axes of the caller or on new ones; returns them."""
    from matplotlib.figure import Figure

    if ax is None:
        ax = Figure(figsize=(8, 4), layout="constrained").subplots()
    for run, colour, dashes in zip(runs, style.RUNS, DASHES, strict=False):
        t = np.array([r.time for r in run.log])
        ax.plot(t, [100 * r.coverage for r in run.log], color=colour, lw=1.3, ls=dashes)
        ax.plot(t, [100 * r.coverage_through for r in run.log], color=colour, lw=0.9, ls=":")
    ax.set(xlabel="time (s)", ylabel="seen (%)", ylim=(0, 100))
    if any(r.coverage != r.coverage_through for run in runs for r in run.log):
        ax.set_title("dotted: without occlusion", fontsize=8)
    return ax


def tethers_along(run: Run, scene: Scene, moments: npt.NDArray[np.int64]) -> list[Tether]:
    """The tether at some rows of the log, ascending: the run is driven again,
    unless its tethers were kept because the scene has changed."""
    if run.tethers:
        rows = np.array([row for row, _ in run.tethers])
        return [run.tethers[k][1] for k in np.searchsorted(rows, moments, side="right") - 1]
    mission = run.mission
    field = scene.field()
    model = GeodesicTether(field, mission.delta)
    state = present_tether(mission, field, model, grid_of(mission, scene, field))
    path, out, at = path_of(run), [], 0
    track = Track.of(mission)
    for row in moments:
        if track is None:
            state = model.drive(state, path[at : int(row) + 1])[0]
        else:
            for k in range(at, int(row) + 1):
                state = model.update(state, path[k], track(run.log[k].time))
        out.append(state)
        at = int(row) + 1
    return out


def save_page(runs: Sequence[Run], scene: Scene, file: str | Path) -> None:
    """A page that needs nothing else: each run in space with a slider for the time.

    Raises
    ------
    InputError
        Plotly is not installed, the file cannot be written.
    """
    go = plotly_objects()
    from plotly.subplots import make_subplots

    figure = make_subplots(
        rows=1, cols=len(runs), specs=[[{"type": "scene"}] * len(runs)],
        subplot_titles=[title_of(r) for r in runs], horizontal_spacing=0.01,
    )  # fmt: skip
    longest = max(r.log[-1].time for r in runs)
    times = np.linspace(0.0, longest, FRAMES)
    changing: list[list[Any]] = [[] for _ in times]
    numbers: list[int] = []
    for k, run in enumerate(runs):
        path = path_of(run)
        low, high = extent(scene, path, run.tether.nodes)
        for name, (vertices, faces) in parts_of(scene, low, high):
            trace = mesh_trace(name, vertices, faces)
            trace.showlegend = False
            figure.add_trace(trace, row=1, col=k + 1)
        for trace in stop_traces(stops_of(run)):
            trace.showlegend = k == 0
            figure.add_trace(trace, row=1, col=k + 1)
        told = seen(path)
        stamps = np.array([r.time for r in run.log])
        rows = np.minimum(np.searchsorted(stamps, times), len(stamps) - 1)
        tethers = tethers_along(run, scene, rows)
        for f, (row, tether) in enumerate(zip(rows, tethers, strict=True)):
            moving = [
                line_trace("path", path[[*told[told < row], row]], style.PATH, 3),
                line_trace("tether", tether.nodes, style.TETHER, 6),
                point_trace("robot", path[row], style.ROBOT),
                point_trace("anchor", tether.anchor, style.BASE),
            ]
            if f == 0:
                for trace in moving:
                    trace.showlegend = k == 0
                    numbers.append(len(figure.data))
                    figure.add_trace(trace, row=1, col=k + 1)
            changing[f] += moving
    figure.frames = [
        go.Frame(data=traces, traces=numbers, name=f"{t:.0f}")
        for t, traces in zip(times, changing, strict=True)
    ]
    now = {"frame": {"duration": 0, "redraw": True}, "mode": "immediate"}
    steps = [{"args": [[f"{t:.0f}"], now], "label": f"{t:.0f}", "method": "animate"} for t in times]
    base = layout(runs[0].mission.name, scene.units)
    scenes = {f"scene{k + 1 if k else ''}": base["scene"] for k in range(len(runs))}
    figure.update_layout(
        title=base["title"], margin={"l": 0, "r": 0, "t": 70, "b": 115}, legend=base["legend"],
        sliders=[{
            "steps": steps, "currentvalue": {"prefix": "time (s) "}, "pad": {"t": 20}, "x": 0.17,
            "len": 0.81,
        }],
        updatemenus=[_play()], **scenes,
    )  # fmt: skip
    write_figure(figure, runs[0].mission.name, file)


def _play() -> dict[str, Any]:
    """Buttons that have the frames go by."""
    on = {
        "frame": {"duration": FILM_MS // FRAMES, "redraw": True}, "fromcurrent": True,
        "transition": {"duration": 0},
    }  # fmt: skip
    stop = {"frame": {"duration": 0, "redraw": False}, "mode": "immediate"}
    buttons = [
        {"label": "▶ play", "method": "animate", "args": [None, on]},
        {"label": "❚❚ pause", "method": "animate", "args": [[None], stop]},
    ]
    return {
        "type": "buttons", "direction": "left", "buttons": buttons, "showactive": False,
        "x": 0.0, "xanchor": "left", "y": 0.0, "yanchor": "top", "pad": {"t": 40, "l": 8},
    }  # fmt: skip
