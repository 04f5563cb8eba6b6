"""A guard beside a vehicle: which class, how long, what it leads to, and what it does not know."""

import contextlib
import copy
import csv
import functools
import gzip
import http.client
import itertools
import json
import math
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from netsp import Circle, Polygon, Problem
from netsp.base.errors import InputError
from netsp.command.main import main
from netsp.hsignature import concatenate, crossings, signature
from netsp.model.problem import Origin
from netsp.model.solution import Solution
from netsp.online.guard.alarms import Alarm, Alarms, Level
from netsp.online.guard.belief import Belief
from netsp.online.guard.guard_page import Page
from netsp.online.guard.guard_policy import GuardPolicy
from netsp.online.guard.live import watch
from netsp.online.guard.lookahead import Lookahead, LookaheadResult
from netsp.online.guard.loops import loop_closed_by, loops_in
from netsp.online.guard.plane import PlaneSite
from netsp.online.guard.position_track import Motion, Track
from netsp.online.guard.reasons import Situation, loop_ahead
from netsp.online.guard.replay import read_fixes
from netsp.online.guard.site import Loop
from netsp.online.guard.state_file import restore, save
from netsp.online.guard.stream import replay_fixes
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_belief import Strands
from netsp.online.guard.tether_guard import Guard, GuardOptions
from netsp.online.link.geo_frame import Frame
from netsp.online.link.modes import Mode
from netsp.roadmap.plane_world import PlaneWorld, RayLetters
from tests.autopilot import Autopilot

RECORDED = Path(__file__).parent / "data" / "ardusub"
PROBLEMS = Path(__file__).parent.parent / "problems"
SITE = Problem(
    base=(0, 0), goals=[(9, 0, -1)], tether_length=20,
    obstacles=[
        Circle(center=(5, 0), radius=0.5, name="A"), Circle(center=(9, 4), radius=0.5, name="B")
    ],
)  # fmt: skip
EXACT = GuardOptions(noise=0.0, drift=0.0)


def along(*corners, speed=0.5, begin=0.0):
    """Fixes of a robot that goes from corner to corner, ten a second."""
    t, out = begin, []
    for a, b in itertools.pairwise(corners):
        a, b = np.array(a, dtype=float), np.array(b, dtype=float)
        n = max(1, round(float(np.linalg.norm(b - a)) / speed * 10))
        for k in range(n):
            x, y, z = a + (b - a) * k / n
            out.append(Fix(t, (float(x), float(y), float(z)), estimate=True))
            t += 0.1
    return out


def ring(center, radius, begin, turn, steps=60):
    return [
        (center[0] + radius * math.cos(begin + turn * k / steps),
         center[1] + radius * math.sin(begin + turn * k / steps), 0.0)
        for k in range(steps + 1)
    ]  # fmt: skip


ROUND_A = [(0, 0, 0), (3, 0.9, 0), *ring((5, 0), 1.5, math.pi - 0.6, -2.0 * math.pi)]


# the recorded flights


def every_other(fixes):
    """Five a second say as much of where a robot went as ten do."""
    return itertools.islice(fixes, 0, None, 2)


@pytest.mark.parametrize(
    ("name", "goals", "longest"),
    [("wharf", 8, 19.25), ("pool", 5, 11.66), ("oc4-jacket", 9, 24.52), ("r1", 6, None),
     ("r4", 6, None)],
)  # fmt: skip
def test_recorded_flights_have_the_words_of_their_tours_at_every_goal(name, goals, longest):
    own = RECORDED / f"problem-{name}.json"
    problem = Problem.load(own if own.exists() else PROBLEMS / f"{name}.json")
    tour = Solution.load(RECORDED / f"tour-{name}.json")
    guard = Guard(problem, GuardOptions(noise=0.02, drift=0.01))
    nearest, most = {}, 0.0
    file = RECORDED / f"ardusub-{name}.csv.gz"
    for report in replay_fixes(guard, every_other(read_fixes(file, Frame(problem)))):
        now = report.classes[0]
        most = max(most, now.taut)
        for visit in tour.tour:
            goal = np.array(problem.goals[visit.goal].position)
            far = float(np.linalg.norm(np.array(report.position) - goal))
            if far < nearest.get(visit.goal, (9.0, None))[0]:
                step = np.array([report.position, goal])
                word = concatenate(now.word, crossings(step, problem.representative_points))
                nearest[visit.goal] = (far, word == visit.signature)
        assert not report.loops
    assert len(nearest) == goals
    assert all(right for _, right in nearest.values())
    assert report.classes[0].word == ()
    if longest is not None:
        assert abs(most - longest) <= 0.1


def test_the_likeliest_class_is_right_under_noise_and_drift_on_a_recorded_flight():
    problem = Problem.load(RECORDED / "problem-r4.json")
    rng = np.random.default_rng(1)
    with gzip.open(RECORDED / "ardusub-r4.csv.gz", "rt") as text:
        rows = list(csv.DictReader(text))[::4]
    guard, exact = Guard(problem), Guard(problem, GuardOptions(0.02, 0.01))
    drift, right, held = np.zeros(2), 0, 0
    for r in rows:
        drift = 0.992 * drift + 0.5 * math.sqrt(1 - 0.992**2) * rng.normal(size=2)
        x, y, z = (float(r[k]) for k in "xyz")
        noisy = (x + drift[0] + 0.3 * rng.normal(), y + drift[1] + 0.3 * rng.normal(), z)
        report = guard.update(Fix(float(r["t"]), noisy, estimate=True))
        true = exact.update(Fix(float(r["t"]), (x, y, z), estimate=True)).classes[0]
        end = np.array([report.position, (x, y, z)])
        back = crossings(end, problem.representative_points)
        words = [concatenate(c.word, back) for c in report.classes]
        right += words[0] == true.word
        held += true.word in words
    assert right > 0.9 * len(rows)
    assert held > 0.95 * len(rows)


