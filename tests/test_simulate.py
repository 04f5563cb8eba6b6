"""A mission is flown within its tether, and what cannot be reached is said, not softened."""

import csv
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import lil_array
from scipy.sparse.csgraph import dijkstra

from netsp import InputError
from netsp.base.geometry import polylines
from netsp.command.main import main
from netsp.world import Scene
from netsp.world.mission.equipment import PositionSensor
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import describe_run
from netsp.world.paths.path_policy import PathPolicy
from netsp.world.paths.tree import STEPS, Grid, ShortestTree, grow, pull_taut, states_of, tree_path
from netsp.world.planner import PLANNERS, PlannerOptions
from netsp.world.planner.predictive import PredictivePlanner
from netsp.world.scene.field import pushed_out
from netsp.world.simulator.mission_run import simulate
from netsp.world.simulator.sensing import Positions
from netsp.world.vehicle.kinematic import advance_along
from tests.pages import unpacked
from tests.posts_and_rings import POST, ring

MISSIONS = Path(__file__).parent.parent / "missions"


def mission(waypoints, length, **more):
    return Mission(
        scene="-", anchor=(-2, 0, 0), waypoints=waypoints, tether_length=length,
        **{"start": (-2, 0.5, 0), "clearance": 0.2, "delta": 0.1, **more},
    )  # fmt: skip


def fly(planner, waypoints, length, **more):
    return simulate(mission(waypoints, length, **more), planner, scene=POST)


def test_without_a_planner_the_tether_winds_up():
    run = fly("none", ring(3), 5.0)
    assert run.summary["longest_tether"] > 8.0
    assert run.summary["exceedance_s"] > 10.0


@pytest.mark.parametrize("length", [3.6, 4.5, 6.0])
def test_the_predictive_planner_visits_all_and_never_exceeds_the_tether(length):
    """Three turns about a post, whose far side is 3.4 m of tether away."""
    run = fly("predictive", ring(3), length)
    assert run.summary["visited"] == run.summary["waypoints"]
    assert run.summary["longest_tether"] <= length
    assert run.summary["exceedance_s"] == 0.0
    places = np.array([[r.x, r.y, r.z] for r in run.log])
    assert POST.field().distance(places).min() > 0.15  # clearance, but for its corners


@settings(max_examples=300, deadline=None)
@given(
    saved=st.lists(st.floats(0.0, 0.2), min_size=1, max_size=20),
    fitting=st.integers(-1, 20), looks=st.integers(1, 8), metres=st.floats(1.0, 100.0),
)  # fmt: skip
def test_the_tautest_path_is_sought_until_little_is_to_be_saved_or_enough_was_looked(
    saved, fitting, looks, metres
):
    """Of ever shorter paths of which the first fit only. What is taken fits; where one fits and is
    not the best by more than its share, the budget was spent."""
    lengths = 10.0 * np.cumprod(1.0 - np.array(saved))
    paths = [np.array([[0.0, 0, 0], [x, 0, 0]]) for x in lengths]
    planner = object.__new__(PredictivePlanner)
    planner.options = PlannerOptions(looks=looks, metres=metres)
    planner._preview_count, planner._previewed_length = 0, 0.0
    planner._pull_in_stages = lambda _: iter(paths)

    that_fit = lengths[: fitting + 1]
    found = []

    def fits(_, path, limit):
        assert not (
            found and (planner._preview_count >= looks or planner._previewed_length >= metres)
        )
        planner._preview_count, planner._previewed_length = (
            planner._preview_count + 1,
            planner._previewed_length + path[1, 0],
        )
        found.extend(that_fit[that_fit == path[1, 0]])
        return path[1, 0] in that_fit

    planner._fits = fits
    taken = planner._tautest(None, None, 0.0)
    if taken is None:
        assert not len(that_fit)
    else:
        assert taken[1, 0] in that_fit
        assert (
            planner._has_previewed_enough
            or taken[1, 0] * (1.0 - planner.predictive.min_saving) <= that_fit.min() + 1e-9
        )


def test_what_the_tether_cannot_reach_is_left_out_with_the_reason():
    run = fly("predictive", [(-2, 1.0, 0), (3.5, 0, 0), (-1, 1, 0)], 4.0)
    assert run.summary["visited"] == 2
    (left,) = run.summary["left_out"]
    assert left["waypoint"] == 1
    assert "5.6" in left["reason"]
    assert run.summary["exceedance_s"] == 0.0


