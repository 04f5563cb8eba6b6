"""Solving again after editing: what is left of the old tour is where the search begins."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InfeasibleError, InputError, Problem, Solution, solve, travel_graph, verify
from netsp.command.main import main
from netsp.plan.warm_start import old_tour, tour_from
from tests.worlds import random_world

PROBLEMS = Path(__file__).parent.parent / "problems"


def named(problem):
    goals = [g.model_copy(update={"name": f"g{k}"}) for k, g in enumerate(problem.goals)]
    return problem.model_copy(update={"goals": tuple(goals)})


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), names=st.booleans())
def test_the_old_tour_survives_goals_shuffled_removed_and_added(seed, names):
    """In a world that is the same otherwise, the tour over what is left has the classes it had."""
    rng = np.random.default_rng(seed)
    problem = random_world(seed, goals=6, tether=320.0)
    if names:
        problem = named(problem)
    try:
        old = Solution.from_json(solve(problem).to_json())
    except InfeasibleError:
        return
    kept = rng.permutation(6)[:5]
    edited = problem.model_copy(update={"goals": tuple(problem.goals[k] for k in kept)})
    found = old_tour(edited, old)
    assert found.gone == 1
    left = [v for v in old.tour if v.goal in kept]
    assert [kept[g] for g in found.goals] == [v.goal for v in left]
    assert list(found.words) == [tuple(v.signature) for v in left]
    graph = travel_graph(edited)
    tour = tour_from(edited, old, graph)
    assert graph.is_tour(tour)
    assert graph.tour_length(tour) <= old.length * (1.0 + 1e-9)  # the triangle inequality
    again = solve(edited, warm_start=old, time_limit=20)
    assert verify(edited, again)
    assert again.length <= graph.tour_length(tour) * (1.0 + 1e-9)
    # and back: the goal that was left out is new
    full = tour_from(problem, Solution.from_json(again.to_json()), travel_graph(problem))
    assert full is None or travel_graph(problem).is_tour(full)


def test_a_goal_that_moved_is_found_by_its_name_and_an_obstacle_by_its_place():
    problem = Problem.load(PROBLEMS / "wharf.json")
    old = solve(problem)
    data = json.loads(problem.to_json())
    data["obstacles"].reverse()
    for obstacle in data["obstacles"]:
        obstacle["center"][0] += 0.05
    x, y, z = data["goals"][2]["position"]
    data["goals"][2]["position"] = [x + 0.3, y + 0.2, z]
    edited = Problem.model_validate(data)
    found = old_tour(edited, old)
    assert found.goals == tuple(v.goal for v in old.tour)
    graph = travel_graph(edited)
    assert graph.vertices_of([g + 1 for g in found.goals], found.words) is not None
    assert graph.tour_length(tour_from(edited, old, graph)) < 1.05 * old.length


def test_on_the_command_line(tmp_path, capsys):
    wharf, out = PROBLEMS / "wharf.json", tmp_path / "s.json"
    assert main(["solve", str(wharf), "-o", str(out), "--quiet"]) == 0
    data = json.loads(wharf.read_text())
    del data["goals"][3]
    data["goals"] += [{"name": "N1", "position": [1, 1]}]
    edited = tmp_path / "edited.json"
    edited.write_text(json.dumps(data))
    argv = ["solve", str(edited), "--warm-start", str(out), "-o", str(tmp_path / "t.json")]
    assert main([*argv, "--quiet", "--margin", "0.05"]) == 0
    said = "note: warm start: 7 of 8 goals are those of an older version, 1 new, 1 gone"
    assert said in capsys.readouterr().err
    assert main(["verify", str(edited), str(tmp_path / "t.json"), "--quiet"]) == 0


def test_a_solution_without_a_path_cannot_be_known_again():
    problem = Problem(base=(0, 0), goals=[(3, 4), (4, 0)], tether_length=9)
    bare = solve(problem).model_copy(update={"path": ()})
    edited = problem.model_copy(update={"goals": problem.goals[:1]})
    with pytest.raises(InputError, match="warm_start: has no path"):
        solve(edited, warm_start=bare)


def test_a_solution_that_has_nothing_to_do_with_the_problem_is_refused():
    old = solve(Problem(base=(0, 0), goals=[(3, 4)], tether_length=9))
    far = Problem(base=(0, 0), goals=[(-300, 4)], tether_length=900)
    with pytest.raises(InputError, match="none of its goals is in the problem"):
        solve(far, warm_start=old)
