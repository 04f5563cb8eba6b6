"""Films: the robot moves along its tour with the taut tether behind it."""

from __future__ import annotations

import logging
import subprocess
import tempfile
import textwrap
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from netsp.base.errors import InputError
from netsp.model.problem import Problem
from netsp.view.pictures import style
from netsp.view.pictures.film import Film, steps_of
from netsp.view.pictures.moments import CANCELLED, LEFT_OUT, VISITED
from netsp.view.pictures.picture_layout import FilmLayout
from netsp.view.pictures.problem_picture import draw_map, view
from netsp.view.pictures.scene_picture import draw_space
from netsp.view.pictures.waypoint_marks import WaypointMarks

FORMATS = (".gif", ".mp4")

ROBOT = {"marker": "o", "ms": 9, "color": style.ROBOT, "mec": style.BASE, "mew": 0.8}

MARKS: tuple[tuple[str, dict[str, Any]], ...] = (
    (VISITED, {"marker": "o", "color": style.VISITED, "ms": 7}),
    (LEFT_OUT, {"marker": "x", "color": style.LEFT_OUT, "ms": 8, "mew": 2.2}),
    (CANCELLED, {"marker": "+", "color": style.CANCELLED, "ms": 9, "mew": 2.2}),
)
"""Marks of the fates of goals and waypoints."""


def save_animation(
    films: Sequence[Film],
    file: str | Path,
    seconds: float = 12.0,
    fps: int = 15,
    on_progress: Callable[[int, int], None] | None = None,
    layout: FilmLayout = FilmLayout(),
) -> None:
    """Write a GIF or MP4 of one film, or of several side by side.

    Parameters
    ----------
    films : sequence of Film
        Films from left to right.
    file : str or Path
        File whose name ends in .gif or .mp4.
    seconds : float
        Duration without the hold of the last picture, s.
    fps : int
        Pictures per second.
    on_progress : callable, optional
        Called with the number of pictures drawn and the number of all pictures.
    layout : FilmLayout
        Sizes, and the time for which the last picture is shown.

    Raises
    ------
    InputError
        The name has another ending, the file cannot be written, or `imageio-ffmpeg`, which .mp4
        needs, is not installed.
    """
    suffix = Path(file).suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"{file}: expected a name ending in {' or '.join(FORMATS)}")
    write = _write_gif if suffix == ".gif" else _write_mp4
    count = max(2, round(seconds * fps))
    target = Path(file).resolve()
    if target.exists() and not target.is_file():
        raise InputError(f"{file}: cannot be written: expected a file, not a device or a folder")
    try:
        # renamed into place when complete, so that Ctrl-C keeps an older file
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=".netsp-") as folder:
            part = Path(folder) / f"film{suffix}"
            write(
                part,
                _report_frames(_pictures(films, count, layout), count, on_progress),
                fps,
                layout,
            )
            part.replace(target)
    except OSError as error:
        raise InputError(f"{file}: cannot be written: {error.strerror or error}") from None


def _report_frames(
    pictures: Iterator[Any], count: int, on_progress: Callable[[int, int], None] | None
) -> Iterator[Any]:
    for k, picture in enumerate(pictures, 1):
        if on_progress is not None:
            on_progress(k, count)
        yield picture


