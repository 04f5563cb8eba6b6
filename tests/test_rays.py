"""The word of a path is a homotopy invariant, whatever the floating-point accidents."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netsp.hsignature import concatenate, crossings, invert, reduce, signature

# a coarse grid makes vertices on rays, equal centres and vertical segments the usual case
grid = st.integers(-4, 4).map(float)
vertex = st.tuples(grid, grid)
centers = st.lists(
    st.tuples(grid, grid.map(lambda v: v + 0.5)), min_size=1, max_size=4, unique=True
)
paths = st.lists(vertex, min_size=2, max_size=8)


def touches(path, rays):
    """Whether a polyline passes through a representative point (then it has no word)."""
    p = np.array(path)
    for c in np.array(rays):
        a, b = p[:-1] - c, p[1:] - c
        d = b - a
        t = np.clip(-(a * d).sum(1) / np.maximum((d**2).sum(1), 1e-300), 0, 1)
        if np.hypot(*(a + t[:, None] * d).T).min() < 1e-9:
            return True
    return False


@given(paths, centers)
def test_a_path_followed_by_its_reverse_is_empty(path, rays):
    there, back = crossings(path, rays), crossings(path[::-1], rays)
    assert back == invert(there)
    assert reduce((*there, *back)) == ()


@given(paths, centers, st.integers(1, 6))
def test_splitting_a_path_at_a_vertex_never_changes_its_word(path, rays, at):
    k = min(at, len(path) - 1)
    parts = crossings(path[: k + 1], rays) + crossings(path[k:], rays)
    assert parts == crossings(path, rays)


@given(paths, centers, st.floats(0.01, 0.99), st.integers(0, 6))
def test_a_point_inserted_on_a_segment_never_changes_the_word(path, rays, t, at):
    if touches(path, rays):
        return
    k = min(at, len(path) - 2)
    a, b = np.array(path[k]), np.array(path[k + 1])
    middle = tuple(a + t * (b - a))
    assert signature([*path[: k + 1], middle, *path[k + 1 :]], rays) == signature(path, rays)


@given(st.lists(vertex, min_size=3, max_size=8), centers, st.data())
def test_small_moves_that_cross_no_obstacle_keep_the_word(path, rays, data):
    """Inner vertices move by less than the clearance of the path to every centre."""
    p = np.array(path)
    gap = min(
        float(_distance(p[k], p[k + 1], np.array(c))) for k in range(len(p) - 1) for c in rays
    )
    if gap < 1e-6:
        return
    moved = p.copy()
    for k in range(1, len(p) - 1):
        angle = data.draw(st.floats(0, 6.3))
        moved[k] += 0.49 * gap * np.array([np.cos(angle), np.sin(angle)])
    assert signature(moved, rays) == signature(path, rays)


def _distance(a, b, c):
    d = b - a
    t = np.clip(((c - a) @ d) / max(d @ d, 1e-300), 0, 1)
    return np.hypot(*(a + t * d - c))


@pytest.mark.parametrize(("i", "k"), [(i, k) for i in range(1, 6) for k in range(i, 6)])
def test_a_clockwise_loop_round_obstacles_i_to_k_writes_them_in_order(i, k):
    rays = [(float(j), 0.0) for j in range(1, 6)]
    a, b = i - 0.5, k + 0.5
    loop = [(a, -1.0), (a, 1.0), (b, 1.0), (b, -1.0)]
    assert signature(loop, rays, closed=True) == tuple(range(i, k + 1))
    assert signature(loop[::-1], rays, closed=True) == invert(range(i, k + 1))


def test_a_vertex_exactly_on_a_ray_is_counted_once():
    assert signature([(-1, 1), (0, 1), (1, 1)], [(0, 0)]) == (1,)
    assert signature([(-1, 1), (0, 1), (-1, 2)], [(0, 0)]) == ()
    assert signature([(1, 1), (0, 1), (1, 2)], [(0, 0)]) == ()


def test_a_vertical_segment_crosses_nothing_even_on_a_ray():
    assert crossings([(0, 1), (0, 5)], [(0, 0)]) == ()
    assert signature([(-1, 1), (0, 1), (0, 3), (1, 3)], [(0, 0)]) == (1,)


def test_rays_of_equal_x_are_crossed_in_the_order_of_their_numbers():
    rays = [(0, 2), (0, 0), (0, 1)]
    assert crossings([(-1, 3), (1, 3)], rays) == (1, 2, 3)
    assert crossings([(1, 3), (-1, 3)], rays) == (-3, -2, -1)
    assert crossings([(-1, 1.5), (1, 1.5)], rays) == (2, 3)


def test_a_ray_goes_on_through_the_obstacle_above_it():
    """Round the upper of two obstacles, the lower one's ray is crossed and crossed back."""
    rays = [(0, 0), (0.5, 3)]
    round_upper = [(-2, 3), (-2, 6), (2, 6), (2, 1.5), (-2, 1.5), (-2, 3)]
    assert crossings(round_upper, rays) == (1, 2, -1)


@given(paths, paths, centers)
def test_the_word_of_two_paths_in_a_row_is_the_product_of_their_words(p, q, rays):
    q = [p[-1], *q]
    assert signature([*p, *q[1:]], rays) == concatenate(signature(p, rays), signature(q, rays))


def test_heights_do_not_matter_and_shapes_are_checked():
    assert signature([(-1, 1, 5), (1, 1, -7)], [(0, 0)]) == (1,)
    assert crossings([], [(0, 0)]) == ()
    assert crossings([(0, 0), (1, 1)], []) == ()
    with pytest.raises(ValueError, match="expected an array of shape"):
        crossings([(1, 2, 3, 4)], [(0, 0)])
