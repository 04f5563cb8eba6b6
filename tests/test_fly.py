"""A tour flown by a vehicle over MAVLink, and what stops it."""

import functools
import io
import json
import random
import re
import signal
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from netsp import Circle, Problem, solve
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.command.fly import path_home
from netsp.command.main import main
from netsp.online.execute.events import Surprises
from netsp.online.execute.execution_log import ExecutionOptions
from netsp.online.execute.tour_execution import StopsFlightError
from netsp.online.fly import standby, tour_flight
from netsp.online.fly.flight_policy import FlightPolicy
from netsp.online.fly.flight_rehearsal import rehearse
from netsp.online.fly.flight_time import predicted_flight
from netsp.online.fly.inputs import parse_event
from netsp.online.fly.preflight_checks import make_ready
from netsp.online.fly.standby import stand_by
from netsp.online.fly.stopped import RefusedError
from netsp.online.fly.tour_flight import fly
from netsp.online.fly.vehicle import LinkedVehicle
from netsp.online.guard.telemetry import Fix
from netsp.online.link.address import Address
from netsp.online.link.dialect import dialect, parser
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import Listener
from netsp.online.link.session import Session
from netsp.online.link.udp import UdpLink, messages_in
from netsp.online.link.vehicle_kind import VehicleKind
from tests.ardusub import BINARY, REASON, ArduSub
from tests.autopilot import Autopilot

PACE = 8.0
SITE = Problem(
    base=(0, 0), goals=[(6, 2, -1), (6.5, -2, -1)], tether_length=12,
    obstacles=[Circle(center=(4, 0), radius=0.6, name="pile")], clearance=0.4,
)  # fmt: skip
OPTIONS = ExecutionOptions(speed=0.5, reach=0.3)
PATIENT = FlightPolicy(max_silence_s=60.0, max_position_age_s=60.0, max_gps_age_s=60.0)
"""At `PACE` two seconds of the vehicle are a quarter of one of ours, for which a busy machine holds
either end up: only tests of lost links take that for one."""


@pytest.fixture(scope="module")
def tour():
    rehearse()  # on a fresh machine that takes a minute, in which an armed vehicle drifts off
    return solve(SITE)


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """Give flights by command the patient policy, too."""
    monkeypatch.setattr(tour_flight, "fly", functools.partial(fly, policy=PATIENT))
    monkeypatch.setattr(standby, "stand_by", functools.partial(stand_by, policy=PATIENT))


class Flown:
    """An autopilot, and our session with it."""

    def __init__(self, arm=True, **how):
        how = {"pace": PACE, "params": {"FS_GCS_TIMEOUT": 60}, **how}
        self.autopilot = Autopilot(**how)
        self.arm, self.pace = arm, how["pace"]

    def __enter__(self):
        self.autopilot.__enter__()
        link = UdpLink(Address(True, "127.0.0.1", self.autopilot.port))
        self.session = Session(link, Frame(SITE), 1, self.pace)
        assert self.autopilot.until(lambda: self.session.latest.position is not None)
        if self.arm:
            self.session.command(400, 1)
            assert self.autopilot.until(lambda: self.session.latest.armed is True)
        return self

    def __exit__(self, *error):
        self.session.close()
        self.autopilot.__exit__(*error)

    def fly(self, tour, **how):
        return fly(SITE, tour, self.session, OPTIONS, **{"policy": PATIENT, **how})

    @property
    def targets(self):
        return [e for e in self.autopilot.events if e.get("event") == "target"]


def after(seconds, do):
    """A step that does something once, so many seconds after the start."""
    done = []

    def on_step(row):
        if row.time >= seconds and not done:
            done.append(do())

    return on_step


def test_a_vehicle_visits_every_goal_in_the_class_of_the_plan_and_comes_home_free(tour):
    with Flown(noise=0.02, drift=0.03, smooth=1.0) as flown:
        done = flown.fly(tour)
        s = done.summary
        assert (s["status"], s["visited"], s["home"]) == ("done", 2, True), done.stopped
        assert s["arrivals_as_planned"] == 3
        assert s["tether_free"]
        assert s["exceedance_s"] == 0.0
        true = flown.autopilot.truth()[:, 1:3]
        assert min(float(o.signed_distance(p)) for o in SITE.obstacles for p in true) > 0.1


