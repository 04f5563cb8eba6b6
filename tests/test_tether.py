"""The taut tether is as long as geometry says, keeps its class, and forgets how it was driven."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import scipy.optimize
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from netsp import InputError, Problem
from netsp.base.geometry import polylines
from netsp.hsignature import signature
from netsp.plan.random_worlds import random_world
from netsp.roadmap.paths import TautPaths
from netsp.world import GeodesicTether, ReactTether, Scene
from netsp.world.scene.field import DistanceField
from netsp.world.scene.voxels import grid_of_triangles


def model(*solids, delta=0.05, kind=GeodesicTether, **more):
    return kind(Scene(solids=solids).field(), delta, **more)


def around(a, b, centre, radius, long_way=False):
    """Length of the taut path about a circle from a to b, both outside."""
    u, v = np.subtract(a, centre), np.subtract(b, centre)
    p, q = np.hypot(*u), np.hypot(*v)
    turn = abs(math.remainder(math.atan2(v[1], v[0]) - math.atan2(u[1], u[0]), 2 * math.pi))
    if long_way:
        turn = 2 * math.pi - turn
    arc = turn - math.acos(radius / p) - math.acos(radius / q)
    return math.sqrt(p * p - radius**2) + math.sqrt(q * q - radius**2) + radius * arc


def random_drive(rng, field, start, steps, step, low, high):
    """A path of free straight steps, that wanders."""
    here, path = np.array(start, dtype=float), []
    heading = rng.normal(size=3) * [1, 1, 0.1]
    while len(path) < steps:
        heading = heading / np.linalg.norm(heading) + 0.5 * rng.normal(size=3) * [1, 1, 0.1]
        there = here + step * rng.uniform(0.2, 1.0) * heading / np.linalg.norm(heading)
        inside = (there >= low).all() and (there <= high).all()
        if inside and field.line_of_sight(here, there) and field.distance(there) > 1e-3:
            here = there
            path.append(here)
        else:
            heading = rng.normal(size=3) * [1, 1, 0.1]
    return np.array(path)


@pytest.mark.parametrize("family", ["icra2017", "harbour"])
@pytest.mark.parametrize("seed", range(3))
def test_among_prisms_length_and_word_are_those_of_the_offline_geometry(family, seed):
    """Length within 0.5 %, class never wrong; 400 updates a world, looked at every 20."""
    problem = random_world(seed, family=family, goals=3, tether_length=300.0)
    field = Scene.from_problem(problem).field()
    tethers = GeodesicTether(field, 2.0)
    rng = np.random.default_rng(seed)
    path = random_drive(rng, field, problem.base, 400, 9.0, [0, 0, -40], [500, 500, 40])
    tether, checks = tethers.start(problem.base, problem.base), []
    for k, point in enumerate(path):
        tether = tethers.update(tether, point)
        if k % 20 == 19:
            checks.append((k, tether))
    there = Problem(
        base=problem.base, goals=[tuple(t.robot) for _, t in checks], tether_length=10_000,
        obstacles=problem.obstacles, clearance=problem.clearance,
    )  # fmt: skip
    exact = TautPaths(there, 20_000.0)
    reps = problem.representative_points
    base = np.array(problem.base)
    for goal, (k, tether) in enumerate(checks, start=1):
        word = signature(np.vstack([base, path[: k + 1]])[:, :2], reps)
        assert signature(tether.nodes[:, :2], reps) == word
        assert tether.length == pytest.approx(exact.length(0, goal, word), rel=0.005)


@pytest.mark.parametrize("turns", [0.7, 3, 5.25])
@pytest.mark.parametrize("delta", [0.05, 0.2])
def test_a_helix_on_a_cylinder(turns, delta):
    """Unrolled it is a straight line: within 0.2 %, and usually within 0.005 %."""
    tethers = model({"capsule": {"a": [0, 0, -30], "b": [0, 0, 30], "radius": 0.5}}, delta=delta)
    angle = np.linspace(0.0, 2 * np.pi * turns, int(200 * turns))
    path = np.column_stack([2 * np.cos(angle), 2 * np.sin(angle), 0.1 * angle])
    tether, lengths = tethers.drive(tethers.start(path[0], path[0]), path)
    planar = 2 * math.sqrt(4 - 0.25) + 0.5 * (angle[-1] - 2 * math.acos(0.25))
    assert tether.length == pytest.approx(math.hypot(planar, 0.1 * angle[-1]), rel=0.002)
    assert len(tether.contacts) == 1
    back, _ = tethers.drive(tether, path[::-1])
    assert back.length == pytest.approx(0.0, abs=0.01)
    assert (np.diff(lengths) > -1e-3).all()


def test_over_a_sphere():
    tethers = model({"sphere": {"center": [0, 0, 0], "radius": 1}})
    start = tethers.start([-2, 0, 0.5], [-2, 0, 3])
    tether, _ = tethers.drive(start, [[2, 0.3, 3], [2, 0, 0.5]])
    assert tether.length == pytest.approx(around((-2, 0.5), (2, 0.5), (0, 0), 1), rel=1e-3)
    assert np.abs(tethers.refine(tether).nodes[:, 1]).max() < 0.01


@pytest.mark.parametrize(
    ("a", "via", "b", "centre", "radius"),
    [  # in the plane of the ring, and through its hole, each in the coordinates of that plane
        ((1.35, -0.9, 0), (2.5, 0, 0), (1.35, 0.9, 0), (0, 0), 1.3),
        ((2, 0, 0.1), (0, 0, 1), (1.8, 0, -1), (1, 0), 0.3),
    ],
)
def test_on_a_torus(a, via, b, centre, radius):
    tethers = model({"torus": {"center": [0, 0, 0], "major_radius": 1, "minor_radius": 0.3}})
    through = [via, (0, 0, -1), b] if a[1] == 0 else [via, b]
    tether = tethers.lay([a, *through])
    tether = tethers.refine(tether)
    plane = [0, 2] if a[1] == 0 else [0, 1]
    u, v = np.array(a)[plane], np.array(b)[plane]
    exact = around(u, v, centre, radius, long_way=a[1] == 0)
    assert tether.length == pytest.approx(exact, rel=0.002)


@pytest.mark.parametrize("dy", [0.0, 1.0, 5.0])
def test_over_the_edges_of_a_box(dy):
    """Unfolded it is a straight line."""
    tethers = model({"box": {"center": [0, 0, 0], "size": [2, 40, 2]}})
    tether = tethers.lay([(-2, 0, 0), (-2, 0, 3), (2, dy, 3), (2, dy, 0)])
    tether = tethers.refine(tether)
    assert tether.length == pytest.approx(math.hypot(2 + 2 * math.sqrt(2), dy), rel=0.002)
    assert tether.strand[1:-1, 14].all()  # both contacts are on sharp edges


def test_voxels_of_a_mesh_give_nearly_the_length_of_the_solid():
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.cylinder(radius=0.5, height=6, sections=128)
    field = DistanceField.build([], [], [], [], grid_of_triangles(mesh.vertices, mesh.faces, voxel=0.05), 0)  # fmt: skip # noqa: E501
    tethers = GeodesicTether(field, 0.1)
    angle = np.linspace(0.0, 4 * np.pi, 400)
    path = np.column_stack([2 * np.cos(angle), 2 * np.sin(angle), 0.1 * angle])
    tether, _ = tethers.drive(tethers.start(path[0], path[0]), path)
    planar = 2 * math.sqrt(4 - 0.25) + 0.5 * (angle[-1] - 2 * math.acos(0.25))
    assert tether.length == pytest.approx(math.hypot(planar, 0.1 * angle[-1]), rel=0.005)


@pytest.mark.parametrize("seed", range(40))
def test_thin_poles_are_never_passed_and_the_way_back_undoes_the_way_out(seed):
    """Poles of radius delta, steps of up to 1 m = 10 delta."""
    rng = np.random.default_rng(seed)
    poles = rng.uniform(0, 8, (25, 2))
    tethers = model(*[{"post": {"center": list(c), "radius": 0.1}} for c in poles], delta=0.1)
    start = np.array([-0.5, -0.5, 0.0])
    path = random_drive(rng, tethers.field, start, 40, 1.0, [-1, -1, -3], [9, 9, 3])
    tether, out = tethers.drive(tethers.start(start, start), path)
    walked = np.vstack([start, path])[:, :2]
    assert signature(tether.nodes[:, :2], poles) == signature(walked, poles)
    tether, back = tethers.drive(tether, path[::-1])
    assert np.allclose(back[::-1], out, rtol=0.001, atol=0.01)
    assert tethers.update(tether, start).length == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_poles_of_a_mesh_are_never_passed_either(seed):
    """Square ones as thin as the class guarantee allows for voxels of half a delta: their corners
    are where contacts are taken sideways, and turned, so that no face lies along the voxels."""
    rng = np.random.default_rng(seed)
    poles, parts = rng.uniform(0, 5, (12, 2)), []
    for pole in poles:
        part = trimesh.creation.box((0.25, 0.25, 5.0))
        part.apply_transform(trimesh.transformations.rotation_matrix(rng.uniform(0, 2), [0, 0, 1]))
        part.apply_translation([*pole, 0.0])
        parts.append(part)
    mesh = trimesh.util.concatenate(parts)
    voxels = grid_of_triangles(mesh.vertices, mesh.faces, voxel=0.05)
    field = DistanceField.build([], [], np.empty((0, 4)), [], voxels, 0.0)
    tethers, start = GeodesicTether(field, 0.1), np.array([-0.5, -0.5, 0.0])
    walk = random_drive(rng, field, start, 60, 1.0, [-1, -1, -1.2], [6, 6, 1.2])
    tether, walked = tethers.start(start, start), [start[:2]]
    for place in walk:
        for _ in range(3):
            tether = tethers.update(tether, place)
        tether = tethers.relaxed(tether.nodes, 60)
        walked.append(place[:2])
        if np.abs(tether.nodes[:, 2]).max() < 2.4:  # over the top of a pole the word says nothing
            assert signature(tether.nodes[:, :2], poles) == signature(np.array(walked), poles)
        else:
            break
    assert len(walked) > 20


posts = st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=1, max_size=4)


@settings(max_examples=25, deadline=None)
@given(posts=posts, seed=st.integers(0, 10**6))
def test_the_anchor_may_move_as_the_robot_does(posts, seed):
    """The tether does not know which end is which."""
    tethers = model(*[{"post": {"center": c, "radius": 0.4}} for c in posts], delta=0.1)
    ends = np.array([[-5.0, -5.0, 0.0], [5.0, 5.0, 1.0]])
    assume(tethers.field.line_of_sight(*ends))
    rng = np.random.default_rng(seed)
    path = random_drive(rng, tethers.field, ends[1], 15, 1.5, [-6, -6, -2], [6, 6, 2])
    one, _ = tethers.drive(tethers.start(*ends), path)
    other = tethers.start(ends[1], ends[0])
    for point in path:
        other = tethers.update(other, ends[0], anchor=point)
    assert other.length == pytest.approx(one.length, rel=1e-3, abs=1e-3)
    assert np.allclose(other.anchor, path[-1])


def test_a_state_is_not_changed_by_looking_ahead():
    tethers = model({"post": {"center": [0, 0], "radius": 0.5}})
    tether = tethers.start([-2, 0.6, 0], [2, 0.6, 0])
    before = tether.strand.copy()
    far = tethers.update(tether, [2, -3, 0])
    assert np.array_equal(before, tether.strand)
    assert far.length > tether.length
    again = tethers.update(tether, [2, -3, 0])
    assert np.array_equal(far.strand, again.strand)


def test_contacts_say_which_part_is_touched_and_how_long():
    """Over one post and under the next: mirror images, each within a node of the exact arc."""
    tethers = model(
        {"post": {"center": [0, 0], "radius": 0.5}}, {"post": {"center": [3, 0], "radius": 0.5}}
    )
    tether = tethers.lay([(-2, 0, 0), (0, 1, 0), (1.5, 0, 0), (3, -1, 0), (5, 0, 0)])
    assert [c.part for c in tether.contacts] == [0, 1]
    # tangents from (-2, 0), and across between the posts
    exact = 0.5 * (math.asin(0.5 / 2) + math.asin(0.5 / 1.5))
    for contact in tether.contacts:
        assert contact.length == pytest.approx(exact, abs=0.12)
        assert contact.first <= contact.last


def test_a_finer_resolution_gives_the_same_length():
    """The capsules of a lattice, a helix about them; halving delta changes it little."""
    legs = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    capsules = [{"a": [x, y, -4], "b": [0.6 * x, 0.6 * y, 4], "radius": 0.2} for x, y in legs]
    for (x, y), (u, v) in zip(legs, [*legs[1:], legs[0]], strict=True):
        capsules.append({"a": [x, y, -4], "b": [0.6 * u, 0.6 * v, 4], "radius": 0.12})
    solids = [{"capsule": c} for c in capsules]
    angle = np.linspace(0, 5 * np.pi, 500)
    path = np.column_stack([2.2 * np.cos(angle), 2.2 * np.sin(angle), -2 + 0.25 * angle])
    lengths = [model(*solids, delta=d).lay(path).length for d in (0.15, 0.075, 0.02)]
    assert lengths[0] == pytest.approx(lengths[2], rel=0.005)
    assert lengths[1] == pytest.approx(lengths[2], rel=0.005)


def test_what_is_too_thin_is_said():
    wire = {"name": "wire", "capsule": {"a": [0, 0, 0], "b": [1, 0, 0], "radius": 0.02}}
    assert "wire" in model(wire, delta=0.1).warnings[0]
    assert model(wire, delta=0.02).warnings == ()


@pytest.mark.parametrize("kind", [GeodesicTether, ReactTether])
def test_bad_ends_are_named(kind):
    tethers = model({"post": {"center": [0, 0], "radius": 0.5}}, kind=kind)
    with pytest.raises(InputError, match=r"anchor: \(0, 0, 0\) lies 0\.5 inside"):
        tethers.start([0, 0, 0], [1, 0, 0])
    with pytest.raises(InputError, match="robot: expected three finite"):
        tethers.start([1, 0, 0], [np.nan, 0, 0])
    for bad in ([np.nan, 0, 0], [np.inf, 0, 0], [0, 1], None, "x"):
        with pytest.raises(InputError, match="robot: expected three finite"):
            tethers.update(tethers.start([1, 0, 0], [1, 1, 0]), bad)
    with pytest.raises(InputError, match="not in sight"):
        tethers.start([-1, 0, 0], [1, 0, 0])
    tether = tethers.start([1, 0, 0], [1, 1, 0])
    with pytest.raises(InputError, match=r"robot: .* inside a solid"):
        tethers.update(tether, [0.1, 0, 0])
    with pytest.raises(InputError, match="delta"):
        model({"post": {"center": [0, 0], "radius": 0.5}}, kind=kind, delta=0.0)


def test_the_papers_model_in_both_readings():
    """Three turns about a cylinder: the listing overestimates a little, the text unwinds them."""
    solid = {"capsule": {"a": [0, 0, -30], "b": [0, 0, 30], "radius": 0.5}}
    angle = np.linspace(0.0, 6 * np.pi, 600)
    path = np.column_stack([2 * np.cos(angle), 2 * np.sin(angle), 0.1 * angle])
    exact = math.hypot(
        2 * math.sqrt(3.75) + 0.5 * (angle[-1] - 2 * math.acos(0.25)), 0.1 * angle[-1]
    )
    listing = model(solid, kind=ReactTether, delta=0.1)
    tether, _ = listing.drive(listing.start(path[0], path[0]), path)
    assert exact * 0.999 < tether.length < 1.1 * exact
    text = model(solid, kind=ReactTether, delta=0.1, reading="text")
    tether, _ = text.drive(text.start(path[0], path[0]), path)
    assert tether.length < 0.6 * exact
    with pytest.raises(InputError, match="reading"):
        model(solid, kind=ReactTether, reading="both")


def test_a_strand_laid_densely_round_something_stays_on_its_side():
    """Nodes on a line are dropped in a round only if that does not add up to a way through."""
    box = Scene(solids=[{"prism": {"polygon": [[-8, -8], [8, -8], [8, 8], [-8, 8]]}}])
    model = GeodesicTether(box.field(), 0.5)
    corners = [(-20, -9, 0), (-9, -9, 0), (-8.3, 8.3, 0), (9, 9, 0), (20, 9, 0)]
    path = np.vstack([np.linspace(a, b, 80) for a, b in itertools.pairwise(corners)])
    lengths = [model.relaxed(path, n).length for n in (5, 50, 2000)]
    assert model.relaxed(path, 2000).length == pytest.approx(model.lay(path).length, rel=2e-3)
    assert lengths[0] >= lengths[1] - 1e-6 >= lengths[2] - 2e-6
    assert box.field().distance(model.relaxed(path, 2000).nodes).min() > -0.1


@pytest.fixture(scope="module")
def wreck():
    """Seven overlapping tilted boxes as a mesh, and stops of a robot among them, by other hands
    (free to use): a Newton step used to fling the tether 10^11 m away here."""
    data = Path(__file__).parent / "data"
    scene = Scene.model_validate(
        {"schema_version": 1, "mesh": {"file": str(data / "wreck.stl"), "voxel": 0.08}}
    )
    return scene.field(), np.load(data / "wreck-stops.npz")["stops"].astype(float)


def test_a_tether_over_a_wreck_stays_taut_where_its_newton_steps_have_no_end(wreck):
    field, stops = wreck
    model = GeodesicTether(field, 0.12)
    tether = model.start((0, 6, 0), (0, 5.5, -1))
    for k, place in enumerate(stops):
        tether = model.update(tether, place)
        assert tether.residual < 1e4
        if k % 100 == 0:
            rested = tether
            for _ in range(3):
                rested = model.update(rested, place)
            taut = model.refine(rested).length
            assert -0.001 * taut <= rested.length - taut <= 0.005 * taut


def test_a_tether_comes_off_the_corners_of_a_comb():
    """Plates in a row, by other hands (free to use). Near a corner two contacts on two edges kept
    one another back, and a tether in the plane of a plate's end hung at its corner."""
    data = Path(__file__).parent / "data"
    model = GeodesicTether(Scene.load(data / "comb.json").field(), 0.1)
    stops = np.load(data / "comb-stops.npz")["stops"].astype(float)
    tether, hung = model.start((-4, 0, 0), (-4, 0, -1)), 0
    for k, place in enumerate(np.vstack([stops, stops[::-1]])):
        tether = model.update(tether, place)
        if k % 25 == 0:
            rested = tether
            for _ in range(3):
                rested = model.update(rested, place)
            taut = model.refine(rested).length
            assert rested.length >= taut * 0.9995
            hung += rested.length > 1.005 * taut
    assert hung <= 3  # of 300
    assert tether.length == pytest.approx(math.dist((-4, 0, 0), stops[0]), rel=1e-4)


