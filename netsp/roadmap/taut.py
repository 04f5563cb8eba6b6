"""Exact roadmap: every taut class of every goal, and the exact length of every leg.

Facts used (docs/theory): a homotopy class holds exactly one taut path; a taut path alternates
common tangents and arcs; a leg between two admissible classes never needs more tether than its ends
do, so its cost is the length of the taut path of the word ``h_i^-1 h_j`` and depends on nothing
else; obstacles are vertical, so a 3D length is ``hypot(planar taut length, dz)``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock, TimeLimit
from netsp.base.deprecated import deprecated_method
from netsp.base.errors import InputError
from netsp.hsignature import Word, concatenate, is_looping, signature
from netsp.model.problem import Problem
from netsp.model.solution import KeptClasses
from netsp.roadmap.any_class_paths import taut_detours
from netsp.roadmap.classes import find_classes
from netsp.roadmap.explore import ALL, NON_LOOPING
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.reach_bounds import find_parity_paths
from netsp.roadmap.roadmap_policy import RoadmapPolicy
from netsp.roadmap.taut_legs import TautLegs
from netsp.roadmap.travel_graph import TravelGraph

RULES = {"all": ALL, "non-looping": NON_LOOPING}
"""Rules for the classes that a roadmap holds, by name."""


class TautRoadmap:
    """Classes and legs of one problem.

    Parameters
    ----------
    classes
        ``all`` whose taut tether fits, or ``non-looping``, the rule of the 2017 paper, which drops
        some of them (`netsp.hsignature.is_looping`; docs/theory, Proposition 10).
    max_classes
        Maximum number of classes, about; by default that of the policy. If there are more, the
        shortest of every goal are kept.
    time_limit
        Seconds, or the clock of the run. If the time is up during the search for classes, the ones
        found so far are kept. If it is up while legs are measured, `lengths` raises.
    limits_paths
        Whether the limit also applies to outline and tangents, without which there is no plan.

    Attributes
    ----------
    complete
        Whether no class was left out.
    min_tether_left_out
        Lower bound on the tether of every class left out; inf if none is.

    Raises
    ------
    InfeasibleError
        No taut tether reaches some goal; the error states the length that would.
    InputError
        An unknown rule, or a bad number of classes.
    LimitReachedError
        The time was up before outline and tangents were complete.
    """

    def __init__(
        self,
        problem: Problem,
        policy: RoadmapPolicy | None = None,
        *,
        classes: str = "all",
        max_classes: int | None = None,
        time_limit: TimeLimit = None,
        limits_paths: bool = True,
    ) -> None:
        self.policy = policy or RoadmapPolicy()
        if max_classes is None:
            max_classes = self.policy.classes.max_classes
        if not isinstance(max_classes, (int, np.integer)) or max_classes < 1:
            raise InputError(f"max_classes: expected a positive whole number, got {max_classes!r}")
        if classes not in RULES:
            raise InputError(f"classes: unknown {classes!r}; expected one of {', '.join(RULES)}")
        self.problem = problem
        self.rule: KeptClasses = "non-looping" if RULES[classes] == NON_LOOPING else "all"
        self.clock = Clock.from_limit(time_limit)
        self.paths = TautPaths(
            problem, clock=self.clock if limits_paths else None, policy=self.policy
        )
        self.outline, self.tangents = self.paths.outline, self.paths.tangents
        self._margin = self.paths.margin
        self._z = problem.points[:, 2]
        found = find_classes(self.paths, RULES[classes], int(max_classes), self.clock)
        self.cluster, self.signatures, self.planar = found.cluster, found.signatures, found.planar
        self.complete, self.min_tether_left_out = found.complete, found.min_tether_left_out
        self.tethers: Floats = np.hypot(self.planar, self._z[self.cluster] - self._z[0])
        self.legs = TautLegs(self.paths, self.cluster, self.signatures, self.planar)

    least_left_out = deprecated_method("least_left_out", "min_tether_left_out")

    def to_travel_graph(self) -> TravelGraph:
        """Return the travel graph over this roadmap; legs are computed when first asked for."""
        graph = TravelGraph(
            self.cluster,
            self.signatures,
            self.tethers,
            self.legs,
            roadmap="taut",
            detours=partial(taut_detours, self.problem, policy=self.policy),
            between=self.paths.bounds_in_any_class,
            classes=self.rule if self.complete else "shortest",
            min_tether_left_out=self.min_tether_left_out,
            carrier=None if self.complete else self,
            by_parity=partial(find_parity_paths, self.paths),
        )
        graph.excluded_by_rule = self.rule != "all"
        return graph

    def ways(self, goal: int, most: int) -> list[tuple[int, Word]]:
        """Return what `netsp.roadmap.travel_graph.Carrier.ways` does."""
        contacts = self.paths.contacts
        length, before = contacts.tree_to_nearest(goal, most + 2)  # with itself and the base
        near = np.argsort(length[: contacts.points], kind="stable")
        rays = self.outline.rays
        return [
            (k, signature(contacts.draw(goal, k, before), rays))
            for k in [k for k in near.tolist() if k not in (0, goal)][:most]
            if np.isfinite(length[k])
        ]

    def carried(self, start: int, word: Word, goal: int) -> Word | None:
        """Return what `netsp.roadmap.travel_graph.Carrier.carried` does."""
        contacts = self.paths.contacts
        line = contacts.draw(start, goal, contacts.tree_to(start, goal))
        arrived = concatenate(word, signature(line, self.outline.rays))
        return None if self._tether_length(goal, arrived) is None else arrived

    def with_classes(
        self, wanted: Iterable[tuple[int, Word]], up: Callable[[], bool]
    ) -> TravelGraph:
        """Return what `netsp.roadmap.travel_graph.Carrier.with_classes` does. The classes are then
        part of this roadmap."""
        known = set(zip(self.cluster.tolist(), self.signatures, strict=True))
        added = [
            (goal, word, length)
            for goal, word in dict.fromkeys(wanted)
            if not up()
            and (goal, word) not in known
            and (length := self._tether_length(goal, word)) is not None
        ]
        cluster = np.array([*self.cluster, *(g for g, _, _ in added)], dtype=np.int64)
        order = np.argsort(cluster, kind="stable")
        signatures = [*self.signatures, *(w for _, w, _ in added)]
        planar = np.array([*self.planar, *(length for _, _, length in added)])
        self.cluster, self.planar = cluster[order], planar[order]
        self.signatures = [signatures[k] for k in order.tolist()]
        self.tethers = np.asarray(np.hypot(self.planar, self._z[self.cluster] - self._z[0]))
        self.legs = TautLegs(self.paths, self.cluster, self.signatures, self.planar)
        return self.to_travel_graph()

    def _tether_length(self, goal: int, word: Word) -> float | None:
        """Return the planar length of the taut tether of a class; None if it is over the limit."""
        rise = float(self._z[goal] - self._z[0])
        longest = math.sqrt(max(self.problem.tether_length**2 - rise**2, 0.0))
        bound = self.paths.slit_length(0, goal, word)
        if bound > longest + self._margin or (self.rule == "non-looping" and is_looping(word)):
            return None
        return self.paths.planar_length_within(0, goal, word, longest)
