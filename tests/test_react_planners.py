"""The planners of Amer et al. 2025 search pivots as the papers list it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.planner import PLANNERS, PlannerOptions, make_planner
from netsp.world.planner.pivots import Pivots
from netsp.world.planner.react_draft import DraftRule, ReactDraftPlanner, ReactThresholdsPlanner
from netsp.world.planner.react_planner import ReactPlanner
from netsp.world.simulator.mission_run import simulate

LIMIT = 10.0
POST = Scene(solids=[{"post": {"center": [0, 0], "radius": 0.5}}], bounds=(-4, -4, -1, 4, 4, 1))
ANGLES = math.pi + np.arange(1, 33) * math.pi / 8
TWO_TURNS = Mission(
    scene="-", anchor=(-2, 0, 0), start=(-2, 0.5, 0), clearance=0.2, tether_length=5.0,
    waypoints=[(1.2 * math.cos(a), 1.2 * math.sin(a), 0.0) for a in ANGLES],
)  # fmt: skip


class PivotsOfLengths:
    """Pivots on a line, whose tethers have given lengths; keeps which were asked for."""

    def __init__(self, lengths):
        self.lengths, self.asked = lengths, []
        self.points = np.column_stack([np.arange(len(lengths)), *2 * [np.zeros(len(lengths))]])

    def __len__(self):
        return len(self.lengths)

    def length(self, n):
        self.asked.append(n)
        return self.lengths[n]

    def path_back(self, n):
        return self.points[: n + 1]

    def onward(self, n):
        return np.vstack([self.points[n], [0.0, 1.0, 0.0]])


def planner_of(kind):
    """A planner that neither pulls nor refines its paths."""
    planner = object.__new__(kind)
    planner.mission = TWO_TURNS.model_copy(update={"tether_length": LIMIT})
    planner.rule, planner.index = DraftRule(), 0
    planner.pull_taut = planner.refined = lambda path: path
    return planner


lengths_of_tethers = st.lists(st.floats(0.5, 20.0) | st.just(math.inf), min_size=1, max_size=14)


@settings(max_examples=300, deadline=None)
@given(lengths_of_tethers)
def test_react_looks_at_no_pivot_beyond_the_first_that_is_feasible(lengths):
    pivots = PivotsOfLengths(lengths)
    path = planner_of(ReactPlanner).recovery(pivots)
    feasible = [n for n, length in enumerate(lengths) if length <= LIMIT]
    first = feasible[0] if feasible else len(lengths) - 1
    assert pivots.asked == list(range(first + 1))
    turns_at = feasible[0] if feasible else 0
    assert len(path) == turns_at + 1
    assert path[-1].tolist() == [0.0, 1.0, 0.0]


def listed(lengths):
    """The pivot i of the draft's Algorithm 2, written down line by line; None for the fallback."""
    count = len(lengths)

    def candidate(i):
        return lengths[count - 1 - i]

    previous = math.inf
    for i in range(count - 3, 2, -1):
        length = candidate(i)
        if length < LIMIT * 0.7 and length < previous * 0.65:
            return i
        previous = candidate(i - 3)
    return None


@settings(max_examples=300, deadline=None)
@given(lengths_of_tethers)
def test_the_drafts_planner_takes_the_pivot_that_its_listing_takes(lengths):
    path = planner_of(ReactDraftPlanner).found(PivotsOfLengths(lengths))
    i = listed(lengths)
    if i is None:
        assert path.tolist() == [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    else:
        assert path[-1, 0] == len(lengths) - 1 - (i + 2)


@settings(max_examples=300, deadline=None)
@given(lengths_of_tethers)
def test_the_thresholds_are_compared_with_the_pivot_three_nodes_nearer_to_the_anchor(lengths):
    path = planner_of(ReactThresholdsPlanner).recovery(PivotsOfLengths(lengths))
    further = [*lengths[3:], math.inf, math.inf, math.inf]
    taken = [
        n
        for n, (length, other) in enumerate(zip(lengths, further, strict=False))
        if length < 0.7 * LIMIT and length < 0.65 * other
    ]
    if taken:
        assert path.tolist() == [
            [k, 0.0, 0.0] for k in range(1, min(max(2, taken[0] - 1), taken[0] + 1))
        ]
    else:
        assert path.tolist() == [[0.0, 1.0, 0.0]]


def test_pivots_are_the_robot_to_the_anchor_and_simulate_a_tether_once():
    planner = make_planner_at_the_end(ReactPlanner)
    pivots = Pivots(planner, planner.tether_now)
    assert np.allclose(pivots.points[0], planner.tether_now.robot)
    assert np.allclose(pivots.points[-1], TWO_TURNS.anchor)
    gaps = np.linalg.norm(np.diff(pivots.points, axis=0), axis=1)
    assert gaps.max() <= 0.5 + 1e-9
    driven = []
    drive = planner.tethers.drive
    planner.tethers = type("Counting", (), {
        "start": planner.tethers.start,
        "drive": lambda _, *a: driven.append(1) or drive(*a),
    })()  # fmt: skip
    assert pivots.length(2) == pivots.length(2)
    assert len(driven) == 1


def make_planner_at_the_end(kind):
    """A planner whose tether lies once about the post."""
    kept = []
    options = PlannerOptions(pivot_spacing=0.5)
    simulate(
        TWO_TURNS.model_copy(update={"waypoints": TWO_TURNS.waypoints[:12]}), kind, scene=POST,
        options=options, on_step=lambda row, planner: kept.append(planner),
    )  # fmt: skip
    planner = kept[-1]
    a = np.linspace(math.pi, -0.9 * math.pi, 60)
    turn = np.column_stack([1.2 * np.cos(a), 1.2 * np.sin(a), 0 * a])
    planner.tether_now = planner.tethers.lay(np.vstack([[-2, 0, 0], turn]))
    planner.index = 3
    return planner


def test_the_drafts_planner_ends_over_the_limit_where_react_keeps_near_it():
    over = {
        name: simulate(TWO_TURNS, name, scene=POST).summary["exceedance_s"]
        for name in ("react", "react-draft", "none")
    }
    assert 0.0 < over["react"] < 5.0 < over["react-draft"]


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"max_share": 0.0}, "max_share: expected more than 0 and at most 1, got 0.0"),
        ({"max_gain": 1.1}, "max_gain: expected more than 0 and at most 1, got 1.1"),
        ({"max_gain": math.nan}, "max_gain: expected more than 0"),
        ({"neighbour": 0}, "neighbour: expected 1 or more, got 0"),
    ],
)
def test_a_rule_out_of_range_is_refused(fields, said):
    with pytest.raises(InputError, match=said):
        DraftRule(**fields)


@pytest.mark.parametrize("spacing", [0.0, -1.0, math.nan, math.inf])
def test_pivots_need_a_spacing(spacing):
    with pytest.raises(InputError, match="pivot_spacing: expected more than 0"):
        make_planner("react", None, None, None, None, PlannerOptions(pivot_spacing=spacing))


def test_each_of_the_papers_planners_has_a_name():
    assert {"react", "react-draft", "react-thresholds"} <= set(PLANNERS)
