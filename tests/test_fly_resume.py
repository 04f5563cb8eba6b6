"""Flights that were broken off go on where the vehicle is, in the class that the tether has."""

import contextlib
import csv
import json
import time

import numpy as np
import pytest

from netsp import Circle, Problem, solve
from netsp.base.errors import InputError
from netsp.command.main import main
from netsp.hsignature import signature
from netsp.online.execute import run_record
from netsp.online.execute.events import Event, Surprises
from netsp.online.execute.execution_log import ExecutionOptions, describe_execution
from netsp.online.execute.run_record import RunRecord, RunState
from netsp.online.fly import tour_flight
from netsp.online.fly.resume import (
    from_guard,
    from_record,
    from_word,
    parse_class,
    read_run,
    whole_tour,
)
from netsp.online.fly.stopped import RefusedError
from netsp.online.fly.tour_flight import fly
from netsp.online.guard.plane import PlaneSite
from tests.simulated_session import SimulatedSession

SITE = Problem(
    base=(0, 0), goals=[(6, 2, -1), (6.5, -2, -1)], tether_length=12,
    obstacles=[Circle(center=(4, 0), radius=0.6, name="pile")], clearance=0.4,
)  # fmt: skip
OPTIONS = ExecutionOptions(speed=0.5, reach=0.3)


class KilledError(BaseException):
    """The process is gone: nobody catches this on the way."""


@pytest.fixture(scope="module")
def tour():
    return solve(SITE)


@pytest.fixture(autouse=True)
def rehearsed(monkeypatch):
    monkeypatch.setattr(tour_flight, "rehearse", lambda: None)


def killed(tour, folder, when, seconds=10.0, **how):
    """Kill a flight, and leave the vehicle alone for a while; return its session."""
    session = SimulatedSession(SITE).arm()

    def kill(row):
        if row.time >= when:
            raise KilledError

    with pytest.raises(KilledError):
        fly(SITE, tour, session, OPTIONS, on_step=kill, record=RunRecord(folder, tour), **how)
    session.close()
    session.begin_at(session.simulation.now + seconds)
    return session


def after_kill(session):
    return SimulatedSession(SITE, session.simulation).arm()


@pytest.mark.parametrize("when", [4.0, 17.0, 30.0])
def test_a_flight_that_was_killed_is_resumed_in_its_class(tour, tmp_path, when):
    session = killed(tour, tmp_path, when)
    assert session.heard("disarmed")
    rows = list(csv.DictReader((tmp_path / "log.csv").read_text().splitlines()))
    assert float(rows[-1]["time"]) == pytest.approx(when, abs=0.3)
    problem, plan, state = read_run(tmp_path)
    assert (problem, plan.tour) == (SITE, tour.tour)
    assert when - 1.3 <= state.time <= float(rows[-1]["time"])
    again = after_kill(session)
    begins = from_record(problem, state)
    done = fly(problem, plan, again, OPTIONS, begins=begins)
    s = done.summary
    assert (s["status"], s["visited"], s["home"]) == ("done", len(state.left), True), done.stopped
    assert s["tether_free"]
    assert s["exceedance_s"] == 0.0
    assert "than planned" not in describe_execution(done).split("tether ")[0]  # the whole tour
    true = np.vstack([[0.0, 0.0], session.truth[:, 1:3]])
    assert signature(np.vstack([true, [[0.0, 0.0]]]), SITE.representative_points) == ()
    assert {v.goal for v in tour.tour} == {a.goal for a in done.arrivals if a.goal >= 0} | (
        {v.goal for v in tour.tour} - set(state.left)
    )


def test_events_outlive_a_flight_that_was_killed(tour, tmp_path):
    boat = Circle(center=(3.0, 1.6), radius=0.4, name="boat")
    events = [[], [], [Event(time=0, appear=boat)], [Event(time=0, cancel_goal=1)]]
    killed(tour, tmp_path, 12.0, incoming=lambda: events.pop(0) if events else [])
    problem, _, state = read_run(tmp_path)
    assert [o.name for o in problem.obstacles] == ["pile", "boat"]
    assert (state.left, state.cancelled) == ((0,), (1,))


def test_a_run_beside_the_problem_of_another_is_not_resumed(tour, tmp_path):
    killed(tour, tmp_path, 4.0)
    read_run(tmp_path)
    other = SITE.model_copy(update={"tether_length": SITE.tether_length + 1.0})
    other.save(tmp_path / "problem.json")
    with pytest.raises(InputError, match=r"state\.json: problem_sha256: .*expected the problem"):
        read_run(tmp_path)


@pytest.mark.parametrize("n_files", [0, 1, 2, 3])
def test_a_run_killed_as_its_problem_is_replaced_is_resumed(tour, tmp_path, monkeypatch, n_files):
    killed(tour, tmp_path, 4.0)
    state, written = read_run(tmp_path)[2], []
    record = RunRecord(tmp_path, tour)
    record.write_state(SITE, state)

    def write_text(file, text):
        if len(written) == n_files:
            raise KilledError
        written.append(file.name)
        file.write_text(text)

    monkeypatch.setattr(run_record, "write_text", write_text)
    longer = SITE.model_copy(update={"tether_length": SITE.tether_length + 1.0})
    with contextlib.suppress(KilledError):
        record.write_state(longer, state)
    assert written == ["state.json", "problem.json", "state.json"][:n_files]
    problem, _, _ = read_run(tmp_path)
    assert problem.tether_length == (SITE if n_files < 2 else longer).tether_length


