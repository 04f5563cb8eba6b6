"""Pictures draw where they are asked to, and the same thing looks the same everywhere."""

import math
import re
from pathlib import Path

import pytest
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure

from netsp import Problem, TravelGraph, solve, travel_graph
from netsp.model.bound_scope import LowerBound, Scope, above_shortest
from netsp.online.execute import execute
from netsp.view.pictures import style
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import simulate

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def objects():
    """Everything that has a picture."""
    problem = Problem.load(ROOT / "problems" / "wharf.json")
    solution = solve(problem)
    post = {"capsule": {"a": (0, 0, -3), "b": (0, 0, 3), "radius": 0.5}}
    scene = Scene.model_validate({"schema_version": 1, "name": "post", "solids": [post]})
    mission = Mission(
        scene="-", anchor=(-2, 0, 0), start=(-2, 0.5, 0), tether_length=9.0,
        waypoints=[(-2, 1, 0), (-2, 2, 0)], speed=0.5,
    )  # fmt: skip
    costs = [[0, 1, 5], [1, 0, 2], [5, 2, 0]]
    return {
        "problem": problem, "solution": solution, "graph": travel_graph(problem),
        "costs": TravelGraph.from_costs(costs, clusters=[0, 1, 2]),
        "run": simulate(mission, scene=scene), "execution": execute(problem, solution),
    }  # fmt: skip


NAMES = ("problem", "solution", "graph", "costs", "run", "execution")


@pytest.mark.parametrize("name", NAMES)
def test_plot_draws_on_the_axes_that_are_given(objects, name):
    left, right = Figure().subplots(1, 2)
    assert objects[name].plot(ax=right) is right
    assert right.has_data()
    assert not left.has_data()
    assert objects[name].plot().has_data()


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_shows_a_short_line_and_the_picture(objects, name):
    line = repr(objects[name])
    assert line.startswith("<")
    assert len(line) < 160
    assert "\n" not in line
    page = objects[name]._repr_html_()
    assert page.count("<svg") == 1
    assert "&lt;" in page.split("<svg")[0]


def test_a_solution_is_drawn_over_its_problem(objects):
    alone = objects["solution"].plot()
    whole = objects["solution"].plot(problem=objects["problem"])
    assert len(whole.patches) > len(alone.patches)


@pytest.mark.parametrize("name", ["solution", "execution"])
def test_the_path_has_one_colour_everywhere(objects, name):
    lines = [to_hex(line.get_color()) for line in objects[name].plot().get_lines()]
    assert style.PATH in lines


def test_no_other_file_names_a_colour():
    for path in (ROOT / "netsp").rglob("*.py"):
        if path.name != "style.py" and path.name not in ("page.py", "tour.py"):  # their CSS
            assert not re.findall(r'"#[0-9a-f]{6}"', path.read_text()), path


def test_colours_that_stand_side_by_side_can_be_told_apart():
    """Machado, Oliveira & Fernandes (2009): what a viewer without red or green cones sees."""
    without_green = [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]]
    without_red = [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]]
    together = [style.TETHER, style.PATH, style.ROBOT, style.BASE, style.VISITED, style.LEFT_OUT]

    def seen(colour, matrix):
        rgb = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
        return [sum(m * c for m, c in zip(row, rgb, strict=True)) for row in matrix]

    for matrix in (without_green, without_red):
        for k, a in enumerate(together):
            for b in together[:k]:
                assert math.dist(seen(a, matrix), seen(b, matrix)) > 0.08, (a, b)


def test_a_picture_tells_the_excess_over_the_bound_and_not_the_gap():
    bound = LowerBound(80.0, Scope.ALL_TOURS)
    assert above_shortest(100.0, bound) == "at most 25 % above the shortest tour"
    assert above_shortest(100.0, None) == "no bound"
    assert above_shortest(100.0, LowerBound(0.0, Scope.ALL_TOURS)) == "no bound"
