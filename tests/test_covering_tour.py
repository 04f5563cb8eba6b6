"""Viewpoints and tour chosen together: cover, cost, legs and stops against independent counts."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.clock import Clock
from netsp.base.compiled.interpretation import interpreted
from netsp.base.errors import InputError
from netsp.plan.cover import cover
from netsp.plan.cover.arrival_turns import expected_turns
from netsp.plan.cover.choose import choose_greedily, prune
from netsp.plan.cover.cover_policy import CoverPolicy, TourSearchPolicy
from netsp.plan.cover.covering_rounds import RoundSettings, insertion_tour, search_rounds
from netsp.plan.cover.covering_tour import TourProblem, cheapest_tour, shortest_order
from netsp.plan.cover.leg_classes import TetherClasses
from netsp.plan.cover.tour_choice import TourChooser
from netsp.plan.cover.tour_improvement import nearest_neighbour_tour, shorten, tour_length
from netsp.plan.cover.viewpoint_distances import are_clear, estimate_distances, neighbour_pairs
from netsp.plan.cover.viewpoints import Viewer, Viewpoints, coarsen, find_more_viewpoints
from netsp.world import Scene
from netsp.world.mission.equipment import Camera
from netsp.world.paths.tree import Grid
from netsp.world.simulator.coverage import Coverage, surface_patches

CAMERA = Camera(range=2.5, patch=0.25)
WALL = Scene(name="wall", solids=[{"box": {"center": [0, 0, -3], "size": [0.2, 4, 20]}}])
BALL = Scene(name="ball", solids=[{"sphere": {"center": [0, 0, -4], "radius": 0.8}}],
             bounds=[-6, -6, -9, 6, 6, 0])  # fmt: skip
FEW_ROUNDS = CoverPolicy(max_candidates=300, tours=TourSearchPolicy(max_rounds=300))

POINTS = st.lists(st.tuples(st.floats(0, 9), st.floats(0, 9)), min_size=2, max_size=9)


def distances_of(points):
    points = np.array(points, dtype=float)
    return np.linalg.norm(points[:, None] - points[None], axis=2)


def viewer_of(scene, policy=None, standoff=1.2):
    field = scene.field()
    patches = coarsen(surface_patches(scene, field, 0.25, np.zeros((1, 3))), 0.25)
    allowed = lambda places: np.ones(len(places), dtype=bool)  # noqa: E731
    return Viewer(
        field, patches, CAMERA, standoff, 0.3, np.radians(75.0), 2.5, allowed, policy or FEW_ROUNDS
    )


@settings(deadline=None, max_examples=60)
@given(POINTS, st.randoms(use_true_random=False))
def test_a_shortened_tour_has_no_better_reversal_and_the_same_places(points, random):
    distances, order = distances_of(points), list(range(1, len(points)))
    random.shuffle(order)
    tour = np.array([0, *order])
    short = shorten(distances, tour)
    assert short[0] == 0
    assert sorted(short) == sorted(tour)
    length = tour_length(distances, short)
    assert length <= tour_length(distances, tour) + 1e-9
    for i, j in itertools.combinations(range(1, len(short) + 1), 2):
        other = np.concatenate([short[:i], short[i:j][::-1], short[j:]])
        assert tour_length(distances, other) >= length - 1e-6
    around = shorten(distances, tour, around=tour[1:2])
    assert sorted(around) == sorted(tour)
    assert tour_length(distances, around) <= tour_length(distances, tour) + 1e-9


def problem_of(random, count, patches):
    rng = np.random.default_rng(random)
    sees = np.vstack([np.zeros(patches, dtype=bool), rng.random((count, patches)) < 0.35])
    areas = np.where(sees.any(axis=0), rng.uniform(0.5, 2.0, patches), 0.0)
    share = rng.choice([0.7, 0.9, 1.0])
    prices = np.r_[0.0, rng.uniform(0.0, 1.0, count)]
    return TourProblem(
        sees, areas, share * areas.sum(), distances_of(rng.uniform(0, 9, (count + 1, 2))), prices
    )


def least_cost(problem):
    """The cost of the best of all sets of places, in the best of all orders."""
    best, n = math.inf, len(problem.prices)
    for count in range(n):
        for chosen in itertools.combinations(range(1, n), count):
            tour = np.array([0, *chosen])
            if problem.seen_area(tour) < problem.needed * (1 - 1e-9):
                continue
            for order in itertools.permutations(chosen):
                best = min(best, problem.cost(np.array([0, *order])))
    return best


@pytest.mark.parametrize("seed", range(12))
def test_the_cheapest_covering_tour_of_few_places_is_found(seed):
    problem = problem_of(seed, 6, 12)
    policy = TourSearchPolicy(max_rounds=300)
    tour = cheapest_tour(problem, np.random.default_rng(seed), Clock(), policy)
    assert tour[0] == 0
    assert len(set(tour.tolist())) == len(tour)
    assert problem.seen_area(tour) >= problem.needed * (1 - 1e-9)
    assert problem.cost(tour) == pytest.approx(least_cost(problem))


@settings(deadline=None, max_examples=12)
@given(st.integers(0, 10**6), st.integers(2, 25))
def test_more_rounds_cover_as_much_for_no_more(seed, count):
    problem = problem_of(seed, count, 60)
    costs = []
    for rounds in (1, 20, 60):
        policy = TourSearchPolicy(max_rounds=rounds, warmth=1e-12)
        tour = cheapest_tour(problem, np.random.default_rng(1), Clock(), policy)
        assert problem.seen_area(tour) >= problem.needed * (1 - 1e-9)
        costs.append(problem.cost(tour))
    assert costs[2] <= costs[1] + 1e-9
    assert costs[1] <= costs[0] + 1e-9


@pytest.mark.parametrize("seed", range(8))
def test_no_tour_costs_more_than_that_of_the_greedy_cover_even_without_time(seed):
    problem = problem_of(seed, 30, 60)
    chosen = choose_greedily(problem.sees, problem.areas, problem.needed)
    chosen = prune(problem.sees, problem.areas, chosen, problem.needed)
    cover_first = shorten(problem.distances, nearest_neighbour_tour(problem.distances, chosen))
    for limit in (0.0, None):
        policy = TourSearchPolicy(max_rounds=20)
        tour = cheapest_tour(problem, np.random.default_rng(seed), Clock(limit), policy)
        assert problem.seen_area(tour) >= problem.needed * (1 - 1e-9)
        assert problem.cost(tour) <= problem.cost(cover_first) + 1e-9


@pytest.mark.parametrize("seed", range(8))
def test_insertions_from_the_start_alone_see_enough_unless_nothing_does(seed):
    problem, policy = problem_of(seed, 30, 60), TourSearchPolicy()
    settings_ = RoundSettings(*(getattr(policy, name) for name in RoundSettings._fields))
    state = np.array([seed + 1], dtype=np.uint64)
    tour = insertion_tour(problem.arrays(), settings_, state)
    assert tour[0] == 0
    assert len(set(tour.tolist())) == len(tour)
    assert problem.seen_area(tour) >= problem.needed * (1 - 1e-9)
    assert not len(insertion_tour(problem.arrays()._replace(needed=1e9), settings_, state))


def test_local_rounds_add_nothing_that_sees_only_what_was_unseen_before():
    # Place 1 sees the needed area; place 2 is on the way, and sees only a patch that is not needed.
    sees = np.array([[0, 0], [1, 0], [0, 1]], dtype=bool)
    distances = distances_of([(0.0, 0.0), (2.0, 0.0), (1.0, 0.0)])
    problem = TourProblem(sees, np.array([2.0, 2.0]), 2.0, distances, np.zeros(3))
    visited = {}
    for share in (1.0, 1e-12):
        policy = TourSearchPolicy(local_share=share)
        settings_ = RoundSettings(*(getattr(policy, name) for name in RoundSettings._fields))
        tour, state = np.array([0, 1]), np.array([5], dtype=np.uint64)
        visited[share] = search_rounds(problem.arrays(), settings_, tour, tour, (0, 50), state)[1]
    assert visited[1.0].tolist() == [0, 1]
    assert visited[1e-12].tolist() == [0, 2]


def test_legs_go_round_a_wall():
    viewer = viewer_of(WALL)
    places = np.array([[-1.0, 0.0, -3.0], [1.0, 0.0, -3.0], [-1.0, 1.0, -3.0], [-1.0, 0.0, -3.0]])
    legs = estimate_distances(viewer, places)
    assert legs == pytest.approx(legs.T)
    assert legs[0, 3] == 0.0
    assert legs[0, 2] == pytest.approx(1.0)
    # round the nearest edge at the clearance, at 2.0 + 0.3 from the middle
    shortest = 2.0 * math.hypot(0.6, 2.3) + 0.8
    assert 0.9 * shortest <= legs[0, 1] <= 1.15 * shortest


def test_legs_are_clear_as_sphere_tracing_says():
    viewer, rng = viewer_of(BALL), np.random.default_rng(5)
    a, b = rng.uniform([-3, -3, -7], [3, 3, -1], (2, 200, 3))
    clear = are_clear(viewer, a, b)
    exact = [viewer.field.grown(0.3).line_of_sight(p, q) for p, q in zip(a, b, strict=True)]
    wrong = clear != np.array(exact)
    assert 0 < clear.sum() < 200
    # samples may miss a graze of the clearance, never the ball
    assert not (np.array(exact) & ~clear).any()
    assert wrong.sum() <= 6
    assert all(viewer.field.line_of_sight(p, q) for p, q in zip(a[clear], b[clear], strict=True))


@given(POINTS, st.integers(1, 4))
def test_each_point_is_paired_with_its_nearest(points, count):
    points = np.unique(np.array(points).round(3), axis=0)
    pairs = set(zip(*(x.tolist() for x in neighbour_pairs(points, count)), strict=True))
    assert all(a < b for a, b in pairs)
    distances = distances_of(points) + np.where(np.eye(len(points)), np.inf, 0.0)
    for k in range(len(points) if len(points) > 1 else 0):
        mine = [distances[k, b if a == k else a] for a, b in pairs if k in (a, b)]
        assert min(mine) == pytest.approx(distances[k].min())


def test_more_viewpoints_keep_off_and_see_what_a_camera_sees():
    viewer = viewer_of(BALL)
    none = Viewpoints(
        np.zeros((0, 3)), np.zeros(0), np.zeros((0, len(viewer.patches.areas)), dtype=bool)
    )
    more = find_more_viewpoints(viewer, none, Clock(), lambda _: None)
    assert 100 < len(more) <= FEW_ROUNDS.max_candidates
    assert viewer.field.distance(more.places).min() >= viewer.clearance
    far = viewer.field.distance(more.places)
    assert {round(float(d), 1) for d in far} == {0.8, 1.2, 1.7, 2.2}
    for k in range(0, len(more), 50):
        look = Coverage(viewer.patches, viewer.field, CAMERA)
        look.look(more.places[k], float(more.headings[k]))
        assert not (more.sees[k] & ~look.seen).any()


def test_a_visit_costs_the_turn_from_the_nearest_patch():
    viewer = viewer_of(BALL)
    chooser = TourChooser(
        viewer, np.zeros(3), 0.4, 0.99, Clock(), 0, lambda _: None, viewer.patches
    )
    places = np.array([[2.0, 0.0, -4.0], [2.0, 0.0, -4.0]])
    arrival, is_known = viewer.arrival_headings(places)
    assert is_known.all()
    assert np.abs(np.abs(arrival) - math.pi).max() < 0.2
    headings = arrival + np.radians([0.0, 65.0])
    found = Viewpoints(places, headings, np.zeros((2, 1), dtype=bool))
    straight, aside = chooser.visit_times(found)
    assert straight == pytest.approx(0.15)
    assert aside - straight == pytest.approx(1.0)
    free = Viewpoints(places, np.full(2, np.nan), np.zeros((2, 1), dtype=bool))
    assert chooser.visit_times(free).tolist() == [0.0, 0.0]


def test_a_turn_is_left_where_another_wall_is_nearest_on_the_way():
    walls = Scene(name="walls", solids=[
        {"box": {"center": [x, 0, -3], "size": [0.2, 6, 20]}} for x in (-2.0, 2.0)
    ])  # fmt: skip
    viewer = viewer_of(walls)
    x = np.array([0.1, 0.5, 1.0])
    places = np.column_stack([x, 0 * x, 0 * x - 3.0])
    arrival, _ = viewer.arrival_headings(places)
    between, aside, far = expected_turns(viewer, places, arrival, 0.4)
    # of 26 directions, nine lead across the middle; the robot turns on for the rest of its way
    assert between > aside > far == 0.0
    assert 0.2 * math.pi < between < 9 / 26 * math.pi
    assert expected_turns(viewer, places, np.full(3, np.nan), 0.4).tolist() == [0.0, 0.0, 0.0]


def test_without_a_heading_only_what_any_heading_shows_counts():
    viewer, rng = viewer_of(BALL), np.random.default_rng(2)
    for place in ([0.0, 0.0, -1.9], [0.2, -0.1, -6.2]):
        seen = viewer.seen_from(np.array(place), math.nan)
        assert seen.sum() > 10
        for heading in rng.uniform(-math.pi, math.pi, 12):
            missed = seen & ~viewer.seen_from(np.array(place), float(heading))
            assert missed.sum() <= 0.03 * seen.sum()
    assert not viewer.seen_from(np.array([2.0, 0.0, -4.0]), math.nan).any()


def test_what_a_passing_robot_counts_is_seen_from_beside_too():
    viewer, rng = viewer_of(BALL), np.random.default_rng(3)
    chooser = TourChooser(
        viewer, np.zeros(3), 0.4, 0.99, Clock(), 0, lambda _: None, viewer.patches
    )
    found = viewer.views(np.array([[0.0, 0.0, -2.0]]), np.array([np.nan]))
    counted = chooser.seen_in_flight(found)[0]
    assert 10 < counted.sum() < found.sees[0].sum()
    for _ in range(20):
        aside = rng.normal(size=3)
        aside *= viewer.policy.passing_distance / np.linalg.norm(aside)
        heading = float(rng.uniform(-math.pi, math.pi))
        missed = counted & ~viewer.seen_from(found.places[0] + aside, heading)
        assert missed.sum() <= 0.05 * counted.sum()


def test_legs_that_stay_in_their_class_have_an_empty_word():
    torus = {"center": [0, 0, 0], "axis": [0, 0, 1], "major_radius": 2.0, "minor_radius": 0.3}
    scene, anchor = Scene(solids=[{"torus": torus}]), np.array([3.5, 0.0, 2.0])
    grid = Grid(scene.field(), [-4] * 3, [4] * 3, 0.25, 0.3)
    classes, rng = TetherClasses.on_grid(grid, anchor), np.random.default_rng(4)
    a, b = rng.uniform(-3.9, 3.9, (2, 300, 3))
    is_free = grid.field.grown(0.3).line_of_sight
    legs = [(p, q) for p, q in zip(a, b, strict=True) if is_free(p, q)]
    stays = classes.stay(*(np.array(ends) for ends in zip(*legs, strict=True)))
    is_empty = np.array([classes.water.word(np.array(leg)) == () for leg in legs])
    assert not (stays & ~is_empty).any()
    # a leg may leave its class and come back to it
    assert (is_empty & ~stays).sum() <= 0.05 * len(legs)
    assert 10 < stays.sum() < len(legs) - 5
    viewer = viewer_of(scene)
    # the shortest tethers to these ends lead through the ring and past it
    ends = np.array([[0.0, 0.0, -1.0], [3.2, 0.0, -1.0]])
    straight, around = (
        estimate_distances(viewer, ends, classes=known)[0, 1] for known in (None, classes)
    )
    assert straight == pytest.approx(3.2)
    assert around > 4.0


def test_rounds_are_the_same_interpreted_and_compiled():
    problem, policy = problem_of(5, 25, 60), TourSearchPolicy()
    settings_ = RoundSettings(*(getattr(policy, name) for name in RoundSettings._fields))
    results = []
    for run in (interpreted(search_rounds), search_rounds):
        tour, state = np.arange(26), np.array([77], dtype=np.uint64)
        current, best, idle = run(problem.arrays(), settings_, tour, tour, (0, 30), state)
        results.append((current.tolist(), best.tolist(), int(idle), int(state[0])))
    assert results[0] == results[1]
    assert problem.cost(np.array(results[0][1])) < problem.cost(np.arange(26))


@pytest.mark.parametrize("seed", range(6))
def test_the_shortest_order_is_that_of_all_orders(seed):
    distances = distances_of(np.random.default_rng(seed).uniform(0, 9, (8, 2)))
    places = np.array([1, 3, 4, 5, 6, 7])
    tour = shortest_order(distances, places, np.random.default_rng(seed), Clock())
    assert tour[0] == 0
    assert sorted(tour[1:]) == places.tolist()
    shortest = min(
        tour_length(distances, np.array([0, *order])) for order in itertools.permutations(places)
    )
    assert tour_length(distances, tour) == pytest.approx(shortest)


def test_together_is_faster_than_the_fewest_and_sees_the_share():
    how = {"anchor": (-3.0, -3.0, -0.5), "camera": CAMERA, "standoff": 1.2, "policy": FEW_ROUNDS}
    fewest = cover(BALL, objective="viewpoints", **how)
    told = []
    together = cover(BALL, time_limit=None, on_progress=told.append, **how)
    assert together.objective == "time"
    assert together.tour_s <= 0.9 * fewest.tour_s
    assert together.seen >= 0.99 * together.visible - 1e-9
    assert any("m with" in line for line in told)
    look = Coverage(together.patches, BALL.field(), CAMERA)
    for waypoint in together.mission.waypoints:
        # without a heading, any heading shows enough
        look.look(np.array(waypoint.position), math.radians(waypoint.heading or 0.0))
    assert look.share >= 0.985 * together.visible
    places = np.vstack([together.mission.start, together.mission.places])
    straight = np.linalg.norm(places - np.roll(places, -1, axis=0), axis=1).sum()
    assert straight <= together.tour_length + 1e-3 * len(places)
    again = cover(BALL, time_limit=None, **how)
    assert again.mission == together.mission
    policy = replace(FEW_ROUNDS, max_views=1)
    coarse = cover(BALL, time_limit=None, **{**how, "policy": policy})
    assert coarse.seen >= 0.99 * coarse.visible - 1e-9
    assert coarse.tour_s <= 0.9 * fewest.tour_s


@pytest.mark.parametrize(
    ("policy", "field"),
    [
        (lambda: TourSearchPolicy(max_rounds=0), "max_rounds"),
        (lambda: TourSearchPolicy(run_share=1.5), "run_share"),
        (lambda: CoverPolicy(standoff_ratios=(0.0,)), "standoff_ratios"),
        (lambda: CoverPolicy(heading_offsets_deg=()), "heading_offsets_deg"),
        (lambda: CoverPolicy(more_time_share=2.0), "more_time_share"),
    ],
)
def test_policies_name_the_field_that_is_wrong(policy, field):
    with pytest.raises(InputError, match=field):
        policy()


def test_the_nearest_neighbour_is_next():
    distances = distances_of([(0, 0), (5, 0), (1, 0), (3, 0)])
    assert nearest_neighbour_tour(distances, np.array([1, 2, 3])).tolist() == [0, 2, 3, 1]
