"""Optima of netsp are certified: those of all shipped problems, and of random ones."""

from pathlib import Path

import numpy as np
import pytest

from netsp import Problem, Status, solve
from netsp.plan.proof.certify import certify
from netsp.plan.random_worlds import random_world

PROBLEMS = Path(__file__).parent.parent / "problems"
SHIPPED = sorted(
    path
    for path in (*PROBLEMS.glob("*.json"), *PROBLEMS.glob("known/*.json"))
    if path.stem not in ("optima", "lillgrund-part")
)
"""Problems that are certified here; `make accept` certifies lillgrund-part, a minute's work."""

FAMILIES = ("icra2017", "rss2016", "clustered", "array", "harbour")

PORTIONS = 10
"""Portions of the random problems, which processes can share."""


def uncertified(problem):
    """Return why the optimum of a problem is not certified, or an empty string."""
    solution = solve(problem)
    if solution.status is not Status.OPTIMAL:
        return f"not solved: {solution.status.value}"
    certificate = certify(problem, solution)
    if certificate.level != "optimal":
        return f"{certificate.level}: {certificate.reason}"
    shown = certificate.bound  # as `netsp_check` found it
    if not solution.length * (1.0 - 1e-6) <= shown <= solution.length:
        return f"the bound {shown} is not that of the tour, {solution.length}"
    return ""


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_every_shipped_problem_is_certified(path):
    """`netsp_check` accepts a proof of each optimum of `problems/` and `problems/known`."""
    assert uncertified(Problem.load(path)) == ""


def test_goals_on_rays_of_obstacles_are_certified():
    """Viewpoints straight above a pile are on its ray, where a rounded position changes words."""
    goals = [{"inspect": "pile", "standoff": 0.5, "viewpoints": 3}, [9.0, 1.0]]
    pile = {"center": [7.2, 2.2], "radius": 0.25, "name": "pile"}
    data = {"base": [0.5, 3.0], "goals": goals, "obstacles": [pile], "tether_length": 14.0}
    assert uncertified(Problem.model_validate({"schema_version": 1, **data})) == ""


def test_a_goal_straight_below_the_base_is_certified():
    """The plan of such a problem is one point, and the box about it has a size all the same."""
    assert uncertified(Problem(base=(2, 1), goals=[(2, 1, -5)], tether_length=9)) == ""


@pytest.mark.parametrize("portion", range(PORTIONS))
def test_every_optimum_of_a_random_problem_is_certified(portion):
    """`netsp_check` accepts a proof of each optimum of 200 random problems of five families."""
    count, failures = 0, {}
    for seed in range(portion, 200, PORTIONS):
        family, rng = FAMILIES[seed // PORTIONS % len(FAMILIES)], np.random.default_rng(seed)
        problem = random_world(
            seed, family=family, goals=int(rng.integers(2, 8)), obstacles=int(rng.integers(2, 9)),
            tether_length=float(rng.choice([250.0, 300.0, 350.0])),
        )  # fmt: skip
        count += 1
        if reason := uncertified(problem):
            failures[f"{family} {seed}"] = reason
    assert count == 200 // PORTIONS
    assert not failures
