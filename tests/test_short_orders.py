"""Tours in short orders: shorter than a bad order of the file, and right by the judge."""

import numpy as np
import pytest

from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.plan.space.given_order import drive_given_order
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_policy import OrderPolicy
from netsp.plan.space.places import Places
from netsp.plan.space.short_orders import short_order_tour
from netsp.plan.space.space_plan import SHORT_ORDER, candidate_plans, prepare_context
from netsp.world import Scene
from netsp.world.mission.mission import Mission

BAR = Scene(
    bounds=[-5, -5, -3, 5, 5, 1],
    solids=[{"capsule": {"a": [-2, 0, -1], "b": [2, 0, -1], "radius": 0.4}}],
)
ROUND = [(4 * np.cos(t), 4 * np.sin(t), -1.0) for t in np.linspace(0, 2 * np.pi, 9)[:-1]]
BAD = (0, 4, 1, 5, 2, 6, 3, 7)


def mission(**more) -> Mission:
    return Mission.model_validate({
        "scene": "-", "anchor": (4.5, 0, 0), "start": (4.5, 0, 0), "tether_length": 14.0,
        "waypoints": [ROUND[k] for k in BAD], "clearance": 0.1, "cell": 0.5, **more,
    })  # fmt: skip


def best_of(made) -> tuple:
    return short_order_tour(made, Places.for_mission(made.mission, made.field), Clock())


def test_waypoints_in_a_bad_order_get_a_short_tour_that_the_judge_accepts():
    found = next(candidate_plans(mission(), scene=BAR, clock=Clock(20.0)))
    assert found.kind == SHORT_ORDER
    given = drive_given_order(found.context)
    assert sorted(found.order) == list(range(8))
    assert found.length < 0.6 * given.length
    assert verify_mission(found.to_mission(), scene=BAR, context=found.context)


def test_a_short_order_takes_one_alternative_of_each_waypoint_and_begins_at_the_state():
    near = {"position": (-4.5, 0, -1), "alternatives": [{"position": (3.5, 1.0, -1)}]}
    state = {"position": (3, 2, -1), "tether": [(4.5, 0, 0), (3, 2, -1)]}
    made = prepare_context(mission(waypoints=[near, (0, 3, -1)], state=state), Clock(), scene=BAR)
    found = best_of(made)
    assert sorted(stop.waypoint for stop in found.visits) == [0, 1]
    assert {stop.waypoint: stop.choice for stop in found.visits} == {0: 1, 1: 0}
    assert found.visits[0].path[0] == pytest.approx(state["position"])


def test_without_time_there_is_no_tour_and_bad_effort_is_refused():
    made = prepare_context(mission(), Clock(), scene=BAR)
    places = Places.for_mission(made.mission, made.field)
    assert short_order_tour(made, places, Clock(0.0)) is None
    with pytest.raises(InputError, match=r"blocked_ratio: 0\.5; expected 1 or more"):
        OrderPolicy(blocked_ratio=0.5)
