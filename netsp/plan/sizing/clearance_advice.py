"""Clearance that a real vehicle needs, from flights of ArduSub 4.7 in its own simulator.

Flown paths cost up to 0.10 m of clearance in still water and 0.15 m in a current of 0.8 m/s, with
the position as the vehicle believed it; the error of that position comes on top.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.base.errors import InputError
from netsp.base.units import metres_per_unit
from netsp.model.problem import Problem


@dataclass(frozen=True)
class ClearancePolicy:
    """Policy of how much clearance a plan needs to be flown.

    Attributes
    ----------
    position_error
        Error of the vehicle's position, m: of GPS, USBL or DVL. 0 or more.
    current
        Speed of the current, m/s. 0 or more.
    path_error
        Clearance that a flown path costs in still water, m; the largest of the measured flights.
        0 or more.
    error_by_current
        Further clearance that it costs per m/s of the current, s; from flights in 0 and 0.8 m/s.
        0 or more.
    """

    position_error: float = 0.0
    current: float = 0.0
    path_error: float = 0.1
    error_by_current: float = 0.06

    def __post_init__(self) -> None:
        for name in ("position_error", "current", "path_error", "error_by_current"):
            if not 0.0 <= getattr(self, name) < float("inf"):
                raise InputError(f"{name}: expected 0 or more, got {getattr(self, name)!r}")

    @property
    def min_clearance(self) -> float:
        """Return the minimum clearance with which a plan can be flown, m.

        Examples
        --------
        >>> round(ClearancePolicy(position_error=0.3, current=0.5).min_clearance, 3)
        0.43
        """
        return self.position_error + self.path_error + self.error_by_current * self.current


@dataclass(frozen=True)
class ClearanceRoom:
    """Largest clearance that a problem can have.

    Attributes
    ----------
    max_clearance
        Distance of base, goals and robot to the nearest obstacle, in the problem's units.
    place, obstacle
        Names of the place and the obstacle at this distance.
    """

    max_clearance: float
    place: str
    obstacle: str


def clearance_room(problem: Problem) -> ClearanceRoom | None:
    """Return the largest clearance with which base, goals and robot lie in free water; None if
    there are no obstacles. Goals that already lie in obstacles, as in a run, do not count."""
    if not problem.obstacles:
        return None
    names = ["the base", *map(problem.goal_label, range(len(problem.goals)))]
    places = problem.points[:, :2]
    if problem.state is not None:
        names.append("the robot")
        places = np.vstack([places, problem.state.position[:2]])
    room = np.array([o.signed_distance(places) for o in problem.obstacles])
    room[:, (room < problem.clearance - problem.tolerance).any(axis=0)] = np.inf
    i, k = (int(n) for n in np.unravel_index(int(room.argmin()), room.shape))
    return ClearanceRoom(float(room[i, k]), names[k], problem.obstacle_label(i))


def clearance_advice(
    clearance: float,
    units: str,
    policy: ClearancePolicy | None = None,
    *,
    margin: float = 0.0,
    room: ClearanceRoom | None = None,
) -> str | None:
    """Return a line that warns of too little clearance to fly a plan, and says which number to
    raise; None if there is enough.

    Clearances in units that are not lengths are not checked.

    Parameters
    ----------
    clearance : float
        Clearance of the plan, in its units.
    units : str
        Units of the plan.
    margin : float
        Margin that the plan was made with, which counts as clearance, in its units.
    room : ClearanceRoom, optional
        Largest clearance that the problem can have.
    """
    p = policy or ClearancePolicy()
    metres = metres_per_unit(units)
    if metres is None or (clearance + margin) * metres >= p.min_clearance * (1 - 1e-9) - 1e-9:
        return None
    unit = "" if metres == 1.0 else f" {units}"
    has = f"{clearance:g} {units}" + (f" and a margin of {margin:g} {units}" if margin else "")
    needed = p.min_clearance / metres - margin
    text = (
        f"clearance: {has} is less than the {_rounded(p.min_clearance, up=True):g} m that flights "
        f"need ({_terms(p)}); "
    )
    if room is None or room.max_clearance >= needed:
        return (
            text + f"raise clearance to {_rounded(needed, up=True):g}{unit} or more and plan again"
        )
    shown = _rounded(room.max_clearance, up=False)
    less = ", or reduce the position error" if p.position_error else ""
    raised = (
        f"can be raised to {shown:g}{unit} at most" if shown > clearance else "cannot be raised"
    )
    return (
        f"{text}{room.place} is only {shown:g} {units} from {room.obstacle}, "
        f"so clearance {raised}: move {room.place}{less}"
    )


def _terms(policy: ClearancePolicy) -> str:
    """Return what the minimum clearance is made of, without terms that are zero."""
    terms = [f"{policy.path_error:g} m that the vehicle strays from its path"]
    if policy.position_error:
        terms.insert(0, f"{policy.position_error:g} m of position error")
    if policy.current:
        by_current = policy.error_by_current * policy.current
        terms.append(f"{by_current:.3g} m for a current of {policy.current:g} m/s")
    return " + ".join(terms)


def _rounded(value: float, *, up: bool) -> float:
    """Return a number rounded to three digits, up or down; rounding errors do not count."""
    if value <= 0.0:
        return 0.0
    unit = 10.0 ** (2 - math.floor(math.log10(value)))
    scaled = value * unit
    return (math.ceil(scaled - 1e-9) if up else math.floor(scaled + 1e-9)) / unit
