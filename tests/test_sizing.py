"""How long a tether and where to stand, beside solves one by one."""

import itertools
import json
import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InfeasibleError, InputError, Problem, Status, solve, travel_graph, verify
from netsp.command.main import main
from netsp.plan.sizing import best_base, margins, tether_curve
from netsp.plan.sizing.tether_margins import _misfit
from netsp.roadmap.explain_unreachable import shortest_tethers
from netsp.roadmap.paths import TautPaths

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

from perturbed import violations

from .worlds import random_world

PROBLEMS = Path(__file__).parent.parent / "problems"


def with_tether(problem, length):
    return problem.model_copy(update={"tether_length": length})


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10**6), goals=st.integers(2, 7), longest=st.floats(250.0, 420.0))
def test_at_every_step_and_just_below_the_curve_is_what_a_solve_finds(seed, goals, longest):
    problem = random_world(seed, goals=goals, tether=longest)
    if shortest_tethers(problem).max() > longest:
        return
    curve = tether_curve(problem)
    assert curve.proven
    assert curve.steps[0].tether == pytest.approx(curve.shortest)
    assert curve.steps[-1].until == longest
    for below, step in zip((None, *curve.steps), curve.steps, strict=False):
        at = solve(with_tether(problem, step.tether * (1 + 1e-6)))
        assert at.length == pytest.approx(step.length, rel=1e-6)
        under = with_tether(problem, step.tether * (1 - 1e-6))
        if below is None:
            with pytest.raises(InfeasibleError):
                solve(under)
        else:
            assert solve(under).length == pytest.approx(below.length, rel=1e-6)
            assert step.length < below.length
            assert below.until == step.tether


def test_the_shortest_tether_of_a_goal_behind_a_post_is_the_closed_form():
    problem = Problem(
        base=(-3, 0), goals=[(3, 0), (0, 2)], obstacles=[Circle(center=(0, 0), radius=1)],
        tether_length=20,
    )  # fmt: skip
    over = 2 * np.sqrt(8) + (np.pi - 2 * np.arccos(1 / 3))
    assert shortest_tethers(problem) == pytest.approx([over, np.hypot(3, 2)])
    curve = tether_curve(problem)
    assert curve.shortest == pytest.approx(over)
    assert curve.needs == 0
    # out over the post and back over it, by way of the other goal
    assert curve.steps[0].length == pytest.approx(solve(with_tether(problem, over + 1e-6)).length)


def test_a_curve_that_ran_out_of_time_is_not_whole(monkeypatch):
    problem = random_world(1, goals=20, tether=300.0)
    whole = tether_curve(problem)
    assert len(whole.steps) > 1
    clock = iter([False])
    monkeypatch.setattr("netsp.base.clock.Clock.is_up", property(lambda self: next(clock, True)))
    part = tether_curve(problem)
    assert not part.whole
    assert not part.proven
    assert len(part.steps) < len(whole.steps)


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_best_base_is_the_best_of_solves_from_all(seed):
    rng = np.random.default_rng(seed)
    problem = random_world(seed, goals=5, tether=300.0)
    places = rng.uniform(0.0, 500.0, (10, 2))
    found = best_base(problem, places)
    data = problem.model_dump(exclude={"origin"})
    lengths = []
    for place in places:
        try:
            lengths.append(solve(Problem.model_validate({**data, "base": tuple(place)})).length)
        except (InfeasibleError, InputError, ValueError):
            lengths.append(np.inf)
    if np.isinf(lengths).all():
        assert found.best is None
        assert not found.proven
        return
    assert found.proven
    assert found.best.length == pytest.approx(min(lengths), rel=1e-6)
    for c in found.candidates:
        k = int(c.name[1:])
        assert c.lower_bound <= lengths[k] * (1 + 1e-9)
        assert c.possible == bool(np.isfinite(lengths[k]))
        if c.length is not None:
            assert c.length == pytest.approx(lengths[k], rel=1e-6)
    every = best_base(problem, places, every=True)
    assert all(c.length is not None for c in every.candidates if c.possible)
    assert every.best.length == pytest.approx(found.best.length)


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_best_base_is_the_best_with_choices_and_orders_too(seed):
    rng = np.random.default_rng(seed)
    goals = [
        {"name": "a", "any_of": rng.uniform(0.0, 9.0, (2, 2)).tolist()},
        {"name": "b", "position": rng.uniform(0.0, 9.0, 2).tolist(), "after": ["c"]},
        {"name": "c", "position": rng.uniform(0.0, 9.0, 2).tolist()},
        {"name": "d", "any_of": [[99.0, 0.0], rng.uniform(0.0, 9.0, 2).tolist()]},
    ]
    problem = Problem(base=(0, 0), goals=goals, tether_length=30)
    places = rng.uniform(0.0, 9.0, (6, 2))
    found = best_base(problem, places)
    data = problem.model_dump()
    lengths = [solve(Problem.model_validate({**data, "base": tuple(p)})).length for p in places]
    assert found.proven
    assert found.best.length == pytest.approx(min(lengths), rel=1e-6)
    for c in found.candidates:
        assert c.lower_bound <= lengths[int(c.name[1:])] * (1 + 1e-9)


