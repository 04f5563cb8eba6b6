"""What becomes of a vehicle after its flight, 30 s beyond the end, on the autopilot's own clock."""

import signal

import numpy as np
import pytest

from netsp import Circle, Problem, solve
from netsp.command.main import main
from netsp.online.execute import execution_log
from netsp.online.execute.execution_log import ExecutionOptions
from netsp.online.execute.run_record import RunState
from netsp.online.execute.tour_execution import _Run
from netsp.online.fly import tour_flight
from netsp.online.fly.resume import read_run
from netsp.online.fly.standby import stand_by
from netsp.online.fly.tour_flight import fly
from tests.simulated_session import SimulatedSession

SITE = Problem(
    base=(0, 0), goals=[(6, 2, -1)], tether_length=12,
    obstacles=[Circle(center=(4, 0), radius=0.6, name="pile")], clearance=0.4,
)  # fmt: skip
OPTIONS = ExecutionOptions(speed=0.5, reach=0.3)
BEYOND = 30.0
"""Seconds to look beyond the end of a flight."""


@pytest.fixture(scope="module")
def tour():
    return solve(SITE)


@pytest.fixture(autouse=True)
def rehearsed(monkeypatch):
    """Nothing is in a hurry on a clock that waits."""
    monkeypatch.setattr(tour_flight, "rehearse", lambda: None)


def after(session, seconds, do):
    """Return a step that does something once, after some seconds of the flight."""
    done = []

    def on_step(row):
        if row.time >= seconds and not done:
            done.append(do(session))

    return on_step


def stop(session):
    raise KeyboardInterrupt


ENDS = {
    "done": None,
    "Ctrl-C": stop,
    "pushed": lambda s: s.simulation.do(do="push", by=[-1.5, -2.5, 0]),
    "link lost for a while": lambda s: s.simulation.do(do="silence", seconds=4.0),
}


@pytest.mark.parametrize("how", ENDS)
def test_a_vehicle_is_held_until_somebody_says_otherwise(tour, how):
    session = SimulatedSession(SITE).arm()
    on_step = None if ENDS[how] is None else after(session, 8.0, ENDS[how])
    done = fly(SITE, tour, session, OPTIONS, on_step=on_step)
    assert (done.summary["status"] == "done") is (how == "done"), done.stopped
    end, said = session.simulation.now, []
    why = stand_by(
        session, on_note=said.append, should_stop=lambda: session._seconds() > end + BEYOND
    )
    assert why == "Ctrl-C"
    assert session.heard("disarmed") == []
    track = session.truth
    late = track[track[:, 0] > end + 18.0, 1:3]  # 3 m back where it was pushed
    assert np.linalg.norm(late - late[0], axis=1).max() < 0.3
    assert "holds its place" in said[0]
    assert "disarms and drifts after 5 s" in said[0]


@pytest.mark.parametrize(("ending", "mode"), [("position-hold", 16), ("surface", 9)])
def test_the_vehicle_holds_its_position_or_comes_up_as_asked(tour, ending, mode):
    session = SimulatedSession(SITE).arm()
    fly(SITE, tour, session, OPTIONS, on_step=after(session, 18.0, stop))
    end = session.simulation.now
    stand_by(session, ending, should_stop=lambda: session._seconds() > end + BEYOND)
    assert session.simulation.vehicle.mode == mode
    assert session.heard("disarmed") == []
    assert bool(session.truth[-1, 3] > -0.1) is (ending == "surface")


def test_another_ground_station_that_the_vehicle_counts_on_takes_over(tour):
    session = SimulatedSession(SITE).arm()
    fly(SITE, tour, session, OPTIONS, on_step=after(session, 8.0, stop))
    end, said = session.simulation.now, []
    session.stations = {(254, 190): end + 5.0, (255, 190): end + 20.0}
    why = stand_by(
        session, on_note=said.append, should_stop=lambda: session._seconds() > end + 60.0
    )
    assert "ground station" in why
    assert end + 20.0 <= session.simulation.now < end + 22.0
    assert any("254" in text and "keeps the link alive" in text for text in said)
    session.close()
    session.begin_at(end + 60.0)
    assert session.heard("disarmed") == []


def test_what_the_vehicle_will_do_is_asked_for_until_it_is_told(tour):
    """A link that loses the first question for each parameter."""
    session, asked = SimulatedSession(SITE, params={"FS_GCS_TIMEOUT": 42}).arm(), set()
    fly(SITE, tour, session, OPTIONS, on_step=after(session, 4.0, stop))
    receive, said = session.simulation.vehicle.receive, []

    def deaf(message):
        if message.get_type() == "PARAM_REQUEST_READ" and message.param_id not in asked:
            asked.add(message.param_id)
            return
        receive(message)

    session.simulation.vehicle.receive = deaf
    stand_by(session, on_note=said.append, should_stop=lambda: bool(said))
    assert "after 42 s" in said[0]


def test_nobody_waits_for_a_vehicle_that_needs_nobody_or_is_gone(tour):
    for params, befall, why in (
        ({"FS_GCS_ENABLE": 0}, {}, "FS_GCS_ENABLE"),
        ({}, {"do": "disarm"}, "is disarmed"),
        ({}, {"do": "silence", "seconds": 1000.0}, "not heard for 60 s"),
    ):
        session = SimulatedSession(SITE, params=params).arm()
        fly(SITE, tour, session, OPTIONS, on_step=after(session, 8.0, stop))
        if befall:
            session.simulation.do(**befall)
        assert why in stand_by(session)


