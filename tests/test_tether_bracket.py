"""The bracket of a tether holds what hangs, and is the taut length where nothing does."""

import math

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError
from netsp.base.geometry import polylines
from netsp.plan.space.run_bracket import bracket_run
from netsp.world import GeodesicTether, Scene
from netsp.world.mission.mission import Mission
from netsp.world.mission.mission_tether import mission_tether
from netsp.world.simulator.mission_run import simulate
from netsp.world.tether.tether_bracket import (
    BracketPolicy,
    HangingTether,
    HoldingTether,
    held_tethers,
    taut_length,
)
from netsp.world.tether.tether_policy import TetherPolicy

BAR = {"capsule": {"a": [-3, 0, 0], "b": [0, 0, 0], "radius": 0.2}}
ANCHOR = (-0.3, -1.5, -1.0)
OVER_THE_BAR = [ANCHOR, (-1.5, -1.5, 1.5), (-1.5, 1.5, 1.5), (-0.3, 1.5, -1)]
"""Path over a bar that ends at the origin, and down behind it."""


def along_the_bar(until, step=0.05):
    """A path from behind the bar to beyond its free end."""
    return np.array([(x, 1.5, -1.0) for x in np.arange(-0.3 + step, until, step)])


def holding(*solids, friction=0.4, delta=0.05):
    return HoldingTether(
        Scene(solids=solids).field(), delta, bracket=BracketPolicy(hold_friction=friction)
    )


def test_off_the_end_of_a_bar_the_tether_may_hang_on_and_may_have_slipped_before():
    model = holding(BAR)
    path = along_the_bar(1.5)
    tether = model.lay(OVER_THE_BAR)
    found = model.along(tether, path)
    straight = np.linalg.norm(path - np.array(ANCHOR), axis=1)
    slip = int(np.diff(found.taut).argmin()) + 1
    # the shorter curve is straight, and was there before the slip
    assert found.taut[slip:] == pytest.approx(straight[slip:], abs=1e-3)
    assert found.lower == pytest.approx(straight, abs=1e-3)
    # the longer one hangs on for a while, growing no faster than the robot moves, and ends
    held = found.upper > found.taut + 0.1
    assert held[slip]
    assert not held[-1]
    assert (np.diff(found.upper[: slip + 3]) <= 0.05 + 1e-6).all()
    assert found.upper[-1] == pytest.approx(straight[-1], abs=1e-3)


def test_more_friction_holds_longer():
    ends = []
    for friction in (0.05, 0.2, 0.6):
        model = holding(BAR, friction=friction)
        found = model.along(model.lay(OVER_THE_BAR), along_the_bar(1.8))
        ends.append(int(np.flatnonzero(found.upper > found.taut + 0.1)[-1]))
    assert ends == sorted(ends)
    assert ends[0] < ends[-1]


@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_bracket_holds_the_taut_length_among_random_bars(seed):
    rng = np.random.default_rng(seed)
    bars = [
        {"capsule": {"a": list(a), "b": list(a + rng.uniform(-2, 2, 3)), "radius": 0.2}}
        for a in rng.uniform(-1.5, 1.5, (3, 3))
    ]
    model = holding(*bars, delta=0.1)
    path, here = [], np.array((4.0, 4.0, 4.0))
    while len(path) < 60:
        there = here + rng.normal(size=3) * 0.4
        if np.abs(there).max() < 4.5 and model.field.line_of_sight(here, there):
            path.append(there)
            here = there
    start = model.start((4, 4, 4), (4, 4, 4))
    found = model.along(start, path, stops=[30, 59])
    assert (found.lower <= found.taut + 1e-9).all()
    assert (found.taut <= found.upper + 1e-9).all()
    # no curve is shorter than the straight one
    assert (found.lower >= np.linalg.norm(np.array(path) - 4.0, axis=1) - 1e-6).all()


def plan_turning(nodes):
    """The sum of the angles by which a tether turns, seen from above."""
    steps = np.diff(nodes[:, :2], axis=0)
    steps = steps[np.linalg.norm(steps, axis=1) > 1e-9]
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.abs(np.diff(headings)).sum())