@pytest.mark.skipif(not BINARY, reason=REASON)
def test_ardusub_s_own_simulator_flies_a_tour_and_is_stopped_by_what_stops_the_fake_one(tour):
    for stops in (None, "disarmed", "mode"):
        with ArduSub() as vehicle:
            link = UdpLink(Address(True, "127.0.0.1", vehicle.port))
            session = Session(link, Frame(SITE), 1, 1.0)
            try:
                vehicle.until(lambda s=session: s.latest.position is not None and s.latest.estimate)
                session.command(400, 1)
                vehicle.until(lambda s=session: s.latest.armed is True)
                what = {
                    None: None,
                    "disarmed": after(5.0, lambda s=session: s.command(400, 0, 21196)),
                    "mode": after(5.0, lambda s=session: s.command(176, 1, 19)),
                }[stops]
                summary = fly(SITE, tour, session, OPTIONS, on_step=what, policy=PATIENT).summary
            finally:
                session.close()
        if stops is None:
            assert (summary["status"], summary["visited"], summary["home"]) == ("done", 2, True)
            assert summary["tether_free"]
        else:
            assert summary["status"] == "stopped"


def test_a_vehicle_that_is_not_ready_is_not_moved(tour):
    for how, before, why in (
        ({"arm": False}, {}, "not armed"),
        ({"start": (5.0, 0.0, 0.0)}, {}, "from the start of the tour"),
        ({}, {"do": "lose_estimate"}, "no position estimate"),
    ):
        with Flown(**how) as flown:
            if before:
                flown.autopilot.tell(**before)
                assert flown.autopilot.until(lambda f=flown: f.session.latest.estimate is False)
            with pytest.raises(RefusedError, match=why):
                flown.fly(tour)
            assert flown.targets == []


def test_an_armed_vehicle_is_not_refused_before_it_has_said_whether_it_is():
    """Its first heartbeat comes before its clock is known, its position before the second."""
    placed = Fix(1.0, (0.0, 0.0, 0.0), estimate=True)
    said = iter([placed] * 5)

    class Heard:
        silent_s, kind = 0.0, VehicleKind(12, 3)
        latest = property(lambda self: next(said, replace(placed, armed=True, mode="GUIDED")))

        def request_positions(self):
            pass

        def sleep(self, seconds):
            pass

    make_ready(Heard(), np.zeros(3), 2.0)


def test_a_clock_that_stands_still_ends_the_flight(monkeypatch):
    session = Session(UdpLink(Address(True, "127.0.0.1", 0)), Frame(SITE, "local"), 1, 1.0)
    m, pack, ours = dialect(), parser(1, 1), [0.0]
    monkeypatch.setattr(session, "_seconds", lambda: ours[0])

    def say(time_ms):
        for message in (
            m.MAVLink_heartbeat_message(12, 3, 128, 4, 4, 3),
            m.MAVLink_local_position_ned_message(time_ms, 0.0, 0.0, 0.0, 0, 0, 0),
        ):
            for heard in messages_in(bytes(message.pack(pack))):
                session._receive(heard, ("127.0.0.1", 1))

    try:
        for second in range(4):
            ours[0] = float(second)
            say(1000 * second)
            assert session.stalled_s == 0.0
        vehicle = LinkedVehicle(session, 0.3, PATIENT)
        for second in range(4, 7):
            ours[0] = float(second)
            say(3000)
            vehicle.check()
        ours[0] = 6.5
        with pytest.raises(StopsFlightError, match=r"the vehicle's clock stands still.* 4 s"):
            vehicle.check()
    finally:
        session.close()


def test_positions_without_heartbeats_are_told_from_silence():
    class Heard:
        silent_s, position_age_s, system, others = np.inf, 0.1, 7, ()

        def sleep(self, seconds):
            pass

        def request_positions(self):
            pass

    with pytest.raises(RefusedError, match="positions come from system 7, but no heartbeat"):
        make_ready(Heard(), np.zeros(3), 2.0)


@pytest.mark.parametrize("number", ["0", "256", "-1", "one"])
@pytest.mark.parametrize("command", ["fly", "guard"])
def test_system_ids_that_mavlink_does_not_have_are_refused(command, number, capsys):
    assert main([command, "p.json", "--link", "udpin:14550", f"--system={number}"]) == 2
    assert f"expected a system id from 1 to 255, got '{number}'" in capsys.readouterr().err


def test_a_link_with_nobody_at_the_other_end_is_told(tour):
    session = Session(UdpLink(Address(True, "127.0.0.1", 0)), Frame(SITE), 1, 20.0)
    try:
        with pytest.raises(RefusedError, match="no vehicle has been heard"):
            fly(SITE, tour, session, OPTIONS, policy=PATIENT)
    finally:
        session.close()