def test_goals_at_one_spot_and_candidates_on_goals_do_no_harm():
    problem = Problem(
        base=(0, 0), goals=[(4, 1, -1), (4, 1, -3), (2, 5)],
        obstacles=[Circle(center=(2, 2), radius=1)], tether_length=12,
    )  # fmt: skip
    places = [(4, 1, 0), (4, 1, -2), (2, 2, 0), (0, 0, 0), (0, 0, 0)]
    found = best_base(problem, places)
    assert found.proven
    by_name = {c.name: c for c in found.candidates}
    assert "lies inside obstacle #0" in by_name["#2"].why
    assert found.best.name == "#1"
    assert by_name["#0"].shortest_tether == pytest.approx(np.hypot(2, 4), abs=0.2)


def test_both_commands_write_what_they_say(tmp_path, capsys):
    wharf = str(PROBLEMS / "wharf.json")
    out, picture = tmp_path / "c.json", tmp_path / "c.png"
    argv = ["tether", wharf, "-o", str(out), "--plot", str(picture), "--quiet"]
    assert main(argv) == 0
    said = capsys.readouterr().out
    steps = json.loads(out.read_text())["steps"]
    assert f"{steps[0]['length']:.6g}" in said
    assert "needed by goal" in said
    assert picture.stat().st_size > 5000
    table, best, maps = tmp_path / "b.csv", tmp_path / "best.json", tmp_path / "b.svg"
    argv = ["base", wharf, "--line", "0,-1,16,-1,5", "-o", str(table), "--plot", str(maps)]
    assert main([*argv, "--problem-output", str(best), "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "5 places" in said
    assert "proven the best" in said
    length = solve(Problem.load(best)).length
    assert f"{length:.6g}" in said
    assert len(table.read_text().splitlines()) == 6
    assert maps.stat().st_size > 5000


def test_where_no_place_has_a_tour_none_is_called_the_best(capsys):
    """Both places are so far off that no tether reaches the goals."""
    argv = ["base", str(PROBLEMS / "wharf.json"), "--line", "900,900,910,900,2", "--quiet"]
    assert main(argv) == 3
    said = capsys.readouterr()
    assert "2 places, 0 of them possible, 0 solved\n" in said.out
    assert "the first" not in said.out
    assert "no place has a tour" in said.err


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["base", "P", "--line", "0,0,1"], "--line: expected X1,Y1,X2,Y2,N, got '0,0,1'"),
        (["base", "P", "--line", "0,0,1,1,1"], "--line: expected 2 to 10,000 places"),
        (["base", "P", "--grid", "3"], "--grid: expected NX,NY, got '3'"),
        (["base", "P", "--candidates", "T"], "expected a table with the columns x, y"),
        (["tether", "P", "--longest", "-3"], "expected a positive number"),
        (["tether", "P", "--longest", "5"], "is out of reach"),
    ],
)
def test_bad_questions_take_one_line(argv, message, tmp_path, capsys):
    table = tmp_path / "t.csv"
    table.write_text("a,b\n1,2\n")
    words = {"P": str(PROBLEMS / "wharf.json"), "T": str(table)}
    assert main([words.get(a, a) for a in argv]) in (2, 3)
    err = capsys.readouterr().err
    assert message in err
    assert len(err.strip().splitlines()) == 1


def test_a_known_status_is_kept():
    assert tether_curve(Problem.load(PROBLEMS / "pool.json")).steps[0].status is Status.OPTIMAL


def test_the_margin_of_a_post_is_the_closed_form():
    """The tether over a post grows with it until it does not fit."""

    def over(radius):
        side = math.sqrt(9.0 - radius**2)
        return 2.0 * side + radius * (math.pi - 2.0 * math.acos(radius / 3.0))

    problem = Problem(
        base=(-3, 0), goals=[(3, 0)], obstacles=[Circle(center=(0, 0), radius=1)],
        tether_length=over(1.5),
    )  # fmt: skip
    found = margins(problem, solve(problem), friction=0.3)
    assert found.obstacles == pytest.approx(0.5, abs=1e-6)
    assert "goal #0: its tether does not fit" in found.limited_by
    assert found.tether == pytest.approx(over(1.5) - over(1.0))
    assert found.cross_track == pytest.approx(0.0, abs=1e-6)
    assert found.visits[0].turning == pytest.approx(math.pi - 2.0 * math.acos(1 / 3))
    assert found.visits[0].tension_ratio == pytest.approx(math.exp(0.3 * found.visits[0].turning))


