"""Classes along good tours, where a roadmap had to leave classes out."""

import signal
import subprocess
import sys

import numpy as np
import pytest

from netsp import Circle, Problem, Solution, solve, travel_graph, verify
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.plan import solve_problem as by_name
from netsp.plan import tether_carry_columns
from netsp.plan.solve_policy import CarryPolicy
from netsp.plan.tether_carry_columns import Carried, with_carried
from netsp.roadmap import taut


def windfarm(side=4, share=1.3, seed=0, radius=1.0):
    """Thin piles far apart, a goal beside each, and more tether than the goals need."""
    rng = np.random.default_rng(seed)
    places = [
        (100.0 * c + 50.0 * (r % 2) + rng.uniform(-10, 10), 80.0 * r + rng.uniform(-10, 10))
        for r in range(side) for c in range(side)
    ]  # fmt: skip
    goals = [(x + radius + 2.0, y + rng.choice([-2.0, 2.0])) for x, y in places]
    base = (-60.0, -60.0)
    longest = max(np.hypot(x - base[0], y - base[1]) for x, y in goals)
    return Problem(
        base=base, goals=goals, tether_length=share * longest,
        obstacles=[Circle(center=p, radius=radius) for p in places],
    )  # fmt: skip


def few(problem, most=40):
    return travel_graph(problem, max_classes=most)


def test_classes_that_are_put_back_have_the_tethers_of_the_whole_roadmap():
    problem = windfarm(3, 1.02, radius=15.0)
    whole, part = travel_graph(problem), few(problem, 20)
    assert whole.is_complete
    assert not part.is_complete
    every = [(int(whole.cluster[v]), whole.signatures[v]) for v in range(1, len(whole))]
    again = part.carrier.with_classes(every, lambda: False)
    assert len(again) == len(whole)
    tethers = dict(zip(zip(whole.cluster, whole.signatures, strict=True), whole.tethers,
                       strict=True))  # fmt: skip
    for v in range(len(again)):
        there = tethers[again.cluster[v], again.signatures[v]]
        assert again.tethers[v] == pytest.approx(there, abs=1e-6)


def test_classes_that_the_tether_does_not_reach_are_not_put_back():
    problem = windfarm(3, 1.02, radius=15.0)
    part = few(problem, 20)
    twice = (1, 1)  # around the first pile and once more
    assert len(part.carrier.with_classes([(9, (*twice, 2, 3, -2, 4))], lambda: False)) == len(part)


def test_nothing_is_put_back_once_the_time_is_up():
    part = few(windfarm(3, 1.02, radius=15.0), 20)
    wanted = [(k, (1,)) for k in range(1, 10)]
    assert len(part.carrier.with_classes(wanted, lambda: True)) == len(part)


def test_a_tour_along_carried_classes_is_verified_and_much_shorter(monkeypatch):
    problem = windfarm()
    how = {"roadmap_options": {"max_classes": 100}, "seed": 3}
    found = solve(problem, **how)
    assert verify(problem, found)
    assert found.lower_bound <= found.length
    monkeypatch.setattr(by_name, "with_carried", lambda graph, *_: Carried(graph))
    before = solve(problem, **how)
    assert found.length < 0.9 * before.length


def stacked():
    """Goals over one place, over the base too."""
    problem = windfarm(3, 1.2)
    over = [(x, y, -5.0) for x, y, _ in (problem.base, problem.goals[4].position)]
    goals = [g.position for g in problem.goals]
    return Problem(
        base=problem.base, goals=[*goals, *over, (*over[1][:2], -9.0)],
        obstacles=list(problem.obstacles), tether_length=problem.tether_length,
    )  # fmt: skip


