"""A guard notices at once that no fixes correct the position, and takes it to be off by more; it
says which vehicle it does not know, and how often positions come."""

import gzip
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InputError, Problem
from netsp.online.guard import live
from netsp.online.guard.alarms import Level
from netsp.online.guard.dead_reckoning import DeadReckoning
from netsp.online.guard.guard_policy import RatePolicy
from netsp.online.guard.message_rates import MessageRates
from netsp.online.guard.replay import read_fixes
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard, GuardOptions
from netsp.online.link.geo_frame import Frame
from netsp.online.link.link_policy import AidingPolicy
from netsp.online.link.mavlink_messages import Listener

pytest.importorskip("pymavlink")

from netsp.online.link.dialect import dialect, parser
from tests.autopilot import Simulation

FLIGHTS = Path(__file__).parent / "data" / "ardusub47"
SITE = Problem(
    base=(0, 0), goals=[(9, 0, -1)], tether_length=30,
    obstacles=[Circle(center=(6, 1.5), radius=0.3, name="pile")],
)  # fmt: skip
M = dialect()
GOOD = 831


@pytest.mark.parametrize(
    ("flight", "begin", "lost", "why"),
    [
        ("gps-lost-pool", 57.20, 77.3, "the GPS has no fix"),
        ("gps-jump-pool", 76.26, 96.3, "the filter rejects the fixes"),
    ],
)
def test_a_lost_gps_is_noticed_within_a_second_in_the_log_of_a_real_autopilot(
    tmp_path, flight, begin, lost, why
):
    file = tmp_path / "flight.bin"
    file.write_bytes(gzip.decompress((FLIGHTS / f"{flight}.BIN.gz").read_bytes()))
    fixes = [f for f in read_fixes(file, Frame(SITE)) if f.time > begin]
    faults = [f for f in fixes if f.aiding_fault]
    assert lost <= faults[0].time <= lost + 1.0  # its flags said so after 7 s, or never
    assert faults[0].aiding_fault == why
    assert all(f.estimate is not False for f in fixes if f.time < lost + 5.0)


def heard(messages):
    """The last reason for doubt after each (second, message)."""
    listener, out = Listener(Frame(SITE), 1), []
    for t, message in messages:
        clock = M.MAVLink_local_position_ned_message(round(1000 * t), 0, 0, 1, 0, 0, 0)
        for one in (clock, message):
            data = one.pack(parser(1, 1))
            fix = listener.read(parser().decode(bytearray(data)))
            if fix is not None:
                out.append((t, fix.aiding_fault))
    return out


def gps(stamp, fix_type=3):
    return M.MAVLink_gps_raw_int_message(stamp, fix_type, 1, 1, 0, 100, 100, 0, 0, 10)


def status(health, enabled=32 | 128):
    return M.MAVLink_sys_status_message(enabled, enabled, health, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)


def ekf(ratio, of_velocity=0.01):
    return M.MAVLink_ekf_status_report_message(GOOD, of_velocity, ratio, 0.01, 0.01, 0.0)


@pytest.mark.parametrize(
    ("change", "why", "within"),
    [
        (lambda k: gps(k, 1), "the GPS has no fix", 0.01),
        (lambda k: gps(40), "the GPS is silent", 1.75),
        (lambda k: M.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0), "the GPS is silent", 1.75),
        (lambda k: ekf(1.2), "the filter rejects the fixes", 0.01),
        (lambda k: ekf(0.1, 1.3), "the filter rejects the fixes", 0.01),
        (lambda k: status(0, 32), "GPS: not healthy", 0.01),
    ],
    ids=["no fix", "stamp stands", "no message", "innovation", "of velocity", "GPS unhealthy"],
)
def test_every_way_to_lose_fixes_is_noticed_within_two_seconds(change, why, within):
    before = [(0.2 * k, m) for k in range(40) for m in (gps(k + 1), status(32, 32), ekf(0.1))]
    after = [(8.0 + 0.2 * k, change(k + 41)) for k in range(15)]
    told = heard(before + after)
    assert not any(fault for t, fault in told if t < 8.0)
    first = next((t, fault) for t, fault in told if fault)
    assert first[1] == why
    assert 0.0 <= first[0] - 8.0 <= within
    again = [(11.0 + 0.2 * k, m) for k in range(5) for m in (gps(k + 60), status(32, 32), ekf(0.1))]
    assert heard(before + after + again)[-1][1] == ""


