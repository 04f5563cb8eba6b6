"""A taut path that is not found ends no run: what depends on it is left out, and a warning says so.

The failure is injected: `TautPaths._search` fails for paths from the base to chosen points.
"""

import json
import warnings

import matplotlib
import numpy as np
import pytest

from netsp import Circle, Problem, solve
from netsp.base.errors import InputError, LeftOutWarning, LimitReachedError
from netsp.command.main import main
from netsp.command.measures import describe_tethers
from netsp.online.execute.tour_repair import RepairOptions, repair
from netsp.plan.solve_problem import travel_graph
from netsp.roadmap.paths import TautPaths, UnknownPathError
from netsp.roadmap.turning import limit_turning, tether_turnings
from netsp.view.pictures.problem_picture import draw_map
from netsp.view.report.briefing import tethers

matplotlib.use("Agg")

PROBLEM = Problem(
    base=(0, 0), goals=[(9, 0), (5, 5)], tether_length=16,
    obstacles=[Circle(center=(5, 0), radius=1), Circle(center=(2, 4), radius=1)],
)  # fmt: skip


@pytest.fixture
def fails(monkeypatch):
    """Make the search fail for all paths, or for chosen ones, from the base."""
    original = TautPaths._search

    def install(chosen):
        def search(self, a, b, word, longest, stop):
            if a == 0 and chosen(b, word):
                raise UnknownPathError(f"internal: no taut path of word {word} from {a} to {b}")
            return original(self, a, b, word, longest, stop)

        monkeypatch.setattr(TautPaths, "_search", search)

    return install


def test_lengths_that_cannot_be_found_are_infinite(fails, monkeypatch):
    known = TautPaths(PROBLEM).length(0, 2, ())
    fails(lambda b, word: b == 1)
    monkeypatch.setattr(
        "netsp.roadmap.paths.pull_each", lambda *args: args[-1].fill(-1.0)
    )  # no path is pulled, each is searched
    with pytest.warns(LeftOutWarning, match="lengths of 1 taut path left out"):
        found = TautPaths(PROBLEM).lengths([0, 0], [1, 2], [(), ()])
    assert found[0] == np.inf
    assert found[1] == pytest.approx(known)


def test_a_tether_that_is_not_found_is_left_out_of_maps_tables_and_reports(fails):
    solution = solve(PROBLEM, time_limit=5)
    lines = len(draw_map(PROBLEM, solution, tethers=True).lines)
    fails(lambda b, word: b == 1)
    with pytest.warns(LeftOutWarning, match="tether to goal #0 .*left out"):
        assert len(draw_map(PROBLEM, solution, tethers=True).lines) == lines - 1
    with pytest.warns(LeftOutWarning):
        assert describe_tethers(PROBLEM, solution).count("unknown") == 3
    with pytest.warns(LeftOutWarning):
        assert tethers(PROBLEM, solution).count("unknown: the taut tether was not found") == 2


def test_a_word_with_unknown_obstacles_is_still_refused():
    with pytest.raises(InputError, match="no taut tether to goal #0 has the word"):
        TautPaths(PROBLEM).tether_if_found(0, (7,))


def test_prm_leaves_out_states_whose_tether_is_not_found(fails):
    whole = travel_graph(PROBLEM, "prm", samples=200, seed=1)
    gone = whole.signatures[-1], int(whole.cluster[-1])
    fails(lambda b, word: (word, b) == gone)
    with pytest.warns(LeftOutWarning, match="1 state of the tether left out"):
        part = travel_graph(PROBLEM, "prm", samples=200, seed=1)
    assert len(part) == len(whole) - 1
    assert part.classes == "shortest"
    fails(lambda b, word: b == 1)
    with (
        pytest.warns(LeftOutWarning),
        pytest.raises(LimitReachedError, match=r"no taut tether was found in any class .*goal #0"),
    ):
        travel_graph(PROBLEM, "prm", samples=200, seed=1)


def test_states_of_unknown_turning_are_left_out_and_no_bound_claims_them(fails):
    graph = travel_graph(PROBLEM, "taut")
    shortest = int(graph.tethers[1:].argmin()) + 1
    gone = graph.signatures[shortest], int(graph.goal[shortest])
    fails(lambda b, word: (word, b) == gone)
    with pytest.warns(LeftOutWarning, match="1 state of the tether left out"):
        assert np.isnan(tether_turnings(PROBLEM, graph)).sum() == 1
    with pytest.warns(LeftOutWarning):
        part = limit_turning(PROBLEM, graph, 100.0)
    assert len(part) == len(graph) - 1
    assert part.scope.value == "kept_classes"
    assert part.min_tether_left_out == graph.tethers[shortest]
    fails(lambda b, word: b == 1)
    with pytest.warns(LeftOutWarning), pytest.raises(LimitReachedError, match="it is unknown how"):
        limit_turning(PROBLEM, graph, 100.0)


def test_a_blind_tour_states_the_length_of_its_path_for_a_tether_not_found(fails):
    known = {v.goal: v.tether_length for v in solve(PROBLEM, solver="greedy-tsp").tour}
    fails(lambda b, word: b == 1)
    with pytest.warns(LeftOutWarning, match="taut tether to goal #0 .*not found"):
        found = {v.goal: v.tether_length for v in solve(PROBLEM, solver="greedy-tsp").tour}
    assert found[1] == known[1]
    assert found[0] >= known[0] - 1e-9


def test_a_robot_goes_home_along_its_tether_as_it_lies_if_no_taut_path_is_found(fails):
    fails(lambda b, word: True)
    tether = np.array([(0.0, 0.0, 0.0), (4.0, 2.0, 0.0), (7.0, 2.0, 0.0)])
    made = repair(PROBLEM, tether[-1], tether, [], "told to", RepairOptions(1.0))
    assert made.kind == "home"
    assert "along the tether as it lies" in made.reason
    assert np.array_equal(made.legs[0].path, tether[::-1])


def test_the_command_line_says_in_one_line_what_is_left_out(fails, tmp_path, capsys):
    PROBLEM.save(tmp_path / "p.json")
    fails(lambda b, word: b == 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        code = main(
            ["solve", str(tmp_path / "p.json"), "--solver", "greedy-tsp", "-o",
             str(tmp_path / "s.json")]
        )  # fmt: skip
    assert code == 5
    said = [line for line in capsys.readouterr().err.splitlines() if "warning: taut" in line]
    assert len(said) == 1
    assert json.loads((tmp_path / "s.json").read_text())["status"] == "invalid"
