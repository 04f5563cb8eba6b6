"""One sample of everything that netsp draws."""

import functools
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from netsp import Circle, Problem, solve
from netsp.online.execute.events import Event, Surprises
from netsp.online.execute.tour_execution import execute
from netsp.study.compare.rows import read_rows
from netsp.study.compare.study import Study
from netsp.study.compare.study_run import compare
from netsp.view.pictures import style
from netsp.view.pictures.execution import draw_map, draw_tether
from netsp.view.pictures.mission_picture import save_runs
from netsp.view.pictures.problem_picture import draw
from netsp.view.pictures.scene_picture import figure_of, save
from netsp.view.pictures.waypoint_marks import WaypointMarks
from netsp.view.report import figures
from netsp.view.report.stats import best_lengths, cells, methods
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene
from netsp.world.simulator.mission_run import simulate

ROOT = Path(__file__).parent.parent


WHARF = Problem.load(ROOT / "problems" / "wharf.json")


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
    """One figure of each kind, shared by all tests that only read it."""
    matplotlib.use("Agg")
    with pytest.MonkeyPatch.context() as monkeypatch:
        found = of(request.param, request, monkeypatch)
    return drawn(found)
