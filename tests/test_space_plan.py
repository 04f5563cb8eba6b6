"""Tours in space: the fewest metres, a tether that fits, and nothing that is wound up."""

import dataclasses
import heapq
import itertools
import json
from types import SimpleNamespace

import numpy as np
import pytest

from netsp import Circle, Problem, solve
from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.command.main import main
from netsp.hsignature.wordtable import times, times_inverse
from netsp.plan.space.board import StateGraph
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_policy import PotentialPolicy, StageTimePolicy, StatePolicy
from netsp.plan.space.path_bound import LegBounds, bound_all_tours
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext, keeps_clearance
from netsp.plan.space.space_legs import DrivenLegs, RobotPaths
from netsp.plan.space.space_plan import plan
from netsp.plan.space.state_search import _best_driven
from netsp.plan.space.states import find_first_states
from netsp.plan.space.triangle_labels import (
    LENGTHS,
    STEPS,
    lower_end,
    nth_axis,
    staircase_order,
    step_axes,
)
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import scene_of
from netsp.world.simulator.surprises import SceneSurprises

POSTS = [
    Circle(center=(3.0, 0.4), radius=0.5),
    Circle(center=(5.0, -1.0), radius=0.5),
    Circle(center=(5.2, 1.6), radius=0.5),
]
ENOUGH_S = 8.0
"""Time limit of missions with a few waypoints, s; solvers without a proof use all that is left."""

GOALS = [(4.2, 2.2, -1.0), (6.3, 0.2, -1.5), (4.0, -1.5, -0.5), (6.0, 2.4, -1.0)]


def mission_of(problem, folder, **more):
    """The same in space: obstacles upright, grown by the clearance already."""
    (folder / "scene.json").write_text(scene_of(problem).model_dump_json(exclude_none=True))
    mission = {
        "schema_version": 1, "scene": "scene.json", "anchor": problem.base, "start": problem.base,
        "waypoints": [g.position for g in problem.goals], "clearance": 0.0,
        "tether_length": problem.tether_length / 0.99, **more,
    }  # fmt: skip
    file = folder / "mission.json"
    file.write_text(json.dumps(mission))
    return Mission.load(file)


@pytest.fixture(scope="module")
def posts(tmp_path_factory):
    problem = Problem(
        base=(0, 0, 0), goals=GOALS, obstacles=POSTS, tether_length=7.6, clearance=0.1
    )
    return problem, mission_of(problem, tmp_path_factory.mktemp("posts"))


@pytest.fixture(scope="module")
def planned(posts):
    return plan(posts[1], time_limit=ENOUGH_S)


def test_among_prisms_it_is_as_short_as_the_proven_optimum(posts, planned):
    problem, mission = posts
    found, best = planned, solve(problem)
    assert best.status.value == "optimal"
    assert found.length == pytest.approx(best.length, rel=2e-3)
    assert found.free
    assert sorted(found.order) == [0, 1, 2, 3]
    assert max(stop.longest_tether for stop in found.visits) <= mission.tether_length
    # and the tether is at every goal in the class that it has in the plane
    path, words = np.array(best.path), found.context.words
    for stop in found.visits:
        near = int(np.argmin(np.linalg.norm(path - problem.goals[stop.waypoint].position, axis=1)))
        assert words.word(path[: near + 1]) == stop.word


def test_a_shorter_tether_makes_another_tour_that_keeps_to_it(posts, tmp_path):
    problem, _ = posts
    least = max(v.tether_length for v in solve(problem).tour)
    shorter = problem.model_copy(update={"tether_length": least - 0.02})
    best = solve(shorter)
    found = plan(mission_of(shorter, tmp_path), time_limit=ENOUGH_S)
    assert found.length == pytest.approx(best.length, rel=2e-3)
    assert max(stop.longest_tether for stop in found.visits) <= shorter.tether_length + 0.02


def test_the_same_seed_gives_the_same_plan(beside_a_bar):
    one, other = beside_a_bar, plan(beside_a_bar.mission, scene=A_BAR, time_limit=None)
    assert one.order == other.order
    assert one.length == other.length
    assert [s.word for s in one.visits] == [s.word for s in other.visits]


def test_every_stop_has_the_word_of_the_way_to_it(planned):
    found = planned
    words = found.context.words
    walked = [np.asarray(found.mission.anchor, dtype=float)[None]]
    for stop in found.visits:
        walked.append(stop.path)
        assert words.word(np.vstack(walked)) == stop.word
    walked.append(found.home)
    assert words.word(np.vstack(walked)) == ()


