"""Planned tours: what they must match, and that they are flown as they were planned."""

import json
import signal
import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netsp.base.clock import Clock
from netsp.base.geometry import polylines
from netsp.base.interrupt_signals import deferred_interrupts, until_interrupt
from netsp.command.main import main
from netsp.model.solution import Status
from netsp.plan.space.flown import words_of_flight
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_solver import add_bound, seconds_until_home, solve_mission
from netsp.plan.space.path_bound import bound_all_tours
from netsp.plan.space.space_plan import plan
from netsp.world.mission.mission import Mission
from netsp.world.mission.planned_tour import thinned_path
from netsp.world.planner.predictive import PredictivePlanner
from netsp.world.simulator.laid_tether import present_tether
from netsp.world.simulator.mission_run import mission_grid, simulate
from netsp.world.tether import GeodesicTether
from tests.worlds import FEW_CELLS
from tests.written_problems import SCENE, WAYPOINTS, written


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    mission = Mission.load(written(tmp_path_factory.mktemp("posts")))
    return mission, solve_mission(mission, time_limit=None, policy=FEW_CELLS)


def test_predictive_flies_the_legs_and_looks_for_no_others(solved, monkeypatch):
    mission, found = solved
    sought = []
    seek = PredictivePlanner._shortest_feasible
    monkeypatch.setattr(PredictivePlanner, "warm_up", lambda *_: None)
    monkeypatch.setattr(
        PredictivePlanner, "_shortest_feasible", lambda self, *a: sought.append(a) or seek(self, *a)
    )
    planned = found.plan.to_mission()
    run = simulate(planned)
    assert not sought
    assert run.summary["visited"] == 4
    assert run.summary["home"]["tether_free"]
    # a waypoint counts as visited a bit before it, so that a flight may be shorter
    assert seconds_until_home(run) <= planned.tour.length / mission.speed + 1.0
    assert seconds_until_home(run) >= 0.93 * planned.tour.length / mission.speed
    for stop, flown in zip(planned.tour.stops, run.summary["stops"], strict=True):
        assert flown["tether"] == pytest.approx(stop.tether_length, abs=2 * mission.reach)


def test_a_robot_that_is_elsewhere_plans_for_itself(solved):
    planned = solved[1].plan.to_mission()
    other = planned.model_copy(update={"start": (0.0, -2.0, 0.0)})
    run = simulate(other)
    assert run.summary["visited"] == 4
    assert run.summary["exceedance_s"] == 0.0
    assert run.summary["home"]["tether_free"]


def test_what_is_new_on_the_map_is_not_flown_through(solved, tmp_path):
    planned = solved[1].plan.to_mission()
    leg = np.array(planned.tour.stops[1].path)
    middle = polylines.points_along(leg, 0.5 * polylines.length(leg))[1]
    scene = {**SCENE, "solids": [
        *SCENE["solids"], {"sphere": {"center": middle.tolist(), "radius": 0.25}},
    ]}  # fmt: skip
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    other = planned.model_copy(update={"scene": str(tmp_path / "scene.json")})
    run = simulate(other)
    assert run.summary["contacts"] == 0
    assert run.summary["visited"] == 4


def test_a_solved_mission_is_never_worse_than_the_order_given(solved):
    mission, found = solved
    assert sorted(found.order) == [0, 1, 2, 3]
    assert found.mission.waypoints == tuple(mission.waypoints[n] for n in found.order)
    assert seconds_until_home(found.run) <= seconds_until_home(found.given)
    tour = found.tour
    assert tour.bound_of_all <= tour.length
    assert tour.longest_tether <= mission.tether_length
    assert tour.length == pytest.approx(polylines.length(tour.line))


def test_the_bound_is_no_longer_than_any_order_without_a_tether(solved):
    mission, found = solved
    bound = bound_all_tours(found.plan.paths, [0, 1, 2, 3], Clock(), potential=FEW_CELLS.potential)
    loose = plan(mission.model_copy(update={"tether_length": 60.0}), time_limit=8.0)
    assert bound <= loose.length + 1e-6
    assert bound >= 2.0 * max(np.linalg.norm(np.subtract(p, mission.start)) for p in WAYPOINTS)


def test_the_same_seed_gives_the_same_mission(solved):
    mission, found = solved
    again = solve_mission(mission, time_limit=None, policy=FEW_CELLS)
    assert again.mission.model_dump_json() == found.mission.model_dump_json()


