"""Moving pictures: the robot along its tour with the taut tether behind it."""

from __future__ import annotations

import logging
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from netsp.errors import InputError
from netsp.online.scene.scene import Scene
from netsp.pictures import style
from netsp.pictures.moments import Moment
from netsp.pictures.problem import draw_map, view
from netsp.pictures.scene import Stops, draw_space
from netsp.problem import Problem

FORMATS = (".gif", ".mp4")

COLOURS = 64
"""Of a GIF: pictures have few, and edges of lines need some between."""

WIDTH, DPI = 6.4, 100
"""Inches of a panel, and pixels in each."""

HIGH = 5.6
"""Inches of a panel in space."""

HOLD_S = 1.5
"""Seconds that the last picture stays."""


@dataclass(frozen=True)
class Space:
    """A scene in space.

    Parameters
    ----------
    scene : Scene
        The scene.
    stops : Stops
        Waypoints.
    """

    scene: Scene
    stops: Stops


@dataclass(frozen=True)
class Film:
    """What one panel shows.

    Parameters
    ----------
    title : str
        Above it.
    moments : sequence of Moment
        At even steps.
    length : float
        Of it all: seconds of a run, or metres of a tour. Beside a longer one, it ends earlier.
    space : Space, optional
        What stands still in a picture in space; by default, the map of each moment.
    """

    title: str
    moments: Sequence[Moment]
    length: float
    space: Space | None = None


