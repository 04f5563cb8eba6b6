"""A robot on a tether from a ship never asks for more tether than there is, wherever that goes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError
from netsp.plan.space.mission_solver import solve_mission
from netsp.view.pictures.mission_picture import save_runs, tethers_along
from netsp.world import Scene
from netsp.world.mission.anchor_track import AnchorTrack
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import describe_run
from netsp.world.simulator.mission_run import simulate

PILES = Scene(
    solids=[
        {"post": {"center": [x, y], "radius": 0.5}} for x in (0, 6, 12) for y in (-3, 0, 3)
    ],
    bounds=(-6, -8, -6, 18, 8, 2),
)  # fmt: skip
AMONG = [(3, 1.5, -2), (9, 1.5, -3), (14, -1.5, -2), (3, -1.5, -1)]


def mission(waypoints, track, **more):
    return Mission(
        scene="-", anchor=(-3, -6, 0), waypoints=waypoints, track=track,
        **{"start": (-3, -5, 0), "tether_length": 12.0, "speed": 0.5, **more},
    )  # fmt: skip


def fly(waypoints, track, planner="predictive", vehicle="kinematic", **more):
    return simulate(mission(waypoints, track, **more), planner, vehicle=vehicle, scene=PILES)


def kept(run):
    s = run.summary
    return s["exceedance_s"] == 0.0 and s["home"]["tether_free"] and not s["defects"]


@given(
    legs=st.lists(st.tuples(st.floats(0.1, 50), *[st.floats(-9, 9)] * 3), min_size=1, max_size=6),
    now=st.floats(0, 400), later=st.floats(0, 400),
)  # fmt: skip
def test_a_track_goes_no_faster_than_its_fastest_leg_and_passes_every_position(legs, now, later):
    times = np.cumsum([leg[0] for leg in legs])
    rows = [(t, *leg[1:]) for t, leg in zip(times, legs, strict=True)]
    track = AnchorTrack.for_mission(mission(AMONG, rows))
    for t, *place in rows:
        assert np.allclose(track(t), place)
    assert np.allclose(track(track.end + later), rows[-1][1:])
    way = track.distance_between(now, now + later)
    assert np.linalg.norm(track(now + later) - track(now)) <= way + 1e-9
    assert way <= track.speed * later * (1.0 + 1e-9) + 1e-9


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 10**6))
def test_wherever_a_ship_goes_the_tether_is_never_exceeded_and_comes_home_free(seed):
    rng = np.random.default_rng(seed)
    # along the piles and back, as fast as 0.9 of the robot
    x = np.clip(np.cumsum([-3.0, *rng.uniform(-15, 15, 5)]), -5, 17)
    way = np.hypot(np.diff(x), 0.5)
    times = np.cumsum(way / (0.5 * rng.uniform(0.1, 0.9, 5)) + 0.1)
    y = -6.0 + np.cumsum(rng.uniform(-0.3, 0.3, 5))
    track = [(t, a, b, 0.0) for t, a, b in zip(times, x[1:], y, strict=True)]
    run = fly(rng.permutation(AMONG).tolist(), track, tether_length=float(rng.uniform(7, 14)))
    assert kept(run)
    assert PILES.field().distance(np.array([[r.x, r.y, r.z] for r in run.log])).min() > 0.1


def test_a_robot_waits_for_a_ship_that_comes_nearer_and_goes_where_it_could_not():
    there = [(14, -1.5, -2)]
    assert fly(there, []).summary["left_out"]
    run = fly(there, [(40, -3, -6, 0), (140, 14, -6, 0)])
    assert run.summary["visited"] == 1
    assert run.summary["waited_s"] > 10.0
    assert "waited" in describe_run(run, "m")
    assert kept(run)
    gone = fly(there, [(60, -5, -6, 0)])
    assert gone.summary["visited"] == 0
    assert "out of reach" in gone.summary["left_out"][0]["reason"]
    assert gone.log[-1].time > 60.0  # given up only when the ship has come to rest
    assert kept(gone)


def test_a_long_stay_is_not_begun_when_the_ship_leaves_meanwhile():
    stop = {"position": (3, -1.5, -1), "dwell": 60, "heading": 90}
    run = fly([stop], [(60, 14, -6, 0), (120, 14, -6, 0), (180, -3, -6, 0)], tether_length=9.0)
    assert run.summary["visited"] == 1
    assert run.summary["stops"][0]["waypoint"] == 0
    assert run.summary["waited_s"] > 60.0
    assert kept(run)


def test_without_regard_for_the_tether_a_ship_winds_it_up():
    """The other tests could see an exceedance."""
    run = fly(AMONG, [(60, 14, -6, 0), (120, -3, -6, 0)], planner="none")
    assert run.summary["exceedance_s"] > 10.0


def test_a_ship_that_stays_is_an_anchor_that_does():
    still, fixed = fly(AMONG, [(1e-3, -3, -6, 0)]), fly(AMONG, [])
    assert still.summary["visited"] == fixed.summary["visited"]
    assert still.log[-1].time == pytest.approx(fixed.log[-1].time, abs=0.5)


def test_the_dynamic_vehicle_follows_a_ship_in_a_current():
    track, few = [(60, 14, -6, 0), (160, -3, -6, 0)], AMONG[: len(AMONG) // 2 + 1]
    run = fly(few, track, vehicle="bluerov2", current=(0.2, 0.0, 0.0))
    assert kept(run)
    assert run.summary["visited"] == len(few)


def test_home_is_beside_the_ship_where_there_is_room_and_else_the_ship():
    run = fly(AMONG[:1], [(60, 8, -6, 0)])
    last = run.log[-1]
    assert np.allclose(
        (last.x, last.y, last.z), run.tether.anchor + np.array([0.0, 1.0, 0.0]), atol=0.1
    )
    beside = fly(AMONG[:1], [(20, 0, -4.3, 0)])  # a metre on there is a pile
    last = beside.log[-1]
    assert np.allclose((last.x, last.y, last.z), (0, -4.3, 0), atol=0.1)
    assert kept(run)
    assert kept(beside)


def test_the_tether_drawn_at_the_end_is_the_one_flown_and_the_picture_shows_the_track(tmp_path):
    run = fly(AMONG[:2], [(60, 6, -6, 0)])
    drawn = tethers_along(run, PILES, np.array([len(run.log) // 2, len(run.log) - 1]))
    assert np.allclose(drawn[-1].anchor, run.tether.anchor)
    assert drawn[-1].length == pytest.approx(run.tether.length, abs=0.02)
    save_runs([run], PILES, tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("track", "message"),
    [
        ([(10, 1, 2)], r"track\[0\]: expected \[t, x, y, z\]"),
        ([(0, 0, -6, 0)], "track: expected ascending times after 0 s, got 0 s in row 0"),
        ([(9, 0, -6, 0), (5, 0, -6, 0)], "track: expected ascending times.* got 5 s in row 1"),
        ([(10, float("nan"), -6, 0)], r"track\[0\]: expected a finite number"),
        ([(10, 9, -6, 0)], r"track\[0\]: the anchor moves at 1.2 m/s.*outrun the tether"),
        ([(100, 0, -3, 0)], r"track\[0\]: \(0, -3, 0\) lies 0.5 inside"),
        ([(100, -3, 0, 0), (200, 3, 0, 0)], r"track\[1\]: from 100 s to 200 s .* through a solid"),
        ([(1e9, -3, 0, 0)], "track: its 1e.09 s take more than"),
    ],
)
def test_bad_tracks_are_told_in_one_line(track, message):
    with pytest.raises(InputError, match=message) as error:
        fly(AMONG, track)
    assert len(str(error.value).splitlines()) == 1


def test_what_cannot_follow_a_moving_anchor_says_so():
    moving = mission(AMONG, [(100, 0, -6, 0)])
    with pytest.raises(InputError, match="track: tether model 'react' cannot follow it"):
        simulate(moving, "react", tether="react", scene=PILES)
    with pytest.raises(InputError, match="track: a moving anchor has no one best order"):
        solve_mission(moving, scene=PILES)