def test_what_the_tether_does_not_reach_is_told(posts, tmp_path):
    problem, _ = posts
    far = problem.model_copy(update={"tether_length": 5.5})
    found = plan(mission_of(far, tmp_path), time_limit=ENOUGH_S)
    assert set(found.unreached) | set(found.order) == {0, 1, 2, 3}
    assert found.unreached
    with pytest.raises(InputError, match="no tether within the limit reaches"):
        plan(mission_of(problem.model_copy(update={"tether_length": 1.0}), tmp_path))
    moving = mission_of(problem, tmp_path, track=[[10.0, 1.0, 0.0, 0.0]])
    with pytest.raises(InputError, match="track: a moving anchor"):
        plan(moving)


def test_a_search_finds_the_shortest_words_of_each_cell(tmp_path):
    """Beside a search that keeps every word, and takes every step."""
    solids = [{"capsule": {"a": [2.0, 2.0, -9], "b": [2.0, 2.0, 9], "radius": 0.3}},
              {"capsule": {"a": [-9, 3.2, 1.5], "b": [9, 3.2, 1.5], "radius": 0.3}}]  # fmt: skip
    bounds = [0, 0, 0, 4.0, 4.4, 2.4]
    (tmp_path / "s.json").write_text(Scene(solids=solids, bounds=bounds).model_dump_json())
    file = tmp_path / "m.json"
    file.write_text(json.dumps({
        "schema_version": 1, "scene": "s.json", "anchor": [0.6, 0.6, 0.6], "start": [0.6, 0.6, 0.6],
        "waypoints": [[3.4, 3.8, 1]], "tether_length": 20, "cell": 0.4, "clearance": 0.1,
    }))  # fmt: skip
    mission = Mission.load(file)
    scene = mission.load_scene()
    context = PlanningContext.for_mission(mission, scene, scene.field())
    words, most, longest = context.words, 2, 4.8
    root = int(np.ravel_multi_index(tuple(words.root), words.cells.flags.shape))
    found = context.search_words(False, root, most, longest)
    limit = int(100 * 1.35 * longest / 0.4)
    _, ny, nz = words.cells.flags.shape
    kept: dict[tuple[int, int], int] = {(root, 0): 0}
    queue = [(0, root, 0)]
    while queue:
        far, cell, word = heapq.heappop(queue)
        if kept[cell, word] < far:
            continue
        i, j, k = np.unravel_index(cell, words.cells.flags.shape)
        for s, step in enumerate(STEPS):
            order = staircase_order(words.cells.flags, i, j, k, s)
            there = far + int(LENGTHS[s])
            if order < 0 or there > limit:
                continue
            at, new, table = cell, word, words.table
            n, a, b, c = step_axes(s)
            for m in range(n):
                axis = nth_axis(n, a, b, c, order, m)
                label = words.labels[3 * lower_end(at, axis, step[axis], ny, nz) + axis]
                by = times if step[axis] > 0 else times_inverse
                new, table = by(table, words.rules, new, label)
                words.keep_table(table)
                at += step[axis] * (ny * nz, nz, 1)[axis]
            if there < kept.get((int(at), int(new)), limit + 1):
                kept[int(at), int(new)] = there
                heapq.heappush(queue, (there, int(at), int(new)))
    each: dict[int, list[int]] = {}
    for (cell, _), far in kept.items():
        each.setdefault(cell, []).append(far)
    assert max(map(len, each.values())) > most
    for cell, lengths in each.items():
        place = np.unravel_index(cell, words.cells.flags.shape)
        has = found.word[place] >= 0
        assert sorted(found.far[place][has].tolist()) == sorted(lengths)[:most]
        assert len(set(found.word[place][has].tolist())) == has.sum()


# what a reviewer found


BOX = Scene(
    solids=[{"box": {"center": [0, 0, 0], "size": [2, 2, 2]}}], bounds=[-6, -6, -6, 6, 6, 6]
)


def about_a_box(**more) -> Mission:
    return Mission(
        scene="-",
        anchor=(-5, 0, 0),
        start=(-5, 0, 0),
        waypoints=[(3, 0, 0.2)],
        tether_length=20.0,
        **more,
    )


def test_a_tour_with_no_clearance_goes_round_a_solid_and_not_through_it():
    planned = plan(about_a_box(clearance=0.0), scene=BOX, time_limit=20).to_mission()
    verdict = verify_mission(planned, scene=BOX)
    assert verdict, str(verdict)


@pytest.fixture(scope="module")
def around_the_box():
    return plan(about_a_box(clearance=0.2), scene=BOX, time_limit=20)


def test_a_tour_that_leaves_the_scene_is_not_verified_and_one_far_off_is_told_at_once(
    around_the_box,
):
    planned = around_the_box.to_mission()
    for beyond in ((-7.0, 0.0, 0.0), (0.0, 0.0, -1e9)):
        home = (planned.tour.home[0], beyond, *planned.tour.home[1:])
        tour = planned.tour.model_copy(update={"home": home}).without_bounds()
        failed = [
            c.name
            for c in verify_mission(planned.model_copy(update={"tour": tour}), scene=BOX).checks
            if not c.passed
        ]
        assert failed == ["within the scene and the tether"]


