"""The order in which a mission gives its waypoints, as a tour: the first one that a search has.

The planner `predictive` is asked at the stops only, and the tether is driven along its paths: what
comes of that is its flight without the time that a flight takes to simulate.
"""

from __future__ import annotations

import numpy as np

from netsp.geometry import polylines
from netsp.online.planner import PlannerOptions
from netsp.online.planner.base import DONE
from netsp.online.planner.predictive import PredictivePlanner
from netsp.space.board import Driven
from netsp.space.driven_legs import LegTo, drive_legs
from netsp.space.water import Water

MOST_STEPS = 8
"""Paths that the planner may lay for each waypoint; more, and it does not get on."""


def drive_given_order(water: Water) -> Driven | None:
    """Drive a mission in the order of its file.

    Parameters
    ----------
    water : Water
        Of the mission; legs of its tour are taken where it has one.

    Returns
    -------
    Driven or None
        The tour; None where the robot does not come home with the tether free, within its limit
        and off the solids.
    """
    mission = water.mission
    if mission.tour is not None:
        paths = [np.array(stop.path) for stop in mission.tour.stops]
        legs = [LegTo(k, 0, path) for k, path in enumerate(paths)]
        return drive_legs(water, legs, np.array(mission.tour.home))
    planner = PredictivePlanner(
        mission, water.field, water.model, water.grid, PlannerOptions(prepared=False)
    )
    planner.laid = water.laid
    robot, tether = np.array(mission.begin), water.present
    walked, legs = [robot], []
    for _ in range(MOST_STEPS * (2 + len(mission.waypoints))):
        before = len(planner.reached)
        command = planner.step(robot, tether)
        for k in planner.reached[before:]:
            path = np.array(walked if len(walked) > 1 else [robot, robot])
            legs.append(LegTo(k, 0, path))
            walked = [robot]
        if command.mode == DONE:
            break
        path = np.vstack([robot, command.path])
        tether = water.model.drive(tether, polylines.dense(path, mission.delta))[0]
        walked += list(command.path)
        robot = command.path[-1]
        planner.passed(len(command.path))
    if not planner.home:
        return None
    return drive_legs(water, legs, np.array(walked if len(walked) > 1 else [robot, robot]))
