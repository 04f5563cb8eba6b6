"""Soundness of `netsp_check`: laws against brute force, exact legs, enumeration of tours, hand-made
triangulations, mutated proofs and forgeries."""

import ast
import itertools
import json
import math
import random
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import netsp_check
from netsp import Circle, Polygon, Problem, solve
from netsp.base.errors import InfeasibleError, NetspError
from netsp.model.solution import Status
from netsp.plan.proof.certify import CertifyPolicy, certify
from netsp.plan.proof.cover_instance import CoverInstance
from netsp.plan.proof.triangulate import triangulate
from netsp.plan.random_worlds import random_world
from netsp.plan.solve_problem import travel_graph
from netsp_check import Refused, check
from netsp_check.dual_bound import Bound, Stage, _allowed, is_out_of_order, read_cut
from netsp_check.leg_bounds import LegBounds
from netsp_check.problem_file import read_problem
from netsp_check.proof_check import cover
from tests.brute import brute_tour
from tests.proof_attacks import FORGERIES, MUTATIONS, attack, honest

FAMILIES = ("icra2017", "rss2016", "clustered", "array", "harbour")


@st.composite
def tiny_worlds(draw, max_goals=5):
    """Worlds of one to five circles and rectangles, and two to five goals; a third of them have a
    clearance, a third bounds, and a third heights."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    obstacles = []
    for _ in range(draw(st.integers(1, 5))):
        x, y = rng.uniform(-6, 6, 2).round(3).tolist()
        if rng.random() < 0.5:
            obstacles.append(Circle(center=(x, y), radius=round(rng.uniform(0.3, 2.0), 3)))
        else:
            a, b = rng.uniform(0.2, 2.0, 2).round(3).tolist()
            corners = [(x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b)]
            obstacles.append(Polygon(polygon=corners))
    clearance = draw(st.sampled_from([0.0, 0.0, 0.17]))
    bounds = draw(st.sampled_from([None, None, (-7.5, -7.5, 7.5, 7.5)]))
    has_heights = draw(st.sampled_from([False, False, True]))
    places = []
    while len(places) < 1 + draw(st.integers(2, max_goals)):
        x, y = rng.uniform(-6, 6, 2).round(3).tolist()
        if all(float(o.signed_distance((x, y))) > clearance + 0.01 for o in obstacles):
            places.append((x, y, round(rng.uniform(-3, 0), 2) if has_heights else 0.0))
        elif rng.random() < 0.02:
            assume(False)
    try:
        return Problem(
            base=places[0], goals=places[1:], obstacles=obstacles, clearance=clearance,
            bounds=bounds, tether_length=draw(st.sampled_from([9.0, 12.0, 15.0])),
        )  # fmt: skip
    except NetspError:
        assume(False)


# proofs and optima


@settings(max_examples=20, deadline=None, derandomize=True)
@given(problem=tiny_worlds())
def test_an_optimum_is_certified_and_nothing_above_it(problem):
    """The optimum is proven up to 1e-6, and no more than the brute force over the exact travel
    graph allows, even if the solution claims a longer tour."""
    try:
        solution = solve(problem)
    except InfeasibleError:
        return
    certificate = certify(problem, solution)
    assert solution.status is Status.OPTIMAL
    optimum = brute_tour(travel_graph(problem))
    assert solution.length == pytest.approx(optimum, rel=1e-9)
    assert certificate.level == "optimal", certificate.reason
    assert optimum * (1.0 - 1e-6) <= certificate.bound <= optimum
    for share in (1e-5, 1.0):
        longer = solution.model_copy(update={"length": solution.length * (1.0 + share)})
        raised = certify(problem, longer, policy=CertifyPolicy(corners=(48,)))
        assert raised.level != "optimal"
        assert raised.bound is None or raised.bound <= optimum


# classes and legs


def covered(problem, corners=48):
    """Return the cover of a problem within its tether, the exact travel graph, and the checker's
    vertices with the rows of the graph that have their words."""
    text = problem.to_json()
    exact = read_problem(text)
    tree = cover(text, {"target": None, **triangulate(exact, corners).to_fields()})
    try:
        graph = travel_graph(problem)
    except InfeasibleError:
        assume(False)
    bound = Bound(tree, LegBounds(tree), None)
    instance = CoverInstance(problem, graph, bound, range(len(tree.vertices)))
    return instance, graph, 2.0**-exact.grid


@settings(max_examples=40, deadline=None, derandomize=True)
@given(problem=tiny_worlds())
def test_the_cover_holds_all_classes_of_the_travel_graph(problem):
    """Each class of each goal within the tether is a vertex of the cover, once."""
    instance, graph, _ = covered(problem)
    found = instance.at[instance.at >= 0].tolist()
    assert sorted(found) == list(range(len(graph.signatures)))


@settings(max_examples=20, deadline=None, derandomize=True)
@given(problem=tiny_worlds())
def test_bounds_on_legs_are_below_the_exact_legs_and_rise_with_effort(problem):
    """For each leg: effort 0 <= effort 1 <= effort 2 <= exact length."""
    instance, graph, unit = covered(problem)
    check_legs(instance, graph, unit)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("seed", range(2))
def test_bounds_on_legs_are_nearly_exact(family, seed):
    """In worlds of obstacles that are not merged, the bound of effort 2 is the exact length of
    legs up to 1e-6."""
    problem = random_world(seed, family=family, goals=4, obstacles=6, tether_length=300.0)
    instance, graph, unit = covered(problem, corners=128)
    assert check_legs(instance, graph, unit) < 1e-6


MAX_LEGS = 40
"""Legs of one world that are compared; of more, some are left out."""


def check_legs(instance, graph, unit):
    """Check the bounds of all legs, and return the largest share by which effort 2 is below."""
    worst = 0.0
    rows, legs = np.flatnonzero(instance.at >= 0).tolist(), LegBounds(instance.tree)
    pairs = [
        (i, j)
        for i, j in itertools.combinations(rows, 2)
        if instance.cluster[i] != instance.cluster[j]
    ]
    for i, j in pairs[:: 1 + len(pairs) // MAX_LEGS]:
        exact = float(graph.costs[instance.at[i], instance.at[j]])
        u, v = int(instance.vertices[i]), int(instance.vertices[j])
        bounds = [legs.bound(u, v, effort) * unit for effort in (0, 1, 2)]
        assert bounds == sorted(bounds)
        assert bounds[2] <= exact * (1.0 + 1e-12)
        worst = max(worst, 1.0 - bounds[2] / exact)
    return worst


# triangulations


U = 1 << 32
"""Grid units of a unit of length in the hand-made triangulations."""

ROOM = [-4, -4, 12, 4]
"""Box of the hand-made triangulations."""


def post_problem(**more):
    """Return the text of a problem with a square pier between base and goals."""
    pier = {"polygon": [[4, -2], [6, -2], [6, 2], [4, 2]]}
    problem = {"base": [0, 0], "goals": [[10, 0], [10, 1]], "obstacles": [pier], **more}
    return json.dumps({"schema_version": 1, "tether_length": 30, **problem})


def ring(inner=(4.01, -1.99, 5.99, 1.99), outer=ROOM):
    """Return the eight triangles between a rectangle and a box around it, as coordinates."""
    x0, y0, x1, y1 = inner
    u0, v0, u1, v1 = outer
    i = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    o = [(u0, v0), (u1, v0), (u1, v1), (u0, v1)]
    out = []
    for k in range(4):
        n = (k + 1) % 4
        out += [(o[k], o[n], i[n]), (o[k], i[n], i[k])]
    return out


def proof_of(triangles, box=ROOM):
    """Return the fields of a proof that say where the triangles are."""
    index = {}
    corners = [index.setdefault(p, len(index)) for t in triangles for p in t]
    points = [round(c * U) for p in index for c in p]
    fields = {"target": None, "points": points, "triangles": corners}
    return fields if box is None else {**fields, "box": [v * U for v in box]}


def test_a_ring_of_triangles_about_a_pier_is_accepted():
    """Triangles from the box to inside the pier are a cover of the free space."""
    tree = cover(post_problem(), proof_of(ring()))
    assert {v.place for v in tree.vertices} == {0, 1, 2}


def refused(message, triangles, box=ROOM, **more):
    with pytest.raises(Refused, match=message):
        cover(post_problem(**more), proof_of(triangles, box))


def test_a_clockwise_triangle_is_refused():
    """Corners in clockwise order are refused, wherever the triangle is."""
    for k in range(8):
        triangles = ring()
        triangles[k] = triangles[k][::-1]
        refused("counter-clockwise", triangles)


def test_a_hole_over_free_space_is_refused():
    """A missing triangle leaves edges in free space, which are refused."""
    for k in range(8):
        refused("not in an obstacle|no triangle holds it", ring()[:k] + ring()[k + 1 :])


def test_triangles_on_the_same_side_of_an_edge_are_refused():
    """Two triangles on the left of an edge are refused."""
    a, b, c = ring()[0]
    refused("is on the left of edge", [*ring(), (a, b, (c[0] + 0.5, c[1]))])
    refused("is on the left of edge", [*ring(), ring()[3]])


def test_a_second_sheet_over_a_place_cuts_no_place_off():
    """Triangles that overlap are refused, or a place counts in each of them."""
    first, second = ring(), ring((4.02, -1.98, 5.98, 1.98), (-4.5, -4.5, 12.5, 4.5))
    for triangles in (first + second, second + first, [*first[-2:], *second, *first[:-2]]):
        try:
            tree = cover(post_problem(), proof_of(triangles))
        except Refused:
            continue
        assert {v.place for v in tree.vertices} == {0, 1, 2}


def test_a_corner_that_triangles_surround_is_refused():
    """A corner in the free space with triangles all around is refused."""
    triangles = ring()
    a, b, c = triangles.pop(7)
    middle = (sum(p[0] for p in (a, b, c)) / 3, sum(p[1] for p in (a, b, c)) / 3)
    triangles += [(a, b, middle), (b, c, middle), (c, a, middle)]
    refused("surround", triangles)


def test_an_edge_through_free_water_is_refused():
    """A border edge beyond the pier's outline is refused, even if it is a millionth beyond."""
    cover(post_problem(), proof_of(ring((4 + 1e-9, -2 + 1e-9, 6 - 1e-9, 2 - 1e-9))))
    for inner in ((3.999999, -1, 5, 1), (4.5, -1, 6.000001, 1), (4, -2, 6, 2)):
        refused("not in an obstacle", ring(inner))


