"""Log of an execution: rows, arrivals, events and the summary."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.base.data_frames import frame_of
from netsp.base.errors import counted
from netsp.base.field_types import Point3
from netsp.base.reprs import Drawn
from netsp.hsignature import Word
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.online.execute.execute_policy import ExecutePolicy, RepairPolicy
from netsp.online.execute.repair_rule import HOMEWARD, LOCAL, REPLANNED
from netsp.online.execute.tether_limits import (
    LimitPeriod,
    Overrun,
    describe_limits,
    limit_periods,
    overruns,
)
from netsp.online.execute.tether_reserve import ReservePolicy
from netsp.plan.tour_plan import HOME

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class ExecutionOptions:
    """Options of an execution.

    Parameters
    ----------
    speed : float
        Speed of the vehicle, length units per second.
    vehicle : str
        Name of a vehicle (`netsp.world.vehicle.VEHICLES`).
    reach : float
        Distance at which a vehicle with dynamics has visited a goal, in the problem's units.
    delta : float, optional
        Resolution of the tether, in the problem's units; by default from the problem.
    repair : bool
        Whether plans are repaired.
    planning_limit : float
        Seconds that a repair may take; the robot holds its place meanwhile.
    current : tuple of float
        Velocity (x, y, z) of the water, length units per second.
    gusts : float
        Standard deviation of the velocity about the current, length units per second.
    seed : int
        Seed of the gusts and of the solver.
    reserve_policy : ReservePolicy
        Policy of the tether that repairs keep in reserve.
    policy : ExecutePolicy
        Steps and thresholds.
    """

    speed: float = 0.5
    vehicle: str = "kinematic"
    reach: float = 0.1
    delta: float | None = None
    repair: bool = True
    planning_limit: float = RepairPolicy.time_limit_s
    current: Point3 = (0.0, 0.0, 0.0)
    gusts: float = 0.0
    seed: int = 0
    reserve_policy: ReservePolicy = field(default_factory=ReservePolicy)
    policy: ExecutePolicy = ExecutePolicy()


@dataclass(frozen=True)
class ExecutionRow:
    """Row of the log: one step.

    Parameters
    ----------
    time : float
        Seconds since the start.
    x, y, z : float
        Position, z up, in the problem's units.
    goal : int
        Next goal, -1 for the base.
    mode : {"tour", "shorten", "hold"}
        What the robot is doing.
    tether : float
        Length of the taut tether, in the problem's units.
    limit : float
        Maximum length of the tether, in the problem's units.
    shortening : bool
        Whether the limit was lowered below the tether, which is being shortened.
    over : bool
        Whether the tether is longer than the limit.
    """

    time: float
    x: float
    y: float
    z: float
    goal: int
    mode: str
    tether: float
    limit: float
    shortening: bool = False
    over: bool = False


@dataclass(frozen=True)
class Arrival:
    """Arrival at a goal or the base.

    Parameters
    ----------
    time : float
        Seconds since the start.
    goal : int
        The goal, -1 for the base.
    word, planned : Word
        Words of the tether and of the planned one.
    tether, planned_tether : float
        Lengths of the tether and of the planned one, in the problem's units.
    """

    time: float
    goal: int
    word: Word
    planned: Word
    tether: float
    planned_tether: float

    @property
    def as_planned(self) -> bool:
        """True if the tether is in the planned class."""
        return self.word == self.planned


@dataclass(frozen=True)
class Entry:
    """Event, and the response to it.

    Parameters
    ----------
    time : float
        Seconds since the start.
    event, response, reason : str
        What happened, what was done about it, and why.
    planning_s : float
        Time of planning, s.
    """

    time: float
    event: str
    response: str
    reason: str
    planning_s: float = 0.0


@dataclass
class Execution(Drawn):
    """Result of an execution.

    Parameters
    ----------
    problem : Problem
        The problem at the end.
    solution : Solution
        The plan at the start.
    options : ExecutionOptions
        Options of the execution.
    rows : list of ExecutionRow
        Rows, one for each step.
    arrivals : list of Arrival
        Goals reached.
    entries : list of Entry
        Events and responses.
    left_out : dict
        Goals left out, with the reason.
    cancelled : dict
        Cancelled goals, with the time, seconds since the start.
    tethers : list of (float, ndarray)
        Times and nodes of the tether at intervals, for pictures.
    free : bool
        Whether the tether is free at the end.
    walked : float
        Length of the path travelled, in the problem's units.
    interrupted : bool
        Whether it was interrupted.
    wall_s : float
        Wall-clock time of the run, s.
    stopped : str
        Why a vehicle that is not simulated had to stop; empty if it had not.
    maps : list of (float, Problem)
        Problem from each of some times on; the first from 0.
    reserve : float
        Length of tether that repairs keep where they can, in the problem's units.
    """

    picture: ClassVar[str] = "netsp.view.pictures.execution:draw_map"

    problem: Problem
    solution: Solution
    options: ExecutionOptions
    rows: list[ExecutionRow] = field(default_factory=list)
    arrivals: list[Arrival] = field(default_factory=list)
    entries: list[Entry] = field(default_factory=list)
    left_out: dict[int, str] = field(default_factory=dict)
    cancelled: dict[int, float] = field(default_factory=dict)
    tethers: list[tuple[float, Floats]] = field(default_factory=list)
    free: bool = False
    walked: float = 0.0
    interrupted: bool = False
    wall_s: float = 0.0
    stopped: str = ""
    maps: list[tuple[float, Problem]] = field(default_factory=list)
    reserve: float = 0.0

    def to_frame(self) -> pandas.DataFrame:
        """Return the steps as a pandas DataFrame, a column per field of `ExecutionRow`.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        return frame_of(self.rows)

    def __repr__(self) -> str:
        """Return problem and results in one line."""
        s = self.summary
        tethers = ", then ".join(f"{p.longest:.4g} of {p.limit:g}" for p in self.limit_periods)
        return (
            f"<Execution of {self.problem.name!r}: {counted(s['visited'], 'goal')} in "
            f"{s['time_s']:.1f} s, longest tether {tethers or 'never out'}>"
        )

    @property
    def limit_periods(self) -> list[LimitPeriod]:
        """Longest tether under each limit, in the order of the limits."""
        t, tether, limit, _ = self._lengths
        return limit_periods(t, tether, limit)

    @property
    def overruns(self) -> list[Overrun]:
        """Times in which the tether was over its limit."""
        return overruns(*self._lengths)

    @property
    def _lengths(self) -> tuple[Floats, Floats, Floats, Bools]:
        """Time, tether, limit, and whether it is being shortened, by rows."""
        return (
            np.array([r.time for r in self.rows]),
            np.array([r.tether for r in self.rows]),
            np.array([r.limit for r in self.rows]),
            np.array([r.shortening for r in self.rows], dtype=bool),
        )

    @property
    def summary(self) -> dict[str, Any]:
        """Numbers of the execution.

        `limits` has the longest tether under each limit, `over_limit` every time in which the
        tether was longer: `exceedance_s` is their sum, except for those after the limit was
        lowered below the tether, until it fits, whose sum is `shortening_s`.
        """
        over = self.overruns
        goals = [a for a in self.arrivals if a.goal != HOME]
        return {
            "problem": self.problem.name,
            "status": "interrupted" if self.interrupted else "stopped" if self.stopped else "done",
            "time_s": self.rows[-1].time if self.rows else 0.0,
            "path": self.walked,
            "planned_path": self.solution.length,
            "visited": len(goals),
            "arrivals_as_planned": sum(a.as_planned for a in self.arrivals),
            "left_out": [{"goal": g, "reason": why} for g, why in sorted(self.left_out.items())],
            "cancelled": sorted(self.cancelled),
            "cancelled_s": [round(self.cancelled[g], 6) for g in sorted(self.cancelled)],
            "longest_tether": max((r.tether for r in self.rows), default=0.0),
            "tether_length": self.problem.tether_length,
            "reserve": self.reserve,
            "limits": [asdict(p) for p in self.limit_periods],
            "over_limit": [asdict(o) for o in over],
            "exceedance_s": sum((o.seconds for o in over if not o.shortening), 0.0),
            "shortening_s": sum((o.seconds for o in over if o.shortening), 0.0),
            "home": bool(self.arrivals and self.arrivals[-1].goal == HOME),
            "tether_free": self.free,
            "defects": sum(e.response == "defect" for e in self.entries),
            "repairs": sum(e.response in (LOCAL, REPLANNED, HOMEWARD) for e in self.entries),
            "planning_worst_s": max((e.planning_s for e in self.entries), default=0.0),
            "wall_s": self.wall_s,
        }


