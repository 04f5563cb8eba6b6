"""Model-predictive control by real-time iteration: one quadratic program per control step.

Diehl, Bock and Schloeder, "A real-time iteration scheme for nonlinear optimization in optimal
feedback control", SIAM J. Control Optim. 43(5), 2005: the model is linearised along the last
solution, moved on by one step, and the resulting quadratic program is solved once. States are
eliminated; 100 thrusts between bounds remain. A few steps of Bertsekas' projected Newton method
("Projected Newton methods for optimization problems with simple constraints", SIAM J. Control
Optim. 20(2), 1982) solve it. Matrices are multiplied by plain loops, because BLAS starts threads
for products this small, which wait for one another.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.compiled.dynamic_array import write_floats
from netsp.base.compiled.kernel import kernel
from netsp.world.vehicle.dynamics import ALLOCATION, MAX_THRUST, step_into, step_jacobians
from netsp.world.vehicle.vehicle_policy import ControlPolicy


class ControlWeights(NamedTuple):
    """`ControlPolicy` for the kernel, with the weights of the state as an array (8,)."""

    step_s: float
    state: Floats
    thrust: float
    change: float
    max_thrust: float
    max_newton_steps: int


class PredictiveControl:
    """Controller that keeps the thrusts (horizon, 5) of its last solution, N."""

    def __init__(self, policy: ControlPolicy = ControlPolicy()) -> None:
        self.thrusts = np.zeros((policy.horizon, 5))
        self._weights = ControlWeights(
            policy.step_s,
            np.array(policy.state_cost),
            policy.thrust_cost,
            policy.change_cost,
            MAX_THRUST,
            policy.max_newton_steps,
        )

    def force(self, state: Floats, aims: Floats, water: Floats) -> Floats:
        """Return the input (4,) of the next step, which the thrusters can produce.

        Parameters
        ----------
        state : ndarray, shape (8,)
            State of the vehicle, see `dynamics`.
        aims : ndarray, shape (horizon, 8)
            Desired states after each step.
        water : ndarray, shape (3,)
            Estimated velocity of the water, m/s.
        """
        thrusts = self.improved(self.guess, state, aims, water)
        return self.apply(thrusts)

    @property
    def guess(self) -> Floats:
        """Last solution (horizon, 5), moved on by one step, N."""
        return np.vstack([self.thrusts[1:], self.thrusts[-1:]])

    def improved(self, guess: Floats, state: Floats, aims: Floats, water: Floats) -> Floats:
        """Return the thrusts (horizon, 5) after one iteration from a guess (horizon, 5), N, without
        applying them; see `force` for the other parameters."""
        before, weights = self.thrusts[0], self._weights
        return np.asarray(improved_thrusts(guess, before, state, aims, water, ALLOCATION, weights))

    def error(self, thrusts: Floats, state: Floats, aims: Floats, water: Floats) -> float:
        """Return the largest distance between the vehicle and its aim, metres, after any of the
        next steps.

        Parameters
        ----------
        thrusts : ndarray, shape (n, 5)
            Thrusts of the next steps, N.
        state, aims, water
            See `force`; at least n aims.
        """
        step_s = self._weights.step_s
        return float(largest_error(thrusts, state, aims, water, ALLOCATION, step_s))

    def apply(self, thrusts: Floats) -> Floats:
        """Return the input (4,) of the next step by thrusts (horizon, 5), N; the next solution
        starts from them."""
        self.thrusts = thrusts
        return np.asarray(ALLOCATION @ thrusts[0])


@kernel
def largest_error(
    thrusts: Floats, state: Floats, aims: Floats, water: Floats, allocation: Floats, step_s: float
) -> float:
    """Return the largest distance, metres, between the position and its aim after any step, if the
    thrusts (n, m) are applied from a state on."""
    n, m = thrusts.shape
    now, after, room = state.copy(), np.empty(8), np.empty((5, 8))
    force, worst = np.empty(4), 0.0
    for k in range(n):
        force[:] = 0.0
        for i in range(m):
            force += thrusts[k, i] * allocation[:, i]
        step_into(after, now, force, water, step_s, room)
        write_floats(now, after, 8)
        squared = 0.0
        for i in range(3):
            squared += (now[i] - aims[k, i]) ** 2
        worst = max(worst, squared)
    return math.sqrt(worst)


@kernel
def improved_thrusts(
    guess: Floats,
    before: Floats,
    state: Floats,
    aims: Floats,
    water: Floats,
    allocation: Floats,
    weights: ControlWeights,
) -> Floats:
    """Return the thrusts (n, m) after one iteration from a guess (n, m), where those of the step
    before are (m,)."""
    n, m = guess.shape
    step_s, state_cost, max_thrust = weights.step_s, weights.state, weights.max_thrust
    thrust_cost, change_cost = weights.thrust, weights.change
    forces = np.zeros((n, 4))
    for k in range(n):
        for i in range(m):
            forces[k] += guess[k, i] * allocation[:, i]
    states, room = np.empty((n + 1, 8)), np.empty((5, 8))
    write_floats(states[0], state, 8)
    for k in range(n):
        step_into(states[k + 1], states[k], forces[k], water, step_s, room)
    by_state, by_force = step_jacobians(states, forces, water, step_s)
    answer = _answer(by_state, by_force, allocation)
    hessian, wish = np.zeros((m * n, m * n)), np.zeros(m * n)
    for k in range(n):
        for i in range(8):
            row = answer[8 * k + i, : m * k + m]
            off = state_cost[i] * (states[k + 1, i] - aims[k, i])
            for a in range(len(row)):
                wish[a] += off * row[a]
                _add(state_cost[i] * row[a], row[: a + 1], hessian[a])
    low, high = np.empty(m * n), np.empty(m * n)
    for k in range(n):
        for i in range(m):
            j = m * k + i
            hessian[j, j] += thrust_cost + change_cost
            last = guess[k - 1, i] if k > 0 else before[i]
            wish[j] += thrust_cost * guess[k, i] + change_cost * (guess[k, i] - last)
            if k + 1 < n:
                hessian[j, j] += change_cost
                hessian[j + m, j] -= change_cost
                wish[j] -= change_cost * (guess[k + 1, i] - guess[k, i])
            low[j], high[j] = -max_thrust - guess[k, i], max_thrust - guess[k, i]
    for j in range(m * n):
        for a in range(j):
            hessian[a, j] = hessian[j, a]
    change = minimum_in_box(hessian, wish, low, high, weights.max_newton_steps)
    out = np.empty((n, m))
    for k in range(n):
        for i in range(m):
            out[k, i] = min(max(guess[k, i] + change[m * k + i], -max_thrust), max_thrust)
    return out


@kernel
def _answer(by_state: Floats, by_force: Floats, allocation: Floats) -> Floats:
    """Return (8 n, m n) the derivatives of the states by the thrusts; row block k is the state
    after step k."""
    n, m = len(by_state), allocation.shape[1]
    out = np.zeros((8 * n, m * n))
    for k in range(n):
        for i in range(8):
            row = out[8 * k + i]
            for j in range(8):
                if k > 0:
                    _add(by_state[k, i, j], out[8 * (k - 1) + j, : m * k], row)
            for j in range(4):
                _add(by_force[k, i, j], allocation[j], row[m * k : m * k + m])
    return out


@kernel
def _add(share: float, row: Floats, to: Floats) -> None:
    """Add a multiple of a row to the beginning of another."""
    if share != 0.0:
        for j in range(len(row)):
            to[j] += share * row[j]


@kernel
def minimum_in_box(hessian: Floats, slope: Floats, low: Floats, high: Floats, steps: int) -> Floats:
    """Return the minimum of x H x / 2 + g x between bounds, H positive definite (projected
    Newton)."""
    n = len(slope)
    x = np.minimum(np.maximum(np.zeros(n), low), high)
    down, value = _slope_and_value(hessian, slope, x)
    free = np.empty(n, dtype=np.int64)
    for _ in range(steps):
        count = 0
        for j in range(n):
            if not ((x[j] <= low[j] and down[j] > 0.0) or (x[j] >= high[j] and down[j] < 0.0)):
                free[count] = j
                count += 1
        if count == 0:
            break
        part, path = np.empty((count, count)), np.empty(count)
        for a in range(count):
            path[a] = -down[free[a]]
            for b in range(a, count):
                part[a, b] = hessian[free[a], free[b]]
        solve_positive(part, path)
        gain = 0.0
        for a in range(count):
            gain += down[free[a]] * path[a]
        if -gain <= 1e-12 * (1.0 + abs(value)):
            break
        share = 1.0
        while share > 1e-6:
            tried = x.copy()
            for a in range(count):
                j = free[a]
                tried[j] = min(max(x[j] + share * path[a], low[j]), high[j])
            new_down, new = _slope_and_value(hessian, slope, tried)
            promised = 0.0
            for j in range(n):
                promised += down[j] * (x[j] - tried[j])
            if new <= value - 1e-4 * promised:
                break
            share *= 0.5
        if not new < value:
            break
        x, value, down = tried, new, new_down
    return x


@kernel
def _slope_and_value(hessian: Floats, slope: Floats, x: Floats) -> tuple[Floats, float]:
    """Return H x + g, and x H x / 2 + g x."""
    down, value = slope.copy(), 0.0
    for j in range(len(x)):
        _add(x[j], hessian[j], down)
    for j in range(len(x)):
        value += 0.5 * x[j] * (down[j] + slope[j])
    return down, value


@kernel
def solve_positive(matrix: Floats, right: Floats) -> None:
    """Solve a system of equations with a positive definite matrix, of which the upper half counts,
    in place: U^T D U by rows."""
    n = len(right)
    for k in range(n):
        for i in range(k + 1, n):
            share = matrix[k, i] / matrix[k, k]
            _add(-share, matrix[k, i:], matrix[i, i:])
            right[i] -= share * right[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]
