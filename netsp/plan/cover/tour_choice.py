"""Choose viewpoints with the order in which to visit them.

With the objective `TIME`, viewpoints and tour are chosen together, so that the robot is home early.
With `VIEWPOINTS`, the fewest viewpoints come first, and then a short tour through them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from netsp.base.arrays import Bools, ComparesArrays, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.plan.cover.arrival_turns import expected_turns
from netsp.plan.cover.choose import choose, counting_bound, merge_patches
from netsp.plan.cover.covering_tour import TourProblem, cheapest_tour, shortest_order
from netsp.plan.cover.leg_classes import TetherClasses
from netsp.plan.cover.tour_improvement import tour_length
from netsp.plan.cover.viewpoint_distances import estimate_distances
from netsp.plan.cover.viewpoints import Viewer, Viewpoints
from netsp.world.mission.equipment import Camera
from netsp.world.simulator.coverage import Patches
from netsp.world.simulator.simulation_policy import SimulationPolicy
from netsp.world.vehicle.vehicle_policy import VehiclePolicy

Objective = Literal["time", "viewpoints"]
"""Objective of the choice: the time until the robot is home, or the number of viewpoints."""

TIME: Objective = "time"
VIEWPOINTS: Objective = "viewpoints"


@dataclass(frozen=True, eq=False)
class TourChoice(ComparesArrays):
    """Chosen viewpoints in the order of a tour.

    Parameters
    ----------
    order : ndarray of int
        Numbers of the viewpoints in their order.
    bound : int
        Lower bound on the number of viewpoints that see as much.
    length : float
        Estimated length of the tour, metres. It is not a bound, because it ignores the tether.
    seconds : float
        Estimated time of the tour with its visits, s.
    """

    order: Ints
    bound: int
    length: float
    seconds: float


@dataclass(frozen=True)
class TourChooser:
    """Choice among viewpoints.

    Parameters
    ----------
    viewer : Viewer
        Limits of viewpoints.
    start : ndarray, shape (3,)
        Place where the tour begins and ends, metres.
    speed : float
        Speed of the robot, m/s.
    share : float
        Share, by area, of what any viewpoint sees.
    clock : Clock
        When it is up, the best choice so far is returned.
    seed : int
        Seed of all random choices.
    on_progress : callable
        Called with a line of text now and then.
    fine : Patches
        Patches of the surface that a flight counts.
    classes : TetherClasses, optional
        Classes of tethers; by default legs ignore the tether.
    """

    viewer: Viewer
    start: Floats
    speed: float
    share: float
    clock: Clock
    seed: int
    on_progress: Callable[[str], None]
    fine: Patches
    classes: TetherClasses | None = None

    def choose(self, found: Viewpoints, objective: Objective) -> TourChoice:
        """Return viewpoints that see the share, in the order of a short tour.

        For a tour of least time, the viewpoints see what `seen_in_flight` returns.
        """
        if objective == VIEWPOINTS:
            return self._choose_fewest(found)
        policy, areas = self.viewer.policy, self.viewer.patches.areas
        visible_share = float(areas[found.sees.any(axis=0)].sum() / areas.sum())
        matrix, weights = merge_patches(found.sees, areas)
        area = float(weights.sum())
        distances = self._distances(found.places)
        self.on_progress(f"choosing among {len(found)} viewpoints with their tour")
        problem = TourProblem(
            np.vstack([np.zeros((1, matrix.shape[1]), dtype=bool), matrix]),
            weights,
            min(self.share * visible_share * float(areas.sum()), area),
            distances,
            np.r_[0.0, self.speed * self.visit_times(found)],
        )
        rng = np.random.default_rng(self.seed)
        tour: Ints | None = None
        tours = policy.tours
        for _ in range(policy.max_recounts):
            tour = cheapest_tour(problem, rng, self.clock, tours, self.on_progress, tour)
            missing = self.share * visible_share - self.fine_share(found.subset(tour[1:] - 1))
            if missing <= 0.0 or problem.needed >= area:
                break
            self.on_progress(f"{100 * missing:.1f} % of the surface is missing on fine patches")
            needed = min(problem.needed + missing * float(areas.sum()), area)
            problem = replace(problem, needed=needed)
            rounds = min(policy.recount_rounds, tours.max_rounds)
            tours = replace(tours, max_rounds=rounds, rounds_per_visit=1)
        assert tour is not None
        return TourChoice(
            tour[1:] - 1,
            min(counting_bound(matrix, weights, problem.needed), len(tour) - 1),
            tour_length(distances, tour),
            problem.cost(tour) / self.speed,
        )

    def seen_in_flight(self, found: Viewpoints) -> Bools:
        """Return the patches (n, m) that a flight sees from each viewpoint: those in view at the
        heading where the turn to its own ends.

        The robot only passes viewpoints without a heading, so a patch must be in view from some
        distance away, too.
        """
        early = self._early_headings(found)
        sees = found.sees.copy()
        for k in np.flatnonzero(~np.isnan(early) & (early != found.headings)):
            sees[k] = self.viewer.seen_from(found.places[k], float(early[k]))
        passing = replace(self.viewer, camera=self._camera_in_passing())
        for k in np.flatnonzero(np.isnan(found.headings)):
            sees[k] &= passing.seen_from(found.places[k], math.nan)
        return sees

    def _camera_in_passing(self) -> Camera:
        """Return a camera with a view so narrow that it shows nothing which the camera of a robot
        that passes at some distance does not show."""
        policy, camera = self.viewer.policy, self.viewer.camera
        nearest = min(policy.standoff_ratios) * self.viewer.standoff
        half = math.tan(math.radians(0.5 * camera.field_of_view))
        narrow = max(half - policy.passing_distance / nearest, 0.1 * half)
        field_of_view = math.degrees(2.0 * math.atan(narrow))
        return camera.model_copy(update={"field_of_view": field_of_view})

    def fine_share(self, chosen: Viewpoints) -> float:
        """Return the share of the surface that is seen, counted on the fine patches as in a
        flight."""
        viewer = replace(self.viewer, patches=self.fine)
        seen = np.zeros(len(self.fine.areas), dtype=bool)
        for place, heading in zip(chosen.places, self._early_headings(chosen), strict=True):
            seen |= viewer.seen_from(place, float(heading))
        return float(self.fine.areas[seen].sum() / self.fine.areas.sum())

    def _choose_fewest(self, found: Viewpoints) -> TourChoice:
        """Return the fewest viewpoints, in the order of a short tour."""
        policy = self.viewer.policy
        self.on_progress(f"choosing among {len(found)} viewpoints")
        choice = choose(found.sees, self.viewer.patches.areas, self.share, self.clock, policy)
        chosen = found.subset(choice.chosen)
        distances = self._distances(chosen.places)
        places, rng = 1 + np.arange(len(chosen)), np.random.default_rng(self.seed)
        tour = shortest_order(distances, places, rng, self.clock, policy.tours)
        length = tour_length(distances, tour)
        seconds = length / self.speed + float(self.visit_times(chosen).sum())
        return TourChoice(choice.chosen[tour[1:] - 1], choice.bound, length, seconds)

    def _distances(self, places: Floats) -> Floats:
        """Return the lengths of legs between the start and places; straight ones if the time is
        up."""
        points = np.vstack([self.start, places])
        try:
            return self.clock.bounded(
                "estimating the legs between viewpoints",
                lambda: estimate_distances(self.viewer, points, classes=self.classes),
            )
        except LimitReachedError:
            return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=2))

    def visit_times(self, found: Viewpoints) -> Floats:
        """Return the estimated time (n,) of a visit at each viewpoint, s.

        The robot arrives with the heading of the nearest patch, and turns from there. It passes a
        viewpoint without a heading.
        """
        policy, flight = self.viewer.policy, SimulationPolicy()
        rate = math.radians(VehiclePolicy().max_turn_rate_deg)
        turns = expected_turns(self.viewer, found.places, found.headings, self.speed)
        times = turns / rate + policy.visit_steps * flight.step_s
        return np.where(np.isnan(found.headings), 0.0, times)

    def _early_headings(self, found: Viewpoints) -> Floats:
        """Return the headings (n,) where turns to those of viewpoints may end, within a tolerance;
        NaN without a heading."""
        tolerance = math.radians(SimulationPolicy().heading_tolerance_deg)
        arrival, is_known = self.viewer.arrival_headings(found.places)
        turns = (found.headings - arrival + math.pi) % (2.0 * math.pi) - math.pi
        turns = np.where(is_known, turns, math.radians(self.viewer.policy.free_turn_deg))
        return np.asarray(found.headings - np.clip(turns, -tolerance, tolerance))
