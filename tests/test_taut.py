"""The exact roadmap: every class once, every length right."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from netsp import (
    Circle,
    InfeasibleError,
    InputError,
    Polygon,
    Problem,
    Status,
    solve,
    travel_graph,
    verify,
)
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.hsignature import crossings, is_looping, reduce, signature
from netsp.plan.random_worlds import random_world as papers_world
from netsp.roadmap.taut import TautRoadmap
from tests.brute import BruteForce
from tests.worlds import random_world, small_worlds

relaxed = settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.filter_too_much]
)


def reachable(problem):
    """The roadmap, or None where some goal is out of reach."""
    try:
        return TautRoadmap(problem)
    except InfeasibleError:
        return None


def classes(roadmap):
    return {
        (int(c), w): float(d)
        for c, w, d in zip(roadmap.cluster, roadmap.signatures, roadmap.planar, strict=True)
        if c > 0
    }


def nearly_touching(problem):
    """Whether two obstacles touch in a point, so that inscribed polygons cannot tell if they do."""
    for a, b in itertools.combinations(problem.obstacles, 2):
        if isinstance(a, Circle):
            if abs(math.dist(a.center, b.center) - a.radius - b.radius) < 0.05:
                return True
            continue
        p, q = shapely.Polygon(a.polygon), shapely.Polygon(b.polygon)
        gap = p.distance(q) - 2 * problem.clearance
        if abs(gap) < 0.02 and (problem.clearance or "Point" in p.intersection(q).geom_type):
            return True
    return False


def check_against_brute_force(problem, sides=32):
    if nearly_touching(problem):
        return
    roadmap = reachable(problem)
    brute = BruteForce(problem, sides)
    limit = problem.tether_length
    found = {k: d for k, d in brute.lengths(0, limit).items() if k[0] > 0}
    # polygons are inscribed, so brute lengths are short by less than this
    error = 2.0 * limit * (math.pi / sides) ** 2
    if roadmap is None:
        goals = {g for g, _ in found}
        firm = {g for (g, _), d in found.items() if d < limit - error}
        assert len(firm) < len(problem.goals), f"reachable by brute force: {sorted(goals)}"
        return
    exact = classes(roadmap)
    for k, d in exact.items():
        assert k in found, f"class {k} of length {d} unknown to brute force"
        assert found[k] - 1e-6 <= d <= found[k] + error
    for k, d in found.items():
        if d < limit - error:
            assert k in exact, f"class {k} of length {d} missed"
    # the paper's rule: the same but for the words that loop
    papers = classes(TautRoadmap(problem, classes="non-looping"))
    assert papers == {k: d for k, d in exact.items() if not is_looping(k[1])}


@relaxed
@given(small_worlds())
def test_classes_agree_with_brute_force(problem):
    check_against_brute_force(problem)


@relaxed
@given(small_worlds(grid=True))
def test_classes_agree_with_brute_force_where_everything_is_aligned(problem):
    check_against_brute_force(problem)


@settings(relaxed, max_examples=12)
@given(small_worlds(max_circles=3, goals=2))
def test_legs_agree_with_brute_force(problem):
    roadmap = reachable(problem)
    if roadmap is None or len(roadmap.cluster) > 60:
        return
    brute = BruteForce(problem, 32)
    found = brute.lengths(1, 2 * problem.tether_length)
    costs = roadmap.to_travel_graph().costs
    error = 4.0 * problem.tether_length * (math.pi / 32) ** 2
    for u in np.flatnonzero(roadmap.cluster == 1):
        for v in np.flatnonzero(roadmap.cluster == 2):
            d = found[2, roadmap.legs.relative_word(int(u), int(v))]
            assert d - 1e-6 <= costs[u, v] <= d + error


@pytest.mark.parametrize("seed", range(4))
def test_laws_of_a_random_world(seed):
    problem = random_world(seed, goals=8, tether=330.0)
    roadmap = TautRoadmap(problem)
    graph = roadmap.to_travel_graph()
    costs = graph.costs
    n = len(graph)
    # each class once
    keys = list(zip(graph.cluster.tolist(), graph.signatures, strict=True))
    assert len(set(keys)) == n
    assert all(w == reduce(w) for w in graph.signatures)
    # symmetric; no leg within a cluster
    assert (costs == costs.T).all()
    same = graph.cluster[:, None] == graph.cluster[None, :]
    assert np.isinf(costs[same]).all()
    assert np.isfinite(costs[~same]).all()
    # triangle inequality on the cover
    finite = np.where(same, np.inf, costs)
    rng = np.random.default_rng(seed)
    for _ in range(3000):
        u, v, w = rng.integers(0, n, 3)
        if len({int(graph.cluster[k]) for k in (u, v, w)}) == 3:
            assert finite[u, w] <= finite[u, v] + finite[v, w] + 1e-9
    # tethers are legs from the base
    assert np.allclose(costs[0, 1:], graph.tethers[1:], rtol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_a_materialised_leg_has_its_word_its_length_and_enough_tether(seed):
    """Facts 2 and 3 of the design: tether along a leg is never longer than at its worse end."""
    problem = random_world(seed, goals=8, tether=330.0)
    roadmap = TautRoadmap(problem)
    graph = roadmap.to_travel_graph()
    rays = problem.representative_points
    rng = np.random.default_rng(seed)
    for _ in range(25):
        u, v = (int(k) for k in rng.integers(0, len(graph), 2))
        if graph.cluster[u] == graph.cluster[v]:
            continue
        path = graph.path(u, v)
        assert signature(path, rays) == roadmap.legs.relative_word(u, v)
        drawn = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        assert graph.costs[u, v] - 1e-6 <= drawn <= graph.costs[u, v] * 1.001
        # no piece of the path is inside an obstacle
        for o in problem.obstacles:
            a, d = path[:-1, :2], np.diff(path[:, :2], axis=0)
            t = np.clip(((o.center - a) * d).sum(1) / np.maximum((d**2).sum(1), 1e-300), 0, 1)
            assert np.hypot(*(a + t[:, None] * d - o.center).T).min() >= o.radius - 1e-9


@pytest.mark.parametrize("seed", range(2))
def test_tether_along_a_leg_stays_below_its_worse_end(seed):
    """Sample points of a leg become goals; their class there must have a taut tether that short."""
    problem = random_world(seed, goals=3, tether=300.0, circles=10)
    roadmap = TautRoadmap(problem)
    graph = roadmap.to_travel_graph()
    rays = problem.representative_points
    rng = np.random.default_rng(seed)
    for _ in range(6):
        u = int(rng.choice(np.flatnonzero(graph.cluster == 1)))
        v = int(rng.choice(np.flatnonzero(graph.cluster == 2)))
        tether, leg = graph.path(0, u), graph.path(u, v)
        worse = max(graph.tethers[u], graph.tethers[v])
        for k in rng.integers(1, len(leg) - 1, 3) if len(leg) > 2 else []:
            drive = np.vstack([tether, leg[1 : k + 1]])
            word = signature(drive, rays)
            there = Problem(
                base=problem.base,
                goals=[leg[k, :2]],
                obstacles=problem.obstacles,
                tether_length=worse * 1.01,
            )
            taut = classes(TautRoadmap(there))
            assert taut[1, word] <= worse * (1 + 1e-3)


def test_a_word_twice_through_a_ray_that_another_obstacle_cuts_is_found():
    """The tether passes right of the upper obstacle: letter 1 is written and taken back."""
    problem = Problem(
        base=(-6, 3.0),
        goals=[(-6, 9.0)],
        obstacles=[Circle(center=(0, 0), radius=1), Circle(center=(-1, 6), radius=2)],
        tether_length=40,
    )
    roadmap = TautRoadmap(problem)
    assert (1, (-2,)) in classes(roadmap)
    path = roadmap.paths.path(0, 1, (-2,))
    rays = problem.representative_points
    assert crossings(path, rays) == (1, -1, -2)
    assert path[:, 0].max() > 0.9
    check_against_brute_force(problem.model_copy(update={"tether_length": 16.0}))


def test_collinear_tangents_give_one_path_not_many():
    """Twelve equal circles in a row: every tangent along the row grazes all of them."""
    row = [Circle(center=(3.0 * k, 0), radius=1) for k in range(1, 13)]
    problem = Problem(base=(0, 1), goals=[(39, 1)], obstacles=row, tether_length=41)
    roadmap = TautRoadmap(problem)
    keys = list(zip(roadmap.cluster.tolist(), roadmap.signatures, strict=True))
    assert len(keys) == len(set(keys))
    assert roadmap.planar.min() == 0.0
    assert roadmap.planar[1] == pytest.approx(39.0, abs=1e-6)


def test_three_dimensional_lengths_are_the_hypotenuse_of_the_plan_and_the_height():
    flat = Problem(
        base=(0, 0), goals=[(10, 0), (0, 6)], obstacles=[Circle(center=(5, 0), radius=3)],
        tether_length=30,
    )  # fmt: skip
    deep = flat.model_copy(
        update={
            "goals": Problem(base=(0, 0), goals=[(10, 0, -4), (0, 6, -9)], tether_length=30).goals
        }
    )
    a, b = TautRoadmap(flat), TautRoadmap(deep)
    for (k, d), (key, e) in zip(classes(a).items(), classes(b).items(), strict=True):
        assert k == key
        assert d == pytest.approx(e, rel=1e-12)
    ca, cb = a.to_travel_graph().costs, b.to_travel_graph().costs
    z = deep.points[:, 2][b.cluster]
    finite = np.isfinite(ca)
    assert np.allclose(np.hypot(ca, z[:, None] - z[None, :])[finite], cb[finite], rtol=1e-12)


def test_legs_may_be_asked_for_in_part():
    roadmap = TautRoadmap(random_world(5, goals=6, tether=300.0))
    whole = roadmap.legs.lengths(np.arange(len(roadmap.cluster)))
    some = np.array([0, 3, 5, 9, len(whole) - 1])
    assert np.allclose(roadmap.legs.lengths(some), whole[np.ix_(some, some)], rtol=1e-12)


def test_a_goal_out_of_reach_is_named_with_the_tether_that_would_do():
    problem = Problem(
        base=(0, 0),
        goals=[(1, 0), {"name": "far", "position": [10, 0]}],
        obstacles=[Circle(center=(5, 0), radius=3)],
        tether_length=11,
    )
    with pytest.raises(InfeasibleError, match=r"goal far is out of reach") as caught:
        TautRoadmap(problem)
    needed = 8 + 6 * math.asin(0.6)
    shown = float(str(caught.value).rsplit(" ", 1)[1])
    assert shown == pytest.approx(needed, abs=2e-6)
    assert shown >= needed - 1e-9
    TautRoadmap(problem.model_copy(update={"tether_length": shown}))


def test_a_goal_sealed_in_names_the_obstacles_round_it():
    ring = [
        Circle(center=(10 + 3 * math.cos(a), 3 * math.sin(a)), radius=1.7)
        for a in np.arange(6) * math.pi / 3
    ]
    problem = Problem(
        base=(0, 0), goals=[(10, 0)], obstacles=[*ring, Circle(center=(0, 9), radius=1)],
        tether_length=100,
    )  # fmt: skip
    with pytest.raises(InfeasibleError, match=r"a tether of any length.*obstacles #0, #1"):
        TautRoadmap(problem)
    with pytest.raises(InfeasibleError) as caught:
        TautRoadmap(problem)
    assert "#6" not in str(caught.value)


def test_touching_circles_leave_no_gap():
    """Between two circles that touch there is no way; a hair apart there is."""
    shut = Problem(
        base=(0, -3), goals=[(0, 3)], tether_length=12,
        obstacles=[Circle(center=(-1, 0), radius=1), Circle(center=(1, 0), radius=1)],
    )  # fmt: skip
    ajar = Problem(
        base=(0, -3), goals=[(0, 3)], tether_length=12,
        obstacles=[Circle(center=(-1, 0), radius=1), Circle(center=(1.001, 0), radius=1)],
    )  # fmt: skip
    assert min(classes(TautRoadmap(shut)).values()) > 7.0
    assert min(classes(TautRoadmap(ajar)).values()) == pytest.approx(6.0, abs=1e-5)


def test_polygons_that_touch_in_a_corner_leave_no_gap():
    """Two squares corner to corner: the way between them is shut, the way round is not."""
    squares = [[(-2, -2), (0, -2), (0, 0), (-2, 0)], [(0, 0), (2, 0), (2, 2), (0, 2)]]
    problem = Problem(
        base=(1, -1), goals=[(-1, 1)], obstacles=[Polygon(polygon=s) for s in squares],
        tether_length=9,
    )  # fmt: skip
    lengths = classes(TautRoadmap(problem)).values()
    assert list(lengths) == pytest.approx([4 + 2 * math.sqrt(2)] * 2, abs=1e-6)


def test_of_too_many_classes_the_shortest_of_every_goal_are_kept():
    problem = random_world(0, goals=5, tether=400.0)
    whole, part = TautRoadmap(problem), TautRoadmap(problem, max_classes=50)
    assert whole.complete
    assert not part.complete
    assert part.min_tether_left_out < 400.0
    for goal in range(1, 6):
        kept = np.sort(part.planar[part.cluster == goal])
        assert 1 <= len(kept) <= 10
        assert np.allclose(kept, np.sort(whole.planar[whole.cluster == goal])[: len(kept)])
    # no class left out has a shorter tether than is said
    words = {(int(c), w) for c, w in zip(part.cluster, part.signatures, strict=True)}
    left_out = [
        t for c, w, t in zip(whole.cluster, whole.signatures, whole.tethers, strict=True)
        if (int(c), w) not in words
    ]  # fmt: skip
    assert min(left_out) >= part.min_tether_left_out - 1e-6


def test_tethers_that_wind_more_often_before_one_tangent_part_there():
    """Legs between classes of a roadmap that had to leave classes out, as between those of all."""
    obstacles = [Circle(center=(0, y), radius=1) for y in (0, 6)]
    problem = Problem(
        base=(-4, 0), goals=[(2, 8), (-2, 9), (4, 5)], obstacles=obstacles, tether_length=42
    )
    whole = TautRoadmap(problem).to_travel_graph()
    part = TautRoadmap(problem, max_classes=len(whole) - 4).to_travel_graph()
    assert whole.is_complete
    assert not part.is_complete
    place = {(whole.cluster[v], w): v for v, w in enumerate(whole.signatures)}
    same = [place[part.cluster[v], w] for v, w in enumerate(part.signatures)]
    rng = np.random.default_rng(0)
    for u, v in rng.integers(1, len(part), (300, 2)):  # one by one: a search for many looks farther
        leg = part.costs_among([u, v])[0, 1]
        assert leg == pytest.approx(whole.costs[same[u], same[v]])


@pytest.mark.parametrize("rule", ["none", 3, None])
def test_an_unknown_rule_of_classes_is_refused(rule):
    with pytest.raises(InputError, match="classes: unknown"):
        TautRoadmap(random_world(0, goals=2, tether=200.0), classes=rule)


def test_a_speck_of_an_obstacle_winds_up_no_endless_search():
    """A tether winds a thousand times around a wire; the shortest classes are found all the same,
    and the tour that is shorter than twice any other tether is proven."""
    problem = Problem(
        base=(0, 0), goals=[(6, 1)], obstacles=[Circle(center=(3, 0.5), radius=1e-4)],
        tether_length=20,
    )  # fmt: skip
    solution = solve(problem, roadmap_options={"max_classes": 100})
    assert solution.classes == "shortest"
    assert solution.status is Status.OPTIMAL
    assert solution.length == pytest.approx(2 * math.hypot(6, 1), rel=1e-6)
    assert solution.lower_bound is not None
    assert verify(problem, solution)


def moved(problem, turn=0.0, mirror=False, shift=(0.0, 0.0), order=None):
    """The same world elsewhere: mirrored, turned, moved, its obstacles renumbered."""
    c, s = math.cos(turn), math.sin(turn)

    def there(p):
        x, y = (-p[0], p[1]) if mirror else (p[0], p[1])
        return (c * x - s * y + shift[0], s * x + c * y + shift[1], *p[2:])

    obstacles = [
        Circle(center=there(o.center), radius=o.radius) if isinstance(o, Circle)
        else Polygon(polygon=[there(p) for p in o.polygon])
        for o in problem.obstacles
    ]  # fmt: skip
    return Problem(
        base=there(problem.base),
        goals=[there(g.position) for g in problem.goals],
        obstacles=[obstacles[k] for k in order] if order is not None else obstacles,
        tether_length=problem.tether_length,
        clearance=problem.clearance,
    )


@pytest.mark.parametrize("seed", range(6))
def test_where_a_world_lies_and_how_it_is_numbered_changes_neither_classes_nor_optimum(seed):
    """Which words loop depends on the direction of the rays; which classes there are does not."""
    rng = np.random.default_rng(seed)
    family = "harbour" if seed % 2 else "icra2017"
    problem = papers_world(seed, family=family, goals=5, tether_length=330.0)
    lengths, best = np.sort(TautRoadmap(problem).tethers), solve(problem).length
    turn, shift = float(rng.uniform(0, 2 * math.pi)), rng.uniform(-1e3, 1e3, 2)
    order = rng.permutation(len(problem.obstacles))
    for other in (
        moved(problem, turn=turn),
        moved(problem, mirror=True),
        moved(problem, shift=shift),
        moved(problem, order=order),
        moved(problem, turn, True, shift, order),
    ):
        found = np.sort(TautRoadmap(other).tethers)
        assert len(found) == len(lengths)
        assert np.allclose(found, lengths, atol=1e-5)
        assert solve(other).length == pytest.approx(best, rel=1e-6)


def test_polygons_bend_at_their_convex_vertices_only():
    u = [(4, -2), (9, -2), (9, -1), (5, -1), (5, 1), (9, 1), (9, 2), (4, 2)]
    problem = Problem(base=(0, 0), goals=[(7, 0)], obstacles=[Polygon(polygon=u)], tether_length=15)
    expected = math.hypot(4, 2) + 5 + 1 + math.hypot(2, 1)
    lengths = sorted(classes(TautRoadmap(problem)).values())
    assert lengths[:2] == pytest.approx([expected, expected], abs=1e-6)


shapes = st.sampled_from(
    [
        [(0, 0), (2, 0), (2, 2), (0, 2)],
        [(0, 0), (3, 0), (0, 3)],
        [(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)],
        [(0, 0), (4, 0), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)],
        [(0, 0), (2, 1), (4, 0), (2, 4)],
    ]
)


@settings(relaxed, max_examples=12)
@given(
    st.lists(st.tuples(shapes, st.integers(-5, 4), st.integers(-5, 4)), min_size=1, max_size=3),
    st.sampled_from([0.0, 0.0, 0.25]),
    st.data(),
)
def test_polygons_agree_with_brute_force(parts, clearance, data):
    obstacles = [Polygon(polygon=[(x + dx, y + dy) for x, y in s]) for s, dx, dy in parts]
    half = st.integers(-13, 13).map(lambda k: k / 2 + 0.13)
    point = st.tuples(half, half).filter(
        lambda p: all(o.signed_distance(p) > clearance + 1e-3 for o in obstacles)
    )
    base, *goals = data.draw(st.lists(point, min_size=3, max_size=3, unique=True))
    problem = Problem(
        base=base, goals=goals, obstacles=obstacles, tether_length=12.0, clearance=clearance
    )
    check_against_brute_force(problem)


@settings(relaxed, max_examples=12)
@given(small_worlds(max_circles=3, goals=2), st.sampled_from([-3.0, 0.0, 2.5]))
def test_bounds_cut_off_what_lies_outside(problem, top):
    if any(p[1] > top for p in problem.points):
        return
    # of an obstacle that touches the bounds an inscribed polygon cannot tell if it shuts the gap
    walls = np.array([-9.0, 9.0, -9.0, top])
    for o in problem.obstacles:
        low, high = np.array(o.shape().bounds[:2]), np.array(o.shape().bounds[2:])
        ends = np.array([low[0], high[0], low[1], high[1]])
        if (np.abs(ends - walls) < 0.05 + problem.clearance).any():
            return
    check_against_brute_force(problem.model_copy(update={"bounds": (-9.0, -9.0, 9.0, top)}))


def test_every_pair_of_classes_has_a_leg_in_an_aligned_grid():
    """Rays through other centres, tangents that graze three circles: nothing goes missing."""
    grid = [
        Circle(center=(3.0 * i, 3.0 * j), radius=1)
        for i, j in itertools.product(range(3), repeat=2)
    ]
    problem = Problem(
        base=(-2, -2), goals=[(1.5, 1.5), (4.5, 4.5), (3, 1.5), (0, 4.5)], obstacles=grid,
        tether_length=12,
    )  # fmt: skip
    graph = TautRoadmap(problem).to_travel_graph()
    same = graph.cluster[:, None] == graph.cluster[None, :]
    assert np.isfinite(graph.costs[~same]).all()


@pytest.mark.parametrize("seed", range(10))
def test_every_pair_of_classes_has_a_leg_in_random_worlds(seed):
    """Long legs write and take back letters of rays that other obstacles cut; none may get lost."""
    graph = TautRoadmap(random_world(seed, goals=20, tether=350.0)).to_travel_graph()
    same = graph.cluster[:, None] == graph.cluster[None, :]
    assert np.isfinite(graph.costs[~same]).all()


boundary_angles = st.one_of(st.sampled_from([0.0, 90.0, 180.0, 270.0]), st.floats(0.0, 360.0))


@relaxed
@given(
    boundary_angles,
    st.tuples(st.integers(-3, 3), st.integers(-3, 3)),
    st.sampled_from([0.5, 1.0, 1.7]),
    st.sampled_from([0.0, 0.5]),
    st.sampled_from([(0.0, 0.0), (6e6, -5e6)]),
)
def test_goals_exactly_on_a_grown_boundary(angle, center, radius, clearance, offset):
    """Both ways round one circle to a goal on it: a tangent and an arc, in closed form."""
    base = np.array([-7.0, 0.3]) + offset
    middle = np.array(center) + offset
    grown = radius + clearance
    a = math.radians(angle)
    goal = middle + grown * np.array([math.cos(a), math.sin(a)])
    circle = Circle(center=middle, radius=radius)
    problem = Problem(
        base=base, goals=[goal, base - np.array([0.0, 4.0])], obstacles=[circle], tether_length=40,
        clearance=clearance,
    )  # fmt: skip
    roadmap = TautRoadmap(problem)
    costs = roadmap.to_travel_graph().costs
    same = roadmap.cluster[:, None] == roadmap.cluster[None, :]
    assert np.isfinite(costs[~same]).all()
    d = np.hypot(*(base - middle))
    seen = abs((a - math.atan2(*(base - middle)[::-1]) + math.pi) % (2 * math.pi) - math.pi)
    lit = math.acos(grown / d)  # how far round the boundary the base sees
    if seen <= lit:
        expected = float(np.hypot(*(goal - base)))
    else:
        expected = math.sqrt(d * d - grown * grown) + grown * (seen - lit)
    assert roadmap.planar[roadmap.cluster == 1].min() == pytest.approx(expected, abs=2e-7)
    for v in np.flatnonzero(roadmap.cluster == 1):
        path = roadmap.legs.path(0, int(v))
        assert signature(path, problem.representative_points) == roadmap.signatures[v]


@pytest.mark.parametrize("offset", [(0.0, 0.0), (6e6, 5e6)])
def test_capsules_of_a_rectangle_and_circles_of_its_width(offset):
    """Outlines that touch from inside: the smooth joint is passed, nothing runs in circles."""
    dx, dy = offset
    capsule = [
        Polygon(polygon=[(dx - 2, dy - 1), (dx + 2, dy - 1), (dx + 2, dy + 1), (dx - 2, dy + 1)]),
        Circle(center=(dx - 2, dy), radius=1),
        Circle(center=(dx + 2, dy), radius=1),
        Circle(center=(dx + 1.5, dy), radius=0.5),
    ]
    problem = Problem(
        base=(dx - 6, dy), goals=[(dx + 6, dy), (dx, dy + 1)], obstacles=capsule, tether_length=20
    )
    roadmap = TautRoadmap(problem)
    tangent, arc = math.sqrt(16 - 1), math.asin(1 / 4)
    assert roadmap.planar[roadmap.cluster == 1].min() == pytest.approx(
        2 * (tangent + arc) + 4, abs=1e-6
    )
    assert roadmap.planar[roadmap.cluster == 2].min() == pytest.approx(tangent + arc + 2, abs=1e-6)


def test_circles_inside_circles_that_touch_from_inside():
    outer = Circle(center=(0, 0), radius=2)
    inner = [
        Circle(center=(1, 0), radius=1),
        Circle(center=(0, 0), radius=2),
        Circle(center=(0.3, 0), radius=0.5),
    ]
    for obstacles in ([outer], [outer, *inner], [*inner, outer]):
        problem = Problem(base=(-5, 0), goals=[(5, 0)], obstacles=obstacles, tether_length=14)
        d = 2 * (math.sqrt(21) + 2 * math.asin(2 / 5))
        assert sorted(TautRoadmap(problem).planar)[1:3] == pytest.approx([d, d], abs=1e-6)


def test_a_goal_at_the_end_of_a_vertex_arc():
    """Found by attack: the point was pushed through the corner instead of away from it."""
    problem = Problem(
        base=(-1.862, 1.621), goals=[(-4.25, -2.0)], tether_length=4.5, clearance=0.25,
        obstacles=[Polygon(polygon=[(-4, -4), (-2, -4), (-4, -2)])],
    )  # fmt: skip
    assert TautRoadmap(problem).planar[1] > math.dist((-1.862, 1.621), (-4.25, -2.0))


def test_a_far_origin_changes_nothing():
    near = random_world(4, goals=6, tether=280.0)
    shift = np.array([6.1e6, -4.2e6])
    far = Problem(
        base=np.array(near.base[:2]) + shift,
        goals=[np.array(g.position[:2]) + shift for g in near.goals],
        obstacles=[
            Circle(center=np.array(o.center) + shift, radius=o.radius) for o in near.obstacles
        ],
        tether_length=near.tether_length,
    )
    a, b = TautRoadmap(near), TautRoadmap(far)
    assert a.signatures == b.signatures
    assert np.allclose(a.planar, b.planar, atol=1e-7)


def test_time_up_while_measuring_legs_says_where_it_stood():
    graph = TautRoadmap(random_world(0, goals=20, tether=400.0)).to_travel_graph()
    said = "time limit reached while measuring the legs"
    with graph.on_clock(Clock(1e-9)), pytest.raises(LimitReachedError, match=said):
        graph.costs  # noqa: B018


def test_time_up_while_classes_are_sought_leaves_some_of_every_goal():
    problem = random_world(0, goals=20, tether=400.0)
    roadmap = TautRoadmap(problem, time_limit=1e-9)
    assert not roadmap.complete
    assert set(roadmap.cluster.tolist()) == set(range(21))
    solution = solve(problem, time_limit=1e-9)
    assert solution.status in (Status.FEASIBLE, Status.OPTIMAL_OF_KEPT)
    assert verify(problem, solution)


@pytest.mark.parametrize("radius", [1e2, 1e3, 1e4])
def test_beside_a_circle_ever_wider_the_tour_stays_as_long_as_beside_its_tangent(radius):
    problem = Problem(
        base=(0, 0), goals=[(-4, 0), (-4, 1)], tether_length=10,
        obstacles=[Circle(center=(radius + 1e-3, 0), radius=radius)],
    )  # fmt: skip
    assert solve(problem).length == pytest.approx(4 + 1 + math.hypot(4, 1), rel=1e-6)


def test_what_cannot_be_reached_is_told_by_goal_length_and_obstacles():
    wall = [Circle(center=(4 + 1.5 * np.cos(a), 1.5 * np.sin(a)), radius=0.7)
            for a in np.arange(8) * np.pi / 4]  # fmt: skip
    far = Circle(center=(-9, 0), radius=1)
    cut_off = Problem(base=(0, 0), goals=[(1, 1), (4, 0)], obstacles=[far, *wall], tether_length=20)
    with pytest.raises(InfeasibleError) as told:
        travel_graph(cut_off)
    assert (told.value.goal, told.value.needed) == (1, np.inf)
    assert told.value.enclosing == tuple(range(1, 9))
    short = Problem(base=(0, 0), goals=[(6, 8)], tether_length=9)
    with pytest.raises(InfeasibleError) as told:
        travel_graph(short)
    assert (told.value.goal, told.value.enclosing) == (0, ())
    assert told.value.needed == pytest.approx(10.0)
    choice = Problem(base=(0, 0), tether_length=9, goals=[
        (1, 0), {"name": "c", "any_of": [(60, 80), (6, 8)]}])  # fmt: skip
    with pytest.raises(InfeasibleError) as told:
        travel_graph(choice)
    assert told.value.goal == 1
