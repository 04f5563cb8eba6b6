"""Plans whose clearance a real vehicle uses up are warned of, with the number to raise."""

import gzip
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InputError, Problem, solve
from netsp.base.units import metres_per_unit
from netsp.command.main import main
from netsp.plan.sizing.clearance_advice import ClearancePolicy, clearance_advice, clearance_room

FLIGHTS = Path(__file__).parent / "data" / "ardusub47"
PROBLEMS = Path(__file__).parent.parent / "problems"


def site(clearance, units="m"):
    return Problem(
        name="site", base=(0, 0), goals=[(8, 0, -1)], tether_length=20, clearance=clearance,
        obstacles=[Circle(center=(4, 0.2), radius=1)], units=units,
    )  # fmt: skip


@given(*[st.floats(0.0, 3.0)] * 3)
@settings(max_examples=40, deadline=None)
def test_a_warning_comes_below_the_sum_and_its_number_ends_it(clearance, error, current):
    policy = ClearancePolicy(position_error=error, current=current)
    needed = error + 0.1 + 0.06 * current
    text = clearance_advice(clearance, "m", policy)
    if clearance >= needed:
        assert text is None
    elif clearance < needed - 1e-6:
        number = float(re.search(r"raise clearance to (\S+) or more", text)[1])
        assert needed - 1e-9 <= number <= 1.01 * needed
        assert clearance_advice(number, "m", policy) is None
    assert clearance_advice(needed, "m", policy) is None
    assert clearance_advice(0.0, "pixels", policy) is None


def test_the_terms_of_a_clearance_are_in_words_and_none_is_zero():
    both = clearance_advice(0.3, "m", ClearancePolicy(position_error=0.3, current=0.5))
    assert (
        "(0.3 m of position error + 0.1 m that the vehicle strays from its path + 0.03 m " in both
    )
    assert "for a current of 0.5 m/s)" in both
    neither = clearance_advice(0.05, "m", ClearancePolicy())
    assert "(0.1 m that the vehicle strays from its path)" in neither


def test_the_numbers_are_those_of_flights():
    assert ClearancePolicy().min_clearance == pytest.approx(0.10)
    assert ClearancePolicy(current=0.8).min_clearance == pytest.approx(0.15, abs=0.005)
    problem = Problem.load(PROBLEMS / "wharf.json")
    text = gzip.decompress((FLIGHTS / "fly-wharf-true.csv.gz").read_bytes()).decode()
    rows = [line.split(",")[:4] for line in text.splitlines()[1:]]
    way = [(float(x), float(y)) for t, x, y, _ in rows if 60.4 <= float(t) <= 200.3]
    room = min(
        ((x - o.center[0]) ** 2 + (y - o.center[1]) ** 2) ** 0.5 - o.radius
        for x, y in way for o in problem.obstacles if isinstance(o, Circle)
    )  # fmt: skip
    lost = problem.clearance - room
    assert 0.05 < lost <= ClearancePolicy().path_error + 0.005


@given(st.floats(0.0, 3.0), st.floats(0.0, 2.0), st.sampled_from(["km", "ft", "cm", "Metres"]))
@settings(max_examples=40, deadline=None)
def test_other_units_of_length_are_converted(error, current, units):
    policy, metres = ClearancePolicy(position_error=error, current=current), metres_per_unit(units)
    text = clearance_advice(0.01 / metres, units, policy)
    number = float(re.search(r"raise clearance to (\S+)", text)[1])
    assert policy.min_clearance - 1e-6 <= number * metres <= 1.01 * policy.min_clearance
    assert clearance_advice(number, units, policy) is None


@given(st.floats(0.0, 0.5), st.floats(0.0, 4.0))
@settings(max_examples=30, deadline=None)
def test_following_the_advice_ends_it_or_the_advice_says_which_goal_is_too_near(margin, error):
    problem = site(0.2)
    policy, room = ClearancePolicy(position_error=error), clearance_room(problem)
    assert room.max_clearance == pytest.approx(np.hypot(4, 0.2) - 1.0)
    text = clearance_advice(0.2, "m", policy, margin=margin, room=room)
    if text is None:
        assert 0.2 + margin >= error + 0.1 - 1e-6
        return
    data = json.loads(problem.to_json())
    number = float(re.search(r"(?:raise clearance to|can be raised to) (\d+\.?\d*)", text)[1])
    raised = Problem.model_validate({**data, "clearance": number})  # base and goal stay free
    again = clearance_advice(number, "m", policy, margin=margin, room=clearance_room(raised))
    if "raise clearance to" in text:
        assert again is None
    else:
        assert f"is only {number:g} m from obstacle #0" in text
        assert "cannot be raised" in again