# loops


def test_a_loop_is_foreseen_then_closed_then_undone():
    guard, seen = Guard(SITE, EXACT), []
    for fix in along(*ROUND_A):
        report = guard.update(fix)
        seen += [(a.kind, a.level, report.time) for a in report.raised if "loop" in a.kind]
    kinds = [kind for kind, _, _ in seen]
    assert "loop" in kinds
    assert kinds.index("loop-ahead") < kinds.index("loop")
    warning = next(t for kind, level, t in seen if (kind, level) == ("loop-ahead", Level.WARNING))
    closed = next(t for kind, _, t in seen if kind == "loop")
    assert closed - warning >= 10.0
    text = guard.alarms.active["loop"].text
    assert "a loop around A is closed" in text
    assert "to undo it go back" in text
    back = along(*ROUND_A[::-1], begin=report.time + 0.1)
    for fix in back:
        report = guard.update(fix)
    for k in range(60):
        place = (1e-4 * (k % 7), 0.0, 0.0)
        report = guard.update(Fix(back[-1].time + 0.1 * (k + 1), place, estimate=True))
    assert report.loops == ()
    assert "loop" not in guard.alarms.active
    assert report.classes[0].word == ()


def test_passing_by_and_coming_back_the_same_way_raises_nothing():
    guard = Guard(SITE, EXACT)
    way = [(0, 0, 0), (5, 2, 0), (9, 0, 0), (5, 2, 0), (0, 0, 0)]
    for fix in along(*way):
        report = guard.update(fix)
        assert not any("loop" in a.kind and a.level >= Level.WARNING for a in report.raised)
    assert report.classes[0].word == ()


def test_going_straight_home_past_the_other_side_of_a_pile_closes_a_loop():
    strands = Strands(PlaneSite(SITE))
    tether = strands.site.model.start((0, 0, 0), (0, 0, 0))
    for corner in ((5, 2, 0), (8, 0, 0), (6, -2, 0)):
        tether = strands.site.model.update(tether, corner)
    assert loops_in(SITE, tether.nodes[:, :2]) == []
    found = loop_closed_by(SITE, tether.nodes[:, :2], np.array([(6, -2), (-0.5, 0.3)]))
    assert found is not None
    assert found.around == (0,)


def meets_itself(line):
    """Whether segments that do not follow one another touch: ends that are one do, too."""
    segments = [shapely.LineString(pair) for pair in itertools.pairwise(line)]
    return any(
        a.distance(b) < 1e-9 for k, a in enumerate(segments) for b in segments[k + 2 :]
    )  # fmt: skip


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-3, 13), st.floats(-4, 8)), min_size=1, max_size=7))
@example([(0.0, -2.0), (7.0, 0.0), (0.0, 2.0), (0.0, 0.0)])
def test_a_taut_tether_has_no_loop_where_its_plan_does_not_cross_itself(places):
    strands = Strands(PlaneSite(SITE))
    tether = strands.site.model.start((0, 0, 0), (0, 0, 0))
    for x, y in places:
        there = np.array([x, y, 0.0])
        if strands.site.field.line_of_sight(tether.robot, there, 0.0):
            tether = strands.site.model.update(tether, there)
    line = tether.nodes[:, :2]
    loops = loops_in(SITE, line)
    assert not loops or meets_itself(line)
    # what it is around is in its word
    letters = {abs(a) - 1 for a in signature(line, SITE.representative_points)}
    assert all(letters & set(loop.around) for loop in loops)


GRID = st.tuples(st.integers(3, 11), st.integers(-3, 6))


@given(st.lists(st.one_of(GRID, st.tuples(st.floats(3, 11), st.floats(-3, 6))), max_size=9))
@example([(3, 0), (3.0, 2.2e-311), (3, 1), (4, 0)])
def test_a_line_has_a_loop_exactly_if_one_of_its_steps_closes_one(corners):
    line = np.array(corners, dtype=float).reshape(-1, 2)
    closing = [loop_closed_by(SITE, line[: j + 1], line[j : j + 2]) for j in range(len(line) - 1)]
    around = {loop.around for loop in loops_in(SITE, line)}
    assert bool(around) == any(closing)
    assert {loop.around for loop in closing if loop} <= around


# what is not known


def test_a_pile_within_the_error_leaves_two_classes_and_one_far_off_leaves_one():
    near, far = Guard(SITE), Guard(SITE)
    for fix in along((0, 0, 0), (5, 0.6, 0), (9, 0, 0)):
        close = near.update(fix)
    for fix in along((0, 0, 0), (2, 3, 0), (6, 3.4, 0), (7, 1.5, 0)):
        away = far.update(fix)
    assert {c.word for c in close.classes} >= {(), (1,)}
    assert "class" in near.alarms.active
    assert close.classes[0].word == (1,)
    assert len(away.classes) == 1


def test_the_operator_knows_better():
    guard = Guard(SITE)
    for fix in along((0, 0, 0), (5, 0.6, 0), (9, 0, 0)):
        guard.update(fix)
    report = guard.correct("south", "A")
    report = guard.update(Fix(report.time + 0.1, (9.0, 0.0, 0.0), estimate=True))
    assert [c.word for c in report.classes] == [()]
    report = guard.correct("north", "A")
    report = guard.update(Fix(report.time + 0.1, (9.0, 0.0, 0.0), estimate=True))
    assert report.classes[0].word == (1,)
    for side in ("up", ["north"]):
        with pytest.raises(InputError, match="side"):
            guard.correct(side, "A")
    for obstacle in ("C", 2, -1, True, None, 0.5):
        with pytest.raises(InputError, match="obstacle"):
            guard.correct("north", obstacle)


