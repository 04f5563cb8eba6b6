"""A guard beside a robot on a mission in space."""

import csv
import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from netsp.base.errors import InputError
from netsp.command.main import main
from netsp.online.guard.guard_page import Page
from netsp.online.guard.silhouettes import silhouette
from netsp.online.guard.space_site import SpaceSite
from netsp.online.guard.state_file import restore, save
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard, GuardOptions
from netsp.online.guard.winding import space_loop_closed_by, space_loops_in
from netsp.plan.space.mission_solver import solve_mission
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene
from netsp.world.simulator.mission_run import simulate
from tests.worlds import FEW_CELLS

EXACT = GuardOptions(noise=0.0, drift=0.0)

SOLIDS = [
    {"name": "pile", "capsule": {"a": [0, 0, -9], "b": [0, 0, 1], "radius": 0.3}},
    {"name": "mooring", "capsule": {"a": [5, -3, -2], "b": [5, 3, -4], "radius": 0.12}},
    {"name": "ring", "torus": {"center": [0, 7, -4], "axis": [0, 1, 0], "major_radius": 2.0,
                               "minor_radius": 0.2}},
]  # fmt: skip
BOUNDS = (-9, -8, -8, 10, 12, 0)
"""The pile goes through them from top to bottom; the mooring ends within."""

BY_THE_PILE = [(0, 1.5, -2), (2, 0, -2), (0, -1.5, -2)]
ROUND_THE_PILE = [*BY_THE_PILE, (-2, 0, -2), (-2, 1.5, -2), (0, 1.5, -2)]
ROUND_THE_MOORING = [
    (0, 1.5, -2), (5, 1.5, -1), (6.5, 1.5, -3.5), (5, 1.5, -5), (3.5, 1.5, -3.5), (3.5, 1.5, -1),
    (5, 1.5, -1),
]  # fmt: skip


@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    folder = tmp_path_factory.mktemp("space")
    (folder / "scene.json").write_text(
        Scene(name="two bars and a ring", solids=SOLIDS, bounds=BOUNDS).model_dump_json(
            exclude_none=True
        )
    )
    mission = Mission(
        scene="scene.json", anchor=(-5, 0.3, -1), start=(-4.8, 0.3, -1), tether_length=22.0,
        waypoints=[(2, 0.5, -3), (6.5, 0, -3), (0.5, 8.5, -4), (-3, 8, -3)], clearance=0.2,
        speed=EXACT.speed,
    )  # fmt: skip
    (folder / "mission.json").write_text(mission.model_dump_json(exclude_none=True))
    return Mission.load(folder / "mission.json")


@pytest.fixture(scope="module")
def site(mission):
    return SpaceSite(mission)


@pytest.fixture(scope="module")
def solved(mission):
    """On a grid that is coarse enough for the whole of it to be gone through in time."""
    return solve_mission(mission.model_copy(update={"cell": 0.4}), time_limit=8.0, policy=FEW_CELLS)


@pytest.fixture(scope="module")
def flown(solved):
    return solved.run or simulate(solved.mission)


def along(*points, speed=0.5, t=0.0, every=0.2):
    """Fixes so many seconds apart on a polyline."""
    out = []
    for a, b in itertools.pairwise(points):
        a, b = np.array(a, dtype=float), np.array(b, dtype=float)
        count = max(1, round(float(np.linalg.norm(b - a)) / speed / every))
        for s in np.linspace(0.0, 1.0, count, endpoint=False):
            out.append(Fix(t, tuple((a + s * (b - a)).tolist()), estimate=True))
            t += every
    return out


def test_the_tether_is_as_planned_at_every_stop_of_the_flight_and_free_at_its_end(solved, flown):
    guard, told = Guard(solved.mission, EXACT), {}
    longest = 0.0
    # every one of them: between two, a tether may slip off a bar
    for row in flown.log:
        report = guard.update(Fix(row.time, (row.x, row.y, row.z), estimate=True))
        for k, stop in enumerate(solved.tour.stops):
            if np.linalg.norm(np.array(report.position) - stop.path[-1]) <= 0.1:
                told.setdefault(k, []).append(report.as_planned)
        assert report.as_planned is not False
        assert not report.loops
        longest = max(longest, report.classes[0].taut)
        assert abs(report.classes[0].taut - row.tether) < 0.1
    assert sorted(told) == list(range(len(solved.tour.stops)))
    assert all(True in answers for answers in told.values())
    assert report.classes[0].word == guard.site.start_word()
    assert longest <= solved.mission.tether_length


