"""The fake ArduSub measured against recordings of the real one (`tests/data/ardusub47`).

Each test measures the same quantity in a recording and in the fake, which runs on a clock of its
own here.
"""

from __future__ import annotations

import gzip
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.autopilot import Simulation, fence_bytes

DATA = Path(__file__).parent / "data" / "ardusub47"
GPS_LOST_S, GPS_JUMPED_S = 77.3, 96.3
"""Times in gps-lost-pool and gps-jump-pool at which the GPS was lost and moved, s."""

NO_POSITION = ~(mavlink.EKF_POS_HORIZ_REL | mavlink.EKF_POS_HORIZ_ABS)


@cache
def log(name: str) -> dict[str, list[dict[str, Any]]]:
    """Return the messages of a vehicle's log by their kind."""
    reader = DFReader_binary.__new__(DFReader_binary)
    raw = gzip.decompress((DATA / f"{name}.BIN.gz").read_bytes())
    found: dict[str, list[dict[str, Any]]] = {}
    with tempfile.NamedTemporaryFile(suffix=".BIN") as file:
        file.write(raw)
        file.flush()
        DFReader_binary.__init__(reader, file.name)
        while (message := reader.recv_match()) is not None:
            row = message.to_dict()
            row["t"] = row.get("TimeUS", 0) / 1e6
            found.setdefault(message.get_type(), []).append(row)
        reader.data_map.close()
        reader.filehandle.close()
    return found


@cache
def track(name: str) -> np.ndarray:
    """Return time, true x, y, z and believed x, y, z of a flight, a row each."""
    with gzip.open(DATA / f"{name}-true.csv.gz", "rt") as file:
        return np.loadtxt(file, delimiter=",", skiprows=1)


def error(name: str) -> np.ndarray:
    """Return time and the distance in the plan of the believed from the true place."""
    rows = track(name)
    return np.column_stack([rows[:, 0], np.hypot(*(rows[:, 4:6] - rows[:, 1:3]).T)])


def error_of(vehicle: Simulation) -> np.ndarray:
    """Return the same of the fake."""
    return np.array([
        [r["t"], np.hypot(*np.subtract(r["est"], r["true"])[:2])] for r in vehicle.rows
    ])  # fmt: skip


def at(rows: np.ndarray, t: float) -> float:
    return float(np.interp(t, rows[:, 0], rows[:, 1]))


def first(messages: list[dict[str, Any]], **wanted: Any) -> float:
    """Return the time of the first message that says something."""
    return float(
        next(m["t"] for m in messages if all(m[k] == v for k, v in wanted.items()))
    )  # fmt: skip


def under_way(**options: Any) -> Simulation:
    """Return a vehicle on a long leg to the north."""
    vehicle = Simulation(start=(0.0, 0.0, -1.0), **options)
    vehicle.fly()
    vehicle.go((0.0, 60.0, -1.0))
    vehicle.advance(8.0)
    return vehicle


# parameters and failsafes


def test_parameters_have_the_names_and_defaults_of_the_recorded_vehicle() -> None:
    recorded = {m["Name"]: m["Value"] for m in log("fly-wharf")["PARM"]}
    own = Simulation().vehicle.params
    assert {"MAV_SYSID", "ARMING_SKIPCHK", "FS_GCS_TIMEOUT"} <= set(own)
    assert own == {name: pytest.approx(recorded[name]) for name in own}


@pytest.mark.parametrize("flight", ["gps-lost-pool", "gps-jump-pool"])
def test_it_disarms_as_long_after_the_ground_station_fell_silent(flight: str) -> None:
    said = [m["t"] for m in log(flight)["MSG"] if m["Message"].startswith("GCS:")]
    disarmed = log(flight)["ARM"][-1]
    vehicle = under_way()
    vehicle.beating, begin = False, vehicle.now
    event = vehicle.event("disarmed")
    assert event["t"] - begin == pytest.approx(disarmed["t"] - said[-1], abs=0.1)
    assert (disarmed["ArmState"], event["method"]) == (0, disarmed["Method"])
    heard = [m.text for m in vehicle.wire.messages() if m.get_type() == "STATUSTEXT"]
    recorded = [m["Message"] for m in log(flight)["MSG"] if m["t"] == disarmed["t"]]
    assert heard[-2:] == recorded


def test_targets_above_home_draw_no_refusal_and_do_not_lift_it_out_of_the_water() -> None:
    vehicle = Simulation(start=(0.0, 0.0, -1.0))
    vehicle.fly()
    vehicle.wire.messages()
    vehicle.go((0.0, 3.0, 0.5))
    vehicle.advance(20.0)
    assert [e["event"] for e in vehicle.events if "refused" in e["event"]] == []
    assert not [m for m in vehicle.wire.messages() if m.get_type() == "STATUSTEXT"]
    assert vehicle.truth()[:, 3].max() <= 0.0


