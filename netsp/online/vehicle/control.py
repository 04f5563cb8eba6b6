"""Model-predictive control by real-time iteration: one quadratic program per control step.

Diehl, Bock and Schloeder, "A real-time iteration scheme for nonlinear optimization in optimal
feedback control", SIAM J. Control Optim. 43(5), 2005: the model is linearised along the last
solution, moved on by one step, and the quadratic program that comes of it is solved once. States
are eliminated; what is left are 100 thrusts between bounds, and Bertsekas' projected Newton method
("Projected Newton methods for optimization problems with simple constraints", SIAM J. Control
Optim. 20(2), 1982) is done in a few steps. Compiled whole, it takes half a millisecond; OSQP took
two and its library crashed beside that of HiGHS.
"""

from __future__ import annotations

import numpy as np

from netsp.arrays import Floats
from netsp.compiled.kernel import kernel
from netsp.online.vehicle.dynamics import ALLOCATION, THRUST, linearised, step

HORIZON, DT = 20, 0.1
"""Steps ahead, and seconds of each."""

STATE_COST = np.array([200.0, 200.0, 200.0, 10.0, 5.0, 5.0, 5.0, 1.0])
THRUST_COST, CHANGE_COST = 4e-3, 4e-3
"""Weights of what is squared: errors in m, rad, m/s and rad/s, thrusts in N, and their changes from
step to step."""

NEWTON_STEPS = 30


class PredictiveControl:
    """Controller with the thrusts (HORIZON, 5) of its last solution, N."""

    def __init__(self) -> None:
        self.thrusts = np.zeros((HORIZON, 5))

    def force(self, state: Floats, aims: Floats, water: Floats) -> Floats:
        """The input (4,) for the next step, that thrusters within their limits give.

        Parameters
        ----------
        state
            (8,).
        aims
            (HORIZON, 8) where to be after each step.
        water
            (3,) what the water is thought to do.
        """
        self.thrusts = improved(self.thrusts, state, aims, water, ALLOCATION)
        return np.asarray(ALLOCATION @ self.thrusts[0])


@kernel
def improved(
    last: Floats, state: Floats, aims: Floats, water: Floats, allocation: Floats
) -> Floats:
    """The thrusts after one iteration, from those (n, m) of the step before."""
    n, m = last.shape
    guess = np.empty((n, m))
    guess[:-1] = last[1:]
    guess[-1] = last[-1]
    forces = np.dot(guess, allocation.T.copy())
    states = np.empty((n + 1, 8))
    states[0] = state
    for k in range(n):
        states[k + 1] = step(states[k], forces[k], water, DT)
    by_state, by_force, _ = linearised(states, forces, water, DT)
    # how the states answer to changes of the thrusts: row block k is the state after step k
    answer = np.zeros((8 * n, m * n))
    for k in range(n):
        if k > 0:
            answer[8 * k : 8 * k + 8, : m * k] = np.dot(
                by_state[k], np.ascontiguousarray(answer[8 * k - 8 : 8 * k, : m * k])
            )
        answer[8 * k : 8 * k + 8, m * k : m * k + m] = np.dot(by_force[k], allocation)
    weighted = answer.copy()
    wish = np.zeros(m * n)
    for k in range(n):
        for i in range(8):
            weighted[8 * k + i] *= STATE_COST[i]
            wish += weighted[8 * k + i] * (states[k + 1, i] - aims[k, i])
    hessian = np.dot(answer.T.copy(), weighted)
    low, high = np.empty(m * n), np.empty(m * n)
    for k in range(n):
        for i in range(m):
            j = m * k + i
            hessian[j, j] += THRUST_COST + CHANGE_COST
            before = guess[k - 1, i] if k > 0 else last[0, i]
            wish[j] += THRUST_COST * guess[k, i] + CHANGE_COST * (guess[k, i] - before)
            if k + 1 < n:
                hessian[j, j] += CHANGE_COST
                hessian[j, j + m] -= CHANGE_COST
                hessian[j + m, j] -= CHANGE_COST
                wish[j] -= CHANGE_COST * (guess[k + 1, i] - guess[k, i])
            low[j], high[j] = -THRUST - guess[k, i], THRUST - guess[k, i]
    change = within(hessian, wish, low, high, NEWTON_STEPS)
    out = np.empty((n, m))
    for k in range(n):
        for i in range(m):
            out[k, i] = min(max(guess[k, i] + change[m * k + i], -THRUST), THRUST)
    return out


@kernel
def within(hessian: Floats, slope: Floats, low: Floats, high: Floats, steps: int) -> Floats:
    """The minimum of x H x / 2 + g x between bounds, H positive definite: projected Newton."""
    n = len(slope)
    x = np.minimum(np.maximum(np.zeros(n), low), high)
    value = 0.5 * np.dot(x, np.dot(hessian, x)) + np.dot(slope, x)
    for _ in range(steps):
        down = np.dot(hessian, x) + slope
        free = np.empty(n, dtype=np.int64)
        count = 0
        for j in range(n):
            if not ((x[j] <= low[j] and down[j] > 0.0) or (x[j] >= high[j] and down[j] < 0.0)):
                free[count] = j
                count += 1
        if count == 0:
            break
        part, right = np.empty((count, count)), np.empty(count)
        for a in range(count):
            right[a] = -down[free[a]]
            for b in range(count):
                part[a, b] = hessian[free[a], free[b]]
        path = np.linalg.solve(part, right)
        gain = -np.dot(right, path)
        if -gain <= 1e-12 * (1.0 + abs(value)):
            break
        share = 1.0
        while share > 1e-6:
            tried = x.copy()
            for a in range(count):
                j = free[a]
                tried[j] = min(max(x[j] + share * path[a], low[j]), high[j])
            new = 0.5 * np.dot(tried, np.dot(hessian, tried)) + np.dot(slope, tried)
            if new <= value - 1e-4 * np.dot(down, x - tried):
                break
            share *= 0.5
        if not new < value:
            break
        x, value = tried, new
    return x
