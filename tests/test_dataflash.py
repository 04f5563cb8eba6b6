"""Logs that ArduPilot's vehicles write themselves, packed as its LogStructure.h says."""

import struct

import numpy as np
import pytest

from netsp import Circle, Problem
from netsp.base.errors import InputError
from netsp.online.guard.replay import read_fixes
from netsp.online.guard.stream import replay_fixes
from netsp.online.guard.tether_guard import Guard, GuardOptions
from netsp.online.link.geo_frame import Frame
from tests.dataflash_bytes import TYPES, header, packed, place

SITE = Problem(
    base=(0, 0), goals=[(9, 0, -1)], tether_length=30,
    obstacles=[Circle(center=(5, 0), radius=0.5, name="A")],
)  # fmt: skip


GOOD = 1 | 2 | 8 | 16 | 32
"""Attitude, horizontal velocity, horizontal positions, vertical position."""
TURNED, CONSTANT = 1024, 128


def status(t, flags, core=0, primary=0, name="XKF4"):
    offsets = (0.0, 0.0, 0.0) if name == "XKF4" else (0.0, 0, 0)
    return packed(name, int(t * 1e6), core, 1, 1, 1, 1, 1, *offsets, 0, 0, flags, 0, primary)


def read(tmp_path, *rows):
    file = tmp_path / "log.bin"
    file.write_bytes(header() + b"".join(rows))
    return list(read_fixes(file, Frame(SITE)))


def test_places_headings_velocities_arming_modes_and_the_winch_are_read(tmp_path):
    fixes = read(
        tmp_path, packed("ARM", 10**6, 1, 0, 0, 0), packed("MODE", 2 * 10**6, 4, 4, 0),
        status(2.5, GOOD), place(3.0, 2.0, 1.0, 4.0, (0.2, 0.1, -0.3), yaw=90.0),
        packed("WINC", 4 * 10**6, 1, 0, 0, 0, 0, 9.0, 12.5, 0.0, 0, 0.0, 0),
    )  # fmt: skip
    armed, mode, vouched, there, winch = fixes
    assert (armed.time, armed.armed) == (1.0, True)
    assert mode.mode == "GUIDED"
    assert vouched.estimate is True
    assert there.position == pytest.approx((1.0, 2.0, -4.0))
    assert there.velocity == pytest.approx((0.1, 0.2, 0.3))
    assert there.heading == pytest.approx(90.0)
    assert winch.paid_out == pytest.approx(12.5)


WRITTEN = bytes.fromhex(
    "dcf4362b00000000000f0059006a0098ce46bd4f0bd53d7ae688bd"
    "7e1dbcbc1ca21c41faacadc05ac72ebf0b0002000400b3210000"
)
"""An estimate of an ArduPilot vehicle, 725 s after it had started, byte for byte."""


def test_an_estimate_that_a_vehicle_wrote_is_read_as_what_it_is(tmp_path):
    (fix,) = read(tmp_path, struct.pack("<BBB", 0xA3, 0x95, TYPES["XKF1"]) + WRITTEN)
    assert fix.time == pytest.approx(725.021916)
    assert fix.position == pytest.approx((-5.427365, 9.789577, 0.682729), abs=1e-5)
    assert fix.velocity == pytest.approx((0.104025, -0.048537, 0.066846), abs=1e-5)
    assert fix.heading == pytest.approx(1.06)


def test_a_vehicle_that_has_turned_once_is_believed_on(tmp_path):
    """Bit 10 of the status says that a takeoff was detected, not that nothing is known yet."""
    fixes = read(
        tmp_path, status(1.0, GOOD | TURNED), status(2.0, GOOD | CONSTANT), status(3.0, 1),
        place(4.0, 0.0, 0.0, 0.0),
    )  # fmt: skip
    assert [f.estimate for f in fixes[:3]] == [True, False, False]