NORTH_OF_A = [(0, 0, 0), (4.2, 0.3, 0), (5, 1.2, 0), (7, 1.2, 0), (9, 0, 0)]


@pytest.mark.parametrize("at", [52, 54, 57])
def test_a_correction_leaves_the_classes_that_agree_where_they_are(at):
    """Here the robot is on one side of the obstacle's ray in one class, on the other in another."""
    guard = Guard(SITE)
    for k, fix in enumerate(every_other(along(*NORTH_OF_A))):
        guard.update(fix)
        if k == at:
            passes_north = functools.partial(guard.site.passes_on_side, side="north", obstacle="A")
            agree = {s.word for s in guard.strands.all if passes_north(s.tether.nodes)}
            report = guard.correct("north", "A")
            assert {c.word for c in report.classes} == agree
    report = guard.report
    assert report.classes[0].word == (1,)
    assert report.classes[0].likely > 0.9
    assert not report.loops


def test_a_state_file_has_the_classes_at_one_place(tmp_path):
    guard, again = Guard(SITE), Guard(SITE)
    fixes = list(every_other(along(*NORTH_OF_A)))
    for fix in fixes[:58]:
        guard.update(fix)
    assert len(guard.strands.all) > 1
    save(guard, tmp_path / "state.json")
    restore(again, tmp_path / "state.json")
    for fix in fixes[58:]:
        report = again.update(fix)
    assert report.classes[0].word == (1,)
    assert report.classes[0].likely > 0.9


def test_what_the_operator_says_of_one_obstacle_changes_nothing_about_others():
    guard = Guard(SITE, EXACT)
    for fix in along((0, 0, 0), (4.5, 1, 0), (7, 1, 0), (7, 0, 0)):
        guard.update(fix)
    assert [c.word for c in guard.correct("south", "A").classes] == [()]


def test_what_was_ahead_in_another_class_is_forgotten_at_once():
    guard = Guard(SITE, EXACT)
    guard.begin_with({(): 0.0, (1,): 0.0}, np.zeros(3), 0.0)
    told = 0
    for k, fix in enumerate(along(*ROUND_A)):
        guard.update(fix)
        if k % 7 == 0:
            watching = copy.deepcopy(guard)
            with contextlib.suppress(InputError):
                report = watching.correct("south", "A")
                afresh = Lookahead(
                    watching.site, watching.strands.all[0].tether, watching._motion, 0.05
                )
                afresh.advance(10_000)
                told += guard.report.loop_s is not None
                assert report.loop_s in (None, afresh.result.loop_s)
                assert report.loops or all(a.kind != "loop" for a in report.alarms)
    assert told > 0


@pytest.mark.parametrize("side", ["north", "south", "east", "west"])
def test_a_tether_that_begins_or_ends_on_a_ray_does_not_cross_it(side):
    """The obstacle is in line with the base."""
    site = Problem(base=(0, 0), goals=[(1, 8)], tether_length=20,
                   obstacles=[Circle(center=(0, 5), radius=0.5, name="A")])  # fmt: skip
    east = np.array([(0, 0), (0.5, 5), (1, 8)], dtype=float)
    over = np.array([(0, 0), (-0.5, 5), (0, 5.5), (1, 8)], dtype=float)
    away = np.array([(0, 0), (3, -2)], dtype=float)
    back = np.array([(0, 0), (0, 3), (0.5, 5), (0, 7)], dtype=float)
    assert PlaneWorld(site).passes_on_side(east, side, "A") == (side == "east")
    assert PlaneWorld(site).passes_on_side(over, side, "A") == (side in ("north", "west"))
    assert not PlaneWorld(site).passes_on_side(away, side, "A")
    assert PlaneWorld(site).passes_on_side(back, side, "A") == (side == "east")


def test_a_gap_leaves_every_class_that_the_robot_can_have_reached():
    short, long = Guard(SITE, EXACT), Guard(SITE, EXACT)
    for guard in (short, long):
        for fix in along((0, 0, 0), (3.8, 0.9, 0)):
            report = guard.update(fix)
    few = short.update(Fix(report.time + 3.0, (4.6, 1.2, 0.0), estimate=True))
    many = long.update(Fix(report.time + 25.0, (6.2, 0.9, 0.0), estimate=True))
    assert len(few.classes) == 1
    assert {c.word for c in many.classes} >= {(), (1,)}


def test_ways_are_those_no_longer_than_the_robot_can_have_gone():
    a, b = np.array([3.0, 0.0, 0.0]), np.array([7.0, 0.0, 0.0])
    assert {word for word, _ in PlaneWorld(SITE).paths_between(a, b, 4.6)} == {(), (1,)}
    lengths = [length for _, length in PlaneWorld(SITE).paths_between(a, b, 12.0)]
    assert lengths == sorted(lengths)
    assert len(PlaneWorld(SITE).paths_between(a, b, 12.0)) > 2


def test_long_gaps_and_places_beyond_any_tether_take_no_time_to_think_about():
    problem = Problem.load(PROBLEMS / "wharf.json")
    guard = Guard(problem)
    for fix in along((0, 0, 0), (3.8, 4.0, -1)):
        report = guard.update(fix)
    report = guard.update(Fix(report.time + 600.0, (12.0, 5.0, -1.0), estimate=True))
    assert len(report.classes) > 1
    report = guard.update(Fix(report.time + 0.1, (9e6, 9e6, 0.0), estimate=True))
    report = guard.update(Fix(report.time + 3.0, (9e6, 9e6, 0.0), estimate=True))
    assert not report.claims


