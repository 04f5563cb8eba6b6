"""True solids, and the planner's map of them, which is corrected by the range sensor.

The map begins as the scene file. A solid that is missing is added once rays of the sensor have met
it, at the mean of their measurements. A solid that rays pass through is removed. Without a range
sensor, the planner learns of each change at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.world.mission.mission import Mission
from netsp.world.mission.mission_tether import mission_tether
from netsp.world.planner import Planner
from netsp.world.scene.field import DistanceField, pushed_out
from netsp.world.scene.grid import VoxelGrid
from netsp.world.scene.scene import Scene, Solid
from netsp.world.simulator.ranging import Ranging, cast_rays
from netsp.world.simulator.simulation import Simulation
from netsp.world.simulator.simulation_policy import SimulationPolicy
from netsp.world.simulator.surprises import SceneEvent, SceneSurprises, moved_solid, solids_after
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.tether.load import payout

UNBOUNDED_EXTENT = 1e6
"""Sentinel extent of unbounded solids, metres."""

FAR_OFF = Solid.model_validate({"sphere": {"center": [0.0, 0.0, -1e6], "radius": 1.0}})


@dataclass
class Sighting:
    """Measurements of a solid by the range sensor.

    Parameters
    ----------
    solid : Solid
        True solid.
    count : int
        Number of rays that have met the solid.
    error_sum : ndarray, shape (3,)
        Sum of the errors of these rays, metres.
    mapped : Solid or None
        Solid on the map; None if it is not there.
    placed_by : int
        Number of rays whose mean is the place of the solid on the map.
    """

    solid: Solid
    count: int = 0
    error_sum: Floats = field(default_factory=lambda: np.zeros(3))
    mapped: Solid | None = None
    placed_by: int = 0

    def update_map_place(self, min_hits: int) -> bool:
        """Put the solid at the mean of its measurements; return whether the map changed."""
        if self.count < max(min_hits, 4 * self.placed_by):
            return False
        x, y, z = (self.error_sum / self.count).tolist()
        self.mapped, self.placed_by = moved_solid(self.solid, (x, y, z)), self.count
        return True


class Surroundings:
    """True scene, and the planner's map of it.

    Parameters
    ----------
    scene : Scene
        Map at the beginning.
    voxels : VoxelGrid or None
        Voxels of the scene.
    places : ndarray, shape (k, 3)
        Nodes of the tether at the beginning, metres.
    seed : int
        Seed of the sensor's noise.
    """

    def __init__(
        self,
        mission: Mission,
        scene: Scene,
        voxels: VoxelGrid | None,
        surprises: SceneSurprises,
        places: Floats,
        seed: int,
        policy: SimulationPolicy = SimulationPolicy(),
    ) -> None:
        self.mission, self.scene, self.voxels = mission, scene, voxels
        sensor = mission.range_sensor
        self.policy = policy.mapping
        self.ranging = None if sensor is None else Ranging(sensor, seed, policy.ranging)
        self.solids = self.mapped = scene.all_solids()
        self.sightings: list[Sighting] = []
        self.found: set[str | int] = set()
        self.due = surprises.by_time()
        self.events = surprises.events
        self.happened: list[tuple[float, SceneEvent]] = []
        self.trail = np.array(places)
        self.moments: list[tuple[Floats, int]] = []
        self.times: list[float] = []
        self._since = 0.0
        self._steps = 0

    def update(self, world: Simulation, planner: Planner) -> None:
        """Apply due events, look with the sensor, and update the planner's map."""
        position = world.vehicle.position
        self._extend_trail(position)
        before = self.mapped
        has_changed = self._apply_due_events(world, planner)
        if self.ranging is not None:
            has_changed = self._steps % self.policy.look_steps == 0 and self._look(world, planner)
        self._steps += 1
        if has_changed:
            self._update_planner(world, planner, self._changed_box(before))
            if any(all(solid is not kept for kept in self.mapped) for solid in before):
                planner.try_left_out_again()  # a solid that has gone may have been in the way
        if world.believed is not None:
            excess = payout(world.tether, world.load) - payout(world.believed, world.load)
            is_recalled = self._steps % self.policy.recall_steps == 0
            if excess > planner.policy.predictive.snag_tolerance and is_recalled:
                assert isinstance(world.model, GeodesicTether)
                world.believed = self._recover_tether(world, world.model)
                excess = payout(world.tether, world.load) - payout(world.believed, world.load)
            elif is_recalled:
                self.moments.append((world.believed.nodes.copy(), len(self.trail)))
                self.times.append(world.now)
                if len(self.moments) > self.policy.max_recalled:
                    self.moments, self.times = self.moments[1::2], self.times[1::2]
            planner.on_excess_payout(max(0.0, excess), self.trail)

    def _extend_trail(self, position: Floats) -> None:
        """Extend the trail of the robot, or shorten it if the robot goes back along it."""
        spacing = self.policy.trail_spacing
        min_distance = self.policy.retrace_share * spacing
        while len(self.trail) > 2 and np.linalg.norm(position - self.trail[-2]) < min_distance:
            self.trail = self.trail[:-1]
        if np.linalg.norm(position - self.trail[-1]) >= spacing:
            self.trail = np.vstack([self.trail, position])

    def _apply_due_events(self, world: Simulation, planner: Planner) -> bool:
        """Apply due events, and return whether the scene has changed.

        A solid waits while it would stand on the tether, at home or in the anchor's way, or nearer
        to the robot than its clearance and the distance of one second.
        """
        waiting, before = [], self.solids
        for event in self.due:
            if not event.changes_scene and event.time <= world.now:
                self._apply_event(event, world, planner)
                self.happened.append((world.now, event))
                continue
            solids = solids_after(self.solids, event) if event.time <= world.now else None
            if solids is None or not self._has_room(world, solids):
                waiting.append(event)
                continue
            self.solids = solids
            self.happened.append((world.now, event))
        self.due = waiting
        if self.solids is before:
            return False
        world.scene = self._field(self.solids)
        world.tethers = mission_tether(self.mission, world.scene)
        world.tether = world.tethers.refine(world.tether)
        if self.ranging is None:
            self.mapped = self.solids
        return True

    def _apply_event(self, event: SceneEvent, world: Simulation, planner: Planner) -> None:
        """Apply an event that does not change the scene: waypoints, the limit, or a push.

        A push ends at the first solid, and at the end of the tether.
        """
        if event.add_waypoint is not None:
            planner.add_waypoint(event.add_waypoint)
        elif event.cancel_waypoint is not None:
            planner.cancel_waypoint(event.cancel_waypoint)
        elif event.tether_length is not None:
            limit = event.tether_length
            world.shortening = payout(world.tether, world.load) > limit
            self.mission = self.mission.model_copy(update={"tether_length": limit})
            world.mission = world.mission.model_copy(update={"tether_length": limit})
            planner.update_limit(limit)
        elif event.push is not None:
            start = world.vehicle.position
            max_length = max(self.mission.tether_length, world.tether.length)
            line = np.array([start, start + np.array(event.push)])
            for point in polylines.dense(line, 0.5 * self.mission.delta):
                if float(world.scene.distance(point)) < 0.0:
                    break
                tether = world.tethers.update(world.tether, point)
                if tether.length > max_length:
                    break
                world.tether = tether
                world.vehicle.stop_at(point)
                if world.believed is not None and isinstance(world.model, GeodesicTether):
                    world.believed = world.model.update(world.believed, point)
                self._extend_trail(point)
            planner.on_push()

    def _has_room(self, world: Simulation, solids: tuple[Solid, ...]) -> bool:
        new = [s for s in solids if all(s is not old for old in self.solids)]
        if not new:
            return True
        alone = self.scene.field_with(tuple(new), None)
        nodes, home = world.tether.nodes, np.array(self.mission.start)
        if world.track is not None:
            ahead = world.track.between(world.now, max(world.now, world.track.end))
            home = ahead + home - np.array(self.mission.anchor)
            if (
                alone.distance(polylines.dense(ahead, 0.5)).min(initial=1.0)
                < self.mission.clearance
            ):
                return False
        return bool(
            np.min(alone.distance(home)) > self.mission.clearance
            and alone.distance(world.vehicle.position) > self.mission.clearance + self.mission.speed
            and alone.distance(polylines.dense(nodes, 0.5 * self.mission.delta)).min(initial=1.0)
            > self.mission.delta
        )

    def _field(self, solids: tuple[Solid, ...]) -> DistanceField:
        if not solids and self.voxels is None:
            solids = (FAR_OFF,)  # a field needs a solid
        return self.scene.field_with(solids, self.voxels)

    def _look(self, world: Simulation, planner: Planner) -> bool:
        """Look along the path; return whether the map has changed."""
        assert self.ranging is not None
        position = world.vehicle.position
        onward = polylines.part(np.vstack([position, planner.path]), 0.0, 1.0)[-1] - position
        if np.linalg.norm(onward) < 1e-6:
            onward = np.array([np.cos(world.vehicle.yaw), np.sin(world.vehicle.yaw), 0.0])
        rays, ranges, errors = self.ranging.look(world.scene, position, onward)
        is_any_removed = self._remove_passed_solids(planner.scene, position, rays, ranges)
        return self._add_met_solids(world, rays, ranges, errors) or is_any_removed

    def _add_met_solids(
        self, world: Simulation, rays: Floats, ranges: Floats, errors: Floats
    ) -> bool:
        """Add the solids that rays have met to the map, and return whether there were any."""
        met = np.isfinite(ranges)
        points = world.vehicle.position + rays[met] * (ranges - errors)[met, None]
        solid_of_ray = world.scene.nearest(points)
        known = {id(s) for s in self.mapped}
        found = False
        for n in np.unique(solid_of_ray[solid_of_ray >= 0]).tolist():
            solid = self.solids[n]
            if id(solid) in known:
                continue
            sighting = next((s for s in self.sightings if s.solid is solid), None)
            if sighting is None:
                sighting = Sighting(solid)
                self.sightings.append(sighting)
            is_hit = solid_of_ray == n
            sighting.count += int(is_hit.sum())
            sighting.error_sum = sighting.error_sum + (
                rays[met][is_hit] * errors[met][is_hit, None]
            ).sum(0)
            before = sighting.mapped
            if sighting.update_map_place(self.policy.min_hits) and sighting.mapped is not None:
                # a name occurs once
                name = solid.name
                kept = tuple(
                    s for s in self.mapped if s is not before and (name is None or s.name != name)
                )
                self.found.add(id(solid) if name is None else name)
                self.mapped, found = (*kept, sighting.mapped), True
        return found

    def _remove_passed_solids(
        self, known: DistanceField, position: Floats, rays: Floats, ranges: Floats
    ) -> bool:
        """Remove the solids that rays pass through from the map; return whether there were any."""
        assert self.ranging is not None
        sensor = self.ranging.sensor
        expected = cast_rays(known.arrays, position, rays, sensor.range)
        depth = self.policy.removal_depth
        inside = expected + depth
        passed = inside + 3.0 * sensor.noise + depth < np.minimum(ranges, sensor.range)
        points = position + rays[passed] * inside[passed, None]
        deep = known.distance(points) < -0.25 * depth - 2.0 * sensor.noise
        which, counts = np.unique(known.nearest(points[deep]), return_counts=True)
        is_gone = (which >= 0) & (counts >= self.policy.min_passes)
        gone = set(which[is_gone].tolist())
        removed = [s for n, s in enumerate(self.mapped) if n in gone]
        self.mapped = tuple(s for n, s in enumerate(self.mapped) if n not in gone)
        self.sightings = [s for s in self.sightings if all(s.mapped is not o for o in removed)]
        return bool(removed)

    def _changed_box(self, before: tuple[Solid, ...]) -> Floats:
        """Return the box (2, 3) of all differences between the previous map and the current one."""
        boxes: list[list[list[float]]] = []
        everywhere = [[-UNBOUNDED_EXTENT] * 3, [UNBOUNDED_EXTENT] * 3]
        for solids, others in ((before, self.mapped), (self.mapped, before)):
            for solid in solids:
                if all(solid is not o for o in others):
                    box = solid.shape.box()
                    boxes.append(everywhere if box is None else box.tolist())
        return np.array([np.min(boxes, axis=0)[0], np.max(boxes, axis=0)[1]])

    def _update_planner(self, world: Simulation, planner: Planner, box: Floats) -> None:
        """Give the planner its map, and the tether in it."""
        known = self._field(self.mapped)
        world.model = mission_tether(self.mission, known)
        world.believed = self._recover_tether(world, world.model)
        planner.update_map(known, world.model, box, world.vehicle.position, world.believed)

    def _recover_tether(self, world: Simulation, model: GeodesicTether) -> Tether:
        """Return the tether in another map, on the sides of new solids that explain the payout.

        The trail decides the sides of solids that have been there from the beginning. For a solid
        that appeared later, the tether at that unknown time decides. So each remembered tether is
        continued along the later trail; the one whose payout is nearest to the measured one is
        taken, the earliest if there are several.
        """
        measured = payout(world.tether, world.load)
        best, min_difference, tolerance = None, np.inf, self.policy.payout_tolerance
        for n, (nodes, count) in enumerate([(self.trail[:1], 1), *self.moments]):
            if count > len(self.trail):
                continue  # the robot has gone back past this point
            line = np.vstack([nodes, self.trail[count:], world.vehicle.position])
            line[1:-1] = pushed_out(model.field, line[1:-1], 1e-3)
            line = np.vstack([self._anchor_path_back(world, n), line])
            tether = model.drive(model.relaxed(line[[0, 0]], 1), line[1:])[0]
            difference = abs(payout(tether, world.load) - measured)
            if best is None or difference < min_difference - tolerance:
                best, min_difference, chosen, trail = tether, difference, n, line
            if min_difference <= tolerance:
                break
        assert best is not None
        if chosen:
            self.trail, self.moments, self.times, self._since = trail, [], [], world.now
        return best

    def _anchor_path_back(self, world: Simulation, n: int) -> Floats:
        """Return the path of a moving anchor back to its position at a moment."""
        if world.track is None:
            return self.trail[:0]
        since = self._since if n == 0 else self.times[n - 1]
        return world.track.between(since, world.now)[::-1]

    @property
    def scene_now(self) -> Scene:
        """Scene with the current solids."""
        return self.scene.model_copy(update={"solids": self.solids, "problem": None})

    def summary_fields(self) -> dict[str, Any]:
        """Return the numbers of events, of events that never had room, and of solids that the
        sensor added to the map, and when each event happened, in the order in which they did."""
        number = {id(event): k for k, event in enumerate(self.events)}
        return {
            "happened": len(self.happened),
            "held_back": len(self.due),
            "found": len(self.found),
            "events": [{"number": number[id(e)], "time": time} for time, e in self.happened],
        }
