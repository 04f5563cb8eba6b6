"""Predicted time of a flight: a tour flown in GUIDED, from target to target, in still water."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from netsp.base.arrays import Floats
from netsp.base.field_types import Point3
from netsp.exchange.missions.leg_times import VehicleMotion, target_times
from netsp.exchange.missions.mission_files import altitude
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.online.execute.execution_log import ExecutionRow
from netsp.online.fly.flight_policy import FlightPolicy
from netsp.plan.tour_plan import legs_of


@dataclass(frozen=True)
class FlightTime:
    """Predicted times of the legs of a tour.

    Attributes
    ----------
    goals
        Goal of each leg in the order of the tour, `netsp.plan.tour_plan.HOME` for the
        base.
    leg_s
        Time of each leg, s.
    """

    goals: tuple[int, ...]
    leg_s: tuple[float, ...]

    @property
    def total_s(self) -> float:
        """Time of the flight, s."""
        return sum(self.leg_s)


def predicted_flight(
    problem: Problem,
    solution: Solution,
    speed: float,
    reach: float,
    policy: FlightPolicy = FlightPolicy(),
    motion: VehicleMotion | None = None,
) -> FlightTime:
    """Return the times that `fly` takes for a tour.

    Parameters
    ----------
    problem : Problem
        Problem that was solved.
    solution : Solution
        Tour that is flown.
    speed : float
        Horizontal speed of the vehicle, m/s.
    reach : float
        Distance to a vertex at which the next target is sent, m.
    policy : FlightPolicy
        Limits of the flight; the largest change of depth between targets counts.
    motion : VehicleMotion, optional
        Motion of the vehicle; by default that of ArduSub without changes.
    """
    legs = legs_of(problem, solution)
    places = [_target(legs[0].path[0])]
    counts = []
    for leg in legs:
        before = len(places)
        for a, b in pairwise(leg.path):
            places += _targets_to(_target(a), _target(b), reach, policy.max_depth_step)
        counts.append(len(places) - before)
    times = iter(target_times(places, reach, speed, motion, notice_s=policy.notice_s))
    return FlightTime(
        tuple(leg.goal for leg in legs),
        tuple(sum(next(times) for _ in range(count)) for count in counts),
    )


class FlightClock:
    """Predicted total of a flight under way: the time elapsed and the time of the legs left.

    Parameters
    ----------
    predicted : FlightTime
        Prediction from before the flight.
    """

    def __init__(self, predicted: FlightTime) -> None:
        self._predicted, self._leg = predicted, 0
        self._total_s: float | None = predicted.total_s

    def total_s(self, row: ExecutionRow) -> float | None:
        """Return the seconds that the whole flight will take; None once the plan was changed.

        Parameters
        ----------
        row : ExecutionRow
            Row of the flight's log; rows must be passed in their order.
        """
        if self._total_s is None:
            return None
        goals, leg_s = self._predicted.goals, self._predicted.leg_s
        if row.goal != goals[self._leg]:
            self._leg += 1
            if row.mode == "hold" or self._leg == len(goals) or row.goal != goals[self._leg]:
                self._total_s = None
                return None
            self._total_s = row.time + sum(leg_s[self._leg :])
        self._total_s = max(self._total_s, row.time)
        return self._total_s


def _target(place: Floats) -> Point3:
    x, y, z = (float(v) for v in place)
    return x, y, altitude(z)


def _targets_to(a: Point3, b: Point3, reach: float, max_depth_step: float) -> list[Point3]:
    """Return the targets on the path to a vertex, as the flight sends them on a sloping leg."""
    if math.dist(a[:2], b[:2]) <= 2.0 * reach:
        return [b]
    count = max(1, math.ceil(abs(b[2] - a[2]) / max_depth_step))
    return [
        *(
            (
                a[0] + (b[0] - a[0]) * k / count,
                a[1] + (b[1] - a[1]) * k / count,
                a[2] + (b[2] - a[2]) * k / count,
            )
            for k in range(1, count)
        ),
        b,
    ]