def describe_execution(done: Execution) -> str:
    """Return an execution in a few lines."""
    s, units = done.summary, done.problem.units
    planned = s["planned_path"] or 0.0
    has_resumed = any(e.event == "resumed" for e in done.entries)
    is_comparable = not (s["cancelled"] or s["left_out"] or has_resumed)
    lines = [
        f"run      {s['problem']}: {s['status']} after {s['time_s']:.1f} s"
        + (f": {done.stopped}" if done.stopped else ""),
        f"visited  {counted(s['visited'], 'goal')}{_class_of(done.arrivals)}",
        f"path     {s['path']:.6g} {units}"
        + (f", {_beside(s['path'] / planned)}" if planned and is_comparable else ""),
        f"tether   {describe_limits(done.limit_periods, done.overruns, units)}; "
        + (
            "recovered free at the base" if s["tether_free"] and s["home"] else "not recovered free"
        ),
    ]
    for e in done.entries:
        lines += [
            f"event    {e.event} at {e.time:.1f} s: {e.response}, planned in {e.planning_s:.2f} s",
            f"         {e.reason}",
        ]
    lines += [
        f"left out {done.problem.goal_label(x['goal'])}: {x['reason']}" for x in s["left_out"]
    ]
    lines += [f"cancelled {done.problem.goal_label(g)}" for g in s["cancelled"]]
    return "\n".join(lines)


def _class_of(arrivals: list[Arrival]) -> str:
    """Return words for the number of arrivals, home among them, in another class than planned."""
    others = sum(not a.as_planned for a in arrivals)
    if not others:
        return ", the tether always in the class of the plan in force"
    return f", the tether in another class than planned at {others} of {len(arrivals)} arrivals"


def _beside(ratio: float) -> str:
    """Return words for the ratio of a path to the planned one."""
    if abs(ratio - 1.0) < 1e-4:
        return "as planned"
    return f"{100 * abs(ratio - 1.0):.2f} % {'longer' if ratio > 1.0 else 'shorter'} than planned"