def test_a_border_on_the_edge_of_a_polygon_is_refused_unless_it_is_grown():
    """A border edge on the outline of a polygon is refused, for tethers may lie there."""
    refused("not in an obstacle", ring((4, -1, 5, 1)))
    cover(post_problem(clearance=0.125), proof_of(ring((4, -2, 6, 2))))
    cover(post_problem(clearance=0.125), proof_of(ring((3.9, -2, 6, 2))))
    refused("not in an obstacle", ring((3.87, -2, 6, 2)), clearance=0.125)


def test_a_box_that_leaves_a_place_out_is_refused():
    """The box holds the base and all goals."""
    for box in ([1, -4, 12, 4], [-4, -4, 9, 4], [-4, -4, 12, 0]):
        refused("does not hold the base and all goals", ring(), box)


def test_a_box_beyond_the_bounds_is_refused():
    """The box is within the bounds, and there is one where there are no bounds."""
    cover(post_problem(bounds=[-4, -4, 12, 4]), proof_of(ring(), None))
    cover(post_problem(bounds=[-4, -4, 12, 4]), proof_of(ring()))
    refused("beyond the bounds", ring(), bounds=[-3, -4, 12, 4])
    refused("expected one", ring(), None)


def test_an_obstacle_that_the_box_touches_bounds_nothing():
    """An obstacle that touches the box may bound no triangle: paths outside the box pass it."""
    inner = (4.01, -0.5, 5.99, 0.5)
    for box in ([-4, -2, 12, 4], [-4, -2, 12, 2], [-4, -1, 12, 4]):
        refused("not in an obstacle", ring(inner, box), box)