@pytest.mark.usefixtures("few_cells")
def test_a_planned_mission_is_written_and_read_and_flies(tmp_path, capsys):
    file, out = written(tmp_path), tmp_path / "planned.json"
    assert main(["solve", str(file), "-o", str(out), "--plot", str(tmp_path / "p.png")]) == 0
    said = capsys.readouterr()
    assert said.out == ""
    for word in ("tour ", "bound ", "order ", "tether ", "flown ", "mission "):
        assert word in said.err
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")
    again = Mission.load(out)
    assert again.tour.status.value in ("optimal", "optimal_of_states", "feasible")
    assert len(again.tour.stops) == 4
    assert main(["simulate", str(out)]) == 0
    said = capsys.readouterr()
    assert "classes  as planned at 4 of 4 visits; empty at home" in said.err
    words = json.loads(said.out)["words"]
    assert words["home"] == []
    assert [stop["as_planned"] for stop in words["stops"]] == [True] * 4
    # and as text to standard output, with the scene where it was
    assert main(["order", str(file), "--quiet"]) == 0
    assert json.loads(capsys.readouterr().out)["scene"] == "scene.json"


def test_the_flight_is_in_the_planned_classes_and_ends_in_none(solved):
    planned = solved[1].mission
    flown = words_of_flight(simulate(planned))
    assert flown.as_planned == len(flown.visits) == 4
    assert flown.home == ()
    assert any(word for _, word in flown.visits)


def test_a_flight_in_other_classes_is_told(solved):
    """By a planner that does not know of tethers, round a post."""
    around = [(3.0, 1.4, -1), (4.2, 0.4, -1), (3.0, -0.6, -1), (1.8, 0.4, -1)]
    lasso = Mission.model_validate({**solved[0].model_dump(), "waypoints": around})
    run = simulate(lasso.model_copy(update={"tether_length": 50.0}), "none")
    flown = words_of_flight(run)
    assert flown.planned == ()
    assert flown.home != ()
    assert not run.summary["home"]["tether_free"]


def test_a_bound_above_the_tour_is_left_out_and_not_shortened_to_it(solved):
    mission, found = solved
    field, tour = mission.load_scene().field(), found.tour
    visited = frozenset(found.order[: len(tour.stops)])
    assert found.shortfall == pytest.approx(0.0, abs=1e-9)
    assert add_bound(found, {visited: 1.001 * tour.length}, field) is None
    rounded = add_bound(found, {visited: tour.length * (1.0 + 1e-9)}, field)
    assert rounded is not None
    assert rounded.tour.bound_of_all == tour.length
    assert rounded.tour.status is Status.OPTIMAL
    lower = add_bound(found, {visited: 0.5 * tour.length}, field)
    assert lower is not None
    assert lower.tour.gap_to_all == pytest.approx(0.5)


def test_a_bound_is_reduced_for_a_robot_that_turns_back_and_left_out_where_it_has_less_room(solved):
    mission, found = solved
    field, tour = mission.load_scene().field(), found.tour
    visited = frozenset(found.order[: len(tour.stops)])
    stop = tour.stops[0]
    end = np.array(stop.path[-1])
    after = tour.stops[1].path
    cut = end + 0.05 * (np.array(stop.path[-2]) - end) / np.linalg.norm(end - stop.path[-2])

    def turned_back_at(point):
        stops = (
            stop.model_copy(update={"path": (*stop.path[:-1], tuple(point))}),
            tour.stops[1].model_copy(update={"path": (tuple(point), *after[1:])}),
            *tour.stops[2:],
        )
        planned = found.mission.model_copy(
            update={"tour": tour.model_copy(update={"stops": stops, "bound_of_all": None})}
        )
        return replace(found, mission=planned)

    bounded = add_bound(turned_back_at(cut), {visited: 0.9 * tour.length}, field)
    assert bounded is not None
    assert bounded.tour.bound_of_all == pytest.approx(0.9 * tour.length - 0.1)
    # as if the leg ended in the post: led on to the waypoint, it keeps too little room
    inside = turned_back_at((3.0, 0.4, -1.0))
    assert add_bound(inside, {visited: 0.9 * tour.length}, field) is inside


def test_the_judge_accepts_what_was_solved(solved):
    verdict = verify_mission(solved[1].mission)
    assert verdict, str(verdict)
    assert verify_mission(solved[1].plan.to_mission())


