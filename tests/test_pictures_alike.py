"""Pictures look as they did when they were last looked at, one by one.

After a change that is meant, look at what `NETSP_REDRAW=1 pytest tests/test_pictures_alike.py`
writes to `tests/data/pictures`, and commit it.
"""

import os
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

from netsp.plan.sizing.tether_sizing import tether_curve
from netsp.view.pictures import style
from netsp.view.pictures.animation import save_animation
from netsp.view.pictures.film import film_of_flight, film_of_run
from netsp.view.pictures.mission_picture import save_runs
from netsp.view.pictures.problem_picture import draw as draw_tour
from netsp.view.pictures.problem_picture import save_classes, save_roadmap
from netsp.view.pictures.sizing import draw_tether_curve
from netsp.view.report import figures
from netsp.view.report.stats import best_lengths, cells, methods
from tests.drawn_samples import WHARF, basin_flight, mission, of, rows, run, tour

__all__ = ["mission", "rows", "run", "tour"]  # fixtures

KEPT = Path(__file__).parent / "data" / "pictures"
WIDTH, BLOCK = 480, 12
"""Pixels: pictures are compared at this width, in blocks of this size."""

ALIKE, MOST = 5.0, 0.003
"""Of 255: blocks whose colours differ by less on average are alike; and the share of blocks that
need not be: fonts are drawn a little differently from one release of Matplotlib to the next."""


def trials():
    """Trials of two solvers whose times are known."""
    return {
        name: [
            {"problem_sha256": f"{k}", "seed": 0, "total_s": scale * 1.4**k, "status": status}
            for k, status in enumerate(["optimal"] * last + ["feasible"] * (12 - last))
        ]
        for name, scale, last in (("auto", 0.05, 12), ("mip", 0.2, 9), ("dp", 0.02, 6))
    }


def draw(what, file, request, monkeypatch):
    """Write a picture as the commands do."""
    if what == "classes":
        save_classes(WHARF, 2, file)
    elif what == "roadmap":
        save_roadmap(WHARF, "taut", {}, file)
    elif what == "two runs":
        _, scene = request.getfixturevalue("mission")
        save_runs([basin_flight(), basin_flight("none")], scene, file)
    elif what.startswith("film"):
        save_animation([film_of(what, request)], file.with_suffix(".gif"), seconds=0.3, fps=10)
        with Image.open(file.with_suffix(".gif")) as film:
            film.seek(1)  # in the middle
            film.convert("RGB").save(file)
    elif what == "tether curve":
        style.save(draw_tether_curve(tether_curve(WHARF, 30.0)).figure, file)
    elif what == "lengths":
        all_rows = request.getfixturevalue("rows")
        style.save(figures.lengths(cells(methods(all_rows)), best_lengths(all_rows)), file)
    elif what == "profile":
        style.save(figures.performance(trials()), file)
    else:
        figure = of(what, request, monkeypatch)
        monkeypatch.undo()  # the kind that keeps its figure has replaced what saves it
        style.save(figure, file, dpi=120)


def film_of(what, request):
    """Of a run in the plane, or of a flight."""
    if what == "film":
        done = request.getfixturevalue("run")
        frames = [{"time": time, "nodes": nodes} for time, nodes in done.tethers]
        rows = [{k: str(v) for k, v in asdict(row).items()} for row in done.rows]
        since = {"visited": {a.goal: a.time for a in done.arrivals if a.goal >= 0},
                 "left out": {}, "cancelled": done.cancelled}  # fmt: skip
        return film_of_run(done.maps, rows, frames, since, 40)
    _, scene = request.getfixturevalue("mission")
    return film_of_flight(basin_flight(), scene, 40)


def small(file):
    """(h, w, 3) a picture on white, at the width of comparison."""
    picture = Image.open(file).convert("RGBA")
    white = Image.new("RGBA", picture.size, "white")
    picture = Image.alpha_composite(white, picture).convert("RGB")
    height = round(picture.height * WIDTH / picture.width)
    return picture.resize((WIDTH, height), Image.Resampling.LANCZOS)