def test_nothing_is_claimed_while_the_position_is_lost_and_it_is_said_when_it_comes_back():
    guard = Guard(SITE, EXACT)
    for fix in along((0, 0, 0), (3, 2, 0)):
        report = guard.update(fix)
    assert report.claims
    lost = guard.update(Fix(report.time + 1.0, (3.0, 2.0, 0.0), estimate=False))
    assert not lost.claims
    assert lost.classes == ()
    lost = guard.update(Fix(report.time + 3.0, (3.0, 2.0, 0.0)))
    assert any(a.kind == "estimate" and a.level == Level.ALARM for a in lost.alarms)
    back = guard.update(Fix(report.time + 4.0, (3.2, 2.1, 0.0), estimate=True))
    assert back.claims
    assert back.classes[0].word == ()


def test_silence_is_told_and_positions_frozen_to_the_last_digit_are_none():
    guard = Guard(SITE, EXACT)
    for fix in along((0, 0, 0), (4, 2, 0)):
        report = guard.update(fix)
    assert not guard.advance_to(report.time + 4.0).claims
    frozen = Guard(SITE, EXACT)
    for fix in along((0, 0, 0), (4, 2, 0)):
        report = frozen.update(fix)
    for k in range(1, 80):
        report = frozen.update(Fix(fix.time + 0.1 * k, fix.position, estimate=True))
    assert not report.claims


def test_a_jump_is_no_motion():
    track = Track(0.05, 0.5)
    for fix in along((0, 0, 0), (4, 0, 0)):
        motion = track.observe(fix)
    assert motion.lost_s == 0.0
    jumped = track.observe(Fix(fix.time + 0.1, (9.0, 5.0, 0.0), estimate=True))
    assert jumped.reason == "the position jumped"
    assert np.allclose(track.velocity, 0.0)


@given(st.integers(0, 10_000))
def test_a_belief_holds_the_class_of_a_robot_that_is_off_by_a_constant(seed):
    rng = np.random.default_rng(seed)
    offset = rng.uniform(-0.6, 0.6, 2)
    belief = Belief(RayLetters(SITE), 0.5, 0.1)
    here, word = np.zeros(2), ()
    for _ in range(12):
        there = here + rng.uniform(-1.5, 2.0, 2)
        steps = here + np.linspace(0, 1, 30)[1:, None] * (there - here)
        if min(float(o.signed_distance(p)) for o in SITE.obstacles for p in steps) < 0.0:
            continue
        for place in steps:
            belief.move(here - offset, place - offset, 0.1)
            word = concatenate(word, crossings(np.array([here, place]), SITE.representative_points))
            here = place
    ends = [
        concatenate(h.word, crossings(
            np.array([here - offset + h.offset, here]), SITE.representative_points))
        for h in belief.classes()
    ]  # fmt: skip
    assert word in ends


def test_a_robot_is_not_believed_inside_a_pile():
    belief = Belief(RayLetters(SITE), 0.5, 0.1)
    for k in range(60):
        belief.move(np.array([2.0 + 0.05 * k, 0.1]), np.array([2.05 + 0.05 * k, 0.1]), 0.1)
    for _ in range(80):  # it stays there
        belief.move(np.array([5.0, 0.1]), np.array([5.0, 0.1]), 0.1)
    for h in belief.classes():
        place = np.array([5.0, 0.1]) + h.offset
        assert float(SITE.obstacles[0].signed_distance(place)) > -0.15


def test_the_winch_rules_classes_out():
    guard = Guard(SITE)
    for fix in along((0, 0, 0), (5, 0.8, 0), (9, 0.6, 0), (9, -3, 0)):
        report = guard.update(fix)
    assert len(report.classes) > 1
    least = min(c.taut for c in report.classes)
    for k in range(3):
        report = guard.update(
            Fix(fix.time + 0.1 * (k + 1), (9.0, -3.0, 0.0), estimate=True, paid_out=least / 1.4)
        )
    assert len(report.classes) <= len(guard.strands.all)
    assert all(c.taut <= least + 2.5 for c in report.classes)


# alarms


def test_alarms_do_not_flicker():
    alarms = Alarms()
    reason = Alarm("loop-ahead", Level.WARNING, "because")
    assert all(a.level == Level.NOTICE for a in alarms.update(0.0, [reason]))
    (raised,) = alarms.update(0.6, [reason])
    assert raised.level == Level.WARNING
    for t in np.arange(0.7, 4.0, 0.1):
        assert alarms.update(float(t), [reason] if int(10 * t) % 2 else []) == []
    assert alarms.active
    alarms.update(9.0, [])
    assert not alarms.active


def test_a_loop_ahead_goes_once_it_is_closed_in_every_class():
    ahead = Alarm("loop-ahead", Level.WARNING, "in 1 s", around=(0,))
    closed = Alarm("loop", Level.ALARM, "closed", around=(0,))
    other = replace(closed, around=(0, 1))
    alarms = Alarms()
    alarms.update(0.0, [ahead])
    assert [a.kind for a in alarms.update(0.6, [ahead])] == ["loop-ahead"]
    assert [a.kind for a in alarms.update(0.7, [ahead, closed])] == ["loop"]
    alarms.update(1.1, [ahead, closed])  # in another class it is still ahead
    assert set(alarms.active) == {"loop-ahead", "loop"}
    alarms.update(1.2, [closed])  # the loop ahead is lowered after 4 s only
    assert set(alarms.active) == {"loop"}
    alarms.update(1.3, [ahead, other])
    assert set(alarms.active) == {"loop-ahead", "loop"}


# from one run to the next


def test_a_class_survives_a_restart_and_no_other_site_takes_it(tmp_path):
    guard = Guard(SITE, EXACT)
    for fix in along((0, 0, 0), (5, 2, 0), (9, 0, 0)):
        guard.update(fix)
    save(guard, tmp_path / "state.json")
    again = Guard(SITE, EXACT)
    assert restore(again, tmp_path / "state.json") is not None
    report = again.update(Fix(0.0, (9.0, 0.1, 0.0), estimate=True))
    assert report.classes[0].word == (1,)
    other = Guard(SITE.model_copy(update={"tether_length": 25.0}), EXACT)
    with pytest.raises(InputError, match="another site"):
        restore(other, tmp_path / "state.json")
    for text in ("{", '{"schema_version": 1}', "[]"):
        (tmp_path / "bad.json").write_text(text)
        with pytest.raises(InputError):
            restore(Guard(SITE, EXACT), tmp_path / "bad.json")


