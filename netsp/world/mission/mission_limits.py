"""Checks of a mission before it is simulated: names exist, and numbers make sense."""

from __future__ import annotations

import numpy as np

from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.world.mission.anchor_track import AnchorTrack
from netsp.world.mission.mission import Mission
from netsp.world.planner import PLANNERS
from netsp.world.scene.scene import Scene
from netsp.world.simulator.simulation_policy import MissionLimits, SimulationPolicy
from netsp.world.tether import TETHERS
from netsp.world.vehicle import VEHICLES


def check_names(planner: object, vehicle: object, tether: object) -> None:
    """Raise InputError for a planner, vehicle or tether model that does not exist.

    It is called before the scene is read, which takes longer.
    """
    for known, name in ((PLANNERS, planner), (VEHICLES, vehicle), (TETHERS, tether)):
        if not callable(name):
            known.named(name)


def check_bounds(mission: Mission, scene: Scene) -> None:
    """Raise InputError for a place of a mission outside the bounds of its scene."""
    if scene.bounds is None:
        return
    low, high = np.array(scene.bounds[:3]), np.array(scene.bounds[3:])
    named = [("anchor", mission.anchor), ("start", mission.start)]
    named += [] if mission.state is None else [("state.position", mission.state.position)]
    for k, w in enumerate(mission.waypoints):
        named.append((f"waypoints[{k}]", w.position))
        named += [
            (f"waypoints[{k}].alternatives[{c}]", v.position) for c, v in enumerate(w.alternatives)
        ]
    for name, place in named:
        if (np.array(place) < low).any() or (np.array(place) > high).any():
            shown = ", ".join(f"{v:g}" for v in place)
            raise InputError(
                f"{name}: ({shown}) lies outside of the scene's bounds "
                f"{[float(v) for v in scene.bounds]}; expected a place within, or wider bounds"
            )


def check_tether(mission: Mission, length: float) -> None:
    """Raise InputError if a length, metres, of the taut tether at the beginning is over the
    limit."""
    if length > mission.tether_length:
        raise InputError(
            f"tether_length: {mission.tether_length:g} is shorter than the path from anchor to "
            f"start, {length:.4g}"
        )


def check_size(mission: Mission, policy: SimulationPolicy = SimulationPolicy()) -> None:
    """Raise InputError for a mission that would take too long, or whose numbers make no sense."""
    for name, value in (("delta", mission.delta), ("reach", mission.reach)):
        if value > mission.tether_length:
            raise InputError(
                f"{name}: {value:g} is more than the tether_length {mission.tether_length:g}; "
                "expected far less: mixed units?"
            )
    _check_track(mission, policy)
    _check_waypoints(mission, policy)
    _check_reserve(mission)
    _check_water(mission, policy.limits)
    nodes, max_nodes = mission.tether_length / mission.delta, policy.limits.max_tether_nodes
    if nodes > max_nodes:
        raise InputError(
            f"delta: {mission.delta:g} makes {nodes:.2g} nodes of a tether; expected at most "
            f"{max_nodes:g}"
        )


def _check_track(mission: Mission, policy: SimulationPolicy) -> None:
    track = AnchorTrack.for_mission(mission)
    if track is None:
        return
    max_steps, step_s = policy.limits.max_steps, policy.step_s
    k = int(track.speeds.argmax())
    if track.speed >= mission.speed:
        raise InputError(
            f"track[{k}]: the anchor moves at {track.speed:.3g} m/s, the robot at "
            f"{mission.speed:g}: it would outrun the tether; expected a slower one"
        )
    if track.end / step_s > max_steps:
        raise InputError(
            f"track: its {track.end:g} s take more than {max_steps:g} steps of {step_s:g} s"
        )


def _check_waypoints(mission: Mission, policy: SimulationPolicy) -> None:
    places, step_s = mission.every_place[1:], policy.step_s
    max_ratio, max_steps = policy.limits.max_distance_ratio, policy.limits.max_steps
    farthest = float(np.abs(places - np.array(mission.anchor)).max())
    if farthest > max_ratio * mission.tether_length:
        raise InputError(
            f"waypoints: one is {farthest:g} from the anchor; expected at most {max_ratio:g} "
            f"times the tether_length {mission.tether_length:g}: mixed units?"
        )
    steps = polylines.length(places[: len(mission.waypoints) + 1]) / (mission.speed * step_s)
    if steps > max_steps:
        raise InputError(
            f"speed: {mission.speed:g} takes {steps:.2g} steps of {step_s:g} s for the waypoints; "
            f"expected at most {max_steps:g}"
        )
    stays = sum(w.dwell for w in mission.waypoints) / step_s
    if stays > max_steps:
        raise InputError(
            f"waypoints: dwell takes {stays:.2g} steps of {step_s:g} s in all; expected at most "
            f"{max_steps:g}"
        )


def _check_reserve(mission: Mission) -> None:
    sensor = mission.sensor
    reserve = sensor.reserve(mission.speed)
    if reserve > 0.5 * mission.tether_length:
        raise InputError(
            f"sensor: noise {sensor.noise:g} and delay {sensor.delay:g} ask for {reserve:.3g} m of "
            f"tether in reserve; expected at most half of the tether_length "
            f"{mission.tether_length:g}"
        )


def _check_water(mission: Mission, limits: MissionLimits) -> None:
    load = mission.tether.load(np.array(mission.current))
    speed = float(np.linalg.norm(mission.current)) + 3.0 * mission.gusts
    if speed > limits.max_water_speed:
        raise InputError(
            f"current, gusts: water of {speed:g} m/s; expected at most "
            f"{limits.max_water_speed:g}: mixed units?"
        )
    sag = load.drag * speed**2 * mission.tether_length / load.tension
    if sag > limits.max_drag_ratio:
        raise InputError(
            f"current: {speed:g} m/s pulls on {mission.tether_length:g} m of tether with {sag:.3g} "
            f"times its tension of {load.tension:g} N; expected at most "
            f"{limits.max_drag_ratio:g}: mixed units?"
        )
