"""Model-predictive control by real-time iteration: one quadratic program per control step.

Diehl, Bock and Schloeder, "A real-time iteration scheme for nonlinear optimization in optimal
feedback control", SIAM J. Control Optim. 43(5), 2005: the model is linearised along the last
solution, moved on by one step, and the quadratic program that comes of it is solved once. States
are eliminated; what is left are 80 inputs between bounds, and Bertsekas' projected Newton method
("Projected Newton methods for optimization problems with simple constraints", SIAM J. Control
Optim. 20(2), 1982) is done in a few steps. Compiled whole, it takes half a millisecond; OSQP took
two and its library crashed beside that of HiGHS.
"""

from __future__ import annotations

import numpy as np

from netsp.arrays import Floats
from netsp.compiled.kernel import kernel
from netsp.online.vehicle.dynamics import MOST, linearised, step

HORIZON, DT = 20, 0.1
"""Steps ahead, and seconds of each."""

STATE_COST = np.array([200.0, 200.0, 200.0, 10.0, 5.0, 5.0, 5.0, 1.0])
FORCE_COST = np.array([2e-3, 2e-3, 2e-3, 2e-2])
CHANGE_COST = np.array([2e-3, 2e-3, 2e-3, 2e-2])
"""Weights of what is squared: errors in m, rad, m/s and rad/s, inputs in N and N m, and their
changes from step to step."""

NEWTON_STEPS = 30


class PredictiveControl:
    """Controller with the inputs (HORIZON, 4) of its last solution."""

    def __init__(self) -> None:
        self.forces = np.zeros((HORIZON, 4))

    def force(self, state: Floats, aims: Floats, water: Floats) -> Floats:
        """The input (4,) for the next step.

        Parameters
        ----------
        state
            (8,).
        aims
            (HORIZON, 8) where to be after each step.
        water
            (3,) what the water is thought to do.
        """
        self.forces = improved(self.forces, state, aims, water)
        return np.asarray(self.forces[0])


@kernel
def improved(last: Floats, state: Floats, aims: Floats, water: Floats) -> Floats:
    """The inputs after one iteration, from those (n, 4) of the step before."""
    n = len(last)
    guess = np.empty((n, 4))
    guess[:-1] = last[1:]
    guess[-1] = last[-1]
    states = np.empty((n + 1, 8))
    states[0] = state
    for k in range(n):
        states[k + 1] = step(states[k], guess[k], water, DT)
    by_state, by_force, _ = linearised(states, guess, water, DT)
    # how the states answer to changes of the inputs: row block k is the state after step k
    answer = np.zeros((8 * n, 4 * n))
    for k in range(n):
        if k > 0:
            answer[8 * k : 8 * k + 8, : 4 * k] = np.dot(
                by_state[k], np.ascontiguousarray(answer[8 * k - 8 : 8 * k, : 4 * k])
            )
        answer[8 * k : 8 * k + 8, 4 * k : 4 * k + 4] = by_force[k]
    weighted = answer.copy()
    wish = np.zeros(4 * n)
    for k in range(n):
        for i in range(8):
            weighted[8 * k + i] *= STATE_COST[i]
            wish += weighted[8 * k + i] * (states[k + 1, i] - aims[k, i])
    hessian = np.dot(answer.T.copy(), weighted)
    low, high = np.empty(4 * n), np.empty(4 * n)
    for k in range(n):
        for i in range(4):
            j = 4 * k + i
            hessian[j, j] += FORCE_COST[i] + CHANGE_COST[i]
            before = guess[k - 1, i] if k > 0 else last[0, i]
            wish[j] += FORCE_COST[i] * guess[k, i] + CHANGE_COST[i] * (guess[k, i] - before)
            if k + 1 < n:
                hessian[j, j] += CHANGE_COST[i]
                hessian[j, j + 4] -= CHANGE_COST[i]
                hessian[j + 4, j] -= CHANGE_COST[i]
                wish[j] -= CHANGE_COST[i] * (guess[k + 1, i] - guess[k, i])
            low[j], high[j] = -MOST[i] - guess[k, i], MOST[i] - guess[k, i]
    change = within(hessian, wish, low, high, NEWTON_STEPS)
    out = np.empty((n, 4))
    for k in range(n):
        for i in range(4):
            value = guess[k, i] + change[4 * k + i]
            out[k, i] = min(max(value, -MOST[i]), MOST[i])
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
