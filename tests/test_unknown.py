"""What is not on the map is seen in time: no contact, never too little tether, and home free."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError
from netsp.base.errors import is_interrupt
from netsp.command.main import main
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import describe_run
from netsp.world.scene.scene import Solid
from netsp.world.simulator.mission_run import simulate
from netsp.world.simulator.ranging import Ranging, cast_rays, ray_fan
from netsp.world.simulator.surprises import SceneSurprises, moved_solid, solids_after
from netsp.world.simulator.surroundings import Surroundings

ROOT = Path(__file__).parent.parent
PILES = Scene(
    solids=[
        {"name": f"pile {x} {y}", "post": {"center": [x, y], "radius": 0.5}}
        for x in (0, 6, 12) for y in (-3, 0, 3)
    ],
    bounds=(-6, -8, -6, 18, 8, 2),
)  # fmt: skip
AMONG = [(3, 1.5, -2), (9, 1.5, -3), (14, -1.5, -2), (3, -1.5, -1)]
IN_THE_WAY = [
    {"time": 0, "appear": {"name": "a", "post": {"center": [3, 0], "radius": 0.4}}},
    {"time": 0, "appear": {"capsule": {"a": [6, 1.5, -6], "b": [9, 3, 0], "radius": 0.3}}},
    {"time": 30, "appear": {"box": {"center": [10, -1, -2], "size": [1, 1, 3]}}},
]


def fly(events, sensor=None, planner="predictive", vehicle="kinematic", seed=0, **more):
    mission = Mission(
        scene="-", anchor=(-3, -6, 0), start=(-3, -5, 0), range_sensor=sensor,
        **{"waypoints": AMONG, "tether_length": 18.0, "speed": 0.5, **more},
    )  # fmt: skip
    return simulate(
        mission, planner, vehicle=vehicle, scene=PILES, seed=seed,
        surprises=SceneSurprises(events=events),
    )  # fmt: skip


def kept(run):
    s = run.summary
    return (
        s["exceedance_s"] == 0.0 and not s["contacts"] and not s["defects"]
        and s["home"]["tether_free"]
    )  # fmt: skip


@given(st.floats(1.0, 180.0), st.floats(0, 7), st.tuples(*[st.floats(-1, 1)] * 3))
def test_rays_fill_the_cone_and_none_leaves_it(angle, turn, ahead):
    ahead = np.array(ahead) + np.array([0.0, 0.0, 2.0])
    rays = ray_fan(angle, ahead, turn, 240)
    assert np.allclose(np.linalg.norm(rays, axis=1), 1.0)
    cosine = rays @ ahead / np.linalg.norm(ahead)
    assert cosine.min() >= math.cos(math.radians(0.5 * angle)) - 1e-9
    # half of the rays in half of the cap's area
    half = 0.5 * (1.0 + math.cos(math.radians(0.5 * angle)))
    assert (cosine > half).mean() == pytest.approx(0.5, abs=0.02)


def test_a_ray_measures_the_distance_to_a_ball():
    field = Scene(solids=[{"sphere": {"center": [4, 0, 0], "radius": 1}}]).field()
    rays = np.array([[1, 0, 0], [0, 1, 0], [math.cos(0.2), math.sin(0.2), 0]], dtype=float)
    found = cast_rays(field.arrays, np.zeros(3), rays, 10.0)
    assert found[0] == pytest.approx(3.0, abs=2e-3)
    assert math.isinf(found[1])
    near = 4 * math.cos(0.2) - math.sqrt(1 - (4 * math.sin(0.2)) ** 2)
    assert found[2] == pytest.approx(near, abs=5e-3)
    assert math.isinf(cast_rays(field.arrays, np.zeros(3), rays, 2.5)[0])


@pytest.mark.parametrize("sensor", [None, {}, {"noise": 0.05, "range": 4, "field_of_view": 60}])
def test_solids_that_are_not_on_the_map_are_neither_met_nor_wound_about(sensor):
    run = fly(IN_THE_WAY, sensor)
    assert kept(run)
    assert run.summary["visited"] == len(AMONG)
    assert run.summary["surprises"]["happened"] == 3
    if sensor is not None:
        assert run.summary["surprises"]["found"] >= 2
        assert "sensor found" in describe_run(run, "m")


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10**6))
def test_whatever_stands_in_the_way_there_is_no_contact_and_tether_enough(seed):
    rng = np.random.default_rng(seed)
    events = []
    for _ in range(4):
        x, y = rng.uniform((1, -5), (15, 5))
        solid = {"capsule": {"a": [x, y, -6], "b": [x + 1, y - 1, 2], "radius": 0.3}}
        events.append({"time": float(rng.choice([0, 20, 60])), "appear": solid})
    run = fly(events, {"noise": float(rng.choice([0, 0.03]))}, seed=seed)
    assert kept(run)


def test_without_its_sensor_the_robot_would_run_into_them(monkeypatch):
    ahead = [{"time": 0, "appear": {"post": {"center": [1.4, -0.25], "radius": 0.2}}}]
    assert kept(fly(ahead, {}))
    monkeypatch.setattr(Surroundings, "_look", lambda *_: False)
    assert fly(ahead, {}).summary["contacts"] > 0


def test_the_dynamic_vehicle_keeps_off_them_too():
    run = fly(IN_THE_WAY, {}, vehicle="bluerov2", current=(0.1, 0.1, 0.0))
    assert kept(run)
    assert run.summary["visited"] == len(AMONG)


def test_what_has_gone_or_moved_comes_off_the_map():
    events = [
        {"time": 0, "vanish": "pile 0 -3"},
        {"time": 40, "move": {"solid": "pile 6 3", "by": [0.5, -0.8, 0]}},
    ]
    maps = []
    update_planner = Surroundings._update_planner

    def spy(self, *args):
        maps.append({s.name for s in self.mapped})
        return update_planner(self, *args)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Surroundings, "_update_planner", spy)
        run = fly(events, {})
    assert kept(run)
    assert "pile 0 -3" not in maps[-1]
    assert all(len(m) >= 7 for m in maps)  # nothing else was taken off for long


def test_a_solid_waits_until_there_is_room_for_it():
    on_the_tether = {"post": {"center": [-3, -5.5], "radius": 0.3}}
    run = fly([{"time": 0, "appear": on_the_tether}], {}, waypoints=[(-2.5, -5, 0)])
    counts = {"happened": 0, "held_back": 1, "found": 0, "events": []}
    assert run.summary["surprises"] == counts
    assert "had no room" in describe_run(run, "m")


ON_A_WAYPOINT = {"name": "crate", "box": {"center": [3, 1.5, -2], "size": [1, 1, 1]}}


@pytest.mark.parametrize(
    "change",
    [{"vanish": "crate"}, {"move": {"solid": "crate", "by": [0, 0, -3]}}],
    ids=["vanishes", "moves"],
)
def test_a_waypoint_is_visited_once_nothing_stands_on_it_any_more(change):
    events = [{"time": 0, "appear": ON_A_WAYPOINT}, {"time": 25, **change}]
    run = fly(events, tether_length=30.0)
    assert run.summary["visited"] == run.summary["waypoints"] == len(AMONG)
    assert run.summary["left_out"] == []
    assert any(math.dist((r.x, r.y, r.z), AMONG[0]) <= run.mission.reach for r in run.log)
    assert [e["number"] for e in run.summary["surprises"]["events"]] == [0, 1]
    assert run.summary["surprises"]["events"][1]["time"] == pytest.approx(25.0, abs=0.2)


def test_a_waypoint_is_tried_again_with_a_longer_tether():
    # 14 m are too short for two waypoints, 20 m are not
    run = fly([{"time": 20, "tether_length": 20.0}], tether_length=14.0)
    short = fly([], tether_length=14.0)
    assert [left["waypoint"] for left in short.summary["left_out"]] == [1, 2]
    assert run.summary["visited"] == run.summary["waypoints"] == len(AMONG)
    assert kept(run)


def test_a_waypoint_that_was_cancelled_is_not_tried_again():
    events = [
        {"time": 0, "appear": ON_A_WAYPOINT},
        {"time": 25, "vanish": "crate"},
        {"time": 26, "cancel_waypoint": 0},
    ]
    run = fly(events, tether_length=30.0)
    assert run.summary["visited"] == 3
    assert all(math.dist((r.x, r.y, r.z), AMONG[0]) > run.mission.reach for r in run.log)


@pytest.mark.parametrize(
    ("place", "track"),
    [((-3, -6, 0), []), ((-3, -5, 0), []), ((5, -6, 0), [(60, 10, -6, 0)])],
    ids=["anchor", "home", "the anchor's way"],
)
def test_nothing_appears_on_anchor_or_home_or_in_the_anchors_way(place, track):
    ball = {"sphere": {"center": place, "radius": 0.4}}
    run = fly([{"time": 2, "appear": ball}], track=track, waypoints=[(0, -4.5, -1)])
    assert kept(run)
    assert run.summary["surprises"]["held_back"] == 1


def test_a_solid_with_a_name_is_on_the_map_once_however_often_it_moves():
    moves = [
        {"time": t, "move": {"solid": "pile 6 0", "by": [0.05 * (-1) ** t, 0, 0]}}
        for t in range(1, 40)
    ]
    run = fly(moves, {})
    assert kept(run)
    assert run.summary["surprises"]["found"] <= 1


def test_a_scene_may_become_empty_and_is_drawn(tmp_path):
    post = {"name": "p", "post": {"center": [0, 0], "radius": 1}}
    mission = {
        "schema_version": 1, "scene": "scene.json", "anchor": [-3, 0, 0], "start": [-3, 1, 0],
        "waypoints": [[3, 0, 0]], "tether_length": 9,
    }  # fmt: skip
    files = {
        "scene": {"schema_version": 1, "solids": [post]},
        "m": mission,
        "s": {"schema_version": 1, "events": [{"time": 3, "vanish": "p"}]},
    }
    for name, data in files.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(data))
    out = tmp_path / "run"
    args = [str(tmp_path / "m.json"), "--surprise", str(tmp_path / "s.json"), "-o", str(out)]
    assert main(["simulate", *args, "--quiet"]) == 0
    assert (out / "run.png").stat().st_size > 10_000


def test_an_interrupt_that_python_calls_a_system_error_is_one():
    error = SystemError("returned a result with an exception set")
    assert not is_interrupt(error)
    error.__cause__ = KeyboardInterrupt()
    assert is_interrupt(error)
    assert is_interrupt(KeyboardInterrupt())
    assert not is_interrupt(ValueError())

    def stop(row, planner):
        if row.time > 3.0:
            raise error

    mission = Mission(
        scene="-", anchor=(-3, -6, 0), start=(-3, -5, 0), waypoints=AMONG, tether_length=18
    )
    assert simulate(mission, scene=PILES, on_step=stop).summary["status"] == "interrupted"


def test_a_ship_over_unknown_ground():
    run = fly(IN_THE_WAY, {}, track=[(60, 14, -6, 0), (160, -3, -6, 0)], tether_length=12.0)
    assert kept(run)


def test_noise_is_of_the_sensors_deviation():
    field = PILES.field()
    looks = Ranging(Mission(
        scene="-", anchor=(0, 0, 0), start=(0, 0, 0), waypoints=[(1, 1, 1)], tether_length=1,
        range_sensor={"noise": 0.1, "range": 20},
    ).range_sensor, 3)  # fmt: skip
    rays, ranges, off = looks.look(field, np.array([-3.0, -6.0, 0.0]), np.array([1.0, 1.0, 0.0]))
    met = np.isfinite(ranges)
    assert met.sum() > 20
    points = np.array([-3.0, -6.0, 0.0]) + rays[met] * (ranges - off)[met, None]
    assert np.abs(field.distance(points)).max() < 5e-3
    assert off.std() == pytest.approx(0.1, rel=0.2)


@given(st.sampled_from(range(8)), st.tuples(*[st.floats(-5, 5)] * 3))
def test_a_moved_solid_is_the_same_one_elsewhere(kind, by):
    solid = Solid.model_validate([
        {"sphere": {"center": [1, 2, 3], "radius": 1}},
        {"capsule": {"a": [0, 0, 0], "b": [1, 1, 1], "radius": 0.5}},
        {"cylinder": {"a": [0, 0, 0], "b": [1, 1, 1], "radius": 0.5}},
        {"box": {"center": [1, 0, 0], "size": [1, 2, 3], "rotation": [10, 20, 30]}},
        {"torus": {"center": [0, 1, 0], "major_radius": 2, "minor_radius": 0.3}},
        {"post": {"center": [1, 1], "radius": 0.4}},
        {"prism": {"polygon": [[0, 0], [2, 0], [1, 3]]}},
        {"half_space": {"point": [0, 0, -3], "normal": [0, 0.1, 1]}},
    ][kind])  # fmt: skip
    points = np.random.default_rng(kind).uniform(-4, 4, (20, 3))
    here, there = Scene(solids=[solid]).field(), Scene(solids=[moved_solid(solid, by)]).field()
    assert np.allclose(here.distance(points), there.distance(points + np.array(by)), atol=1e-9)


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ({"time": 0, "vanish": "crane"}, "vanish: no solid is named 'crane'; there are 'pile 0"),
        ({"time": 0, "move": {"solid": "x", "by": [1, 0, 0]}}, "move.solid: no solid is named 'x'"),
        (
            {"time": 0, "appear": {"name": "pile 0 0", "post": {"center": [1, 1], "radius": 1}}},
            "appear: a solid is named 'pile 0 0' already",
        ),
        (
            {"time": 0},
            "expected one of appear, vanish, move, add_waypoint, cancel_waypoint, push, "
            "tether_length, got none",
        ),
        ({"time": -1, "vanish": "a"}, "time: expected a number >= 0"),
        ({"time": 0, "appear": {"post": {"center": [1, 1], "radius": -1}}}, "radius: expected"),
    ],
)
def test_bad_surprises_are_told_in_one_line(event, message, tmp_path, capsys):
    (tmp_path / "scene.json").write_text(json.dumps(PILES.model_dump(mode="json")))
    mission = {
        "schema_version": 1, "scene": "scene.json", "anchor": [-3, -6, 0], "start": [-3, -5, 0],
        "waypoints": [[3, 1.5, -2]], "tether_length": 18,
    }  # fmt: skip
    (tmp_path / "m.json").write_text(json.dumps(mission))
    (tmp_path / "s.json").write_text(json.dumps({"schema_version": 1, "events": [event]}))
    args = ["simulate", str(tmp_path / "m.json"), "--surprise", str(tmp_path / "s.json")]
    assert main(args) == 2
    error = capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1
    assert message in error


def test_only_the_geodesic_model_takes_another_map():
    mission = Mission(
        scene="-", anchor=(-3, -6, 0), start=(-3, -5, 0), waypoints=AMONG, tether_length=18
    )
    with pytest.raises(InputError, match="surprises: tether model 'react' has one map only"):
        simulate(mission, "react", tether="react", scene=PILES, surprises=SceneSurprises(events=[]))


def test_the_example_is_flown_and_drawn(tmp_path, capsys):
    mission = json.loads((ROOT / "missions" / "ship.json").read_text())
    mission["scene"] = str(ROOT / "scenes" / "jetty.json")
    mission["range_sensor"] = {"noise": 0.02}
    mission["waypoints"] = mission["waypoints"][:4]
    (tmp_path / "m.json").write_text(json.dumps(mission))
    surprises = ROOT / "examples" / "jetty-surprises.json"
    out = tmp_path / "run"
    args = ["simulate", str(tmp_path / "m.json"), "--surprise", str(surprises), "-o", str(out)]
    assert main([*args, "--quiet"]) == 0
    assert (out / "run.png").stat().st_size > 10_000
    assert json.loads((out / "summary.json").read_text())["contacts"] == 0
    solids = Scene.load(ROOT / "scenes" / "jetty.json").all_solids()
    for event in SceneSurprises.load(surprises).by_time():
        solids = solids_after(solids, event)
    assert "container" in {s.name for s in solids}
