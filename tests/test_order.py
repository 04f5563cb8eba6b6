"""Orders of waypoints that keep the tether short."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from netsp.command.main import main
from netsp.online import Scene
from netsp.online.mission import Mission
from netsp.online.simulate import grid_of, simulate
from netsp.space.order import reorder, waypoint_graph

MISSIONS = Path(__file__).parent.parent / "missions"


@pytest.fixture
def rings(tmp_path):
    """Three turns about a post on a tether that allows no more than one."""
    solid = {"post": {"center": [0, 0], "radius": 0.5}}
    scene = {"schema_version": 1, "solids": [solid], "bounds": [-4, -4, -2, 4, 4, 2]}
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    angle = math.pi + np.arange(1, 37) * 2 * math.pi / 12
    height = np.linspace(-0.5, 0.5, 36)
    points = np.column_stack([1.2 * np.cos(angle), 1.2 * np.sin(angle), height]).round(3)
    mission = {
        "schema_version": 1, "scene": "scene.json", "anchor": [-2, 0, 0], "start": [-2, 0.5, 0],
        "waypoints": points.tolist(), "tether_length": 4.5,
    }  # fmt: skip
    file = tmp_path / "mission.json"
    file.write_text(json.dumps(mission))
    return file


def test_a_better_order_is_found_and_flown_before_it_is_believed(rings):
    mission = Mission.load(rings)
    found = reorder(mission, time_limit=5)
    assert sorted(found.order) == list(range(36))
    assert found.mission.waypoints == tuple(mission.waypoints[n] for n in found.order)
    again = simulate(found.mission, scene=Scene.load(rings.parent / "scene.json"))
    for run in (found.after, again):
        assert run.summary["exceedance_s"] == 0.0
        assert run.summary["visited"] == 36
    before, after = (r.summary["total_s"]["tether"] for r in (found.before, found.after))
    assert after < 0.8 * before
    assert again.summary["total_s"]["tether"] == pytest.approx(after)


def test_legs_never_cost_more_than_by_the_anchor_and_never_less_than_straight(rings):
    mission = Mission.load(rings)
    scene = mission.load_scene()
    field = scene.field()
    graph, points, reached = waypoint_graph(mission, field, grid_of(mission, scene, field))
    costs, home = graph.costs, graph.costs_to_base
    places = np.array([mission.anchor, *mission.places])
    assert len(reached) == 36
    for v in range(1, len(graph)):
        far = np.linalg.norm(places[points[v] + 1] - places[0])
        assert far - 1e-6 <= home[v] <= mission.tether_length
        for w in range(1, len(graph)):
            if points[v] != points[w]:
                straight = np.linalg.norm(places[points[v] + 1] - places[points[w] + 1])
                assert straight - 1e-6 <= costs[v, w] <= home[v] + home[w] + 1e-6


def test_the_order_is_written_as_a_mission_that_flies(rings, tmp_path, capsys):
    out = tmp_path / "elsewhere"
    out.mkdir()
    file = out / "better.json"
    assert main(["order", str(rings), "--time-limit", "3", "-o", str(file)]) == 0
    assert "new    inspection" in capsys.readouterr().err
    assert main(["simulate", str(file), "--quiet"]) == 0


def test_the_shipped_basin_mission_gets_a_fifth_faster():
    found = reorder(Mission.load(MISSIONS / "basin.json"), time_limit=5)
    before, after = (r.summary["total_s"]["tether"] for r in (found.before, found.after))
    assert after < 0.8 * before
    assert found.after.summary["exceedance_s"] == 0.0
