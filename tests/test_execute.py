"""A tour is carried out as planned, and mended when the world is not as it was planned for."""

import csv
import json
import re
import signal
from pathlib import Path

import numpy as np
import pytest

from netsp import Circle, InputError, Problem, Solution, solve
from netsp.command.main import main
from netsp.gtsp.travel.result import Result
from netsp.model.solution import Status
from netsp.online.execute import ExecutionOptions, Surprises, execute
from netsp.online.execute.execute_policy import RepairPolicy
from netsp.online.execute.tour_repair import plan_fault
from netsp.plan.random_worlds import random_world
from netsp.plan.tour_plan import HOME, legs_of
from netsp.world.vehicle import make_vehicle

PROBLEMS = Path(__file__).parent.parent / "problems"
FAST = ExecutionOptions(speed=1.0)


@pytest.fixture(scope="module")
def world():
    problem = random_world(goals=8, tether_length=300, seed=2)
    return problem, solve(problem)


def events(*what):
    return Surprises.model_validate({"schema_version": 1, "events": what})


def on_the_way(solution, leg, share=0.5):
    """A place on a leg of a solution's path (n: the n-th visit)."""
    legs = legs_of(*solution)
    path = legs[leg].path
    s = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    return [float(np.interp(share * s[-1], s, path[:, k])) for k in range(2)]


def check(run, goals):
    """What must hold of every run."""
    s = run.summary
    assert s["exceedance_s"] == 0.0
    assert s["defects"] == 0
    assert s["home"]
    assert s["tether_free"]
    assert all(a.as_planned for a in run.arrivals)
    assert s["visited"] + len(s["left_out"]) + len(run.cancelled) == goals
    for a in run.arrivals:
        if a.goal != HOME:
            assert a.tether == pytest.approx(a.planned_tether, rel=2e-3)


@pytest.mark.parametrize("seed", range(6))
def test_without_surprise_the_plan_is_what_happens(seed):
    problem = random_world(goals=10, tether_length=300, seed=seed)
    solution = solve(problem)
    run = execute(problem, solution, FAST)
    check(run, 10)
    assert run.summary["path"] == pytest.approx(solution.length, rel=2e-3)
    assert [a.goal for a in run.arrivals] == [*(v.goal for v in solution.tour), HOME]
    assert not run.entries


@pytest.mark.parametrize("leg", range(7))
def test_an_obstacle_on_the_way_is_gone_round(world, leg):
    problem, solution = world
    circle = {"center": on_the_way((problem, solution), leg), "radius": 8.0}
    run = execute(problem, solution, FAST, surprises=events({"time": 1.0, "appear": circle}))
    check(run, 8)
    (entry,) = run.entries
    assert entry.response in ("local", "replan")
    field = Circle(**circle)
    places = np.array([[r.x, r.y] for r in run.rows])
    assert field.signed_distance(places).min() > -0.3


def test_an_obstacle_elsewhere_changes_nothing(world):
    problem, solution = world
    away = {"center": [-900.0, -900.0], "radius": 5.0}
    run = execute(problem, solution, FAST, surprises=events({"time": 50.0, "appear": away}))
    check(run, 8)
    assert [e.response for e in run.entries] == ["kept"]
    assert run.summary["path"] == pytest.approx(solution.length, rel=2e-3)


def test_an_obstacle_within_the_loop_would_be_wrapped_and_is_not():
    """Not on the way, but on one side of it: the plan, kept, would wind the tether about it."""
    goals = [(20, 15), (20, -15)]
    problem = Problem(base=(0, 0), goals=goals, tether_length=60)
    solution = solve(problem)
    inside = {"time": 1.0, "appear": {"center": [15.0, 0.0], "radius": 2.0}}
    run = execute(problem, solution, FAST, surprises=events(inside))
    check(run, 2)
    assert "would not be free at the base" in run.entries[0].reason
    blind = execute(
        problem, solution, ExecutionOptions(speed=1.0, repair=False), surprises=events(inside)
    )
    assert not blind.summary["tether_free"]


def test_goals_are_added_and_cancelled(world):
    problem, solution = world
    last, extra = solution.tour[-1].goal, np.add(problem.base[:2], 5.0)
    what = [
        {"time": 10.0, "cancel_goal": last},
        {"time": 20.0, "add_goal": {"name": "extra", "position": extra.tolist()}},
    ]
    run = execute(problem, solution, FAST, surprises=events(*what))
    check(run, 9)
    goals = [a.goal for a in run.arrivals]
    assert last not in goals
    assert 8 in goals
    assert run.problem.goals[8].name == "extra"


