"""Every kind of picture against the list in docs/contributing/pictures.md."""

import itertools
import json

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from netsp import Problem
from netsp.view.pictures import style
from netsp.view.pictures.execution import draw_map
from netsp.view.pictures.film import film_of_flight
from netsp.view.pictures.film_page import save_page
from netsp.view.pictures.interactive import seen
from netsp.view.pictures.mission_picture import save_runs
from netsp.view.pictures.picture_layout import PageLayout
from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import simulate
from tests import drawn_samples
from tests.drawn_samples import ROOT, drawn
from tests.pages import unpacked

figure, mission, rows, run, tour = (
    drawn_samples.figure,
    drawn_samples.mission,
    drawn_samples.rows,
    drawn_samples.run,
    drawn_samples.tour,
)

ROLES = {
    v.lower() for name, v in vars(style).items()
    if name.isupper() and isinstance(v, str) and v.startswith("#")
}  # fmt: skip
NEUTRAL = {"#000000", "#ffffff", "#cccccc", "#b0b0b0", "#808080"}


def axes_of(figure):
    return [ax for ax in figure.axes if ax.axison]


def flat(figure):
    return [ax for ax in axes_of(figure) if ax.name != "3d"]


def texts_of(ax):
    """What is written beside an axes: its names, its ticks, its title."""
    ticks = [t for axis in (ax.xaxis, ax.yaxis) for t in shown_ticks(axis)]
    return [t for t in (ax.title, ax.xaxis.label, ax.yaxis.label, *ticks) if t.get_text().strip()]


def shown_ticks(axis):
    low, high = sorted(axis.get_view_interval())
    ticks = zip(axis.get_majorticklocs(), axis.get_majorticklabels(), strict=False)
    return [label for at, label in ticks if low <= at <= high and label.get_visible()]


def test_every_axis_has_a_name_and_a_unit(figure):
    counted = ("share", "%", "number of", "times", "iteration")
    for ax in axes_of(figure):
        sides = [ax.xaxis, ax.yaxis] + ([ax.zaxis] if ax.name == "3d" else [])
        for axis in sides:
            name = axis.label.get_text()
            if not name and axis is ax.xaxis and len(figure.axes) > 1 and not shown_ticks(axis):
                continue  # it shares that of the axes below
            assert name
            assert name.endswith(")") or any(word in name for word in counted), name


def test_no_text_lies_on_another(figure):
    renderer = figure.canvas.get_renderer()
    for ax in flat(figure):
        boxes = [(t.get_text(), t.get_window_extent(renderer)) for t in texts_of(ax)]
        for (a, first), (b, second) in itertools.combinations(boxes, 2):
            assert not first.overlaps(second), (a, b)


def test_names_of_axes_in_space_are_beside_the_numbers(figure):
    renderer = figure.canvas.get_renderer()
    for ax in figure.axes:
        if ax.name != "3d":
            continue
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
            name = axis.label.get_window_extent(renderer)
            inner = name.shrunk(0.6, 0.6)
            for label in axis.get_majorticklabels():
                if label.get_text().strip():
                    assert not inner.overlaps(label.get_window_extent(renderer)), label


def test_no_legend_hides_data(figure):
    renderer = figure.canvas.get_renderer()
    for ax in flat(figure):
        legend = ax.get_legend()
        if legend is None:
            continue
        box = legend.get_window_extent(renderer)
        for line in ax.lines:
            points = ax.transData.transform(np.column_stack(line.get_data()).astype(float))
            points = points[np.isfinite(points).all(1)]
            assert not any(box.contains(*p) for p in points), line.get_label()


def test_colours_are_those_of_the_roles(figure):
    used = set()
    for ax in figure.axes:
        used |= {to_hex(line.get_color()) for line in ax.lines}
        if ax.name != "3d":  # faces in space have shades
            used |= {to_hex(p.get_facecolor()) for p in ax.patches if p.get_facecolor()[3] > 0.0}
    assert used <= ROLES | set(style.SERIES) | NEUTRAL, used - ROLES - set(style.SERIES)