def test_a_strand_handed_over_inside_a_cloud_never_grows_without_end(tmp_path):
    """Out of one sheet is into the other where they cross: nodes were put to and fro between both
    sides, ever more of them, and a mission about such a structure froze."""
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 2, 60), np.linspace(0, 2, 60)))
    sheets = [(u, v, 0 * u), (1 + 0 * u, u, v - 1), (u, 1 + 0 * u, v - 1)]
    np.savez(tmp_path / "cloud.npz", points=np.vstack([np.column_stack(s) for s in sheets]))
    field = Scene(cloud={"file": str(tmp_path / "cloud.npz"), "voxel": 0.05}).field().grown(0.2)
    model = GeodesicTether(field, 0.1)
    for seed in (2, 3, 14):
        steps = np.random.default_rng(seed).normal(size=(80, 3)) * 0.12
        path = np.clip(np.cumsum(np.vstack([[1.6, 1.6, 0.6], steps]), axis=0), -0.6, 2.6)
        long = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        for rounds in (1, 3, 10):
            tether = model.relaxed(path, rounds)
            assert len(tether.strand) <= len(path) + 64 + long / (2 * 0.0125)
            assert 0.0 <= tether.residual <= tether.length


def tilted_boxes(seed):
    """A union of tilted boxes, a third of them plates of 0.25 m."""
    rng = np.random.default_rng(seed)
    parts = []
    for _ in range(rng.integers(3, 9)):
        size = rng.uniform(0.4, 3.0, 3)
        if rng.random() < 1 / 3:
            size[rng.integers(3)] = 0.25
        part = trimesh.creation.box(size)
        part.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        part.apply_translation(rng.uniform(-2.5, 2.5, 3))
        parts.append(part)
    return trimesh.util.concatenate(parts)


