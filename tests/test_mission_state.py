"""Missions that begin in the middle, alternatives, and tours mended on the way."""

import json
from pathlib import Path

import numpy as np
import pytest

from netsp.base.errors import InputError, LimitReachedError
from netsp.base.geometry import polylines
from netsp.command.main import main
from netsp.online.execute.mission_repair import RepairPlanner
from netsp.plan.cover import cover
from netsp.plan.space.flown import words_of_flight
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_solver import solve_mission
from netsp.plan.space.path_bound import bound_all_tours
from netsp.plan.space.planning_context import PlanningContext, keeps_clearance
from netsp.plan.space.space_plan import plan
from netsp.world import Scene
from netsp.world.mission.equipment import Camera
from netsp.world.mission.mission import Mission, MissionState, MissionWaypoint, Viewpoint
from netsp.world.planner import PlannerOptions
from netsp.world.simulator.mission_run import simulate
from netsp.world.simulator.surprises import SceneSurprises
from tests.worlds import FEW_CELLS
from tests.written_problems import written


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """A planned mission, its scene and its field."""
    mission = Mission.load(written(tmp_path_factory.mktemp("posts")))
    scene = mission.load_scene()
    return plan(mission, scene=scene, time_limit=None).to_mission(), scene, scene.field()


def in_the_middle(planned, stops: int) -> Mission:
    """What is left of a planned mission once so many stops were made."""
    mission, scene, field = planned
    context = PlanningContext.for_mission(mission, scene, field)
    tether = context.present_tether
    for stop in mission.tour.stops[:stops]:
        tether, _ = context.drive(tether, np.array(stop.path))
    line = [tuple(p) for p in tether.nodes.tolist()]
    return mission.model_copy(
        update={
            "tour": None, "waypoints": mission.waypoints[stops:],
            "state": MissionState(position=line[-1], tether=line),
        }
    )  # fmt: skip


@pytest.mark.parametrize("stops", [1, 2, 3])
def test_from_any_stop_of_a_shortest_tour_its_rest_is_found_again(planned, stops):
    mission, scene, field = planned
    rest = [*(s.path for s in mission.tour.stops[stops:]), mission.tour.home]
    length = sum(polylines.length(np.array(leg)) for leg in rest)
    found = plan(in_the_middle(planned, stops), scene=scene, field=field, time_limit=None)
    assert found.length <= length * (1 + 1e-6) + 0.02
    assert found.free
    assert found.visits[0].path[0] == pytest.approx(mission.waypoints[stops - 1].position, abs=1e-6)
    bound = bound_all_tours(found.paths, sorted(found.order), None, potential=FEW_CELLS.potential)
    assert 0.0 < bound <= found.length + 1e-6