def test_a_robot_that_is_pushed_comes_back_to_its_task(world):
    problem, solution = world
    run = execute(
        problem, solution, FAST, surprises=events({"time": 60.0, "push": [12.0, -9.0, 0.0]})
    )
    check(run, 8)
    places = np.array([[r.x, r.y] for r in run.rows])
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() > 5.0


def test_a_shorter_tether_loses_what_is_too_far_and_says_so(world):
    problem, solution = world
    reach = sorted(v.tether_length for v in solution.tour)
    limit = 0.5 * (reach[-1] + reach[-2])
    far = max(solution.tour, key=lambda v: v.tether_length).goal
    run = execute(problem, solution, FAST, surprises=events({"time": 1.0, "tether_length": limit}))
    check(run, 8)
    if run.left_out:
        assert set(run.left_out) == {far}
        assert "out of reach" in run.left_out[far]


def test_what_vanishes_sets_the_tether_free(world):
    problem, solution = world
    run = execute(problem, solution, FAST, surprises=events({"time": 80.0, "vanish": 0}))
    check(run, 8)
    assert len(run.problem.obstacles) == len(problem.obstacles) - 1


def test_a_goal_under_an_obstacle_is_left_out_with_the_reason(world):
    problem, solution = world
    goal = solution.tour[3].goal
    on = {"center": list(problem.goals[goal].position[:2]), "radius": 5.0}
    run = execute(problem, solution, FAST, surprises=events({"time": 1.0, "appear": on}))
    check(run, 8)
    assert "stands on it" in run.left_out[goal]


@pytest.mark.parametrize("seed", range(4))
def test_many_surprises_at_once(seed):
    rng = np.random.default_rng(seed)
    problem = random_world(goals=8, tether_length=300, seed=20 + seed)
    solution = solve(problem)
    what = [{"time": 30.0, "push": rng.uniform(-10, 10, 3).round(2).tolist()}]
    for leg in (2, 5):
        circle = {"center": on_the_way((problem, solution), leg, 0.3), "radius": 6.0}
        what.append({"time": float(rng.uniform(20, 200)), "appear": circle})
    what.append({"time": 100.0, "move": {"obstacle": 1, "by": rng.uniform(-8, 8, 2).tolist()}})
    base = np.array(problem.base[:2])
    if np.linalg.norm(np.array(problem.obstacles[1].center) - base) < 60:
        what.pop()
    run = execute(problem, solution, FAST, surprises=events(*what))
    check(run, 8)


def test_what_is_whole_is_not_called_broken(world):
    problem, solution = world
    tether = np.array([problem.base, problem.base])
    why, legs = plan_fault(problem, tether, legs_of(problem, solution))
    assert why is None
    assert [leg.word for leg in legs] == [*(v.signature for v in solution.tour), ()]


def test_a_dynamic_vehicle_in_a_current_carries_it_out_too():
    problem = Problem.load(PROBLEMS / "pool.json")
    problem = problem.model_copy(update={"goals": problem.goals[:3]})
    run = execute(
        problem, solve(problem),
        ExecutionOptions(vehicle="bluerov2", speed=0.4, current=(0.05, 0.03, 0.0), gusts=0.02),
    )  # fmt: skip
    s = run.summary
    assert s["visited"] == len(problem.goals)
    assert s["arrivals_as_planned"] == len(problem.goals) + 1
    assert s["exceedance_s"] == 0.0


def test_the_same_seed_gives_the_same_run(world):
    problem, solution = world
    circle = {"center": on_the_way((problem, solution), 4), "radius": 8.0}
    a, b = (
        execute(problem, solution, FAST, surprises=events({"time": 1.0, "appear": circle}))
        for _ in range(2)
    )
    assert a.rows == b.rows


