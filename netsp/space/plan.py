"""NE-TSP in space: the shortest tour through a mission's waypoints that the tether allows.

Offline, a goal and the class of its tether make one vertex, and legs belong to classes, so that no
tour can wind the tether up. The same here, where states take the place of classes
(`netsp.space.states`), and legs are those that the tether model was driven along
(`netsp.space.legs`); between any two states there is also the way back along one tether and out
along the other. The travel graph is solved like any other, and the whole tour is driven. Where the
tether gets too long on the way, or does not arrive in the state that was meant, that leg is
forbidden and the graph is solved again: no tour is believed that was not driven without fault.

Status and bound of the result are about these states and legs, less those forbidden, and not about
all tours there are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from netsp.arrays import Floats
from netsp.clock import Clock
from netsp.errors import InputError, LimitReachedError
from netsp.online.mission import Mission
from netsp.online.scene.field import DistanceField
from netsp.online.simulate import first_tether, grid_of
from netsp.online.tether import Tether
from netsp.solvers.solve import solve_graph
from netsp.space.legs import Legs, Ways, grown
from netsp.space.states import Effort, States, alike, first_states
from netsp.space.water import Water, along
from netsp.travel.graph import TravelGraph
from netsp.travel.result import Result

SHARE = 0.99
"""Of the tether that states and legs may need: the rest is for how the robot is steered."""

MOST_AGAIN = 20
"""Times that a graph is solved again because legs were at fault."""


@dataclass(frozen=True)
class Stop:
    """A waypoint of a plan.

    Parameters
    ----------
    point : int
        The waypoint.
    word : tuple of int
        Word of the tether there.
    tether : float
        Metres of tether there.
    path : ndarray, shape (k, 3)
        How the robot gets there from the stop before, metres.
    most : float
        Metres of tether on the way, at most.
    """

    point: int
    word: tuple[int, ...]
    tether: float
    path: Floats
    most: float


@dataclass(frozen=True)
class SpacePlan:
    """A tour of a mission's waypoints.

    Parameters
    ----------
    mission : Mission
        What was planned.
    stops : tuple of Stop
        In the order of the tour.
    home : ndarray, shape (k, 3)
        From the last stop back to the start, metres.
    length : float
        Of the tour, metres.
    result : Result
        Of the solver: its status, bound and gap are about the states and legs that were found.
    states : int
        How many there were to choose from.
    legs : int
        How many of them were driven.
    unreached : tuple of int
        Waypoints that no tether within the limit was found to.
    free : bool
        Whether the tether was as at the start when the whole tour was driven.
    water : Water
        With the words.
    """

    mission: Mission
    stops: tuple[Stop, ...]
    home: Floats
    length: float
    result: Result
    states: int
    legs: int
    unreached: tuple[int, ...]
    free: bool
    water: Water

    @property
    def order(self) -> tuple[int, ...]:
        """The waypoints' numbers in the order of the tour."""
        return tuple(stop.point for stop in self.stops)


def plan(
    mission: Mission,
    *,
    field: DistanceField | None = None,
    solver: str = "auto",
    time_limit: float | None = 60.0,
    seed: int = 0,
    on_progress: Callable[[str], None] | None = None,
) -> SpacePlan:
    """Find the shortest tour of a mission's waypoints that leaves the tether free.

    Parameters
    ----------
    mission : Mission
        The mission; the order of its waypoints does not count.
    field : DistanceField, optional
        Its scene, where it is built already.
    solver : str
        Name of a solver.
    time_limit : float, optional
        Seconds of the solver.
    seed : int
        Of the solver.
    on_progress : callable, optional
        Called with a line of text now and then.

    Returns
    -------
    SpacePlan
        The tour.

    Raises
    ------
    InputError
        A moving anchor; waypoints in solids; no tether that reaches any of them; as of
        `netsp.space.signature.SpaceSignature`.
    LimitReachedError
        No tour was found in time whose tether stays within its limit all along.
    """
    if mission.track:
        raise InputError("track: a moving anchor has no one best order; expected a mission without")
    tell = on_progress or (lambda _: None)
    scene = mission.load_scene()
    field = field or scene.field()
    mission = mission.checked_waypoints(field)
    grid = grid_of(mission, scene, field)
    tell("words")
    water = Water.of(mission, field, grid)
    points, limit = mission.places, SHARE * mission.tether_length
    tell("states")
    effort = Effort.of(len(points))
    states = first_states(water, points, limit, effort)
    if not states.all:
        raise InputError("waypoints: no tether within the limit reaches any of them")
    tell("ways")
    ways = Ways(water, points, effort)
    for n in range(len(points)):
        ways.prepare(n)
    tell("legs")
    legs = grown(states, ways)
    start = first_tether(mission, field, water.model, grid)
    board = _Board.of(water, states, legs, start)
    clock = Clock.of(time_limit)
    found: tuple[Result, _Driven] | None = None
    for again in range(MOST_AGAIN):
        tell("order" if again == 0 else f"order, again without {again} legs")
        result = board.solved(solver, clock, seed)
        if result is None or result.tour is None:
            break
        driven = board.driven([int(v) for v in result.tour[1:]])
        if driven.fault is None:
            found = result, driven
            break
        board.forbid(driven.fault)
    if found is None:
        raise LimitReachedError(
            "waypoints: no tour was found whose tether stays within the limit all along"
        )
    result, driven = found
    reached = set(states.of)
    return SpacePlan(
        mission, tuple(driven.stops), driven.home, driven.length, result, len(states.all),
        len(board.legs),
        tuple(n for n in range(len(points)) if n not in reached), driven.free, water,
    )  # fmt: skip