def changed(mission: Mission, **tour) -> Mission:
    return mission.model_copy(update={"tour": mission.tour.model_copy(update=tour)})


def another_stop(mission: Mission, k: int, **stop) -> Mission:
    stops = list(mission.tour.stops)
    stops[k] = stops[k].model_copy(update=stop)
    return changed(mission, stops=tuple(stops))


def through_a_post(mission: Mission) -> Mission:
    path = mission.tour.stops[0].path
    return another_stop(mission, 0, path=(path[0], (3.0, 0.4, -0.5), path[-1]))


def round_a_post(mission: Mission) -> Mission:
    """A loop about the first post before the first leg."""
    loop = [(2.2, -0.4, 0.0), (3.8, -0.4, 0.0), (3.8, 1.2, 0.0), (2.2, 1.2, 0.0), (2.2, -0.4, 0.0)]
    path = mission.tour.stops[0].path
    return another_stop(mission, 0, path=(path[0], *loop, *path[:0:-1][::-1]))


def without_the_last_stop(mission: Mission) -> Mission:
    """It goes home from the last but one, the way it came, and says that this is the shortest."""
    stops = mission.tour.stops[:-1]
    line = np.vstack([np.array(s.path) for s in stops])
    length = 2.0 * sum(polylines.length(np.array(s.path)) for s in stops)
    return changed(
        mission, stops=stops, home=tuple(map(tuple, line[::-1].tolist())), length=length,
        status=Status.OPTIMAL, lower_bound=length, gap=0.0, bound_of_all=length, gap_to_all=0.0,
    )  # fmt: skip


FALSE = {
    "a stop that is missing": (without_the_last_stop, "leaves out only what is out of reach"),
    "the tether on the way to a stop": (
        lambda m: another_stop(m, 1, longest_tether=m.tour.stops[1].longest_tether + 0.3),
        "tethers as long as stated",
    ),
    "that words are exact": (
        lambda m: changed(m, exact=not m.tour.exact), "words at the visits"
    ),
    "the word of a stop": (lambda m: another_stop(m, 1, signature=(9,)), "words at the visits"),
    "the tether of a stop": (
        lambda m: another_stop(m, 1, tether_length=m.tour.stops[1].tether_length + 0.3),
        "tethers as long as stated",
    ),
    "the length": (lambda m: changed(m, length=m.tour.length - 0.5), "length as stated"),
    "the bound": (
        lambda m: changed(m, bound_of_all=m.tour.length + 1.0, gap_to_all=0.0), "bounds and status"
    ),
    "the gap": (
        lambda m: changed(m, bound_of_all=0.9 * m.tour.length, gap_to_all=0.0), "bounds and status"
    ),
    "the status": (
        lambda m: changed(m, status=Status.OPTIMAL, gap=0.5, lower_bound=0.5 * m.tour.length),
        "bounds and status",
    ),
    "a leg through a post": (through_a_post, "keeps clear of solids"),
    "a leg round a post": (round_a_post, "empty word at the end"),
    "a tether that is too short": (
        lambda m: m.model_copy(update={"tether_length": 0.9 * m.tour.longest_tether}),
        "within the tether's length",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("falsify", "check"), FALSE.values(), ids=FALSE)
def test_the_judge_sees_what_is_wrong(solved, falsify, check):
    verdict = verify_mission(falsify(solved[1].mission))
    assert not verdict
    assert check in [c.name for c in verdict.checks if not c.passed], str(verdict)


def test_missions_are_judged_by_command(solved, tmp_path, capsys):
    written(tmp_path)
    file = tmp_path / "planned.json"
    right = solved[1].mission.model_copy(update={"scene": "scene.json"})
    file.write_text(right.model_dump_json())
    assert main(["verify", str(file)]) == 0
    assert capsys.readouterr().out.endswith("\nverified\n")
    file.write_text(
        changed(right, length=1.0, gap_to_all=None, bound_of_all=None).model_dump_json()
    )
    assert main(["verify", str(file)]) == 5
    assert "NOT VERIFIED" in capsys.readouterr().out
    assert main(["verify", str(tmp_path / "mission.json")]) == 2
    assert "tour: the mission has none" in capsys.readouterr().err
    assert main(["verify", str(file), "--margins"]) == 2
    assert "--margins" in capsys.readouterr().err


BAD = {
    "a stop too many": (lambda t: t["stops"].append(t["stops"][0]), "tour.stops: 5 of them"),
    "a leg elsewhere": (
        lambda t: t["stops"][1]["path"].__setitem__(-1, [1.0, 1.0, 1.0]), "tour.stops[1].path: ends"
    ),
    "a leg from elsewhere": (
        lambda t: t["stops"][2]["path"].__setitem__(0, [1.0, 1.0, 1.0]),
        "tour.stops[2].path: begins",
    ),
    "home elsewhere": (lambda t: t["home"].__setitem__(-1, [3.0, 3.0, 0.0]), "tour.home: ends"),
    "no number": (lambda t: t["home"].__setitem__(0, [0.0, 0.0, "x"]), "tour.home"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "expected"), BAD.values(), ids=BAD)
def test_a_tour_that_does_not_match_is_told_in_one_line(solved, change, expected, tmp_path, capsys):
    written(tmp_path)
    data = json.loads(solved[1].mission.model_dump_json())
    data["scene"] = "scene.json"
    change(data["tour"])
    file = tmp_path / "bad.json"
    file.write_text(json.dumps(data))
    assert main(["simulate", str(file), "--quiet"]) == 2
    said = capsys.readouterr().err
    assert expected in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        (["--slack", "0.1"], "--slack: is for problems"),
        (["--roadmap", "prm"], "--roadmap: is for problems"),
        (["--keep-order"], "--keep-order: is for problems"),
        (["--warm-start", "x.json"], "--warm-start: is for problems"),
        (["--solver", "nonesuch"], "nonesuch"),
        (["--solver", "greedy-tsp"], "greedy-tsp"),
        (["--option", "nonesuch=1"], "nonesuch"),
        (["--plot", "x.bmp"], "x.bmp"),
    ],
)
def test_what_missions_do_not_take_is_told_before_anything_is_done(
    flags, expected, tmp_path, capsys
):
    out = tmp_path / "out.json"
    file = written(tmp_path)
    assert main(["solve", str(file), "-o", str(out), "--quiet", *flags]) == 2
    said = capsys.readouterr().err
    assert expected in said
    assert said.count("\n") == 1
    assert not out.exists()