def test_execute_writes_its_logs_and_pictures(tmp_path, capsys):
    problem, solution, run = PROBLEMS / "wharf.json", tmp_path / "s.json", tmp_path / "run"
    assert main(["solve", str(problem), "-o", str(solution), "--quiet"]) == 0
    surprises = tmp_path / "surprises.json"
    surprises.write_text('{"schema_version": 1, "events": [{"time": 20, "push": [1, 1, 0]}]}')
    code = main(
        ["execute", str(problem), str(solution), "--surprise", str(surprises), "-o", str(run)]
    )
    assert code == 0
    assert re.search(r"push at [\d.]+ s: local", capsys.readouterr().err)
    names = {p.name for p in run.iterdir()}
    assert names >= {"log.csv", "visits.csv", "events.csv", "summary.json", "run.png"}
    with open(run / "visits.csv") as file:
        rows = list(csv.DictReader(file))
    assert all(r["as_planned"] == "True" for r in rows)
    assert len(rows) == 9
    summary = json.loads((run / "summary.json").read_text())
    assert summary["tether_free"]


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ({"time": 1}, "expected one of appear"),
        ({"time": 1, "vanish": 0, "push": [0, 0, 0]}, "got vanish, push"),
        ({"time": 1, "vanish": 99}, r"events\[0\]: vanish: expected a number below 8, got 99"),
        (
            {"time": 1, "vanish": "no such"},
            "expected the name of one, got 'no such', of which there are 0; there are '",
        ),
        ({"time": 1, "cancel_goal": 99}, "cancel_goal: expected a number below 8"),
        ({"time": -1, "push": [0, 0, 0]}, r"events\[0\].*time"),
        ({"time": 1, "appear": {"center": [0, 0], "radius": 2}}, "would stand on the base"),
        ({"time": 1, "tether_length": 0}, "tether_length"),
    ],
)
def test_bad_surprises_are_named(event, message, tmp_path, capsys):
    file, solution = tmp_path / "e.json", tmp_path / "s.json"
    file.write_text(json.dumps({"schema_version": 1, "events": [event]}))
    problem = PROBLEMS / "wharf.json"
    main(["solve", str(problem), "-o", str(solution), "--quiet"])
    assert main(["execute", str(problem), str(solution), "--surprise", str(file)]) == 2
    err = capsys.readouterr().err.strip().splitlines()[-1]

    assert re.search(message, err), err


def test_solutions_that_do_not_belong_or_fail_are_refused(world):
    problem, solution = world
    other = random_world(goals=8, tether_length=300, seed=3)
    with pytest.raises(InputError, match="belongs to the problem"):
        execute(other, solution)
    wrong = solution.model_copy(update={"tour": solution.tour[::-1]})
    with pytest.raises(InputError, match="fails its check"):
        execute(problem, wrong)
    blind = solve(problem, "greedy-tsp")
    if blind.status.value == "invalid":
        with pytest.raises(InputError, match="has status invalid"):
            execute(problem, blind)
    assert isinstance(solution, Solution)


AWAY = {"center": [-900.0, -900.0], "radius": 5.0}
CORNER = Problem(base=(0, 0), goals=[(40, 0), (40, 20)], tether_length=80)


@pytest.mark.parametrize("when", [97.0, 197.0])
def test_events_near_the_end_of_a_leg_take_no_time_from_it(when):
    problem = Problem(base=(0, 0), goals=[(100, 0)], tether_length=150)
    run = execute(
        problem, solve(problem), FAST, surprises=events({"time": when, "appear": AWAY})
    )  # fmt: skip
    check(run, 1)
    assert not run.left_out


@pytest.mark.parametrize("centre", [(20.0, 0.0), (20.0, 0.5), (18.0, -3.0), (24.0, 1.0)])
@pytest.mark.parametrize("clearance", [0.0, 1.0])
def test_an_obstacle_upon_the_robot_or_its_tether_puts_them_aside(centre, clearance):
    problem = CORNER.model_copy(update={"clearance": clearance})
    what = {"time": 20.0, "appear": {"center": list(centre), "radius": 5.0}}
    run = execute(problem, solve(problem), FAST, surprises=events(what))
    check(run, 2)


def test_obstacles_that_touch_are_gone_round_together():
    what = [
        {"time": 20.0, "appear": {"center": [20.0, y], "radius": 3.0}} for y in (6.0, 0.0, -6.0)
    ]
    check(execute(CORNER, solve(CORNER), FAST, surprises=events(*what)), 2)


def test_a_base_that_is_walled_in_but_for_a_gap_is_reached_through_it():
    wall = [[-5, -5], [8, -5], [8, 5], [-5, 5], [-5, 0.1], [-4, 0.1], [-4, 4], [7, 4], [7, -4],
            [-4, -4], [-4, -0.1], [-5, -0.1]]  # fmt: skip
    what = {"time": 20.0, "appear": {"polygon": wall}}
    check(execute(CORNER, solve(CORNER), FAST, surprises=events(what)), 2)


def test_a_push_ends_where_the_tether_holds():
    what = {"time": 20.0, "push": [0.0, 500.0, 0.0]}
    run = execute(CORNER, solve(CORNER), FAST, surprises=events(what))
    check(run, 2)
    assert run.summary["longest_tether"] <= 80.0


