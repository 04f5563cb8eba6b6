"""Model-predictive control by real-time iteration: one quadratic program per control step.

Diehl, Bock and Schloeder, "A real-time iteration scheme for nonlinear optimization in optimal
feedback control", SIAM J. Control Optim. 43(5), 2005: the model is linearised along the last
solution, moved on by one step, and the quadratic program that comes of it is solved once. OSQP
solves it, started from the solution before.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import sparse

from netsp.errors import InputError
from netsp.online.vehicle.dynamics import MOST, linearised, step

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

HORIZON, DT = 20, 0.1
"""Steps ahead, and seconds of each."""

STATE_COST = np.array([200.0, 200.0, 200.0, 10.0, 5.0, 5.0, 5.0, 1.0])
FORCE_COST = np.array([2e-3, 2e-3, 2e-3, 2e-2])
CHANGE_COST = np.array([2e-3, 2e-3, 2e-3, 2e-2])
"""Weights of what is squared: errors in m, rad, m/s and rad/s, inputs in N and N m, and their
changes from step to step."""


class PredictiveControl:
    """Controller with the states and inputs of its last solution.

    Raises
    ------
    InputError : OSQP is not installed.
    """

    def __init__(self) -> None:
        try:
            import osqp
        except ImportError:
            raise InputError(
                "--vehicle bluerov2 needs OSQP: pip install 'netsp[control]'"
            ) from None
        n = HORIZON
        self.forces = np.zeros((n, 4))
        self._cost = np.concatenate([np.tile(STATE_COST, n), np.zeros(4 * n)])
        change = sparse.diags([1.0, -1.0], [0, -1], shape=(n, n))
        inputs = sparse.kron(sparse.eye(n), sparse.diags(FORCE_COST)) + sparse.kron(
            change.T @ change, sparse.diags(CHANGE_COST)
        )
        hessian = sparse.block_diag([sparse.diags(np.tile(STATE_COST, n)), inputs], format="csc")
        rows, columns, order = _layout(n)
        self._order = order
        matrix = sparse.csc_matrix((np.ones(len(rows)), (rows, columns)), shape=(12 * n, 12 * n))
        self._low = np.concatenate([np.zeros(8 * n), np.tile(-MOST, n)])
        self._high = np.concatenate([np.zeros(8 * n), np.tile(MOST, n)])
        self._program = osqp.OSQP()
        self._program.setup(
            sparse.triu(hessian, format="csc"), np.zeros(12 * n), matrix, self._low, self._high,
            verbose=False, eps_abs=1e-3, eps_rel=1e-3, max_iter=400, check_termination=10,
            polishing=False, adaptive_rho=False, rho=0.1,
        )  # fmt: skip

    def force(self, state: Floats, aims: Floats, water: Floats) -> Floats:
        """The input (4,) for the next step. state : (8,). aims : (HORIZON, 8) where to be after
        each step. water : (3,) what the water is thought to do."""
        n = HORIZON
        guess = np.vstack([self.forces[1:], self.forces[-1:]])
        states = np.empty((n + 1, 8))
        states[0] = state
        for k in range(n):
            states[k + 1] = step(states[k], guess[k], water, DT)
        by_state, by_force, _ = linearised(states, guess, water, DT)
        # in differences from the guess, which satisfies the model: dx' = A dx + B du
        data = np.concatenate(
            [np.ones(8 * n), -by_state[1:].ravel(), -by_force.ravel(), np.ones(4 * n)]
        )[self._order]
        error = (states[1:] - aims).ravel()
        wish = np.empty(12 * n)
        wish[: 8 * n] = np.tile(STATE_COST, n) * error
        turn = np.diff(guess, axis=0, prepend=self.forces[:1])
        bend = turn.copy()
        bend[:-1] -= turn[1:]
        wish[8 * n :] = (FORCE_COST * guess + CHANGE_COST * bend).ravel()
        self._low[8 * n :] = (-MOST - guess).ravel()
        self._high[8 * n :] = (MOST - guess).ravel()
        self._program.update(q=wish, l=self._low, u=self._high, Ax=data)
        change = self._program.solve(raise_error=False).x
        if change is None or not np.isfinite(change).all():
            self.forces = np.zeros((n, 4))
        else:
            self.forces = np.clip(guess + change[8 * n :].reshape(n, 4), -MOST, MOST)
        return np.asarray(self.forces[0])


def _layout(n: int) -> tuple[Ints, Ints, Ints]:
    """Rows, columns and, for the values in the order that `force` writes them, the order of a
    compressed matrix of columns. Variables: n states of 8, then n inputs of 4."""
    rows, columns = [np.arange(8 * n)], [np.arange(8 * n)]
    i, j = np.divmod(np.arange(64), 8)
    for k in range(1, n):
        rows.append(8 * k + i)
        columns.append(8 * (k - 1) + j)
    i, j = np.divmod(np.arange(32), 4)
    for k in range(n):
        rows.append(8 * k + i)
        columns.append(8 * n + 4 * k + j)
    rows.append(8 * n + np.arange(4 * n))
    columns.append(8 * n + np.arange(4 * n))
    r, c = np.concatenate(rows), np.concatenate(columns)
    order = np.lexsort((r, c))
    return r[order], c[order], order
