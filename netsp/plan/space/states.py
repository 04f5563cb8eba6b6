"""States of the tether with the robot at a waypoint.

A state is a place, a word, and the tether as it hangs. The word alone is not enough, because
tethers hang on bodies with free ends, which give no letters. The words with the shortest paths to
each place make the first states; others are found from these (`netsp.plan.space.space_legs`).
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
    """Tether at a place.

    Attributes
    ----------
    place
        Number of the place.
    word
        Number of the tether's word in the table of the context.
    tether
        The tether as it hangs.
    """

    place: int
    word: int
    tether: Tether


@dataclass
class States:
    """All states so far.

    Attributes
    ----------
    context
        Context of the mission.
    places
        Places of the robot. The place where the mission begins has only the present tether.
    limit
        Maximum length of a tether, metres.
    max_per_place
        Maximum number of states of a place.
    entries
        The states.
    at_place
        Numbers of the states of each place.
    from_start
        Numbers of the states that were found by a search from the start.
    """

    context: PlanningContext
    places: Places
    limit: float
    max_per_place: int
    entries: list[State] = field(default_factory=list)
    at_place: dict[int, list[int]] = field(default_factory=dict)
    from_start: set[int] = field(default_factory=set)

    def find(self, point: int, word: int, tether: Tether) -> int | None:
        """Return the number of the state that a tether is in; None if it is in none so far."""
        delta = self.context.mission.delta
        for s in self.at_place.get(point, ()):
            if self.entries[s].word == word and hang_alike(self.entries[s].tether, tether, delta):
                return s
        return None

    def can_hold(self, point: int, word: int) -> bool:
        """Return whether a tether of a word may be in a state of a place, or make a new one."""
        numbers = self.at_place.get(point, [])
        has_room = len(numbers) < self.max_per_place and point != self.places.present
        return has_room or any(self.entries[s].word == word for s in numbers)

    def add(self, point: int, word: int, tether: Tether, *, beyond_max: bool = False) -> int | None:
        """Add a state and return its number; None if the place has no room for another state, or
        the tether exceeds its limit.

        Parameters
        ----------
        beyond_max : bool
            Whether the place may get more states than the maximum.
        """
        numbers = self.at_place.setdefault(point, [])
        if (
            (len(numbers) >= self.max_per_place and not beyond_max)
            or tether.length > self.limit
            or (point == self.places.present and numbers)
        ):
            return None
        numbers.append(len(self.entries))
        self.entries.append(State(point, word, tether))
        return numbers[-1]

    @property
    def present(self) -> int | None:
        """Return the number of the state in which the mission begins; None at the start."""
        return None if self.places.present is None else self.at_place[self.places.present][0]

    @property
    def has_free_ends(self) -> bool:
        """Return whether tethers of one word hang in several ways at some place."""
        places_and_words = {(s.place, s.word) for s in self.entries}
        return len(places_and_words) < len(self.entries)

    @property
    def reached(self) -> set[int]:
        """Return the waypoints that have states; that of the mission's state counts as one more."""
        return {int(self.places.waypoint[n]) for n in self.at_place}


def hang_alike(a: Tether, b: Tether, delta: float) -> bool:
    """Return whether two tethers of one word between the same ends hang alike, by their lengths and
    by points at quarters of them, with a tolerance of a delta, metres."""
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
    """Return the states of the shortest words of each place, and the state in which the mission
    begins.

    Parameters
    ----------
    limit : float
        Maximum length of a tether, metres.
    clock : Clock
        When it is up, each remaining place gets one state.

    Returns
    -------
    States
        The states. Places without any are out of reach of the tether.

    Raises
    ------
    InputError
        The tether of the mission's state has no word; says where.
    """
    states = States(context, places, limit, effort.states[0])
    add_first_states(states, effort, clock)
    return states


def add_first_states(states: States, effort: StateEffort, clock: Clock) -> None:
    """Add the states that `find_first_states` returns, as far as they are not known."""
    context, places, limit = states.context, states.places, states.limit
    words = context.words
    if places.present is not None:
        number, last_point = words.word_number(context.present_tether.nodes)
        if number is None:
            raise InputError(
                f"state.tether: no word at {shown(last_point)}: a gap narrower than the cell of "
                f"{words.cells.cell:g} m; expected a smaller cell"
            )
        if not states.at_place.get(places.present):
            states.add(places.present, number, context.present_tether)
    anchor = np.asarray(context.mission.anchor, dtype=float)[None]
    root = int(np.ravel_multi_index(tuple(words.root), words.cells.flags.shape))
    flag = clock.flag
    found = clock.interruptible(
        lambda: context.search_words(False, root, effort.words, limit, flag)
    )
    for n in range(len(places)):
        _add_states(states, n, found, anchor, 1 if clock.is_up else effort.words)


def add_states_with_room(states: States, missing: set[int], words: int, clock: Clock) -> None:
    """Add states along the robot's own shortest paths from the start, for waypoints whose shortest
    tethers lead through gaps that are too narrow for the robot.

    Parameters
    ----------
    missing : set of int
        Numbers of the waypoints.
    words : int
        Maximum number of words of a place.
    clock : Clock
        When it is up, each place gets its first word only.
    """
    context = states.context
    start = context.words.visible_cell(context.start_tether.robot)
    if start is None:
        return
    flag, limit = clock.flag, context.policy.states.max_robot_ratio * states.limit
    found = clock.interruptible(lambda: context.search_words(True, start, words, limit, flag))
    for n in np.flatnonzero(np.isin(states.places.waypoint, list(missing))):
        _add_states(states, int(n), found, context.start_tether.nodes, 1 if clock.is_up else words)


def _add_states(states: States, n: int, found: WordSearch, line: Floats, max_states: int) -> None:
    """Add states of a place: those of the shortest paths found to it, each continuing a line."""
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
            # a search that is resumed may have filled the place with states of legs
            number = states.add(n, hanging_word, tether, beyond_max=True)
            if number is not None:
                states.from_start.add(number)