def test_without_repair_nothing_is_mended_and_nothing_forgotten():
    what = [{"time": 1.0, "add_goal": [5, 5]}, {"time": 2.0, "cancel_goal": 0}]
    run = execute(
        CORNER, solve(CORNER), ExecutionOptions(speed=1.0, repair=False), surprises=events(*what)
    )
    assert run.summary["visited"] == 2
    assert not run.cancelled
    assert "not repaired" in run.left_out[2]
    wall = {"time": 1.0, "appear": {"polygon": [[10, -40], [12, -40], [12, 40], [10, 40]]}}
    run = execute(
        CORNER, solve(CORNER), ExecutionOptions(speed=1.0, repair=False), surprises=events(wall)
    )
    assert set(run.left_out) == {0, 1}
    assert {e.response for e in run.entries} == {"ignored"}


def test_events_after_the_end_are_said_to_be():
    what = {"time": 1e6, "add_goal": [5, 5]}
    run = execute(CORNER, solve(CORNER), FAST, surprises=events(what))
    assert "after the end" in run.left_out[2]
    assert run.entries[-1].response == "ignored"


def test_a_resolution_that_obstacles_slip_through_is_refused():
    problem = Problem.load(PROBLEMS / "wharf.json")
    with pytest.raises(InputError, match=r"delta: expected at most 0\.6667"):
        execute(problem, solve(problem), ExecutionOptions(delta=1000.0))


def test_a_repair_in_the_same_order_starts_at_the_robot(world):
    """The tether that is out is no part of the path to come: it is behind the robot."""
    from netsp.online.execute.tour_repair import RepairOptions, repair

    problem, solution = world
    robot = np.add(solution.path[0], (0.0, 0.5, 0.0))
    order = [v.goal for v in solution.tour]
    made = repair(
        problem, robot, np.array([problem.base, robot]), order, "a test", RepairOptions(1e9)
    )
    assert made.kind == "local"
    assert [leg.goal for leg in made.legs] == [*order, HOME]
    assert np.allclose(made.legs[0].path[0], robot)
    assert sum(leg.length for leg in made.legs) == pytest.approx(made.length, rel=1e-3)
    assert made.length == pytest.approx(solution.length, rel=0.02)


@pytest.mark.parametrize(
    ("bound", "words"), [(1.0, "no new order that saves enough was found"), (1e9, "would not save")]
)
def test_only_a_bound_shows_that_no_new_order_would_save_enough(world, monkeypatch, bound, words):
    import netsp.online.execute.tour_repair as module

    problem, solution = world
    robot = np.add(solution.path[0], (0.0, 0.5, 0.0))
    found = Result(None, None, bound, Status.NO_SOLUTION_FOUND)
    monkeypatch.setattr(module, "solve_graph", lambda *args, **options: found)
    tether = np.array([problem.base, robot])
    how = module.RepairOptions(0.01, policy=RepairPolicy(time_limit_s=60.0))
    made = module.repair(problem, robot, tether, list(range(8)), "a test", how)
    assert made.kind == "local"
    assert words in made.reason


def test_an_interrupt_while_a_new_order_is_searched_ends_the_run(monkeypatch):
    import netsp.online.execute.tour_repair as module

    solve_graph = module.solve_graph

    def interrupted_search(*args, **options):
        def interrupt(_):
            signal.raise_signal(signal.SIGINT)

        return solve_graph(*args, on_progress=interrupt, **options)

    monkeypatch.setattr(module, "solve_graph", interrupted_search)
    monkeypatch.setattr(module, "_lower_bound_of_rest", lambda *_: 0.0)
    push = events({"time": 5.0, "push": [1.0, 1.0, 0.0]})
    # what a shell starts in the background ignores Ctrl-C, and so would the run
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        run = execute(CORNER, solve(CORNER), FAST, surprises=push)
    finally:
        signal.signal(signal.SIGINT, before)
    assert run.interrupted
    assert run.summary["defects"] == 0
    assert run.summary["visited"] == 0


def test_an_interrupt_after_the_end_of_a_run_loses_no_file(tmp_path, monkeypatch):
    import netsp.online.execute.execution_files as module

    write_execution = module.write_execution

    def interrupted_write(*args):
        signal.raise_signal(signal.SIGINT)
        write_execution(*args)

    monkeypatch.setattr(module, "write_execution", interrupted_write)
    monkeypatch.chdir(tmp_path)
    Path("p.json").write_text(CORNER.to_json())
    solve(CORNER).save(Path("s.json"))
    assert main(["execute", "p.json", "s.json", "-o", "run", "--speed", "10", "--quiet"]) == 0
    assert Path("run", "summary.json").exists()
    assert Path("run", "run.png").exists()


