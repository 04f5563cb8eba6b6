"""Repairs keep the reserve of tether that the plan had, and a limit that is lowered below what is
out is met by the shortest way."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InputError, Problem, solve
from netsp.command.main import main
from netsp.online.execute import ExecutionOptions, Surprises, execute
from netsp.online.execute.execution_log import describe_execution
from netsp.online.execute.tether_limits import (
    TETHER_TOLERANCE,
    describe_limits,
    limit_periods,
    overruns,
)
from netsp.online.execute.tether_reserve import ReservePolicy
from netsp.online.execute.tour_repair import RepairOptions, repair, reserved_limit
from netsp.online.fly import tour_flight
from netsp.online.fly.tour_flight import fly
from netsp.plan.tour_plan import HOME
from netsp.world.scene.scene import scene_of
from netsp.world.tether import GeodesicTether
from tests.simulated_session import SimulatedSession

SITE = Problem(
    base=(0, 0), goals=[(6, 2, -1), (9, -2, -1), (4, -4, -2)], tether_length=12, clearance=0.3,
    obstacles=[
        Circle(center=(4, 0), radius=0.6, name="pile"), Circle(center=(7, -2), radius=0.5),
        Circle(center=(2, -3), radius=0.4),
    ],
)  # fmt: skip
NEED = 9.3  # m, at least, of tether to the farthest goal


@pytest.fixture(scope="module")
def tour():
    return solve(SITE)


def shortened(when, limit):
    return Surprises.model_validate({"events": [{"time": when, "tether_length": limit}]})


def check_limits(run):
    """Check a run whose limit was lowered: once within it, the tether stays so, or the summary says
    when it was not."""
    s, met = run.summary, True
    for row in run.rows:
        if row.tether <= row.limit * (1.0 + TETHER_TOLERANCE):
            met = True
        elif met and row.shortening:
            met = False  # the limit was lowered just now
        elif met:
            assert any(o["begin_s"] <= row.time <= o["end_s"] for o in s["over_limit"])
            assert s["exceedance_s"] > 0.0
    told = [o["end_s"] - o["begin_s"] for o in s["over_limit"]]
    assert sum(told) == pytest.approx(s["exceedance_s"] + s["shortening_s"])


@given(st.floats(0.02, 0.98), st.floats(0.15, 1.0))
@settings(max_examples=12, deadline=None)
def test_once_within_a_shortened_limit_the_tether_stays_so(tour, share, limit):
    when, limit = share * tour.length / 0.5, limit * SITE.tether_length
    run = execute(SITE, tour, ExecutionOptions(speed=0.5), surprises=shortened(when, limit))
    s = run.summary
    check_limits(run)
    assert s["exceedance_s"] == 0.0
    assert (s["home"], s["tether_free"], s["defects"]) == (True, True, 0)
    assert s["visited"] + len(s["left_out"]) == 3
    # one metre of tether for each metre of way: no way is shorter
    out = next((r.tether for r in run.rows if r.limit == limit), 0.0)
    step = run.rows[1].time - run.rows[0].time
    assert s["shortening_s"] <= max(out - limit, 0.0) / 0.5 + 2.0 * step
    repairs = [e for e in run.entries if e.response in ("local", "replan")]
    after = [a.tether for a in run.arrivals if repairs and a.time > repairs[0].time]
    room = reserved_limit(run.problem, [0, 1, 2], run.reserve)
    assert max(after, default=0.0) <= room.length * (1.0 + 2e-3)
    assert room.length <= limit


@given(st.floats(0.0, 6.0), st.floats(0.4, 1.0), st.sampled_from([(0, 1, 2), (2, 0), (1,)]))
@settings(max_examples=10, deadline=None)
def test_a_repair_is_never_longer_than_the_limit_less_its_reserve(reserve, limit, left):
    problem = SITE.model_copy(update={"tether_length": limit * SITE.tether_length})
    robot = np.array([1.0, 0.5, -0.5])
    tether = np.array([problem.base, robot])
    made = repair(problem, robot, tether, list(left), "a test", RepairOptions(0.5, reserve=reserve))
    bare = repair(problem, robot, tether, list(left), "a test", RepairOptions(0.5))
    assert [g for g, _ in made.left_out] == [g for g, _ in bare.left_out]
    goals = [leg for leg in made.legs if leg.goal != HOME]
    if not goals:
        assert made.limit is None
        return
    assert made.limit.length + made.limit.reserve == pytest.approx(problem.tether_length)
    assert max(leg.tether for leg in goals) <= made.limit.length + 1e-6
    assert made.limit.reserve <= reserve + 1e-9
    if made.limit.reserve < reserve - 1e-9:  # then some goal cannot be reached with more
        least = max(leg.tether for leg in goals if leg.goal == made.limit.goal)
        assert least == pytest.approx(made.limit.length)
        assert f"instead of {reserve:.4g}" in made.reason
    elif reserve > 0.0:
        assert "of tether kept in reserve" in made.reason


def test_the_reserve_is_that_of_the_plan_or_what_was_asked_for(tour):
    longest = max(v.tether_length for v in tour.tour)
    assert ReservePolicy().of_plan(SITE, tour) == pytest.approx(0.1 * 12)
    assert ReservePolicy(max_share=1.0).of_plan(SITE, tour) == pytest.approx(12 - longest)
    assert ReservePolicy(reserve=0.4).of_plan(SITE, tour) == 0.4
    slack = solve(SITE, slack=0.05)
    assert ReservePolicy().of_plan(SITE, slack) == pytest.approx(12 - 12 / 1.05)
    for wrong in ({"reserve": -1.0}, {"max_share": 1.1}, {"max_share": float("nan")}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            ReservePolicy(**wrong)


def test_an_obstacle_in_the_way_leaves_the_reserve(tour):
    """Round the obstacle there is a tether within the limit that leaves less than the plan did."""
    first = tour.tour[0].goal
    at = 0.6 * np.array(SITE.goals[first].position[:2])
    event = {"time": 2.0, "appear": {"center": at.tolist(), "radius": 0.5}}
    run = execute(
        SITE,
        tour,
        ExecutionOptions(speed=0.5),
        surprises=Surprises.model_validate({"events": [event]}),
    )
    assert run.reserve == pytest.approx(1.2)
    longest = max(r.tether for r in run.rows)
    assert longest <= reserved_limit(run.problem, [0, 1, 2], run.reserve).length * (1 + 2e-3)


def test_the_robot_goes_back_along_its_tether_at_once_and_not_on(tour):
    run = execute(SITE, tour, ExecutionOptions(speed=0.5), surprises=shortened(16.0, 4.0))
    assert run.entries[0].response == "shorten"
    rows = [r for r in run.rows if r.shortening]
    assert rows[0].tether > 4.5
    assert {r.mode for r in rows} == {"shorten"}
    assert np.all(np.diff([r.tether for r in rows]) < 0.0)
    text = describe_execution(run)
    assert f"from {rows[0].time:.1f} s on {rows[0].tether:.6g} of 4 m" in text
    assert f"shortened for {run.summary['shortening_s']:.1f} s to a new limit" in text


def test_what_happens_on_the_way_back_is_in_the_plan_after_it(tour):
    events = [
        {"time": 16.0, "tether_length": 4.0}, {"time": 17.0, "add_goal": [1.0, 1.5, -1.0]},
        {"time": 17.5, "cancel_goal": 2}, {"time": 18.0, "tether_length": 3.0},
        {"time": 18.5, "tether_length": 3.5},
    ]  # fmt: skip
    run = execute(
        SITE, tour, ExecutionOptions(speed=0.5),
        surprises=Surprises.model_validate({"events": events}),
    )  # fmt: skip
    check_limits(run)
    assert run.summary["home"]
    assert run.summary["tether_free"]
    assert 3 in [a.goal for a in run.arrivals]
    assert run.summary["limits"][-1]["limit"] == 3.5


def test_times_over_the_limit_are_told_with_their_limits():
    t, tether = np.arange(6.0), np.array([1.0, 3.0, 2.5, 1.9, 2.2, 1.0])
    limit = np.array([5.0, 2.0, 2.0, 2.0, 2.0, 2.0])
    lowered = np.array([False, True, True, False, False, False])
    periods, over = limit_periods(t, tether, limit), overruns(t, tether, limit, lowered)
    assert [(p.begin_s, p.limit, p.longest, p.longest_s) for p in periods] == [
        (0.0, 5.0, 1.0, 0.0), (1.0, 2.0, 3.0, 1.0),
    ]  # fmt: skip
    assert [(o.begin_s, o.end_s, o.longest, o.shortening) for o in over] == [
        (1.0, 3.0, 3.0, True), (4.0, 5.0, 2.2, False),
    ]  # fmt: skip
    assert describe_limits(periods, over, "m") == (
        "longest 1 of 5 m, from 1.0 s on 3 of 2 m, over the limit for 1.0 s (4.0 to 5.0 s: up to "
        "2.2 of 2 m), shortened for 2.0 s to a new limit (1.0 to 3.0 s: up to 3 of 2 m)"
    )
    assert limit_periods(t[:0], t[:0], t[:0]) == []


def true_lengths(session, begin):
    """Return times and lengths of the tether along the true places of a vehicle."""
    model = GeodesicTether(scene_of(SITE).field(), 0.1)
    rows = session.truth[::5]
    frame = session.frame
    places = np.array([frame.from_local(n, e, -u) for e, n, u in rows[:, 1:4]])
    base = np.array(SITE.base, dtype=float)
    return rows[:, 0] - begin, model.drive(model.start(base, base), places)[1]


@pytest.mark.parametrize(("when", "limit"), [(13.0, 4.0), (30.0, 9.9)])
def test_a_vehicle_stays_within_a_limit_that_is_lowered_under_way(tour, monkeypatch, when, limit):
    monkeypatch.setattr(tour_flight, "rehearse", lambda: None)
    session = SimulatedSession(SITE, speed=0.5).arm()
    begin = session.simulation.now
    done = fly(
        SITE, tour, session, ExecutionOptions(speed=0.5, reach=0.3),
        surprises=shortened(when, limit),
    )  # fmt: skip
    s = done.summary
    assert (s["status"], s["home"], s["tether_free"]) == ("done", True, True), done.stopped
    assert s["exceedance_s"] == 0.0
    t, true = true_lengths(session, begin)
    out = float(true[t <= when][-1])
    over = t[(true > limit) & (t > when + 0.5)]
    assert (len(over) > 0) == (out > limit)
    if out > limit:
        turned = t[int(np.argmax(true))]
        assert turned < when + 2.0  # it turns round at once
        assert true.max() < out + 0.6  # in what it takes to come to a halt
        met = t[t > turned][true[t > turned] <= limit][0]
        assert over.max() < met  # and then never again
        assert s["shortening_s"] == pytest.approx(met - when, abs=0.5)


def test_the_page_about_a_run_says_both_limits_and_when_it_was_over(tour, tmp_path):
    SITE.save(tmp_path / "p.json")
    tour.save(tmp_path / "s.json")
    shortened(16.0, 4.0).save(tmp_path / "e.json")
    run = tmp_path / "run"
    files = [str(tmp_path / name) for name in ("p.json", "s.json", "e.json")]
    line = ["execute", *files[:2], "--surprise", files[2], "-o", str(run), "--reserve", "0.2"]
    assert main([*line, "--quiet"]) == 4
    s = json.loads((run / "summary.json").read_text())
    assert s["reserve"] == 0.2
    (over,) = s["over_limit"]
    assert main(["report", str(run), "-o", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text()
    assert f"of 12 m, from {over['begin_s']:.1f} s on" in page
    assert (
        f"({over['begin_s']:.1f} to {over['end_s']:.1f} s: up to {over['longest']:.4g} of 4 m)"
        in page
    )
