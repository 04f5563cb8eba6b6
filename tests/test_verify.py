"""The judge passes what is right and fails every single thing that can be wrong."""

import importlib
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import (
    Circle,
    InfeasibleError,
    Polygon,
    Problem,
    Solution,
    State,
    solve,
    travel_graph,
    verify,
)
from netsp.base.errors import EXIT_NOT_VERIFIED, VerificationError
from netsp.command.main import main
from netsp.hsignature import signature
from netsp.judge import checked
from netsp.judge.orientation import orientation, orientations
from netsp.judge.solid_distances import room
from netsp.judge.stringpull import StringPuller, reduce_sleeve
from netsp.model.solution import ProblemReference, Status, Visit
from netsp.roadmap.taut import TautRoadmap
from tests.worlds import random_world, small_worlds


@pytest.fixture(scope="module")
def pair():
    """Two goals behind a circle, one of them deep: the plain tour would entangle."""
    problem = Problem(
        base=(0, 0),
        goals=[(5.5, 2), (5.5, -2, -1), (9, 0.5)],
        obstacles=[Circle(center=(5, 0), radius=1), Circle(center=(0, 6), radius=1, name="far")],
        tether_length=12,
        bounds=(-3, -9, 12, 9),
    )
    return problem, solve(problem)


def failed(problem, solution):
    return {c.name for c in verify(problem, solution).checks if not c.passed}


def edit(solution, **changes):
    return solution.model_copy(update=changes)


def visits(solution, k, **changes):
    tour = list(solution.tour)
    tour[k] = tour[k].model_copy(update=changes)
    return edit(solution, tour=tuple(tour))


def test_a_right_solution_passes(pair):
    verdict = verify(*pair)
    assert verdict, str(verdict)
    assert len(verdict.checks) == 13


def test_another_problem_fails(pair):
    problem, solution = pair
    other = ProblemReference(name="x", sha256="0" * 64)
    assert failed(problem, edit(solution, problem=other)) == {"belongs to the problem"}


def test_a_path_that_does_not_close_fails(pair):
    problem, solution = pair
    assert "starts and ends at the base" in failed(problem, edit(solution, path=solution.path[:-1]))


def test_a_goal_left_out_fails(pair):
    problem, solution = pair
    assert "names every goal once" in failed(problem, edit(solution, tour=solution.tour[1:]))


def test_a_goal_named_twice_fails(pair):
    problem, solution = pair
    tour = (*solution.tour, solution.tour[0])
    assert "names every goal once" in failed(problem, edit(solution, tour=tour))


def test_a_goal_passed_by_at_a_distance_fails(pair):
    problem, solution = pair
    goal = problem.goals[1].position
    path = tuple((x, y, z + 0.01) if (x, y, z) == goal else (x, y, z) for x, y, z in solution.path)
    assert "visits every goal in order" in failed(problem, edit(solution, path=path))


def test_the_wrong_order_fails(pair):
    problem, solution = pair
    assert failed(problem, edit(solution, tour=solution.tour[::-1])) != set()


def test_a_path_through_an_obstacle_fails(pair):
    problem, solution = pair
    k = next(i for i, p in enumerate(solution.path) if p == problem.goals[0].position)
    path = (*solution.path[: k + 1], (5.0, 0.1, 0.0), *solution.path[k:])
    assert "enters no obstacle" in failed(problem, edit(solution, path=path))


def test_a_path_out_of_bounds_fails(pair):
    problem, solution = pair
    path = ((0.0, 0.0, 0.0), (-4.0, 0.0, 0.0), *solution.path)
    assert "stays within bounds" in failed(problem, edit(solution, path=path))


def test_a_wrong_word_fails(pair):
    problem, solution = pair
    assert "tether word at every goal" in failed(problem, visits(solution, 0, signature=(2,)))