# the command, the link and the page


def test_a_replay_by_command_writes_lines_of_json(tmp_path, capsys):
    lines = tmp_path / "reports.jsonl"
    code = main([
        "guard", str(PROBLEMS / "pool.json"), "--replay", str(RECORDED / "ardusub-pool.csv.gz"),
        "--noise", "0.02", "--drift", "0.01", "-o", str(lines),
    ])  # fmt: skip
    assert code == 0
    rows = [json.loads(line) for line in lines.read_text().splitlines()]
    assert rows[-1]["classes"][0]["word"] == []
    assert max(r["classes"][0]["taut"] for r in rows) == pytest.approx(11.66, abs=0.1)
    assert "alarm" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.csv", "t,x\n1,2\n", "expected columns"),
        ("a.csv", "t,x,y,z\n1,2,none at all,3\n", "line 2: y"),
        ("a.csv", "t,x,y,z\n1,2,nan,3\n", "no positions"),
        ("a.csv", "t,x,y,z\n", "no positions"),
        ("a.csv", "t,x,y,z,armed\n1,2,3,4,perhaps\n", "armed"),
        ("a.csv.gz", "no gzip", "a.csv.gz"),
        ("a.tlog", "rubbish" * 50, "no positions"),
        ("a.xyz", "1", "ends in"),
    ],
)
def test_a_recording_that_is_none_is_told_in_a_line(tmp_path, capsys, name, text, says):
    (tmp_path / name).write_text(text)
    assert main(["guard", str(PROBLEMS / "pool.json"), "--replay", str(tmp_path / name)]) == 2
    err = capsys.readouterr().err.strip().splitlines()
    assert len(err) == 1
    assert says in err[0]


def test_a_telemetry_log_is_read_as_it_was_heard(tmp_path):
    import struct

    from netsp.online.link.dialect import dialect, parser

    m, packs = dialect(), parser(1, 1)
    data = b"\x00rest of something"
    for k in range(60):
        for message in (
            m.MAVLink_heartbeat_message(12, 3, 128, Mode.GUIDED, 4, 3),
            m.MAVLink_local_position_ned_message(100 * k, 0.02 * k, 0.15 * k, 1.0, 0, 0, 0),
            m.MAVLink_ekf_status_report_message(31, 0, 0, 0, 0, 0),
        ):
            data += struct.pack(">Q", 10**15 + k) + message.pack(packs)
    (tmp_path / "log.tlog").write_bytes(data)
    fixes = list(read_fixes(tmp_path / "log.tlog", Frame(SITE)))
    places = [f.position for f in fixes if f.position is not None]
    assert len(places) == 60
    assert places[-1] == pytest.approx((8.85, 1.18, -1.0))
    assert any(f.mode == "GUIDED" and f.armed for f in fixes)


def test_a_guard_beside_a_vehicle_hears_it_and_tells_it_nothing_to_do(tmp_path):
    guard, reports, ended = Guard(SITE), [], threading.Event()
    state = tmp_path / "state.json"
    with Autopilot(pace=8.0, noise=0.05, drift=0.1, smooth=1.0) as autopilot:
        work = threading.Thread(
            target=watch,
            args=(guard, Frame(SITE), f"udpin:{autopilot.port}", reports.append),
            kwargs={"system": 1, "state": str(state), "publish": True, "should_stop": ended.is_set},
        )
        work.start()
        assert autopilot.until(lambda: len(reports) > 40)
        ended.set()
        work.join(5.0)
        told = {e["event"] for e in autopilot.events}
    assert told <= {"started", "not understood"}
    assert reports[-1].claims
    assert reports[-1].classes[0].word == ()
    assert state.exists()


def test_a_guard_that_hears_another_vehicle_says_so():
    said, ended = [], threading.Event()
    with Autopilot(pace=8.0) as autopilot:
        work = threading.Thread(
            target=watch,
            args=(Guard(SITE), Frame(SITE), f"udpin:{autopilot.port}", lambda _: None),
            kwargs={"system": 2, "on_note": said.append, "should_stop": ended.is_set},
        )
        work.start()
        assert autopilot.until(lambda: "heard from system 1, but nothing from system 2 yet" in said)
        ended.set()
        work.join(5.0)
    assert len(said) == 2


def test_the_page_is_for_who_has_the_token_and_takes_corrections_only():
    with Page(SITE, 0) as page:

        def ask(path, method="GET", body=None, **headers):
            link = http.client.HTTPConnection("127.0.0.1", page.port, timeout=5)
            link.request(method, path, body, headers)
            answer = link.getresponse()
            told = answer.status, answer.read()
            link.close()
            return told

        assert ask("/")[0] == 404
        assert ask("/wrong/site")[0] == 404
        assert ask(f"/{page.token}/site", Host="evil.example")[0] == 404
        status, data = ask(f"/{page.token}/site")
        assert status == 200
        assert [o["name"] for o in json.loads(data)["obstacles"]] == ["A", "B"]
        for name in ("", "page.js", "page.css"):
            assert ask(f"/{page.token}/{name}")[0] == 200
        assert ask(f"/{page.token}/../pyproject.toml")[0] == 404
        assert json.loads(data)["sides"] == ["+y", "+x", "−y", "−x"]  # the words of alarms
        said = json.dumps({"side": "−y", "obstacle": "A"})
        assert ask(f"/{page.token}/correct", "POST", said)[0] == 200
        assert page.corrections.get_nowait() == ("−y", "A")
        assert ask(f"/{page.token}/correct", "POST", said, Origin="http://evil.example")[0] == 400
        for bad in (
            "",
            "[",
            "{}",
            '{"side": "up", "obstacle": "A"}',
            '{"side": [], "obstacle": 1}',
        ):
            assert ask(f"/{page.token}/correct", "POST", bad)[0] in (400, 404)
        assert ask(f"/{page.token}/event", "POST", "{}")[0] == 404


