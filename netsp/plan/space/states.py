"""How a tether can come to lie when the robot is at a waypoint.

A state is a waypoint, a word, and the tether as it hangs: words alone do not tell all there is,
for tethers hang on bodies with free ends, which give no letters. The few shortest words of each
waypoint make the first states; others come of going on from these (`netsp.plan.space.space_legs`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import Water
from netsp.plan.space.space_signature import shown
from netsp.plan.space.word_search import Found
from netsp.world.tether import Tether

LONGER = 2.0
"""Ways of the robot are no longer than so many times the longest tether."""

ROUNDS = 300
"""Of pulling a tether taut."""


@dataclass(frozen=True)
class Effort:
    """How many states and legs are sought.

    Parameters
    ----------
    words : int
        Shortest words of a waypoint that make states.
    states : tuple of int
        States of a waypoint, at most: at first, and then ever more as long as there is time.
    ways : int
        Classes of ways between two waypoints.
    farther : float
        Ways are no longer than so many times the distance.
    detours : tuple of float
        How much longer detours are, as shares of the leg.
    sides : int
        Directions of detours, evenly around a leg.
    tethers : int
        Kept after each leg of an order that is driven with detours.
    """

    words: int
    states: tuple[int, ...]
    ways: int
    farther: float
    detours: tuple[float, ...]
    sides: int
    tethers: int

    @classmethod
    def of(cls, waypoints: int) -> Effort:
        """What takes no more than a minute or so on two cores.

        Parameters
        ----------
        waypoints : int
            How many there are.

        Returns
        -------
        Effort
            The fewer waypoints, the more for each.
        """
        if waypoints <= 24:
            # around a row of piles, a way is twice as long as the distance: tours were within
            # 0.03 % of the proven shortest among prisms with these (benchmarks/space.py)
            return cls(
                words=5,
                states=(7, 14, 28),
                ways=6,
                farther=2.2,
                detours=(0.02, 0.06, 0.15, 0.35),
                sides=8,
                tethers=8,
            )
        if waypoints <= 100:
            return cls(
                words=4,
                states=(5, 10, 16, 32),
                ways=4,
                farther=1.5,
                detours=(0.02, 0.1),
                sides=6,
                tethers=12,
            )
        return cls(
            words=3, states=(5, 10), ways=4, farther=1.5, detours=(0.02, 0.1), sides=6, tethers=4
        )


@dataclass(frozen=True)
class State:
    """A tether at a waypoint.

    Parameters
    ----------
    point : int
        The waypoint.
    word : int
        Number of the tether's word in the water's table.
    tether : Tether
        As it hangs.
    """

    point: int
    word: int
    tether: Tether


@dataclass
class States:
    """All states so far.

    Parameters
    ----------
    water : Water
        Where they are.
    places : Places
        The points; that of the mission's state has the one tether that hangs there now.
    limit : float
        Longest tether, metres.
    most : int
        States of a waypoint.
    """

    water: Water
    places: Places
    limit: float
    most: int
    all: list[State] = field(default_factory=list)
    of: dict[int, list[int]] = field(default_factory=dict)

    def find(self, point: int, word: int, tether: Tether) -> int | None:
        """The number of the state that a tether is in.

        Parameters
        ----------
        point : int
            The waypoint.
        word : int
            The tether's word.
        tether : Tether
            The tether.

        Returns
        -------
        int or None
            None where it is in none so far.
        """
        delta = self.water.mission.delta
        for s in self.of.get(point, ()):
            if self.all[s].word == word and alike(self.all[s].tether, tether, delta):
                return s
        return None

    def may_take(self, point: int, word: int) -> bool:
        """Whether a tether of a word may be in some state of a waypoint, or make a new one.

        Parameters
        ----------
        point : int
            The waypoint.
        word : int
            The tether's word.

        Returns
        -------
        bool
            Whether it may.
        """
        here = self.of.get(point, [])
        room = len(here) < self.most and point != self.places.begin
        return room or any(self.all[s].word == word for s in here)

    def add(self, point: int, word: int, tether: Tether) -> int | None:
        """A new state, if there is room for one more and the tether is no longer than its limit.

        Parameters
        ----------
        point : int
            The waypoint.
        word : int
            The tether's word.
        tether : Tether
            The tether.

        Returns
        -------
        int or None
            Its number, None if there is none.
        """
        here = self.of.setdefault(point, [])
        if (
            len(here) >= self.most
            or tether.length > self.limit
            or (point == self.places.begin and here)
        ):
            return None
        here.append(len(self.all))
        self.all.append(State(point, word, tether))
        return here[-1]

    @property
    def begin(self) -> int | None:
        """Number of the state that the mission begins in; None at the start."""
        return None if self.places.begin is None else self.of[self.places.begin][0]

    @property
    def hang_on_free_ends(self) -> bool:
        """Whether tethers of one word hang in several ways at some waypoint."""
        of_words = {(s.point, s.word) for s in self.all}
        return len(of_words) < len(self.all)

    @property
    def reached(self) -> set[int]:
        """The waypoints that have states; that of the mission's state counts as one more."""
        return {int(self.places.waypoint[n]) for n in self.of}