def test_a_loop_round_an_obstacle_fails_twice_over(pair):
    """Both opinions see it: the rays and the triangles."""
    problem, solution = pair
    loop = tuple(
        (5 + 1.2 * math.cos(a), 1.2 * math.sin(a), 0.0) for a in np.linspace(math.pi, -math.pi, 60)
    )
    path = (solution.path[0], *loop, *solution.path)
    bad = failed(problem, edit(solution, path=path))
    assert {"total word is empty", "contractible over triangles", "length is right"} <= bad


def test_a_tether_too_long_fails(pair):
    problem, solution = pair
    longest = max(v.tether_length for v in solution.tour)
    shorter = problem.model_copy(update={"tether_length": longest * 0.999})
    bad = failed(shorter, edit(solution, problem=ProblemReference(name="x", sha256=shorter.sha256)))
    assert "taut tether fits" in bad


def test_a_wrong_tether_length_fails(pair):
    problem, solution = pair
    wrong = visits(solution, 1, tether_length=solution.tour[1].tether_length + 0.01)
    assert failed(problem, wrong) == {"taut lengths as stated"}


@pytest.mark.parametrize("factor", [0.999, 1.001])
def test_a_wrong_length_fails(pair, factor):
    problem, solution = pair
    length = solution.length * factor
    wrong = edit(solution, length=length, lower_bound=length, gap=0.0)
    assert "length is right" in failed(problem, wrong)


@pytest.mark.parametrize(
    "changes",
    [
        {"lower_bound": 1e9},
        {"gap": 0.5},
        {"gap": None},
        {"lower_bound": 1.0, "gap": 0.95},
        {"status": Status.INFEASIBLE},
    ],
)
def test_a_proof_that_does_not_add_up_fails(pair, changes):
    problem, solution = pair
    assert "bound, gap and status agree" in failed(problem, edit(solution, **changes))


def test_no_tour_fails(pair):
    problem, solution = pair
    none = edit(solution, length=None, lower_bound=None, gap=None, tour=(), path=(),
                status=Status.NO_SOLUTION_FOUND)  # fmt: skip
    assert failed(problem, none) == {"has a tour"}


@pytest.mark.parametrize("seed", range(4))
def test_pulled_lengths_bracket_the_exact_ones_for_every_class(seed):
    """Two methods that share no code agree on every tether of a random world."""
    problem = random_world(seed, goals=5, tether=320.0)
    roadmap = TautRoadmap(problem)
    puller = StringPuller(problem, reach=320.0)
    for v in range(1, len(roadmap.cluster)):
        path = roadmap.to_travel_graph().path(0, v)
        sleeve = reduce_sleeve([c for piece in puller.crossings(path) for c in piece])
        pulled = puller.pull(path[0], path[-1], sleeve)
        assert pulled.low <= roadmap.planar[v] * (1 + 1e-9)
        assert roadmap.planar[v] <= pulled.high * (1 + 1e-6)
        assert pulled.high - pulled.low <= 2e-4 * problem.tether_length


@settings(max_examples=40, deadline=None)
@given(small_worlds(grid=True))
def test_the_two_opinions_on_homotopy_agree(problem):
    """Every pair of classes of one goal differs by a loop that neither method can shrink."""
    try:
        roadmap = TautRoadmap(problem)
    except InfeasibleError:
        return
    graph = roadmap.to_travel_graph()
    puller = StringPuller(problem, reach=problem.tether_length)
    members = graph.members(1)[:5]
    for u in members:
        for v in members:
            loop = np.vstack([graph.path(0, int(u)), graph.path(0, int(v))[::-1][1:]])
            word = signature(loop, problem.representative_points)
            sleeve = reduce_sleeve([c for piece in puller.crossings(loop) for c in piece])
            assert (word == ()) == (sleeve == []) == (u == v)


@settings(max_examples=25, deadline=None)
@given(small_worlds(goals=2))
def test_every_solution_of_a_small_world_is_verified(problem):
    try:
        graph = travel_graph(problem)
    except InfeasibleError:
        return
    if len(graph) > 150:
        return
    verdict = verify(problem, solve(problem))
    assert verdict, f"{problem.to_json()}\n{verdict}"


