"""Solids that touch leave no slit between them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.world import GeodesicTether, Scene
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import encode
from netsp.world.scene.seams import seam_boxes

lengths = st.floats(0.4, 3.0)
angles = st.floats(-180.0, 180.0)


def turned(rotation):
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", rotation, degrees=True).as_matrix()


def unfilled(scene):
    """The field of a scene's solids alone."""
    solids = scene.all_solids()
    kind, rows, outline = encode(solids)
    boxes = [b for s in solids if (b := s.shape.box()) is not None]
    return DistanceField.build(kind, rows, outline, boxes, None, 0.0)


# at 90 degrees the angles of a rotation are not unique, which SciPy says; any of them will do
@pytest.mark.filterwarnings("ignore:Gimbal lock")
@settings(max_examples=60, deadline=None)
@given(
    size=st.tuples(lengths, lengths, lengths), other=st.tuples(lengths, lengths, lengths),
    rotation=st.tuples(angles, angles, angles), twist=angles,
    shift=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), gap=st.floats(-0.02, 0.0009),
)  # fmt: skip
def test_boxes_that_touch_are_one_solid_and_no_distance_outside_changes(
    size, other, rotation, twist, shift, gap
):
    frame = turned(rotation)
    up = 0.5 * (size[2] + other[2]) + gap
    second = frame @ turned((0, 0, twist))
    from scipy.spatial.transform import Rotation

    scene = Scene(solids=[
        {"box": {"center": [0, 0, 0], "size": size, "rotation": rotation}},
        {"box": {"center": list(frame @ [*shift, up]), "size": other,
                 "rotation": Rotation.from_matrix(second).as_euler("xyz", degrees=True).tolist()}},
    ])  # fmt: skip
    alone, filled = unfilled(scene), scene.field()
    rng = np.random.default_rng(0)
    points = rng.uniform(-3, 3, (2000, 3)) + 0.5 * up * frame[:, 2] * rng.integers(0, 2)
    before, after = alone.distance(points), filled.distance(points)
    outside = before > 1e-3
    assert np.allclose(before[outside], after[outside], atol=1e-3)
    assert (after <= before + 1e-12).all()
    # half way between the two faces, where both are
    flat = np.column_stack(
        [rng.uniform(-1.5, 1.5, (2000, 2)), np.full(2000, 0.5 * (size[2] + gap))]
    )
    local = (flat[:, :2] - shift) @ turned((0, 0, twist))[:2, :2]
    rim = np.minimum(
        (0.5 * np.array(size[:2]) - np.abs(flat[:, :2])).min(1),
        (0.5 * np.array(other[:2]) - np.abs(local)).min(1),
    )
    edges_may_dip = 0.0125
    assert filled.distance(flat[rim > 0.15] @ frame.T).max(initial=-1.0) < -edges_may_dip


TOUCHING = {
    "a column on a floor": (
        {"cylinder": {"a": [0, 0, 0], "b": [0, 0, 3], "radius": 1.0}},
        {"half_space": {"point": [0, 0, 0]}},
    ),
    "two columns": (
        {"cylinder": {"a": [0, 0, 0], "b": [0, 0, 3], "radius": 1.0}},
        {"cylinder": {"a": [0.2, 0, 0], "b": [0.2, 0, -3], "radius": 1.2}},
    ),
    "a box on a wall": (
        {"prism": {"polygon": [[-9, 0], [-9, -2], [9, -2], [9, 0]]}},
        {"box": {"center": [0, 1, 0], "size": [2, 2, 2]}},
    ),
    "two prisms": (
        {"prism": {"polygon": [[-2, 0], [2, 0], [1, 3], [-1, 3]]}},
        {"prism": {"polygon": [[-3, 0], [3, 0], [3, -2], [-3, -2]]}},
    ),
}
INSIDE = {
    "a column on a floor": [[0, 0, 0], [0.7, 0, 0], [0, -0.8, 0]],
    "two columns": [[0, 0, 0], [0.7, 0, 0], [-0.7, 0, 0]],
    "a box on a wall": [[0, 0, 0], [0.7, 0, 0.7], [-0.7, 0, 0.7]],
    "two prisms": [[0, 0, 5], [0.7, 0, -5], [-1, 0, 1]],
}


@pytest.mark.parametrize("name", TOUCHING)
def test_other_flat_faces_leave_no_slit_either(name):
    scene = Scene(solids=list(TOUCHING[name]))
    assert unfilled(scene).distance(INSIDE[name]).max() == pytest.approx(0.0, abs=1e-9)
    assert scene.field().distance(INSIDE[name]).max() < -0.04
    points = np.random.default_rng(1).uniform(-4, 4, (4000, 3))
    before, after = unfilled(scene).distance(points), scene.field().distance(points)
    assert np.allclose(before[before > 0], after[before > 0], atol=1e-9)
    assert (after[before <= 0] <= 1e-12).all()


def test_solids_apart_or_deep_in_one_another_have_no_seam():
    apart = Scene(solids=[{"box": {"center": [0, 0, z], "size": [1, 1, 1]}} for z in (0, 1.01)])
    within = Scene(solids=[{"box": {"center": [0, 0, z], "size": [1, 1, 1]}} for z in (0, 0.7)])
    for scene in (apart, within):
        assert not seam_boxes([s.shape for s in scene.solids])


def test_a_tether_does_not_pass_between_a_keel_and_its_hull():
    """It is pulled up along the keel to the hull: there it has to stay."""
    scene = Scene(solids=[
        {"box": {"center": [0, 0, 1], "size": [6, 4, 2]}},
        {"box": {"center": [0, 0, -0.4], "size": [4, 0.4, 0.8]}},
    ])  # fmt: skip
    model = GeodesicTether(scene.field())
    tether = model.lay([(2.6, 0.6, -0.1), (2.6, -0.6, -0.1)])
    tether, _ = model.drive(tether, [(x, -0.6, -0.1) for x in np.arange(2.5, -1.0, -0.1)])
    about_the_keels_end = np.hypot(0.6, 0.8) + np.hypot(2.9, 0.4)
    assert tether.length == pytest.approx(about_the_keels_end, rel=1e-3)


def test_the_nearest_solid_is_never_what_fills_a_seam():
    scene = Scene(solids=list(TOUCHING["two columns"]))
    points = np.random.default_rng(2).uniform(-1, 1, (500, 3))
    assert set(scene.field().nearest(points).tolist()) <= {0, 1}


def test_a_field_with_seams_reads_back_as_it_was_written(tmp_path):
    field = Scene(solids=list(TOUCHING["two columns"])).field()
    field.save(tmp_path / "f.npz")
    back = DistanceField.load(tmp_path / "f.npz")
    points = np.random.default_rng(2).uniform(-1, 1, (500, 3))
    assert (back.nearest(points) == field.nearest(points)).all()
    assert (back.distance(points) == field.distance(points)).all()