@dataclass
class _Driven:
    """What came of driving a tour."""

    stops: list[Stop]
    home: Floats
    length: float
    free: bool
    fault: tuple[int, int] | None


@dataclass
class _Board:
    """States, legs, and ways by way of the start."""

    water: Water
    states: States
    legs: dict[tuple[int, int], Floats]
    out: list[Floats]
    start: Tether
    cluster: list[int]
    cut: set[tuple[int, int]]

    @classmethod
    def of(cls, water: Water, states: States, legs: Legs, start: Tether) -> _Board:
        """Put together; paths from the start run along its tether and out along another."""
        out = [water.taut(np.vstack([start.nodes[::-1], s.tether.nodes[1:]])) for s in states.all]
        reached = sorted(states.of)
        cluster = [0, *(1 + reached.index(s.point) for s in states.all)]
        both = {
            (v, w): path for v, w, path in legs.both_ways()
            if along(path) < along(out[v]) + along(out[w])
        }  # fmt: skip
        return cls(water, states, both, out, start, cluster, set())

    def path(self, v: int, w: int) -> Floats:
        """From one state to another; -1 is the start."""
        if v < 0:
            return self.out[w]
        if w < 0:
            return self.out[v][::-1]
        direct = self.legs.get((min(v, w), max(v, w)))
        if direct is None:
            return np.vstack([self.out[v][::-1], self.out[w][1:]])
        return direct if v < w else direct[::-1]

    def forbid(self, pair: tuple[int, int]) -> None:
        """Take the leg between two states away, or if it was by way of the start, that."""
        if self.legs.pop(pair, None) is None:
            self.cut.add(pair)

    def solved(self, solver: str, clock: Clock, seed: int) -> Result | None:
        """The graph as it is now, solved; None where too much was forbidden for any tour."""
        home = np.array([along(p) for p in self.out])
        n = len(home)
        costs = np.zeros((n + 1, n + 1))
        costs[1:, 1:] = home[:, None] + home[None, :]
        costs[0, 1:] = costs[1:, 0] = home
        for (v, w), path in self.legs.items():
            costs[v + 1, w + 1] = costs[w + 1, v + 1] = along(path)
        for v, w in self.cut:
            costs[v + 1, w + 1] = costs[w + 1, v + 1] = np.inf
        try:
            graph = TravelGraph.from_costs(costs, self.cluster)
        except InputError:  # some waypoint is joined to nothing any more
            return None
        return solve_graph(graph, solver, time_limit=clock, seed=seed)

    def driven(self, tour: list[int]) -> _Driven:
        """A tour, driven with the tether it begins with."""
        states, water = self.states, self.water
        tether, before = self.start, -1
        stops: list[Stop] = []
        total, fault = 0.0, None
        delta = water.mission.delta
        for vertex in [*tour, 0]:
            state = vertex - 1
            path = self.path(before, state)
            tether, lengths = water.model.drive(tether, path[1:])
            total += along(path)
            meant = self.start if state < 0 else states.all[state].tether
            if fault is None and (
                lengths.max() > states.limit or not alike(tether, meant, delta)
            ):  # fmt: skip
                fault = (min(before, state), max(before, state))
            if state >= 0:
                s = states.all[state]
                stops.append(
                    Stop(s.point, self._word(s.word), tether.length, path, float(lengths.max()))
                )
            before = state
        return _Driven(stops, path, total, alike(tether, self.start, delta), fault)

    def _word(self, number: int) -> tuple[int, ...]:
        return self.water.words.letters(number)
