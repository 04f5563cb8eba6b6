"""Legs and states by words alone, beside those that driving the tether finds."""

import numpy as np
import pytest

from netsp.base.clock import Clock
from netsp.base.geometry import polylines
from netsp.plan.space.mission_policy import StatePolicy
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.space_legs import RobotPaths, StateGrowth
from netsp.plan.space.state_search import SearchRun, StateSearch
from netsp.plan.space.states import find_first_states
from netsp.world import Scene
from netsp.world.mission.mission import Mission

LIMIT = 8.9

POSTS = Scene(
    solids=[
        {"capsule": {"a": [x, y, -4.0], "b": [x, y, 4.0], "radius": 0.2}}
        for x, y in ((0.0, 0.7), (0.0, -0.7), (1.4, 0.0))
    ],
    bounds=(-3.0, -3.0, -2.0, 3.0, 3.0, 2.0),
)


@pytest.fixture(scope="module")
def among_posts() -> PlanningContext:
    mission = Mission(
        scene="-", anchor=(-2.0, 0.0, 0.0), start=(-2.0, 0.0, 0.0), tether_length=9.0,
        waypoints=[(0.7, 0.1, 0.3), (2.1, 0.4, -0.5), (0.1, 1.4, 0.2), (0.2, -1.5, 0.0)],
        clearance=0.2, cell=0.25,
    )  # fmt: skip
    return PlanningContext.for_mission(mission, POSTS, POSTS.field())


def grown(context: PlanningContext, *, by_words: bool, max_per_place: int) -> StateGrowth:
    places = Places.for_mission(context.mission, context.field)
    effort = StatePolicy().effort(len(places))
    states = find_first_states(context, places, LIMIT, effort, Clock())
    paths = RobotPaths(context, places, effort)
    paths.find_all(Clock(), lambda text: None)
    growth = StateGrowth(states, paths, by_words)
    assert growth.grow(max_per_place, Clock(), lambda text: None)
    return growth


def named_legs(growth: StateGrowth) -> dict[tuple, float]:
    """Lengths of the legs by the places and words at their ends."""
    entries = growth.states.entries
    named = {}
    for (v, w), path in growth.legs.arrives.items():
        ends = (entries[v].place, entries[v].word), (entries[w].place, entries[w].word)
        named[ends] = polylines.length(path)
    return named


def test_legs_by_words_are_those_that_driving_finds(among_posts):
    """Around posts through all depths words distinguish all tethers, so each driven leg arrives
    where its word says; by words there may be more, on which the tether is too long half-way."""
    driven = named_legs(grown(among_posts, by_words=False, max_per_place=30))
    by_words = named_legs(grown(among_posts, by_words=True, max_per_place=30))
    assert len(driven) > 40
    assert driven.keys() <= by_words.keys()
    assert all(by_words[ends] <= length + 1e-9 for ends, length in driven.items())


def test_no_tether_around_a_tour_is_too_long_and_no_state_is_there_twice(among_posts):
    growth = grown(among_posts, by_words=True, max_per_place=1)
    tour = [numbers[0] for numbers in growth.states.at_place.values() if numbers]
    before = len(growth.states.entries)
    count = growth.surround(tour, 1000, Clock())
    entries = growth.states.entries
    assert count > 0
    assert len(entries) == before + count
    assert max(state.tether.length for state in entries) <= LIMIT
    assert len({(state.place, state.word) for state in entries}) == len(entries)
    assert growth.surround(tour, 1000, Clock()) == 0


def test_states_around_a_tour_are_all_that_one_leg_leads_to(among_posts):
    growth = grown(among_posts, by_words=True, max_per_place=1)
    context, v = among_posts, growth.states.at_place[0][0]
    growth.surround([v], 1000, Clock())
    known = {(state.place, state.word) for state in growth.states.entries}
    state = growth.states.entries[v]
    for m in growth.paths.neighbours[state.place]:
        for word, path in growth.paths.between(state.place, int(m)):
            line = np.vstack([state.tether.nodes, path[1:]])
            if context.model.relaxed(line, 300).length <= LIMIT:
                assert (int(m), context.words.multiply(state.word, word)) in known


def test_each_tour_of_the_search_is_shorter_than_those_before(among_posts):
    options = {"solver": "auto", "seed": 0, "params": None, "iteration_limit": None}
    places = Places.for_mission(among_posts.mission, among_posts.field)
    search = StateSearch(SearchRun(among_posts, places, Clock(20), lambda text: None, options))
    search.connect()
    lengths = [driven.length for _, driven in search.tours_along_taut_legs()]
    assert search.growth.by_words
    assert lengths
    assert lengths == sorted(lengths, reverse=True)
    assert search.best[1].length == lengths[-1]
    assert search.best[1].free


def test_a_path_between_two_sides_of_a_plate_may_lead_over_any_of_its_rims():
    """The waypoints are 2 m apart and the plate 4 m across: the way over the far rim is thrice as
    long as the distance."""
    plate = Scene(
        solids=[{"box": {"center": [0.0, 0.0, 0.0], "size": [0.2, 4.0, 4.0]}}],
        bounds=(-4.0, -4.0, -4.0, 4.0, 4.0, 4.0),
    )
    mission = Mission(
        scene="-", anchor=(-2.0, 0.0, 3.0), start=(-2.0, 0.0, 3.0), tether_length=20.0,
        waypoints=[(-1.0, 0.3, 0.6), (1.0, 0.3, 0.6)], clearance=0.2, cell=0.25,
    )  # fmt: skip
    context = PlanningContext.for_mission(mission, plate, plate.field())
    places = Places.for_mission(mission, context.field)
    paths = RobotPaths(context, places, StatePolicy().effort(len(places)))
    paths.find_all(Clock(), lambda text: None)
    rims = {
        (axis, np.sign(path[k, axis]))
        for _, path in paths.between(0, 1)
        for axis in (1, 2)
        for k in range(len(path))
        if abs(path[k, axis]) > 2.0
    }
    assert rims == {(1, -1.0), (1, 1.0), (2, -1.0), (2, 1.0)}
