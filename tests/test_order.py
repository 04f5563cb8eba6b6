"""Orders of waypoints that keep the tether short."""

import json
import math

import numpy as np
import pytest

from netsp.base.clock import Clock
from netsp.command.main import main
from netsp.plan.space.mission_solver import seconds_until_home, solve_mission, tour_of_flight
from netsp.plan.space.visit_order import order_by_going_on, waypoint_graph
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import mission_grid, simulate
from tests.worlds import FEW_CELLS


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
    found = solve_mission(mission, time_limit=40, policy=FEW_CELLS)
    assert sorted(found.order) == list(range(36))
    assert found.mission.waypoints == tuple(mission.waypoints[n] for n in found.order)
    again = simulate(found.mission, scene=Scene.load(rings.parent / "scene.json"))
    for run in (found.run, again):
        assert run.summary["exceedance_s"] == 0.0
        assert run.summary["visited"] == 36
    assert seconds_until_home(found.run) < 0.8 * seconds_until_home(found.given)
    assert seconds_until_home(again) == pytest.approx(seconds_until_home(found.run))


def test_legs_never_cost_more_than_by_the_anchor_and_never_less_than_straight(rings):
    mission = Mission.load(rings)
    scene = mission.load_scene()
    field = scene.field()
    graph, points, reached = waypoint_graph(mission, field, mission_grid(mission, scene, field))
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


def test_the_older_way_makes_a_tour_that_flies_as_it_did(rings):
    mission = Mission.load(rings)
    scene = mission.load_scene()
    field = scene.field()
    grid = mission_grid(mission, scene, field)
    order = order_by_going_on(mission, field, grid, clock=Clock(20.0))
    there = mission.model_copy(update={"waypoints": tuple(mission.waypoints[n] for n in order)})
    run = simulate(there, scene=scene, field=field)
    kept = tour_of_flight(there, order, run, there.load_scene().field())
    assert kept is not None
    again = simulate(kept.mission, scene=scene, field=field)
    assert again.summary["visited"] == 36
    assert again.summary["home"]["tether_free"]
    assert seconds_until_home(again) <= seconds_until_home(run) + 1.0
    for stop, flown in zip(kept.tour.stops, run.summary["stops"], strict=True):
        assert stop.tether_length == flown["tether"]
        assert stop.longest_tether >= flown["tether"] - 1e-9


def test_a_flight_that_does_not_end_free_makes_no_tour(rings):
    mission = Mission.load(rings)
    run = simulate(mission, "none")
    assert run.summary["exceedance_s"] > 0.0
    assert tour_of_flight(mission, tuple(range(36)), run, mission.load_scene().field()) is None


def test_the_order_is_written_as_a_mission_that_flies(rings, tmp_path, capsys):
    out = tmp_path / "elsewhere"
    out.mkdir()
    file = out / "better.json"
    assert main(["order", str(rings), "--time-limit", "20", "-o", str(file)]) == 0
    assert "flown " in capsys.readouterr().err
    assert main(["simulate", str(file), "--quiet"]) == 0