def test_the_filter_that_the_vehicle_goes_by_counts(tmp_path):
    rows = [place(0.5, 1.0, 0.0, 0.0), place(0.5, 9.0, 9.0, 9.0, core=1)]
    rows += [status(1.0, GOOD, primary=1), status(1.0, 0, core=1, primary=1)]
    rows += [place(1.5, 9.0, 9.0, 9.0), place(1.5, 2.0, 0.0, 0.0, core=1)]
    fixes = read(tmp_path, *rows)
    assert [f.position[1] for f in fixes if f.position is not None] == [1.0, 2.0]
    assert [f.estimate for f in fixes if f.estimate is not None] == [False]


def test_older_vehicles_log_their_older_filter(tmp_path):
    fixes = read(
        tmp_path, status(1.0, GOOD, name="NKF4"), place(2.0, 1.0, 2.0, 3.0, name="NKF1"),
    )  # fmt: skip
    assert fixes[0].estimate is True
    assert fixes[1].position == pytest.approx((2.0, 1.0, -3.0))


@pytest.mark.parametrize("core", [-1, 5])
def test_a_filter_that_is_not_logged_leaves_the_first(tmp_path, core):
    fixes = read(tmp_path, status(1.0, GOOD, primary=core), place(2.0, 1.0, 0.0, 0.0))
    assert [f.estimate for f in fixes] == [True, None]
    assert fixes[1].position == pytest.approx((0.0, 1.0, 0.0))


def test_where_the_newer_filter_knows_nothing_the_older_counts(tmp_path):
    fixes = read(
        tmp_path, place(1.0, np.nan, 0.0, 0.0), place(2.0, 1.0, 0.0, 0.0, name="NKF1"),
    )  # fmt: skip
    assert [f.time for f in fixes if f.position is not None] == [2.0]


def test_a_place_is_kept_when_its_velocity_is_none(tmp_path):
    for v in ((np.nan, 0.0, 0.0), (0.0, np.inf, 0.0), (0.0, 0.0, np.nan)):
        (fix,) = read(tmp_path, place(1.0, 1.0, 2.0, 3.0, velocity=v))
        assert fix.position == pytest.approx((2.0, 1.0, -3.0))
        assert fix.velocity is None


def test_formats_that_are_damaged_and_columns_that_are_missing_are_told(tmp_path):
    file = tmp_path / "log.bin"
    rows = place(1.0, 1.0, 2.0, 3.0)
    file.write_bytes(header().replace(b"QBccCfffffffccce", b"QBccCfff!fffccce", 1) + rows)
    with pytest.raises(InputError, match="not a log of ArduPilot"):
        list(read_fixes(file, Frame(SITE)))
    file.write_bytes(header().replace(b"dPD,PN,PE", b"dPD,QN,PE", 1) + rows)
    with pytest.raises(InputError, match=r"without its column.*PN"):
        list(read_fixes(file, Frame(SITE)))


def test_a_log_without_places_and_one_cut_short_are_told(tmp_path):
    with pytest.raises(InputError, match="no positions"):
        read(tmp_path, packed("ARM", 10**6, 1, 0, 0, 0))
    rows = b"".join(place(0.1 * k, 0.0, 0.05 * k, 1.0) for k in range(50))
    file = tmp_path / "cut.bin"
    file.write_bytes((header() + rows)[:-20])
    assert len(list(read_fixes(file, Frame(SITE)))) == 49


def test_a_guard_replays_a_log_round_an_obstacle(tmp_path):
    angles = np.linspace(np.pi, -1.5 * np.pi, 400)
    rows = [status(0.0, GOOD | TURNED)]
    rows += [place(0.1 * k, 0.0, 0.05 * k, 1.0) for k in range(70)]
    rows += [
        place(7.0 + 0.1 * k, 1.5 * np.sin(a), 5.0 + 1.5 * np.cos(a), 1.0)
        for k, a in enumerate(angles)
    ]
    file = tmp_path / "log.bin"
    file.write_bytes(header() + b"".join(rows))
    guard = Guard(SITE, GuardOptions(noise=0.01, drift=0.01))
    reports = list(replay_fixes(guard, read_fixes(file, Frame(SITE))))
    assert reports[0].claims
    assert reports[-1].loops == (("A",),)
