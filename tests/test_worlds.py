"""Random worlds are what they say, everywhere the same."""

import hashlib

import numpy as np
import pytest

from netsp import InputError, solve
from netsp.worlds import random_world


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


def test_a_world_is_the_same_on_every_machine():
    # digest of the coordinates, computed once; Python promises the sequence of random.Random
    p = random_world(7, goals=5, obstacles=6)
    numbers = [*p.base, *(x for g in p.goals for x in g.position)]
    numbers += [x for o in p.obstacles for x in (*o.center, o.radius)]
    text = " ".join(f"{x:.9f}" for x in numbers)
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == "dada8bcc9790a942"


@pytest.mark.parametrize(
    ("kwargs", "said"),
    [
        ({"obstacles": 2000}, "2000 circles do not fit"),
        ({"tether_length": 1e-3}, "places in reach of the tether found"),
    ],
)
def test_worlds_that_do_not_fit_are_told(kwargs, said):
    with pytest.raises(InputError, match=said):
        random_world(0, **kwargs)
