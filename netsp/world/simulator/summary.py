"""Summary of a mission run in numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.model.solution import tension_ratio
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import LogRow
from netsp.world.planner import Planner
from netsp.world.planner.planner import DWELL, WAIT
from netsp.world.simulator.simulation import Simulation


def summarise(
    mission: Mission, planner: Planner, world: Simulation, wall: float, interrupted: bool
) -> dict[str, Any]:
    """Return the numbers of a run that the papers report.

    `exceedance_s` is the time in which the payout, at most `longest_payout`, is over the limit. If
    the limit was lowered below the payout, the time until it fits is `shortening_s` instead.
    `waited_s` is the time in which the robot waited for a moving anchor. `stops` has each waypoint
    visited, with the sum of turning angles and the factor e^(mu theta) by which friction multiplies
    the tension. `contacts` counts contacts of the robot with solids. `recovery_s` is the time to
    come back to the anchor afterwards, by retracing the tether, or the whole path (the paper does
    not say which). Both, `path` and coverage are those of the inspection; `home` describes the path
    back to the start that follows it: whether it was `reached` with the tether free, how much
    longer the tether is there than when the mission began (`left`, m), and how long it took.

    Parameters
    ----------
    planner, world : Planner, Simulation
        States at the end.
    wall : float
        Wall-clock time of the run, s.
    """
    log = world.log
    # the inspection ends with the row after the last waypoint
    before = [
        n for n, r in enumerate(log) if r.waypoint < len(mission.waypoints) or r.mode == DWELL
    ]
    last = before[-1] + 1 if before else 0
    inspected = log[: last + 1]
    lengths = np.array([r.tether for r in log])
    payouts = np.array([r.payout for r in log])
    turnings = np.array([r.turning for r in log])
    places = np.array([[r.x, r.y, r.z] for r in inspected])
    planned = [r.replan_s for r in log if r.replan_s > 0.0]
    walked, step_s = polylines.length(places), world.policy.step_s
    inspection = inspected[-1].time if log else 0.0
    control = world.vehicle.control_s
    by_tether = inspected[-1].tether / mission.speed if log else 0.0
    by_path = walked / mission.speed
    return {
        "mission": mission.name,
        "planner": planner.name,
        "status": "interrupted" if interrupted else "done",
        "inspection_s": inspection,
        "recovery_s": {"tether": by_tether, "path": by_path},
        "total_s": {"tether": inspection + by_tether, "path": inspection + by_path},
        "path": walked,
        "tether_length": mission.tether_length,
        "longest_tether": float(lengths.max(initial=0.0)),
        "longest_payout": float(payouts.max(initial=0.0)),
        "exceedance_s": step_s * sum(_over(r) and not r.shortening for r in log),
        "shortening_s": step_s * sum(r.shortening for r in log),
        "friction": _friction(mission, turnings, step_s),
        "visited": len(planner.reached),
        "waypoints": len(set(planner.given)),
        "contacts": world.contacts,
        "left_out": [{"waypoint": k, "reason": why} for k, why in planner.left_out],
        "stops": _stops(mission, planner, log),
        "waited_s": step_s * sum(r.mode == WAIT for r in log),
        "home": _home(planner, world, inspection),
        "defects": len(planner.defects),
        "replans": len(planned),
        "replan_median_s": float(np.median(planned)) if planned else 0.0,
        "replan_worst_s": max(planned, default=0.0),
        "coverage": log[-1].coverage if world.coverage and log else None,
        "coverage_through": log[-1].coverage_through if world.coverage and log else None,
        "control_median_s": float(np.median(control)) if control else 0.0,
        "control_worst_s": max(control, default=0.0),
        "wall_s": wall,
    }


def _over(row: LogRow) -> bool:
    return row.payout > row.limit * (1 + 1e-9)


def _home(planner: Planner, world: Simulation, since: float) -> dict[str, Any]:
    """Return how the mission ended; `left` is measured once the tether has come to rest."""
    model, delta = world.tethers, world.tethers.delta
    as_laid = model.refine(model.update(planner.home_tether, world.vehicle.position)).length
    left = max(0.0, model.refine(world.tether).length - as_laid)
    return {
        "reached": planner.home,
        "tether_free": planner.home and left <= planner.policy.free_tolerance * delta,
        "left": left,
        "seconds": world.now - since if planner.is_homeward else 0.0,
        "reason": planner.home_failure,
    }


def _stops(mission: Mission, planner: Planner, log: list[LogRow]) -> list[dict[str, Any]]:
    """Return the tether at each waypoint visited."""
    arrival: dict[int, LogRow] = {}
    passed, visited = 0, set(planner.reached)
    for row in log:
        for index in range(passed, row.waypoint):
            if index in visited:
                arrival[index] = row
        passed = max(passed, row.waypoint)
    mu = mission.tether.friction
    return [
        {
            "waypoint": k,
            "tether": r.tether,
            "payout": r.payout,
            "turning_deg": math.degrees(r.turning),
            "tension_ratio": tension_ratio(mu, r.turning),
        }
        for k, r in arrival.items()
    ]


def _friction(mission: Mission, turnings: Floats, step_s: float) -> dict[str, float] | None:
    """Return the largest turning and tension ratio, and the time over the limit, s; None without
    friction."""
    physics = mission.tether
    if physics.friction == 0.0:
        return None
    max_turning = float(turnings.max(initial=0.0))
    return {
        "most_turning_deg": math.degrees(max_turning),
        "most_tension_ratio": tension_ratio(physics.friction, max_turning),
        "over_s": float((turnings > physics.max_turning * (1 + 1e-9)).sum() * step_s),
    }
