"""What a tether needs beyond its taut length follows the laws of cables, and planners obey it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError
from netsp.world import GeodesicTether
from netsp.world.mission.equipment import TetherPhysics
from netsp.world.mission.mission import Mission
from netsp.world.simulator.mission_run import simulate
from netsp.world.tether.load import payout, payout_along, pull_on_robot, turning
from tests.posts_and_rings import POST, ring

DIAMETER, DRAG = 0.0076, 1.2
"""A BlueROV2's tether, and a cylinder across the flow."""


def load_of(water, tension=10.0, slack=0.0):
    physics = TetherPhysics(slack=slack, diameter=DIAMETER, tension=tension)
    return physics.load(np.array(water))


def integrated(chord, load, speed):
    """Length of a span that the balance of its pieces, T da = w cos(a)^2 ds, gives: a(s) from the
    middle on until half the chord is spanned."""
    w, a, x, s, ds = load.drag * speed**2, 0.0, 0.0, 0.0, 1e-4 * chord
    while x < 0.5 * chord:
        middle = a + 0.5 * ds * w / load.tension * math.cos(a) ** 2
        a += ds * w / load.tension * math.cos(middle) ** 2
        x += ds * math.cos(middle)
        s += ds
    return 2.0 * (s - (x - 0.5 * chord) / math.cos(a))


@pytest.mark.parametrize("speed", [0.2, 0.5, 0.8])
def test_a_span_across_the_current_is_as_long_as_the_balance_of_its_pieces_says(speed):
    load = load_of((0, speed, 0))
    found = payout_along([(0, 0, 0), (10, 0, 0)], load)
    assert found - 10 == pytest.approx(integrated(10.0, load, speed) - 10, rel=1e-3)


@settings(deadline=None)
@given(speed=st.floats(0.01, 0.3), chord=st.floats(0.5, 12), angle=st.floats(0.0, math.pi))
def test_small_sag_is_q_squared_over_24(speed, chord, angle):
    load = load_of((speed * math.cos(angle), 0, speed * math.sin(angle)))
    q = load.drag * (speed * math.sin(angle)) ** 2 * chord / load.tension
    excess = payout_along([(0, 0, 0), (chord, 0, 0)], load) / chord - 1.0
    assert excess == pytest.approx(q * q / 24, rel=0.06, abs=1e-12)


@settings(deadline=None)
@given(st.lists(st.floats(0.1, 5), min_size=1, max_size=6), st.floats(0, 0.5))
def test_slack_is_a_share_of_all_and_still_water_adds_nothing(steps, slack):
    line = np.cumsum([[0, 0, 0], *[[0, s, 0.5 * s] for s in steps]], axis=0)
    taut = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    assert payout_along(line, load_of((0, 0, 0), slack=slack)) == pytest.approx(taut * (1 + slack))


def test_a_contact_parts_a_span_in_two():
    """About a post the tether sags as two spans, of a third of the excess of one."""
    model = GeodesicTether(POST.field(), 0.1)
    load = load_of((0.0, 0.0, 0.4))
    bent = model.lay([(-4, 0.3, 0), (0, 1.5, 0), (4, 0.3, 0)])
    spans = [c.length for c in bent.contacts]
    free = 2 * math.hypot(4, 0.3)
    each = payout_along([(0, 0, 0), (math.sqrt(16.09 - 0.25), 0, 0)], load)
    excess = payout(bent, load) - bent.length
    assert sum(spans) < 0.5 < free
    assert excess == pytest.approx(2 * (each - math.sqrt(16.09 - 0.25)), rel=0.02)


@pytest.mark.parametrize("turns", [0.5, 1.0, 2.5])
def test_turning_about_a_post_is_its_angle(turns):
    """The capstan: e^(mu theta), theta what lies around the post."""
    model = GeodesicTether(POST.field(), 0.05)
    tether = model.start((-2, 0, 0), (-2, 0.02, 0))
    path = ring(turns, 2.0, steps=200)
    tether = model.refine(model.drive(tether, path)[0])
    tangent = 2 * math.acos(0.5 / 2)
    assert turning(tether, 0.05) == pytest.approx(2 * math.pi * turns - tangent, abs=0.02)


def test_the_robot_feels_the_tension_and_half_of_the_drag_on_the_last_span():
    tether = GeodesicTether(POST.field(), 0.1).start((-2, 0, 0), (-2, 3, 0))
    load = load_of((0.3, 0, 0), tension=15.0)
    force = pull_on_robot(tether, load, 0.3, np.zeros(3), 0.1)
    assert force == pytest.approx([0.5 * load.drag * 3 * 0.09, -15.0, 0.0])