def unlike(one, other):
    """Share of the blocks of two pictures that are not alike; 1 if they have not the same shape."""
    if abs(one.height - other.height) > 2:
        return 1.0
    height = min(one.height, other.height) // BLOCK * BLOCK
    a, b = (np.asarray(p, dtype=float)[:height, : WIDTH // BLOCK * BLOCK] for p in (one, other))
    blocks = (height // BLOCK, BLOCK, WIDTH // BLOCK, BLOCK, 3)
    means = [p.reshape(blocks).mean(axis=(1, 3)) for p in (a, b)]
    return float((np.abs(means[0] - means[1]).max(axis=2) > ALIKE).mean())


KINDS = (
    "problem", "tour", "classes", "roadmap", "execution map", "execution tether",
    "scene", "tall scene", "mission", "two runs", "profile", "film", "film in space",
    "tether curve", "lengths",
)  # fmt: skip


@pytest.mark.parametrize("what", KINDS)
def test_a_picture_is_as_it_was_when_it_was_looked_at(what, request, monkeypatch, tmp_path):
    draw(what, tmp_path / "now.png", request, monkeypatch)
    now, kept = small(tmp_path / "now.png"), KEPT / f"{what.replace(' ', '-')}.png"
    if os.environ.get("NETSP_REDRAW"):
        KEPT.mkdir(exist_ok=True)
        now.save(kept, optimize=True)
    before = Image.open(kept).convert("RGB")
    assert unlike(now, before) <= MOST


def test_names_or_a_tether_that_are_missing_are_seen(tour, tmp_path):
    """The check itself, of what is small."""
    style.save(draw_tour(WHARF, tour), tmp_path / "one.png", dpi=120)
    nameless = draw_tour(WHARF, tour)
    for text in nameless.findobj(Text):
        if any(text.get_text().startswith(o.name) for o in (*WHARF.goals, *WHARF.obstacles)):
            text.set_visible(False)
    style.save(nameless, tmp_path / "nameless.png", dpi=120)
    slack = draw_tour(WHARF, tour)
    next(line for line in slack.axes[2].lines if line.get_color() == style.TETHER).remove()
    style.save(slack, tmp_path / "slack.png", dpi=120)
    for other in ("nameless", "slack"):
        assert unlike(small(tmp_path / "one.png"), small(tmp_path / f"{other}.png")) > MOST


def test_a_change_that_an_eye_would_see_is_seen(monkeypatch, tmp_path):
    """Another colour of the tether, a legend elsewhere, an obstacle less."""
    style.save(figures.performance(trials()), tmp_path / "one.png")
    figure = figures.performance(trials())
    for legend in figure.legends or [ax.get_legend() for ax in figure.axes]:
        legend.remove()
    style.save(figure, tmp_path / "other.png")
    assert unlike(small(tmp_path / "one.png"), small(tmp_path / "other.png")) > MOST
    save_classes(WHARF, 2, tmp_path / "one.png")
    monkeypatch.setattr(style, "TETHER", "#009e73")
    save_classes(WHARF, 2, tmp_path / "green.png")
    fewer = WHARF.model_copy(update={"obstacles": WHARF.obstacles[1:]})
    assert unlike(small(tmp_path / "one.png"), small(tmp_path / "green.png")) > MOST
    monkeypatch.undo()
    save_classes(fewer, 2, tmp_path / "fewer.png")
    assert unlike(small(tmp_path / "one.png"), small(tmp_path / "fewer.png")) > MOST


@pytest.mark.parametrize("ending", style.FORMATS)
def test_a_picture_drawn_twice_gives_equal_files(tmp_path, ending):
    """Element ids of an SVG are not random, and files hold no dates."""
    files = [tmp_path / f"{k}{ending}" for k in range(2)]
    for file in files:
        style.save(draw_tour(WHARF), file)
    assert files[0].read_bytes() == files[1].read_bytes()