# cuts and duals


def cluster_lists(draw, max_clusters=5, max_classes=3):
    """Return a cluster for each vertex; the base is alone in the first one."""
    sizes = draw(st.lists(st.integers(1, max_classes), min_size=2, max_size=max_clusters - 1))
    return [0, *(c for c, size in enumerate(sizes, 1) for _ in range(size))]


def tours(cluster):
    """Yield the legs of all tours that visit one vertex of each cluster."""
    members = [[v for v, c in enumerate(cluster) if c == k] for k in range(max(cluster) + 1)]
    for order in itertools.permutations(range(1, len(members))):
        if order[0] < order[-1] or len(order) == 1:
            for chosen in itertools.product(*(members[c] for c in order)):
                stops = [0, *chosen, 0]
                yield [tuple(sorted(leg)) for leg in itertools.pairwise(stops)]


@st.composite
def cuts_over(draw, cluster):
    """Draw a cut that `read_cut` may accept, of any kind."""
    clusters, size = max(cluster) + 1, len(cluster)
    kind = draw(st.sampled_from(["subtour", "parity", "comb"]))
    inside = draw(st.integers(0, (1 << size) - 1))
    if kind == "subtour":
        return [kind, f"{inside & ~1:x}", draw(st.integers(0, clusters))]
    if kind == "parity":
        pairs = list(itertools.combinations(range(clusters + 1), 2))
        teeth = draw(st.lists(st.sampled_from(pairs), min_size=1, max_size=5, unique=True))
        return [kind, f"{inside:x}", [list(p) for p in teeth]]
    handle = draw(st.sets(st.integers(0, clusters - 1), min_size=1))
    inside = sum(1 << v for v, c in enumerate(cluster) if c in handle)
    named = draw(st.permutations(range(clusters + 3)))  # the last three are no clusters
    ends = sorted(draw(st.lists(st.integers(1, len(named)), min_size=3, max_size=3)))
    teeth = [list(named[a:b]) for a, b in itertools.pairwise([0, *ends])]
    return [kind, f"{inside:x}", teeth]


