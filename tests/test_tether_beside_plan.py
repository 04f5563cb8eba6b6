"""A planner notices in time that the tether is longer than in its plan, and goes back at once."""

import numpy as np
import pytest

from netsp.world import GeodesicTether, Scene
from netsp.world.mission.mission import Mission
from netsp.world.planner import make_planner
from netsp.world.simulator.mission_run import mission_grid

POST = Scene(
    solids=[{"capsule": {"a": [0, 0, -6], "b": [0, 0, 6], "radius": 0.5}}],
    bounds=(-4, -4, -2, 4, 4, 2),
)
ANCHOR, START = (-2.0, 0.0, 0.0), (-2.0, 0.5, 0.0)
ROUND = [(-1.0, -1.5, 0.0), (1.0, -1.0, 0.0), (1.5, 0.5, 0.0)]
"""Corners of a path to (1.5, 0.5, 0) by the side of the post that is not planned."""


def beside_plan(limit):
    """Planner on its path from (-1, 1.5, 0) to (2, 2, 0), its tether model, and its first path."""
    mission = Mission(
        scene="-", anchor=ANCHOR, start=START, waypoints=[(2.0, 2.0, 0.0)],
        tether_length=limit, clearance=0.2, delta=0.1, speed=0.6,
    )  # fmt: skip
    field = POST.field()
    tethers, grid = GeodesicTether(field, mission.delta), mission_grid(mission, POST, field)
    planner = make_planner("predictive", mission, field, tethers, grid)
    planner.laid = tethers.start(ANCHOR, START)
    robot = np.array([-1.0, 1.5, 0.0])
    command = planner.step(robot, tethers.drive(planner.laid, [robot])[0])
    assert command.mode == "normal"
    return planner, tethers, command.path


def step_with_other_tether(planner, tethers):
    """Command of the next second at (1.5, 0.5, 0), with the tether on the other side of the post,
    and that tether."""
    tether = tethers.drive(planner.laid, ROUND)[0]
    planner.now = 1.0
    return planner.step(np.array(ROUND[-1]), tether), tether


def test_a_tether_that_is_over_the_limit_is_shortened_at_once():
    planner, tethers, _ = beside_plan(limit=5.0)
    planner.mission = planner.mission.model_copy(update={"tether_length": 3.7})
    command, tether = step_with_other_tether(planner, tethers)
    assert tether.length > 3.7
    assert command.mode == "recovery"
    after, lengths = tethers.drive(tether, command.path)
    assert after.length < 3.7
    assert lengths.max() <= tether.length + 1e-6


def test_a_path_is_planned_again_before_its_tether_is_too_long():
    planner, tethers, path = beside_plan(limit=4.8)
    command, tether = step_with_other_tether(planner, tethers)
    assert tether.length < 4.8
    assert tethers.drive(tether, path)[0].length > 4.8
    assert tethers.drive(tether, command.path)[1].max() <= 4.8


@pytest.mark.parametrize("limit", [6.0, 8.0])
def test_a_path_is_kept_while_its_tether_is_sure_to_fit(limit):
    planner, tethers, path = beside_plan(limit)
    command, _ = step_with_other_tether(planner, tethers)
    assert np.array_equal(command.path, path)
    assert command.replan_s == 0.0