def test_a_vehicle_with_another_system_id_is_named(tour):
    with Autopilot(pace=PACE) as autopilot:
        session = Session(UdpLink(Address(True, "127.0.0.1", autopilot.port)), Frame(SITE), 2, PACE)
        try:
            with pytest.raises(
                RefusedError, match="heard from system 1, but nothing from system 2"
            ):
                fly(SITE, tour, session, OPTIONS, policy=PATIENT)
        finally:
            session.close()


@pytest.mark.parametrize(
    ("what", "why"),
    [
        ({"do": "mode", "mode": 19}, "the pilot has taken over"),
        ({"do": "disarm"}, "disarmed"),
        ({"do": "lose_estimate"}, "position estimate"),
        ({"do": "silence", "seconds": 60}, "the link is lost"),
    ],
)
def test_a_flight_stops_when_the_vehicle_is_not_ours_any_more_and_says_why(tour, what, why):
    policy = FlightPolicy() if what["do"] == "silence" else PATIENT
    with Flown(pace=3.0) as flown:
        tell = after(6.0, lambda: flown.autopilot.tell(**what))
        done = flown.fly(tour, on_step=tell, policy=policy)
        assert done.summary["status"] == "stopped"
        assert why in done.stopped
        sent = len(flown.targets)
        flown.autopilot.sleep(3.0)
        assert len(flown.targets) == sent
        if what["do"] == "lose_estimate":
            assert flown.autopilot.until(lambda: flown.session.latest.mode == "ALT_HOLD")


def test_ctrl_c_has_the_vehicle_hold_its_place(tour):
    def stop():
        raise KeyboardInterrupt

    with Flown() as flown:
        done = flown.fly(tour, on_step=after(8.0, stop))
        assert done.interrupted
        flown.autopilot.sleep(8.0)
        there = flown.autopilot.truth()[-1, 1:4]
        # where it was when it was told, and what it takes to stop
        assert np.linalg.norm(np.array(flown.targets[-1]["at"]) - there) < 0.5


def test_what_appears_in_the_way_is_gone_round(tour):
    told = {"schema_version": 1, "events": [
        {"time": 3.0, "appear": {"center": [3.0, 1.6], "radius": 0.4, "name": "boat"}},
        {"time": 6.0, "cancel_goal": 1},
    ]}  # fmt: skip
    with Flown() as flown:
        done = flown.fly(tour, surprises=Surprises.model_validate(told))
        s = done.summary
        assert (s["status"], s["visited"], s["tether_free"]) == ("done", 1, True), done.stopped
        boat = Circle(center=(3.0, 1.6), radius=0.4)
        late = flown.autopilot.truth()
        assert min(float(boat.signed_distance(p[1:3])) for p in late) > 0.0


def test_events_that_come_in_are_asked_first():
    assert parse_event('{"cancel_goal": "A3"}').kind == "cancel_goal"
    for line in ("[]", "{", '{"appear": 3}', '{"tether_length": -1}', "{}"):
        with pytest.raises(InputError, match="event"):
            parse_event(line)


@pytest.mark.parametrize("sent", [b"", b'{"cancel_goal": 1}\nrubbish\n{"cancel'])
def test_a_command_that_waits_for_events_ends_with_its_own_exit_code(sent):
    """Standard input stays open, as that of a shell does."""
    program = (
        "import sys, time\n"
        "from netsp.online.fly.inputs import read_events\n"
        "events, found = read_events(sys.stdin.buffer, print), []\n"
        "time.sleep(0.2)  # so that it waits for a line when the program ends\n"
        "while len(found) < int(sys.argv[1]):\n"
        "    found += events()\n"
        "sys.exit(3)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program, str(sent.count(b"cancel_goal"))],
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    ) as command:  # fmt: skip
        command.stdin.write(sent)
        command.stdin.flush()
        assert command.wait(60.0) == 3, command.stderr.read()


def test_nobody_else_is_listened_to():
    listener = Listener(Frame(SITE), 1)
    m = dialect()
    for system, component, heard in ((1, 1, True), (2, 1, False), (1, 42, False)):
        packs = parser(system, component)
        message = m.MAVLink_local_position_ned_message(1000, 1.0, 2.0, 3.0, 0, 0, 0)
        (read,) = messages_in(message.pack(packs))
        assert (listener.read(read) is not None) is heard
    assert listener.n_foreign == 2


