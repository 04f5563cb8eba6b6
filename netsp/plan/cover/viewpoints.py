"""Places from which to look at a structure, and what is seen from each.

A viewpoint is a place and a heading. The tilt of the camera follows as in a flight, which keeps the
nearest patch in the middle as far as the tilt allows (`netsp.world.simulator.coverage`), so that
what is planned is what `netsp simulate` counts. Patches are spread evenly, and before each the
robot stands off along the normal; if that place is taken or does not show the patch, at other
angles and distances.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from netsp.base.arrays import Bools, ComparesArrays, Floats, Ints
from netsp.base.clock import Clock
from netsp.plan.cover.cover_policy import CoverPolicy
from netsp.world.mission.equipment import Camera
from netsp.world.scene.field import DistanceField
from netsp.world.simulator.coverage import Coverage, Patches
from netsp.world.simulator.mesh_patches import merged


@dataclass(frozen=True, eq=False)
class Viewpoints(ComparesArrays):
    """Viewpoints, and what each sees.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Places, metres.
    headings : ndarray, shape (n,)
        Radians from the x axis towards y; NaN for viewpoints without a heading, to which the robot
        does not turn.
    sees : ndarray of bool, shape (n, m)
        Whether each viewpoint sees each patch; without a heading, whatever the robot's heading is.
    """

    places: Floats
    headings: Floats
    sees: Bools

    def __len__(self) -> int:
        return len(self.places)

    def subset(self, chosen: Ints | Bools) -> Viewpoints:
        """Return the viewpoints of given numbers, or where a mask is true."""
        return Viewpoints(self.places[chosen], self.headings[chosen], self.sees[chosen])


@dataclass
class Viewer:
    """Limits of viewpoints, and what can be seen within them.

    Parameters
    ----------
    standoff : float
        Distance from the surface, metres.
    clearance : float
        Distance that the robot keeps from all solids, metres.
    incidence : float
        Largest angle between a line of sight and the normal, radians.
    farthest : float
        Largest distance of a patch that is seen, metres.
    allowed : callable
        Function that returns which of places (n, 3) the robot gets to.
    policy : CoverPolicy
        Policy of how densely places are tried.
    """

    field: DistanceField
    patches: Patches
    camera: Camera
    standoff: float
    clearance: float
    incidence: float
    farthest: float
    allowed: Callable[[Floats], Bools]
    policy: CoverPolicy

    @cached_property
    def _patch_tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.patches.centres)

    def seen_from(self, place: Floats, heading: float) -> Bools:
        """Return whether each patch (m,) is seen from a place with a heading; with NaN, whether it
        is seen with any heading."""
        if not math.isnan(heading):
            return self._seen_with(place, heading)
        count = self.policy.free_headings
        seen = self._seen_with(place, 0.0)
        for k in range(1, count):
            if seen.any():
                seen &= self._seen_with(place, 2.0 * math.pi * k / count)
        return seen

    def _seen_with(self, place: Floats, heading: float) -> Bools:
        patches = self.patches
        look = Coverage(patches, self.field, self.camera)
        look.look(place, heading)
        in_view = np.flatnonzero(look.seen)
        sight = place - patches.centres[in_view]
        distance = np.linalg.norm(sight, axis=1)
        facing = np.einsum("ij,ij->i", sight, patches.normals[in_view])
        is_good_view = (distance <= self.farthest) & (
            facing >= math.cos(self.incidence) * distance - 1e-12
        )
        seen = np.zeros(len(patches.areas), dtype=bool)
        seen[in_view[is_good_view]] = True
        if len(patches.sides):
            # either side of a sheet shows it, from wherever it is looked at
            a, b = patches.sides.T
            seen[a] = seen[b] = seen[a] | seen[b]
        return seen

    def places_before(self, targets: Ints, offsets: Floats, far: Floats) -> tuple[Floats, Ints]:
        """Return the free places before patches, and the patch of each.

        Parameters
        ----------
        offsets : ndarray, shape (n, 3)
            Vectors that are added to the normals, for other angles.
        far : ndarray, shape (n,)
            Distance from each patch, metres.
        """
        toward = self.patches.normals[targets] + offsets
        toward /= np.linalg.norm(toward, axis=1)[:, None]
        places = self.patches.centres[targets] + far[:, None] * toward
        is_usable = self.field.distance(places) >= self.clearance
        places, targets = places[is_usable], targets[is_usable]
        if len(places):
            is_usable = self.allowed(places)
            places, targets = places[is_usable], targets[is_usable]
        return places, targets

    def viewpoints_at(self, places: Floats, targets: Ints) -> Viewpoints:
        """Return a viewpoint at each place, looking at the patch of the same number."""
        toward = self.patches.centres[targets] - places
        headings = np.arctan2(toward[:, 1], toward[:, 0])
        level = np.hypot(toward[:, 0], toward[:, 1]) > 0.2 * np.linalg.norm(toward, axis=1)
        return self.views(places, np.where(level, headings, 0.0))

    def arrival_headings(self, places: Floats) -> tuple[Floats, Bools]:
        """Return the headings (n,) of a robot that arrives at places (n, 3), radians.

        It turns to the nearest patch on the way, as `netsp.world.simulator.coverage` describes.

        Returns
        -------
        headings : ndarray, shape (n,)
            Headings; 0 where they are not known.
        is_known : ndarray of bool, shape (n,)
            False where the patch is straight above or below, so that the robot keeps its heading.
        """
        toward = self.patches.centres[self._patch_tree.query(places)[1]] - places
        is_known = np.hypot(toward[:, 0], toward[:, 1]) >= 0.2 * np.linalg.norm(toward, axis=1)
        return np.where(is_known, np.arctan2(toward[:, 1], toward[:, 0]), 0.0), is_known

    def views(self, places: Floats, headings: Floats, clock: Clock | None = None) -> Viewpoints:
        """Return the viewpoints at places (n, 3) with headings (n,), and what each sees; when a
        clock is up, the first ones only."""
        sees: list[Bools] = []
        for place, heading in zip(places, headings, strict=True):
            if clock is not None and clock.is_up:
                break
            sees.append(self.seen_from(place, float(heading)))
        return Viewpoints(
            places[: len(sees)],
            headings[: len(sees)],
            np.array(sees, dtype=bool).reshape(len(sees), len(self.patches.areas)),
        )


def find_viewpoints(
    viewer: Viewer, rng: np.random.Generator, clock: Clock, on_progress: Callable[[str], None]
) -> Viewpoints:
    """Return viewpoints before the whole structure, many more than are needed.

    Patches that no viewpoint sees count as hidden. When the clock is up, the viewpoints found by
    then are returned.

    Parameters
    ----------
    on_progress : callable
        Called with a line of text now and then.
    """
    patches, camera = viewer.patches, viewer.camera
    width = 2.0 * viewer.standoff * math.tan(math.radians(0.5 * camera.field_of_view))
    targets = spread_out(patches.centres, viewer.policy.patch_spacing * width)
    on_progress(
        f"looking at the structure from before {len(targets)} of {len(patches.areas)} patches"
    )
    straight = np.zeros((len(targets), 3))
    places, before = viewer.places_before(targets, straight, np.full(len(targets), viewer.standoff))
    found = [viewer.viewpoints_at(places, before)]
    seen: Bools = np.asarray(found[0].sees.any(axis=0))
    hidden = np.flatnonzero(~seen)
    rng.shuffle(hidden)
    # one after the other, for a place that shows one often shows its neighbours
    for part in np.array_split(
        hidden, max(1, math.ceil(len(hidden) / viewer.policy.patches_per_round))
    ):
        still_hidden = part[~seen[part]]
        if clock.is_up or not len(still_hidden):
            continue
        on_progress(f"viewpoints for hidden patches, {int((~seen).sum())} left")
        for place, patch in zip(
            *viewer.places_before(*_around(viewer, still_hidden, rng)), strict=True
        ):
            if seen[patch] or clock.is_up:
                continue
            view = viewer.viewpoints_at(place[None], np.array([patch]))
            if view.sees[0, patch]:
                found.append(view)
                seen |= view.sees[0]
    return Viewpoints(
        np.vstack([f.places for f in found]),
        np.concatenate([f.headings for f in found]),
        np.vstack([f.sees for f in found]),
    )


def find_more_viewpoints(
    viewer: Viewer, found: Viewpoints, clock: Clock, on_progress: Callable[[str], None]
) -> Viewpoints:
    """Return viewpoints with others between them, so that a tour can choose among many.

    Patches that are spread evenly are looked at from several distances and at several angles, and
    from the same places without a turn: with the heading of a robot that arrives, or straight above
    or below the surface, where that heading is not known, without a heading. When the clock is up,
    the viewpoints found by then are returned.

    Parameters
    ----------
    found : Viewpoints
        Viewpoints before the whole structure.
    """
    policy, patches = viewer.policy, viewer.patches
    ratios, offsets = policy.standoff_ratios, np.radians(policy.heading_offsets_deg)
    max_targets = (policy.max_candidates - len(found)) // (len(ratios) * (1 + len(offsets)))
    if max_targets < 1:
        return found
    targets = spread_out(patches.centres, 0.0, max_targets)
    on_progress(f"looking at {len(targets)} patches from several distances")
    views = [found]
    for ratio in sorted(ratios, key=lambda ratio: abs(math.log(ratio))):
        if clock.is_up:
            break
        far = np.full(len(targets), min(ratio * viewer.standoff, viewer.farthest))
        places, before = viewer.places_before(targets, np.zeros((len(targets), 3)), far)
        arrival, is_level = viewer.arrival_headings(places)
        toward = patches.centres[before] - places
        is_aside = np.hypot(toward[:, 0], toward[:, 1]) > 0.2 * np.linalg.norm(toward, axis=1)
        straight = np.where(is_aside, np.arctan2(toward[:, 1], toward[:, 0]), arrival)
        views += [viewer.views(places, straight + offset, clock) for offset in offsets]
        is_other = ~is_level | (np.abs(straight - arrival) > math.radians(1.0))
        turnless = np.where(is_level, arrival, np.nan)
        views.append(viewer.views(places[is_other], turnless[is_other], clock))
    return Viewpoints(
        np.vstack([v.places for v in views]),
        np.concatenate([v.headings for v in views]),
        np.vstack([v.sees for v in views]),
    )


def _around(viewer: Viewer, patches: Ints, rng: np.random.Generator) -> tuple[Ints, Floats, Floats]:
    """Return other angles and distances from which to look at each patch, straight first."""
    tries = viewer.policy.views_per_hidden_patch
    targets = np.repeat(patches, tries)
    offsets = rng.normal(size=(len(targets), 3)) * rng.uniform(0.0, 1.2, len(targets))[:, None]
    min_far = viewer.policy.min_standoff_ratio * viewer.standoff
    max_far = min(viewer.farthest, 2.0 * viewer.standoff)
    distances = rng.uniform(min(min_far, max_far), max_far, len(targets))
    distances[np.arange(len(targets)) % tries < tries // 2] = viewer.standoff
    offsets[::tries] = 0.0
    return targets, offsets, distances


def coarsen(patches: Patches, size: float) -> Patches:
    """Return one patch for all patches in a cube of space that face the same of six directions.

    Tubes are drawn with slivers, of which a view shows hundreds. The place of a coarse patch is
    that of the patch in the middle, and areas add up.

    Parameters
    ----------
    size : float
        Edge of the cubes, metres.
    """
    first, which, areas = merged(patches.centres, patches.normals, patches.areas, size)
    sides = patches.sides
    if len(sides):
        sides = np.unique(which[sides], axis=0)
        sides = sides[sides[:, 0] != sides[:, 1]]
    return Patches(patches.centres[first], patches.normals[first], areas, sides, patches.sight)


def spread_out(points: Floats, apart: float, max_count: int | None = None) -> Ints:
    """Return the numbers of points so far apart that balls of radius `apart` about them hold all
    others. Each is the one farthest from those before (Gonzalez 1985).

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Points, metres.
    apart : float
        Radius of the balls, metres.
    max_count : int, optional
        Maximum number of points; with fewer than needed, the balls do not hold all others.
    """
    chosen = [0]
    distances = np.linalg.norm(points - points[0], axis=1)
    while True:
        k = int(distances.argmax())
        if distances[k] <= apart or len(chosen) == max_count:
            return np.array(chosen)
        chosen.append(k)
        distances = np.minimum(distances, np.linalg.norm(points - points[k], axis=1))