def test_waypoints_that_no_tether_reaches_come_last_and_are_told(tmp_path, capsys):
    file, out = written(tmp_path, tether_length=6.2), tmp_path / "out.json"
    assert main(["solve", str(file), "-o", str(out)]) == 4
    mission = Mission.load(out)
    assert 0 < len(mission.tour.stops) < 4
    assert "left out #" in capsys.readouterr().err
    assert simulate(mission).summary["visited"] == len(mission.tour.stops)


def test_any_solver_will_do(tmp_path):
    mission = Mission.load(written(tmp_path))
    mission = mission.model_copy(update={"waypoints": mission.waypoints[:2]})
    best = plan(mission, time_limit=None).length
    for solver in ("mip", "dp", "lns", "anneal", "greedy"):
        found = plan(mission, solver=solver, time_limit=None, iteration_limit=300)
        assert found.length >= best - 1e-6
        assert found.free


def test_when_the_time_is_up_there_is_a_tour(tmp_path):
    mission = Mission.load(written(tmp_path))
    found = solve_mission(mission, time_limit=1e-3)
    assert sorted(found.order) == [0, 1, 2, 3]
    assert found.tour.longest_tether <= mission.tether_length
    assert found.run is None


@pytest.fixture
def ctrl_c():
    """Python's own handler, whatever servers of other tests have left behind."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before or signal.SIG_DFL)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_the_search_with_a_tour(tmp_path):
    mission = Mission.load(written(tmp_path))

    def press(text: str) -> None:
        if text == "judging the tour" and not pressed:
            pressed.append(text)
            signal.raise_signal(signal.SIGINT)

    pressed: list[str] = []
    found = solve_mission(mission, time_limit=None, on_progress=press)
    assert pressed
    assert len(found.tour.stops) == 4
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def pressed_twice() -> None:
    with until_interrupt(None) as clock:
        signal.raise_signal(signal.SIGINT)
        for _ in range(500):
            if clock.is_up:
                break
            threading.Event().wait(0.01)
        assert clock.is_up
        signal.raise_signal(signal.SIGINT)


@pytest.mark.usefixtures("ctrl_c")
def test_work_that_ends_at_once_after_ctrl_c_says_so():
    """A thread asks every 20 ms whether it was pressed: short work lost it."""
    with until_interrupt(None) as clock:
        signal.raise_signal(signal.SIGINT)
    assert clock.is_stopped


@pytest.mark.usefixtures("ctrl_c")
def test_whole_work_ends_and_then_interrupts():
    done: list[int] = []

    def work() -> None:
        with deferred_interrupts():
            signal.raise_signal(signal.SIGINT)
            done.append(1)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == [1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("ctrl_c")
def test_pressed_again_it_interrupts():
    with pytest.raises(KeyboardInterrupt):
        pressed_twice()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("ctrl_c")
def test_a_handler_of_somebody_else_is_left_alone():
    heard: list[int] = []
    signal.signal(signal.SIGINT, lambda *_: heard.append(1))
    with until_interrupt(None) as clock:
        signal.raise_signal(signal.SIGINT)
        assert not clock.is_up
    assert heard == [1]


POINT = st.tuples(*[st.integers(-5, 5).map(float)] * 3)


@given(st.lists(POINT, min_size=2, max_size=12))
def test_a_simplified_path_is_the_same_path(points):
    path = np.array(points)
    short = np.array(thinned_path(path))
    assert len(short) <= len(path)
    assert polylines.length(short) == pytest.approx(polylines.length(path))
    assert (short[[0, -1]] == path[[0, -1]]).all()
    # each corner that is left out lies on the path
    for p in path:
        ends = np.stack([short[:-1], short[1:]], axis=1)
        near = [
            np.linalg.norm(a + np.clip((p - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0, 1)
                           * (b - a) - p)
            for a, b in ends
        ]  # fmt: skip
        assert min(near) < 1e-6


RING_AND_BOX = {
    "schema_version": 1, "bounds": [-4, -4, -3, 4, 4, 3],
    "solids": [
        {"torus": {"center": [0, 0, 0], "axis": [1, 0, 0], "major_radius": 1.2,
                   "minor_radius": 0.15}},
        {"box": {"center": [2, 1.5, 0], "size": [1, 1, 2]}},
    ],
}  # fmt: skip


def beside_a_box(folder, tether):
    """A leg straight over the box, on which the tether is longer than at both of its ends."""
    (folder / "ring.json").write_text(json.dumps(RING_AND_BOX))
    waypoints = [[2.9, 0, 0.5], [0, 2.2, 0], [3.2, 2.8, 0], [0, 0, 2]]
    return Mission.model_validate({
        "schema_version": 1, "scene": str(folder / "ring.json"), "anchor": [-3, 0, 0],
        "start": [-2.8, 0, 0], "waypoints": waypoints, "clearance": 0.2, "tether_length": tether,
    })  # fmt: skip


def longest_by_steps(mission, step):
    """Of the tether along a tour, by the model alone, metres."""
    scene = mission.load_scene()
    field = scene.field()
    model = GeodesicTether(field, mission.delta)
    tether = present_tether(mission, field, model, mission_grid(mission, scene, field))
    _, lengths = model.drive(tether, polylines.dense(mission.tour.line, step))
    return float(lengths.max())


@pytest.fixture(scope="module")
def over_the_box(tmp_path_factory):
    return solve_mission(beside_a_box(tmp_path_factory.mktemp("box"), 9.0), time_limit=8.0).mission


@pytest.fixture(scope="module")
def longest_over_the_box(over_the_box):
    return longest_by_steps(over_the_box, 0.02)


def test_a_tether_is_as_long_as_stated_between_the_ends_of_legs_too(
    over_the_box, longest_over_the_box
):
    """Lengths were asked for at corners alone: 0.4 m too little on a straight leg."""
    tour = over_the_box.tour
    at_ends = max(stop.tether_length for stop in tour.stops)
    longest = longest_over_the_box
    assert longest > at_ends + 0.2
    assert tour.longest_tether == pytest.approx(longest, abs=over_the_box.delta)


def test_where_it_would_be_too_long_on_the_way_another_tour_is_taken(
    over_the_box, longest_over_the_box, tmp_path
):
    limit = longest_over_the_box - 0.2
    shorter = solve_mission(beside_a_box(tmp_path, limit), time_limit=8.0).mission
    assert verify_mission(shorter)
    assert longest_by_steps(shorter, 0.02) <= shorter.tether_length
    assert shorter.tour.length > over_the_box.tour.length + 0.05
    false = over_the_box.model_copy(update={"tether_length": shorter.tether_length})
    failed = [c.name for c in verify_mission(false).checks if not c.passed]
    assert "within the tether's length" in failed
