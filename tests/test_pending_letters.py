"""Letters that a taut path writes and takes back: legs around hooks and bars are all found."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from netsp import Circle, Polygon, Problem, Solution, solve, verify
from netsp.command.main import main
from netsp.hsignature import concatenate, crossings, invert, reduce, signature
from netsp.roadmap import tangents
from netsp.roadmap.letters import arc_letters
from netsp.roadmap.outline import build_outline
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.pending_letters import MAX_PENDING, XMAX, XMIN, YMIN, pending_boxes
from netsp.roadmap.taut import TautRoadmap
from tests.brute import BruteForce
from tests.whole_numbers import WholeNumbers, whole_number_world

sys.path.insert(0, str(Path(__file__).parent.parent / "benchmarks"))

from hooked_walls import FAMILIES, compared, hooked_world, roadmap_of

BASIN = [(2, 2), (8, 2), (8, 8), (5, 8), (5, 7), (7, 7), (7, 3), (3, 3), (3, 7), (4, 7), (4, 8),
         (2, 8)]  # fmt: skip
POST = [(5.6, 5.1), (6.4, 5.1), (6.4, 5.9), (5.6, 5.9)]


def boxes_of(problem):
    outline = build_outline(problem)
    return pending_boxes(outline.rays, outline.blockers) + np.array(
        [*problem.base[:2], *problem.base[:2], 0.0]
    )


@pytest.mark.parametrize("flip", [1, -1])
def test_a_basin_with_a_hooked_wall_is_solved(flip):
    problem = Problem(
        base=(4 * flip, 4), goals=[(9 * flip, 4), (9 * flip, 0)], tether_length=20,
        obstacles=[Polygon(polygon=[(x * flip, y) for x, y in ring]) for ring in (BASIN, POST)],
    )  # fmt: skip
    solution = solve(problem)
    assert solution.status == "optimal"
    assert solution.length == pytest.approx(30.431575, abs=1e-5)
    # right of the post, and back to its left below the hook: both cross the ray of the post
    paths = TautPaths(problem)
    length, _ = paths._search_word(0, 1, ())
    assert length == pytest.approx(paths._pull(0, 1, ())[0], rel=1e-9) or length > 0.0


def test_a_bar_that_a_ray_cuts_may_reach_below_the_point_of_the_ray():
    """The path goes under the post's ray, round the far end of the bar deep below the post, and
    back over both."""
    problem = Problem(
        base=(-4, 3), goals=[(-4, 9)], tether_length=60,
        obstacles=[
            Circle(center=(0, 0), radius=1),
            Polygon(polygon=[(-15, 17), (9, -7), (9.2, -6.8), (-14.8, 17.2)]),
        ],
    )  # fmt: skip
    paths = TautPaths(problem)
    found = BruteForce(problem).lengths(0, 60.0)
    path = paths.path(0, 1, (-2,))
    assert crossings(path, paths.problem.representative_points)[0] == 1
    assert path[:, 1].min() < -6.9
    assert paths._search_word(0, 1, (-2,))[0] == pytest.approx(found[1, (-2,)], rel=2e-3)
    assert boxes_of(problem)[0, 0, YMIN] < -6.9


def test_a_hook_may_lead_a_path_under_the_point_and_back():
    """An arm goes over a post, down behind it and under it: so does the path around it, and it
    leaves the side to which it crossed."""
    arm = [(-6, 4), (4, 4), (4, -4), (-3, -4), (-3, -3.5), (3.5, -3.5), (3.5, 3.5), (-6, 3.5)]
    problem = Problem(
        base=(-4, 2.5), goals=[(-4, 6)], tether_length=80,
        obstacles=[Polygon(polygon=[(-1, -1), (1, -1), (1, 1), (-1, 1)]), Polygon(polygon=arm)],
    )  # fmt: skip
    box = boxes_of(problem)[0, 0]
    rays = problem.representative_points
    assert rays[1, 0] < 0.0 or rays[1, 1] < 0.0  # the arm's point
    if rays[1, 0] < 0.0:
        assert box[XMIN] < -2.9
        assert box[XMAX] > 3.9
        assert box[MAX_PENDING] > 1
    found = BruteForce(problem).lengths(0, 70.0)
    for word in ((), (-2,), (2,), (1, -2), (-1,)):
        if (1, word) in found:
            searched = TautPaths(problem)._search_word(0, 1, word)
            assert searched[0] == pytest.approx(found[1, word], abs=1e-5)


def test_a_letter_is_final_where_the_ray_cuts_nothing_off():
    apart = Problem(
        base=(-4, 0), goals=[(4, 0)], tether_length=20,
        obstacles=[Circle(center=(0, 0), radius=1), Circle(center=(-1, 6), radius=2),
                   Circle(center=(9, 6), radius=2)],
    )  # fmt: skip
    boxes = boxes_of(apart)
    assert boxes[0, 0, XMIN] == 0.0
    assert boxes[0, 0, XMAX] == pytest.approx(1.0)
    assert math.isinf(boxes[1, 0, XMIN])
    assert np.isinf(boxes[:, 1:, XMIN]).all()


@pytest.mark.parametrize("family", sorted(FAMILIES))
@pytest.mark.parametrize("seed", [1003])
def test_classes_and_legs_are_those_of_a_brute_force_that_prunes_no_word(family, seed):
    problem = hooked_world(family, seed)
    roadmap = None if problem is None else roadmap_of(problem)
    if roadmap is None:
        pytest.skip("the draw is no problem")
    assert compared(roadmap, BruteForce(roadmap.problem)).wrong == ""


@pytest.mark.parametrize("seed", range(2000, 2010))
def test_words_on_corners_edges_and_rays_are_those_of_whole_numbers(seed):
    problem = whole_number_world(seed)
    roadmap = None if problem is None else roadmap_of(problem)
    if roadmap is None:
        return
    assert compared(roadmap, WholeNumbers(roadmap.problem)).wrong == ""


@pytest.mark.parametrize("width", [1.0, 2.0, 3.0])
def test_a_base_on_the_corner_of_a_box_that_touches_another_gets_a_tour(width):
    """The tangent to the far end of the edge misses its arc by the angle tolerance."""
    boxes = [[(3, 1), (4, 1), (4, 3), (3, 3)], [(4, 1), (4 + width, 1), (4 + width, 3), (4, 3)]]
    problem = Problem(
        base=(3, 1), goals=[(11, 11)], tether_length=20,
        obstacles=[Polygon(polygon=box) for box in boxes],
    )  # fmt: skip
    graph = TautPaths(problem).tangents
    for numbers in (graph.turn, graph.gap, graph.length, graph.angle, graph.ends):
        assert np.isfinite(numbers).all()
    assert solve(problem, time_limit=20).status == "optimal"


def test_a_contact_lies_on_an_arc_in_both_senses_or_in_none():
    rng = np.random.default_rng(0)
    key, reverse = (
        getattr(f, "py_func", f) for f in (tangents._arc_position, tangents._reversed_position)
    )
    for _ in range(2000):
        start = rng.uniform(-7, 7)
        end = start + rng.choice([1e-9, 0.1, 3.0, 6.0])
        theta = rng.choice([start, end]) + rng.choice([-1, 1]) * rng.choice(
            [0.0, 1e-7, 1e-7 * (1 - 1e-9), 1e-7 * (1 + 1e-9)]
        )
        for sense in (1, -1):
            along = key(theta, sense, start, end, False)
            assert math.isnan(along) == math.isnan(reverse(along, start, end, False))


def test_letters_of_an_arc_end_even_where_its_turn_is_no_number():
    out = np.empty(8, dtype=np.int32)
    rays, order = np.zeros((1, 2)), np.zeros(1, dtype=np.int64)
    walk = getattr(arc_letters, "py_func", arc_letters)
    assert walk(0.0, 0.0, 1.0, -1.0, 1.0, 0.0, math.nan, rays, order, out, 0) <= 8


HIDDEN = Problem(
    base=(0, 0), goals=[(6, 1), (6, -1), (2, 4)], tether_length=7,
    obstacles=[Circle(center=(3, 0), radius=1), Circle(center=(4, 3), radius=0.8)],
)  # fmt: skip


@pytest.fixture
def hidden_legs(monkeypatch):
    """Nothing is pulled, and legs between goals 0 and 1 are not found by a search either; the
    length of the shortest tour with these legs."""
    length = solve(HIDDEN).length
    search = TautPaths._find

    def sought(self, a, b, word, longest, stop):
        return None if {a, b} == {1, 2} else search(self, a, b, word, longest, stop)

    monkeypatch.setattr(TautPaths, "_find", sought)
    monkeypatch.setattr(TautPaths, "_pull", lambda *_: (-1.0, None, None))
    monkeypatch.setattr("netsp.roadmap.taut_legs.fill", _pulls_nothing)
    monkeypatch.setattr("netsp.roadmap.taut_legs.pull_each", lambda *args: args[-1].fill(-1.0))
    return length


def _pulls_nothing(branches, lengths, point, ends, slits, arcs, stop, i, j):
    order, whole = branches.order, len(lengths.out) == len(branches.order)
    while i < len(order):
        for k in range(j, len(order)):
            u, v = order[i], order[k]
            apart = point[u] != point[v] and 0 not in (point[u], point[v])
            if apart and lengths.row[i] >= 0 and lengths.out[lengths.row[i], v] == -1.0:
                return i, k
        i += 1
        j = i + 1 if whole else 0
    return i, j


def test_a_leg_that_the_search_for_its_word_misses_is_found_among_all_words(hidden_legs):
    found = solve(HIDDEN)
    assert found.status == "optimal"
    assert found.legs_left_out == ()
    assert found.length == pytest.approx(hidden_legs, rel=1e-9)


def test_a_leg_that_is_not_found_is_left_out_and_said_and_the_bound_still_holds(
    hidden_legs, monkeypatch, capsys, tmp_path
):
    monkeypatch.setattr(TautPaths, "_search_all_words", lambda *_: None)
    graph = TautRoadmap(HIDDEN).to_travel_graph()
    costs, pairs = graph.costs, graph.legs_left_out
    assert pairs
    for u, v in pairs:
        assert {int(graph.cluster[u]), int(graph.cluster[v])} == {1, 2}
        assert costs[u, v] == pytest.approx(graph.tethers[u] + graph.tethers[v])
        assert graph.costs_of(np.array([u]), np.array([v]))[0] == pytest.approx(costs[u, v])
        path = graph.path(u, v)
        assert signature(path, HIDDEN.representative_points) == reduce(
            concatenate(invert(graph.signatures[u]), graph.signatures[v])
        )
    found = solve(HIDDEN)
    assert found.legs_left_out
    assert found.lower_bound <= hidden_legs * (1 + 1e-9)
    assert hidden_legs <= found.length * (1 + 1e-9)
    assert verify(HIDDEN, found).passed
    file = tmp_path / "hidden.json"
    HIDDEN.save(file)
    assert main(["solve", str(file), "-o", str(tmp_path / "out.json")]) == 0
    assert "whose taut path was not found (#0 to #1" in capsys.readouterr().err
    assert Solution.load(tmp_path / "out.json").legs_left_out == found.legs_left_out
