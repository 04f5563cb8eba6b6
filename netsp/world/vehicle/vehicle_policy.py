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
        Maximum turn rate of a kinematic vehicle, and of the heading that a BlueROV2 turns to,
        degrees per second.
    max_lead
        Largest distance between a BlueROV2 and the point that it follows, metres, now and in the
        next `lead_steps`. A smaller distance cuts corners less, and is slower there.
    lead_steps
        Number of control steps ahead for which `max_lead` holds, at most the controller's horizon.
        Near the horizon the controller saves thrust and falls behind, because its costs end there.
    pace_growth
        Largest factor by which the pace of that point grows from one control step to the next, more
        than 1. A smaller one finds the fastest pace more closely, and later.
    pace_cut
        Factor on the pace for the next try if the vehicle would fall behind, less than 1. A smaller
        one tries fewer paces, and flies slower than necessary.
    min_pace
        Slowest pace that is tried, as a share of the cruise speed, at most 1; below it, the point
        waits for the vehicle.
    max_iterations
        Largest number of iterations of the controller at one pace. With more, it finds faster paces
        around corners, and takes longer.
    integration_steps
        Integration steps of its dynamics in one control step.
    drift_gain
        Share of an unexpected drift in one step that its controller attributes to the current, at
        most 1. A smaller gain averages more, and learns a current later.
    control
        Policy of its controller.
    """

    max_turn_rate_deg: float = 60.0
    max_lead: float = 0.15
    lead_steps: int = 10
    pace_growth: float = 1.1
    pace_cut: float = 0.7
    min_pace: float = 0.1
    max_iterations: int = 2
    integration_steps: int = 5
    drift_gain: float = 0.3
    control: ControlPolicy = ControlPolicy()

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "drift_gain", "pace_cut", "min_pace")
        if self.lead_steps > (horizon := self.control.horizon):
            raise InputError(
                f"lead_steps: expected at most the horizon, {horizon}, got {self.lead_steps!r}"
            )
        if self.pace_growth <= 1.0:
            raise InputError(f"pace_growth: expected more than 1, got {self.pace_growth!r}")
        if self.pace_cut >= 1.0:
            raise InputError(f"pace_cut: expected less than 1, got {self.pace_cut!r}")