def towed(chord, length, tension, flow, nodes=20):
    """Tensions along a neutrally buoyant line that MoorDyn tows through still water."""
    moordyn = pytest.importorskip("moordyn", reason="moordyn (extra test) is not installed")
    stiff = 1e4
    mass = 1025.0 * math.pi / 4 * DIAMETER**2
    lines = [
        "---", "netsp", "--- LINE TYPES ---",
        "TypeName Diam Mass/m EA BA/-zeta EI Cd Ca CdAx CaAx", "- - - - - - - - - -",
        f"rope {DIAMETER} {mass} {stiff} -0.1 0 {DRAG} 0 0 0",
        "--- POINTS ---", "ID Type X Y Z Mass Volume CdA Ca", "- - - - - - - - -",
        "1 Coupled 0 0 -50 0 0 0 0", f"2 Coupled {chord} 0 -50 0 0 0 0",
        "--- LINES ---", "ID LineType AttachA AttachB UnstrLen NumSegs LineOutputs",
        "- - - - - - -", f"1 rope 1 2 {length / (1 + tension / stiff)} {nodes} -",
        "--- OPTIONS ---", "0 writeLog", "2e-4 dtM", "100 WtrDpth", "1025 rho", "0.5 dtIC",
        "0.1 TmaxIC", "--- OUTPUTS ---", "--- END ---", "",
    ]  # fmt: skip
    return moordyn, "\n".join(lines), -np.array(flow)


@pytest.mark.parametrize(
    ("speed", "degrees"), [(0.3, 90), (0.5, 90), (0.8, 90), (0.5, 60), (0.5, 30)]
)
def test_spans_in_a_current_are_as_long_as_in_moordyn(speed, degrees, tmp_path, capfd):
    """MoorDyn's tension in a line of our length, put back into our formula, gives the excess of
    that line within 5 %: from 0.4 to 42 % of the chord."""
    chord, tension = 10.0, 10.0
    flow = (speed * math.cos(math.radians(degrees)), speed * math.sin(math.radians(degrees)), 0.0)
    load = load_of(flow, tension)
    length = payout_along([(0, 0, 0), (chord, 0, 0)], load)
    moordyn, text, velocity = towed(chord, length, tension, flow)
    (tmp_path / "span.txt").write_text(text)
    system = moordyn.Create(str(tmp_path / "span.txt"))
    ends, both = np.array([0, 0, -50, chord, 0, -50.0]), np.tile(velocity, 2)
    moordyn.Init(system, list(ends), list(both))
    for k in range(150):
        moordyn.Step(system, list(ends + 0.1 * k * both), list(both), 0.1 * k, 0.1)
    line = moordyn.GetLine(system, 1)
    found = np.mean([np.linalg.norm(moordyn.GetLineNodeTen(line, k)) for k in range(1, 20)])
    moordyn.Close(system)
    capfd.readouterr()
    again = payout_along([(0, 0, 0), (chord, 0, 0)], load._replace(tension=float(found)))
    assert again - chord == pytest.approx(length - chord, rel=0.05)


def fly(planner, physics, length, turns=2, **more):
    mission = Mission(
        scene="-", anchor=(-2, 0, 0), start=(-2, 0.5, 0), waypoints=ring(turns),
        tether_length=length, clearance=0.2, delta=0.1, tether=physics, **more,
    )  # fmt: skip
    return simulate(mission, planner, scene=POST)


@settings(deadline=None, max_examples=15)
@given(
    slack=st.floats(0, 0.2), speed=st.floats(0, 0.8), tension=st.floats(5, 40),
    length=st.floats(4.5, 7),
)  # fmt: skip
def test_predictive_never_needs_more_tether_than_there_is(slack, speed, tension, length):
    physics = TetherPhysics(slack=slack, diameter=DIAMETER, tension=tension)
    run = fly("predictive", physics, length, turns=1.2, current=(0.0, 0.0, speed))
    assert run.summary["longest_payout"] <= length
    assert run.summary["exceedance_s"] == 0.0
    assert run.summary["home"]["tether_free"]


def test_without_regard_for_slack_the_same_mission_would_need_more():
    """What the law above guards against: as taut as the tether may be without slack, it is too
    long with it."""
    taut = fly("predictive", TetherPhysics(), 5.0)
    loose = fly("predictive", TetherPhysics(slack=0.1), 5.0)
    assert 1.1 * taut.summary["longest_tether"] > 5.0
    assert loose.summary["longest_payout"] <= 5.0
    assert loose.summary["visited"] == taut.summary["visited"]