@pytest.mark.parametrize("problem", [windfarm(4), stacked()], ids=["apart", "stacked"])
def test_the_nearest_are_found_as_among_all(problem):
    contacts = few(problem).carrier.paths.contacts
    for source in range(contacts.points):
        length, _ = contacts.tree(source)
        for most in (3, 6, contacts.points, contacts.points + 5):
            near, _ = contacts.tree_to_nearest(source, most)
            found = np.isfinite(near[: contacts.points])
            assert found.sum() >= min(most, contacts.points)
            assert np.allclose(near[: contacts.points][found], length[: contacts.points][found])
            farthest = near[: contacts.points][found].max()
            assert (length[: contacts.points][~found] >= farthest).all()
        for target in range(contacts.points):
            line = contacts.draw(source, target, contacts.tree_to(source, target))
            long = np.hypot(*np.diff(line, axis=0).T).sum()
            assert long == pytest.approx(length[target], rel=1e-3, abs=1e-6)


def test_a_tether_is_carried_along_and_no_farther_than_it_reaches():
    problem = windfarm(4, 1.05)
    graph = few(problem)
    words = {}
    chain = tether_carry_columns._along_straight_lines(graph, np.random.default_rng(0), Clock())
    assert sorted(goal for goal, _ in chain) == list(range(1, 17))
    again = tether_carry_columns._with_classes(graph, chain, words, Clock())
    assert list(words) == chain
    assert again.tethers.max() <= problem.tether_length * (1.0 + 1e-9)
    ended = Clock()
    ended.end()
    assert tether_carry_columns._along_straight_lines(graph, np.random.default_rng(0), ended) == []


def test_goals_over_one_place_are_carried_to():
    found = solve(stacked(), roadmap_options={"max_classes": 40}, time_limit=10.0)
    assert verify(stacked(), found)


def test_the_same_seed_carries_to_the_same_classes():
    problem = windfarm()
    tours = []
    for _ in range(2):
        found = with_carried(few(problem), Clock(), np.random.default_rng(5))
        assert found.graph.is_tour(found.tour)
        tours.append([found.graph.signatures[v] for v in found.tour])
    assert tours[0] == tours[1]


def test_a_whole_graph_is_given_back_as_it_is():
    graph = travel_graph(windfarm(2, 1.1))
    assert with_carried(graph, Clock(), np.random.default_rng(0)).graph is graph


def test_ctrl_c_while_classes_are_carried_keeps_the_best_tour(tmp_path):
    path, out = tmp_path / "farm.json", tmp_path / "tour.json"
    path.write_text(windfarm(5).to_json())
    run = subprocess.Popen(
        [sys.executable, "-m", "netsp", "solve", str(path), "-o", str(out), "--max-classes", "200"],
        stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    for line in run.stderr:
        if "carried" in line:
            run.send_signal(signal.SIGINT)
            break
    run.communicate()
    assert run.returncode == 0
    assert verify(Problem.load(path), Solution.load(out))


@pytest.fixture
def pressed(monkeypatch):
    """Ctrl-C as soon as classes are sought."""
    find = taut.find_classes

    def press(*args):
        signal.raise_signal(signal.SIGINT)
        return find(*args)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr(taut, "find_classes", press)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_while_classes_are_sought_leaves_the_tour_of_those_found(pressed):
    problem = windfarm(5)
    found = solve(problem)
    assert found.classes == "shortest"
    assert verify(problem, found)


def test_ctrl_c_while_a_roadmap_is_made_that_is_nothing_until_it_is_whole(pressed, monkeypatch):
    def never(*_):
        raise LimitReachedError("time limit reached while doing nothing")

    monkeypatch.setattr(taut, "TautLegs", never)
    with pytest.raises(KeyboardInterrupt):
        solve(windfarm(2))
    monkeypatch.setattr(taut, "find_classes", never)
    with pytest.raises(LimitReachedError, match="nothing"):
        solve(windfarm(2))


def test_searches_in_vain_end_although_there_is_no_end_of_classes():
    # so few may be looked at that each search begins anew with those of least tether
    policy = CarryPolicy(max_classes_per_goal=4)
    graph = few(windfarm())
    found = with_carried(graph, Clock(), np.random.default_rng(1), policy=policy)
    assert found.graph.is_tour(found.tour)
