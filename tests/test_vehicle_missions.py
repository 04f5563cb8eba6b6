"""A BlueROV2 flies whole missions at any speed and in currents, as a kinematic robot does."""

from pathlib import Path

import pytest

from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import simulate

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