def test_a_flight_is_resumed_when_an_obstacle_stands_on_a_goal(tour, tmp_path):
    last = tour.tour[-1].goal
    boat = Circle(center=SITE.goals[last].position[:2], radius=0.4, name="boat")
    events = [[], [], [Event(time=0, appear=boat)]]
    session = killed(tour, tmp_path, 9.0, incoming=lambda: events.pop(0) if events else [])
    problem, plan, state = read_run(tmp_path)
    assert [g.goal for g in state.left_out] == [last]
    done = fly(problem, plan, after_kill(session), OPTIONS, begins=from_record(problem, state))
    assert (done.summary["home"], done.summary["tether_free"]) == (True, True)
    assert "boat stands on it" in done.left_out[last]


def test_a_resumed_flight_keeps_the_reserve_of_its_plan(tour, tmp_path):
    session = killed(
        tour, tmp_path, 8.0, surprises=Surprises(events=(Event(time=2.0, tether_length=9.0),))
    )
    problem, plan, state = read_run(tmp_path)
    assert problem.tether_length == 9.0
    longest = max(v.tether_length for v in tour.tour)
    assert state.reserve == pytest.approx(min(1.2, 12.0 - longest))
    done = fly(problem, plan, after_kill(session), OPTIONS, begins=from_record(problem, state))
    assert done.reserve == state.reserve


@pytest.mark.parametrize("word", ["1", ""])
def test_a_flight_begins_where_the_vehicle_is_with_the_class_of_the_operator(tour, word):
    """Between the base and a vehicle beyond the pile the tether lies on one side or the other."""
    session = SimulatedSession(SITE, start=(6.0, 0.3, -1.0)).arm()
    with pytest.raises(RefusedError, match="from the start of the tour"):
        fly(SITE, tour, session, OPTIONS)
    begins = from_word(SITE, parse_class(word), whole_tour(SITE, tour))
    first = begins(np.array([6.0, 0.3, -1.0])).tether
    assert signature(first[:, :2], SITE.representative_points) == parse_class(word)
    done = fly(SITE, tour, session, OPTIONS, begins=begins)
    s = done.summary
    assert (s["status"], s["visited"], s["home"], s["tether_free"]) == ("done", 2, True, True)


def test_a_class_that_is_not_known_is_asked_for(tour, tmp_path):
    state = RunState(time=3.0, tether=((0, 0, 0), (3, 0, -1)), left=(0,))
    begins = from_record(SITE, state)
    with pytest.raises(RefusedError, match=r"pile lies between.*--class"):
        begins(np.array([5.0, 0.0, -1.0]))
    with pytest.raises(RefusedError, match=r"12\.0 m from where it was last.*--class"):
        begins(np.array([3.0, 12.0, -1.0]))
    for text in ("A1", "0", "1;2"):
        with pytest.raises(InputError, match="--class"):
            parse_class(text)
    with pytest.raises(InputError, match="up to 1"):
        from_word(SITE, (2,), state)
    for bad, field in (
        ({"left": (2,)}, "left"), ({"tether": ((1, 0, 0), (3, 0, -1))}, "tether"),
        ({"cancelled": (2,)}, "cancelled"), ({"left": (0, 0)}, "left"),
        ({"left": (0,), "cancelled": (0,)}, "left"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"state.json: {field}: expected"):
            state.model_copy(update=bad).check(SITE, "state.json")
    with pytest.raises(InputError, match=r"state\.json"):
        read_run(tmp_path)


@pytest.mark.parametrize(("cost", "known"), [(9.0, True), (1.0, False)])
def test_a_guard_s_state_says_the_class_where_it_is_sure(tour, tmp_path, cost, known):
    file = tmp_path / "guard.json"
    at = [3.0, 1.5, -1.0]
    file.write_text(json.dumps({
        "schema_version": 1, "site": PlaneSite(SITE).identity, "saved": time.time(), "position": at,
        "classes": [
            {"word": [], "cost": 0.0, "tether": [[0, 0, 0], at]}, {"word": [1], "cost": cost},
        ],
    }))  # fmt: skip
    if not known:
        with pytest.raises(InputError, match=r"as likely as the next.*--class"):
            from_guard(SITE, file, whole_tour(SITE, tour))
        return
    begun = from_guard(SITE, file, whole_tour(SITE, tour))(np.array([3.5, 1.5, -1.0]))
    assert np.allclose(begun.tether[-1], [3.5, 1.5, -1.0])
    assert sorted(begun.left) == [0, 1]


def test_the_command_resumes_a_run_and_writes_another(tour, tmp_path, monkeypatch, capsys):
    run = tmp_path / "run"
    session = killed(tour, run, 17.0)
    log = (run / "log.csv").read_text()
    again = after_kill(session)
    again.stations = {(255, 190): 0.0}
    monkeypatch.setattr("netsp.online.link.session.Session", lambda *_: again)
    monkeypatch.setattr("netsp.online.link.udp.UdpLink", lambda *_: None)
    monkeypatch.setattr("netsp.online.fly.flight_rehearsal.rehearse", lambda: None)
    given = ["fly", "--resume", str(run), "--link", "udpin:14550", "--quiet"]
    assert main([*given, "-o", str(run)]) == 2
    assert main([*given, "--dry-run"]) == 2
    assert main(["fly", "--link", "udpin:14550"]) == 2
    assert main(given) == 0, capsys.readouterr().err
    summary = json.loads((run / "resumed" / "summary.json").read_text())
    assert (summary["status"], summary["home"], summary["tether_free"]) == ("done", True, True)
    assert (run / "log.csv").read_text() == log
    assert "resumed" in (run / "resumed" / "events.csv").read_text()