@pytest.mark.parametrize("seed", [30, 32])
def test_a_tether_does_not_hang_on_the_tips_of_corners(seed):
    """After three still updates it is no longer than one of half the delta, laid where it lies."""
    mesh = tilted_boxes(seed)
    grid = grid_of_triangles(mesh.vertices, mesh.faces, voxel=0.05)
    field = DistanceField.build([], [], np.empty((0, 4)), [], grid, 0.0)
    tethers, finer = GeodesicTether(field, 0.1), GeodesicTether(field, 0.05)
    rng = np.random.default_rng([seed, 1])
    here, path = np.full(3, -4.5), []
    ahead = rng.normal(size=3)
    while len(path) < 600:
        ahead = ahead / np.linalg.norm(ahead) + 0.5 * rng.normal(size=3)
        there = here + 0.5 * rng.uniform(0.2, 1.0) * ahead / np.linalg.norm(ahead)
        inside = (np.abs(there) <= 4.5).all()
        if inside and field.line_of_sight(here, there) and field.distance(there) > 1e-3:
            here = there
            path.append(here)
        else:
            ahead = rng.normal(size=3)
    tether, above = tethers.start([-4.5] * 3, [-4.5] * 3), []
    for begin in range(0, len(path), 10):
        tether, _ = tethers.drive(tether, path[begin : begin + 10])
        for _ in range(3):
            tether = tethers.update(tether, tether.robot)
        above.append(tether.length / finer.refine(tether).length - 1.0)
    assert max(above) < 0.005


