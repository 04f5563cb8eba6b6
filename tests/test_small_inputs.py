"""Inputs that are malformed in small ways end in one line, and results convert to other forms."""

import dataclasses
import inspect
import json
import pickle
import subprocess
import sys

import numpy as np
import pytest

from netsp import Circle, InputError, Problem, TravelGraph, solve, solve_graph, travel_graph
from netsp.base.arrays import ComparesArrays
from netsp.base.files import csv_rows
from netsp.base.polyline_file import read_path
from netsp.command.main import main
from netsp.exchange.maps.site_import import read_site
from netsp.model.problem import State
from netsp.model.solution import LARGEST, tension_ratio
from netsp.online.guard.plane import PlaneSite
from netsp.online.guard.state_file import MAX_LETTERS, GuardState
from netsp.plan.sizing.tether_margins import margins
from netsp.world.mission.mission import Mission
from netsp.world.tether.taut_tether import Tether, new_strand

LONG_NUMBER = "1" * 5001


@pytest.fixture
def posts():
    """Return a problem with two posts and four goals, which takes milliseconds to solve."""
    return Problem(
        base=(0, 0), goals=[(6, 1), (6, -1), (9, 2), (3, 3)], tether_length=14,
        obstacles=[Circle(center=(4, 0), radius=1), Circle(center=(7, 2), radius=0.5)],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("path.json", f"[[0, 0], [{LONG_NUMBER}, 1]]"),
        ("path.csv", f"x,y\n0,0\n{LONG_NUMBER},1\n"),
        ("path.csv", f"x,y\n0,0\n{'9' * 200_000},1\n"),
        ("path.json", "[" * 100_000),
    ],
)
def test_a_path_that_cannot_be_read_is_told_in_one_line(tmp_path, name, text):
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(InputError, match=name) as error:
        read_path(file)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400


def test_a_cell_of_200000_characters_is_told_with_its_line():
    with pytest.raises(InputError, match=r"flight\.csv: line 2: field larger"):
        csv_rows("a,b\n1," + "x" * 200_000 + "\n", "flight.csv")


@pytest.mark.parametrize("kind", [[1, 2], {"a": 1}, 3, None, "Sphere"])
def test_a_geometry_of_no_kind_is_told_by_its_feature(tmp_path, kind):
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": kind, "coordinates": []}}
    file = tmp_path / "map.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    with pytest.raises(InputError, match=r"features\[0\]: expected a Point"):
        read_site(file)