def alike(a: Tether, b: Tether, delta: float) -> bool:
    """Whether two tethers of one word between the same ends hang alike.

    Parameters
    ----------
    a : Tether
        One tether.
    b : Tether
        The other.
    delta : float
        Resolution of both, metres.

    Returns
    -------
    bool
        By length, and points at quarters of it.
    """
    if abs(a.length - b.length) > delta:
        return False
    one, other = (
        np.array([polylines.points_along(t.nodes, 0.25 * t.length + 1e-9)[k] for k in (1, 2)])
        if t.length > 1e-6
        else np.zeros((2, 3))
        for t in (a, b)
    )
    return bool(np.linalg.norm(one - other, axis=1).max() < 2.0 * delta)


def first_states(
    water: Water, places: Places, limit: float, effort: Effort, clock: Clock
) -> States:
    """States of the shortest words of each waypoint, and the one that the mission begins in.

    Parameters
    ----------
    water : Water
        Where they are.
    places : Places
        The points.
    limit : float
        Longest tether, metres.
    effort : Effort
        How many.
    clock : Clock
        When it is up, one for each of the waypoints that are left.

    Returns
    -------
    States
        The states; waypoints without any are out of reach of the tether.

    Raises
    ------
    InputError
        The tether of the mission's state has no word: says where.
    """
    states = States(water, places, limit, effort.states[0])
    words = water.words
    if places.begin is not None:
        number, where = words.number(water.present.nodes)
        if number is None:
            raise InputError(
                f"state.tether: no word at {shown(where)}: a gap narrower than the cell of "
                f"{words.cells.cell:g} m; expected a smaller cell"
            )
        states.add(places.begin, number, water.present)
    anchor = np.asarray(water.mission.anchor, dtype=float)[None]
    root = int(np.ravel_multi_index(tuple(words.root), words.cells.flags.shape))
    flag = clock.flag
    found = clock.interruptible(lambda: water.search(False, root, effort.words, limit, flag))
    for n in range(len(places)):
        _take(states, n, found, anchor, 1 if clock.up else effort.words)
    return states


def states_with_room(states: States, lacking: set[int], words: int, clock: Clock) -> None:
    """More states, along the robot's own shortest ways from the start: where it does not fit
    through the gaps that the shortest tethers go through.

    Parameters
    ----------
    states : States
        Those so far; more are added.
    lacking : set of int
        Waypoints that these are for.
    words : int
        Shortest words of a waypoint that make states.
    clock : Clock
        When it is up, there is only the soonest of each.
    """
    water = states.water
    start = water.words.held(water.laid.robot)
    if start is None:
        return
    flag, limit = clock.flag, LONGER * states.limit
    found = clock.interruptible(lambda: water.search(True, start, words, limit, flag))
    for n in np.flatnonzero(np.isin(states.places.waypoint, list(lacking))):
        _take(states, int(n), found, water.laid.nodes, 1 if clock.up else words)


def _take(states: States, n: int, found: Found, begin: Floats, most: int) -> None:
    """States of a place by the shortest ways found to it, which go on from a line."""
    water, words, point = states.water, states.water.words, states.places.points[n]
    cell = words.held(point)
    if cell is None or n == states.places.begin:
        return
    for _, way in water.ways(found, cell)[:most]:
        tether = water.model.relaxed(np.vstack([begin, way, point]), ROUNDS)
        if tether.length > states.limit:
            continue
        hangs = water.number(tether.nodes)
        if hangs is not None and states.find(n, hangs, tether) is None:
            states.add(n, hangs, tether)