def test_a_tether_slips_off_the_corner_of_a_box_when_no_shortest_line_lies_around_it():
    """Around two edges that meet in a corner, the line is shortest at the corner itself from there
    on; contacts on the two edges must not block each other."""
    below, stern, side = -2.0, -8.0, 2.0
    anchor = np.array((-6.5, -0.3, -2.4))

    def length(v, robot):
        line = np.array([anchor, (stern, v[0], below), (stern, side, v[1]), robot])
        return np.linalg.norm(np.diff(line, axis=0), axis=1).sum()

    solids = [{"box": {"center": [0, 0, -1], "size": [16, 4, 2]}}]
    model = GeodesicTether(Scene(solids=solids).field(), 0.05)
    corners = np.array([(-7.7, 2.5, -1.4), (-6.9, 2.9, -1.2), (-5, 2.9, -1.2)])
    path = polylines.dense(corners, 0.05)
    tether = model.lay([anchor, (-8.3, 1.7, -2.1), (-8.3, 2.2, -1.7), path[0]])
    lengths = model.drive(tether, path)[1]
    bounds = [(-side, side), (below, 0.0)]
    best = [scipy.optimize.minimize(length, (1.7, -1.8), (p,), bounds=bounds) for p in path]
    at_corner = [max(side - b.x[0], b.x[1] - below) < 1e-3 for b in best]
    last = at_corner.index(True)
    assert 3 < last < len(path) - 20
    assert lengths[:last] == pytest.approx([b.fun for b in best[:last]], abs=2e-3)
    # it lags by no more than half a metre of the robot's path
    assert (lengths[last + 10 :] < [b.fun - 0.1 for b in best[last + 10 :]]).all()
