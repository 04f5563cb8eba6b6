"""A BlueROV2 flies whole missions at any speed and in currents, as a kinematic robot does."""

import sys
from pathlib import Path

import numpy as np
import pytest

from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import simulate

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import currents

COMB = Path(__file__).parent / "data" / "comb-tight.json"


@pytest.mark.parametrize(
    ("speed", "current"), [(1.0, (0.0, 0.0, 0.0)), (0.8, (0.2, 0.2, 0.1)), (0.5, (0.0, 0.0, 0.3))]
)
def test_all_are_visited_between_plates_at_any_speed_in_any_current(speed, current):
    """Over plates and down behind them, with 23.9 m of tether; the fourth waypoint was given up."""
    comb = Mission.load(COMB)
    changes = {"speed": speed, "current": current, "camera": None, "waypoints": comb.waypoints[:4]}
    summary = simulate(comb.model_copy(update=changes), vehicle="bluerov2").summary
    assert summary["visited"] == 4
    assert summary["stalls"] == []
    assert summary["contacts"] == 0
    assert summary["home"]["reached"]
    assert summary["home"]["tether_free"]
    assert summary["exceedance_s"] == 0.0


def test_the_way_home_is_not_through_a_gap_that_only_the_tether_fits_through():
    """Where leaning poles cross, the tether lay in a gap, 0.05 m from each pole, and the path
    back along it led the vehicle into a pole; the way that it came has room."""
    mission, scene = currents.mission_of("poles 1")
    mission = mission.model_copy(update={"speed": 0.8})
    run = simulate(mission, vehicle="bluerov2", scene=scene)
    places = np.array([(r.x, r.y, r.z) for r in run.log])
    assert run.summary["home"]["reached"]
    assert run.summary["home"]["tether_free"]
    assert run.summary["contacts"] == 0
    assert scene.field().distance(places).min() > 0.1
