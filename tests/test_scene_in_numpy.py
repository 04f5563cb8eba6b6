"""Tests that vectorised forms of scene kernels return the same as their loops to the last bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.compiled import interpretation
from netsp.base.compiled.compile_policy import CompilePolicy, compiled_by, everything_compiled
from netsp.world import Scene
from netsp.world.paths.standoff import are_in_sight
from netsp.world.paths.tree import are_all_in_sight, free_cells, grow, states_of, tree_path
from netsp.world.scene import packing, sampling
from netsp.world.scene.sites import point_sites
from netsp.world.simulator.coverage import CameraView, PatchArrays, mark_visible, nearest_point

SOLIDS = (
    {"name": "ball", "sphere": {"center": [0, 0, 0], "radius": 1.0}},
    {"name": "bar", "capsule": {"a": [2, 0, 0], "b": [4, 1, 1], "radius": 0.3}},
    {"name": "pipe", "cylinder": {"a": [-3, 2, 0], "b": [-1, 2, 0], "radius": 0.5}},
    {"name": "upright", "cylinder": {"a": [3, 3, -1], "b": [3, 3, 2], "radius": 0.4}},
    {"name": "crate", "box": {"center": [0, -3, 0], "size": [2, 1, 1], "rotation": [30, 10, 0]}},
    {"name": "ring", "torus": {"center": [-3, -2, 1], "major_radius": 1.0, "minor_radius": 0.2}},
    {"name": "post", "post": {"center": [5, -2], "radius": 0.3}},
    {"name": "quay", "prism": {"polygon": [[5, 2], [7, 2], [7, 4], [6, 3], [5, 4]], "grow": 0.1}},
    {"name": "bed", "half_space": {"point": [0, 0, -5], "normal": [0, 0.1, 1]}},
)
LOW, HIGH = np.array([-6.0, -6.0, -6.0]), np.array([8.0, 6.0, 5.0])


def field_of(names):
    return Scene(solids=[s for s in SOLIDS if s["name"] in names]).field().arrays


ALL = {s["name"] for s in SOLIDS}
FIELDS = st.sets(st.sampled_from(sorted(ALL)), min_size=1, max_size=5).map(field_of) | st.just(
    field_of(ALL)  # enough solids for a lookup by cell
)


def both(kernel, *args):
    """Return the results of a kernel's loops and of its vectorised form."""
    own = getattr(kernel, "py_func", kernel)
    numpy = CompilePolicy(min_numpy_items=0)
    with np.errstate(all="ignore"), pytest.MonkeyPatch.context() as patch, compiled_by(numpy):
        by_numpy = interpretation._in_numpy[own](*args)
        patch.setattr(interpretation, "_in_numpy", {})
        return interpretation._interpreted.__wrapped__(own)(*args), by_numpy


def assert_alike(loops, numpy):
    for a, b in zip(*(v if isinstance(v, tuple) else (v,) for v in (loops, numpy)), strict=True):
        a, b = np.asarray(a), np.asarray(b)
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        assert a.tobytes() == b.tobytes()


def points(seed, n):
    """Return random points, a third of them with integer coordinates, as faces of solids have."""
    drawn = np.random.default_rng(seed).uniform(LOW, HIGH, (n, 3))
    drawn[::3] = np.round(drawn[::3])
    return drawn


@settings(max_examples=15, deadline=None)
@given(field=FIELDS, seed=st.integers(0, 10**6))
def test_distances_and_sight_are_equal(field, seed):
    """Distances, gradients and sight are equal for each kind of solid, with and without lookup."""
    p = points(seed, 40)
    assert_alike(*both(sampling.sample_many, field, p))
    assert_alike(*both(are_in_sight, field, p[:6], p[6:12], 0.05))
    for k in range(3):
        assert_alike(*both(are_all_in_sight, field, p[k : k + 2], p[k + 1 : k + 3], 0.1))


def test_an_empty_array_of_points_has_no_distances():
    """An array without points gives an array without distances."""
    assert_alike(*both(sampling.sample_many, field_of(ALL), np.zeros((0, 3))))


@settings(max_examples=6, deadline=None)
@given(field=FIELDS, seed=st.integers(0, 10**6))
def test_free_cells_and_trees_of_paths_are_equal(field, seed):
    """Free cells, trees of shortest paths and paths to the root are equal in both forms."""
    rng = np.random.default_rng(seed)
    shape = (9, 8, 7)
    free, by_numpy = both(free_cells, field, LOW, 1.5, shape, 0.1, np.zeros(1, dtype=np.int64))
    assert_alike(free, by_numpy)
    states, by_numpy = both(states_of, free)
    assert_alike(states, by_numpy)
    open_ = np.argwhere(free)
    root, wanted = open_[rng.integers(len(open_))], open_[rng.integers(len(open_), size=2)]
    for cells in (wanted, np.full((1, 3), -1)):
        toward, by_numpy = both(grow, states, root, cells)
        assert_alike(toward, by_numpy)
    there = np.argwhere(toward >= 0)
    for start in there[rng.integers(len(there), size=3)]:
        assert_alike(*both(tree_path, toward, start))


def test_the_lookup_lists_the_same_solids_in_both_forms():
    """Both forms list the same candidates for the nearest solid in each cell of the lookup."""
    data = field_of(ALL).data
    data = data[: int(data[packing.CELLS])].copy()
    data[packing.NEAR + 3] *= 8.0
    data[packing.NEAR + 4 : packing.NEAR + 7] = np.ceil(data[packing.NEAR + 4 :][:3] / 8.0)
    assert_alike(*both(packing.candidates, data))


@settings(max_examples=10, deadline=None)
@given(field=FIELDS, seed=st.integers(0, 10**6), yaw=st.floats(-3.0, 3.0))
def test_a_view_marks_the_same_patches_in_both_forms(field, seed, yaw):
    """Both forms mark the same patches as seen and return the same shares of the surface as new."""
    centres = points(seed, 120)
    normals = points(seed + 1, 120)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1.0)[:, None]
    surface = PatchArrays(centres, normals, np.random.default_rng(seed).random(120))
    view = CameraView(centres[0] + 0.3, yaw, -0.2, 1.0, 6.0, 0.05)
    assert_alike(*both(nearest_point, centres, view.eye))
    seen = [np.zeros(120, dtype=bool) for _ in range(4)]
    own, numpy = getattr(mark_visible, "py_func", mark_visible), CompilePolicy(min_numpy_items=0)
    with np.errstate(all="ignore"), compiled_by(numpy):
        new = interpretation._in_numpy[own](field, surface, *seen[:2], view)
        loops = interpretation.FunctionType(
            own.__code__,
            {**own.__globals__, "lowest_along": interpretation.interpreted(sampling.lowest_along)},
        )
        assert_alike(loops(field, surface, *seen[2:], view), new)
    assert_alike(tuple(seen[2:]), tuple(seen[:2]))


def test_arrays_in_any_memory_order_use_the_same_compiled_code():
    rows = np.random.default_rng(0).uniform(-3, 3, (50, 3))
    field = Scene(solids=SOLIDS[:2]).field()
    with everything_compiled():
        distances = field.distance(rows)
        count = len(sampling.sample_many.overloads)
        assert np.array_equal(field.distance(np.asfortranarray(rows)), distances)
        assert np.array_equal(field.distance(np.repeat(rows, 2, axis=0)[::2]), distances)
    assert len(sampling.sample_many.overloads) == count
    assert point_sites(np.asfortranarray(rows)).flags.c_contiguous