def test_the_papers_planner_exceeds_the_tether_before_it_turns():
    run = fly("react", ring(3), 5.0)
    assert run.summary["visited"] == run.summary["waypoints"]
    assert 0.0 < run.summary["exceedance_s"] < 20.0
    assert run.summary["longest_tether"] < 5.3


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_ends_and_the_log_is_continuous(planner):
    run = fly(planner, ring(1.5, steps=8), 5.0)
    assert run.summary["status"] == "done"
    places = np.array([[r.x, r.y, r.z] for r in run.log])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert steps.max() <= 0.03 + 1e-9  # 0.3 m/s for 0.1 s
    times = [r.time for r in run.log]
    assert np.allclose(np.diff(times), 0.1)


points = st.tuples(st.floats(-3.5, 3.5), st.floats(-3.5, 3.5), st.floats(-0.8, 0.8))


@settings(max_examples=10, deadline=None)
@given(waypoints=st.lists(points, min_size=1, max_size=6), length=st.floats(3.0, 9.0))
def test_no_waypoints_make_the_predictive_planner_exceed(waypoints, length):
    field = POST.field()
    moved = pushed_out(field, np.array(waypoints), 0.25)
    run = fly("predictive", [tuple(map(float, p)) for p in moved], length)
    assert run.summary["exceedance_s"] == 0.0
    assert run.summary["visited"] + len(run.summary["left_out"]) == len(waypoints)


def test_ways_of_the_tree_are_shortest_and_pull_taut_to_the_truth():
    field = POST.field()
    grid = Grid(field, (-4, -4, -1), (4, 4, 1), 0.1, 0.0)
    tree = ShortestTree(grid, (2, 0.05, 0), [(-2, 0.05, 0), (2, 1, 0)])
    straight = 0.95
    length = polylines.length(tree.path(1))
    assert straight <= length <= straight + 0.3  # ends lie beside the centres of cells
    path = pull_taut(field, tree.path(0), 0.0, 0.05)
    exact = 2 * math.sqrt(4 - 0.25) + 0.5 * (math.pi - 2 * math.acos(0.25))
    assert polylines.length(path) == pytest.approx(exact, rel=0.02)
    assert polylines.length(tree.path(0)) >= polylines.length(path)


class Blind(PredictivePlanner):
    """Finds classes, but never a path."""

    def _shortest_feasible(self, robot, tether, limit):
        return None, super()._shortest_feasible(robot, tether, limit)[1]

    def _straight(self, robot, tether, limit):
        return None


def test_where_no_path_is_found_the_way_by_the_anchor_is_as_good_as_a_proof():
    goals = ring(1.0)
    run = fly(Blind, goals, 3.6)
    assert run.summary["visited"] == len(goals)
    assert run.summary["exceedance_s"] == 0.0
    assert run.summary["home"]["tether_free"]


def test_a_waypoint_is_left_out_with_the_length_of_its_shortest_tether():
    """Behind the post: two straight pieces and an arc."""
    run = fly("predictive", [(2, 0, 0), (-1, 1, 0)], 3.9)
    exact = 2 * math.sqrt(4 - 0.25) + 0.5 * (math.pi - 2 * math.acos(0.25))
    (left,) = run.summary["left_out"]
    assert left["waypoint"] == 0
    told = re.match(
        r"out of reach: it needs ([\d.]+) m of tether, the limit is 3.9", left["reason"]
    )
    assert float(told[1]) == pytest.approx(exact, abs=0.01)