def save_animation(
    films: Sequence[Film], file: str | Path, seconds: float = 12.0, fps: int = 15,
    on_progress: Callable[[int, int], None] | None = None,
) -> None:  # fmt: skip
    """Write one film, or several side by side.

    Parameters
    ----------
    films : sequence of Film
        From left to right.
    file : str or Path
        Its ending says the format: .gif or .mp4.
    seconds : float
        How long it is, but for the last picture, which stays a little.
    fps : int
        Pictures a second.
    on_progress : callable, optional
        Called with how many pictures are drawn, and how many there are.

    Raises
    ------
    InputError
        Another ending, a file that cannot be written, `imageio-ffmpeg` not installed (for .mp4).
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
        # renamed into place when it is whole: Ctrl-C leaves what was there before
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=".netsp-") as folder:
            part = Path(folder) / f"film{suffix}"
            write(part, _told(_pictures(films, count), count, on_progress), fps)
            part.replace(target)
    except OSError as error:
        raise InputError(f"{file}: cannot be written: {error.strerror or error}") from None


def _told(
    pictures: Iterator[Any], count: int, on_progress: Callable[[int, int], None] | None
) -> Iterator[Any]:
    for k, picture in enumerate(pictures, 1):
        if on_progress is not None:
            on_progress(k, count)
        yield picture


def _pictures(films: Sequence[Film], count: int) -> Iterator[Any]:
    """(h, w, 3) pixels of one picture after the other. What stands still is drawn once for each
    map."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    height = max(map(_height, films))
    figure = Figure(figsize=(WIDTH * len(films), height), dpi=DPI, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    panels: list[Any] = [
        figure.add_subplot(1, len(films), k, projection="3d" if film.space else None)
        for k, film in enumerate(films, 1)
    ]
    moving: list[tuple[Any, ...]] = []
    for ax, film in zip(panels, films, strict=True):
        none: tuple[list[float], ...] = ([], [], []) if film.space else ([], [])
        (path,) = ax.plot(*none, color=style.PATH, lw=1.6, zorder=8, animated=True)
        (tether,) = ax.plot(*none, color=style.TETHER, lw=2.4, zorder=9, animated=True)
        look = {"marker": "o", "ms": 9, "color": style.ROBOT, "mec": style.BASE, "mew": 0.8}
        (robot,) = ax.plot(*none, **look, zorder=10, animated=True)
        write = ax.text2D if film.space else ax.text
        text = write(
            0.0, 1.02, "", transform=ax.transAxes, fontsize=8, color=style.EDGE, animated=True
        )
        moving.append((path, tether, robot, text))
    style.literal(figure)
    longest = max(film.length for film in films)
    shown: list[Problem | None] | None = None
    still = None
    for k in range(count):
        shares = [min(k / max(count - 1, 1) * longest / film.length, 1.0) for film in films]
        now = [
            f.moments[round(s * (len(f.moments) - 1))] for f, s in zip(films, shares, strict=True)
        ]
        if [moment.problem for moment in now] != shown:
            shown = [moment.problem for moment in now]
            _draw_maps(panels, films, shown)
            style.literal(figure)
            canvas.draw()
            still = canvas.copy_from_bbox(figure.bbox)
        canvas.restore_region(still)
        for moment, (path, tether, robot, text) in zip(now, moving, strict=True):
            for line, points in (
                (path, moment.path), (tether, moment.nodes), (robot, moment.nodes[-1:]),
            ):  # fmt: skip
                if line.axes.name == "3d":
                    line.set_data_3d(*points.T)
                else:
                    line.set_data(*points.T[:2])
            text.set_text(moment.text)
            for artist in (path, tether, robot, text):
                figure.draw_artist(artist)
        yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


def _draw_space(ax: Any, film: Film, space: Space) -> None:
    """A scene, seen as far as the robot goes."""
    every = np.vstack([m.nodes for m in film.moments] + [film.moments[-1].path])
    draw_space(space.scene, every, np.zeros((0, 3)), ax=ax, stops=space.stops)
    for line in ax.lines:
        if line.get_label() == "path" and not line.get_animated():
            line.remove()
    ax.set_title(f"{film.title}\n", fontsize=10, loc="left")


def _draw_maps(panels: Any, films: Sequence[Film], shown: Sequence[Problem | None]) -> None:
    """All that stands still, in place of what stood there before."""
    for ax, film, problem in zip(panels, films, shown, strict=True):
        if film.space is not None:
            if not ax.collections:
                _draw_space(ax, film, film.space)
            continue
        assert problem is not None
        for artist in [*ax.patches, *ax.lines, *ax.texts, *ax.collections]:
            if not artist.get_animated():
                artist.remove()
        draw_map(problem, ax=ax)
        xmin, ymin, xmax, ymax = _view(film)
        ax.set(xlim=(xmin, xmax), ylim=(ymin, ymax))
        ax.set_title(f"{film.title}\n", fontsize=10, loc="left")


def _view(film: Film) -> tuple[float, float, float, float]:
    """What is seen of all its maps."""
    maps = {id(m.problem): m.problem for m in film.moments if m.problem is not None}
    views = np.array([view(problem) for problem in maps.values()])
    low, high = views[:, :2].min(0), views[:, 2:].max(0)
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _height(film: Film) -> float:
    """Inches, so that the map fills its panel."""
    if film.space is not None:
        return HIGH
    xmin, ymin, xmax, ymax = _view(film)
    return float(np.clip(WIDTH * (ymax - ymin) / (xmax - xmin) + 0.8, 2.5, 2.0 * WIDTH))


def _palette(picture: Any) -> Any:
    """The colours of a picture, and those of the roles, however small they are in it."""
    from PIL import Image

    roles = (style.ROBOT, style.TETHER, style.PATH, style.BASE, style.OBSTACLE, style.EDGE)
    out = Image.new("RGB", (picture.width, picture.height + 20 * len(roles)))
    out.paste(picture)
    for k, colour in enumerate(roles):
        out.paste(Image.new("RGB", (picture.width, 20), colour), (0, picture.height + 20 * k))
    return out.quantize(COLOURS)


def _write_gif(file: Path, pictures: Iterator[Any], fps: int) -> None:
    from PIL import Image

    drawn = [Image.fromarray(picture) for picture in pictures]
    palette = _palette(drawn[len(drawn) // 2])
    frames = [d.quantize(palette=palette, dither=Image.Dither.NONE) for d in drawn]
    durations = [1000 // fps] * (len(frames) - 1) + [int(1000 * HOLD_S)]
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=durations, loop=0)


def _check_ffmpeg(imageio_ffmpeg: Any) -> None:
    """InputError unless there is an ffmpeg that runs: a broken one would be blamed on the film."""
    try:
        program = imageio_ffmpeg.get_ffmpeg_exe()
        said = subprocess.run([program, "-version"], capture_output=True, timeout=30).stdout
        why = "" if b"ffmpeg version" in said else f"{program} is none"
    except (RuntimeError, OSError, subprocess.SubprocessError) as error:
        why = str(error)
    if why:
        raise InputError(f"films in .mp4 need an ffmpeg that runs: {why}; a .gif does not")


def _write_mp4(file: Path, pictures: Iterator[Any], fps: int) -> None:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise InputError(
            "films in .mp4 need imageio-ffmpeg: pip install 'netsp[video]'; a .gif does not"
        ) from None
    _check_ffmpeg(imageio_ffmpeg)
    logging.getLogger("imageio_ffmpeg").setLevel(logging.ERROR)  # what Ctrl-C cuts off is not kept
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
        for _ in range(int(HOLD_S * fps)):
            writer.send(last)
    finally:
        writer.close()
