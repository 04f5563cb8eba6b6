"""Dynamics of the BlueROV2 in four degrees of freedom: surge, sway, heave and yaw. Compiled.

Parameters: von Benzon et al., "An Open-Source Benchmark Simulator: Control of a BlueROV2 Underwater
Robot", J. Mar. Sci. Eng. 10(12), 1898, 2022. Roll and pitch are left out: the vehicle is upright by
its weight. Equations of motion: Fossen, "Handbook of Marine Craft Hydrodynamics and Motion
Control", 2011, in velocities relative to the water, which holds for a current that changes slowly.

State: x, y, z (m, z up), yaw, and in the vehicle's frame surge, sway, heave (m/s, through the
water) and yaw rate. Input: three forces (N) and the yaw moment (N m), to which the pull of the
tether may be added (`netsp.world.tether.load.pull_on_robot`; the REACT paper leaves it out).
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.compiled.dynamic_array import write_floats
from netsp.base.compiled.kernel import kernel

MASS = 13.5
"""Physical constant: mass of the vehicle, kg."""

VOLUME = 0.0134
"""Physical constant: volume of the vehicle, m³."""

GRAVITY = 9.82
"""Physical constant: acceleration of gravity, m/s²."""

WATER_DENSITY = 1000.0
"""Physical constant: density of the water in which the vehicle was measured, kg/m³."""

INERTIA = np.array([13.5 + 6.36, 13.5 + 7.12, 13.5 + 18.68, 0.37 + 0.222])
"""Physical constant: mass and added mass, kg, kg, kg and kg m²."""

LINEAR = np.array([13.7, 0.0, 33.0, 0.0])
QUADRATIC = np.array([41.1, 217.0, 190.0, 1.5])
"""Physical constant: quadratic damping. All damping is that of von Benzon et al. except the
quadratic one in surge: their 141 kg/m, found at low speed, would let four thrusters push the
vehicle to 0.85 m/s. 41.1 kg/m gives the 1.5 m/s that Blue Robotics states."""

MAX_THRUST = 40.0
"""Physical constant: largest thrust of a T200 in either direction, N. At 16 V, Blue Robotics states
51 N ahead and 40 N astern."""

_C, _ARM = math.sqrt(0.5), math.sqrt(0.5) * (0.156 + 0.111)
ALLOCATION = np.array(
    [
        [_C, _C, _C, _C, 0.0],
        [_C, -_C, -_C, _C, 0.0],
        [0.0, 0.0, 0.0, 0.0, 2.0],
        [_ARM, -_ARM, _ARM, -_ARM, 0.0],
    ]
)
"""Physical constant: input (4,) of thrusts (5,), front right, front left, back right and back left
at 45 degrees, 0.156 m before or behind and 0.111 m beside the middle (von Benzon et al.), and the
vertical two, which push alike in a vehicle that stays upright."""


@kernel
def derivative(state: Floats, force: Floats, water: Floats, out: Floats) -> None:
    """Write d state / dt into `out` (8,) for a velocity of the water (3,), m/s."""
    c, s = math.cos(state[3]), math.sin(state[3])
    u, v, w, r = state[4], state[5], state[6], state[7]
    out[0] = c * u - s * v + water[0]
    out[1] = s * u + c * v + water[1]
    out[2] = w + water[2]
    out[3] = r
    m = INERTIA
    out[4] = (m[1] * v * r - (LINEAR[0] + QUADRATIC[0] * abs(u)) * u + force[0]) / m[0]
    out[5] = (-m[0] * u * r - (LINEAR[1] + QUADRATIC[1] * abs(v)) * v + force[1]) / m[1]
    lift = (WATER_DENSITY * VOLUME - MASS) * GRAVITY
    out[6] = (lift - (LINEAR[2] + QUADRATIC[2] * abs(w)) * w + force[2]) / m[2]
    out[7] = ((m[0] - m[1]) * u * v - (LINEAR[3] + QUADRATIC[3] * abs(r)) * r + force[3]) / m[3]


@kernel
def step(state: Floats, force: Floats, water: Floats, seconds: float) -> Floats:
    """Return the state after one step of the classical Runge-Kutta method."""
    out = np.empty(8)
    step_into(out, state, force, water, seconds, np.empty((5, 8)))
    return out


@kernel
def step_into(
    out: Floats, state: Floats, force: Floats, water: Floats, seconds: float, room: Floats
) -> None:
    """Write the result of `step` into `out` (8,); `room` (5, 8) is scratch space."""
    k1, k2, k3, k4, at = room[0], room[1], room[2], room[3], room[4]
    derivative(state, force, water, k1)
    for i in range(8):
        at[i] = state[i] + 0.5 * seconds * k1[i]
    derivative(at, force, water, k2)
    for i in range(8):
        at[i] = state[i] + 0.5 * seconds * k2[i]
    derivative(at, force, water, k3)
    for i in range(8):
        at[i] = state[i] + seconds * k3[i]
    derivative(at, force, water, k4)
    for i in range(8):
        out[i] = state[i] + seconds / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])


@kernel
def step_jacobians(
    states: Floats, forces: Floats, water: Floats, seconds: float
) -> tuple[Floats, Floats]:
    """Return the Jacobians of the steps along a trajectory (n + 1, 8), (n, 4), by central
    differences: by state (n, 8, 8) and by input (n, 8, 4). The position does not change how the
    vehicle moves."""
    n = len(forces)
    by_state, by_force = np.zeros((n, 8, 8)), np.empty((n, 8, 4))
    ahead, behind, room = np.empty(8), np.empty(8), np.empty((5, 8))
    state, force = np.empty(8), np.empty(4)
    eps, newton = 1e-6, 1e-3
    for k in range(n):
        write_floats(state, states[k], 8)
        write_floats(force, forces[k], 4)
        for i in range(3):
            by_state[k, i, i] = 1.0
        for i in range(3, 8):
            state[i] = states[k, i] + eps
            step_into(ahead, state, force, water, seconds, room)
            state[i] = states[k, i] - eps
            step_into(behind, state, force, water, seconds, room)
            state[i] = states[k, i]
            for j in range(8):
                by_state[k, j, i] = (ahead[j] - behind[j]) / (2.0 * eps)
        for i in range(4):
            force[i] = forces[k, i] + newton
            step_into(ahead, state, force, water, seconds, room)
            force[i] = forces[k, i] - newton
            step_into(behind, state, force, water, seconds, room)
            force[i] = forces[k, i]
            for j in range(8):
                by_force[k, j, i] = (ahead[j] - behind[j]) / (2.0 * newton)
    return by_state, by_force
