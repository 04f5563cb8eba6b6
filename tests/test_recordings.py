"""Recordings of any format: every message or row is used or left out for a reason, and what cannot
be read says what would help."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InputError, Problem
from netsp.command.main import main
from netsp.model.problem import Origin
from netsp.online.guard.alarms import Level
from netsp.online.guard.guard_policy import RecordingPolicy
from netsp.online.guard.message_tally import MessageTally
from netsp.online.guard.recorded_path import read_any_paths
from netsp.online.guard.replay import read_fixes
from netsp.online.guard.stream import Stream, replay_fixes
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard, GuardOptions
from netsp.online.link.geo_frame import Frame
from netsp.online.link.link_policy import ClockPolicy
from netsp.online.link.vehicle_clock import VehicleClock

SITE = Problem(
    base=(0, 0), goals=[(9, 0, -1)], tether_length=30,
    obstacles=[Circle(center=(5, 3), radius=0.5, name="A")],
)  # fmt: skip
ON_EARTH = SITE.model_copy(update={"origin": Origin(latitude=58.0, longitude=5.5, heading=30.0)})
EXACT = GuardOptions(noise=0.02, drift=0.02)
GOOD, NONE = 1 | 2 | 8 | 16 | 32, 0


def told(file, site=SITE, kind=None, system=None):
    tally, notes = MessageTally(), []
    fixes = list(read_fixes(file, Frame(site, kind), system, tally=tally, on_note=notes.append))
    return fixes, tally, notes


def places(fixes):
    return np.array([f.position for f in fixes if f.position is not None])


# tables

WAY = [(0.1 * k, 0.3 * k, 0.2 * k, -1.0) for k in range(20)]


def degrees(x, y):
    from netsp.exchange.maps.projection import Projection

    ((lat, lon),) = Projection.for_problem(ON_EARTH).to_earth([(x, y)])
    return f"{lat:.10f}", f"{lon:.10f}"


TABLES = {
    "seconds": ("t,x,y,z", lambda t, x, y, z: (t, x, y, z)),
    "epoch": ("t,x,y,z", lambda t, x, y, z: (t + 1.732e9, x, y, z)),
    "epoch in ms": ("time,x,y,z", lambda t, x, y, z: (round(1e3 * t) + 1732000000000, x, y, z)),
    "boot time in ms": ("time_boot_ms,x,y,z", lambda t, x, y, z: (round(1e3 * t), x, y, z)),
    "ISO, other order": (
        "Z,Time,Y,X", lambda t, x, y, z: (z, f"2024-11-19T07:06:{t:06.3f}Z", y, x)
    ),
    "local": ("x,y,t,depth", lambda t, x, y, z: (x, y, t, -z)),
    "earth": (
        "timestamp,latitude,longitude,altitude", lambda t, x, y, z: (t, *degrees(x, y), z)
    ),
    "earth by depth": ("t,lon,lat,depth", lambda t, x, y, z: (t, *degrees(x, y)[::-1], -z)),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(TABLES))
@pytest.mark.parametrize("separator", [",", ";"])
def test_tables_of_any_times_columns_and_frames_tell_the_same_track(tmp_path, name, separator):
    head, row = TABLES[name]
    rows = [list(map(str, row(*place))) for place in WAY]
    if separator == ";":
        rows = [[c if "T" in c else c.replace(".", ",") for c in r] for r in rows]
    lines = [head.replace(",", separator), *(separator.join(r) for r in rows)]
    (tmp_path / "a.csv").write_text("\ufeff" + "\n".join(lines))
    fixes, tally, _ = told(tmp_path / "a.csv", ON_EARTH)
    np.testing.assert_allclose(places(fixes), np.array(WAY)[:, 1:], atol=1e-3)
    times = np.array([f.time for f in fixes])
    np.testing.assert_allclose(times - times[0], np.array(WAY)[:, 0], atol=1e-3)
    assert (tally.used["rows"], tally.total) == (len(WAY), len(WAY))


@settings(max_examples=40, deadline=None)
@given(rows=st.lists(st.sampled_from(["place", "nan", "empty", "half", "no fix", "blank"]),
                     min_size=1, max_size=12))  # fmt: skip
def test_rows_without_a_position_are_gaps_and_all_rows_are_counted(rows, tmp_path_factory):
    cells = {
        "place": f"{{t}},{','.join(degrees(1, 2))},-1", "nan": "{t},nan,NaN,nan",
        "empty": "{t},,,", "half": "{t},58.0,nan,-1", "no fix": "{t},0,0,0.0", "blank": ",,,",
    }  # fmt: skip
    file = tmp_path_factory.mktemp("rows") / "a.csv"
    text = "\n".join(cells[kind].format(t=k) for k, kind in enumerate(rows))
    file.write_text(f"t,lat,lon,alt\n{text}\n")
    if "place" not in rows:
        with pytest.raises(InputError, match="has no positions"):
            told(file, ON_EARTH)
        return
    fixes, tally, notes = told(file, ON_EARTH)
    assert tally.total == len(rows) - rows.count("blank")  # a line without a cell is no row
    assert tally.used["rows"] == rows.count("place") == len(places(fixes))
    # positions that are seconds apart have a note of their own
    has_gaps = any("a gap of the track" in note for note in notes)
    assert has_gaps is bool(set(rows) - {"place", "blank"})


@pytest.mark.parametrize(
    ("text", "site", "kind", "says"),
    [
        ("t,lat,lon,z\n0,58,5.5,0\n", SITE, None, "expected a problem with an origin"),
        ("t,lat,lon,z\n0,58,5.5,0\n", ON_EARTH, "local", "expected --frame global"),
        ("t,lat,lon,z\n0,580000000,55000000,0\n", ON_EARTH, None, "lat within 90"),
        ("t,x,y,z\n,1,2,3\n", SITE, None, "t: expected seconds, got nothing"),
        ("t,x,y,z\nnoon,1,2,3\n", SITE, None, "expected a time such as"),
        ("t,name\n0,1\n", SITE, None, "expected columns t, x, y, z"),
    ],
)
def test_a_table_that_cannot_be_read_says_what_would_help(tmp_path, text, site, kind, says):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=says):
        told(tmp_path / "a.csv", site, kind)


TRACK = [(0.0, 0.0, 0.0, -1.0), (1.0, 1.0, 0.5, -1.0), (2.0, 2.0, 1.0, -1.0)]
DAY = "2024-11-19"


def table(head, row):
    """A table of `TRACK`: `row` names its cells with t (whole seconds), x, y and z."""
    lines = [
        row.format(t=int(t), ms=int(1e3 * t), x=x, y=y, z=z, d=-z, cx=f"{x:.1f}".replace(".", ","),
                   cy=f"{y:.1f}".replace(".", ","), fx=x / 0.3048, fy=y / 0.3048, fd=-z / 0.3048)
        for t, x, y, z in TRACK
    ]  # fmt: skip
    return "\n".join([head, *lines]) + "\n"


READ_TABLES = {
    "unit in brackets": (table("time (ms),x [m],y [m],z [m]", "{ms},{x},{y},{z}"), None),
    "feet": (table("t,x (ft),y (ft),depth (ft)", "{t},{fx},{fy},{fd}"), None),
    "zone": (table("time,z,y,x", DAY + "T07:06:4{t}+02:00,{z},{y},{x}"), None),
    "no zone": (table("time,x,y,z", DAY + " 07:06:4{t},{x},{y},{z}"), None),
    "UTC in words": (table("time,x,y,z", DAY + " 7:06:4{t} UTC,{x},{y},{z}"), None),
    "German": (table("Zeit;time;x;y;z", "1;19.11.2024 7:06:4{t};{cx};{cy};-1"), "decimal commas"),
    "two columns": (table("date,time,x,y,z", DAY + ",07:06:4{t},{x},{y},{z}"), None),
    "only a date": (table("x,y,z,date", "{x},{y},{z}," + DAY + "T07:06:4{t}Z"), None),
    "clock": (table("time,x,y,z", "07:06:4{t},{x},{y},{z}"), "hours, minutes and seconds"),
    "midnight": ("time,x,y,z\n23:59:59,0,0,-1\n00:00:00,1,.5,-1\n00:00:01,2,1,-1\n", "hours"),
    "midnight, dated": (
        "date,time,x,y,z\n2024-11-19,23:59:59,0,0,-1\n2024-11-20,00:00:00,1,.5,-1\n"
        "2024-11-20,00:00:01,2,1,-1\n", None
    ),
    "no values": (
        "t,x,y,z\n0,0,0,-1\n.2,#N/A,#N/A,#N/A\n.4,-,-,-\n.6,inf,inf,-1\n.8,-9999,-9999,-9999\n"
        "1,1,.5,-1\n2,2,1,-1\n", "4 left out: no position"
    ),
    "no time": ("t,x,y,z\nnan,7,7,-1\n0,0,0,-1\n1,1,.5,-1\n2,2,1,-1\n", "without a time"),
    "newest first": ("t,x,y,z\n2,2,1,-1\n1,1,.5,-1\n0,0,0,-1\n", "sorted"),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(READ_TABLES))
def test_tables_of_loggers_tell_the_track_and_what_was_assumed(tmp_path, name):
    text, says = READ_TABLES[name]
    (tmp_path / "a.csv").write_text(text)
    fixes, tally, notes = told(tmp_path / "a.csv")
    fixes = [f for f in fixes if f.position is not None]
    np.testing.assert_allclose(places(fixes), np.array(TRACK)[:, 1:], atol=1e-9)
    assert [f.time - fixes[0].time for f in fixes] == pytest.approx([0.0, 1.0, 2.0])
    assert tally.total == len(text.splitlines()) - 1
    assert (
        any(says in note for note in notes) if says else not [n for n in notes if "Zeit" not in n]
    )


@pytest.mark.parametrize(
    ("text", "site", "says"),
    [
        (table("time,x,y,z", "{ms},{x},{y},{z}"), SITE, "1000 s between positions"),
        ("t,x,y,z\n45615.29,0,0,-1\n45615.290001,1,0,-1\n", SITE, "moves at 1e+06 m/s"),
        (table("t,x,y,z", "{t},45{t}000.5,63{t}0000,{z}"), SITE, "3 of 3 positions are farther"),
        ("t,lat,lon,z\n0,5.5,58,-1\n1,5.5,58,-1\n", ON_EARTH, "check the frame"),
        ("t,x,y,z\n5,0,0,-1\n3,1,0,-1\n5,0,0,-1\n6,0,0,-1\n7,0,0,-1\n", SITE, "go back at 1 place"),
        (table("t,x,y,z,yaw", "{t},{x},{y},{z},1.{t}"), SITE, "name it yaw_rad"),
        (table("t;x;y;z;leak", "{t};{cx};{cy};-1;0"), SITE, "unused columns: leak"),
    ],
)  # fmt: skip
def test_what_is_unlikely_of_a_recording_is_told_with_what_helps(tmp_path, text, site, says):
    (tmp_path / "a.csv").write_text(text)
    assert any(says in note for note in told(tmp_path / "a.csv", site)[2])


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.csv", b"t,x,y,depth\n0,0,0,-1\n1,0,0,-2\n", "depths count downwards"),
        ("a.csv", b"t,x,y,z\n0,0,0,0\n2024-11-19T07:00:00Z,1,0,0\n", "expected one kind of times"),
        ("a.csv", b"time,x,y,z\n11/12/2024 07:00:00,0,0,0\n", "expected a time such as"),
        ("a.csv", b"", "expected a table, got nothing"),
        ("a.csv", bytes(range(256)), "not a text file"),
        ("a.tlog", b"", "no MAVLink message"),
        ("a.tlog", b"t,x,y,z\n0,0,0,0\n" * 9, "no MAVLink message"),
        ("a.bin", b"", "the file is empty"),
        ("a.bin", b"t,x,y,z\n0,0,0,0\n" * 9, "no message in its beginning"),
    ],
)
def test_what_is_no_recording_is_refused_with_what_was_expected(tmp_path, name, data, says):
    pytest.importorskip("pymavlink")
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=says):
        told(tmp_path / name)


def test_a_policy_of_recordings_out_of_range_is_refused():
    for wrong in ({"max_speed": 0.0}, {"max_far_share": 2.0}, {"max_back_share": -1.0},
                  {"max_height": -1.0}, {"min_back_count": 0}):  # fmt: skip
        with pytest.raises(InputError, match=next(iter(wrong))):
            RecordingPolicy(**wrong)


def test_bytes_of_a_log_that_belong_to_no_message_are_counted(tmp_path, m):
    file = tlog(tmp_path / "a.tlog", *vehicle(m))
    whole = places(told(file)[0])
    assert not any("no message" in note for note in told(file)[2])
    file.write_bytes(b"noise" + file.read_bytes() + b"cut off")
    fixes, _, notes = told(file)
    assert len(places(fixes)) == len(whole)
    assert any("12 bytes left out: they belong to no message" in note for note in notes)


def test_columns_that_are_not_understood_are_named(tmp_path):
    (tmp_path / "a.csv").write_text("t,x,y,battery,leak\n0,1,2,16.1,0\n1,1,3,16,0\n")
    _, _, notes = told(tmp_path / "a.csv")
    assert any("unused columns: battery, leak" in note for note in notes)
    assert any("z is taken as 0" in note for note in notes)


# telemetry logs


def tlog(file, *rows):
    """Rows of (system, component, message)."""
    from netsp.online.link.dialect import parser

    data = b"".join(
        struct.pack(">Q", 10**15 + k) + message.pack(parser(system, component))
        for k, (system, component, message) in enumerate(rows)
    )
    file.write_bytes(data)
    return file


def vehicle(m, system=1, *, local=True, degrees=None, flags=GOOD, n=30, begin=0):
    rows = []
    for k in range(n):
        t = begin + 100 * k
        if k % 5 == 0:
            rows += [(system, 1, m.MAVLink_heartbeat_message(12, 3, 128, 4, 4, 3)),
                     (system, 1, m.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0)),
                     (system, 154, m.MAVLink_heartbeat_message(26, 8, 0, 0, 4, 3)),
                     (system, 1, m.MAVLink_system_time_message(0, t))]  # fmt: skip
        if local:
            place = m.MAVLink_local_position_ned_message(t, 0.0, 0.04 * k, 1.0, 0, 0.4, 0)
            rows.append((system, 1, place))
        if degrees is not None:
            lat, lon = degrees
            place = m.MAVLink_global_position_int_message(t, lat, lon, 0, -1000, 0, 0, 0, 0)
            rows.append((system, 1, place))
    return rows


@pytest.fixture(scope="module")
def m():
    pytest.importorskip("pymavlink")
    from netsp.online.link.dialect import dialect

    return dialect()


def tried(monkeypatch, m):
    """The number of bytes that the parser of messages was given, in a list."""
    total = [0]
    decode, parse = m.MAVLink.decode, m.MAVLink.parse_char

    def counted(read):
        def wrapped(self, data):
            total[0] += len(data)
            return read(self, data)

        return wrapped

    monkeypatch.setattr(m.MAVLink, "decode", counted(decode))
    monkeypatch.setattr(m.MAVLink, "parse_char", counted(parse))
    return total


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (np.random.default_rng(5).bytes(40_000), "not a telemetry log"),
        (b"Notes of a dive, in words. " * 1500, "not a telemetry log"),
        (b"\xa3\x95" + np.random.default_rng(6).bytes(40_000), "end in .bin"),
        (b"\x1f\x8b" + np.random.default_rng(7).bytes(40_000), "gunzip"),
    ],
    ids=["noise", "words", "vehicle's log", "gzip"],
)
def test_a_file_that_is_no_telemetry_log_is_refused_in_one_look(
    tmp_path, m, monkeypatch, content, says
):
    (tmp_path / "wrong.tlog").write_bytes(content)
    total = tried(monkeypatch, m)
    with pytest.raises(InputError, match=says):
        list(read_fixes(tmp_path / "wrong.tlog", Frame(SITE)))
    assert total[0] < 2 * len(content)


def test_a_damaged_telemetry_log_loses_only_the_messages_that_are_damaged(tmp_path, m):
    file = tlog(tmp_path / "a.tlog", *vehicle(m))
    data = bytearray(file.read_bytes())
    whole = len(list(read_fixes(file, Frame(SITE))))
    marker = data.index(m.PROTOCOL_MARKER_V2, 300)
    data[marker + 11] ^= 0xFF  # a payload whose checksum is none any more
    data[8:8] = b"\xfd\xfe\x01rest of a message"
    file.write_bytes(data[:-3])
    assert whole - len(list(read_fixes(file, Frame(SITE)))) in (1, 2, 3)


FIX, NO_FIX = (580000100, 55000100), (0, 0)


@pytest.mark.parametrize("first", [True, False])
def test_the_only_vehicle_that_tells_positions_is_read_whoever_is_heard_first(tmp_path, m, first):
    mine, other = vehicle(m, 1), vehicle(m, 2, local=False, degrees=NO_FIX)
    rows = [*mine, *other] if first else [*other, *mine]
    fixes, tally, notes = told(tlog(tmp_path / "a.tlog", *rows))
    assert len(places(fixes)) == 30
    assert tally.total == len(rows)
    assert any("not of the vehicle, system 1" in note for note in notes)


def test_of_several_vehicles_with_positions_one_is_asked_for(tmp_path, m):
    rows = [*vehicle(m, 7), *vehicle(m, 1, n=10)]
    file = tlog(tmp_path / "a.tlog", *rows)
    with pytest.raises(InputError, match="--system 7 or --system 1"):
        told(file)
    fixes, tally, _ = told(file, system=1)
    assert (len(places(fixes)), tally.total) == (10, len(rows))
    with pytest.raises(
        InputError, match="no positions of system 3; it has messages of system 7, 1"
    ):
        told(file, system=3)


def test_without_a_gps_fix_metres_are_read_and_it_is_said(tmp_path, m):
    file = tlog(tmp_path / "a.tlog", *vehicle(m, degrees=NO_FIX))
    fixes, tally, notes = told(file, ON_EARTH)
    assert len(places(fixes)) == 30
    assert any("as with --frame local" in note for note in notes)
    assert tally.left_out["no GPS fix (lat = lon = 0)"] == {"GLOBAL_POSITION_INT": 30}
    np.testing.assert_allclose(places(fixes), places(told(file, ON_EARTH, "local")[0]))
    with pytest.raises(InputError, match=r"no GPS fix.*--frame local"):
        told(file, ON_EARTH, "global")


def test_degrees_count_where_both_are_told(tmp_path, m):
    fixes, tally, notes = told(tlog(tmp_path / "a.tlog", *vehicle(m, degrees=FIX)), ON_EARTH)
    assert len({tuple(p) for p in places(fixes)}) == 1
    assert sum(tally.left_out["degrees count, because the site has an origin"].values()) == 30
    assert not any("as with --frame local" in note for note in notes)


@pytest.mark.parametrize(
    ("site", "kind", "says"),
    [(SITE, None, "expected a problem with an origin"), (ON_EARTH, "local", "--frame global")],
)
def test_degrees_that_cannot_be_placed_say_what_would_help(tmp_path, m, site, kind, says):
    file = tlog(tmp_path / "a.tlog", *vehicle(m, local=False, degrees=FIX))
    with pytest.raises(InputError, match=says):
        told(file, site, kind)


# logs of vehicles


def test_a_log_with_pos_only_is_read_where_the_site_is_on_the_earth(tmp_path):
    pytest.importorskip("pymavlink")
    from tests.dataflash_bytes import FORMATS, header, packed, place

    pos = [
        packed("POS", int(1e6 * t), *((580000050, 55000030) if t > 1 else (0, 0)), -1.0, -1.5, -1.0)
        for t in range(6)
    ]
    file = tmp_path / "a.bin"
    file.write_bytes(header() + packed("ARM", 10**6, 1, 0, 0, 0) + b"".join(pos))
    fixes, tally, _ = told(file, ON_EARTH)
    assert len(places(fixes)) == 4
    assert places(fixes)[0][2] == -1.5
    assert tally.left_out["no GPS fix (lat = lon = 0)"] == {"POS": 2}
    assert tally.total == len(FORMATS) + 1 + 6
    with pytest.raises(InputError, match="4 POS are in degrees; expected a problem with an origin"):
        told(file, SITE)
    with pytest.raises(InputError, match="expected --frame global"):
        told(file, ON_EARTH, "local")
    rows = b"".join(place(t, 0.1 * t, 0.0, 1.0) for t in range(6))
    file.write_bytes(header() + rows)
    fixes, tally, notes = told(file, ON_EARTH)
    assert any("as with --frame local" in note for note in notes)
    assert tally.total == len(FORMATS) + 6
    file.write_bytes(header() + packed("ARM", 10**6, 1, 0, 0, 0))
    with pytest.raises(InputError, match="in XKF1, NKF1 and POS; the log has 1 ARM"):
        told(file, ON_EARTH)


# clocks


def drive(times, offset=lambda t: 0.0, **more):
    return [Fix(t + offset(t), (0.4 * t, 0.0, -1.0), estimate=True, **more) for t in times]


TIMES = np.round(np.arange(0.0, 12.0, 0.1), 3)


@pytest.mark.parametrize("begin", [0.0, 100.0, 1.732e9])
@pytest.mark.parametrize("step", [2.0, 4.0])
@pytest.mark.parametrize("every", [1, 5, 10])
def test_a_clock_that_is_set_is_not_a_restart(begin, step, every):
    """The guard goes on as with a clock that is not set: without an alarm and without a gap."""
    notes = []
    fixes = drive(TIMES[::every], lambda t: begin - (step if t >= 8.0 else 0.0))
    reports = list(replay_fixes(Guard(SITE, EXACT), fixes, notes.append))
    assert not [a for r in reports for a in r.raised]
    assert all(r.claims for r in reports)
    assert reports[-1].time == pytest.approx(TIMES[::every][-1] + begin - step)
    if every == 10 and step == 2.0:
        assert not notes  # at one position a second this is a single message that is behind
        return
    (note,) = notes
    assert "the clock was set: its time went back by" in note


@pytest.mark.parametrize("begin", [100.0, 4000.0])
@pytest.mark.parametrize("boot", [0.2, 20.0])
def test_a_clock_that_begins_anew_near_zero_is_a_restart(begin, boot):
    notes = []
    fixes = drive(TIMES, lambda t: begin if t < 6.0 else boot - 6.0)
    reports = list(replay_fixes(Guard(SITE, EXACT), fixes, notes.append))
    assert "the vehicle restarted" in notes[0]
    assert reports[-1].time == pytest.approx(TIMES[-1] + boot - 6.0)
    assert reports[-1].claims


def test_a_message_that_comes_late_is_left_out():
    stream = Stream(Guard(SITE, EXACT))
    for fix in drive(TIMES[:50]):
        stream.add(fix)
    assert stream.add(Fix(1.0, (0.4, 0.0, -1.0))) is None
    assert stream.add(Fix(5.0, (2.0, 0.0, -1.0))).claims


@settings(max_examples=50, deadline=None)
@given(steps=st.lists(st.tuples(st.integers(6, 30), st.floats(1.5, 5.0)), max_size=5))
def test_a_clock_that_is_set_again_and_again_never_goes_back(steps):
    clock, own, times = VehicleClock(), 1000.0, []
    for n, back in steps:
        for _ in range(n):
            own += 0.1
            reading = clock.read(own)
            assert reading.event != "restart"
            if reading.event != "late":
                times.append(reading.time)
        own -= back
    assert (np.diff(times) > 0.0).all()
    assert len(times) >= sum(n - 4 for n, _ in steps)


def test_a_policy_out_of_range_is_refused():
    for wrong in (
        {"max_late_s": 0.0},
        {"max_boot_s": -1.0},
        {"n_behind": 0},
        {"min_behind_s": -0.1},
    ):
        with pytest.raises(InputError, match=next(iter(wrong))):
            ClockPolicy(**wrong)


def test_the_path_of_a_recording_keeps_its_order_when_the_clock_is_set(tmp_path):
    rows = "\n".join(f"{t if t < 6.0 else t - 2.0:.2f},0,{0.4 * t:.3f},1" for t in TIMES.tolist())
    (tmp_path / "a.csv").write_text(f"t,north,east,down\n{rows}\n")
    (path,) = read_any_paths(tmp_path / "a.csv", SITE)
    assert (np.diff(path.points[:, 0]) > 0.0).all()
    assert (np.diff(path.times) > 0.0).all()
    assert path.times[-1] == pytest.approx(TIMES[-1])


# what is not known


def test_an_estimate_that_was_never_vouched_for_is_an_alarm_at_once(tmp_path, m, capsys):
    file = tlog(tmp_path / "a.tlog", *vehicle(m, flags=NONE))
    reports = list(replay_fixes(Guard(SITE, EXACT), told(file)[0]))
    assert [a.kind for a in reports[0].raised] == ["estimate"]
    assert "never vouched" in reports[0].raised[0].text
    assert not any(r.claims for r in reports)
    (tmp_path / "site.json").write_text(SITE.to_json())
    assert main(["guard", str(tmp_path / "site.json"), "--replay", str(file)]) == 4
    said = capsys.readouterr()
    assert "nothing was claimed about the tether: the vehicle has never vouched" in said.err
    assert '"kind": "estimate"' in said.out


def test_a_gap_in_a_recording_is_told_as_beside_the_vehicle():
    rows = [f for f in drive(TIMES) if not 3.0 < f.time < 9.0]
    gaps = [Fix(t) for t in TIMES if 3.0 < t < 9.0]
    for fixes in (rows, sorted([*rows, *gaps], key=lambda f: f.time)):
        reports = list(replay_fixes(Guard(SITE, EXACT), fixes))
        raised = [a.text for r in reports for a in r.raised if a.level == Level.ALARM]
        assert len(raised) == 1
        assert "no position has come" in raised[0]
        assert reports[-1].claims


@pytest.mark.parametrize(
    ("text", "n", "says"),
    [
        ("timestamp,x,y\n1732000000000,0,0\n1732000000500,1,0\n", 2, "milliseconds since 1970"),
        ("t,x,y,z\n0,0,0,1\n1,nan,2,1\n2,1,NaN,1\n3,1,1,\n4,2,2,1\n", 2, "3 rows left out"),
        ("t,lat,lon,depth\n0,0,0,1\n1,58,5.5,1\n2,58.0001,5.5,1\n", 2, "1 row left out"),
        ("time,x,y\n2026-05-01T12:00:00Z,0,0\n2026-05-01T12:00:02Z,1,1\n", 2, None),
    ],
)
def test_paths_of_tables_have_the_same_times_and_gaps(tmp_path, text, n, says, capsys):
    (tmp_path / "a.csv").write_text(text)
    (path,) = read_any_paths(tmp_path / "a.csv", ON_EARTH)
    assert len(path.points) == n
    assert 0.0 < path.times[-1] - path.times[0] < 10.0
    assert len(path.notes) == (says is not None)
    (tmp_path / "p.json").write_text(ON_EARTH.to_json())
    assert main(["verify", str(tmp_path / "p.json"), str(tmp_path / "a.csv"), "--measures"]) == 0
    assert says is None or says in capsys.readouterr().err


def test_beside_the_vehicle_it_is_said_once_which_option_would_help(m):
    from netsp.online.guard.live import _Hints
    from netsp.online.link.dialect import parser
    from netsp.online.link.mavlink_messages import Listener

    listener, hints = Listener(Frame(ON_EARTH)), _Hints()
    said = []
    for system, _, packet in [*vehicle(m, 2, local=False, degrees=NO_FIX),
                              *vehicle(m, 1, local=False, degrees=FIX)]:  # fmt: skip
        (message,) = parser().parse_buffer(packet.pack(parser(system, 1)))
        said += hints.about(message, listener.read(message), listener)
    assert len(said) == 2
    assert "--frame local" in said[0]
    assert "--system 1" in said[1]


@pytest.mark.parametrize("wire", [1, 2])
def test_damaged_messages_of_a_log_are_told_by_the_checksum_as_pymavlink_tells_them(m, wire):
    import random

    from netsp.online.guard.telemetry_log import STAMP_BYTES, messages_of_log
    from netsp.online.link.dialect import parser

    chance, stamp = random.Random(wire), (10**15).to_bytes(STAMP_BYTES, "big")
    packets = [bytes(packet.pack(parser(1, 1), force_mavlink1=wire == 1))
               for _, _, packet in vehicle(m, 1)]  # fmt: skip
    assert len(list(messages_of_log(b"".join(stamp + p for p in packets)))) == len(packets)
    for _ in range(200):
        good = bytearray(chance.choice(packets))
        at = chance.randrange(1, len(good))
        good[at] ^= 1 << chance.randrange(8)
        try:
            found = parser().decode(bytearray(good))
            is_known = not found.get_type().startswith("UNKNOWN")
        except Exception:
            is_known = False
        heard = [x for x in messages_of_log(stamp + bytes(good))
                 if not x.get_type().startswith("UNKNOWN")]  # fmt: skip
        assert len(heard) == is_known, (at, bytes(good).hex())