@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 10_000), friction=st.floats(0.1, 0.5))
def test_among_upright_posts_friction_adds_no_more_than_it_can_turn_the_tether(seed, friction):
    """Seen unrolled, friction turns the tether by at most the friction times its turning."""
    rng = np.random.default_rng(seed)
    posts = [{"post": {"center": list(c), "radius": 0.3}} for c in rng.uniform(-3, 3, (6, 2))]
    model = holding(*posts, friction=friction, delta=0.1)
    path, here = [], np.array((4.0, 4.0, 0.0))
    while len(path) < 30:
        there = here + rng.normal(size=3) * 0.4
        if np.abs(there).max() < 4.5 and model.field.line_of_sight(here, there):
            path.append(there)
            here = there
    tether = model.start((4, 4, 0), (4, 4, 0))
    for point in path:
        tether = model.update(tether, point)
        taut = taut_length(tether)
        assert tether.length >= taut
        angle = 0.5 * friction * plan_turning(tether.nodes)
        if angle < 1.2:
            assert tether.length <= taut / math.cos(angle) + 2e-3
    # where nothing rises or sinks, friction holds nothing
    level = np.array(path) * (1.0, 1.0, 0.0)
    found = model.along(model.start((4, 4, 0), (4, 4, 0)), level)
    assert found.upper == pytest.approx(found.lower, rel=1e-3, abs=1e-3)


def sideways_share(contact, before, after):
    """The pull along x at a contact on an edge along x, as a share of what presses across it."""
    u, w = contact - before, after - contact
    pull = w / np.linalg.norm(w) - u / np.linalg.norm(u)
    return pull[0] / math.hypot(pull[1], pull[2])


EDGE = {"box": {"center": [0, 0, -5], "size": [40, 2, 10]}}


def held_on_an_edge(friction, delta=0.05):
    """A tether over an edge whose end has turned about its contact, until friction holds no more.

    No tether passes over the contact before it slides.
    """
    field = Scene(solids=[EDGE]).field()
    model = GeodesicTether(field, delta, policy=TetherPolicy(hold_friction=friction))
    tether = model.lay([(0, -2, 1.5), (0, 2, 1.5), (0, 2, -1.5)])
    for _ in range(30):
        (contact,) = tether.nodes[1:-1]
        span = tether.robot - contact
        ahead = np.array((np.linalg.norm(span), 0.0, 0.0))
        tether = model.update(tether, contact + math.cos(0.04) * span + math.sin(0.04) * ahead)
    return model, tether


@given(friction=st.floats(0.15, 0.4))
@settings(max_examples=4, deadline=None)
def test_friction_holds_a_tether_on_an_edge_up_to_its_cone(friction):
    _, tether = held_on_an_edge(friction)
    (contact,) = tether.nodes[1:-1]
    assert contact[0] > 0.0
    share = sideways_share(contact, tether.anchor, tether.robot)
    # tether passes over a contact that slides, which takes a part of the friction
    assert 0.7 * friction < share < friction + 0.03


@given(friction=st.floats(0.15, 0.4))
@settings(max_examples=4, deadline=None)
def test_a_contact_creeps_while_tether_passes_over_it(friction):
    """It moves sideways by the share of friction that holds it, per metre that passes."""
    model, tether = held_on_an_edge(friction)
    (contact,) = tether.nodes[1:-1]
    out = (tether.robot - contact) / np.linalg.norm(tether.robot - contact)
    robot, expected = tether.robot.copy(), contact.copy()
    for _ in range(100):
        robot = robot + 0.01 * out
        tether = model.update(tether, robot)
        expected[0] += 0.01 * sideways_share(expected, tether.anchor, robot) / friction
    (found,) = tether.nodes[1:-1]
    assert expected[0] - contact[0] > 0.05
    assert found[0] - contact[0] == pytest.approx(expected[0] - contact[0], rel=0.1)


HULL = [
    {"box": {"center": [0, 0, -1], "size": [16, 4, 2]}},
    {"box": {"center": [-8.6, 0, -1.9], "size": [0.9, 0.2, 1.8]}},
]
"""A hull, and its rudder, which ends 2.8 m below the surface."""