def test_a_defect_is_no_reason_it_is_counted_and_told_by_the_exit_code(
    world, tmp_path, monkeypatch
):
    import netsp.online.execute.tour_execution

    def broken_repair(*_):
        raise RuntimeError("something that nobody foresaw")

    monkeypatch.setattr(netsp.online.execute.tour_execution, "repair", broken_repair)
    problem, solution = world
    (tmp_path / "p.json").write_text(problem.to_json())
    solution.save(tmp_path / "s.json")
    what = [{"time": 90.0, "push": [30.0, 5.0, 0.0]}]
    (tmp_path / "e.json").write_text(json.dumps({"schema_version": 1, "events": what}))
    code = main(["execute", str(tmp_path / "p.json"), str(tmp_path / "s.json"), "--surprise",
                 str(tmp_path / "e.json"), "-o", str(tmp_path / "run"), "--quiet"])  # fmt: skip
    assert code == 1
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["defects"] == 1
    assert summary["home"]
    assert summary["tether_free"]
    assert "something that nobody foresaw" in (tmp_path / "run" / "events.csv").read_text()


def test_planning_takes_its_time_and_the_robot_holds_its_place(world):
    problem, solution = world
    push = events({"time": 30.0, "push": [4.0, 4.0, 0.0]})
    run = execute(
        problem, solution, ExecutionOptions(speed=1.0, planning_limit=1.5), surprises=push
    )
    check(run, 8)
    held = [r for r in run.rows if r.mode == "hold"]
    assert held[-1].time - held[0].time == pytest.approx(1.5, abs=0.2)
    assert len({(r.x, r.y, r.z) for r in held}) == 1
    assert max(e.planning_s for e in run.entries) < 1.5 + 1.0


def test_goals_come_back_when_the_tether_gets_longer(world):
    problem, solution = world
    what = [{"time": 5.0, "tether_length": 60.0}, {"time": 8.0, "tether_length": 300.0}]
    run = execute(problem, solution, FAST, surprises=events(*what))
    check(run, 8)
    assert not run.left_out
    assert run.summary["visited"] == 8


def test_a_tether_far_longer_than_its_new_limit_still_comes_home(world):
    problem, solution = world
    run = execute(problem, solution, FAST, surprises=events({"time": 200, "tether_length": 1e-9}))
    assert run.summary["defects"] == 0
    assert run.summary["home"]
    assert run.summary["tether_free"]
    assert all("out of reach" in why for why in run.left_out.values())


def test_a_goal_that_was_left_out_may_still_be_cancelled():
    problem = Problem(base=(0, 0), goals=[(4, 0), (0, 4), (-4, 0)], tether_length=6)
    events = Surprises.model_validate({"events": [
        {"time": 0.5, "appear": {"center": (0.0, 4.0), "radius": 0.5}},
        {"time": 2.0, "cancel_goal": 1},
    ], "schema_version": 1})  # fmt: skip
    run = execute(problem, solve(problem), surprises=events)
    assert run.left_out == {}
    assert set(run.cancelled) == {1}


class GoesOn:
    """A vehicle with a clock of its own that takes half a metre to hold its place."""

    control_s = ()

    def __init__(self, start):
        self._own, self.time = make_vehicle("kinematic", np.array(start), 0.5), 0.0
        self._on = np.zeros(3)

    position = property(lambda self: self._own.position)
    yaw = property(lambda self: self._own.yaw)

    def go(self, path, seconds, *more):
        before = self.position.copy()
        self.time += seconds
        done = self._own.go(path, seconds, *more)
        self._on = self.position - before
        return done

    def hold(self):
        size = float(np.linalg.norm(self._on))
        self.stop_at(self.position + (0.5 * self._on / size if size else 0.0))

    def stop_at(self, place):
        self._own.stop_at(place)


@pytest.mark.parametrize("when", [20.2, 20.6, 21.0, 21.4, 21.8, 22.2])
def test_a_repair_knows_on_which_side_of_an_obstacle_the_robot_came_to_rest(when):
    """On its way to a goal the robot goes past the buoy at (9.4, 3.3) while it comes to a halt. A
    tether that stays behind meanwhile would be planned for as if it passed on the other side."""
    problem = Problem.load(PROBLEMS / "pool.json")
    solution = solve(problem, seed=0, time_limit=20.0)
    boat = {"center": [10.765, 2.379], "radius": 0.2527}
    run = execute(
        problem, solution, ExecutionOptions(speed=0.5), vehicle=GoesOn(problem.base),
        surprises=events({"time": when, "appear": boat}),
    )  # fmt: skip
    assert [a.word for a in run.arrivals] == [a.planned for a in run.arrivals]
    assert run.summary["home"]
    assert run.summary["tether_free"]
    assert run.summary["longest_tether"] <= problem.tether_length