@pytest.mark.parametrize(
    ("fences", "fits"),
    [([1] * 51, True), ([1] * 52, False), ([83], True), ([84], False), ([40, 40], True),
     ([40, 1, 1], True), ([3] * 25, True), ([3] * 26, False)],
)  # fmt: skip
def test_fences_fit_by_their_bytes(fences: list[int], fits: bool) -> None:
    vehicle = Simulation()
    m, kind = mavlink, mavlink.MAV_MISSION_TYPE_FENCE
    vehicle.send(m.MAVLink_mission_count_message(1, 1, sum(fences), kind))
    items = [(5004 if n == 1 else 5002, n) for n in fences for _ in range(n)]
    for seq, (command, n) in enumerate(items):
        vehicle.send(m.MAVLink_mission_item_int_message(
            1, 1, seq, 0, command, 0, 1, n, 0, 0, 0, 1000 * seq, 0, 0, kind
        ))  # fmt: skip
    ack = [x for x in vehicle.wire.messages() if x.get_type() == "MISSION_ACK"]
    assert [x.type for x in ack] == [0 if fits else m.MAV_MISSION_NO_SPACE]
    assert bool(vehicle.vehicle.fence_items) is fits
    if fits:
        count = sum(13 if n == 1 else 2 + 8 * n for n in fences)
        assert fence_bytes(vehicle.vehicle.fence_items) == count + 5


# the estimate


def test_a_lost_estimate_drifts_on_and_stops_as_recorded() -> None:
    flags = [m for m in log("gps-lost-pool")["XKF4"] if m["C"] == 0 and m["t"] > GPS_LOST_S]
    timed_out = next(m["t"] for m in flags if not m["SS"] & ~NO_POSITION) - GPS_LOST_S
    stopped = next(m["t"] for m in flags if m["SS"] & 128) - GPS_LOST_S
    assert (timed_out, stopped) == (pytest.approx(7.2, abs=0.2), pytest.approx(15.3, abs=0.2))
    drifts = []
    for seed in range(3):
        vehicle = under_way(seed=seed)
        begin = vehicle.now
        vehicle.do(do="lose_estimate")
        vehicle.wire.messages()
        vehicle.advance(20.0)
        sent = vehicle.wire.messages()
        ekf = [m for m in sent if m.get_type() == "EKF_STATUS_REPORT"]
        expected = {int(m["SS"]) & 1023 for m in flags}
        assert {m.flags for m in ekf} == expected == {831, 39, 167}
        last = max(m.time_boot_ms for m in sent if m.get_type() == "LOCAL_POSITION_NED") / 1e3
        assert vehicle.event("estimate timed out")["t"] - begin == pytest.approx(timed_out, abs=0.3)
        assert last - begin == pytest.approx(stopped, abs=0.3)
        drifts.append([at(error_of(vehicle), begin + s) for s in (3.0, 5.0, 7.1, 13.0)])
    recorded = [at(error("gps-lost-pool"), GPS_LOST_S + s) for s in (3.0, 5.0, 7.1, 13.0)]
    np.testing.assert_allclose(np.mean(drifts, axis=0), recorded, rtol=0.25)


def test_a_gps_that_jumps_is_rejected_and_then_believed_as_recorded() -> None:
    recorded = error("gps-jump-pool")
    believed = recorded[recorded[:, 1] > 0.5][0, 0] - GPS_JUMPED_S
    assert believed == pytest.approx(7.3, abs=0.3)
    vehicle = under_way()
    begin = vehicle.now
    vehicle.do(do="gps_jump", by=[0.0, 5.6])
    vehicle.wire.messages()
    vehicle.advance(12.0)
    own = error_of(vehicle)
    own = own[own[:, 0] > begin]
    assert own[own[:, 1] > 0.5][0, 0] - begin == pytest.approx(believed, abs=0.4)
    assert own[own[:, 0] < begin + 6.9, 1].max() < 0.1
    assert at(own, begin + 9.0) == pytest.approx(at(recorded, GPS_JUMPED_S + 9.0), rel=0.25)
    ratios = [m for m in vehicle.wire.messages() if m.get_type() == "EKF_STATUS_REPORT"]
    cores = log("gps-jump-pool")["XKF4"]
    logged = [m for m in cores if m["C"] == 0 and m["t"] > GPS_JUMPED_S + 0.3]
    assert ratios[1].pos_horiz_variance == pytest.approx(logged[0]["SP"], abs=0.1)
    assert any(m.flags & mavlink.EKF_GPS_GLITCHING for m in ratios)
    assert any(m["SS"] & 1 << 14 for m in logged)


def test_a_small_jump_of_the_gps_is_believed_at_once_and_a_large_one_after_seven_seconds() -> None:
    for jump, rejected in ((1.0, 0.0), (3.0, 0.0), (12.0, 7.2)):
        vehicle = under_way()
        begin = vehicle.now
        vehicle.do(do="gps_jump", by=[jump, 0.0])
        vehicle.advance(10.0)
        own = error_of(vehicle)
        own = own[own[:, 0] > begin]
        assert own[own[:, 1] > 0.5 * jump][0, 0] - begin == pytest.approx(rejected + 0.3, abs=0.3)
