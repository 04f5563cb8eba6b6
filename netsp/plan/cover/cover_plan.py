"""Plan of a mission from a scene: few waypoints with headings that see all that can be seen."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from netsp.base.arrays import Bools, ComparesArrays, Floats
from netsp.base.clock import Clock, TimeLimit
from netsp.base.errors import InputError, LimitReachedError
from netsp.base.field_types import Point3, checked_argument
from netsp.base.geometry import polylines
from netsp.base.interrupt_signals import until_interrupt
from netsp.plan.cover.cover_policy import CoverPolicy
from netsp.plan.cover.leg_classes import TetherClasses
from netsp.plan.cover.tour_choice import TIME, VIEWPOINTS, Objective, TourChoice, TourChooser
from netsp.plan.cover.viewpoint_swaps import find_alternatives
from netsp.plan.cover.viewpoints import (
    Viewer,
    Viewpoints,
    coarsen,
    find_more_viewpoints,
    find_viewpoints,
)
from netsp.world.mission.equipment import Camera
from netsp.world.mission.mission import Mission, MissionWaypoint, Viewpoint
from netsp.world.mission.mission_limits import check_bounds
from netsp.world.paths.tree import Grid, ShortestTree, pull_taut
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene
from netsp.world.scene.surfaces import extent
from netsp.world.simulator.coverage import Patches, surface_patches
from netsp.world.simulator.mission_run import mission_grid

UNKNOWN_TETHER_LENGTH = 1e6
"""Sentinel for a tether whose required length is not known yet, metres."""


@dataclass(frozen=True, eq=False)
class Cover(ComparesArrays):
    """Waypoints that see a structure.

    Parameters
    ----------
    mission : Mission
        Mission with the waypoints and the camera.
    viewpoints : Viewpoints
        Chosen viewpoints.
    patches : Patches
        Surface to be seen.
    candidates : int
        Number of viewpoints to choose from.
    bound : int
        Lower bound on the number of viewpoints among these that see as much.
    seen : float
        Share of the whole surface that is seen from the waypoints, on the patches by which they
        were chosen. The choice makes the most of these, so `counted` is a little smaller. With the
        objective `time`, what is seen is what a flight sees, whose turns may end a few degrees
        early; with `viewpoints`, it is what is seen at the headings of the waypoints.
    counted : float
        Same share on the finer patches that a flight counts, seen where its turns end.
    visible : float
        Share of it that is seen from any of the candidates.
    visible_patches : ndarray of bool, shape (m,)
        Whether each patch is seen from any of the candidates.
    objective : {"time", "viewpoints"}
        Quantity that was kept small: the time until the robot is home, or the number of viewpoints.
    tour_length : float
        Estimated length of the tour in the order of the waypoints, metres. The planner may find a
        shorter tour, or need a longer one for the tether.
    tour_s : float
        Estimated time of that tour with its visits, s.
    """

    mission: Mission
    viewpoints: Viewpoints
    patches: Patches
    candidates: int
    bound: int
    seen: float
    counted: float
    visible: float
    visible_patches: Bools
    objective: Objective
    tour_length: float
    tour_s: float

    def __repr__(self) -> str:
        """Return the numbers on one line."""
        return (
            f"<Cover: {len(self.viewpoints)} viewpoints (no fewer than {self.bound}) see "
            f"{100 * self.counted:.1f} % of the surface, all {self.candidates} see "
            f"{100 * self.visible:.1f} %>"
        )


def cover(
    scene: Scene,
    *,
    anchor: Point3,
    start: Point3 | None = None,
    camera: Camera | None = None,
    standoff: float | None = None,
    tether_length: float | None = None,
    clearance: float = 0.3,
    share: float = 0.99,
    incidence: float = 75.0,
    farthest: float | None = None,
    inspect: tuple[str, ...] | None = None,
    objective: Objective = TIME,
    speed: float | None = None,
    time_limit: TimeLimit = 60.0,
    seed: int = 0,
    on_progress: Callable[[str], None] | None = None,
    policy: CoverPolicy | None = None,
) -> Cover:
    """Place waypoints around the solids, meshes and clouds of a scene.

    Parameters
    ----------
    scene : Scene
        Scene that is to be seen.
    anchor : (x, y, z)
        Point where the tether is fixed, metres.
    start : (x, y, z), optional
        Point where the robot starts; the anchor by default, metres.
    camera : Camera, optional
        Camera of the robot.
    standoff : float, optional
        Distance from the surface, metres; half the camera's range by default.
    tether_length : float, optional
        Length of the tether, metres; no waypoint needs more. By default a tenth more than the
        waypoints need.
    clearance : float
        Distance that the robot keeps from all solids, metres.
    share : float
        Share, by area, of the surface that can be seen at all.
    incidence : float
        Largest angle between a line of sight and the normal, degrees.
    farthest : float, optional
        Largest distance of a patch that is seen, metres; the camera's range by default.
    inspect : tuple of str, optional
        Names of the solids to be seen; all but half spaces and the sea floor by default.
    objective : {"time", "viewpoints"}
        Quantity to keep small: the time until the robot is home, with viewpoints and tour chosen
        together, or the number of viewpoints.
    speed : float, optional
        Speed of the robot, m/s; by default that of missions.
    time_limit : float or Clock, optional
        Seconds; when they are up, the best result by then is returned.
    seed : int
        Seed of all random choices.
    on_progress : callable, optional
        Called with a line of text now and then.
    policy : CoverPolicy, optional
        Policy of the search for viewpoints and of the choice among them.

    Returns
    -------
    Cover
        Waypoints in the order of a short tour, as a mission for
        `netsp.plan.space.mission_solver.solve_mission`, which may change the order.

    Raises
    ------
    InputError
        Values out of their ranges; an anchor in a solid; nothing that can be seen.
    """
    policy, camera = policy or CoverPolicy(), camera or Camera()
    report = on_progress or (lambda _: None)
    with until_interrupt(time_limit) as clock:
        standoff = 0.5 * camera.range if standoff is None else standoff
        farthest = camera.range if farthest is None else min(farthest, camera.range)
        _check(standoff, farthest, clearance, share, incidence, tether_length, speed)
        if objective not in (TIME, VIEWPOINTS):
            raise InputError(f"objective: expected {TIME!r} or {VIEWPOINTS!r}, got {objective!r}")
        mission = Mission(
            scene="-",
            name=scene.name,
            anchor=anchor,
            start=start or anchor,
            waypoints=(MissionWaypoint(position=anchor),),
            clearance=clearance,
            camera=camera,
            inspect=inspect,
            tether_length=tether_length or UNKNOWN_TETHER_LENGTH,
        )
        if speed is not None:
            mission = mission.model_copy(update={"speed": speed})
        check_bounds(mission, scene)
        field = clock.bounded("measuring distances in the scene", scene.field)
        base = field.free_point(anchor, "anchor")
        start_place = base if start is None else field.free_point(start, "start")
        report("surface of the scene")
        fine = clock.bounded(
            "covering the surface with patches",
            lambda: surface_patches(
                scene, field, camera.patch, np.array([anchor]), inspect, clearance=clearance
            ),
        )
        patches = coarsen(fine, camera.patch)
        mission = mission.model_copy(update={"start": tuple(start_place.tolist())})
        reach = clock.bounded(
            "finding where the robot can go",
            lambda: _Reach.build(mission, scene, field, patches, standoff, policy),
        )
        viewer = Viewer(
            field,
            patches,
            camera,
            standoff,
            clearance,
            math.radians(incidence),
            farthest,
            reach.allowed,
            policy,
        )
        search_clock = clock.part(policy.search_time_share)
        found = find_viewpoints(viewer, np.random.default_rng(seed), search_clock, report)
        if not len(found) or not found.sees.any():
            raise InputError(
                "inspect: no part of the surface can be seen from where the robot can go; "
                "expected a shorter stand-off or clearance, or a longer tether"
            )
        if objective in policy.dense_objectives:
            more_clock = clock.part(policy.more_time_share)
            viewer, found = _counted_finely(viewer, found, fine, more_clock, report)
            found = find_more_viewpoints(viewer, found, more_clock, report)
            patches = viewer.patches
        classes = reach.tether_classes(clock)
        chooser = TourChooser(
            viewer, start_place, mission.speed, share, clock, seed, report, fine, classes
        )
        if objective == TIME:
            found = replace(found, sees=chooser.seen_in_flight(found))
        choice = chooser.choose(found, objective)
        counted = chooser.fine_share(found.subset(choice.order))
        return _build_cover(mission, patches, found, choice, counted, reach, share, objective)


def _counted_finely(
    viewer: Viewer,
    found: Viewpoints,
    fine: Patches,
    clock: Clock,
    on_progress: Callable[[str], None],
) -> tuple[Viewer, Viewpoints]:
    """Return a viewer of finer patches, with what viewpoints see of these.

    These are the patches that a flight counts, or coarser ones if these are too many. If all are
    too many, or the clock is up before all viewpoints are counted, the viewer is returned as it is.
    """
    policy = viewer.policy
    for ratio in policy.counted_ratios:
        patches = coarsen(fine, ratio * viewer.camera.patch) if ratio > 0.0 else fine
        if len(patches.areas) * policy.max_candidates <= policy.max_views:
            on_progress(f"counting what viewpoints see of {len(patches.areas)} patches")
            finer_viewer = replace(viewer, patches=patches)
            counted = finer_viewer.views(found.places, found.headings, clock)
            return (finer_viewer, counted) if len(counted) == len(found) else (viewer, found)
    return viewer, found


def _check(
    standoff: float,
    farthest: float,
    clearance: float,
    share: float,
    incidence: float,
    tether_length: float | None,
    speed: float | None,
) -> None:
    positive = {"standoff": standoff, "farthest": farthest, "share": share, "incidence": incidence}
    optional = {"tether_length": tether_length, "speed": speed}
    positive |= {name: value for name, value in optional.items() if value is not None}
    for name, value in positive.items():
        checked_argument(name, value, 0.0)
        if not value > 0.0:
            raise InputError(f"{name}: expected more than 0, got {value:g}")
    checked_argument("clearance", clearance, 0.0)
    if share > 1.0:
        raise InputError(f"share: expected a share up to 1, got {share:g}")
    if incidence >= 90.0:
        raise InputError(f"incidence: expected less than 90 degrees, got {incidence:g}")
    if standoff < clearance:
        raise InputError(
            f"standoff: {standoff:g} is nearer than the clearance {clearance:g}; expected no less"
        )
    if standoff > farthest:
        raise InputError(
            f"standoff: {standoff:g} is farther than the camera sees, {farthest:g}; expected no "
            "more"
        )


@dataclass
class _Reach:
    """Region to which the robot gets on its tether."""

    mission: Mission
    field: DistanceField
    grid: Grid
    bounds: tuple[Floats, Floats] | None
    policy: CoverPolicy

    @classmethod
    def build(
        cls,
        mission: Mission,
        scene: Scene,
        field: DistanceField,
        patches: Patches,
        standoff: float,
        policy: CoverPolicy,
    ) -> _Reach:
        """Return the region, with a grid about all places where viewpoints may be."""
        low, high = extent(scene, np.vstack([patches.centres, mission.every_place]))
        margin = 2.0 * standoff
        corners = np.array([low - margin, high + margin])
        corner_mission = mission.model_copy(
            update={
                "waypoints": tuple(
                    MissionWaypoint(position=(x, y, z)) for x, y, z in corners.tolist()
                )
            }
        )
        bounds = None
        if scene.bounds is not None:
            bounds = np.array(scene.bounds[:3]), np.array(scene.bounds[3:])
        return cls(mission, field, mission_grid(corner_mission, scene, field), bounds, policy)

    def allowed(self, places: Floats) -> Bools:
        """Return which of places (n, 3) the robot gets to, within the bounds."""
        is_allowed = np.ones(len(places), dtype=bool)
        if self.bounds is not None:
            is_allowed &= (places >= self.bounds[0]).all(axis=1) & (places <= self.bounds[1]).all(
                axis=1
            )
        anchor = np.array(self.mission.anchor)
        limit = self.policy.max_tether_share * self.mission.tether_length
        is_allowed &= np.linalg.norm(places - anchor, axis=1) <= limit
        near = np.flatnonzero(is_allowed)
        if len(near):
            lengths = self.tethers(places[near])
            is_allowed[near] = lengths <= limit
        return is_allowed

    def tether_classes(self, clock: Clock) -> TetherClasses | None:
        """Return the classes of tethers; None if the complex has no labels in time."""
        anchor = np.array(self.mission.anchor)
        try:
            return clock.bounded(
                "labelling the water", lambda: TetherClasses.on_grid(self.grid, anchor)
            )
        except (InputError, LimitReachedError):
            return None

    def tethers(self, places: Floats) -> Floats:
        """Return the shortest tethers (n,) to places (n, 3), metres; inf where there is none."""
        anchor = np.array(self.mission.anchor)
        tree = ShortestTree(self.grid, anchor, places)
        lengths = np.full(len(places), np.inf)
        for k in range(len(places)):
            path = tree.path(k)
            if path is not None:
                lengths[k] = polylines.length(path)
                if lengths[k] > self.policy.max_tether_share * self.mission.tether_length:
                    lengths[k] = polylines.length(
                        pull_taut(self.field, path, 0.0, self.mission.delta)
                    )
        return lengths


def _build_cover(
    mission: Mission,
    patches: Patches,
    found: Viewpoints,
    choice: TourChoice,
    counted: float,
    reach: _Reach,
    share: float,
    objective: Objective,
) -> Cover:
    chosen, policy = found.subset(choice.order), reach.policy
    length = _tether_length(mission, chosen, reach)
    needed = share * float(patches.areas[found.sees.any(axis=0)].sum())
    alternatives_of = find_alternatives(found, choice.order, patches.areas, needed, policy)
    viewpoints = [_viewpoint(found, k) for k in choice.order]
    waypoints = tuple(
        MissionWaypoint(
            position=v.position,
            heading=v.heading,
            alternatives=tuple(_viewpoint(found, k) for k in others),
        )
        for v, others in zip(viewpoints, alternatives_of, strict=True)
    )
    areas = patches.areas
    visible: Bools = np.asarray(found.sees.any(axis=0))
    return Cover(
        mission.model_copy(update={"waypoints": waypoints, "tether_length": length}),
        chosen,
        patches,
        len(found),
        choice.bound,
        float(areas[chosen.sees.any(axis=0)].sum() / areas.sum()),
        counted,
        float(areas[visible].sum() / areas.sum()),
        visible,
        objective,
        choice.length,
        choice.seconds,
    )


def _tether_length(mission: Mission, chosen: Viewpoints, reach: _Reach) -> float:
    """Return the length of the mission's tether, metres, with a spare if it is not stated."""
    if mission.tether_length != UNKNOWN_TETHER_LENGTH:
        return mission.tether_length
    longest, policy = float(reach.tethers(chosen.places).max()), reach.policy
    return round(policy.tether_ratio * longest + policy.tether_spare, 2)


def _viewpoint(found: Viewpoints, k: int) -> Viewpoint:
    x, y, z = found.places[k].round(4).tolist()
    heading = math.degrees(found.headings[k])
    return Viewpoint(position=(x, y, z), heading=None if math.isnan(heading) else round(heading, 1))
