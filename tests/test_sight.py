"""Horizons rule out no pair that has a free tangent, and few pairs are left to test."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError, Problem
from netsp.base.compiled.compile_policy import everything_compiled
from netsp.base.geometry.box_tree import build_box_tree
from netsp.base.geometry.kernels import (
    depth_in_obstacle,
    point_in_polygon,
    point_segment_distance,
    segment_blocked,
    segment_segment_distance,
)
from netsp.roadmap.outline import build_outline
from netsp.roadmap.roadmap_policy import SightPolicy
from netsp.roadmap.tangents import tangent_rows


def _star(x, y, radius, corners, rng):
    """A polygon whose corners lie at random distances from its centre, in order of direction."""
    turn = 2.0 * math.pi * (np.arange(corners) + rng.uniform(0.1, 0.9, corners)) / corners
    r = radius * rng.uniform(0.4, 1.0, corners)
    return np.column_stack([x + r * np.cos(turn), y + r * np.sin(turn)]).tolist()


def _room(x, y, side, wall, gap):
    """A square wall that is open at one corner."""
    a, b = side, side - wall
    points = [(0, 0), (a, 0), (a, a - gap), (b, a - gap), (b, wall), (wall, wall), (wall, b)]
    return [(x + u, y + v) for u, v in [*points, (b - gap, b), (b - gap, a), (0, a)]]


def _world(seed, clearance, corners=24):
    """Stars, rooms and circles on a grid, which overlap where the clearance is large."""
    rng = np.random.default_rng(seed)
    obstacles = []
    for k in range(9):
        x, y = 10.0 * (k % 3) + 5.0, 10.0 * (k // 3) + 5.0
        kind = rng.integers(3)
        if kind == 0:
            obstacles.append({"polygon": _star(x, y, 4.5, corners, rng)})
        elif kind == 1:
            obstacles.append({"polygon": _room(x - 4, y - 4, 8, 0.5, 2.0)})
        else:
            obstacles.append({"center": (x, y), "radius": float(rng.uniform(0.5, 4.5))})
    goals = [(10.0 * i, 10.0 * j) for i, j in ((1, 3), (3, 1), (3, 3))]
    return Problem(
        base=(0, 0), goals=goals, obstacles=obstacles, tether_length=60, clearance=clearance
    )


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.3]), st.sampled_from([8, 32, 100]))
@settings(max_examples=12, deadline=None)
def test_tangents_by_horizons_are_those_of_all_pairs(seed, clearance, sectors):
    outline = build_outline(_world(seed, clearance))
    policy = SightPolicy(sectors=sectors, min_pairs=0, block=50)
    with everything_compiled():
        seen = tangent_rows(outline, outline.arcs, outline.full, 60.0, policy=policy)
        every = SightPolicy(min_pairs=10**9)
        assert np.array_equal(
            seen, tangent_rows(outline, outline.arcs, outline.full, 60.0, policy=every)
        )


def _is_blocked(a, b, blockers):
    """Return whether a segment enters a blocker, tested one by one."""
    for o in range(len(blockers.box)):
        begin, end = blockers.edge_start[o], blockers.edge_start[o + 1]
        edges, limit = blockers.edges, blockers.grow[o] - blockers.eps
        if blockers.circles[o, 2] >= 0.0:
            d = point_segment_distance(*blockers.circles[o, :2], *a, *b)
            if d < blockers.circles[o, 2] - blockers.eps:
                return True
        elif point_in_polygon(*a, edges, begin, end) or any(
            segment_segment_distance(*a, *b, *edges[e]) < limit for e in range(begin, end)
        ):
            return True
    return False


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.3]))
@settings(max_examples=10, deadline=None)
def test_a_segment_is_blocked_as_the_obstacles_one_by_one_say(seed, clearance):
    blockers = build_outline(_world(seed, clearance)).blockers
    rng = np.random.default_rng(seed)
    for a in rng.uniform(-1.0, 31.0, (30, 2)):
        b = a + rng.normal(0.0, rng.choice([0.01, 1.0, 10.0]), 2)
        assert segment_blocked(*a, *b, blockers) == _is_blocked(a, b, blockers)
        depth = max(depth_in_obstacle(*a, o, blockers) for o in range(len(blockers.box)))
        assert segment_blocked(*a, *a, blockers) == (depth > blockers.eps)


def test_few_pairs_without_a_tangent_are_left_to_test(monkeypatch):
    from netsp.roadmap import tangents

    outline = build_outline(_world(4, 0.0, corners=200))
    asked = []
    original = tangents.pairs_in_sight

    def count(*args):
        pairs = original(*args)
        asked.append(len(pairs))
        return pairs

    monkeypatch.setattr(tangents, "pairs_in_sight", count)
    rows = tangent_rows(outline, outline.arcs, outline.full, 60.0)
    n = len(outline.arcs)
    assert sum(asked) < 0.1 * n * n / 2
    assert sum(asked) < 2 * len(rows)


@given(st.integers(0, 40), st.integers(0, 100))
@settings(deadline=None)
def test_a_walk_that_skips_nothing_meets_all_items_in_order(n, seed):
    low = np.random.default_rng(seed).uniform(0.0, 9.0, (n, 2))
    boxes = np.hstack([low, low + 1.0])
    tree = build_box_tree(boxes)
    met = []
    for k, after in enumerate(tree.skip.tolist()):
        items = boxes[tree.first[k] : tree.stop[k]]
        assert np.array_equal(tree.box[k], [*items[:, :2].min(axis=0), *items[:, 2:].max(axis=0)])
        if after == k + 1:
            met += range(tree.first[k], tree.stop[k])
    assert met == list(range(n))


@pytest.mark.parametrize(("name", "value"), [("sectors", 7), ("min_pairs", -1), ("block", 0)])
def test_policies_out_of_range_are_refused(name, value):
    with pytest.raises(InputError, match=f"{name}: expected at least"):
        SightPolicy(**{name: value})