def test_another_class_than_the_planned_one_is_told(solved):
    stop = solved.tour.stops[0]
    x, y, z = stop.path[-1]
    mission = solved.mission.model_copy(
        update={"tour": solved.tour.model_copy(update={
            "stops": (stop.model_copy(update={"signature": (1, 1)}), *solved.tour.stops[1:])
        })}
    )  # fmt: skip
    guard = Guard(mission, EXACT)
    for fix in along(mission.start, (x, y, z), (x, y, z)):
        report = guard.update(fix)
        if report.as_planned is False:
            break
    assert report.as_planned is False
    assert any(a.kind == "plan" for a in report.alarms)


def taut_along(site, *points):
    tether = site.context.start_tether
    for a, b in itertools.pairwise(points):
        for share in np.linspace(0.0, 1.0, 12)[1:]:
            there = np.array(a) + share * (np.array(b) - np.array(a))
            tether = site.model.update(tether, there)
    return tether


@pytest.mark.parametrize(
    ("way", "around"),
    [(BY_THE_PILE[:2], []), (BY_THE_PILE, []), (ROUND_THE_PILE, [(0,)]),
     (ROUND_THE_MOORING, [(1,)])],
)  # fmt: skip
def test_loops_are_what_a_tether_is_wound_around_bodies_with_free_ends_too(site, way, around):
    tether = taut_along(site, tuple(site.start), *way)
    assert [
        loop.around for loop in space_loops_in(site.field, site.model, tether.nodes, site.policy)
    ] == around


def test_a_loop_is_told_before_it_closes_and_is_gone_once_it_is_undone(mission, site):
    guard, first, closed = Guard(site, EXACT), None, None
    for fix in along(tuple(mission.start), *ROUND_THE_PILE, (0, 1.5, -2.2)):
        report = guard.update(fix)
        if first is None and report.loop_s is not None and report.loop_around == ("pile",):
            first = fix.time
        if closed is None and report.loops:
            closed = fix.time
    assert closed is not None
    assert first is not None
    assert first < closed
    back = [(0, 1.5, -2.2), *ROUND_THE_PILE[::-1][1:], tuple(mission.start)]
    for later in along(*back, t=fix.time + 0.2):
        report = guard.update(later)
    assert report.loops == ()
    assert report.classes[0].word == guard.site.start_word()


def test_a_robot_that_goes_straight_home_on_the_other_side_closes_a_loop(site):
    tether = taut_along(site, tuple(site.start), *BY_THE_PILE)
    assert (
        space_loop_closed_by(
            site.field, site.model, tether.nodes, np.array([-2.0, -1.0, -2.0]), site.policy
        )
        is None
    )
    assert (
        space_loop_closed_by(
            site.field, site.model, tether.nodes, np.array([-3.0, 0.6, -1.5]), site.policy
        )
        is not None
    )


def test_what_is_near_a_pile_is_in_doubt_and_what_is_far_from_all_is_not(mission, site):
    near, far = Guard(site), Guard(site)
    for fix in along(tuple(mission.start), (-1, 0.6, -2), (2, 0.2, -2), (4, 0, -1)):
        one = near.update(fix)
    for fix in along(tuple(mission.start), (-4.5, -4, -2), (-4, -5, -2)):
        other = far.update(fix)
    assert len(one.classes) > 1
    assert len(other.classes) == 1


def test_a_step_through_a_solid_has_no_word_and_none_is_sought(site, monkeypatch):
    """Walks along such steps took up to a second."""
    through = np.array([[(-0.6, 0.1, -2), (0.6, 0.0, -2)], [(0, 7, -1.5), (0, 7, -2.9)]])
    beside = np.array([[(-1, 0.6, -2), (1, 0.6, -2)], [(1, 0, -2), (1, -1, -2)]])
    words = site.letters.words_of_steps(*beside.swapaxes(0, 1))
    assert words == [site.context.words.word(step) for step in beside]
    monkeypatch.setattr(site.letters, "words", replace(site.context.words, labels=None))
    assert site.letters.words_of_steps(*through.swapaxes(0, 1)) == [None, None]


@pytest.mark.parametrize("every", [0.1, 0.2])
def test_the_operator_says_on_which_side_of_a_solid_the_tether_passes(mission, site, every):
    guard = Guard(site)
    way = [tuple(mission.start), (-1, 0.6, -2), (2, 0.2, -2), (3.5, 0, -1.5)]
    for fix in along(*way, every=every):
        guard.update(fix)
    words = {}
    for side, meant, opposite in (("north", "+y", "−y"), ("south", "−y", "+y")):
        guard.correct(side, "pile")
        words[side] = guard.report.classes[0].word
        for now in guard.report.classes:
            assert meant in now.passes
            assert opposite not in now.passes
    assert words["north"] != words["south"]
    with pytest.raises(InputError, match="obstacle: expected"):
        guard.correct("north", "nowhere")
    with pytest.raises(InputError, match="side: expected"):
        guard.correct("inside", "pile")