def test_predictive_keeps_the_tension_ratio_within_its_limit():
    """Two turns about a post at mu 0.3 multiply the tension by 20; the planner unwinds before."""
    free = fly("predictive", TetherPhysics(friction=0.3), 20.0)
    held = fly("predictive", TetherPhysics(friction=0.3, max_tension_ratio=3.0), 20.0)
    assert free.summary["friction"]["most_tension_ratio"] > 10.0
    assert held.summary["friction"]["most_tension_ratio"] <= 3.0
    assert held.summary["friction"]["over_s"] == 0.0
    assert held.summary["visited"] == free.summary["visited"] == 32
    assert held.summary["path"] > free.summary["path"]


def test_stops_tell_tether_turning_and_tension_ratio():
    run = fly("predictive", TetherPhysics(friction=0.2), 20.0, turns=1)
    stops = run.summary["stops"]
    assert [s["waypoint"] for s in stops] == list(range(16))
    last = stops[-1]
    assert last["tension_ratio"] == pytest.approx(math.exp(0.2 * math.radians(last["turning_deg"])))
    assert last["turning_deg"] > stops[8]["turning_deg"] > 0.0


def test_a_vehicle_with_dynamics_holds_its_course_against_the_tethers_pull():
    there = {
        "scene": "-", "anchor": (-2, 0, 0), "start": (-2, 0.5, 0), "waypoints": [(-2, 3, 0)],
        "tether_length": 8.0,
    }  # fmt: skip
    pulled = TetherPhysics(diameter=DIAMETER, tension=25.0, pulls_vehicle=True)
    free, held = (
        simulate(Mission(**there, tether=t), scene=POST, vehicle="bluerov2")
        for t in (TetherPhysics(), pulled)
    )
    assert free.summary["visited"] == held.summary["visited"] == 1
    assert held.summary["home"]["tether_free"]
    assert held.summary["inspection_s"] != free.summary["inspection_s"]


@pytest.mark.parametrize(
    ("physics", "message"),
    [
        ({"slack": -0.1}, "slack"),
        ({"slack": 3}, "slack"),
        ({"tension": 0}, "tension"),
        ({"max_tension_ratio": 1.0}, "max_tension_ratio"),
        ({"friction": "high"}, "friction"),
        ({"mu": 0.3}, "mu"),
    ],
)
def test_bad_physics_is_told_in_one_line(physics, message):
    with pytest.raises(InputError, match=message):
        TetherPhysics(**physics)


def test_an_absurd_current_is_refused_before_the_run():
    with pytest.raises(InputError, match="current: 15 m/s pulls on"):
        fly("predictive", TetherPhysics(diameter=DIAMETER), 8.0, current=(15, 0, 0))
    with pytest.raises(InputError, match="current, gusts: water of 300 m/s; expected at most 20"):
        fly("none", TetherPhysics(), 8.0, current=(300, 0, 0))


def test_where_no_waypoint_is_in_reach_the_robot_is_home_without_a_defect():
    run = fly("predictive", TetherPhysics(slack=1.0), 1.2)
    assert run.summary["visited"] == run.summary["defects"] == 0
    assert run.summary["home"]["tether_free"]


def test_waypoints_close_together_are_flown_under_load_without_a_defect():
    """Steps shorter than those of the look-ahead."""
    points = [(-2 + 0.01 * k, 0.7, 0) for k in range(8)]
    mission = Mission(
        scene="-", anchor=(-2, 0, 0), start=(-2, 0.5, 0), waypoints=points, tether_length=6.0,
        reach=0.002, tether=TetherPhysics(slack=0.1),
    )  # fmt: skip
    run = simulate(mission, scene=POST)
    assert run.summary["defects"] == 0
    assert run.summary["visited"] == 8


@given(angle=st.floats(0, 2 * math.pi), gust=st.floats(0, 2 * math.pi))
@settings(deadline=None)
def test_a_plan_allows_for_gusts_from_any_side(angle, gust):
    """Of every direction: a span along the current, too, sags no more in a gust than planned."""
    steady, strength = np.array([0.3, 0.0, 0.0]), 0.15
    planned = load_of(steady)._replace(gusts=strength)
    met = load_of(steady + strength * np.array([math.cos(gust), math.sin(gust), 0.0]))
    line = [(0, 0, 0), (8 * math.cos(angle), 8 * math.sin(angle), 0)]
    assert payout_along(line, met) <= payout_along(line, planned) * (1 + 1e-12)