def test_a_margin_counts_as_clearance_and_px_are_no_length(tmp_path, capsys):
    file, tour = str(tmp_path / "p.json"), str(tmp_path / "s.json")
    site(0.1).save(file)
    more = ["--position-error", "0.2"]
    assert main(["solve", file, "-o", tour, "--margin", "0.2", *more]) == 0
    assert main(["fly", file, tour, "--dry-run", *more]) == 0
    plan = ["--origin", "55,12", "-o", str(tmp_path / "m.plan")]
    assert main(["export", tour, "--problem", file, *plan, *more]) == 0
    assert "clearance: " not in capsys.readouterr().err
    assert main(["fly", file, tour, "--dry-run", "--position-error", "0.3"]) == 0
    said = capsys.readouterr().err
    assert "0.1 m and a margin of 0.2 m is less than the 0.4 m" in said
    assert "raise clearance to 0.2 or more" in said
    site(0.1, "px").save(file)
    assert main(["solve", file, "-o", tour, *more]) == 0
    assert "a clearance in px cannot be compared with metres" in capsys.readouterr().err


def test_goals_that_an_obstacle_has_come_upon_do_not_limit_the_clearance():
    problem = site(0.3)
    boat = Circle(center=(8, 0), radius=1)
    over = problem.model_copy(update={"obstacles": (*problem.obstacles, boat)})
    assert clearance_room(over).place == "the base"
    assert clearance_room(problem.model_copy(update={"obstacles": ()})) is None


@pytest.mark.parametrize("name", ["position_error", "current", "path_error", "error_by_current"])
def test_numbers_out_of_range_are_refused(name):
    for wrong in (-0.1, float("inf"), float("nan")):
        with pytest.raises(InputError, match=name):
            ClearancePolicy(**{name: wrong})


@pytest.mark.parametrize(
    ("clearance", "units", "more", "number"),
    [
        (0.05, "m", [], "0.1 or more"),
        (0.3, "m", [], None),
        (0.3, "m", ["--position-error", "0.3", "--current", "0.5"], "0.43 or more"),
        (0.5, "m", ["--position-error", "0.3", "--current", "0.5"], None),
        (0.05, "px", [], None),
    ],
)
def test_solve_export_and_fly_warn_and_say_what_to_raise(
    tmp_path, capsys, clearance, units, more, number
):
    problem = site(clearance, units)
    problem.save(tmp_path / "p.json")
    file, tour = str(tmp_path / "p.json"), str(tmp_path / "s.json")
    solve(problem, seed=0).save(tour)
    commands = [["solve", file, "-o", tour, "--time-limit", "30"]]
    if units == "m":
        commands += [
            [
                "export",
                tour,
                "--problem",
                file,
                "--origin",
                "55,12",
                "-o",
                str(tmp_path / "m.plan"),
            ],
            ["fly", file, tour, "--dry-run"],
        ]
    for command in commands:
        assert main([*command, *more]) == 0
        lines = [x for x in capsys.readouterr().err.splitlines() if "clearance: " in x]
        assert len(lines) == (0 if number is None else 1)
        assert all(f"raise clearance to {number}" in x for x in lines)


def test_missions_are_warned_of_too(tmp_path, capsys):
    scene = {
        "schema_version": 1, "name": "s",
        "solids": [{"box": {"center": [4, 3, -1], "size": [1, 1, 1]}}],
    }  # fmt: skip
    mission = {
        "schema_version": 1, "scene": "scene.json", "anchor": [0, 0, -1], "start": [0.2, 0, -1],
        "tether_length": 14, "waypoints": [[3, 0, -1]], "clearance": 0.05, "reach": 0.2,
    }  # fmt: skip
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    (tmp_path / "m.json").write_text(json.dumps(mission))
    line = ["solve", str(tmp_path / "m.json"), "-o", str(tmp_path / "out.json")]
    assert main([*line, "--time-limit", "1"]) == 0
    assert "raise clearance to 0.1 or more" in capsys.readouterr().err
