"""How long a tether and where to stand, beside solves one by one."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InfeasibleError, InputError, Problem, Status, solve
from netsp.command.main import main
from netsp.sizing import best_base, tether_curve
from netsp.sizing.tether import shortest_tethers

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
    monkeypatch.setattr("netsp.clock.Clock.up", property(lambda self: next(clock, True)))
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