def test_the_operator_may_say_how_it_passes_a_body_with_free_ends(mission, site):
    guard = Guard(site, EXACT)
    under = [(-1, 0.9, -2), (3.5, 0.9, -4.2), (6.9, 0.1, -4.2), (6.9, 0.1, -2.6)]
    for fix in along(tuple(mission.start), *under):
        guard.update(fix)
    guard.correct("below", "mooring")
    hangs = guard.report.classes[0]
    assert "below mooring" in hangs.passes
    guard.correct("above", "mooring")
    over = guard.report.classes[0]
    assert "mooring" not in over.passes
    assert over.taut < hangs.taut
    assert over.word == hangs.word  # which sides of it words do not tell


def test_a_straight_tether_passes_a_solid_on_the_side_where_it_comes_nearest(site):
    nodes = np.array([(-5, 2, -1), (5, 2, -1.5)], dtype=float)
    assert site.passes_on_side(nodes, "north", "pile")
    assert not any(site.passes_on_side(nodes, side, "pile") for side in ("south", "east", "west"))


def test_the_class_outlives_a_restart(mission, site, tmp_path):
    guard = Guard(site, EXACT)
    for fix in along(tuple(mission.start), *BY_THE_PILE):
        report = guard.update(fix)
    save(guard, tmp_path / "state.json")
    again = Guard(SpaceSite(mission), EXACT)
    restore(again, tmp_path / "state.json")
    later = again.update(fix)
    assert later.classes[0].word == report.classes[0].word
    assert later.classes[0].taut == pytest.approx(report.classes[0].taut, abs=0.05)
    data = json.loads((tmp_path / "state.json").read_text())
    data["classes"][0]["word"] = [99]
    (tmp_path / "state.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match="classes: expected letters from 1 to"):
        restore(Guard(site, EXACT), tmp_path / "state.json")


def test_a_moving_anchor_is_refused(mission):
    moving = mission.model_copy(update={"track": ((0.0, (-5, 0.3, -1)), (9.0, (-4, 0.3, -1)))})
    with pytest.raises(InputError, match="track: a moving anchor"):
        SpaceSite(moving)


def test_the_page_shows_solids_from_above(site):
    with Page(site, 0) as page:
        shown = page.site_data()
    assert [o["name"] for o in shown["obstacles"]] == ["pile", "mooring", "ring"]
    assert shown["sides"] == ["+y", "+x", "−y", "−x", "above", "below"]


@pytest.mark.parametrize(
    ("solid", "size"),
    [({"sphere": {"center": [1, 2, 0], "radius": 2}}, (4, 4)),
     ({"capsule": {"a": [0, 0, 0], "b": [4, 0, -3], "radius": 1}}, (6, 2)),
     ({"cylinder": {"a": [0, 0, 0], "b": [0, 0, -3], "radius": 1}}, (2, 2)),
     ({"box": {"center": [0, 0, 0], "size": [4, 2, 1], "rotation": [0, 0, 90]}}, (2, 4)),
     ({"torus": {"center": [0, 0, 0], "axis": [0, 0, 1], "major_radius": 3, "minor_radius": 1}},
      (8, 8)),
     ({"post": {"center": [0, 0], "radius": 1}}, (2, 2)),
     ({"prism": {"polygon": [[0, 0], [3, 0], [3, 1]]}}, (3, 1))],
)  # fmt: skip
def test_silhouettes_are_as_wide_as_their_solids(solid, size):
    (rim,) = silhouette(Scene(solids=[solid]).solids[0].shape)
    assert np.ptp(rim, axis=0) == pytest.approx(size, rel=0.01)


def test_a_recording_of_a_mission_is_replayed_by_the_command(
    solved, flown, mission, tmp_path, capsys
):
    (tmp_path / "scene.json").write_text(mission.load_scene().model_dump_json(exclude_none=True))
    planned = solved.mission.model_copy(update={"scene": "scene.json"})
    (tmp_path / "planned.json").write_text(planned.model_dump_json(exclude_none=True))
    with open(tmp_path / "log.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t", "x", "y", "z"])
        rows.writerows([r.time, r.x, r.y, r.z] for r in flown.log[::3])
    code = main(
        ["guard", str(tmp_path / "planned.json"), "--replay", str(tmp_path / "log.csv"), "--quiet",
         "--noise", "0.05", "--drift", "0.05"]
    )  # fmt: skip
    told = json.loads(capsys.readouterr().out)
    assert code == 0
    assert told["tether_length"] == 22.0
