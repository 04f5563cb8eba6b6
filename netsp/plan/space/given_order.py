"""Tours in a given order of waypoints: that of the mission file, the first incumbent, or another.

The planner `predictive` plans at the waypoints only, and the tether is driven along its paths. The
result is the tour of a simulated flight, without the time that a simulation takes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.clock import Clock
from netsp.base.geometry import polylines
from netsp.plan.space.board import DrivenTour
from netsp.plan.space.driven_legs import LegTo, drive_legs
from netsp.plan.space.planning_context import PlanningContext
from netsp.world.planner import PlannerOptions
from netsp.world.planner.planner import DONE
from netsp.world.planner.predictive import PredictivePlanner


def drive_given_order(context: PlanningContext) -> DrivenTour | None:
    """Drive a mission in the order of its file, whatever the time. If the mission has a tour, drive
    its legs.

    Returns
    -------
    DrivenTour or None
        The tour; None if the robot does not come home with a free tether, exceeds the limit of the
        tether, or comes too near to solids.
    """
    mission = context.mission
    if mission.tour is not None:
        paths = [np.array(stop.path) for stop in mission.tour.stops]
        legs = [LegTo(k, 0, path) for k, path in enumerate(paths)]
        return drive_legs(context, legs, np.array(mission.tour.home))
    return drive_order(context, [(k, 0) for k in range(len(mission.waypoints))], Clock())


def drive_order(
    context: PlanningContext, order: Sequence[tuple[int, int]], clock: Clock
) -> DrivenTour | None:
    """Drive a mission in some order of its waypoints.

    Parameters
    ----------
    order : sequence of (int, int)
        Number of each waypoint, and of its alternative, from 1 on; 0 for the waypoint's position.
    clock : Clock
        Clock of the run; when it is up, there is no tour.

    Returns
    -------
    DrivenTour or None
        The tour; None if the robot does not come home with a free tether, exceeds the limit of the
        tether, or comes too near to solids.
    """
    mission = context.mission
    waypoints = tuple(mission.waypoints[n].at(choice) for n, choice in order)
    ordered = mission.model_copy(update={"waypoints": waypoints, "tour": None})
    planner = PredictivePlanner(
        ordered, context.field, context.model, context.grid, PlannerOptions(prepared=False)
    )
    planner.laid = context.start_tether
    robot, tether = np.array(mission.begin), context.present_tether
    walked, legs = [robot], []
    for _ in range(context.policy.orders.max_paths_per_waypoint * (2 + len(order))):
        if clock.is_up:
            return None
        before = len(planner.reached)
        command = planner.step(robot, tether)
        for k in planner.reached[before:]:
            path = np.array(walked if len(walked) > 1 else [robot, robot])
            legs.append(LegTo(*order[k], path))
            walked = [robot]
        if command.mode == DONE:
            break
        path = np.vstack([robot, command.path])
        tether = context.model.drive(tether, polylines.dense(path, mission.delta))[0]
        walked += list(command.path)
        robot = command.path[-1]
        planner.drop_passed(len(command.path))
    if not planner.home:
        return None
    return drive_legs(context, legs, np.array(walked if len(walked) > 1 else [robot, robot]))