def test_malformed_packets_neither_raise_nor_say_anything():
    rng = random.Random(0)
    m, packs = dialect(), parser(1, 1)
    listener = Listener(Frame(SITE), 1)
    whole = [
        m.MAVLink_heartbeat_message(12, 3, 128, 4, 4, 3).pack(packs),
        m.MAVLink_local_position_ned_message(1, 1.0, 2.0, 3.0, 0, 0, 0).pack(packs),
        m.MAVLink_statustext_message(4, b"\xff\xfe").pack(packs),
    ]
    for _ in range(4000):
        data = bytearray(rng.choice(whole))
        for _ in range(rng.randint(1, 6)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        data = data[: rng.randint(0, len(data))] + rng.randbytes(rng.randint(0, 20))
        for message in messages_in(bytes(data)):
            listener.read(message)
    for x in (float("nan"), float("inf"), 1e30):
        (read,) = messages_in(m.MAVLink_local_position_ned_message(1, x, 0, 0, 0, 0, 0).pack(packs))
        assert listener.read(read) is None


def test_links_are_this_machine_s_unless_told_otherwise():
    assert Address.parse("udpin:14550") == Address(True, "127.0.0.1", 14550)
    assert Address.parse("udpin:0.0.0.0:14550").host == "0.0.0.0"
    for text in ("14550", "udpin:", "udpin:0", "udpout:1", "tcp:1.2.3.4:5", "udpin:70000"):
        with pytest.raises(InputError, match="--link"):
            Address.parse(text)


def test_places_go_to_the_vehicle_and_back():
    rng = np.random.default_rng(0)
    turned = SITE.model_copy(
        update={"origin": Problem.model_validate({
            **SITE.model_dump(mode="json"),
            "origin": {"latitude": 55.5, "longitude": 12.7, "heading": 30.0},
        }).origin}
    )  # fmt: skip
    for site, kind in ((SITE, "local"), (turned, "local"), (turned, "global")):
        frame = Frame(site, kind)
        for _ in range(20):
            x, y, z = rng.uniform(-50, 50, 3)
            place = (float(x), float(y), -abs(float(z)))
            back = (
                frame.from_global(*frame.to_global(place)) if frame.is_global
                else frame.from_local(*frame.to_local(place))
            )  # fmt: skip
            assert np.allclose(back, place, atol=0.02 if frame.is_global else 1e-9)


def test_a_dry_run_shows_every_target_and_needs_no_link(tmp_path, capsys, tour):
    problem, solution = tmp_path / "p.json", tmp_path / "s.json"
    problem.write_text(SITE.to_json())
    solution.write_text(tour.to_json())
    assert main(["fly", str(problem), str(solution), "--dry-run"]) == 0
    out, err = capsys.readouterr()
    assert out.count("goal") == 2
    assert "the base" in out
    seconds = predicted_flight(SITE, tour, 0.5, 0.3).total_s
    assert f"about {seconds:.0f} s at 0.5 m/s" in err
    broken = json.loads(tour.to_json())
    broken["path"][1][0] += 3.0
    solution.write_text(json.dumps(broken))
    assert main(["fly", str(problem), str(solution), "--dry-run"]) == 2
    assert main(["fly", str(problem), str(solution)]) == 2


def test_an_address_that_is_none_is_refused_before_anything_is_said(tmp_path, tour, capsys):
    problem, solution = tmp_path / "p.json", tmp_path / "s.json"
    problem.write_text(SITE.to_json())
    solution.write_text(tour.to_json())
    assert main(["fly", str(problem), str(solution), "--link", "tcp:14550"]) == 2
    err = capsys.readouterr().err
    assert "--link: expected udpin:PORT" in err
    assert "in still water" not in err


def test_the_way_home_has_no_bends_within_a_share_of_the_clearance():
    """A dozen corners of an arc around a pile stand for one bend or two."""
    angles = np.linspace(0.0, np.pi / 2, 13)
    arc = 5.0 + 0.9 * np.column_stack([np.sin(angles), np.cos(angles), np.zeros(13)])
    tether = np.vstack([(0, 5.9, 0), arc, (5.9, 0, 0)])
    done = SimpleNamespace(tethers=[(0.0, tether)], problem=SITE, options=ExecutionOptions())
    waypoints = [
        tuple(map(float, w.split(",")))
        for w in re.findall(r"\(([^)]*)\)", path_home(done).split(" by ")[1])
    ]
    assert len(waypoints) < 8
    assert waypoints[-1] == (0.0, 5.9, 0.0)
    line = np.vstack([tether[-1], waypoints])
    share = FlightPolicy().max_home_offset
    rounding = 0.01
    for place in tether:
        assert polylines.distance(line, place) <= share * SITE.clearance + rounding
    every = path_home(done, replace(FlightPolicy(), max_home_offset=1e-6))
    assert every.count("(") == len(tether) - 1


def test_a_tour_is_flown_by_command_with_events_and_its_files_are_written(
    tmp_path, tour, monkeypatch
):
    problem, solution, run = tmp_path / "p.json", tmp_path / "s.json", tmp_path / "run"
    problem.write_text(SITE.to_json())
    solution.write_text(tour.to_json())
    monkeypatch.setattr("sys.stdin", io.StringIO('{"cancel_goal": 1}\nrubbish\n'))
    with Autopilot(pace=PACE, params={"FS_GCS_ENABLE": 0}) as autopilot:
        autopilot.tell(do="arm")
        autopilot.event("armed")
        code = main([
            "fly", str(problem), str(solution), "--link", f"udpin:{autopilot.port}", "--pace",
            str(PACE), "--events", "-o", str(run), "--quiet",
        ])  # fmt: skip
    assert code == 0
    summary = json.loads((run / "summary.json").read_text())
    assert (summary["status"], summary["visited"], summary["cancelled"]) == ("done", 1, [1])
    assert {p.name for p in run.iterdir()} >= {"log.csv", "events.csv", "run.png", "visits.csv"}


def test_ctrl_c_at_the_command_stops_the_vehicle_offers_the_way_home_and_keeps_the_log(
    tmp_path, tour
):
    problem, solution, run = tmp_path / "p.json", tmp_path / "s.json", tmp_path / "run"
    problem.write_text(SITE.to_json())
    solution.write_text(tour.to_json())
    slow = 2.0  # the flight must not be over before it is stopped
    with Autopilot(pace=slow, params={"FS_GCS_ENABLE": 0}) as autopilot:
        autopilot.tell(do="arm")
        autopilot.event("armed")
        command = subprocess.Popen(
            [sys.executable, "-m", "netsp", "fly", problem, solution, "--link",
             f"udpin:{autopilot.port}", "--pace", str(slow), "-o", run],
            stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            # tests that run in the background of a shell have it ignored
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )  # fmt: skip
        autopilot.until(
            lambda: (
                command.poll() is not None
                or any(e.get("event") == "target" for e in list(autopilot.events))
            ),
            seconds=180.0,
        )
        assert command.poll() is None, command.communicate()[1]
        autopilot.sleep(4.0)
        command.send_signal(signal.SIGINT)
        told = command.communicate(timeout=60)[1]
        sent = len(autopilot.events)
        autopilot.sleep(8.0)
        assert not [e for e in autopilot.events[sent:] if e.get("event") == "target"]
        there = autopilot.truth()[-1, 1:4]
        last = [e for e in autopilot.events if e.get("event") == "target"][-1]
    assert command.returncode == 4, told
    assert "Traceback" not in told
    assert "back along the tether" in told
    # where it was when it was told, and what it takes to stop
    assert np.linalg.norm(np.array(last["at"]) - there) < 0.5
    assert json.loads((run / "summary.json").read_text())["status"] == "interrupted"
    assert (run / "log.csv").read_text().count("\n") > 10


@pytest.mark.parametrize(
    "what", [{"do": "push", "by": [-1.5, -2.5, 0]}, {"do": "jump", "by": [1, -4]}]
)
def test_a_vehicle_that_is_not_where_it_was_sent_is_stopped(tour, what):
    with Flown() as flown:
        done = flown.fly(tour, on_step=after(8.0, lambda: flown.autopilot.tell(**what)))
        assert "off its path" in str(done.stopped)


def test_disarming_that_nobody_looked_at_in_time_is_not_forgotten(tour):
    def rearm():
        flown.autopilot.tell(do="disarm")
        assert flown.autopilot.until(lambda: flown.session.latest.armed is False)
        flown.autopilot.tell(do="arm")
        assert flown.autopilot.until(lambda: flown.session.latest.armed is True)

    with Flown(params={"FS_GCS_ENABLE": 0}) as flown:
        done = flown.fly(tour, on_step=after(6.0, rearm))
        assert "disarmed" in str(done.stopped)


def test_a_vehicle_that_tells_no_positions_any_more_is_stopped(tour):
    patient = FlightPolicy(max_silence_s=60.0, max_position_age_s=2.0)

    def deaf():
        flown.session._listener._local_position_ned = lambda message: None

    with Flown() as flown:
        done = flown.fly(tour, on_step=after(6.0, deaf), policy=patient)
        assert "no position" in done.stopped


def test_pushes_are_not_for_real_vehicles(tour):
    told = {"schema_version": 1, "events": [{"time": 1.0, "push": [1, 0, 0]}]}
    with pytest.raises(InputError, match="push"):
        fly(SITE, tour, None, OPTIONS, surprises=Surprises.model_validate(told))