def test_two_stops_cannot_be_the_same_waypoint_of_the_file():
    mission = about_a_box(clearance=0.2).model_copy(
        update={"waypoints": Mission(
            scene="-", anchor=(0, 0, 0), start=(0, 0, 0), waypoints=[(3, 0, 0.2), (3, 2, 0)],
            tether_length=9,
        ).waypoints}
    )  # fmt: skip
    planned = plan(mission, scene=BOX, time_limit=20).to_mission()
    stops = tuple(s.model_copy(update={"given_as": 7}) for s in planned.tour.stops)
    lied = planned.model_copy(update={"tour": planned.tour.model_copy(update={"stops": stops})})
    assert not verify_mission(lied, scene=BOX)


def test_a_tether_too_short_for_the_start_is_told_before_anything_is_sought():
    mission = about_a_box(clearance=0.2).model_copy(
        update={"start": (5.0, 0.0, 0.0), "tether_length": 6.0}
    )
    with pytest.raises(InputError, match="tether_length: 6 is shorter than the path"):
        plan(mission, scene=BOX, time_limit=20)


def test_surprises_that_cannot_be_are_refused_before_the_flight():
    mission, field = about_a_box(clearance=0.2), BOX.field()
    for event, field_name in (
        ({"add_waypoint": [0, 0, 0]}, "add_waypoint"),
        ({"add_waypoint": [0, 0, 30]}, "add_waypoint"),
        ({"push": [1e9, 0, 0]}, "push"),
    ):
        told = {"schema_version": 1, "events": [{"time": 1.0, **event}]}
        surprises = SceneSurprises.model_validate(told)
        with pytest.raises(InputError, match=rf"events\[0\].{field_name}"):
            surprises.check_places(mission, BOX, field)


def test_a_flight_is_not_written_over_its_mission(around_the_box, tmp_path):
    planned = around_the_box.to_mission()
    (tmp_path / "scene.json").write_text(BOX.model_dump_json(exclude_none=True))
    data = {**planned.model_dump(mode="json", exclude_none=True), "scene": "scene.json"}
    file = tmp_path / "mission.json"
    file.write_text(json.dumps(data))
    assert main(["execute", str(file), "-o", str(tmp_path), "--quiet"]) == 2
    assert json.loads(file.read_text()) == data


@pytest.mark.parametrize(
    ("right", "wrong"), [("waypoints", "waipoints"), ("anchor", "ancor")]
)  # fmt: skip
def test_a_mission_with_a_field_misspelt_is_read_as_a_mission(right, wrong, tmp_path, capsys):
    data = about_a_box().model_dump(mode="json", exclude_none=True)
    data[wrong] = data.pop(right)
    file = tmp_path / "mission.json"
    file.write_text(json.dumps(data))
    for command in ("solve", "verify", "execute", "order"):
        assert main([command, str(file)]) == 2
        told = capsys.readouterr().err
        assert f"{right}: missing" in told
        assert wrong in told


def test_a_bound_on_all_tours_is_found_among_classes_of_which_some_are_not_found(around_the_box):
    found = around_the_box
    for seconds in (0.05, 2.0):
        bound = bound_all_tours(found.paths, sorted(found.order), Clock(seconds))
        assert bound is None or bound <= found.length * 1.001


def free_bar() -> tuple[PlanningContext, Places]:
    """Water about a bar with free ends, and two waypoints beyond it."""
    bar = {"capsule": {"a": [0, -3, 0], "b": [0, 3, 0], "radius": 0.3}}
    scene = Scene(solids=[bar], bounds=[-6, -6, -6, 6, 6, 6])
    mission = Mission(
        scene="-", anchor=(-4, 0, -0.5), start=(-4, 0, -0.5),
        waypoints=[(2, 0, -0.5), (2, 1, -0.5)], tether_length=20.0, clearance=0.2,
    )  # fmt: skip
    field = scene.field()
    return PlanningContext.for_mission(mission, scene, field), Places.for_mission(mission, field)


BESIDE_A_BAR = {
    "schema_version": 1, "scene": "scene.json", "anchor": [-4, 0, -1], "start": [-4, 0, -1],
    "waypoints": [[2, 0, -1], [2, 0, 2]], "tether_length": 12.0, "clearance": 0.2,
}  # fmt: skip
A_BAR = Scene(
    solids=[{"capsule": {"a": [0, -3, 0], "b": [0, 0.5, 0], "radius": 0.15}}],
    bounds=[-6, -6, -6, 6, 6, 6],
)