def coefficients(cut, cluster):
    """Return the share of each leg in a cut, as stages count it, and the right-hand side."""
    stage = Stage({"a": [0] * (max(cluster) + 1), "cuts": [[0, 1]]}, [cut], cluster, set())

    def share(u, v):
        return -stage.reduced(u, v, 0, tuple(sorted((cluster[u], cluster[v]))))

    return share, stage.constant


@settings(max_examples=400, deadline=None, derandomize=True)
@given(data=st.data())
def test_every_cut_that_is_read_holds_for_every_tour(data):
    """The legs of each tour add up to at least the right-hand side."""
    cluster = cluster_lists(data.draw)
    try:
        cut = read_cut(data.draw(cuts_over(cluster)), cluster)
    except Refused:
        return
    share, constant = coefficients(cut, cluster)
    for tour in tours(cluster):
        assert sum(share(u, v) for u, v in tour) >= constant


def test_every_comb_of_six_clusters_holds_for_every_tour():
    """All handles with three pairs as teeth; some tour is tight, so no larger side holds."""
    cluster = list(range(6))
    every, slack = list(tours(cluster)), []
    for handle in itertools.chain(*(itertools.combinations(cluster, n) for n in (3, 4, 5))):
        inside = set(handle)
        for ends in itertools.permutations(cluster):
            teeth = [ends[:2], ends[2:4], ends[4:]]
            is_first = all(t[0] < t[1] for t in teeth) and teeth == sorted(teeth)
            if not is_first or any(set(t) <= inside or not set(t) & inside for t in teeth):
                continue
            cut = read_cut(["comb", f"{sum(1 << c for c in inside):x}", teeth], cluster)
            share, constant = coefficients(cut, cluster)
            slack += [sum(share(u, v) for u, v in tour) - constant for tour in every]
    assert min(slack) == 0


