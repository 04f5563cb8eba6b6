"""Tethers with slack, and with friction that has a limit: classes that keep both, on whole legs."""

import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InfeasibleError, InputError, Problem, Status, solve, travel_graph, verify
from netsp.command.main import main
from netsp.hsignature import reduce
from netsp.hsignature.rays import crossings
from netsp.model.solution import max_turning
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.turning import tether_turnings
from tests.brute import brute_tour
from tests.worlds import random_world

PROBLEMS = Path(__file__).parent.parent / "problems"


def turn_of(xy):
    """Sum of the angles of a polyline."""
    steps = np.diff(xy[:, :2], axis=0)
    steps = steps[np.hypot(*steps.T) > 1e-9]
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.abs(np.diff(heading)).sum())


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), goals=st.integers(1, 5), share=st.floats(0.0, 1.0))
def test_the_best_tour_among_classes_that_turn_no_farther(seed, goals, share):
    """Brute force over the vertices left; turning measured on drawn tethers; judged by another."""
    problem = random_world(seed, goals=goals, tether=300.0)
    try:
        graph = travel_graph(problem)
    except InfeasibleError:
        return
    paths = TautPaths(problem)
    drawn = np.array([0.0] + [
        turn_of(paths.path(0, int(c), w))
        for c, w in zip(graph.cluster[1:], graph.signatures[1:], strict=True)
    ])  # fmt: skip
    assert tether_turnings(problem, graph) == pytest.approx(drawn, abs=1e-6)
    most = float(np.quantile(drawn, share)) + 1e-3
    ratio = math.exp(0.3 * most)
    kept = np.flatnonzero(drawn <= max_turning(0.3, ratio))
    if len(set(graph.cluster[kept])) <= goals:
        with pytest.raises(InfeasibleError, match="is reached in no class in which the tether"):
            solve(problem, friction=0.3, max_tension_ratio=ratio)
        return
    found = solve(problem, friction=0.3, max_tension_ratio=ratio)
    assert found.length == pytest.approx(brute_tour(graph.subgraph(kept)), rel=1e-6)
    assert found.status is Status.OPTIMAL
    verdict = verify(problem, found)
    assert verdict, str(verdict)
    assert "tension ratio is kept" in str(verdict)
    turns = [drawn[graph.vertices_of([v.goal + 1], [v.signature])[0]] for v in found.tour]
    if max(turns) > 0.1:
        tighter = found.model_copy(update={"max_tension_ratio": math.exp(0.3 * max(turns) * 0.99)})
        assert "FAIL  tension ratio" in str(verify(problem, tighter))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), goals=st.integers(2, 4))
def test_along_a_leg_the_tether_turns_no_farther_than_at_its_ends(seed, goals):
    problem = random_world(seed, goals=goals, tether=320.0)
    try:
        found = solve(problem)
    except InfeasibleError:
        return
    path, rays = np.array(found.path), problem.representative_points
    ends, at = [0], 0
    for visit in found.tour:
        target = problem.points[visit.goal + 1]
        at += int(np.argmin(np.linalg.norm(path[at:] - target, axis=1)))
        ends.append(at)
    ends.append(len(path) - 1)
    places, words, leg = [], [], []
    for n, (a, b) in enumerate(itertools.pairwise(ends)):
        for k in range(a, b):
            middle = 0.5 * (path[k] + path[k + 1])
            places.append(middle)
            words.append(reduce(crossings(np.vstack([path[: k + 1], middle]), rays)))
            leg.append(n)
    off = [i for i, p in enumerate(places) if np.linalg.norm(p - path[0]) > 1e-3]
    placed = problem.model_copy(
        update={"goals": tuple(problem.goals[0].model_copy(update={"position": tuple(places[i])})
                               for i in off)}
    )  # fmt: skip
    paths = TautPaths(placed)
    own = TautPaths(problem)
    turns = [0.0, *(own.turning(0, v.goal + 1, v.signature) for v in found.tour), 0.0]
    for k, i in enumerate(off):
        here = paths.turning(0, k + 1, words[i])
        assert here <= max(turns[leg[i]], turns[leg[i] + 1]) + 1e-4


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), slack=st.floats(0.01, 0.5))
def test_slack_is_a_shorter_tether(seed, slack):
    problem = random_world(seed, goals=4, tether=300.0)
    shorter = problem.model_copy(update={"tether_length": 300.0 / (1.0 + slack)})
    try:
        expected = solve(shorter)
    except InfeasibleError:
        with pytest.raises(InfeasibleError):
            solve(problem, slack=slack)
        return
    found = solve(problem, slack=slack)
    assert found.length == pytest.approx(expected.length)
    assert verify(problem, found)
    longest = max(v.tether_length for v in found.tour)
    assert longest * (1.0 + slack) <= 300.0 * (1.0 + 1e-9)


def test_limits_on_the_command_line(tmp_path, capsys):
    wharf, out = str(PROBLEMS / "wharf.json"), tmp_path / "s.json"
    argv = ["solve", wharf, "-o", str(out), "--quiet"]
    assert main([*argv, "--slack", "0.04", "--friction", "0.2", "--max-tension-ratio", "2"]) == 0
    data = json.loads(out.read_text())
    assert (data["slack"], data["friction"], data["max_tension_ratio"]) == (0.04, 0.2, 2.0)
    assert main(["verify", wharf, str(out)]) == 0
    said = capsys.readouterr().out
    assert "tether less 4 % slack" in said
    assert "tension ratio is kept" in said
    plain = solve(Problem.load(wharf))
    assert "slack" not in json.loads(plain.to_json())
    assert main([*argv, "--max-tension-ratio", "2"]) == 2
    assert "expected friction > 0 with it" in capsys.readouterr().err
    assert main([*argv, "--slack", "2"]) == 2
    assert "slack: expected 0 to 1, got 2.0" in capsys.readouterr().err
    assert main([*argv, "--friction", "5", "--max-tension-ratio", "1.01"]) == 3
    assert "is reached in no class" in capsys.readouterr().err
    with pytest.raises(InputError, match="max_tension_ratio"):
        solve(Problem.load(wharf), friction=0.1, max_tension_ratio=0.5)
