"""Every shipped problem is proven optimal and verified; the known ones have the known length.

The formulas here are those derived in problems/known/README.md, written out again by hand.
"""

import json
import math
from math import acos, asin, atan2, hypot, pi, sqrt
from pathlib import Path

import pytest

from netsp import Problem, Status, solve, verify
from netsp.base.errors import InfeasibleError
from netsp.hsignature import is_looping
from tests.brute import BruteForce

PROBLEMS = Path(__file__).parent.parent / "problems"
KNOWN = PROBLEMS / "known"
REAL = sorted(PROBLEMS.glob("*.json"))


def around(d1, d2, r, angle):
    """Two tangents and the arc between them: points at distances d1, d2 from the centre of a circle
    of radius r, seen `angle` apart on the side passed."""
    arc = angle - acos(r / d1) - acos(r / d2)
    return sqrt(d1**2 - r**2) + r * arc + sqrt(d2**2 - r**2)


def entangling_pair():
    d, side = hypot(0.5, 2), atan2(2, 0.5)
    return 2 * hypot(5.5, 2) + around(d, d, 1, 2 * pi - 2 * side)


def far_pair():
    d, tilt = sqrt(26), atan2(1, 5)
    return around(5, d, 2, pi - tilt) + 2 + around(5, d, 2, pi + tilt)


def far_pair_short_tether():
    d, tilt = sqrt(26), atan2(1, 5)
    over = around(5, d, 2, pi - tilt)
    return min(4 * over, 2 * over + around(d, d, 2, 2 * pi - 2 * tilt))


def winding_wall():
    to_end = 7 * pi / 4 - atan2(0.1, 1.1)
    corners = hypot(0.4, 1.1) + 3.2 + 2.2 + 2.2 + 1.2
    return 2 * (corners + around(hypot(1.1, 0.1), sqrt(0.5), 0.3, to_end))


FORMULAS = {
    "open-water": lambda: 10.0,
    "triangle": lambda: 12.0,
    "square": lambda: 8.0,
    "above": lambda: 12.0,
    "behind": lambda: 2 * (8 + 6 * asin(0.6)),
    "behind-clearance": lambda: 2 * (8 + 6 * asin(0.6)),
    "entangling-pair": entangling_pair,
    "far-pair": far_pair,
    "far-pair-short-tether": far_pair_short_tether,
    "two-in-a-row": lambda: 2 * (2 * sqrt(15) + 4 + 2 * asin(1 / 4)),
    "square-pier": lambda: 2 * (2 * sqrt(17) + 2),
    "harbour": lambda: 2 * (sqrt(20) + 5 + 1 + sqrt(5)),
    "against-the-wall": lambda: 2 * around(5, hypot(5, 0.5), 2, pi + atan2(0.5, 5)),
    "overlap": lambda: 2 * (2 * sqrt(4.5**2 - 4) + 3 + 2 * 2 * asin(2 / 4.5)),
    "depth-only": lambda: 2 * hypot(8 + 6 * asin(0.6), 6),
    "winding-wall": winding_wall,
}


@pytest.mark.parametrize("name", FORMULAS)
def test_the_optimum_is_the_closed_form(name):
    problem = Problem.load(KNOWN / f"{name}.json")
    solution = solve(problem)
    assert solution.status is Status.OPTIMAL
    assert solution.length == pytest.approx(FORMULAS[name](), rel=1e-8)
    assert verify(problem, solution), str(verify(problem, solution))


@pytest.mark.parametrize("name", ["brute-3", "brute-4"])
def test_the_optimum_is_what_brute_force_finds(name):
    problem = Problem.load(KNOWN / f"{name}.json")
    solution = solve(problem)
    brute = BruteForce(problem, sides=24).optimum()
    # inscribed polygons make brute force short by at most (pi/24)^2/6 of every arc
    assert brute <= solution.length * (1 + 1e-9)
    assert solution.length <= brute * 1.003
    assert solution.status is Status.OPTIMAL
    assert verify(problem, solution)


def test_the_table_of_optima_is_complete_and_right():
    table = json.loads((KNOWN / "optima.json").read_text())
    assert set(table) == {p.stem for p in KNOWN.glob("*.json")} - {"optima"}
    assert len(table) >= 12
    for name, formula in FORMULAS.items():
        assert table[name] == pytest.approx(formula(), rel=1e-9)
    derivations = (KNOWN / "README.md").read_text()
    assert all(f"`{name}`" in derivations for name in table)


@pytest.mark.parametrize("path", REAL, ids=lambda p: p.stem)
def test_every_real_problem_is_proven_and_verified(path):
    problem = Problem.load(path)
    solution = solve(problem)
    assert solution.status is Status.OPTIMAL
    assert verify(problem, solution), str(verify(problem, solution))
    assert problem.name == path.stem
    if path.stem in ("wharf", "pool", "oc4-jacket"):
        again = solve(problem, params={"backend": "cbc"})
        assert again.status is Status.OPTIMAL
        assert math.isclose(again.length, solution.length, rel_tol=2e-6)


def test_the_shortest_tour_of_the_double_spiral_needs_a_looping_class():
    """The non-looping rule of 2017 can cost the optimum: Proposition 10 of docs/theory."""
    problem = Problem.load(KNOWN / "double-spiral.json")
    shortest = solve(problem)
    assert shortest.status is Status.OPTIMAL
    table = json.loads((KNOWN / "optima.json").read_text())
    assert shortest.length == pytest.approx(table["double-spiral"], rel=1e-6)
    assert verify(problem, shortest), str(verify(problem, shortest))
    assert any(is_looping(visit.signature) for visit in shortest.tour)
    restricted = solve(problem, roadmap_options={"classes": "non-looping"})
    assert restricted.status is Status.OPTIMAL_OF_KEPT
    assert restricted.lower_bound > 1.02 * shortest.length


def test_the_non_looping_rule_can_leave_no_tour_and_the_message_says_why():
    """A goal behind a winding wall: Proposition 10 (b) of docs/theory."""
    problem = Problem.load(KNOWN / "winding-wall.json")
    tour = solve(problem)
    assert [visit.signature for visit in tour.tour] == [(2, 2)]
    with pytest.raises(InfeasibleError, match="leaves out every class") as caught:
        solve(problem, roadmap_options={"classes": "non-looping"})
    assert "expected at least" not in str(caught.value)


def test_the_plain_tour_of_the_entangling_pair_is_shorter_and_wrapped():
    """What the instance is for: without topology one would drive round the circle."""
    plain = 2 * hypot(5.5, 2) + around(hypot(0.5, 2), hypot(0.5, 2), 1, 2 * atan2(2, 0.5))
    assert plain < entangling_pair() - 0.5


def test_the_far_pair_needs_its_long_tether():
    """With the short one the class over the top to the lower goal is out of reach."""
    long_way = around(5, sqrt(26), 2, pi + atan2(1, 5))
    short, long = (
        Problem.load(KNOWN / f"far-pair{s}.json").tether_length for s in ("-short-tether", "")
    )
    assert short < long_way <= long