def _pictures(films: Sequence[Film], count: int, layout: FilmLayout) -> Iterator[Any]:
    """Yield the pixels (h, w, 3) of each picture; fixed parts are drawn once for each map."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    handles, columns = _legend(films), layout.legend_columns * len(films)
    legend_lines = -(-len(handles) // columns)
    height = max(_height(film, layout) for film in films) + layout.legend_height * legend_lines
    size = layout.panel_width * len(films), height
    figure = Figure(figsize=size, dpi=layout.dpi, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    panels: list[Any] = [
        figure.add_subplot(1, len(films), k, projection="3d" if film.scene else None)
        for k, film in enumerate(films, 1)
    ]
    moving = [_moving(ax, film) for ax, film in zip(panels, films, strict=True)]
    figure.legend(
        handles=handles, loc="outside lower center", ncols=columns, fontsize=8, frameon=False
    )
    style.literal(figure)
    shown: list[Problem | None] | None = None
    still = None
    for step in steps_of(films, count)[1]:
        now = [film.moments[n] for film, n in zip(films, step.moments, strict=True)]
        if [moment.problem for moment in now] != shown:
            shown = [moment.problem for moment in now]
            _draw_maps(panels, films, shown, layout)
            style.literal(figure)
            canvas.draw()
            still = canvas.copy_from_bbox(figure.bbox)
        canvas.restore_region(still)
        for film, moment, artists in zip(films, now, moving, strict=True):
            marks = [film.places[list(moment.fates.get(fate, ()))] for fate, _ in MARKS]
            lines = [*marks, moment.path, moment.nodes, moment.nodes[-1:]]
            for line, points in zip(artists, lines, strict=False):
                if film.scene is not None:
                    line.set_data_3d(*points.T)
                else:
                    line.set_data(*points.T[:2])
            artists[-1].set_text(moment.text)
            for artist in artists:
                figure.draw_artist(artist)
        yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


def _moving(ax: Any, film: Film) -> tuple[Any, ...]:
    """Return the artists that change with each moment: marks, path, tether, robot and caption."""
    none: tuple[list[float], ...] = ([], [], []) if film.scene else ([], [])
    size = 0.6 if film.scene else 1.0
    marks = []
    for _, look in MARKS:
        smaller = {**look, "ms": size * float(look["ms"])}
        marks += ax.plot(*none, **smaller, ls="none", zorder=7, animated=True)
    (path,) = ax.plot(*none, color=style.PATH, lw=1.6, zorder=8, animated=True)
    (tether,) = ax.plot(*none, color=style.TETHER, lw=2.4, zorder=9, animated=True)
    (robot,) = ax.plot(*none, **ROBOT, zorder=10, animated=True)
    write = ax.text2D if film.scene else ax.text
    text = write(0.0, 1.02, "", transform=ax.transAxes, fontsize=8, color=style.EDGE, animated=True)
    return (*marks, path, tether, robot, text)


def _legend(films: Sequence[Film]) -> list[Any]:
    """Return the handles of the legend."""
    from matplotlib.lines import Line2D

    what = "waypoint" if any(film.scene for film in films) else "goal"
    base = "anchor" if any(film.scene for film in films) else "base"
    star = {"marker": "*", "color": style.BASE, "ms": 9}
    to_visit = {"marker": "o", "color": style.GOAL, "mec": style.PATH, "mew": 1.4, "ms": 7}
    found = set().union(*(film.every_fate for film in films))
    return [
        Line2D([], [], color=style.PATH, lw=1.6, label="path"),
        Line2D([], [], color=style.TETHER, lw=2.4, label="taut tether"),
        *(
            Line2D([], [], ls="none", label=label, **look)
            for label, look in (
                ("robot", ROBOT),
                (base, star),
                (what, to_visit),
                *((f"{what} {fate}", look) for fate, look in MARKS if fate in found),
            )
        ),
    ]


def _draw_space(ax: Any, film: Film, layout: FilmLayout) -> None:
    """Draw the part of a scene around the path of the robot."""
    assert film.scene is not None
    every = np.vstack([m.nodes for m in film.moments] + [film.moments[-1].path])
    stops = WaypointMarks(film.places, anchor=film.anchor)
    draw_space(film.scene, every, np.zeros((0, 3)), ax=ax, stops=stops)
    for line in ax.lines:
        if line.get_label() == "path" and not line.get_animated():
            line.remove()
    ax.set_title(_title(film, layout.title_letters), fontsize=10, loc="left")


def _title(film: Film, letters: int) -> str:
    """Return the title, wrapped to the panel, with space below for the caption."""
    lines = [part for line in film.title.split("\n") for part in textwrap.wrap(line, letters)]
    return "\n".join([*lines, ""])


def _draw_maps(
    panels: Any, films: Sequence[Film], shown: Sequence[Problem | None], layout: FilmLayout
) -> None:
    """Replace the fixed parts of each panel if its map has changed."""
    for ax, film, problem in zip(panels, films, shown, strict=True):
        if film.scene is not None:
            if not ax.collections:
                _draw_space(ax, film, layout)
            continue
        assert problem is not None
        for artist in [*ax.patches, *ax.lines, *ax.texts, *ax.collections]:
            if not artist.get_animated():
                artist.remove()
        draw_map(problem, ax=ax)
        xmin, ymin, xmax, ymax = _view(film)
        ax.set(xlim=(xmin, xmax), ylim=(ymin, ymax))
        ax.set_title(_title(film, layout.title_letters), fontsize=10, loc="left")


def _view(film: Film) -> tuple[float, float, float, float]:
    """Return the box around all maps of a film."""
    maps = {id(m.problem): m.problem for m in film.moments if m.problem is not None}
    views = np.array([view(problem) for problem in maps.values()])
    low, high = views[:, :2].min(0), views[:, 2:].max(0)
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _height(film: Film, layout: FilmLayout) -> float:
    """Return the height of the panel that fits the map, inches."""
    if film.scene is not None:
        return layout.max_panel_height
    xmin, ymin, xmax, ymax = _view(film)
    width = layout.panel_width
    return float(np.clip(width * (ymax - ymin) / (xmax - xmin) + 0.8, 2.5, 2.0 * width))


def _palette(picture: Any, colours: int) -> Any:
    """Return the palette of a picture, which always contains the colours of the roles."""
    from PIL import Image

    roles = (
        style.ROBOT,
        style.TETHER,
        style.PATH,
        style.BASE,
        style.OBSTACLE,
        style.EDGE,
        style.VISITED,
        style.LEFT_OUT,
        style.CANCELLED,
    )
    out = Image.new("RGB", (picture.width, picture.height + 20 * len(roles)))
    out.paste(picture)
    for k, colour in enumerate(roles):
        out.paste(Image.new("RGB", (picture.width, 20), colour), (0, picture.height + 20 * k))
    return out.quantize(colours)


def _write_gif(file: Path, pictures: Iterator[Any], fps: int, layout: FilmLayout) -> None:
    from PIL import Image

    drawn = [Image.fromarray(picture) for picture in pictures]
    palette = _palette(drawn[len(drawn) // 2], layout.gif_colours)
    frames = [d.quantize(palette=palette, dither=Image.Dither.NONE) for d in drawn]
    durations = [1000 // fps] * (len(frames) - 1) + [int(1000 * layout.hold_s)]
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=durations, loop=0)


def _check_ffmpeg(imageio_ffmpeg: Any) -> None:
    """Raise InputError unless ffmpeg runs: a broken one would look like an error of the film."""
    try:
        program = imageio_ffmpeg.get_ffmpeg_exe()
        version_text = subprocess.run([program, "-version"], capture_output=True, timeout=30).stdout
        why = "" if b"ffmpeg version" in version_text else f"{program} is none"
    except (RuntimeError, OSError, subprocess.SubprocessError) as error:
        why = str(error)
    if why:
        raise InputError(f"films in .mp4 need an ffmpeg that runs: {why}; a .gif does not")


def _write_mp4(file: Path, pictures: Iterator[Any], fps: int, layout: FilmLayout) -> None:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise InputError(
            "films in .mp4 need imageio-ffmpeg: pip install 'netsp[video]'; a .gif does not"
        ) from None
    _check_ffmpeg(imageio_ffmpeg)
    # after Ctrl-C, warnings about an incomplete file do not matter
    logging.getLogger("imageio_ffmpeg").setLevel(logging.ERROR)
    first = next(pictures)
    height, width = (n - n % 2 for n in first.shape[:2])
    writer = imageio_ffmpeg.write_frames(
        str(file), (width, height), fps=fps, macro_block_size=2, ffmpeg_log_level="error"
    )
    writer.send(None)
    try:
        last = first
        for picture in (first, *pictures):
            last = np.ascontiguousarray(picture[:height, :width])
            writer.send(last)
        for _ in range(int(layout.hold_s * fps)):
            writer.send(last)
    finally:
        writer.close()
