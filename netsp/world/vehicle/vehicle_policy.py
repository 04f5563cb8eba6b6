"""Policies of the simulated vehicles."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_positive, check_shares


@dataclass(frozen=True)
class ControlPolicy:
    """Policy of the predictive controller of a BlueROV2. All numbers are positive.

    Attributes
    ----------
    horizon
        Number of control steps that the controller looks ahead.
    step_s
        Length of a control step, s.
    state_cost
        Weights of squared errors: three of the position (m), one of the heading (rad), three of the
        velocity (m/s) and one of the turn rate (rad/s).
    thrust_cost
        Weight of squared thrusts, N. A larger weight saves power and follows less closely.
    change_cost
        Weight of squared changes of thrust from step to step, N.
    max_newton_steps
        Maximum number of steps in the solution of a quadratic program.
    """

    horizon: int = 20
    step_s: float = 0.1
    state_cost: tuple[float, ...] = (200.0, 200.0, 200.0, 10.0, 5.0, 5.0, 5.0, 1.0)
    thrust_cost: float = 4e-3
    change_cost: float = 4e-3
    max_newton_steps: int = 30

    def __post_init__(self) -> None:
        check_positive(self)
        if len(self.state_cost) != 8:
            raise InputError(f"state_cost: expected 8 weights, got {len(self.state_cost)}")


@dataclass(frozen=True)
class VehiclePolicy:
    """Policy of the simulated vehicles. All numbers are positive.

    Attributes
    ----------
    max_turn_rate_deg
        Maximum turn rate of a kinematic vehicle, degrees per second.
    max_lead
        Largest distance by which the point that a BlueROV2 follows runs ahead of it, metres.
    integration_steps
        Integration steps of its dynamics in one control step.
    drift_gain
        Share of an unexpected drift in one step that its controller attributes to the current, at
        most 1. A smaller gain averages more, and learns a current later.
    control
        Policy of its controller.
    """

    max_turn_rate_deg: float = 60.0
    max_lead: float = 0.25
    integration_steps: int = 5
    drift_gain: float = 0.3
    control: ControlPolicy = ControlPolicy()

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "drift_gain")
