"""Every kind of picture against the list in docs/style.md."""

import functools
import itertools
import json
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from netsp import Circle, Problem, solve
from netsp.online.execute.events import Event, Surprises
from netsp.online.execute.tour_execution import execute
from netsp.study.compare.rows import read_rows
from netsp.study.compare.study import Study
from netsp.study.compare.study_run import compare
from netsp.view.pictures import style
from netsp.view.pictures.execution import draw_map, draw_tether
from netsp.view.pictures.film import film_of_flight
from netsp.view.pictures.film_page import FRAMES, save_page
from netsp.view.pictures.interactive import seen
from netsp.view.pictures.mission_picture import save_runs
from netsp.view.pictures.problem_picture import draw
from netsp.view.pictures.scene_picture import figure_of, save
from netsp.view.pictures.waypoint_marks import WaypointMarks
from netsp.view.report import figures
from netsp.view.report.stats import best_lengths, cells, methods
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene
from netsp.world.simulator.mission_run import simulate
from tests.pages import unpacked

ROOT = Path(__file__).parent.parent
WHARF = Problem.load(ROOT / "problems" / "wharf.json")
ROLES = {
    v.lower() for name, v in vars(style).items()
    if name.isupper() and isinstance(v, str) and v.startswith("#")
}  # fmt: skip
NEUTRAL = {"#000000", "#ffffff", "#cccccc", "#b0b0b0", "#808080"}


@functools.cache
def wharf_tour():
    """Return the tour of WHARF that pictures show, once for all modules."""
    return solve(WHARF)


@functools.cache
def wharf_run():
    """Return a run of that tour with surprises, once for all modules."""
    barge = Circle(center=(12, 6.3), radius=0.8, name="barge")
    events = (
        Event(time=25, appear=barge), Event(time=60, cancel_goal="A3"),
        Event(time=70, vanish="barge"),
    )  # fmt: skip
    return execute(WHARF, wharf_tour(), surprises=Surprises(events=events))


@functools.cache
def basin():
    """Return a mission of eight waypoints and its scene, once for all modules."""
    found = Mission.load(ROOT / "missions" / "basin.json")
    found = found.model_copy(update={"waypoints": found.waypoints[:8]})
    return found, found.load_scene()


@functools.cache
def basin_flight(planner="predictive"):
    """Return a flight of that mission, once for all modules."""
    found, scene = basin()
    return simulate(found, scene=scene, planner=planner)


@functools.cache
def small_study(file):
    """Return the rows of a study of three solvers, once for all modules."""
    study = {
        "name": "style", "goals": [3, 4], "tether_lengths": [200], "time_limit": 5,
        "worlds": {"count": 2}, "solvers": [{"name": "auto"}, {"name": "mip"}, {"name": "greedy"}],
    }  # fmt: skip
    compare(Study.checked(study, "test"), file)
    return read_rows(file)


@pytest.fixture(scope="module")
def tour():
    return wharf_tour()


@pytest.fixture(scope="module")
def run():
    return wharf_run()


@pytest.fixture(scope="module")
def mission():
    return basin()


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    return small_study(tmp_path_factory.getbasetemp() / "style-rows.jsonl")


def of(what, request, monkeypatch):
    """The figure of a kind of picture."""
    if what == "problem":
        return draw(WHARF)
    if what == "tour":
        return draw(WHARF, request.getfixturevalue("tour"))
    if what == "execution map":
        return draw_map(request.getfixturevalue("run")).figure
    if what == "execution tether":
        return draw_tether(request.getfixturevalue("run")).figure
    if what == "scene":
        found, scene = request.getfixturevalue("mission")
        path = np.array([[-3.0, 0, -2], [3, 1, -2]])
        return figure_of(scene, path, "a scene", WaypointMarks(found.places))
    if what == "tall scene":
        kept = []
        monkeypatch.setattr(style, "save", lambda figure, *_, **__: kept.append(figure))
        save(Scene.load(ROOT / "scenes" / "oc4-jacket.json"), "x.png")
        return kept[0]
    if what == "mission":
        _, scene = request.getfixturevalue("mission")
        kept = []
        monkeypatch.setattr(style, "save", lambda figure, *_, **__: kept.append(figure))
        save_runs([basin_flight()], scene, "x.png")
        return kept[0]
    all_rows = request.getfixturevalue("rows")
    by_method, best = methods(all_rows), best_lengths(all_rows)
    if what == "profile":
        return figures.performance(by_method)
    if what == "anytime":
        return figures.anytime(by_method, best)
    return figures.times(cells(by_method))


KINDS = (
    "problem", "tour", "execution map", "execution tether", "scene", "tall scene", "mission",
    "profile", "anytime", "times",
)  # fmt: skip


def drawn(figure):
    """With a canvas that knows where everything is."""
    figure.set_dpi(100)
    FigureCanvasAgg(figure).draw()
    return figure


@pytest.fixture(scope="module", params=KINDS)
def figure(request):
    """Of each kind one, for all that looks at it and changes nothing."""
    matplotlib.use("Agg")
    with pytest.MonkeyPatch.context() as monkeypatch:
        found = of(request.param, request, monkeypatch)
    return drawn(found)


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
    films = [film_of_flight(run, scene, FRAMES)]
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