def test_trees_that_are_kept_lead_as_those_that_are_grown_whatever_comes_and_goes():
    goal, points = (2.0, 0.05, 0.0), [(-2, 0.05, 0), (2, 1, 0), (0.1, -1.5, 0.3)]
    box = np.array([[-0.6, -0.6, -1.1], [0.6, 0.6, 1.1]])
    elsewhere = Scene(solids=[{"post": {"center": [99, 99], "radius": 0.5}}])
    empty, far = elsewhere.field(), np.full((2, 3), 3.0)
    for first, second, where in ((empty, POST.field(), box), (POST.field(), empty, box),
                                 (POST.field(), POST.field(), far)):  # fmt: skip
        kept = Grid(first, (-4, -4, -1), (4, 4, 1), 0.1, 0.0)
        assert kept.prepare([goal]) == 1
        for grid, field in ((kept, first), (kept.with_changed_box(second, where), second)):
            fresh = Grid(field, (-4, -4, -1), (4, 4, 1), 0.1, 0.0)
            tree, other = (ShortestTree(g, goal, points) for g in (grid, fresh))
            for n in range(len(points)):
                a, b = tree.path(n), other.path(n)
                assert field.distance(a).min() >= 0.0
                assert polylines.length(a) == pytest.approx(polylines.length(b))


def test_no_more_trees_are_kept_than_go_into_the_memory():
    policy = PathPolicy(max_tree_bytes=2 * 80 * 80 * 20)
    grid = Grid(POST.field(), (-4, -4, -1), (4, 4, 1), 0.1, 0.0, policy)
    goals = [(2.0, 0.05 * k, 0.0) for k in range(1, 20, 4)]
    assert grid.free.size == 80 * 80 * 20
    assert grid.prepare(goals) == 2


def test_advance_passes_corners_and_stops_after_its_step():
    path = np.array([[1.0, 0, 0], [1.0, 1.0, 0]])
    stops, passed = advance_along(np.zeros(3), path, 1.25)
    assert passed == 1
    assert np.allclose(stops, [[1, 0, 0], [1, 0.25, 0]])


def test_waypoints_inside_solids_are_named_or_moved_out():
    inside = [(-2, 1, 0), (0.1, 0, 0), (0, 0.2, 0)]
    with pytest.raises(InputError, match="waypoints #1, #2 lie inside"):
        fly("predictive", inside, 6.0)
    run = simulate(mission(inside, 6.0), scene=POST, snap=True)
    assert run.summary["visited"] == 3


def test_an_interrupted_run_gives_what_it_has():
    def stop(row, planner):
        if row.time >= 1.0:
            raise KeyboardInterrupt

    run = simulate(mission(ring(3), 6.0), scene=POST, on_step=stop)
    assert run.summary["status"] == "interrupted"
    assert 5 < len(run.log) < 20


def test_simulate_writes_log_summary_and_picture(tmp_path, capsys):
    out, file = tmp_path / "run", few_of_the_basin(tmp_path, 12)
    assert main(["simulate", str(file), "-o", str(out), "--quiet"]) == 0
    summary = json.loads((out / "summary.json").read_text())
    with (out / "log.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert summary["exceedance_s"] == 0.0
    assert summary["visited"] == summary["waypoints"] == 12
    assert max(float(r["tether"]) for r in rows) == pytest.approx(
        summary["longest_tether"], abs=1e-4
    )
    assert (out / "run.png").stat().st_size > 10_000
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("args", "change", "message"),
    [
        (["--planner", "magic"], {}, "planner: unknown 'magic'; expected one of predictive"),
        (["--tether", "0.1"], {}, "tether_length: 0.1 is shorter"),
        ([], {"scene": "missing.json"}, "missing.json: cannot be read"),
        ([], {"waypoints": []}, "waypoints"),
        ([], {"anchor": [0, 0, -4]}, "anchor: .* inside a solid"),
        ([], {"rope": 3}, "rope: unknown field"),
        ([], {"tether": 3}, "tether: expected an object, got 3"),
        ([], {"sensor": {"noise": -1}}, "sensor.noise: expected a number >= 0, got -1"),
        ([], {"current": [9, 0, 0], "tether": {"diameter": 0.01}}, "current: 9 m/s pulls on"),
        ([], {"sensor": {"delay": 60}}, "sensor: noise 0 and delay 60 ask for 18.8 m of tether"),
        (
            [],
            {"waypoints": [{"position": [0, 0, 0], "stay": 3}]},
            r"waypoints\[0\].stay: unknown field$",
        ),
    ],
)
def test_bad_missions_are_named(args, change, message, tmp_path, capsys):
    data = json.loads((MISSIONS / "basin.json").read_text())
    data["scene"] = str(MISSIONS.parent / "scenes" / "basin.json")
    (tmp_path / "m.json").write_text(json.dumps({**data, **change}))
    assert main(["simulate", str(tmp_path / "m.json"), *args]) == 2
    error = capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1
    import re

    assert re.search(message, error)