@pytest.mark.usefixtures("few_cells")
def test_a_tour_with_detours_is_told_as_one(tmp_path, capsys):
    (tmp_path / "scene.json").write_text(A_BAR.model_dump_json(exclude_none=True))
    file, out = tmp_path / "mission.json", tmp_path / "planned.json"
    file.write_text(json.dumps(BESIDE_A_BAR))
    assert main(["solve", str(file), "--time-limit", "30", "-o", str(out)]) == 0
    told = capsys.readouterr().err
    assert "with detours past what it would hang on" in told
    tour = json.loads(out.read_text())["tour"]
    assert (tour["status"], tour.get("lower_bound")) == ("feasible", None)
    assert main(["verify", str(out)]) == 0


@pytest.fixture(scope="module")
def beside_a_bar():
    return plan(Mission.model_validate(BESIDE_A_BAR), scene=A_BAR, time_limit=None)


def test_a_detour_past_the_free_end_of_a_bar_saves_the_way_back_around_it(
    beside_a_bar, monkeypatch
):
    found = beside_a_bar
    assert verify_mission(found.to_mission(), scene=A_BAR)
    monkeypatch.setattr("netsp.plan.space.state_search.Detours.shorten", lambda *_: None)
    taut = plan(found.mission, scene=A_BAR, time_limit=None)
    assert taut.result.status.value == "optimal_of_states"
    assert found.length < taut.length - 0.1


def test_a_leg_that_arrives_in_one_direction_only_is_gone_in_that_direction():
    context, places = free_bar()
    states = find_first_states(context, places, 19.8, StatePolicy().effort(2), Clock())
    a, b = states.at_place[0][0], states.at_place[1][0]
    line = places.points[[0, 1]]
    for v, w, path in ((a, b, line), (b, a, line[::-1])):
        board = StateGraph(context, states)
        board.update(DrivenLegs({(v, w): path}), Clock())
        assert list(board.legs) == [(min(a, b), max(a, b))]
        for tour in ([a, b], [b, a]):
            driven = board.drive(tour)
            assert driven.fault is None
            assert driven.tour == [v, w]


def test_a_tour_whose_only_way_is_forbidden_when_the_time_is_up_is_not_driven_again(monkeypatch):
    context, places = free_bar()
    states = find_first_states(context, places, 19.8, StatePolicy().effort(2), Clock())
    a, b = states.at_place[0][0], states.at_place[1][0]
    own_way, driven = StateGraph._path_along_tether, StateGraph.drive
    # the robot gets to b by way of a alone, and whatever is driven is at fault on that leg
    monkeypatch.setattr(
        StateGraph, "_path_along_tether", lambda self, v: own_way(self, v) if v == a else None
    )
    monkeypatch.setattr(
        StateGraph, "drive",
        lambda self, tour: dataclasses.replace(driven(self, tour), fault=(min(a, b), max(a, b))),
    )  # fmt: skip
    board = StateGraph(context, states)
    line = places.points[[0, 1]]
    board.update(DrivenLegs({(a, b): line, (b, a): line[::-1]}), Clock())
    assert board.can_reach_all([a, b])
    run = SimpleNamespace(on_progress=lambda _: None, times=StageTimePolicy())
    search = SimpleNamespace(board=board, run=run, best=None)
    assert _best_driven(search, Clock(0.0), 1.0, {"seed": 0}) is None
    assert board.can_reach_all([a])
    assert not board.can_reach_all([a, b])


def test_ways_made_of_tethers_are_ways_of_their_words_and_no_bound_exceeds_them(posts):
    _, mission = posts
    scene = mission.load_scene()
    field = scene.field()
    context, places = (
        PlanningContext.for_mission(mission, scene, field),
        Places.for_mission(mission, field),
    )
    effort = StatePolicy().effort(len(places))
    states = find_first_states(context, places, mission.tether_length, effort, Clock())
    tethers = {n: [states.entries[s].tether.nodes for s in of] for n, of in states.at_place.items()}
    ways = RobotPaths(context, places, effort, tethers)
    made = 0
    for n in range(len(places)):
        ways.find_from(n, search=False)
    legs = LegBounds(ways, list(range(len(places))), PotentialPolicy(max_cells=15_000))
    for u, v in itertools.combinations(range(1, len(legs.points)), 2):
        legs.raise_bound(u, v, Clock())
    for n, m in itertools.permutations(range(len(places)), 2):
        for word, path in ways.between(n, m):
            assert context.word_number(path) == word
            assert keeps_clearance(field, path, mission)
            made += len(path) > 2
        lengths = [polylines.length(path) for _, path in ways.between(n, m)]
        assert all(length >= legs.costs[n + 1, m + 1] - 1e-6 for length in lengths)
    assert made