def test_every_kind_of_cut_cuts_something_off():
    """Each kind of cut is violated by some set of legs with two legs at each cluster."""
    cluster = [0, 1, 2, 3, 4, 5]
    triangles = [(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5)]
    # halves: two triangles of half legs that are joined by three whole legs
    halves = dict.fromkeys(triangles, 0.5) | {(0, 3): 1.0, (1, 4): 1.0, (2, 5): 1.0}
    whole = dict.fromkeys(triangles, 1.0)
    teeth = [[0, 3], [1, 4], [2, 5]]
    for cut, legs in ((["subtour", "38", 3], whole), (["parity", "7", teeth], halves),
                      (["comb", "7", teeth], halves)):  # fmt: skip
        share, constant = coefficients(read_cut(cut, cluster), cluster)
        assert sum(share(u, v) * y for (u, v), y in legs.items()) < constant


@pytest.mark.parametrize(
    ("cut", "message"),
    [
        (["subtour", "3", 1], "without the base"), (["subtour", "40", 1], "set of vertices"),
        (["subtour", "-2", 1], "set of vertices"), (["parity", "6", [[1, 2], [2, 3]]], "odd"),
        (["parity", "6", [[1, 2], [2, 1], [2, 3]]], "distinct"),
        (["parity", "6", [[1, 1]]], "distinct"),
        (["comb", "2", [[0, 1], [2, 3], [1, 4]]], "whole clusters"),
        (["comb", "c", [[2, 3], [2, 4], [0, 1]]], "disjoint"),
        (["comb", "6", [[1, 3], [2, 4]]], "odd"), (["comb", "6", [[1, 3]]], "three"),
        (["comb", "6", [[1, 2], [0, 3], [4, 5]]], "partly"), (["blossom", "6", [[1, 3]]], "comb"),
    ],
)  # fmt: skip
def test_a_cut_without_the_conditions_of_its_lemma_is_refused(cut, message):
    """Sets with the base, even numbers of teeth, teeth that meet or miss the handle are refused."""
    with pytest.raises(Refused, match=message):
        read_cut(cut, [0, 1, 1, 2, 3, 4] if cut[1] == "2" else [0, 1, 2, 3, 4, 5])