@pytest.mark.parametrize("friction", ["1e300", "-1", "nan", "inf", "10.01", "x"])
def test_friction_out_of_range_ends_in_one_line(friction, capsys):
    assert main(["margins", "p.json", "s.json", "--friction", friction]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "friction" in told
    assert "expected 0 to 10" in told


def test_the_tension_ratio_is_the_capstans_and_finite():
    assert tension_ratio(0.3, np.pi) == pytest.approx(np.exp(0.3 * np.pi))
    assert tension_ratio(10.0, 1e6) == pytest.approx(LARGEST)


def test_margins_without_obstacles_are_a_file(tmp_path):
    problem = Problem(base=(0, 0), goals=[(3, 4)], tether_length=6)
    data = json.loads(margins(problem, solve(problem), friction=10.0).to_json())
    assert data["obstacles"] is None
    assert data["tether"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"position": [1e9, 0, 0]}, "--state: position: expected at most 28 m"),
        ({"classes": [{"word": [1, 2] * (MAX_LETTERS // 2 + 1), "cost": 0}]}, "word"),
    ],
)
def test_a_guard_state_that_no_tether_has_is_refused(posts, change, complaint):
    site = PlaneSite(posts)
    state = {
        "schema_version": 1, "site": site.identity, "saved": 1.0, "position": [1, 0, 0],
        "classes": [{"word": [], "cost": 0.0}],
    }  # fmt: skip
    assert GuardState.from_json(json.dumps(state)).words(site) == {(): 0.0}
    with pytest.raises(InputError, match=complaint):
        GuardState.from_json(json.dumps({**state, **change})).words(site)


@pytest.mark.parametrize("kind", ["taut", "prm", "state", "choices", "costs", "baseless"])
def test_a_pickled_travel_graph_has_the_same_tours(posts, kind):
    """One roadmap serves many solvers in other processes, whatever the graph was made from."""
    if kind == "prm":
        pytest.importorskip("ompl")
        graph = travel_graph(posts, roadmap="prm", samples=30)
    elif kind in ("costs", "baseless"):
        table = np.abs(np.subtract.outer(np.arange(5.0), np.arange(5.0) ** 2))
        base = 0 if kind == "costs" else None
        graph = TravelGraph.from_costs(table + table.T, range(5), base=base)
    else:
        update = {"state": State(position=(2, 2))} if kind == "state" else {}
        if kind == "choices":
            goals = [
                {"position": (6, 1), "choice": "a"}, {"position": (6, -1), "choice": "a"}, (3, 3)
            ]  # fmt: skip
            posts = Problem(
                base=(0, 0), goals=goals, tether_length=14, obstacles=list(posts.obstacles)
            )
        graph = travel_graph(posts.model_copy(update=update))
    copy = pickle.loads(pickle.dumps(graph))
    assert solve_graph(copy).length == solve_graph(graph).length
    again = pickle.loads(pickle.dumps(graph))  # now with its legs measured
    assert np.array_equal(again.costs, graph.costs)


def test_a_pickled_travel_graph_is_solved_in_another_process(posts, tmp_path):
    file = tmp_path / "graph.pickle"
    file.write_bytes(pickle.dumps(travel_graph(posts)))
    code = (
        "import pickle, sys; from netsp import solve_graph; "
        "print(repr(solve_graph(pickle.load(open(sys.argv[1], 'rb'))).length))"
    )
    out = subprocess.run([sys.executable, "-c", code, file], capture_output=True, text=True)
    assert float(out.stdout) == solve(posts).length, out.stderr


def test_a_travel_graph_in_networkx_has_the_lengths_of_its_legs(posts):
    networkx = pytest.importorskip("networkx")
    graph = travel_graph(posts)
    other = graph.to_networkx()
    assert networkx.is_connected(other)
    assert len(other) == len(graph)
    tour = solve_graph(graph).tour
    length = sum(other.edges[u, v]["weight"] for u, v in zip(tour, (*tour[1:], 0), strict=True))
    assert length == pytest.approx(graph.tour_length(tour))
    assert {other.nodes[v]["goal"] for v in tour} == {None, 0, 1, 2, 3}
    assert all(graph.cluster[u] != graph.cluster[v] for u, v in other.edges)


def test_tethers_are_equal_if_all_of_them_is():
    nodes = [[0, 0, 0], [1, 1, 1], [2, 0, 0]]
    one, same = Tether(new_strand(nodes), 3.0), Tether(new_strand(nodes), 3.0)
    assert one == same
    assert one != dataclasses.replace(same, length=4.0)
    assert one != Tether(new_strand(nodes[:2]), 3.0)
    assert one != Tether(new_strand([[0, 0, 0], [1, 1, 1], [2, 0, 1]]), 3.0)
    assert one != "a tether"


def test_equality_by_arrays_looks_at_every_field():
    @dataclasses.dataclass(frozen=True, eq=False)
    class Pair(ComparesArrays):
        a: np.ndarray
        b: str

    assert Pair(np.array([1.0, np.nan]), "x") == Pair(np.array([1.0, np.nan]), "x")
    assert Pair(np.array([1.0]), "x") != Pair(np.array([1.0]), "y")
    assert Pair(np.array([1]), "x") != Pair(np.array([1.0]), "x")


@pytest.mark.parametrize("model", [Problem, Mission])
def test_the_signature_of_a_model_can_be_read(model):
    text = str(inspect.signature(model))
    assert "Annotated" not in text
    assert "BeforeValidator" not in text
    assert len(text) < 1100
    assert list(inspect.signature(model).parameters) == list(model.model_fields)


def test_results_become_frames(posts):
    pytest.importorskip("pandas")
    solution = solve(posts)
    frame = solution.to_frame()
    assert list(frame.columns) == ["goal", "name", "x", "y", "z", "signature", "tether_length"]
    assert sorted(frame.goal) == [0, 1, 2, 3]
    assert frame.tether_length.tolist() == [v.tether_length for v in solution.tour]
    progress = solve_graph(travel_graph(posts)).to_frame()
    assert progress.incumbent.iloc[-1] == pytest.approx(solution.length)
    assert len(margins(posts, solution).to_frame()) == 4