class Broken(PLANNERS["none"]):
    """A planner that fails at its second waypoint."""

    def plan(self, robot, tether):
        if self.index == 1:
            raise ZeroDivisionError("of all things")
        return super().plan(robot, tether)


def test_a_planner_that_fails_holds_says_so_and_goes_on(monkeypatch):
    monkeypatch.setitem(PLANNERS, "none", Broken)
    run = fly("none", [(-2, 1, 0), (-2, 1.5, 0), (-2, 2, 0)], 9.0)
    assert [r.mode for r in run.log].count("hold") >= 10
    assert run.summary["visited"] == 2
    assert "ZeroDivisionError: of all things" in run.summary["left_out"][0]["reason"]
    assert run.summary["defects"] >= 10


def few_of_the_basin(folder, waypoints):
    """A mission file with the first waypoints of the basin."""
    data = json.loads((MISSIONS / "basin.json").read_text())
    data |= {"scene": str(MISSIONS / data["scene"]), "waypoints": data["waypoints"][:waypoints]}
    (folder / "basin.json").write_text(json.dumps(data))
    return folder / "basin.json"


def test_a_defect_of_planning_makes_the_command_fail(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(PLANNERS, "none", Broken)
    place = few_of_the_basin(tmp_path, 8)
    assert main(["simulate", str(place), "--planner", "none", "-o", str(tmp_path / "run")]) == 1
    assert "defect" in capsys.readouterr().err


@pytest.mark.parametrize("planner", ["predictive", "react"])
def test_a_dynamic_vehicle_in_a_current_keeps_the_tether_too(planner):
    stormy = mission(
        ring(0.9), 4.5, current=(0.08, 0.04, 0.0), gusts=0.04, camera={"range": 2.0, "patch": 0.2}
    )
    run, again = (
        simulate(stormy, planner, vehicle="bluerov2", scene=POST, seed=2) for _ in range(2)
    )
    assert [r.tether for r in run.log] == [r.tether for r in again.log]
    assert run.summary["visited"] == len(stormy.waypoints)
    seen = [r.coverage for r in run.log]
    assert seen == sorted(seen)
    assert 0.0 < seen[-1] <= run.summary["coverage_through"] <= 1.0 + 1e-9
    if planner == "predictive":
        assert run.summary["exceedance_s"] == 0.0


@pytest.mark.parametrize("name", ["pipes", "jacket", "ship"])
def test_shipped_missions_are_flown_within_their_tether(name):
    flown = Mission.load(MISSIONS / f"{name}.json")
    flown = flown.model_copy(update={"waypoints": flown.waypoints[:24], "camera": None})
    run = simulate(flown)
    assert run.summary["exceedance_s"] == 0.0
    assert run.summary["visited"] == run.summary["waypoints"]


def test_two_planners_are_drawn_side_by_side(tmp_path):
    out, file = tmp_path / "run", few_of_the_basin(tmp_path, 5)
    code = main(["simulate", str(file), "--compare", "none", "-o", str(out), "--quiet"])
    assert code == 0
    names = {p.relative_to(out).as_posix() for p in out.rglob("*.*")}
    assert {"log.csv", "summary.json", "run.png", "run.html", "none/log.csv"} <= names
    figure = unpacked(out / "run.html")
    assert len(figure["frames"]) == 120
    (slider,), (menu,) = figure["layout"]["sliders"], figure["layout"]["updatemenus"]
    assert len(slider["steps"]) == 120
    assert [b["label"] for b in menu["buttons"]] == ["▶ play", "❚❚ pause"]
    assert {"scene", "scene2"} <= figure["layout"].keys()


def test_planners_may_believe_the_papers_tether_and_the_log_tells_the_truth():
    run = simulate(mission(ring(2), 5.0), "react", tether="react", scene=POST)
    own = simulate(mission(ring(2), 5.0), "react", scene=POST)
    assert run.summary["visited"] == own.summary["visited"]
    assert run.summary["longest_tether"] < 6.0
    with pytest.raises(InputError, match="planner 'predictive' needs geodesic, got 'react'"):
        simulate(mission(ring(2), 5.0), "predictive", tether="react", scene=POST)
    with pytest.raises(InputError, match="tether: unknown 'rope'; expected one of geodesic, react"):
        simulate(mission(ring(2), 5.0), "react", tether="rope", scene=POST)


def test_a_scene_thinner_than_what_holds_a_tether_is_warned_of(tmp_path, capsys):
    box = {"name": "plate", "box": {"center": [2, 0, 0], "size": [0.05, 1, 1]}}
    (tmp_path / "scene.json").write_text(json.dumps({"schema_version": 1, "solids": [box]}))
    for delta, warned in ((0.1, True), (0.02, False)):
        mission = {
            "schema_version": 1, "scene": "scene.json", "anchor": [0, 0, 0], "start": [0.5, 0, 0],
            "waypoints": [[1, 0, 0]], "tether_length": 3, "delta": delta,
        }  # fmt: skip
        (tmp_path / "m.json").write_text(json.dumps(mission))
        assert main(["simulate", str(tmp_path / "m.json")]) == 0
        assert ("may slip through; lower the mission's delta" in capsys.readouterr().err) == warned


@pytest.mark.parametrize(
    ("posts", "taken"),
    [([], 0.2), ([{"name": "rod", "post": {"center": [5, 0], "radius": 0.1}}], 0.2 / 1.89)],
    ids=["mesh alone", "mesh and rod"],
)
def test_a_delta_finer_than_the_voxels_is_raised_as_far_as_other_solids_allow(
    posts, taken, tmp_path, capsys
):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box([1.0, 1.0, 1.0]).export(tmp_path / "box.stl")
    scene = {"schema_version": 1, "solids": posts, "mesh": {"file": "box.stl", "voxel": 0.2}}
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    said = {}
    for delta in (0.05, 0.3):
        mission = {
            "schema_version": 1, "scene": "scene.json", "anchor": [2, 0, 0], "start": [2, 1, 0],
            "waypoints": [[2, 1.5, 0]], "tether_length": 3, "delta": delta,
        }  # fmt: skip
        (tmp_path / "m.json").write_text(json.dumps(mission))
        assert main(["simulate", str(tmp_path / "m.json")]) == 0
        said[delta] = capsys.readouterr().err
    assert f"delta 0.05 is finer than the voxels of the scene: {taken:g} is taken" in said[0.05]
    assert "is finer than" not in said[0.3]


@settings(max_examples=60, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 7), st.integers(1, 7), st.integers(1, 7)),
    share=st.sampled_from([0.0, 0.02, 0.1, 0.4]),
    seed=st.integers(0, 10**6),
)
def test_lengths_in_a_grid_are_those_of_dijkstra_over_all_neighbours(shape, share, seed):
    rng = np.random.default_rng(seed)
    free = rng.random(shape) >= share
    root = tuple(int(rng.integers(n)) for n in shape)
    free[root] = True
    # in C order, as planners have them: kernels would be compiled anew for any other
    cells = np.ascontiguousarray(np.argwhere(free))
    number = np.full(np.array(shape) + 2, -1)
    number[1:-1, 1:-1, 1:-1][free] = np.arange(len(cells))
    graph = lil_array((len(cells), len(cells)))
    for step in STEPS:
        to = number[tuple((cells + 1 + step).T)]
        graph[np.flatnonzero(to >= 0), to[to >= 0]] = np.linalg.norm(step)
    expected = dijkstra(graph.tocsr(), indices=int(number[tuple(np.add(root, 1))]))
    for wanted in (cells, np.full((1, 3), -1)):
        toward = grow(states_of(free), np.array(root), wanted)
        for cell, length in zip(cells, expected, strict=True):
            if toward[tuple(cell)] < 0:
                assert not np.isfinite(length)
                continue
            cells_on_the_way = tree_path(toward, cell)
            assert free[tuple(cells_on_the_way.T)].all()
            assert tuple(cells_on_the_way[-1]) == root
            steps = np.diff(cells_on_the_way, axis=0)
            assert abs(steps).max(initial=0) <= 1
            assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(length)


