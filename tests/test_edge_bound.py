"""Bounds by edges of polytopes: sharp around simple solids, and above no path."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.errors import InputError
from netsp.plan.space.edge_bound import edge_bound
from netsp.plan.space.edge_paths import Pieces, is_blocked, link_cost
from netsp.plan.space.inscribed_polytopes import inscribed_polytopes
from netsp.plan.space.mission_policy import EdgePolicy
from netsp.plan.space.potential import Ends, Region
from netsp.world import Scene

BOX = np.array([[-20.0] * 3, [20.0] * 3])
FEW = EdgePolicy(sides=8, max_rounds=40)


def bound_of(solids, a, b, longest, room=0.0, policy=EdgePolicy()):
    field = Scene(solids=solids).field()
    shapes = inscribed_polytopes(field, room, BOX, policy)
    region = Region(room, BOX, np.zeros(3), 60.0)
    return edge_bound(shapes, Ends(np.array(a), np.array(b), longest), region, policy)


def around_a_circle(far: float, radius: float) -> float:
    """Length of the shortest way between two points on opposite sides of a circle."""
    turn = math.pi - 2.0 * math.acos(radius / far)
    return 2.0 * math.sqrt(far**2 - radius**2) + radius * turn


@pytest.mark.parametrize("room", [0.0, 0.3])
def test_around_the_rim_of_a_wall(room):
    wall = {"box": {"center": [0, 0, 0], "size": [0.4, 8, 30]}}
    reach = math.hypot(2.8, 4.0)
    arc = room * (0.5 * math.pi + math.atan2(4.0, 2.8) - math.acos(room / reach))
    exact = 2.0 * (math.sqrt(reach**2 - room**2) + arc) + 0.4
    found = bound_of([wall], (-3.0, 0, 0), (3.0, 0, 0), 20.0, room)
    assert 0.997 * exact <= found.length <= exact
    assert found.is_final


@pytest.mark.parametrize("kind", ["capsule", "cylinder", "post"])
def test_around_a_round_bar(kind):
    ends = {"a": [0, 0, -15], "b": [0, 0, 15], "radius": 1.0}
    solid = {"post": {"center": [0, 0], "radius": 1.0}} if kind == "post" else {kind: ends}
    exact = around_a_circle(3.0, 1.2)
    found = bound_of([solid], (-3.0, 0, 0), (3.0, 0, 0), 9.0, 0.2)
    assert 0.99 * exact <= found.length <= exact


def test_over_a_bar_on_a_slant_path():
    bar = {"capsule": {"a": [0, 0, -15], "b": [0, 0, 15], "radius": 0.8}}
    flat, rise = around_a_circle(3.0, 1.0), 4.0
    found = bound_of([bar], (-3.0, 0, -2.0), (3.0, 0, 2.0), 9.5, 0.2)
    exact = math.hypot(flat, rise)  # a helix, unrolled
    assert 0.99 * exact <= found.length <= exact


def test_no_way_around_within_the_box():
    wall = {"box": {"center": [0, 0, 0], "size": [0.4, 50, 50]}}
    assert bound_of([wall], (-3.0, 0, 0), (3.0, 0, 0), 12.0).length == pytest.approx(12.0)


@pytest.mark.parametrize("turn", np.linspace(0.0, 0.35, 6))
def test_a_path_across_the_tube_of_a_ring_goes_around_it(turn):
    """No path slips through where two pieces of the ring meet."""
    ring = {"center": [0, 0, 0], "axis": [0, 0, 1], "major_radius": 3, "minor_radius": 0.5}
    ends = [(3.0 * math.cos(turn), 3.0 * math.sin(turn), z) for z in (-1.5, 1.5)]
    found = bound_of([{"torus": ring}], *ends, 5.0, 0.2)
    exact = around_a_circle(1.5, 0.7)
    assert 0.97 * exact <= found.length <= exact


def test_far_polytopes_are_left_out_first():
    bars = [{"capsule": {"a": [x, 0, -9], "b": [x, 0, 9], "radius": 0.5}} for x in (0.0, 8.0)]
    policy = EdgePolicy(max_edges=130)
    shapes = inscribed_polytopes(Scene(solids=bars).field(), 0.0, BOX, policy)
    near = shapes.nearest(np.array([-2.0, 0, 0]), np.array([2.0, 0, 0]), policy.max_edges)
    assert len(near.radii) == 1
    assert near.centres[0] == pytest.approx([0.0, 0.0, 0.0])
    around = bound_of(bars, (-2.0, 0, 0), (2.0, 0, 0), 6.0, policy=policy)
    exact = around_a_circle(2.0, 0.5)
    assert 0.985 * exact <= around.length <= exact
    assert not around.is_final


@pytest.mark.parametrize(("name", "value"), [("sides", 6), ("tolerance", 0.0), ("max_edges", 0)])
def test_a_policy_out_of_range_is_refused(name, value):
    with pytest.raises(InputError, match=name):
        EdgePolicy(**{name: value})


coordinates = st.floats(-3.0, 3.0)
places = st.tuples(coordinates, coordinates, coordinates)
sizes = st.floats(0.2, 3.0)
boxes = st.builds(
    lambda c, s, r: {"box": {"center": list(c), "size": list(s), "rotation": list(r)}},
    places,
    st.tuples(sizes, sizes, sizes),
    st.tuples(*[st.floats(-180.0, 180.0)] * 3),
)
bars = st.builds(
    lambda a, b, radius: {"capsule": {"a": list(a), "b": list(b), "radius": radius}},
    places,
    places,
    st.floats(0.05, 0.8),
)
rods = st.builds(
    lambda a, b, radius: {"cylinder": {"a": list(a), "b": list(b), "radius": radius}},
    places,
    places.map(lambda p: (p[0], p[1], p[2] + 7.0)),
    st.floats(0.05, 0.8),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.one_of(boxes, bars, rods), min_size=1, max_size=3), places, places)
def test_between_two_samples_a_path_is_as_far_from_solids_as_pythagoras_says(solids, middle, to):
    """Check segments of up to 4 cm."""
    field = Scene(solids=solids).field()
    half = 0.02 * np.array(to) / max(1.0, float(np.linalg.norm(to)))
    line = np.array(middle) + np.linspace(-1.0, 1.0, 41)[:, None] * half
    distances = field.distance(line)
    sampled = float(distances[[0, -1]].min())
    if sampled > 0.02:
        assert distances.min() >= math.sqrt(sampled**2 - 0.02**2) - 1e-9


@settings(max_examples=10, deadline=None)
@given(st.lists(st.one_of(boxes, bars, rods), min_size=1, max_size=3), st.floats(0.0, 0.3),
       st.integers(0, 1000))  # fmt: skip
def test_no_bound_is_above_a_path_that_keeps_the_room(solids, room, seed):
    """Paths with one or two corners among random points, sampled at half a centimetre."""
    field, rng = Scene(solids=solids).field(), np.random.default_rng(seed)
    points = rng.uniform(-5.0, 5.0, (60, 3))
    points = points[field.distance(points) >= room]
    if len(points) < 2:
        return

    def is_free(p, q):
        count = 2 + int(np.linalg.norm(q - p) / 5e-3)
        line = p + np.linspace(0.0, 1.0, count)[:, None] * (q - p)
        return field.distance(line).min() >= room

    a, b = points[0], points[1]
    ways = [(c,) for c in points[2:]] + list(itertools.permutations(points[2:14], 2))
    lines = [np.vstack([a, *way, b]) for way in ways]
    lines.sort(key=lambda line: np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    for line in lines[:40]:
        if all(is_free(p, q) for p, q in itertools.pairwise(line)):
            length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
            found = bound_of(solids, a, b, 1.5 * length, room, FEW)
            assert found.length <= length * (1.0 + 1e-9)
            return


@settings(max_examples=30, deadline=None)
@given(st.lists(places, min_size=4, max_size=4), st.floats(-0.99, 0.99), st.floats(-0.99, 0.99),
       st.floats(0, 1), st.floats(0, 1))  # fmt: skip
def test_a_link_costs_no_more_than_any_way_between_its_pieces(ends, slope, other, s, t):
    a, b, c, d = (np.array(p) for p in ends)
    pieces = Pieces(
        np.array([a, c]), np.array([b, d]), np.array([5, 6]), np.array([slope, other]),
        np.zeros(2),
    )  # fmt: skip
    p, q = a + s * (b - a), c + t * (d - c)
    of_ends = (s - 0.5) * slope * np.linalg.norm(b - a) - (t - 0.5) * other * np.linalg.norm(d - c)
    # a cost that would be negative is cut off: slopes are limited where pieces are close
    assert link_cost(pieces, 0, 1) <= max(0.0, np.linalg.norm(q - p) + of_ends) + 1e-9


@settings(max_examples=30, deadline=None)
@given(boxes, st.lists(places, min_size=4, max_size=4), st.integers(0, 1000))
def test_what_is_blocked_is_blocked_for_all_points(box, ends, seed):
    field = Scene(solids=[box]).field()
    shapes = inscribed_polytopes(field, 0.1, BOX, FEW)
    a, b, c, d = (2.0 * np.array(p) for p in ends)
    if is_blocked(shapes, a, a + 0.1 * (b - a), c, c + 0.1 * (d - c)):
        rng = np.random.default_rng(seed)
        for s, t in rng.uniform(0.0, 0.1, (5, 2)):
            p, q = a + s * (b - a), c + t * (d - c)
            line = p + np.linspace(0.0, 1.0, 2001)[:, None] * (q - p)
            assert field.distance(line).min() < 0.1


def test_polytopes_lie_inside_of_grown_solids():
    rng = np.random.default_rng(3)
    solids = [
        {"box": {"center": [0, 0, 0], "size": [2, 3, 4], "rotation": [10, 20, 30]}},
        {"capsule": {"a": [4, 0, 0], "b": [5, 3, 1], "radius": 0.4}},
        {"cylinder": {"a": [-4, 0, 0], "b": [-5, 3, 1], "radius": 0.7}},
        {"torus": {"center": [0, 9, 0], "axis": [1, 2, 3], "major_radius": 2, "minor_radius": 0.4}},
        {"torus": {"center": [0, 9, 0], "axis": [0, 0, 1], "major_radius": 1, "minor_radius": 0.9}},
        {
            "torus": {
                "center": [0, -9, 0],
                "axis": [0, 2, 0],
                "start": [1, 0, 1],
                "major_radius": 3,
                "minor_radius": 0.2,
                "angle": 200,
            }
        },
        {"post": {"center": [9, 9], "radius": 0.6}},
        {"prism": {"polygon": [[-9, -9], [-7, -9], [-8, -7]]}},
    ]
    for solid, room in itertools.product(solids, (-0.1, 0.0, 0.25)):
        field = Scene(solids=[solid]).field()
        shapes = inscribed_polytopes(field, room, BOX, EdgePolicy())
        assert len(shapes.radii) >= (solid.keys() != {"prism"} or room >= 0.0)
        for n in range(len(shapes.radii)):
            faces = slice(*shapes.first[n : n + 2])
            points = shapes.centres[n] + rng.uniform(-1, 1, (400, 3)) * shapes.radii[n]
            heights = points @ shapes.normals[faces].T - shapes.offsets[faces]
            inside = points[heights.max(axis=1) < 0.0]
            assert (field.distance(inside) <= room + 1e-6).all()
        on_edges = np.vstack([shapes.begins, shapes.ends, 0.5 * (shapes.begins + shapes.ends)])
        assert (field.distance(on_edges) <= room + 1e-6).all()
