"""Policies of the execution and the repair of a tour."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class RepairPolicy:
    """Policy of repairs. All numbers are positive.

    Attributes
    ----------
    time_limit_s
        Default of `ExecutionOptions.planning_limit`, the time that a repair may take, s. The robot
        holds its place meanwhile: a longer limit finds better orders for a later start.
    max_classes
        Maximum number of classes of the tether in a repair; if there are more, each goal keeps the
        shortest.
    """

    time_limit_s: float = 2.0
    max_classes: int = 4_000

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class ExecutePolicy:
    """Policy of the execution of a tour. All numbers are positive.

    Attributes
    ----------
    dynamic_step_s
        Step of a simulated vehicle with dynamics, s.
    live_step_s
        Step of a vehicle that is not simulated, s.
    hold_step_s
        Time between two rows of the log while the robot holds its place, s.
    tether_rows
        Rows of the log between two tethers kept for pictures.
    max_leg_time_ratio, leg_grace_s
        Time after which the goal of a leg is left out: a multiple of the time that the leg should
        take, plus a grace time, s.
    min_obstacle_ratio
        Size of an obstacle over the tether's length, below which an obstacle that appears on a
        georeferenced site was given in degrees.
    state_interval_s
        Time between two states of a run from which it can be resumed, s.
    repair
        Policy of repairs.
    """

    dynamic_step_s: float = 0.1
    live_step_s: float = 0.2
    hold_step_s: float = 0.1
    tether_rows: int = 10
    max_leg_time_ratio: float = 3.0
    leg_grace_s: float = 60.0
    min_obstacle_ratio: float = 1e-4
    state_interval_s: float = 1.0
    repair: RepairPolicy = RepairPolicy()

    def __post_init__(self) -> None:
        check_positive(self)
