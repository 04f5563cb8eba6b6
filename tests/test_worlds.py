"""Random worlds are what they say, everywhere the same."""

import hashlib
import itertools
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError, Problem, solve
from netsp.command.command_policy import CommandPolicy
from netsp.command.main import main
from netsp.plan.random_worlds import FAMILIES, random_world, reachable_world


@pytest.mark.parametrize("seed", range(5))
def test_circles_are_apart_and_every_goal_is_in_reach(seed):
    p = random_world(seed, goals=12, tether_length=250.0)
    assert len(p.goals) == 12
    assert len(p.obstacles) == 20
    for i, a in enumerate(p.obstacles):
        assert 10.0 <= a.radius <= 30.0
        for b in p.obstacles[:i]:
            assert np.hypot(*np.subtract(a.center, b.center)) > a.radius + b.radius
    assert solve(p, "greedy-2016").length <= 2 * 12 * 250.0


DIGESTS = {
    "icra2017": "dada8bcc9790a942",
    "rss2016": "5c1007a010d09b55",
    "clustered": "14126f2177be8fa2",
    "array": "95a06d386c4099aa",
    "harbour": "4b384b7485bae1bd",
}


@pytest.mark.parametrize("family", FAMILIES)
def test_a_world_is_the_same_on_every_machine(family):
    # digests of the coordinates, computed once; Python promises the sequence of random.Random
    given = {} if family == "rss2016" else {"goals": 5, "obstacles": 6}
    p = random_world(7, family=family, **given)
    numbers = [*p.base, *(x for g in p.goals for x in g.position)]
    for o in p.obstacles:
        circle = hasattr(o, "radius")
        numbers += (*o.center, o.radius) if circle else itertools.chain(*o.polygon)
    text = " ".join(f"{x:.9f}" for x in numbers)
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == DIGESTS[family]


def test_up_to_twenty_obstacles_are_one_to_twenty_with_the_same_odds():
    """400 worlds, 20 of each number on average; one in 10,000 sets would be as uneven."""
    counts = np.zeros(21)
    for seed in range(400):
        world, _ = reachable_world(seed, goals=1, obstacles=(1, 20), radii=(5.0, 10.0))
        counts[len(world.obstacles)] += 1
    assert counts[0] == 0
    assert ((counts[1:] - 20.0) ** 2 / 20.0).sum() < 50.0


def test_obstacles_in_a_range_leave_worlds_of_a_number_alone():
    assert len(random_world(3, goals=2, obstacles=(6, 6)).obstacles) == 6
    assert random_world(3, goals=2, obstacles=6) != random_world(3, goals=2, obstacles=(6, 6))
    for wrong in ((-1, 4), (3, 10**6), (5, 4)):
        with pytest.raises(InputError, match="world: obstacles: expected"):
            random_world(3, obstacles=wrong)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(sorted(FAMILIES)), st.integers(0, 10**9), st.integers(0, 24))
def test_in_every_family_obstacles_are_apart_and_goals_in_reach(family, seed, count):
    p, _ = reachable_world(seed, family=family, obstacles=count, goals=6, tether_length=260.0)
    assert len(p.obstacles) == count
    shapes = [o.shape(0.0) for o in p.obstacles]
    for a, b in itertools.combinations(shapes, 2):
        assert a.distance(b) > 0.0
    assert solve(p, "greedy-2016").length <= 2 * 6 * 260.0


def test_a_seed_whose_world_does_not_fit_is_drawn_again_and_counted():
    crowded = {"obstacles": 44, "goals": 4, "side": 300.0, "radii": (20.0, 20.0)}
    in_vain = []
    for seed in range(6):
        problem, drawn = reachable_world(seed, **crowded)
        in_vain.append(drawn)
        if drawn == 0:
            assert problem == random_world(seed, **crowded)
        else:
            with pytest.raises(InputError):
                random_world(seed, **crowded)
    assert sum(map(bool, in_vain)) > 0


def test_netsp_world_draws_a_number_from_a_range(tmp_path, capsys):
    out = tmp_path / "w.json"
    command = ["world", "--seed", "4", "--goals", "3", "-o", str(out), "--obstacles"]
    assert main([*command, "1-20"]) == 0
    assert Problem.load(out) == reachable_world(4, goals=3, obstacles=(1, 20))[0]
    for wrong in ("20-1", "1-", "-1", "1-2-3", "a-b"):
        assert main([*command[:-1], f"--obstacles={wrong}"]) == 2
    assert "expected" in capsys.readouterr().err


def test_netsp_world_writes_a_problem_that_solve_reads(tmp_path, capsys):
    out, picture = tmp_path / "w.json", tmp_path / "w.svg"
    command = ["world", "--family", "harbour", "--seed", "4", "--goals", "3", "-o", str(out)]
    assert main([*command, "--plot", str(picture)]) == 0
    assert Problem.load(out) == reachable_world(4, family="harbour", goals=3)[0]
    assert "<svg" in picture.read_text()
    assert main(["solve", str(out), "-o", str(tmp_path / "s.json"), "--quiet"]) == 0
    assert main(["world", "--goals", "2", "--obstacles", "0"]) == 0
    assert len(json.loads(capsys.readouterr().out)["goals"]) == 2


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["--family", "reef"], "family: unknown 'reef'; expected one of icra2017, rss2016"),
        (["--radii", "30", "10"], "radii: expected 0 < minimum <= maximum, got 30 and 10"),
        (["--obstacles", "900"], "900 circles do not fit"),
        (["--goals", "100000000"], "goals: expected 1 to 10000"),
        (["--tether", "1e300"], "tether_length: expected more than 0 and at most 1e11"),
        (["--side", "1e300"], "side: expected more than 0 and at most 1e11"),
        (["--tether", "0.001"], "places within reach of the tether found"),
    ],
)
def test_bad_worlds_are_told_in_one_line(args, said, capsys):
    policy = CommandPolicy(max_worlds=3)  # of 50, each as much in vain
    assert main(["world", *args], policy) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("kwargs", "said"),
    [
        ({"obstacles": 2000}, "2000 circles do not fit"),
        ({"tether_length": 1e-3}, "places within reach of the tether found"),
    ],
)
def test_worlds_that_do_not_fit_are_told(kwargs, said):
    with pytest.raises(InputError, match=said):
        random_world(0, **kwargs)