@pytest.mark.parametrize(("planner", "length"), [("predictive", 3.6), ("react", 6.0)])
def test_after_the_last_waypoint_the_robot_goes_home_and_the_tether_is_free(planner, length):
    run = fly(planner, ring(1.6), length)
    home = run.summary["home"]
    assert home["reached"]
    assert home["tether_free"]
    assert home["seconds"] > 0.0
    assert math.dist(run.tether.robot, run.mission.start) <= run.mission.reach
    assert run.tether.length < 0.6
    assert run.log[-1].mode == "done"
    assert run.log[-2].mode == "home"


def test_going_straight_home_leaves_the_turns_in_the_tether():
    """One turn about a post of perimeter pi: what is left is not much less."""
    run = fly("none", ring(1.0), 20.0)
    assert run.summary["home"]["reached"]
    assert not run.summary["home"]["tether_free"]
    assert run.summary["home"]["left"] > 3.0


def test_inspection_ends_at_the_last_waypoint():
    """The way home counts for the tether, not for the time of inspection."""
    run = fly("predictive", ring(1), 8.0)
    rows = [r for r in run.log if r.waypoint >= len(run.mission.waypoints)]
    assert run.summary["inspection_s"] == rows[0].time < run.log[-1].time
    there_and_back = run.summary["inspection_s"] + run.summary["home"]["seconds"]
    assert there_and_back == pytest.approx(run.log[-1].time)