@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_within_its_margin_a_tour_fits_every_world_and_beyond_it_the_grown_one_does_not(seed):
    problem = random_world(seed, goals=4, tether=330.0)
    try:
        solution = solve(problem)
    except InfeasibleError:
        return
    found = margins(problem, solution)
    assert found.obstacles > 0.0
    assert violations(problem, solution, found.obstacles, worlds=4, seed=seed) == 0
    if not re.search("would (be nearer|lie in)", found.limited_by):
        assert _misfit(problem, solution, found.obstacles * (1 + 1e-6) + 1e-9) is not None


def test_worlds_that_are_off_by_more_than_the_margin_are_seen(monkeypatch):
    """The check of perturbed worlds can fail: with a tether that is too short for them, it does."""
    problem = Problem.load(PROBLEMS / "wharf.json")
    solution = solve(problem)
    longest = max(v.tether_length for v in solution.tour)
    assert violations(problem, solution, 0.39, worlds=10, seed=0) == 0
    short = problem.model_copy(update={"tether_length": longest})
    monkeypatch.setattr("perturbed.TautPaths", lambda p: TautPaths(p, 2.0 * longest))
    assert violations(short, solution, 0.39, worlds=10, seed=0) > 0


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 10**6), margin=st.floats(0.5, 6.0))
def test_a_tour_planned_with_a_margin_has_it_and_is_verified_with_it(seed, margin):
    problem = random_world(seed, goals=5, tether=330.0)
    try:
        planned = solve(problem, margin=margin)
        plain = solve(problem)
    except (InfeasibleError, InputError):
        return
    assert verify(problem, planned)
    assert planned.margin == margin
    assert margins(problem, planned).obstacles >= margin * (1 - 1e-9)
    assert planned.length >= plain.length * (1 - 1e-9)
    assert planned.length == pytest.approx(solve(problem.grown(margin)).length)
    again = type(planned).model_validate_json(planned.to_json())
    assert again.margin == margin
    # a tour that has the margin unplanned is as good as the one that was planned with it
    lying = plain.model_copy(update={"margin": margin})
    assert not verify(problem, lying) or plain.length == pytest.approx(planned.length)


def test_margins_are_printed(tmp_path, capsys):
    wharf, out = str(PROBLEMS / "wharf.json"), tmp_path / "s.json"
    assert main(["solve", wharf, "-o", str(out), "--margin", "0.2", "--quiet"]) == 0
    assert main(["margins", wharf, str(out), "-o", str(tmp_path / "m.json")]) == 0
    said = capsys.readouterr().out
    assert "obstacles    may be off by 0.4 m" in said
    assert re.search(r"tether       may shrink by \S+ m before a goal is out of reach", said)
    assert re.search(r"cross-track  the tour holds if the robot is up to \S+ m off its path", said)
    assert json.loads((tmp_path / "m.json").read_text())["stops"][0]["slack"] > 0
    assert main(["verify", wharf, str(out), "--margins"]) == 0
    assert "grown by 0.2" in capsys.readouterr().out
    assert main(["solve", wharf, "-o", str(out), "--margin", "1"]) == 2
    assert "netsp: margin 1: goals[" in capsys.readouterr().err


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), goals=st.integers(1, 5))
def test_with_the_order_kept_classes_are_the_best_of_all(seed, goals):
    """Brute force over classes; and over all orders the best is what a free solve finds."""
    problem = random_world(seed, goals=goals, tether=280.0)
    try:
        graph = travel_graph(problem)
    except InfeasibleError:
        return
    kept = solve(problem, keep_order=True)
    assert verify(problem, kept)
    assert [v.goal for v in kept.tour] == list(range(goals))
    assert kept.status is Status.OPTIMAL
    members = [graph.members(k) for k in range(1, goals + 1)]
    if math.prod(map(len, members)) <= 20_000:
        tours = (graph.tour_length([0, *chosen]) for chosen in itertools.product(*members))
        assert kept.length == pytest.approx(min(tours))
    if goals <= 4:
        orders = itertools.permutations(problem.goals)
        lengths = (
            solve(problem.model_copy(update={"goals": o}), keep_order=True).length for o in orders
        )
        assert min(lengths) == pytest.approx(solve(problem).length)
    if goals > 2:
        other = [kept.tour[1], kept.tour[0], *kept.tour[2:]]
        assert not verify(problem, kept.model_copy(update={"tour": tuple(other)}))


def test_the_order_is_kept_on_the_command_line_with_a_margin(tmp_path):
    wharf, out = str(PROBLEMS / "wharf.json"), tmp_path / "s.json"
    argv = ["solve", wharf, "-o", str(out), "--keep-order", "--margin", "0.2", "--quiet"]
    assert main(argv) == 0
    data = json.loads(out.read_text())
    assert [v["goal"] for v in data["tour"]] == list(range(8))
    assert data["kept_order"]
    assert data["solver"] == "in-order"
    assert main(["verify", wharf, str(out), "--quiet"]) == 0