def test_a_tether_around_a_rudder_may_hang_by_a_centimetre():
    """The hook is a shortest curve; a tether that is refined at a coarser resolution loses it."""
    anchor, robot = np.array((10, -5, -0.5)), np.array((-6.9082, -1.1679, -3.0033))

    def corners(v):
        x, *z = v
        rudder = [(-8.15, 0.1, z[0]), (-9.05, 0.1, z[1]), (-9.05, -0.1, z[2])]
        return np.array([anchor, (x, -2.0, -2.0), *rudder, robot])

    def length(v):
        return np.linalg.norm(np.diff(corners(v), axis=0), axis=1).sum()

    best = scipy.optimize.minimize(length, (-1.0, -2.6, -2.7, -2.7), tol=1e-10)
    above_end = best.x[1:].min() + 2.8
    assert 0.005 < above_end < 0.02
    field = Scene(solids=HULL).field()
    model = GeodesicTether(field, 0.025)
    around = [(-1, -2.3, -2.3), (-8.1, 0.3, -2.6), (-9.3, 0.3, -2.65), (-9.3, -0.3, -2.7), robot]
    path = polylines.dense(np.vstack([anchor, around]), 0.05)
    fine = model.drive(model.start(anchor, anchor), path)[0]
    assert fine.length == pytest.approx(best.fun, abs=2e-3)
    found = HoldingTether(field, 0.1).along(fine, [robot], stops=[0])
    assert found.upper[0] == pytest.approx(best.fun, abs=0.01)
    assert found.lower[0] == pytest.approx(np.linalg.norm(robot - anchor), abs=0.01)


def test_updates_hold_as_drives_do():
    model = holding(BAR)
    tether = model.lay(OVER_THE_BAR)
    path = along_the_bar(0.55)
    driven, lengths = model.drive(tether, path)
    single = []
    for point in path:
        tether = model.update(tether, point)
        single.append(tether.length)
    assert single == pytest.approx(lengths, abs=1e-3)
    assert isinstance(tether, HangingTether)
    assert isinstance(driven, HangingTether)
    assert taut_length(tether) == pytest.approx(taut_length(driven), abs=1e-3)
    assert max(h.length for h in held_tethers(tether)) == tether.length
    # at rest it still hangs; taken to where friction holds no more, it is the taut one
    assert model.refine(tether).length > 1.1 * taut_length(tether)
    gone, _ = model.drive(tether, along_the_bar(1.8)[len(path) :])
    assert not held_tethers(gone)


def bar_mission(friction, tether_length):
    return Mission(
        scene="-", anchor=ANCHOR, start=ANCHOR, tether_length=tether_length, clearance=0.3,
        waypoints=[*OVER_THE_BAR[1:], (0.5, 1.5, -1), (1.6, 1.5, -1)],
        tether={"friction": friction}, reach=0.01,
    )  # fmt: skip


def test_a_mission_with_friction_counts_the_tether_that_holds():
    scene = Scene(solids=[BAR])
    field = scene.field()
    slides, holds = bar_mission(0.0, 20.0), bar_mission(0.3, 20.0)
    assert type(mission_tether(slides, field)) is GeodesicTether
    free = simulate(slides, "none", scene=scene)
    held = simulate(holds, "none", scene=scene)
    assert free.summary["longest_payout"] == free.summary["longest_tether"]
    at = {s["waypoint"]: s for s in held.summary["stops"]}
    assert at[3]["payout"] > 1.2 * at[3]["tether"]
    assert at[4]["payout"] == pytest.approx(at[4]["tether"], rel=1e-6)
    bracket = bracket_run(free, scene, field)
    hanging = {s["waypoint"]: s for s in bracket["stops"]}
    assert hanging[3]["at_least"] <= hanging[3]["tether"] < 0.9 * hanging[3]["at_most"]
    assert 4 not in hanging
    assert bracket["over_s"] == 0.0


def test_policies_refuse_negative_numbers():
    with pytest.raises(InputError, match="hold_friction"):
        BracketPolicy(hold_friction=-0.1)
