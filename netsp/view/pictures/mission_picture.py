"""Pictures of missions, of one run or of two side by side.

They show coverage and tether length over time, as in Figs. 4 and 7 of Amer et al. 2025, and the
paths in space.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.errors import counted
from netsp.plan.space.space_world import SpaceWorld
from netsp.view.pictures import style
from netsp.view.pictures.scene_picture import draw_space, save
from netsp.view.pictures.waypoint_marks import WaypointMarks
from netsp.world.mission.anchor_track import AnchorTrack
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import Run
from netsp.world.scene.scene import Scene
from netsp.world.tether import Tether

DASHES = ("-", "-.")
"""Line styles of two runs side by side, so that they differ in grey prints."""


def path_of(run: Run) -> Floats:
    """Return the path of the robot (n, 3)."""
    return np.array([[r.x, r.y, r.z] for r in run.log])


def title_of(run: Run) -> str:
    """Return the title of a run, in one line."""
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


def stops_of(run: Run) -> WaypointMarks:
    """Return the marks of the waypoints of a run."""
    visited = {int(stop["waypoint"]) for stop in run.summary["stops"]}
    left = tuple(sorted(set(range(len(run.mission.waypoints))) - visited))
    return WaypointMarks(run.mission.places, left, visited=True)


def save_mission(mission: Mission, scene: Scene, file: str | Path) -> None:
    """Draw the waypoints of a mission in order, and its tour if it has one, to a file.

    Raises
    ------
    InputError
        `netsp.view.pictures.scene_picture.save` raises it.
    """
    tour, count = mission.tour, len(mission.waypoints)
    left = () if tour is None else tuple(range(len(tour.stops), count))
    title = f"{mission.name}: {counted(count, 'waypoint')}"
    if tour is not None:
        title += f", tour {tour.length:.5g} {scene.units}"
    save(
        scene,
        file,
        path=None if tour is None else tour.line,
        title=title,
        stops=WaypointMarks(mission.places, left, mission.anchor),
    )


def save_runs(runs: Sequence[Run], scene: Scene, file: str | Path) -> None:
    """Draw tether length and coverage of runs over time, and each run in space, to a file.

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
        track = AnchorTrack.for_mission(run.mission)
        if track is not None:
            gone = track.between(0.0, run.log[-1].time)
            ax.plot(*gone.T, color=style.BASE, lw=1.2, ls="--", label="anchor's track")
        ax.set_title(title_of(run), fontsize=9)
        ax.legend(loc="upper left", fontsize=7)
    figure.suptitle(runs[0].mission.name)
    style.save(figure, file, dpi=120)


def draw_tether(runs: Sequence[Run], *, ax: Any = None, units: str = "m") -> Any:
    """Draw the length of the taut tether over time on given or new axes, and return the axes.

    Slack and sag are drawn, if any; for a single run, tether recovery is marked.
    """
    from matplotlib.figure import Figure

    if ax is None:
        ax = Figure(figsize=(8, 4), layout="constrained").subplots()
    colours = style.RUNS if len(runs) > 1 else (style.TETHER,)
    for run, colour, dashes in zip(runs, colours, DASHES, strict=False):
        t = np.array([r.time for r in run.log])
        recovering = [r.mode == "recovery" for r in run.log]
        if len(runs) == 1 and any(recovering):
            ax.fill_between(
                t,
                0,
                1,
                where=recovering,
                color=style.RECOVERY,
                transform=ax.get_xaxis_transform(),
                label="tether recovery",
            )
        ax.plot(t, [r.payout for r in run.log], color=colour, lw=1.3, ls=dashes, label=run.planner)
    longest = max(runs, key=lambda run: len(run.log))
    ax.plot(
        [r.time for r in longest.log],
        [r.limit for r in longest.log],
        color=style.LIMIT,
        lw=1.0,
        ls="--",
        label="limit",
    )
    what = "payout" if any(r.payout > r.tether for run in runs for r in run.log) else "taut tether"
    max_length = max(max(r.payout, r.limit) for run in runs for r in run.log)
    ax.set(xlabel="time (s)", ylabel=f"{what} ({units})", ylim=(0, 1.06 * max_length))
    ax.legend(loc="best", fontsize=8)
    return ax


def draw_run(run: Run, *, ax: Any = None) -> Any:
    """Draw the length of the taut tether of one run over time; see `draw_tether`."""
    return draw_tether([run], ax=ax)


def draw_coverage(runs: Sequence[Run], *, ax: Any = None) -> Any:
    """Draw the area seen by the camera over time on given or new axes, and return the axes."""
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
    """Return the tethers at rows of the log, given in ascending order.

    The run is simulated again, unless its tethers were kept because the scene changed.
    """
    if run.tethers:
        rows = np.array([row for row, _ in run.tethers])
        return [run.tethers[k][1] for k in np.searchsorted(rows, moments, side="right") - 1]
    mission = run.mission
    world = SpaceWorld(mission, scene)
    model, state = world.model, world.present_tether
    path, out, at = path_of(run), [], 0
    track = AnchorTrack.for_mission(mission)
    for row in moments:
        if track is None:
            state = model.drive(state, path[at : int(row) + 1])[0]
        else:
            for k in range(at, int(row) + 1):
                state = model.update(state, path[k], track(run.log[k].time))
        out.append(state)
        at = int(row) + 1
    return out