def test_a_correction_has_the_words_of_alarms():
    """A site with an origin has compass points, others axes; both are understood."""
    placed = SITE.model_copy(update={"origin": Origin(latitude=54.0, longitude=12.0)})
    assert PlaneWorld(placed).sides == ("north", "east", "south", "west")
    assert PlaneWorld(SITE).sides == ("+y", "+x", "−y", "−x")
    over = np.array([(0, 0), (5, 2), (9, 0)], dtype=float)
    for site in (SITE, placed):
        north = PlaneWorld(site).passes_on_side(over, "north", "A")
        assert north == PlaneWorld(site).passes_on_side(over, "+y", "A")
    with pytest.raises(InputError, match=r"expected one of \+y, \+x, −y, −x, got 'up'"):
        PlaneWorld(SITE).passes_on_side(over, "up", "A")


def test_a_guard_asks_for_a_link_or_a_recording(capsys):
    assert main(["guard", str(PROBLEMS / "pool.json")]) == 2
    assert "--link" in capsys.readouterr().err


# what is believed, and what is ahead


def test_a_class_that_is_too_long_takes_no_other_with_it():
    """Classes beyond those that have a tether of their own once went, too."""
    guard = Guard(SITE, GuardOptions(noise=0.1, drift=0.1), GuardPolicy(max_tethers=2))
    for fix in along((0, 0, 0), (3, 1, 0), (9, 0.5, 0)):
        report = guard.update(fix)
    guard.belief.begin({(1,): 0.0, (1,) * 6: 0.1, (): 2.0})
    for fix in along((9, 0.5, 0), (9.2, 0.5, 0), begin=report.time + 0.1):
        guard.update(fix)
    assert guard.belief.words == {(1,), ()}


def test_a_drift_that_nothing_tells_of_is_believed_as_it_was_at_first():
    """In open water exchanges of offsets change nothing: the walk of the drift has its own normal
    distribution for an equilibrium."""
    belief = Belief(RayLetters(SITE), 0.5, 0.1)
    first = belief._likely[()].copy()
    for k in range(200):
        there = np.array([-20.0 - 0.1 * k, -20.0, 0.0])
        assert belief.move(there, there - (0.1, 0.0, 0.0), 1.0)
    np.testing.assert_allclose(belief._likely[()], first, rtol=1e-9)


def test_a_drift_that_is_known_is_forgotten_in_its_time():
    belief = Belief(RayLetters(SITE), 0.5, 0.1)
    known = np.zeros(len(belief.offsets))
    known[np.argmax(belief.offsets[:, 0])] = 1.0
    belief._likely = {(): known}
    means = []
    for k in range(121):
        there = np.array([-20.0 - 0.1 * k, -20.0, 0.0])
        means.append(float(belief._likely[()] @ belief.offsets[:, 0]))
        belief.move(there, there - (0.1, 0.0, 0.0), 1.0)
    assert means[0] == belief.offsets[:, 0].max()
    assert np.all(np.diff(means) <= 1e-12)
    assert 0.0 < means[120] < 0.35 * means[0]


def test_one_that_grazes_a_pile_is_charged_for_how_deep_and_not_for_how_long():
    """Noise that puts a robot into a pile is the same at the next estimate."""
    costs = []
    for stay in (1, 100):
        belief = Belief(RayLetters(SITE), 0.3, 0.1)
        before = np.array([5.0, -1.0, 0.0])
        for after in [(5.0, -0.6, 0.0)] * stay:
            belief.move(before, np.array(after), 1e-3)
            before = np.array(after)
        inside = SITE.obstacles[0].signed_distance(before[:2] + belief.offsets) < 0.0
        total = sum(belief._likely.values())
        costs.append(float(total[inside].sum()) / float(belief._prior[inside].sum()))
    assert costs[0] == pytest.approx(costs[1], rel=1e-6)
    assert costs[0] < 0.8


@settings(max_examples=40, deadline=None)
@given(
    x=st.floats(-1.0, 3.0), course=st.floats(-math.pi, math.pi), turn=st.floats(-0.4, 0.4),
    pieces=st.integers(1, 7),
)  # fmt: skip
def test_a_look_in_pieces_sees_what_one_at_once_sees(x, course, turn, pieces):
    site = PlaneSite(SITE)
    tether = site.model.start((0, 0, 0), (x, 2.0, 0.0))
    velocity = 0.5 * np.array([math.cos(course), math.sin(course), 0.0])
    motion = Motion(0.0, tether.robot, tether.robot, velocity, turn)
    once, often = (Lookahead(site, tether, motion, 0.05) for _ in range(2))
    assert once.advance(10_000) > 0
    while not often.is_done:
        assert often.advance(pieces) <= pieces
    one, other = once.result, often.result
    assert (one.loop_s, one.short_s, one.is_turning) == (
        other.loop_s,
        other.short_s,
        other.is_turning,
    )
    if one.loop is not None:
        assert one.loop.around == other.loop.around
        np.testing.assert_array_equal(one.loop.line, other.loop.line)