def test_no_text_is_too_small_to_read(figure):
    for text in figure.findobj(matplotlib.text.Text):
        if text.get_text().strip() and text.get_visible():
            assert text.get_fontsize() >= 6.0, text


def test_an_overlap_a_missing_name_and_a_covered_curve_are_seen():
    """The checks themselves."""
    bad = Figure(figsize=(2, 2))
    ax = bad.subplots()
    ax.plot([0, 1], [0, 1], label="hidden", color="#123456")
    ax.set_xticks(np.linspace(0, 1, 30))
    ax.plot([0.5], [0.5], "o", color="#123456")
    ax.legend(loc="center")
    drawn(bad)
    for check in (
        test_every_axis_has_a_name_and_a_unit, test_no_text_lies_on_another,
        test_no_legend_hides_data, test_colours_are_those_of_the_roles,
    ):  # fmt: skip
        with pytest.raises(AssertionError):
            check(bad)


# what was there for a time only


def test_an_obstacle_that_comes_and_goes_is_drawn_with_its_times(run):
    assert [len(p.obstacles) for _, p in run.maps] == [8, 9, 9, 8]
    told = [t.get_text() for t in draw_map(run).texts]
    assert "barge, 25 to 70 s" in told


def test_a_waypoint_that_was_not_visited_is_not_drawn_as_visited(mission, monkeypatch):
    found, scene = mission
    kept = []
    monkeypatch.setattr(style, "save", lambda figure, *_, **__: kept.append(figure))

    def stop(row, planner):
        if len(planner.reached) >= 3:
            raise KeyboardInterrupt

    cut = simulate(found, scene=scene, on_step=stop)
    save_runs([cut], scene, "x.png")
    (space,) = (ax for ax in kept[0].axes if ax.name == "3d")
    counts = {line.get_label(): len(line.get_data_3d()[0]) for line in space.lines}
    assert counts["waypoint visited"] == cut.summary["visited"]
    assert counts["not visited"] == len(found.waypoints) - cut.summary["visited"]


def test_a_page_of_a_hundred_waypoints_is_small_and_plays(tmp_path):
    mission = Mission.load(ROOT / "missions" / "basin.json")
    assert len(mission.waypoints) >= 97
    scene = mission.load_scene()
    run = simulate(mission, scene=scene)
    films = [film_of_flight(run, scene, PageLayout.frames)]
    save_page(films, "helix", tmp_path / "run.html")
    text = (tmp_path / "run.html").read_text()
    assert len(text) < 3_000_000
    figure = unpacked(tmp_path / "run.html")
    names = {trace.get("name") for trace in figure["data"] if trace.get("showlegend", True)}
    marks = {"waypoint", "waypoint visited", "waypoint left out"}
    assert names == {"path", "taut tether", "robot", "anchor", *marks}
    assert all(figure["layout"]["scene"][f"{a}axis"]["title"]["text"] == f"{a} (m)" for a in "xyz")
    save_page(films, "helix", tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text() == text


def test_what_is_left_of_a_line_is_all_that_can_be_seen_of_it():
    rng = np.random.default_rng(0)
    path = rng.normal(size=(400, 3)).cumsum(axis=0)
    kept = path[seen(path)]
    assert len(kept) <= len(path)
    size = np.ptp(path, axis=0).max()
    for point in path:
        a, d = kept[:-1], np.diff(kept, axis=0)
        s = np.clip(((point - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-300), 0, 1)
        assert np.linalg.norm(a + s[:, None] * d - point, axis=1).min() <= 1e-3 * size + 1e-12
    straight = np.linspace([0, 0, 0], [1, 2, 3], 500)
    assert len(seen(straight)) == 2


def test_problems_are_equal_whatever_was_asked_of_them():
    one, other = (Problem.load(ROOT / "problems" / "wharf.json") for _ in range(2))
    assert one.points.shape == other.points.shape
    assert one == other
    assert hash(one) == hash(other)
    assert one != one.model_copy(update={"tether_length": 30.0})
    assert one != json.loads(other.to_json())
