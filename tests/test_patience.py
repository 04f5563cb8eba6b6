"""Work that takes long says so, and where its steps are counted, how long it will take."""

import io
import time
from pathlib import Path

import pytest

from netsp import Circle, Problem
from netsp.base import progress
from netsp.command.command_policy import CommandPolicy
from netsp.command.main import main
from netsp.command.patience import Patience, span
from netsp.command.stages import Stages
from netsp.plan.random_worlds import random_world
from netsp.roadmap.explain_unreachable import shortest_tethers
from netsp.roadmap.roadmap_policy import ReachPolicy, RoadmapPolicy

ROOT = Path(__file__).parent.parent

AT_ONCE = CommandPolicy(silence_s=0.001, line_interval_s=0.02)


def test_what_is_quickly_done_says_nothing():
    out = io.StringIO()
    with Patience(out, "counting"):
        list(progress.track(range(10)))
    assert out.getvalue() == ""


def test_the_time_left_is_that_of_the_steps_left():
    out = io.StringIO()
    with Patience(out, "counting", AT_ONCE) as told:
        for k in progress.track(range(4)):
            if k == 3:
                time.sleep(0.1)
                told._since = time.monotonic() - 60.0
                assert told.line == "counting: 3 of 4, about 0:20 left"
        for _ in progress.track(range(100)):  # other steps: their pace is their own
            assert "about 1:" not in told.line
    assert "counting: " in out.getvalue()
    assert "3 of 4" in out.getvalue()


def test_work_without_steps_says_how_long_it_has_taken():
    out = io.StringIO()
    with Patience(out, "waiting", AT_ONCE):
        time.sleep(0.1)
    assert "waiting: 0:00 so far" in out.getvalue()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["plot", "{root}/problems/wharf.json", "-o", "{tmp}/w.png"], "drawing "),
        (["import", "{root}/examples/site.geojson", "-o", "{tmp}/p.json"], "reading "),
    ],
)
def test_commands_say_what_takes_so_long(tmp_path, capsys, words, said):
    assert main([w.format(root=ROOT, tmp=tmp_path) for w in words], AT_ONCE) == 0
    assert said in capsys.readouterr().err


def test_stages_with_a_limit_say_what_is_left_of_it():
    out = io.StringIO()
    Stages(out, 60.0)("words of the scene")
    assert out.getvalue().strip().endswith("words of the scene …, 1:00 left")


def test_spans_are_told_in_hours_minutes_and_seconds():
    assert [span(s) for s in (0.4, 59.6, 3599.0, 3661.0)] == ["0:00", "1:00", "59:59", "1:01:01"]


@pytest.mark.parametrize("seed", range(4))
def test_obstacles_that_no_path_touches_change_no_tether(seed):
    problem = random_world(seed, goals=8, tether_length=300.0, obstacles=40, radii=(5.0, 20.0))
    far = [Circle(center=(5000.0 + 50.0 * k, 9000.0), radius=20.0) for k in range(10)]
    more = problem.model_copy(update={"obstacles": (*problem.obstacles, *far), "bounds": None})
    whole = shortest_tethers(more)
    near = RoadmapPolicy(reach=ReachPolicy(max_whole_obstacles=0))
    assert shortest_tethers(more, policy=near) == pytest.approx(whole, rel=1e-8)
    # and where the first guess is too near
    nearer = RoadmapPolicy(reach=ReachPolicy(max_whole_obstacles=0, first_ratio=0.3))
    assert shortest_tethers(more, policy=nearer) == pytest.approx(whole, rel=1e-8)


def test_a_goal_behind_a_wall_that_is_far_around_needs_the_whole_way():
    wall = [Circle(center=(10.0, y), radius=3.0) for y in range(-60, 61, 4)]
    problem = Problem(base=(0, 0), goals=[(20, 0)], tether_length=10, obstacles=wall)
    whole = shortest_tethers(problem)
    near = RoadmapPolicy(reach=ReachPolicy(max_whole_obstacles=0))
    assert whole[0] > 120.0
    assert shortest_tethers(problem, policy=near) == pytest.approx(whole, rel=1e-8)