def bound_over(cluster, costs, target):
    """Return a check of duals over given costs, whose vertices are all in one triangle."""
    problem = SimpleNamespace(cluster=sorted(set(cluster)), tether=10**9, before=frozenset())
    vertices = [
        SimpleNamespace(place=c, node=0, tether=float(costs[0][v])) for v, c in enumerate(cluster)
    ]
    node = SimpleNamespace(parent=-1, farthest=0.0)
    tree = SimpleNamespace(
        triangulation=SimpleNamespace(problem=problem), vertices=vertices, nodes=[node], end=[1]
    )
    # little effort gives low bounds
    legs = SimpleNamespace(bound=lambda u, v, effort: costs[u][v] * (effort + 6) // 8)
    return Bound(tree, legs, target)


def instance_of(data):
    """Draw clusters, costs, the lengths of all tours, and the table and the duals of a stage."""
    cluster = cluster_lists(data.draw, max_clusters=5, max_classes=2)
    rng = random.Random(data.draw(st.integers(0, 10**6)))
    at = [complex(rng.randint(0, 100), rng.randint(0, 100)) for _ in cluster]
    costs = [[math.ceil(abs(a - b)) for b in at] for a in at]
    lengths = [(sum(costs[u][v] for u, v in t), t) for t in tours(cluster)]
    cuts = []
    for cut in data.draw(st.lists(cuts_over(cluster), max_size=4)):
        try:
            read_cut(cut, cluster)
        except Refused:
            continue
        cuts.append(cut)
    return cluster, costs, lengths, cuts, rng


def random_stage(rng, clusters, cuts, pairs=()):
    stage = {
        "a": [rng.randint(-5, 50) for _ in range(clusters)],
        "cuts": [[k, rng.choice([0, 1, 5, 30])] for k in range(len(cuts))],
        "reach": rng.choice([0, 20, 60, 200]),
    }
    return {**stage, "p": [[*pair, rng.randint(-40, 80)] for pair in pairs]}


@settings(max_examples=300, deadline=None, derandomize=True)
@given(data=st.data())
def test_no_tour_below_the_target_uses_what_a_stage_strikes_out(data):
    """For any duals: legs and vertices of tours shorter than the target are left."""
    cluster, costs, lengths, cuts, rng = instance_of(data)
    target = min(lengths)[0] + rng.randint(-20, 40)
    bound = bound_over(cluster, costs, target)
    read = [read_cut(c, cluster) for c in cuts]
    alive, legs, adjacent = set(range(len(cluster))), None, set()
    for _ in range(2):
        stage = Stage(random_stage(rng, bound.clusters, cuts, adjacent), read, cluster, adjacent)
        try:
            alive, legs = bound._strike_out(stage, alive, legs)
        except Refused:
            return
        for length, tour in lengths:
            has_pair = all(
                sum(tuple(sorted((cluster[u], cluster[v]))) == p for u, v in tour) for p in adjacent
            )
            if length < target and has_pair:
                assert {w for leg in tour for w in leg} <= alive
                assert set(tour) <= legs
        adjacent = {tuple(sorted(rng.sample(range(bound.clusters), 2)))}


@settings(max_examples=300, deadline=None, derandomize=True)
@given(data=st.data())
def test_no_duals_prove_more_than_the_shortest_tour(data):
    """A branching tree with any duals is accepted for no target above the optimum."""
    cluster, costs, lengths, cuts, rng = instance_of(data)
    optimum, clusters = min(lengths)[0], max(cluster) + 1

    def node(depth, pairs):
        out = {
            "stages": [random_stage(rng, clusters, cuts, pairs) for _ in range(rng.choice([1, 2]))]
        }
        if depth and rng.random() < 0.5:
            pair = sorted(rng.sample(range(clusters), 2))
            return out | {"pair": pair, "apart": node(depth - 1, pairs),
                          "next": node(depth - 1, [*pairs, tuple(pair)])}  # fmt: skip
        if depth:
            vertex = rng.randrange(-1, len(cluster))
            return out | {
                "vertex": vertex,
                "without": node(depth - 1, pairs),
                "at": node(depth - 1, pairs),
            }
        return out

    for target in (optimum + 1, optimum + 10, 3 * optimum + 100):
        with pytest.raises(Refused):
            bound_over(cluster, costs, target).check(node(rng.choice([0, 1, 2]), []), cuts)


SQUARE = [[0, 10, 14, 10], [10, 0, 10, 14], [14, 10, 0, 10], [10, 14, 10, 0]]
"""Costs between the corners of a square, whose shortest tour is 40."""


def test_duals_of_a_tour_that_is_tight_prove_its_length():
    """A stage whose bound is the length of the shortest tour proves that length, and no more."""
    stage = {"stages": [{"a": [5] * 4, "cuts": [], "reach": 20}]}
    bound = bound_over([0, 1, 2, 3], SQUARE, 40)
    bound.check(stage, [])
    assert bound.leaves == 1
    with pytest.raises(Refused, match="a leaf is not closed"):
        bound_over([0, 1, 2, 3], SQUARE, 41).check(stage, [])


def test_a_reach_that_is_too_small_is_refused():
    """A stage is refused if legs beyond its reach, which count as the reach, are not struck out."""
    for reach in (-1, -1000):
        stage = {"stages": [{"a": [5] * 4, "cuts": [], "reach": reach}]}
        with pytest.raises(Refused, match="reach is too small"):
            bound_over([0, 1, 2, 3], SQUARE, 40).check(stage, [])


def test_the_price_of_a_pair_needs_a_pair_that_must_be_adjacent():
    """Prices of other pairs are refused: the bound would count legs that tours lack."""
    stage = {"a": [0] * 4, "cuts": [], "reach": 20, "p": [[0, 2, 1000]]}
    with pytest.raises(Refused, match="prices of adjacent pairs"):
        bound_over([0, 1, 2, 3], SQUARE, 40).check({"stages": [stage]}, [])


# precedences


@settings(max_examples=300, deadline=None, derandomize=True)
@given(data=st.data())
def test_no_order_that_precedences_allow_is_excluded(data):
    """Pairs next to each other in an order that keeps all precedences are allowed, and no subset
    of them is out of order."""
    clusters = data.draw(st.integers(3, 7))
    order = data.draw(st.permutations(range(1, clusters)))
    places = list(itertools.combinations(range(clusters - 1), 2))
    held = data.draw(st.lists(st.sampled_from(places), max_size=5))
    before = {(order[i], order[j]) for i, j in held}
    for h in order:
        before |= {(g, i) for g, a in before if a == h for b, i in before if b == h}
    stops = [0, *order, 0]
    pairs = [tuple(sorted(p)) for p in itertools.pairwise(stops)]
    assert set(pairs) <= _allowed(frozenset(before), clusters)
    some = data.draw(st.sets(st.sampled_from(pairs)))
    assert not is_out_of_order(some, frozenset(before))


def test_orders_that_precedences_exclude_are_noticed():
    """A path from the base that visits a goal before what must come first, in both senses."""
    before = frozenset({(1, 2), (2, 3), (1, 3)})
    assert {(1, 3), (0, 2)}.isdisjoint(_allowed(before, 5))
    assert is_out_of_order({(0, 3), (3, 4), (0, 2)}, before)
    assert is_out_of_order({(2, 4), (3, 4), (1, 3)}, before)
    assert not is_out_of_order({(0, 3), (3, 2)}, before)


# attacks


@pytest.fixture(scope="module")
def proven():
    """Proofs of four worlds."""
    sizes = ((1, 2), (2, 3), (3, 4), (4, 5))
    return [
        honest(random_world(k, family=FAMILIES[k], goals=k + 1, obstacles=n, tether_length=300.0))
        for k, n in sizes
    ]


@pytest.mark.parametrize("number", range(len(MUTATIONS)), ids=lambda k: MUTATIONS[k].__name__)
def test_no_mutated_proof_shows_more_than_the_optimum(proven, number):
    """A mutated proof is refused in one line, or claims no more than the optimum of its problem."""
    for k, some in enumerate(proven):
        found = attack(some, len(MUTATIONS) * (7 + k) + number)
        assert found.kind in ("refused", "true", "void"), f"{found.names}: {found.detail}"


@pytest.mark.parametrize("name", FORGERIES)
def test_forged_proofs_are_refused(name):
    """Proofs of false claims, made with full knowledge of the checker, are refused in one line."""
    text, proof = FORGERIES[name]()
    with pytest.raises(Refused) as caught:
        check(text, proof)
    assert "\n" not in str(caught.value)


# size


def test_the_checker_is_small_and_needs_the_standard_library_only():
    """`netsp_check` has at most 900 lines without blank lines, comments and docstrings, and imports
    nothing but the standard library and itself."""
    count, imported = 0, set()
    for path in Path(netsp_check.__file__).parent.glob("*.py"):
        text = path.read_text()
        tree = ast.parse(text)
        documented = {
            line
            for node in ast.walk(tree)
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            for line in range(node.lineno, (node.end_lineno or 0) + 1)
        }
        lines = enumerate(text.splitlines(), 1)
        count += sum(
            bool(line.strip()) and not line.strip().startswith("#") and k not in documented
            for k, line in lines
        )
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                imported |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported.add((node.module or "").split(".")[0])
    assert 0 < count <= 900
    assert imported <= {"netsp_check", *sys.stdlib_module_names}
