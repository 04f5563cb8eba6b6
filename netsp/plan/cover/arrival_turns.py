"""Turns at viewpoints: how far a robot has to turn after it has arrived.

On its way the robot turns to the nearest patch (`netsp.world.simulator.coverage`), no faster than
its turn rate. Where another part of the structure is nearest shortly before it arrives, a turn is
left, so the turn depends on the direction from which the robot comes. That direction is not known
before the tour is, so the turn is a mean over directions.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.plan.cover.viewpoints import Viewer
from netsp.world.simulator.simulation_policy import SimulationPolicy
from netsp.world.vehicle.vehicle_policy import VehiclePolicy


def expected_turns(viewer: Viewer, places: Floats, headings: Floats, speed: float) -> Floats:
    """Return the turns (n,) that are left at viewpoints on arrival, in the mean over directions.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Places, metres.
    headings : ndarray, shape (n,)
        Headings, radians; NaN for none, which takes no turn.
    speed : float
        Speed of the robot, m/s.

    Returns
    -------
    ndarray, shape (n,)
        Radians, without the last degrees up to which a turn counts as complete.
    """
    policy = viewer.policy
    tolerance = math.radians(SimulationPolicy().heading_tolerance_deg)
    rate = math.radians(VehiclePolicy().max_turn_rate_deg)
    axes = [np.array(d, dtype=float) for d in itertools.product((-1, 0, 1), repeat=3)]
    directions = [d / np.linalg.norm(d) for d in axes if d.any()]
    distinct, which = np.unique(places, axis=0, return_inverse=True)
    which = which.ravel()
    at_place = np.maximum(_turns(viewer, distinct, which, headings) - tolerance, 0.0)
    total, count = np.zeros(len(places)), np.zeros(len(places))
    for direction in directions:
        left, is_free = at_place, np.ones(len(distinct), dtype=bool)
        is_used = is_free
        for number, seconds in enumerate(sorted(policy.approach_times)):
            before = distinct - speed * seconds * direction
            is_free = is_free & (viewer.field.distance(before) >= viewer.clearance)
            turns = _turns(viewer, before, which, headings) - rate * seconds - tolerance
            left = np.where(is_free[which], np.maximum(left, turns), left)
            if number == 0:
                is_used = is_free
        total += np.where(is_used[which], left, 0.0)
        count += is_used[which]
    turns = np.where(count > 0, total / np.maximum(count, 1.0), at_place)
    return np.where(np.isnan(headings), 0.0, turns)


def _turns(viewer: Viewer, places: Floats, which: Ints, headings: Floats) -> Floats:
    """Return the angles (n,) between the heading of a robot on its way and given headings.

    Parameters
    ----------
    places : ndarray, shape (k, 3)
        Distinct places on the way, metres.
    which : ndarray of int, shape (n,)
        Number of the place of each heading.
    """
    known: Bools
    arrival, known = viewer.arrival_headings(places)
    turns = np.abs((headings - arrival[which] + math.pi) % (2.0 * math.pi) - math.pi)
    return np.where(known[which], turns, math.radians(viewer.policy.free_turn_deg))
