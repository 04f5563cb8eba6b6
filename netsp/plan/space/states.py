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
from netsp.plan.space.mission_policy import StateEffort
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.space_signature import shown
from netsp.plan.space.word_search import WordSearch
from netsp.world.tether import Tether


@dataclass(frozen=True)
class State:
    """A tether at a waypoint.

    Parameters
    ----------
    place : int
        The waypoint.
    word : int
        Number of the tether's word in the water's table.
    tether : Tether
        As it hangs.
    """

    place: int
    word: int
    tether: Tether


@dataclass
class States:
    """All states so far.

    Parameters
    ----------
    context : PlanningContext
        Where they are.
    places : Places
        The points; that of the mission's state has the one tether that hangs there now.
    limit : float
        Longest tether, metres.
    max_per_place : int
        States of a waypoint.
    """

    context: PlanningContext
    places: Places
    limit: float
    max_per_place: int
    entries: list[State] = field(default_factory=list)
    at_place: dict[int, list[int]] = field(default_factory=dict)

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
        delta = self.context.mission.delta
        for s in self.at_place.get(point, ()):
            if self.entries[s].word == word and hang_alike(self.entries[s].tether, tether, delta):
                return s
        return None

    def can_hold(self, point: int, word: int) -> bool:
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
        numbers = self.at_place.get(point, [])
        has_room = len(numbers) < self.max_per_place and point != self.places.present
        return has_room or any(self.entries[s].word == word for s in numbers)

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
        numbers = self.at_place.setdefault(point, [])
        if (
            len(numbers) >= self.max_per_place
            or tether.length > self.limit
            or (point == self.places.present and numbers)
        ):
            return None
        numbers.append(len(self.entries))
        self.entries.append(State(point, word, tether))
        return numbers[-1]

    @property
    def present(self) -> int | None:
        """Number of the state that the mission begins in; None at the start."""
        return None if self.places.present is None else self.at_place[self.places.present][0]

    @property
    def has_free_ends(self) -> bool:
        """Whether tethers of one word hang in several ways at some waypoint."""
        of_words = {(s.place, s.word) for s in self.entries}
        return len(of_words) < len(self.entries)

    @property
    def reached(self) -> set[int]:
        """The waypoints that have states; that of the mission's state counts as one more."""
        return {int(self.places.waypoint[n]) for n in self.at_place}


def hang_alike(a: Tether, b: Tether, delta: float) -> bool:
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
    points_a, points_b = (
        np.array([polylines.points_along(t.nodes, 0.25 * t.length + 1e-9)[k] for k in (1, 2)])
        if t.length > 1e-6
        else np.zeros((2, 3))
        for t in (a, b)
    )
    return bool(np.linalg.norm(points_a - points_b, axis=1).max() < 2.0 * delta)


def find_first_states(
    context: PlanningContext, places: Places, limit: float, effort: StateEffort, clock: Clock
) -> States:
    """States of the shortest words of each waypoint, and the one that the mission begins in.

    Parameters
    ----------
    context : PlanningContext
        Where they are.
    places : Places
        The points.
    limit : float
        Longest tether, metres.
    effort : StateEffort
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
    states = States(context, places, limit, effort.states[0])
    words = context.words
    if places.present is not None:
        number, last_point = words.word_number(context.present_tether.nodes)
        if number is None:
            raise InputError(
                f"state.tether: no word at {shown(last_point)}: a gap narrower than the cell of "
                f"{words.cells.cell:g} m; expected a smaller cell"
            )
        states.add(places.present, number, context.present_tether)
    anchor = np.asarray(context.mission.anchor, dtype=float)[None]
    root = int(np.ravel_multi_index(tuple(words.root), words.cells.flags.shape))
    flag = clock.flag
    found = clock.interruptible(
        lambda: context.search_words(False, root, effort.words, limit, flag)
    )
    for n in range(len(places)):
        _add_states(states, n, found, anchor, 1 if clock.up else effort.words)
    return states


def add_states_with_room(states: States, missing: set[int], words: int, clock: Clock) -> None:
    """More states, along the robot's own shortest ways from the start: where it does not fit
    through the gaps that the shortest tethers go through.

    Parameters
    ----------
    states : States
        Those so far; more are added.
    missing : set of int
        Waypoints that these are for.
    words : int
        Shortest words of a waypoint that make states.
    clock : Clock
        When it is up, there is only the soonest of each.
    """
    context = states.context
    start = context.words.visible_cell(context.start_tether.robot)
    if start is None:
        return
    flag, limit = clock.flag, context.policy.states.max_robot_ratio * states.limit
    found = clock.interruptible(lambda: context.search_words(True, start, words, limit, flag))
    for n in np.flatnonzero(np.isin(states.places.waypoint, list(missing))):
        _add_states(states, int(n), found, context.start_tether.nodes, 1 if clock.up else words)


def _add_states(states: States, n: int, found: WordSearch, line: Floats, max_states: int) -> None:
    """States of a place by the shortest ways found to it, which go on from a line."""
    context, words, point = states.context, states.context.words, states.places.points[n]
    cell = words.visible_cell(point)
    if cell is None or n == states.places.present:
        return
    for _, path in context.paths_to(found, cell)[:max_states]:
        tether = context.model.relaxed(
            np.vstack([line, path, point]), context.policy.states.max_pull_rounds
        )
        if tether.length > states.limit:
            continue
        hanging_word = context.word_number(tether.nodes)
        if hanging_word is not None and states.find(n, hanging_word, tether) is None:
            states.add(n, hanging_word, tether)