@settings(max_examples=40, deadline=None)
@given(
    there=st.tuples(st.floats(6.5, 11.0), st.floats(-2.0, 5.0)),
    course=st.floats(-math.pi, math.pi), turn=st.sampled_from([0.0, 0.07, -0.15, 0.3, -0.4]),
)  # fmt: skip
def test_leaps_over_open_water_miss_nothing(there, course, turn):
    site = PlaneSite(SITE)
    tether = site.model.start((0, 0, 0), (6.0, 2.0, 0.0))
    place = np.array([*there, 0.0])
    if site.field.distance(place) > 0.0 and site.field.line_of_sight(tether.robot, place, 0.0):
        tether = site.model.update(tether, place)
    velocity = 0.5 * np.array([math.cos(course), math.sin(course), 0.0])
    motion = Motion(0.0, tether.robot, tether.robot, velocity, turn)
    leaping, walking = (Lookahead(site, tether, motion, 0.05) for _ in range(2))
    leaping.advance(10_000)
    site.safe_prefix = lambda *_: 0
    walking.advance(10_000)
    one, other = leaping.result, walking.result
    assert (one.loop_s, one.short_s, one.is_turning) == (
        other.loop_s,
        other.short_s,
        other.is_turning,
    )


def test_an_alarm_flickers_neither_on_nor_off():
    alarms, warning = Alarms(), Alarm("loop-ahead", Level.WARNING, "x")
    raised = []
    for k in range(40):  # a reason at every second look
        raised += alarms.update(0.3 * k, [warning] if k % 2 else [])
    assert [a.level for a in raised] == [Level.NOTICE, Level.WARNING]
    assert alarms.update(12.3, []) == []
    assert "loop-ahead" in alarms.active
    alarms.update(20.0, [])
    assert not alarms.active


@pytest.mark.parametrize(
    ("share", "clear", "on_plan", "level"),
    [
        (1.0, 1.0, False, Level.WARNING),
        (1.0, 0.4, False, Level.WARNING),  # whichever class it is
        (0.85, 0.85, False, Level.WARNING),
        (0.85, 0.4, False, Level.CAUTION),  # anybody's guess
        (0.6, 0.7, False, Level.CAUTION),
        (1.0, 1.0, True, Level.CAUTION),
        (0.06, 0.9, False, Level.CAUTION),
        (0.04, 0.9, False, None),
    ],
)  # fmt: skip
def test_a_loop_ahead_is_warned_of_where_it_closes_in_nearly_every_class(
    share, clear, on_plan, level
):
    assert levels_ahead(8.0, share, on_plan, clear) == ([] if level is None else [level])


@pytest.mark.parametrize("vouched", [True, False])
def test_after_a_restart_the_robot_may_have_gone_for_ten_seconds_at_least(vouched):
    guard = Guard(SITE, EXACT)
    for fix in along((0, 0, 0), (3, 0.9, 0), begin=100.0):
        guard.update(fix)
    if not vouched:
        guard.update(Fix(guard.report.time, estimate=False))
    before = guard.report.time
    guard.restart_vehicle(Fix(0.5))
    assert guard.track.silence_s(0.5) >= guard.policy.track.restart_s
    motion = guard.track.observe(Fix(2.5, (3.0, 0.9, 0.0)))
    assert before > 100.0
    assert 12.0 <= motion.lost_s < 13.0


def levels_ahead(seconds, share=1.0, on_plan=False, likeliest=1.0, **more):
    line = np.array([[4.0, 0.0], [5.0, 1.0], [6.0, 0.0], [5.0, -1.0], [4.0, 0.0]])
    ahead = LookaheadResult(loop_s=seconds, loop=Loop((0,), line))
    place = np.array([4.0, -1.0, 0.0])
    situation = Situation(PlaneSite(SITE), place, likeliest, is_on_plan=on_plan, **more)
    told = loop_ahead(ahead, situation, share)
    return [a.level for a in told]


def test_with_velocities_fewer_classes_are_asked_for_and_less_is_added_for_noise():
    how = {"noise": 0.3, "has_velocities": True}
    assert levels_ahead(8.0, 0.75, False, 0.5, **how) == [Level.WARNING]
    assert levels_ahead(8.0, 0.65, False, 0.5, **how) == [Level.CAUTION]
    assert levels_ahead(8.0, 0.75, False, 0.5, noise=0.3) == [Level.CAUTION]
    assert levels_ahead(25.0, noise=0.3) == [Level.WARNING]  # 20 s × 1.39
    assert levels_ahead(25.0, **how) == [Level.CAUTION]  # 20 s × 1.18


def test_what_is_ahead_in_two_classes_is_half_a_second_old_at_most():
    """A look that took many updates would tell of a robot that turns what it did before."""
    guard = Guard(SITE, EXACT)
    for fix in along((0, 0, 0), (3, 2.5, 0)):
        guard.update(fix)
    (strand,) = guard.strands.all
    half = replace(strand, likely=0.5)
    motion = replace(guard._motion, velocity=np.array([0.35, 0.35, 0.0]), turn=0.1)
    guard._looks, guard._look_began = [], -math.inf
    updates = 1
    guard._look_ahead([half, half], [[], []], motion)
    while guard._looks:
        guard._look_ahead([half, half], [[], []], motion)
        updates += 1
    assert updates <= 5


def levels_on_the_way_round_a(guard):
    """Of loops ahead, from each fix to where the loop closes."""
    levels = []
    for fix in along(*ROUND_A):
        report = guard.update(fix)
        if report.loops:
            return levels
        levels.append(max((a.level for a in report.alarms if a.kind == "loop-ahead"), default=0))
    raise AssertionError("no loop has closed")


def test_a_loop_in_an_unlikely_class_keeps_nothing_from_being_said_of_the_likely_one():
    """There it is closed already, around the very obstacle that the robot is about to go round."""
    guard = Guard(SITE, EXACT)
    guard.begin_with({(): 0.0, (1,): 2.6}, np.zeros(3), 0.0)
    assert guard.update(along(*ROUND_A)[0]).classes[1].likely == pytest.approx(0.07, abs=0.01)
    levels = levels_on_the_way_round_a(guard)
    assert max(levels) == Level.WARNING
    assert levels[-100] == Level.WARNING  # ten seconds before