@pytest.mark.usefixtures("few_cells")
def test_a_mission_from_the_middle_is_solved_judged_flown_and_reported(planned, tmp_path, capsys):
    mission, scene, _ = planned
    (tmp_path / "scene.json").write_text(scene.model_dump_json(exclude_none=True))
    rest = in_the_middle(planned, 2).model_copy(update={"scene": "scene.json"})
    file, out = tmp_path / "rest.json", tmp_path / "planned.json"
    file.write_text(rest.model_dump_json(exclude_none=True))
    assert main(["solve", str(file), "-o", str(out)]) == 0
    assert main(["verify", str(out)]) == 0
    assert main(["export", str(out), "-o", str(tmp_path / "rest.csv")]) == 0
    capsys.readouterr()
    assert main(["execute", str(out), "-o", str(tmp_path / "run")]) == 0
    assert "as planned at 2 of 2 visits; empty at home" in capsys.readouterr().err
    assert main(["report", str(tmp_path / "run"), "-o", str(tmp_path / "run.html")]) == 0
    assert main(["report", str(out), "-o", str(tmp_path / "plan.html")]) == 0
    assert main(["plot", str(out), "-o", str(tmp_path / "plan.png")]) == 0
    text = (tmp_path / "run.html").read_text()
    for said in ("a flight", "2 of 2 waypoints visited", "Tether over time", "Nothing unforeseen"):
        assert said in text
    assert "words at the visits" in (tmp_path / "plan.html").read_text()
    first = mission.waypoints[1].position
    assert json.loads((tmp_path / "run" / "mission.json").read_text())["state"]["position"] == (
        pytest.approx(first, abs=1e-6)
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"tether": [[0, 0, 0], [1, 1, 0]]}, "state.tether: ends"),
        ({"tether": [[1, 0, 0], [2, 2.5, -1]]}, "state.tether: begins"),
        ({"tether": [[0, 0, 0]]}, "state.tether"),
        ({"tether": [[0, 0, 0], [3, 0.4, -0.5], [2, 2.5, -1]]}, "passes through a solid"),
        (
            {"tether": [[0, 0, 0], [1, -3, -1], [8, -3, -1], [8, 3, -1], [2, 2.5, -1]]},
            "expected no more",
        ),
        ({"position": [3, 0.4, -1], "tether": [[0, 0, 0], [3, 0.4, -1]]}, "state.position"),
        ({"position": [30, 0, -1], "tether": [[0, 0, 0], [30, 0, -1]]}, "outside of the scene's"),
    ],
)
def test_a_state_that_cannot_be_is_told_in_one_line(change, said, tmp_path, capsys):
    state = {"position": [2, 2.5, -1], "tether": [[0, 0, 0], [2, 2.5, -1]], **change}
    file = written(tmp_path, state=state, tether_length=6.0, waypoints=[[2.2, 2.6, -1]])
    assert main(["solve", str(file), "--quiet", "-o", str(tmp_path / "out.json")]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1
    assert not (tmp_path / "out.json").exists()


def test_one_place_of_each_waypoint_is_visited_and_the_best_is_taken(planned):
    mission, scene, field = planned
    far = mission.waypoints[0]
    near = Viewpoint(position=(1.5, 0.6, -0.3), heading=45.0)
    other = MissionWaypoint(position=far.position, heading=10.0, alternatives=(near,))
    choice = mission.model_copy(
        update={"tour": None, "waypoints": (other, *mission.waypoints[1:])}
    )  # fmt: skip
    found = plan(choice, scene=scene, field=field, time_limit=None)
    assert sorted(found.order) == [0, 1, 2, 3]
    assert found.length < mission.tour.length
    taken = next(w for w in found.to_mission().waypoints if w.alternatives)
    assert (taken.position, taken.heading) == (near.position, near.heading)
    assert taken.alternatives == (Viewpoint(position=far.position, heading=10.0),)
    assert verify_mission(found.to_mission(), scene=scene, field=field)


def test_an_alternative_in_a_solid_is_told(planned):
    mission, scene, field = planned
    inside = MissionWaypoint(
        position=mission.waypoints[0].position, alternatives=(Viewpoint(position=(3, 0.4, -1)),)
    )
    bad = mission.model_copy(update={"tour": None, "waypoints": (inside,)})
    with pytest.raises(InputError, match=r"waypoints\[0\].alternatives\[0\]: is inside a solid"):
        plan(bad, scene=scene, field=field)


def test_alternatives_of_a_cover_see_as_much_in_any_combination():
    scene = Scene(solids=[{"box": {"center": [0, 0, 0], "size": [2, 1, 1]}}])
    found = cover(
        scene, anchor=(4, 0, 2), camera=Camera(range=2.5, patch=0.25), standoff=1.2, time_limit=None
    )
    assert sum(len(w.alternatives) for w in found.mission.waypoints) >= 3
    rng = np.random.default_rng(0)
    field = scene.field()
    for _ in range(3):
        chosen = tuple(
            w.at(int(rng.integers(len(w.alternatives) + 1))) for w in found.mission.waypoints
        )
        seen = simulate(
            found.mission.model_copy(update={"waypoints": chosen}), scene=scene, field=field
        ).summary["coverage"]
        assert seen >= 0.99 * found.visible - 0.01


# ------------------------------------------------------------------------------------------ repair


def appear(place, radius: float, time: float) -> SceneSurprises:
    solid = {"name": "new", "sphere": {"center": list(place), "radius": radius}}
    return SceneSurprises.model_validate(
        {"schema_version": 1, "events": [{"time": time, "appear": solid}]}
    )


def middle_of(mission: Mission, k: int) -> list[float]:
    leg = np.array(mission.tour.stops[k].path)
    return polylines.points_along(leg, 0.5 * polylines.length(leg))[1].tolist()


def fly(planned, surprises, planner="repair", **options):
    mission, scene, field = planned
    return simulate(
        mission, planner, scene=scene, field=field, surprises=surprises,
        options=PlannerOptions(**options),
    )  # fmt: skip


def test_without_surprises_repair_is_predictive(planned):
    one, other = (simulate(planned[0], p, scene=planned[1]) for p in ("repair", "predictive"))
    assert [(r.x, r.y, r.z) for r in one.log] == [(r.x, r.y, r.z) for r in other.log]
    assert one.summary["repairs"] == []


@pytest.mark.parametrize("leg", [0, 1, 2, 3])
def test_what_blocks_a_leg_is_not_met_and_all_is_visited_all_the_same(planned, leg):
    run = fly(planned, appear(middle_of(planned[0], leg), 0.15, 0.5), planning_limit=15.0)
    s = run.summary
    assert s["visited"] == 4
    assert s["home"]["tether_free"]
    assert s["exceedance_s"] == 0.0
    assert s["contacts"] == 0
    (repair,) = s["repairs"]
    # the second and the third only need a way round, and more time for planning is worth no more
    assert repair["response"] == "local" or leg in (0, 3)
    assert repair["response"] in ("local", "replan")
    assert f"waypoint #{leg} is blocked" in repair["reason"]
    # words are told by the scene at the end, and are as in the tour that was mended
    assert words_of_flight(run).as_planned == 4
    assert run.mission.tour.mismatch(
        run.mission.begin, run.mission.start, run.mission.places, run.mission.reach
    ) is None  # fmt: skip


def test_what_is_far_away_changes_nothing(planned):
    run = fly(planned, appear((0.0, -3.0, -3.0), 0.3, 1.0))
    assert [r["response"] for r in run.summary["repairs"]] == ["kept"]
    assert run.summary["home"]["tether_free"]


def test_a_waypoint_that_a_solid_stands_on_is_left_out_and_the_others_are_visited(planned):
    run = fly(planned, appear(planned[0].waypoints[2].position, 0.4, 0.5))
    s = run.summary
    assert s["visited"] == 3
    assert [s["given_as"][w["waypoint"]] for w in s["left_out"]] == [2]
    assert s["home"]["tether_free"]


def test_a_waypoint_of_a_tour_is_visited_after_the_solid_on_it_has_gone(planned):
    blocked = appear(planned[0].waypoints[2].position, 0.4, 0.5)
    left_out_s = next(r.time for r in fly(planned, blocked).log if r.waypoint == 4)
    gone = {"time": left_out_s + 1.0, "vanish": "new"}
    run = fly(planned, events(blocked.events[0].model_dump(exclude_none=True), gone))
    s = run.summary
    assert s["visited"] == s["waypoints"] == 4
    assert s["left_out"] == []
    assert s["home"]["tether_free"]
    assert s["exceedance_s"] == 0.0


def test_where_the_order_no_longer_holds_the_rest_is_planned_anew(planned, monkeypatch):
    """Without ways round what blocks a leg there is only another tour."""
    monkeypatch.setattr(RepairPlanner, "_path_around", lambda *_: None)
    run = fly(planned, appear(middle_of(planned[0], 1), 0.15, 0.5), planning_limit=5.0)
    s = run.summary
    (repair,) = s["repairs"]
    assert repair["response"] == "replan"
    assert s["visited"] == 4
    assert s["home"]["tether_free"]
    assert s["exceedance_s"] == 0.0
    assert sorted(s["given_as"]) == [0, 1, 2, 3]
    held = [r for r in run.log if r.mode == "hold"]
    assert len(held) * 0.1 == pytest.approx(5.0, abs=0.3)
    assert words_of_flight(run).as_planned == 4


def events(*some) -> SceneSurprises:
    return SceneSurprises.model_validate({"schema_version": 1, "events": list(some)})


@pytest.mark.parametrize("planner", ["repair", "predictive"])
@pytest.mark.parametrize("time", [0.5, 30.0, 1e4])
def test_a_waypoint_that_is_added_is_visited_and_one_that_is_cancelled_is_not(
    planned, planner, time
):
    surprises = events(
        {"time": time, "add_waypoint": [1.5, 1.5, -0.5]}, {"time": 0.2, "cancel_waypoint": 2}
    )
    s = (run := fly(planned, surprises, planner, planning_limit=5.0)).summary
    late = time > 1e3
    assert s["visited"] == s["waypoints"] == (3 if late else 4)
    assert s["given_as"].count(2) == 0
    assert (4 in s["given_as"]) is not late
    assert s["home"]["tether_free"]
    assert s["exceedance_s"] == 0.0
    assert s["surprises"]["happened"] == (1 if late else 2)
    places = [w.position for w in run.mission.waypoints]
    assert ((1.5, 1.5, -0.5) in places) is not late
    if planner == "repair":
        assert len(s["repairs"]) == (1 if late else 2)
        assert s["repairs"][0]["response"] == "kept"  # one fewer leaves the rest as it was
        assert run.mission.tour is not None


def test_a_waypoint_that_was_visited_cannot_be_cancelled(planned):
    first = planned[0].tour.stops[0]
    late = 1.0 + polylines.length(np.array(first.path)) / planned[0].speed
    s = fly(planned, events({"time": late, "cancel_waypoint": 0})).summary
    assert s["visited"] == 4


@pytest.mark.parametrize("planner", ["repair", "predictive", "react", "none"])
def test_a_robot_that_is_carried_off_goes_on_from_there(planned, planner):
    run = fly(planned, events({"time": 4.0, "push": [-0.6, -0.8, 0.3]}), planner)
    place = np.array([[r.x, r.y, r.z] for r in run.log])
    jump = np.linalg.norm(np.diff(place, axis=0), axis=1).max()
    assert 0.5 < jump < 1.1
    assert run.summary["visited"] == 4
    if planner in ("repair", "predictive"):
        assert run.summary["exceedance_s"] == 0.0
        assert run.summary["home"]["tether_free"]


def test_a_robot_is_carried_no_farther_than_there_is_water_and_tether(planned):
    run = fly(planned, events({"time": 4.0, "push": [50.0, 0.0, 0.0]}))
    assert run.summary["exceedance_s"] == 0.0
    assert run.summary["visited"] == 4
    assert planned[2].distance([[r.x, r.y, r.z] for r in run.log]).min() > -0.05


@pytest.mark.parametrize("planner", ["repair", "predictive"])
@pytest.mark.parametrize("vehicle", ["kinematic", "bluerov2"])
def test_a_tether_that_becomes_shorter_is_kept_to(planned, planner, vehicle):
    mission, scene, field = planned
    far = int(np.argmax([s.longest_tether for s in mission.tour.stops]))
    longest, out = mission.tour.stops[far].longest_tether, mission.tour.stops[far].tether_length
    before = sum(polylines.length(np.array(s.path)) for s in mission.tour.stops[: far + 1])
    assert out > 5.0
    run = simulate(
        mission, planner, vehicle=vehicle, scene=scene, field=field,
        surprises=events({"time": before / mission.speed - 1.0, "tether_length": 5.0}),
        options=PlannerOptions(planning_limit=5.0),
    )  # fmt: skip
    s = run.summary
    assert 5.0 < s["shortening_s"] <= (longest - 5.0) / mission.speed + 10.0
    assert s["exceedance_s"] == 0.0
    assert s["home"]["tether_free"]
    after = [r for r in run.log if r.limit == 5.0 and not r.shortening]
    assert max(r.payout for r in after) <= 5.0 * (1 + 1e-9)
    for k in (w["waypoint"] for w in s["left_out"]):
        assert np.linalg.norm(np.subtract(run.mission.waypoints[k].position, mission.anchor)) > 4.5


def test_a_waypoint_that_is_not_there_cannot_be_cancelled(planned, tmp_path, capsys):
    mission, scene, _ = planned
    (tmp_path / "scene.json").write_text(scene.model_dump_json(exclude_none=True))
    file, bad = tmp_path / "planned.json", tmp_path / "events.json"
    file.write_text(
        mission.model_copy(update={"scene": "scene.json"}).model_dump_json(exclude_none=True)
    )
    bad.write_text(events({"time": 1, "cancel_waypoint": 4}).model_dump_json(exclude_none=True))
    assert main(["execute", str(file), "--surprise", str(bad), "--quiet"]) == 2
    assert "events[0]: cancel_waypoint: no waypoint #4; expected #0 to #3" in (
        capsys.readouterr().err
    )


def test_execute_tells_what_it_did_and_refuses_what_fails_its_checks(planned, tmp_path, capsys):
    mission, scene, _ = planned
    (tmp_path / "scene.json").write_text(scene.model_dump_json(exclude_none=True))
    file, events = tmp_path / "planned.json", tmp_path / "events.json"
    here = mission.model_copy(update={"scene": "scene.json"})
    file.write_text(here.model_dump_json(exclude_none=True))
    events.write_text(
        appear(middle_of(mission, 1), 0.15, 0.5).model_dump_json(exclude_none=True)
    )  # fmt: skip
    run = tmp_path / "run"
    assert main(["execute", str(file), "--surprise", str(events), "-o", str(run)]) == 0
    assert "repair   at 0." in capsys.readouterr().err
    assert main(["report", str(run), "-o", str(tmp_path / "page.html")]) == 0
    assert "is blocked" in (tmp_path / "page.html").read_text()
    Mission.load(run / "mission.json")
    for flags, said in (
        (["x.json"], "SOLUTION: is for problems"), (["--speed", "1"], "--speed: is for problems"),
        (["--delta", "0.1"], "--delta: is for problems"), (["--planner", "x"], "--planner"),
    ):  # fmt: skip
        assert main(["execute", str(file), *flags, "--quiet"]) == 2
        assert said in capsys.readouterr().err
    tour = mission.tour.model_copy(update={"length": 1.0, "gap": None, "lower_bound": None})
    file.write_text(here.model_copy(update={"tour": tour}).model_dump_json(exclude_none=True))
    assert main(["execute", str(file), "--quiet"]) == 2
    assert "fails its check 'length as stated'" in capsys.readouterr().err
    file.write_text(here.model_copy(update={"tour": None}).model_dump_json(exclude_none=True))
    assert main(["execute", str(file), "--quiet"]) == 2
    assert "tour: the mission has none" in capsys.readouterr().err


# -------------------------------------------------------------------------------- found by attacks


def small(folder: Path, waypoints, solids=None, **more) -> Mission:
    solids = solids or [{"name": "ball", "sphere": {"center": [3, 0, 0], "radius": 1}}]
    (folder / "scene.json").write_text(
        json.dumps({"schema_version": 1, "solids": solids, "bounds": [-3, -5, -5, 8, 5, 5]})
    )
    data = {
        "schema_version": 1, "scene": "scene.json", "anchor": [0, 0, 0], "start": [0, 0, 1],
        "tether_length": 9, "waypoints": waypoints, **more,
    }  # fmt: skip
    (folder / "mission.json").write_text(json.dumps(data))
    return Mission.load(folder / "mission.json")


@pytest.mark.parametrize(
    "waypoints",
    [
        [[0, 0, 1]],
        [[0, 0, 1], [3, 1.5, 0]],
        [[5, 0, 0], [3, 2, 0], [3, -2, 1]],
        [[3, 2, 0], [3, 2, 0]],
    ],
)
def test_whatever_is_solved_is_verified(waypoints, tmp_path):
    found = solve_mission(small(tmp_path, waypoints), time_limit=6.0)
    verdict = verify_mission(found.mission)
    assert verdict, str(verdict)


def test_a_robot_is_not_sent_through_gaps_that_only_its_tether_fits_through(tmp_path):
    bars = [
        {"capsule": {"a": [2, -3, z / 5], "b": [2, 3, z / 5], "radius": 0.06}}
        for z in range(-15, 16)
    ]
    mission = small(tmp_path, [[4, 0, 0.1], [3, 2, 0]], bars, delta=0.05)
    found = solve_mission(mission, time_limit=20.0)
    verdict = verify_mission(found.mission)
    assert verdict, str(verdict)
    assert len(found.tour.stops) == 2


@pytest.mark.parametrize("radius", [0.005, 0.06])
def test_no_tour_of_states_leads_where_the_robot_has_no_room(radius, tmp_path):
    """Whether one is found or not; a tether slips through bars as thin as the first."""
    bars = [
        {"capsule": {"a": [2, -3, z / 5], "b": [2, 3, z / 5], "radius": radius}}
        for z in range(-15, 16)
    ]
    mission = small(tmp_path, [[4, 0, 0.1], [3, 2, 0]], bars)
    field = mission.load_scene().field()
    try:
        stops = plan(mission, time_limit=20.0).visits
    except (InputError, LimitReachedError):
        return
    assert all(keeps_clearance(field, stop.path, mission) for stop in stops)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"start": [-4, 0, 0]}, "start: (-4, 0, 0) lies outside of the scene's bounds"),
        ({"waypoints": [[20, 0, 0]]}, "waypoints[0]: (20, 0, 0) lies outside"),
        ({"waypoints": [[2, 0, 0]]}, "waypoints[0]: is 0 m from one"),
        ({"cell": 1e6}, "cell: 1e+06 is more than the whole site"),
        ({"delta": 10}, "delta: 10 is more than the tether_length"),
        ({"reach": 10}, "reach: 10 is more than the tether_length"),
        ({"tether_length": 1.5}, "no tether within the limit reaches any of them: 1.485 m"),
    ],
)
def test_what_cannot_be_planned_is_told_in_one_line(more, said, tmp_path, capsys):
    small(tmp_path, more.pop("waypoints", [[5, 0, 0]]), **more)
    assert main(["solve", str(tmp_path / "mission.json"), "--quiet"]) == 2
    told = capsys.readouterr()
    assert said in told.err
    assert told.err.count("\n") == 1
    assert told.out == ""


def test_a_tour_of_the_file_is_kept_where_nothing_better_is_found(planned):
    mission, scene, field = planned
    again = solve_mission(mission, scene=scene, field=field, time_limit=1e-3)
    assert again.tour.length <= mission.tour.length + 1e-6
