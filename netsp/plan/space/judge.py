"""Judge of a planned mission: checks what its tour states, and imports no solver.

The tether is driven along the whole tour by the same model at half the resolution: another
discretisation, but not another model; benchmarks compare the model with strings of beads. Words are
those of the mission's own cells, because letters have no meaning beyond them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError, counted
from netsp.base.geometry import polylines
from netsp.base.number_ranges import check_positive
from netsp.gtsp.travel.result import relative_gap
from netsp.judge import Check, Verification
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE
from netsp.model.solution import Status
from netsp.plan.space.planning_context import (
    PlanningContext,
    keeps_clearance,
    max_corner_dip,
    min_clearance_along,
)
from netsp.world.mission.mission import Mission
from netsp.world.mission.mission_limits import check_bounds, check_size
from netsp.world.mission.mission_tether import mission_tether
from netsp.world.mission.planned_tour import PlannedTour
from netsp.world.paths.tree import ShortestTree
from netsp.world.planner.planner_policy import PlannerPolicy
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene

STATED_TOLERANCE = 1e-6
"""Tolerance of stated figures, for their rounding in files: metres, and share of a length."""


@dataclass(frozen=True)
class JudgePolicy:
    """Accuracy that the judge of a planned mission asks for.

    Attributes
    ----------
    delta_ratio
        Resolution at which the tether is driven again, as a share of the mission's.
    max_length_error
        Share of a stated tether length, in addition to the mission's resolution, by which the
        length at the other resolution may differ: three times the worst difference between two
        resolutions (docs/theory/tether.md).
    tether_share
        Share of the tether within which a waypoint must not be left out.
    max_cell_halvings
        How often cells are halved for a tour that states no words and whose word at the end is not
        empty, because coarse cells may close a passage; at least 1.
    """

    delta_ratio: float = 0.5
    max_length_error: float = 0.01
    tether_share: float = 0.99
    max_cell_halvings: int = 2

    def __post_init__(self) -> None:
        check_positive(self)


def verify_mission(
    mission: Mission,
    *,
    scene: Scene | None = None,
    field: DistanceField | None = None,
    context: PlanningContext | None = None,
    policy: JudgePolicy | None = None,
) -> Verification:
    """Judge a planned mission.

    Checks that the tour leads from the start through the first waypoints and home, clear of solids;
    that the tether's word at every visit is the stated one and empty at the end; that the tether,
    driven along it again, keeps to its limit, has the stated lengths and is free at home; and
    that length, bounds, gaps and status are consistent.

    Parameters
    ----------
    scene, field : Scene, DistanceField, optional
        Scene of the mission and its distance field; loaded and computed if needed.
    context : PlanningContext, optional
        Context of the mission, if it is known; its words depend on field, box and cell only.
    policy : JudgePolicy, optional
        Accuracy.

    Returns
    -------
    Verification
        All checks, in order.

    Raises
    ------
    InputError
        A mission without a tour, or with a moving anchor.
    """
    if mission.tour is None:
        raise InputError("tour: the mission has none; expected one that `netsp solve` has planned")
    if mission.track:
        raise InputError("track: a tour is for a fixed anchor; expected a mission without")
    check_size(mission)
    policy = policy or JudgePolicy()
    if context is not None:
        return _judged(mission, context, policy)
    scene = scene or mission.load_scene()
    check_bounds(mission, scene)
    field = field or scene.field()
    context = PlanningContext.for_mission(mission, scene, field)
    found = _judged(mission, context, policy)
    for _ in range(policy.max_cell_halvings):
        if not _lacks_only_an_empty_word(found, mission.tour):
            break
        # a coarse grid may close a passage, and an empty word on any grid proves that the tether
        # comes free (docs/theory/space.md, P1)
        smaller = mission.model_copy(update={"cell": 0.5 * context.grid.cell})
        try:
            context = PlanningContext.for_mission(smaller, scene, field)
        except InputError:
            break  # too many cells
        found = _judged(mission, context, policy)
    return found


def _judged(mission: Mission, context: PlanningContext, policy: JudgePolicy) -> Verification:
    """Judge a planned mission with the words of a context."""
    assert mission.tour is not None
    finer = mission_tether(mission, context.field, policy.delta_ratio)
    context = replace(context, mission=mission, model=finer)
    return Verification(tuple(_Judge(mission, mission.tour, context, policy).run()))


def _lacks_only_an_empty_word(found: Verification, tour: PlannedTour) -> bool:
    """Return whether a tour that states no words fails the check of its word at the end alone."""
    failed = [check.name for check in found.checks if not check.passed]
    is_unstated = all(stop.signature is None for stop in tour.stops)
    return is_unstated and failed == ["empty word at the end"]


def check_mission_tour(mission: Mission, scene: Scene, field: DistanceField) -> None:
    """Refuse a mission whose tour fails a check, as before it is flown.

    Raises
    ------
    InputError
        As `verify_mission`, or the tour fails a check.
    """
    failed = [c for c in verify_mission(mission, scene=scene, field=field).checks if not c.passed]
    if failed:
        raise InputError(f"tour: fails its check {failed[0].name!r}: {failed[0].detail}")


def _is_proven(gap: float | None) -> bool:
    return gap is not None and gap <= OPTIMALITY_TOLERANCE


def _first_of(faults: list[str]) -> str:
    """Return the first fault, and how many more there are; empty without any."""
    others = f", and {len(faults) - 1} more" if len(faults) > 1 else ""
    return f"{faults[0]}{others}" if faults else ""


def _shown(point: Floats) -> str:
    return f"({', '.join(f'{v:.4g}' for v in point)})"


@dataclass
class _Judge:
    """Checks of one tour."""

    mission: Mission
    tour: PlannedTour
    context: PlanningContext
    policy: JudgePolicy

    @property
    def field(self) -> DistanceField:
        """Return the scene's field."""
        return self.context.field

    def run(self) -> list[Check]:
        """Return all checks, in order."""
        within = self._check_extent()
        if not within.passed:  # there are no cells to judge by outside
            return [self._check_order(), within, self._check_length(), self._check_bounds()]
        return [
            self._check_order(),
            within,
            self._check_left_out(),
            self._check_clearance(),
            *self._check_words(),
            *self._check_tethers(),
            self._check_length(),
            self._check_bounds(),
        ]

    @cached_property
    def legs(self) -> list[Floats]:
        """Return the paths (k, 3) of the legs; the last leads home."""
        return [*(np.array(s.path) for s in self.tour.stops), np.array(self.tour.home)]

    def _leg_name(self, leg: int) -> str:
        """Return the name of a leg in messages."""
        return "the way home" if leg == len(self.tour.stops) else f"the way to visit {leg}"

    def _check_extent(self) -> Check:
        """Check that paths stay within the scene's bounds and the tether's reach."""
        line, mission, name = self.tour.line, self.mission, "within the scene and the tether"
        if self.context.bounds is not None:
            low, high = np.array(self.context.bounds[:3]), np.array(self.context.bounds[3:])
            outside = np.flatnonzero(((line < low) | (line > high)).any(axis=1))
            if len(outside):
                return Check(
                    name, False, f"{_shown(line[outside[0]])} is out of the scene's bounds"
                )
        distances = np.linalg.norm(line - np.array(mission.anchor), axis=1)
        k = int(distances.argmax())
        if distances[k] > mission.tether_length * (1.0 + STATED_TOLERANCE):
            detail = f"{_shown(line[k])} is {distances[k]:.4g} m from the anchor"
            return Check(name, False, f"{detail}, the tether {mission.tether_length:g} long")
        return Check(name, True, "all paths")

    def _check_order(self) -> Check:
        """Check that each leg begins where the one before ended; the mission's validation checks
        the ends."""
        gaps = [float(np.linalg.norm(b[0] - a[-1])) for a, b in pairwise(self.legs)]
        largest_gap = max(gaps, default=0.0)
        n_left_out = len(self.mission.waypoints) - len(self.tour.stops)
        detail = counted(len(self.tour.stops), "visit")
        detail += f", {counted(n_left_out, 'waypoint')} left out" if n_left_out else ""
        passed = largest_gap <= self.mission.reach
        original_numbers = [stop.given_as for stop in self.tour.stops if stop.given_as is not None]
        if len(set(original_numbers)) < len(original_numbers):
            twice = next(n for n in original_numbers if original_numbers.count(n) > 1)
            return Check(
                "leads through the waypoints and home",
                False,
                f"two visits say that they are waypoint #{twice} of the file",
            )
        return Check(
            "leads through the waypoints and home",
            passed,
            detail
            if passed
            else f"a leg begins {largest_gap:.3g} m from where the one before it ended",
        )

    def _check_left_out(self) -> Check:
        """Check that only waypoints out of reach are left out.

        A waypoint is in reach if the tether that follows a shortest path of the robot from the
        start stays within the part that plans may use.
        """
        mission, left_out = self.mission, range(len(self.tour.stops), len(self.mission.waypoints))
        name = "leaves out only what is out of reach"
        if not left_out:
            return Check(name, True, "no waypoint")
        context = self.context
        tree = ShortestTree(context.grid, np.array(mission.start), mission.places[list(left_out)])
        limit = self.policy.tether_share * mission.tether_length - mission.delta
        for n, k in enumerate(left_out):
            path = tree.path(n)
            if path is None:
                continue
            line = np.vstack([context.start_tether.nodes, path[::-1]])
            tether, longest = context.drive(
                context.start_tether, line[len(context.start_tether.nodes) - 1 :]
            )
            if longest <= limit:
                return Check(name, False, f"waypoint #{k}, which takes {tether.length:.3f} m")
        return Check(name, True, f"{len(left_out)} of {len(mission.waypoints)} waypoints")

    def _check_clearance(self) -> Check:
        """Check that paths keep clear of solids."""
        line, mission = self.tour.line, self.mission
        dip = max_corner_dip(mission.delta)
        room = min_clearance_along(self.field, line)
        tight_legs = [
            k for k, leg in enumerate(self.legs) if not keeps_clearance(self.field, leg, mission)
        ]
        free = all(self.field.line_of_sight(a, b, depth=1e-3) for a, b in pairwise(line))
        detail = f"{room:.3g} m from the nearest, clearance {mission.clearance:g}"
        if room < mission.clearance and not tight_legs:
            nearest = float(
                self.field.distance(np.vstack([mission.places, self.legs[0][:1]])).min()
            )
            detail += (
                f"; a waypoint or the start is {nearest:.3g} m from it"
                if nearest < mission.clearance
                else f"; corners of a taut path may be {dip:.3g} m nearer"
            )
        if tight_legs:
            leg = self._leg_name(tight_legs[0])
            detail += f"; {leg} is nearer than the {dip:.3g} m allowed at corners of taut paths"
        return Check(
            "keeps clear of solids",
            free and not tight_legs,
            detail if free else "passes through a solid",
        )

    def _check_words(self) -> list[Check]:
        """Check the words at the visits, and that the word at the end is empty."""
        if not self.context.has_words:
            unknown = "the words of the scene are not known"
            names = ("words at the visits", "empty word at the end")
            return [Check(name, True, unknown, was_made=False) for name in names]
        context, words = self.context, self.context.words
        wrong, n_unstated = [], 0
        # the way to a waypoint ends at the waypoint itself, from where the next one begins
        places = self.mission.places[: len(self.tour.stops), None]
        legs = [np.vstack([leg, place]) for leg, place in zip(self.legs, places, strict=False)]
        to_start = context.start_tether.nodes[::-1]
        *found, at_end = context.words_along([*legs, np.vstack([self.legs[-1], to_start])])
        for k, (stop, word) in enumerate(zip(self.tour.stops, found, strict=True)):
            n_unstated += stop.signature is None
            if word is None or stop.signature not in (None, word):
                has = "no word" if word is None else f"the word {list(word)}"
                listed = "none" if stop.signature is None else list(stop.signature)
                wrong.append(f"visit {k} has {has}, stated {listed}")
        if self.tour.exact not in (None, words.exact):
            wrong.append(f"words are{'' if words.exact else ' not'} exact, stated otherwise")
        caveat = "" if words.exact else "; other words may be of the same class, too"
        stated = f"{n_unstated} not stated" if n_unstated else "all as stated"
        return [
            Check("words at the visits", not wrong, _first_of(wrong) or f"{stated}{caveat}"),
            Check(
                "empty word at the end",
                at_end == (),
                "contractible"
                if at_end == ()
                else "no word"
                if at_end is None
                else f"{list(at_end)}",
            ),
        ]

    def _check_tethers(self) -> list[Check]:
        """Check the lengths of the tether, and that it is free at home."""
        model, start_tether = self.context.model, self.context.start_tether
        tether, longest, longest_leg, deviations = self.context.present_tether, 0.0, 0, []
        for k, leg in enumerate(self.legs):
            tether, longest_on_leg = self.context.drive(tether, leg, is_fine=True)
            if longest_on_leg > longest:
                longest, longest_leg = longest_on_leg, k
            if k < len(self.tour.stops):
                deviations += self._deviations(k, tether.length, longest_on_leg)
        # the tether at the start, led to the end of the tour, which may be `reach` away
        as_laid = model.update(start_tether, tether.robot)
        excess = model.refine(tether).length - model.refine(as_laid).length
        limit = self.mission.tether_length
        name = "home" if longest_leg == len(self.tour.stops) else f"visit {longest_leg}"
        return [
            Check(
                "within the tether's length",
                longest <= limit * (1.0 + STATED_TOLERANCE),
                f"longest {longest:.3f} of {limit:g} m, on the way to {name}",
            ),
            Check("tethers as long as stated", not deviations, _first_of(deviations) or "all"),
            Check(
                "free at home",
                excess <= PlannerPolicy().free_tolerance * self.mission.delta,
                f"{max(excess, 0.0):.3f} m longer than at the start",
            ),
        ]

    def _deviations(self, k: int, length_at: float, longest_on_leg: float) -> list[str]:
        """Return the lengths at a visit and on the way to it that differ from the stated ones."""
        stop, deviations = self.tour.stops[k], []
        for length, stated, relation in (
            (length_at, stop.tether_length, "at"),
            (longest_on_leg, stop.longest_tether, "on the way to"),
        ):
            if abs(length - stated) > self.mission.delta + self.policy.max_length_error * stated:
                deviations.append(f"{relation} visit {k}: {length:.3f} m, stated {stated:.3f}")
        return deviations

    def _check_length(self) -> Check:
        """Check the length of the tour."""
        length = sum(float(polylines.length(leg)) for leg in self.legs)
        stated = self.tour.length
        passed = abs(length - stated) <= STATED_TOLERANCE * (1.0 + stated)
        return Check(
            "length as stated",
            passed,
            f"{stated:.6g} m"
            if passed
            else f"the path is {length:.6g} m long, stated {stated:.6g}",
        )

    def _check_bounds(self) -> Check:
        """Check bounds, gaps and status."""
        tour, faults = self.tour, []
        for name, bound, gap in (
            ("lower_bound", tour.lower_bound, tour.gap),
            ("bound_of_all", tour.bound_of_all, tour.gap_to_all),
        ):
            slack = STATED_TOLERANCE * tour.length
            if bound is not None and bound > tour.length + slack:
                faults.append(f"{name} {bound:.6g} is above the length")
            expected_gap = relative_gap(tour.length, bound)
            if (expected_gap is None) != (gap is None) or abs(
                (expected_gap or 0.0) - (gap or 0.0)
            ) > 1e-6:
                faults.append(f"the gap of {name} is {expected_gap}, stated {gap}")
        n_left_out = len(self.mission.waypoints) - len(tour.stops)
        if tour.status is Status.OPTIMAL and not _is_proven(tour.gap_to_all):
            faults.append(f"status optimal with a gap of {tour.gap_to_all} to all tours")
        elif tour.status is Status.OPTIMAL and n_left_out:
            faults.append(f"status optimal with {counted(n_left_out, 'waypoint')} left out")
        elif tour.status is Status.OPTIMAL_OF_STATES and not _is_proven(tour.gap):
            faults.append(f"status optimal_of_states with a gap of {tour.gap}")
        elif tour.status not in (Status.OPTIMAL, Status.OPTIMAL_OF_STATES, Status.FEASIBLE):
            faults.append(
                f"status {tour.status.value}; expected optimal, optimal_of_states or feasible"
            )
        return Check("bounds and status", not faults, faults[0] if faults else tour.status.value)