def test_a_pilot_who_has_taken_over_is_left_alone_and_the_link_kept_alive(tour):
    session = SimulatedSession(SITE).arm()
    pilot = after(session, 8.0, lambda s: s.simulation.do(do="mode", mode=19))
    fly(SITE, tour, session, OPTIONS, on_step=pilot)
    end, said = session.simulation.now, []
    sent = len(session.heard("target"))
    stand_by(session, "position-hold", on_note=said.append,
             should_stop=lambda: session._seconds() > end + BEYOND)  # fmt: skip
    assert session.simulation.vehicle.mode == 19
    assert (session.heard("disarmed"), len(session.heard("target"))) == ([], sent)
    assert "does not steer it" in said[0]


def commanded(monkeypatch, tmp_path, tour, session, *more):
    """Return the words of the command for a session; the run goes to ``tmp_path / "run"``."""
    problem, solution, run = tmp_path / "p.json", tmp_path / "s.json", tmp_path / "run"
    problem.write_text(SITE.to_json())
    solution.write_text(tour.to_json())
    monkeypatch.setattr("netsp.online.link.session.Session", lambda *_: session)
    monkeypatch.setattr("netsp.online.link.udp.UdpLink", lambda *_: None)
    monkeypatch.setattr("netsp.online.fly.flight_rehearsal.rehearse", lambda: None)
    return ["fly", str(problem), str(solution), "--link", "udpin:14550", "-o", str(run), *more]


def broken(error, when):
    """Return a method of a run that raises an error after some seconds of it."""
    go = _Run.go

    def step(run):
        if run.now >= when:
            raise error
        go(run)

    return step


@pytest.mark.parametrize(
    ("error", "where"),
    [
        (RuntimeError("no such thing"), "netsp.online.execute.tour_execution._Run.go"),
        (OSError(28, "No space left on device"), "netsp.online.execute.tour_execution._Run.go"),
        (RuntimeError("no such thing"), "netsp.view.pictures.execution.save_execution"),
    ],
)
def test_whatever_breaks_in_netsp_the_vehicle_is_held_and_the_error_told_in_the_end(
    tour, tmp_path, monkeypatch, capfd, error, where
):
    session, run = SimulatedSession(SITE).arm(), tmp_path / "run"
    words = commanded(monkeypatch, tmp_path, tour, session)
    is_flight = where.endswith("go")

    def fail(*_):
        raise error

    monkeypatch.setattr(where, broken(error, 8.0) if is_flight else fail)
    begin = session.simulation.now
    session.stations = {(255, 190): begin + 80.0}
    if isinstance(error, OSError):
        assert main(words) == 2
    else:
        with pytest.raises(RuntimeError, match="no such thing"):
            main(words)
    assert session.simulation.now == pytest.approx(begin + 80.0, abs=1.0)
    assert session.heard("disarmed") == []
    track = session.truth
    late = track[track[:, 0] > begin + (20.0 if is_flight else 45.0), 1:3]
    assert np.linalg.norm(late - late[0], axis=1).max() < 0.3
    told = capfd.readouterr().err
    assert f"{type(error).__name__}: {error}; the flight ends here" in told
    assert "the vehicle holds its place" in told
    state = RunState.load(run / "state.json")
    if is_flight:
        assert state.time == pytest.approx(8.0, abs=0.5)
        _, _, left = read_run(run)
        assert left.left == (0,)


def test_ctrl_c_while_the_files_are_written_does_not_break_them_off(
    tour, tmp_path, monkeypatch, capfd
):
    """The command prints what the vehicle will do, and then ends."""
    session, pressed = SimulatedSession(SITE).arm(), []
    words = commanded(monkeypatch, tmp_path, tour, session)
    sleep, write = session.sleep, execution_log.Execution.summary.fget

    def press(seconds):
        sleep(seconds)
        if session.simulation.now > 12.0 and not pressed:
            pressed.append(1)
            signal.raise_signal(signal.SIGINT)

    def summary(done):
        if len(pressed) == 1:
            pressed.append(2)
            signal.raise_signal(signal.SIGINT)
        return write(done)

    monkeypatch.setattr(session, "sleep", press)
    monkeypatch.setattr(execution_log.Execution, "summary", property(summary))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert main(words) == 4
    finally:
        signal.signal(signal.SIGINT, before)
    assert pressed == [1, 2]
    assert {"summary.json", "run.png", "log.csv"} <= {p.name for p in (tmp_path / "run").iterdir()}
    assert "disarms and drifts after 5 s" in capfd.readouterr().err


@pytest.mark.parametrize("pressed", [(), (8.0,), (8.0, 30.0)])
def test_the_command_ends_with_another_ground_station_or_the_second_ctrl_c(
    tour, tmp_path, monkeypatch, capfd, pressed
):
    """The first Ctrl-C ends the flight, and its files are written before anybody waits."""
    session, run = SimulatedSession(SITE).arm(), tmp_path / "run"
    words = commanded(monkeypatch, tmp_path, tour, session)
    begin, left, sleep, written = session.simulation.now, list(pressed), session.sleep, []

    def press(seconds):
        sleep(seconds)
        if left and session.simulation.now - begin >= left[0]:
            left.pop(0)
            written.append((run / "summary.json").exists())
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(session, "sleep", press)
    takes_over = begin + (80.0 if len(pressed) < 2 else 1e9)
    session.stations = {(255, 190): takes_over}
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        code = main(words)
    finally:
        signal.signal(signal.SIGINT, before)
    assert code == (4 if pressed else 0)
    assert written == [False, True][: len(pressed)]
    ended = session.simulation.now
    session.begin_at(max(ended, takes_over if len(pressed) < 2 else 0.0) + 1.0)
    assert session.heard("disarmed") == []
    assert ended == pytest.approx(takes_over if len(pressed) < 2 else begin + 30.0, abs=1.0)
    assert "Ctrl-C ends that" in capfd.readouterr().err