def test_a_start_out_of_sight_of_the_anchor_is_reached_along_the_shortest_path():
    """Anchor and start on opposite sides of the post: the tether begins around it, and that is what
    it comes back to."""
    there = mission([(2, 1, 0), (0, 2, 0), (-2, 1, 0)], 8.0, start=(2, 0.1, 0))
    run = simulate(there, scene=POST)
    far = math.hypot(2, 0.1)
    arc = math.pi - math.atan2(0.1, 2) - math.acos(0.5 / 2) - math.acos(0.5 / far)
    shortest = math.sqrt(4 - 0.25) + 0.5 * arc + math.sqrt(far**2 - 0.25)
    assert run.log[0].tether == pytest.approx(shortest, abs=0.005)
    assert run.summary["visited"] == 3
    assert run.summary["home"]["tether_free"]
    assert run.tether.length == pytest.approx(shortest, abs=run.mission.reach)


def test_anchor_and_start_in_different_parts_of_the_water_are_refused():
    wall = {"box": {"center": [0, 0, 0], "size": [0.4, 18, 18]}}
    scene = Scene(solids=[wall], bounds=(-4, -4, -1, 4, 4, 1))
    with pytest.raises(InputError, match="start: no path in the water"):
        simulate(mission([(2, 1, 0)], 8.0, start=(2, 0, 0)), scene=scene)


@pytest.mark.parametrize("vehicle", ["kinematic", "bluerov2"])
def test_the_robot_turns_to_a_waypoints_heading_and_stays_there_as_long_as_asked(vehicle):
    there = {"position": (-1, 1.5, 0), "heading": 120.0, "dwell": 4.0}
    plain = simulate(mission([(-1, 1.5, 0)], 8.0), scene=POST, vehicle=vehicle)
    run = simulate(mission([there], 8.0), scene=POST, vehicle=vehicle)
    stays = [r for r in run.log if r.mode == "dwell"]
    assert stays[-1].time - stays[0].time >= 3.9
    headed = [r for r in stays if abs(math.degrees(r.yaw) - 120.0) <= 5.0]
    assert headed[-1].time - headed[0].time >= 3.9
    assert all(math.dist((r.x, r.y, r.z), there["position"]) < 0.2 for r in stays)
    longer = run.summary["inspection_s"] - plain.summary["inspection_s"]
    assert 4.0 <= longer <= 12.0
    assert run.summary["home"]["tether_free"]


def test_waypoints_with_and_without_more_to_do_are_written_as_they_are_read():
    mixed = mission([(1, 2, 0), {"position": [1, 3, 0], "heading": -90, "dwell": 2}], 8.0)
    data = json.loads(mixed.model_dump_json())
    assert data["waypoints"] == [[1, 2, 0], {"position": [1, 3, 0], "heading": -90, "dwell": 2}]
    assert Mission.model_validate(data) == mixed


