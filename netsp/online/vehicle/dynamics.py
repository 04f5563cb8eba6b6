"""The BlueROV2 in four degrees of freedom: surge, sway, heave and yaw. Compiled.

Parameters: von Benzon et al., "An Open-Source Benchmark Simulator: Control of a BlueROV2 Underwater
Robot", J. Mar. Sci. Eng. 10(12), 1898, 2022. Roll and pitch are left out: the vehicle is upright by
its weight. Equations of motion: Fossen, "Handbook of Marine Craft Hydrodynamics and Motion
Control", 2011, in velocities relative to the water, which holds for a current that changes slowly.

State: x, y, z (m, z up), yaw, and in the vehicle's frame surge, sway, heave (m/s, through the
water) and yaw rate. Input: three forces (N) and the yaw moment (N m), to which the pull of the
tether may be added (`netsp.online.tether.load.pull_on_robot`; the REACT paper leaves it out).
"""

from __future__ import annotations

import math

import numpy as np

from netsp.arrays import Floats
from netsp.compiled.kernel import kernel

MASS, VOLUME, GRAVITY, DENSITY = 13.5, 0.0134, 9.82, 1000.0

INERTIA = np.array([13.5 + 6.36, 13.5 + 7.12, 13.5 + 18.68, 0.37 + 0.222])
"""Mass and added mass: kg, kg, kg, kg m^2."""

LINEAR = np.array([13.7, 0.0, 33.0, 0.0])
QUADRATIC = np.array([41.1, 217.0, 190.0, 1.5])
"""Damping. Of von Benzon et al. all but the quadratic damping in surge: their 141 kg/m, found at
low speed, would let four thrusters push the vehicle to 0.85 m/s. Blue Robotics states 1.5 m/s for
it, which is what 41.1 kg/m gives."""

THRUST = 40.0
"""N: most that a T200 gives either way (Blue Robotics: at 16 V 51 N ahead and 40 N astern)."""

_C, _ARM = math.sqrt(0.5), math.sqrt(0.5) * (0.156 + 0.111)
ALLOCATION = np.array(
    [
        [_C, _C, _C, _C, 0.0],
        [_C, -_C, -_C, _C, 0.0],
        [0.0, 0.0, 0.0, 0.0, 2.0],
        [_ARM, -_ARM, _ARM, -_ARM, 0.0],
    ]
)
"""Input (4,) of thrusts (5,): front right, front left, back right and back left at 45 degrees,
0.156 m before or behind and 0.111 m beside the middle (von Benzon et al.), and the vertical two,
which push alike in a vehicle that stays upright."""


@kernel
def derivative(state: Floats, force: Floats, water: Floats, out: Floats) -> None:
    """d state / dt into `out` (8,).

    Parameters
    ----------
    water
        (3,) m/s.
    """
    c, s = math.cos(state[3]), math.sin(state[3])
    u, v, w, r = state[4], state[5], state[6], state[7]
    out[0] = c * u - s * v + water[0]
    out[1] = s * u + c * v + water[1]
    out[2] = w + water[2]
    out[3] = r
    m = INERTIA
    out[4] = (m[1] * v * r - (LINEAR[0] + QUADRATIC[0] * abs(u)) * u + force[0]) / m[0]
    out[5] = (-m[0] * u * r - (LINEAR[1] + QUADRATIC[1] * abs(v)) * v + force[1]) / m[1]
    lift = (DENSITY * VOLUME - MASS) * GRAVITY
    out[6] = (lift - (LINEAR[2] + QUADRATIC[2] * abs(w)) * w + force[2]) / m[2]
    out[7] = (
        (m[0] - m[1]) * u * v - (LINEAR[3] + QUADRATIC[3] * abs(r)) * r + force[3]
    ) / m[3]  # fmt: skip


@kernel
def step(state: Floats, force: Floats, water: Floats, seconds: float) -> Floats:
    """The state after one step of the classical Runge-Kutta method."""
    k1, k2, k3, k4 = np.empty(8), np.empty(8), np.empty(8), np.empty(8)
    derivative(state, force, water, k1)
    derivative(state + 0.5 * seconds * k1, force, water, k2)
    derivative(state + 0.5 * seconds * k2, force, water, k3)
    derivative(state + seconds * k3, force, water, k4)
    return state + seconds / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


@kernel
def linearised(
    states: Floats, forces: Floats, water: Floats, seconds: float
) -> tuple[Floats, Floats, Floats]:
    """Along a trajectory (n + 1, 8), (n, 4): the steps' Jacobians by state (n, 8, 8) and by input
    (n, 8, 4), by central differences, and what each step comes to (n, 8)."""
    n = len(forces)
    by_state, by_force, after = np.empty((n, 8, 8)), np.empty((n, 8, 4)), np.empty((n, 8))
    eps = 1e-6
    for k in range(n):
        after[k] = step(states[k], forces[k], water, seconds)
        for i in range(8):
            ahead, behind = states[k].copy(), states[k].copy()
            ahead[i] += eps
            behind[i] -= eps
            by_state[k, :, i] = (
                step(ahead, forces[k], water, seconds) - step(behind, forces[k], water, seconds)
            ) / (2.0 * eps)
        for i in range(4):
            more, less = forces[k].copy(), forces[k].copy()
            more[i] += 1e-3
            less[i] -= 1e-3
            by_force[k, :, i] = (
                step(states[k], more, water, seconds) - step(states[k], less, water, seconds)
            ) / 2e-3
    return by_state, by_force, after