def box(x0, y0, x1, y1):
    return Polygon(polygon=[(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def test_a_tether_along_an_edge_of_the_triangles_is_pulled_right():
    """The base, a corner of the obstacle and a corner of the judge's box lie on one line."""
    problem = Problem(base=(11, 1), goals=[(0, 10)], obstacles=[box(5, 6, 6, 7)], tether_length=20)
    verdict = verify(problem, solve(problem))
    assert verdict, str(verdict)


@pytest.mark.parametrize(
    ("base", "goals"),
    [((0, 0), [(-1, 1), (1, -1)]), ((0, 0), [(1, -1)]), ((-2, 2), [(0, 0), (2, -2)])],
)
def test_a_tour_may_stand_where_two_obstacles_touch(base, goals):
    problem = Problem(
        base=base, goals=goals, obstacles=[box(0, 0, 2, 2), box(-2, -2, 0, 0)], tether_length=14
    )
    verdict = verify(problem, solve(problem))
    assert verdict, str(verdict)


def out_and_back(problem, *path):
    """The tour to the only goal by way of a path, and back on it, whatever lies in its way."""
    there = [(*problem.base[:2], 0.0), *((float(x), float(y), 0.0) for x, y in path)]
    line = np.array(there)
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    visit = Visit(
        goal=0, signature=signature(line, problem.representative_points), tether_length=length
    )
    return Solution(
        problem=ProblemReference(name="x", sha256=problem.sha256), solver="drawn", roadmap="drawn",
        status=Status.FEASIBLE, length=2.0 * length, lower_bound=None, gap=None, tour=(visit,),
        path=tuple(map(tuple, [*there, *there[-2::-1]])),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (box(0, 0, 2, 2), box(-2, -2, 0, 0)),
        (box(0, -2, 2, 2), box(-2, -1, 0, 1)),
        (Circle(center=(2, 0), radius=2), Circle(center=(-1, 0), radius=1)),
        (Circle(center=(1, -1), radius=2**0.5), box(-2, 0, 0, 2)),
    ],
)
def test_no_path_passes_where_two_obstacles_touch(one, other):
    """Straight through the contact, from one side to the other."""
    across = (-1.0, 1.0) if one == box(0, 0, 2, 2) else (0.0, 1.0)
    if isinstance(one, Circle) and isinstance(other, Polygon):
        across = (1.0, 1.0)
    start, end = (3.0 * across[0], 3.0 * across[1]), (-3.0 * across[0], -3.0 * across[1])
    problem = Problem(base=start, goals=[end], obstacles=[one, other], tether_length=20)
    assert "enters no obstacle" in failed(problem, out_and_back(problem, (0, 0), end))


@pytest.mark.parametrize(
    ("obstacle", "clearance"),
    [
        (Circle(center=(5, 0), radius=1), 0.0),
        (Circle(center=(5, 0), radius=0.5), 0.5),
        (box(4, -1, 6, 1), 0.0),
        (box(4.5, -1, 5.5, 0.5), 0.5),
    ],
)
@pytest.mark.parametrize("depth", [1e-2, 1e-4])
def test_a_path_that_enters_an_obstacle_by_little_fails(obstacle, clearance, depth):
    """A straight path just below the top, at a height of 1 with the clearance."""
    problem = Problem(
        base=(0, 1.0 - depth), goals=[(10, 1.0 - depth)], obstacles=[obstacle],
        clearance=clearance, tether_length=12,
    )  # fmt: skip
    inside = out_and_back(problem, problem.goals[0].position[:2])
    assert "enters no obstacle" in failed(problem, inside)
    free = Problem(
        base=(0, 1), goals=[(10, 1)], obstacles=[obstacle], clearance=clearance, tether_length=12
    )
    assert verify(free, out_and_back(free, (10, 1.0)))


def test_a_path_beyond_the_reach_of_the_tether_fails(pair):
    """A spur on the way, out and back on one line: no goal has another tether for it."""
    given, tour = pair
    free = Problem(base=given.base, goals=given.goals, obstacles=given.obstacles, tether_length=12)
    tour = edit(tour, problem=ProblemReference(name="x", sha256=free.sha256))
    # the tether from the base straight to the left is as long as the spur
    for far, right in ((11.99, True), (12.01, False), (37.8, False)):
        spur = (tour.path[0], (-far, 0.0, 0.0), *tour.path)
        length = tour.length + 2.0 * far
        lie = edit(tour, path=spur, length=length, lower_bound=None, gap=None,
                   status=Status.FEASIBLE)  # fmt: skip
        assert failed(free, lie) == (set() if right else {"taut tether fits"})


def test_the_reach_of_the_tether_counts_heights():
    problem = Problem(base=(0, 0), goals=[(3, 0)], tether_length=5)
    for depth, right in ((-3.99, True), (-4.01, False)):
        spur = ((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 0.0, depth), (3.0, 0.0, 0.0), (0.0,) * 3)
        tour = out_and_back(problem, (3, 0))
        lie = edit(tour, path=spur, length=6.0 - 2.0 * depth)
        assert failed(problem, lie) == (set() if right else {"taut tether fits"})


def test_a_tether_too_long_at_the_start_may_only_be_taken_in():
    """The robot stands 2 m beyond its tether; on the way to the goal it may not go farther."""
    state = State(position=(12, 0))
    problem = Problem(base=(0, 0), goals=[(5, 0)], tether_length=10, state=state)
    tour = solve(problem)
    assert verify(problem, tour)
    for x, right in ((11.5, True), (12.5, False)):
        by_way = (tour.path[0], (x, 0.0, 0.0), (11.0, 0.0, 0.0), *tour.path[1:])
        length = 2.0 * abs(x - 12.0) * (x > 12.0) + tour.length
        lie = edit(tour, path=by_way, length=length, lower_bound=None, gap=None,
                   status=Status.FEASIBLE)  # fmt: skip
        assert failed(problem, lie) == (set() if right else {"taut tether fits"})
    back = (tour.path[0], (11.0, 0.0, 0.0), (11.5, 0.0, 0.0), *tour.path[1:])
    lie = edit(tour, path=back, length=tour.length + 1.0, lower_bound=None, gap=None,
               status=Status.FEASIBLE)  # fmt: skip
    assert failed(problem, lie) == {"taut tether fits"}


@pytest.mark.parametrize("name", ["length", "lower_bound", "gap"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_none_fail(pair, name, value):
    problem, solution = pair
    assert "numbers are finite" in failed(problem, edit(solution, **{name: value}))


def test_a_goal_behind_a_wall_thinner_than_the_tolerance_is_not_visited():
    """The path ends within the tolerance of the goal, on the other side of a wall."""
    wall = box(-5, 1.0, 5, 1.0 + 2e-7)
    problem = Problem(base=(0, -5), goals=[(0, 1.0 + 3e-7)], obstacles=[wall], tether_length=20)
    near = out_and_back(problem, (0, 1.0 - 1e-7))
    assert failed(problem, near)


@pytest.mark.parametrize("seed", range(40))
def test_orientation_is_that_of_fractions(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.integers(-3, 4, (2, 2)) / 10.0
    c = a + rng.integers(-3, 4) * (b - a) + rng.integers(-1, 2, 2) * 2.0**-54
    (ax, ay), (bx, by), (cx, cy) = ([Fraction(float(v)) for v in p] for p in (a, b, c))
    exact = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    sign = (exact > 0) - (exact < 0)
    assert orientation(tuple(a), tuple(b), tuple(c)) == sign
    assert orientations(a[None], b[None], c[None]).tolist() == [sign]


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(-4, 14), st.integers(-4, 14)), min_size=2, max_size=6))
def test_a_path_run_backwards_crosses_the_same_edges(corners):
    """Whole numbers: paths run along edges of triangles, and through their ends."""
    obstacles = [box(2, 2, 4, 4), box(4, 4, 6, 6), box(7, 1, 8, 2), Circle(center=(1, 7), radius=1)]
    problem = Problem(base=(0, 0), goals=[(10, 10)], obstacles=obstacles, tether_length=20)
    puller = PULLERS.setdefault("whole", StringPuller(problem, 20.0))
    path = np.array(corners, dtype=float)
    shapes = [shapely.Polygon(s.shape) for s in puller.solids]
    line = shapely.LineString(path)
    pieces = [puller.crossings(path), puller.crossings(path[::-1])]
    there, back = ([c for piece in p for c in piece] for p in pieces)
    if not any(line.intersects(s) for s in shapes):
        assert there == [(edge, not side) for edge, side in back[::-1]]
        assert reduce_sleeve(there + [(e, not s) for e, s in there[::-1]]) == []


PULLERS = {}


def test_a_tour_that_fails_its_check_is_not_written(pair, tmp_path, monkeypatch, capsys):
    """Whatever finds it, a plug-in's roadmap say: here one that overstates its length."""
    problem, solution = pair
    wrong = edit(solution, length=2.0 * solution.length, lower_bound=None, gap=None,
                 status=Status.FEASIBLE)  # fmt: skip
    with pytest.raises(VerificationError, match="length is right"):
        checked(problem, wrong)
    assert checked(problem, solution) is solution
    monkeypatch.setattr("netsp.plan.solve_problem.solve", lambda *_, **__: wrong)
    file, output = tmp_path / "problem.json", tmp_path / "tour.json"
    problem.save(file)
    assert main(["solve", str(file), "--quiet", "-o", str(output)]) == EXIT_NOT_VERIFIED
    assert "fails its check 'length is right'" in capsys.readouterr().err
    assert not output.exists()


def test_false_tours_of_forty_kinds_are_refused_and_right_ones_are_not(monkeypatch):
    """A sample of `python benchmarks/judge.py --by-kind`, over all its kinds of worlds."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent.parent / "benchmarks"))
    judge = importlib.import_module("judge")
    found = judge.tally(1, 9).values()
    assert [line for t in found for line in (*t.refused, *t.accepted)] == []
    assert len({name for t in found for name in t.false}) >= 40


def test_every_false_tour_of_a_problem_whose_goal_is_the_base_is_false(monkeypatch):
    """A tour that stands still has tethers and a length of 0, and no path to cut short."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent.parent / "benchmarks"))
    judge = importlib.import_module("judge")
    problem = Problem(
        base=(0, 0), goals=[(0, 0)], obstacles=[Circle(center=(3, 0), radius=1)], tether_length=9
    )
    solution = solve(problem)
    rng = np.random.default_rng(0)
    made = [(name, make(problem, solution, rng)) for name, make in judge.KINDS.items()]
    lies = [(name, lie) for name, lie in made if lie is not None]
    assert len(lies) > 30
    assert [name for name, lie in lies if judge._accepts(*lie)] == []


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), limit=st.floats(0.01, 5.0))
def test_the_room_at_a_corner_is_the_least_distance_of_its_edges_from_the_rest(seed, limit):
    """All pairs, which took minutes for coasts of ten thousand corners, say the same."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 30))
    turn = np.sort(rng.uniform(0, 2 * np.pi, n))
    v = np.column_stack([np.cos(turn), np.sin(turn)]) * rng.uniform(0.2, 3.0, n)[:, None]
    edges = [shapely.LineString([v[i], v[(i + 1) % n]]) for i in range(n)]
    least = np.full(n, np.inf)
    for i, edge in enumerate(edges):
        for c in set(range(n)) - {i, (i + 1) % n}:
            away = edge.distance(shapely.Point(v[c]))
            if away <= limit:
                for corner in (i, (i + 1) % n, c):
                    least[corner] = min(least[corner], away)
    assert room(v, limit) == pytest.approx(least)