@pytest.mark.parametrize(
    ("waypoint", "message"),
    [
        ({"position": [0, 0, 0], "dwell": -1}, "dwell"),
        ({"position": [0, 0, 0], "heading": 400}, "heading"),
        ({"position": [0, 0, 0], "heading": "north"}, "heading"),
        ({"position": [0, 0, 0], "heading": True}, "heading"),
        ({"heading": 40}, "position"),
        ({"position": [0, 0, 0], "stay": 3}, "stay"),
        ("here", "position"),
    ],
)
def test_a_bad_waypoint_is_told_in_one_line(waypoint, message):
    with pytest.raises(InputError, match=rf"waypoints\[0\].*{message}"):
        mission([waypoint], 8.0)


def water_test(**more):
    """A straight leg of 4 m across a current of which a BlueROV2 makes no headway, or does."""
    far = {"sphere": {"center": [8, 8, 8], "radius": 0.5}}
    open_water = Scene(solids=[far], bounds=(-9, -9, -9, 9, 9, 9))
    there = mission([(-2, 4.5, 0)], 20.0, speed=0.3, **more)
    return simulate(there, scene=open_water, vehicle="bluerov2")


def test_a_stall_in_a_strong_current_is_seen_and_told():
    run = water_test(current=(0.0, -1.8, 0.0))
    assert run.summary["visited"] == 0
    assert run.summary["stalls"][0]["waypoint"] == 0
    assert "stalled: no progress in 30 s, in water of 1.80 m/s" in str(run.summary["left_out"])
    assert run.summary["inspection_s"] < 60.0
    assert not run.summary["home"]["reached"]


def test_a_current_that_the_robot_masters_is_no_stall():
    run = water_test(current=(0.0, -0.4, 0.0))
    assert run.summary["visited"] == 1
    assert run.summary["stalls"] == []
    assert run.summary["home"]["tether_free"]


def test_a_robot_keeps_its_station_in_a_current():
    there = {"position": (-2, 3, 0), "dwell": 30.0}
    run = simulate(
        mission([there], 20.0, current=(0.3, 0.1, 0.0), gusts=0.05), scene=POST, vehicle="bluerov2"
    )
    held = [math.dist((r.x, r.y, r.z), (-2, 3, 0)) for r in run.log if r.mode == "dwell"]
    assert len(held) >= 300
    assert max(held) < 0.2


@settings(max_examples=8, deadline=None)
@given(noise=st.floats(0.0, 0.05), delay=st.floats(0.0, 1.0), seed=st.integers(0, 99))
def test_late_and_noisy_positions_cost_tether_but_never_more_than_there_is(noise, delay, seed):
    there = mission(ring(1.5), 5.0, sensor={"noise": noise, "delay": delay}, reach=0.25)
    run = simulate(there, scene=POST, seed=seed)
    assert run.summary["visited"] == 24
    assert run.summary["exceedance_s"] == 0.0
    assert run.summary["home"]["reached"]


def test_the_estimate_follows_a_straight_course_without_lag():
    """An alpha-beta filter with the delay made up for has no error on a straight line in the end,
    and less noise than what is measured."""
    steps = np.array([0.03, 0.01, 0.0])
    late = Positions(PositionSensor(delay=0.5), POST.field(), np.array([2.0, 2, 0]), 0)
    for k in range(1, 200):
        place = np.array([2.0, 2, 0]) + k * steps
        estimate = late(place)
    assert estimate == pytest.approx(place, abs=1e-3)
    noisy = Positions(PositionSensor(noise=0.1), POST.field(), np.array([2.0, 2, 0]), 0)
    off = np.array([noisy(np.array([2.0, 2, 0])) for _ in range(3000)]) - [2.0, 2, 0]
    assert off[100:].std() < 0.07


def test_a_vehicle_without_a_camera_heads_where_it_is_fastest():
    """Sideways thrust stands 0.72 m/s; heading into 0.8 m/s the robot arrives."""
    run = water_test(current=(0.0, -0.8, 0.0))
    assert run.summary["visited"] == 1
    assert run.summary["stalls"] == []
    assert run.summary["home"]["tether_free"]


def test_an_inspection_that_is_interrupted_is_not_on_its_way_home():
    def stop(row, planner):
        if row.time > 3.0:
            raise KeyboardInterrupt

    run = simulate(mission(ring(1), 8.0), scene=POST, on_step=stop)
    assert run.summary["status"] == "interrupted"
    assert run.summary["home"]["seconds"] == 0.0
    assert not run.summary["home"]["reached"]
    assert "on the way home" not in describe_run(run, "m")