def test_where_a_loop_is_closed_already_it_counts_as_one_that_going_on_leads_to():
    """In one of two classes there is one around A: going on, there is one in both."""
    guard = Guard(SITE, EXACT)
    guard.begin_with({(): 0.0, (1,): 0.0}, np.zeros(3), 0.0)
    sure = []
    for fix in along(*ROUND_A):
        report = guard.update(fix)
        if any("A in" in a.text and a.kind == "loop-ahead" for a in report.alarms):
            sure.append(guard._ahead_share)
    assert np.median(sure) == 1.0


@settings(max_examples=30, deadline=None)
@given(
    off=st.floats(-0.6, 0.6), rate=st.floats(0.5, 2.0), far=st.floats(0.56, 1.6),
    way=st.sampled_from([1.0, -1.0]),
)  # fmt: skip
@example(off=0.5, rate=1.0, far=0.56, way=1.0)
def test_a_robot_that_goes_round_an_obstacle_is_seen_to_close_its_loop_whatever_the_noise(
    off, rate, far, way
):
    """Where it is tells the circle: not its course, which is off, nor how fast it turns."""
    site, centre = PlaneSite(SITE), np.array([5.0, 0.0, 0.0])
    angles = math.pi + way * np.linspace(0.0, 1.25 * math.pi, 40)
    round_it = centre + far * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    tether = site.model.start((0, 0, 0), (0, 0, 0))
    for place in round_it:
        tether = site.model.update(tether, place)
    course = angles[-1] + way * 0.5 * math.pi + off
    velocity = 0.5 * np.array([math.cos(course), math.sin(course), 0.0])
    motion = Motion(0.0, tether.robot, tether.robot, velocity, way * rate * 0.5 / far)
    look = Lookahead(site, tether, motion, 0.05)
    look.advance(10_000)
    assert look.result.loop is not None
    assert look.result.loop.around == (0,)
    # the loop closes where the tether comes to the obstacle, or before if it turns more tightly
    assert look.result.loop_s <= 0.76 * math.pi * far / 0.5 + 2.0


@pytest.mark.parametrize("exact", [True, False])
def test_a_robot_under_way_begins_with_the_tether_of_its_state(exact):
    """Its word is not that of the shortest tether to where it is."""
    state = {"position": (7.0, 0.3, 0.0), "signature": (1,)}
    site = Problem.from_json(json.dumps({**json.loads(SITE.to_json()), "state": state}))
    guard = Guard(site, EXACT if exact else None)
    report = guard.update(Fix(0.0, (7.0, 0.3, 0.0), estimate=True))
    assert report.classes[0].word == (1,)
    for fix in along((7.0, 0.3, 0), (7.0, -1.5, 0), begin=0.1):
        report = guard.update(fix)
    assert report.classes[0].word == (1,)
    assert report.classes[0].taut > math.dist((0, 0), (7.0, -1.5)) + 0.05


def test_goals_with_alternatives_and_polygons_change_nothing_for_the_tether():
    pier = Polygon(polygon=[(4, -1), (6, -1), (6, 1), (4, 1)], name="pier")
    goals = [{"name": "g", "any_of": [[9, 0, -1], [9, 3, -1]]}]
    sites = [
        Problem(base=(0, 0), goals=g, tether_length=20, obstacles=[pier])
        for g in (goals, [(9, 0, -1)])
    ]  # fmt: skip
    told = []
    for site in sites:
        guard = Guard(site, EXACT)
        for fix in along((0, 0, 0), (4, 2, 0), (8, 0, 0)):
            report = guard.update(fix)
        told.append((report.classes[0].word, report.classes[0].taut))
    assert told[0] == told[1]
    assert told[0][0] == (1,)
    assert told[0][1] == pytest.approx(math.hypot(4, 1) + 2.0 + math.hypot(2, 1), abs=0.06)


def test_a_recording_that_is_wrong_at_its_end_leaves_the_output_as_it_was(tmp_path, capsys):
    out = tmp_path / "kept.jsonl"
    out.write_text("before")
    (tmp_path / "bad.csv").write_text("t,x,y,z\n0,0,0,0\n1,0.1,0,0\n2,right,0,0\n")
    told = ["guard", str(PROBLEMS / "wharf.json"), "-o", str(out), "--quiet", "--replay"]
    for name in ("bad.csv", "missing.csv"):
        assert main([*told, str(tmp_path / name)]) == 2
        assert out.read_text() == "before"
    assert capsys.readouterr().err.count("\n") == 2


@pytest.mark.parametrize("seed", range(3))
def test_shares_of_classes_add_to_one_however_uncertain_the_position_is(seed):
    rng = np.random.default_rng(seed)
    guard = Guard(Problem.load(PROBLEMS / "oc4-jacket.json"), GuardOptions(5.0, 10.0))
    here = np.array([0.0, 0.0, -1.0])
    for k in range(40):
        here[:2] += rng.normal(0.0, 0.3, 2)
        place = here + rng.normal(0.0, 1.0, 3)
        report = guard.update(Fix(0.5 * k, tuple(place), estimate=True))
        if report.classes:
            assert sum(c.likely for c in report.classes) == pytest.approx(1.0)


def test_a_log_that_is_none_is_told_in_a_line_whatever_its_reader_prints(tmp_path):
    pytest.importorskip("pymavlink")
    (tmp_path / "x.bin").write_bytes(np.random.default_rng(0).bytes(3000))
    done = subprocess.run(
        [sys.executable, "-m", "netsp", "guard", str(PROBLEMS / "wharf.json"), "--replay",
         str(tmp_path / "x.bin"), "--quiet"],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert not done.stdout
