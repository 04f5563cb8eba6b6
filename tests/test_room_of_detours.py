"""Paths keep out of solids as long as any other path leads on."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.geometry import polylines
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.planner import PlannerOptions
from netsp.world.planner.planner_policy import PlannerPolicy, PreviewPolicy
from netsp.world.planner.preview import TetherPreview
from netsp.world.simulator.mission_run import simulate
from netsp.world.tether import GeodesicTether

CROSSED = Scene(
    solids=[
        {"capsule": {"a": [-0.67, 1.658, 0.362], "b": [0.852, -1.133, -0.001], "radius": 0.15}},
        {"capsule": {"a": [0.048, -0.956, 1.132], "b": [-0.24, 1.145, -1.265], "radius": 0.15}},
    ],
    bounds=(-3, -3, -3, 3, 3, 3),
)
"""Two bars that cross a few centimetres apart: a tether lies between them, a robot hardly."""

ABOUT = Mission(
    scene="-", anchor=(2.5, 2.5, 2.5), start=(2.3, 2.4, 2.4), tether_length=9.52, clearance=0.25,
    waypoints=[
        (-1.49, 0.75, 0.96), (-0.09, -1.49, -0.64), (0.45, -0.5, 1.06), (0.13, 0.57, 0.84),
        (-0.8, -1.39, -0.66), (-0.22, -0.91, -1.49), (1.01, -1.28, -1.28),
    ],
    speed=0.5, delta=0.1, reach=0.1,
)  # fmt: skip


def room_of_flight(max_cut):
    """Return the smallest distance to the solids of a flight, and its summary."""
    options = PlannerOptions(policy=PlannerPolicy(preview=PreviewPolicy(max_cut=max_cut)))
    run = simulate(ABOUT, "predictive", scene=CROSSED, options=options)
    places = np.array([[row.x, row.y, row.z] for row in run.log])
    return float(CROSSED.field().distance(places).min()), run.summary


def test_a_robot_goes_back_between_bars_without_cutting_into_them():
    """Also with a tolerance by which a path between the bars would do: it goes home along its own
    path."""
    for max_cut in (PreviewPolicy().max_cut, 0.2):
        room, summary = room_of_flight(max_cut)
        assert room > 0.1
        assert summary["visited"] == len(ABOUT.waypoints)
        assert summary["home"]["tether_free"]


corner = st.tuples(*[st.floats(-1.5, 1.5)] * 3)


@settings(max_examples=40, deadline=None)
@given(
    path=st.lists(corner, min_size=2, max_size=4, unique=True), depth=st.sampled_from([0.001, 0.02])
)
def test_a_path_that_is_too_deep_in_a_solid_anywhere_is_found(path, depth):
    line, field = np.array(path), CROSSED.field()
    preview = TetherPreview(ABOUT, GeodesicTether(field, 0.1), None, None, 0.0, max_depth=depth)
    deepest = -float(field.distance(polylines.dense(line, 1e-3)).min())
    begin = -float(field.distance(line[0]))
    if deepest > 1.52 * max(depth, 1.01 * begin):
        assert preview.meets_solid(line)
    elif deepest < 0.99 * depth:
        assert not preview.meets_solid(line)