def test_a_sensor_that_is_lost_does_not_matter_while_another_one_works():
    both = [(0.2 * k, m) for k in range(20) for m in (gps(k + 1), status(32 | 128))]
    without_gps = [(4.0 + 0.2 * k, m) for k in range(20) for m in (gps(k + 50, 1), status(128))]
    assert not any(fault for _, fault in heard(both + without_gps))
    without_dvl = [(4.0 + 0.2 * k, m) for k in range(20) for m in (gps(k + 50), status(32))]
    assert not any(fault for _, fault in heard(both + without_dvl))
    neither = [(8.0, gps(90, 1)), (8.0, status(0))]
    assert heard(both + without_gps + neither)[-1][1] == "the GPS has no fix"
    dvl = [(0.2 * k, status(128 if k < 20 else 0, 128)) for k in range(22)]
    assert heard(dvl)[-1][1] == "visual or DVL odometry: not healthy"


@given(
    st.lists(
        st.sampled_from([gps(0, 0), gps(7, 1), status(0), status(0, 0), ekf(0.1)]),
        min_size=1, max_size=30,
    )
)  # fmt: skip
@settings(max_examples=20, deadline=None)
def test_a_sensor_that_never_worked_is_no_loss(messages):
    told = heard([(0.2 * k, m) for k, m in enumerate(messages)])
    assert not any(fault for _, fault in told)


def drive(faults):
    """Reports of a guard beside a robot that goes past a pile; from second to fault."""
    guard, out = Guard(SITE, GuardOptions(noise=0.05, drift=0.1)), []
    for k in range(190):
        t, fault = 0.1 * k, None
        fault = next((why for begin, why in reversed(faults) if t >= begin), "")
        place = (0.4 * min(t, 15.0), 1e-3 * (k % 7), -1.0)
        out.append(guard.update(Fix(t, place, estimate=True, aiding_fault=fault)))
    return out


def test_a_position_that_nothing_corrects_is_off_by_more_and_so_the_class_is_in_doubt():
    steady = drive([])
    assert {len(r.classes) for r in steady} == {1}
    assert {r.drift for r in steady} == {0.1}
    assert not any(a.kind == "position" for r in steady for a in r.raised)
    lost = drive([(5.0, "the GPS has no fix")])
    raised = [(r.time, a) for r in lost for a in r.raised if a.kind == "position"]
    (told,) = raised
    assert told[0] == pytest.approx(5.0, abs=0.11)
    assert told[1].level == Level.WARNING
    assert "the GPS has no fix: the position may be off by 0.2 m" in told[1].text
    drifts = np.array([r.drift for r in lost])
    assert (np.diff(drifts) >= 0.0).all()
    # within the error measured in a flight with the GPS off: 0.54 m after 5 s, 3.6 m after 13 s
    assert 0.54 < lost[100].drift < 1.2
    assert 3.6 < lost[180].drift < 5.0
    assert len(lost[-1].classes) > 1
    assert sum(c.likely for c in lost[-1].classes) == pytest.approx(1.0)


def test_a_position_that_is_corrected_again_is_as_good_as_before_two_seconds_later():
    reports = drive([(5.0, "the GPS has no fix"), (9.0, "")])
    assert reports[105].drift > 0.5
    assert reports[115].drift == 0.1
    assert [a.kind for r in reports for a in r.alarms if r.time > 16.0] == []


def test_a_position_that_jumps_when_fixes_are_taken_again_is_told():
    guard = Guard(SITE, GuardOptions(noise=0.05, drift=0.1))
    for k in range(120):
        t = 0.1 * k
        why = "the filter rejects the fixes" if 3.0 <= t < 10.0 else ""
        place = (0.2 * t, 4.8 if t >= 10.0 else 0.0, -1.0)
        report = guard.update(Fix(t, place, estimate=True, aiding_fault=why))
    assert any("reset to a place 4.8 m away" in a.text for a in report.alarms)


def test_policies_out_of_range_are_refused():
    for wrong in ({"max_age_s": 0.0}, {"max_innovation": -1.0}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            AidingPolicy(**wrong)
    for wrong in ({"acceleration": -1.0}, {"growth": 1.0}, {"max_error": 0.0}, {"settle_s": -1.0}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            DeadReckoning(**wrong)
    with pytest.raises(InputError, match="span_s"):
        RatePolicy(span_s=0.0)


class Wire:
    """A link that hears what it is given and keeps what is sent."""

    def __init__(self, heard):
        self.heard, self.sent, self.peer = list(heard), [], None

    def receive(self, timeout_s):
        del timeout_s
        return [(self.heard.pop(0), ("127.0.0.1", 5))] if self.heard else []

    def set_peer(self, peer):
        self.peer = peer

    def send(self, message):
        self.sent.append(message)
        return True

    def close(self):
        pass


def beside(monkeypatch, hz, *, seconds=12.0, kind=(12, 3), accepts=True, **options):
    """What a live guard says and sends beside a vehicle that tells its place so often."""
    rows = [M.MAVLink_heartbeat_message(*kind, 0, 4, 4, 3)]
    for k in range(int(seconds * hz)):
        rows.append(
            M.MAVLink_local_position_ned_message(round(1000 * k / hz), 0, 0.1 * k / hz, 1, 0, 0, 0)
        )
        if k == 2:
            rows.append(M.MAVLink_command_ack_message(511, 0 if accepts else 3))
    wire = Wire([parser().decode(bytearray(m.pack(parser(1, 1)))) for m in rows])
    monkeypatch.setattr(live, "UdpLink", lambda *_: wire)
    monkeypatch.setattr(live, "rehearse", lambda **_: None)
    said = []
    live.watch(
        Guard(SITE), Frame(SITE), "udpin:14550", lambda _: None, on_note=said.append,
        should_stop=lambda: not wire.heard, **options,
    )  # fmt: skip
    return said, wire.sent


def test_a_guard_says_how_often_positions_come_and_asks_for_more_only_if_it_may(monkeypatch):
    said, sent = beside(monkeypatch, 3)
    assert [line for line in said if "positions come 3.0 times a second" in line]
    assert not sent  # nothing is ever sent without being asked for
    said, sent = beside(monkeypatch, 10)
    assert not [line for line in said if "times a second" in line]
    said, sent = beside(monkeypatch, 3, ask_rates=True)
    assert {m.command for m in sent} == {M.MAV_CMD_SET_MESSAGE_INTERVAL}
    asked = {int(m.param1): m.param2 for m in sent}
    assert asked[M.MAVLINK_MSG_ID_LOCAL_POSITION_NED] == 100_000
    assert {M.MAVLINK_MSG_ID_GPS_RAW_INT, M.MAVLINK_MSG_ID_EKF_STATUS_REPORT} <= set(asked)
    assert [line for line in said if "still come 3.0 times a second" in line]
    said, sent = beside(monkeypatch, 10, ask_rates=True)
    assert len(sent) == len(asked)  # once is enough where positions come
    said, sent = beside(monkeypatch, 3, ask_rates=True, accepts=False)
    assert [line for line in said if "refuses other rates" in line]
    assert len(sent) == len(asked)


class SimulatedWire(Wire):
    """A link to a fake ArduSub that tells nothing but heartbeats until it is asked."""

    def __init__(self, seconds, *, refuses=None, loses=0):
        super().__init__([])
        self.simulation = Simulation(params={})
        self.end, self.loses, self.positions = seconds, loses, []
        vehicle = self.simulation.vehicle
        for message, stream in vehicle.streams.items():
            stream.interval = 1.0 if message == M.MAVLINK_MSG_ID_HEARTBEAT else 0.0
        if refuses is not None:
            vehicle.commands[M.MAV_CMD_SET_MESSAGE_INTERVAL] = lambda _: refuses

    @property
    def is_over(self):
        return self.simulation.now >= self.end

    def receive(self, timeout_s):
        del timeout_s
        self.simulation.advance(0.1)
        heard = self.simulation.wire.messages()
        self.positions += [self.simulation.now for m in heard if "LOCAL_POSITION" in m.get_type()]
        other = M.MAVLink_heartbeat_message(12, 3, 0, 4, 4, 3)
        other.pack(parser(2, 1))
        return [(parser().decode(bytearray(m.get_msgbuf())), ("here", 5)) for m in (*heard, other)]

    def send(self, message):
        message.pack(parser(live.GUARD_SYSTEM, 191))
        if len(self.sent) >= self.loses:
            self.simulation.vehicle.receive(message)
        return super().send(message)


def listens(monkeypatch, wire, **options):
    """Run a live guard on a link until it is over, by the link's clock; return its lines."""
    monkeypatch.setattr(live, "UdpLink", lambda *_: wire)
    monkeypatch.setattr(live, "rehearse", lambda **_: None)
    monkeypatch.setattr(live.time, "monotonic", lambda: 1e5 + wire.simulation.now)
    said = []
    live.watch(
        Guard(SITE), Frame(SITE), "udpin:14550", lambda _: None, on_note=said.append,
        should_stop=lambda: wire.is_over, **options,
    )  # fmt: skip
    return said


def test_a_vehicle_that_sends_only_heartbeats_is_asked_and_then_tells_ten_positions_a_second(
    monkeypatch,
):
    for loses in (0, 5):  # also where the first requests get lost
        wire = SimulatedWire(20.0, loses=loses)
        said = listens(monkeypatch, wire, ask_rates=True)
        late = [t for t in wire.positions if t > 10.0]
        assert 9.0 <= len(late) / 10.0 <= 11.0
        assert {m.target_system for m in wire.sent} == {1}  # and never the other one on the link
        assert 5 + loses <= len(wire.sent) <= 5 + 2 * loses
        assert not [line for line in said if "times a second" in line or "refuses" in line]
    wire = SimulatedWire(20.0)
    said = listens(monkeypatch, wire)
    assert not wire.sent
    assert any(line.startswith("no positions come; --ask-rates asks") for line in said)


@pytest.mark.parametrize(
    ("result", "n_rounds"),
    [(M.MAV_RESULT_UNSUPPORTED, 1), (M.MAV_RESULT_DENIED, 1),
     (M.MAV_RESULT_TEMPORARILY_REJECTED, 4)],
)  # fmt: skip
def test_a_vehicle_that_refuses_rates_is_not_asked_again_and_it_is_said(
    monkeypatch, result, n_rounds
):
    wire = SimulatedWire(19.0, refuses=result)
    said = listens(monkeypatch, wire, ask_rates=True)
    assert len(wire.sent) == 5 * n_rounds
    refusals = [line for line in said if line.startswith("the vehicle refuses")]
    assert len(refusals) == (n_rounds == 1)
    assert any("no positions come, though the vehicle was asked" in line for line in said)


def test_an_answer_to_another_ground_station_is_no_refusal():
    rates = MessageRates(Frame(SITE), True, sender=live.GUARD_SYSTEM)
    rates.requests(1, 0.0)
    assert not list(rates.on_ack(M.MAV_CMD_SET_MESSAGE_INTERVAL, M.MAV_RESULT_DENIED, 255))
    assert list(
        rates.on_ack(M.MAV_CMD_SET_MESSAGE_INTERVAL, M.MAV_RESULT_DENIED, live.GUARD_SYSTEM)
    )


def test_rates_are_counted_by_the_vehicle_s_clock_also_when_it_is_set():
    rates = MessageRates(Frame(SITE))
    said = [line for k in range(200) for line in rates.count(1000.0 + 0.1 * k)]
    assert rates.hz == pytest.approx(10.0)
    said += [line for k in range(200) for line in rates.count(0.4 * k)]
    assert rates.hz == pytest.approx(2.5, abs=0.1)
    assert len(said) == 1


@pytest.mark.parametrize(
    ("kind", "says"),
    [((12, 3), None), ((2, 3), "quadrotor"), ((10, 3), "ground rover"), ((12, 12), "px4")],
)
def test_a_vehicle_that_is_no_submarine_of_ardupilot_is_warned_of(
    monkeypatch, tmp_path, kind, says
):
    said, _ = beside(monkeypatch, 10, seconds=1.0, kind=kind)
    warned = [line for line in said if "expected a submarine with ArduPilot" in line]
    rows = [M.MAVLink_heartbeat_message(*kind, 0, 4, 4, 3)] + [
        M.MAVLink_local_position_ned_message(100 * k, 0, 0.1 * k, 1, 0, 0, 0) for k in range(9)
    ]
    (tmp_path / "a.tlog").write_bytes(
        b"".join(struct.pack(">Q", 10**15 + k) + m.pack(parser(1, 1)) for k, m in enumerate(rows))
    )
    notes = []
    list(read_fixes(tmp_path / "a.tlog", Frame(SITE), on_note=notes.append))
    warned += [line for line in notes if "expected a submarine with ArduPilot" in line]
    assert len(warned) == (0 if says is None else 2)
    assert all(says in line for line in warned)
