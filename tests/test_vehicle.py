"""The BlueROV2 obeys its equations, follows its way in a current, and stays within its limits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError
from netsp.world.simulator.current import Water
from netsp.world.vehicle import VEHICLES, make_vehicle
from netsp.world.vehicle.control import PredictiveControl, minimum_in_box, solve_positive
from netsp.world.vehicle.dynamics import (
    ALLOCATION,
    INERTIA,
    MAX_THRUST,
    derivative,
    step,
    step_jacobians,
)
from netsp.world.vehicle.kinematic import KinematicVehicle, wrapped_angle
from netsp.world.vehicle.vehicle_policy import VehiclePolicy

STILL = np.zeros(3)


def rate(state, force, water=STILL):
    out = np.empty(8)
    derivative(np.asarray(state, float), np.asarray(force, float), np.asarray(water, float), out)
    return out


@settings(deadline=None)
@given(
    st.lists(st.floats(-2, 2), min_size=4, max_size=4), st.floats(-3, 3),
)  # fmt: skip
def test_without_thrust_the_water_only_takes_energy(speeds, yaw):
    """Coriolis terms do no work; damping takes; buoyancy is balanced by a force."""
    state = np.r_[0, 0, 0, yaw, speeds]
    lift = rate(np.zeros(8), np.zeros(4))[6] * INERTIA[2]
    power = float((INERTIA * state[4:] * rate(state, [0, 0, -lift, 0])[4:]).sum())
    assert power <= 1e-9


@pytest.mark.parametrize(("axis", "force"), [(0, 20.0), (1, 20.0), (2, 20.0)])
def test_steady_speed_balances_thrust_and_drag(axis, force):
    linear, quadratic = ([13.7, 0, 33][axis], [41.1, 217, 190][axis])
    u = (-linear + math.sqrt(linear**2 + 4 * quadratic * force)) / (2 * quadratic)
    lift = rate(np.zeros(8), np.zeros(4))[6] * INERTIA[2]
    inputs = np.array([0.0, 0.0, -lift, 0.0])
    inputs[axis] += force
    state = np.zeros(8)
    for _ in range(600):
        state = step(state, inputs, STILL, 0.05)
    assert state[4 + axis] == pytest.approx(u, rel=1e-6)


def test_a_vehicle_without_thrust_drifts_with_the_current():
    lift = rate(np.zeros(8), np.zeros(4))[6] * INERTIA[2]
    state = np.zeros(8)
    for _ in range(100):
        state = step(state, np.array([0, 0, -lift, 0]), np.array([0.2, -0.1, 0.05]), 0.1)
    assert state[:3] == pytest.approx([2.0, -1.0, 0.5])


def test_the_linear_model_predicts_small_changes():
    rng = np.random.default_rng(1)
    states, forces = rng.normal(size=(4, 8)), 5 * rng.normal(size=(3, 4))
    by_state, by_force = step_jacobians(states, forces, STILL, 0.1)
    dx, du = 1e-4 * rng.normal(size=8), 1e-3 * rng.normal(size=4)
    for k in range(3):
        after = step(states[k], forces[k], STILL, 0.1)
        moved = step(states[k] + dx, forces[k] + du, STILL, 0.1)
        assert moved == pytest.approx(after + by_state[k] @ dx + by_force[k] @ du, abs=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_thrusts_between_bounds_are_those_of_the_least_cost(seed):
    """No step within the bounds goes down: the slope is zero where a bound does not hold, and
    leads out of it where one does."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 40))
    some = rng.normal(size=(n + 3, n))
    hessian, slope = some.T @ some + 1e-3 * np.eye(n), 10.0 * rng.normal(size=n)
    low, high = -rng.random(n), rng.random(n)
    x = minimum_in_box(hessian, slope, low, high, 100)
    down = hessian @ x + slope
    assert (low <= x).all()
    assert (x <= high).all()
    assert (np.abs(down[(x > low) & (x < high)]) < 1e-5).all()
    assert (down[x == low] > -1e-5).all()
    assert (down[x == high] < 1e-5).all()


@pytest.mark.parametrize("n", [1, 2, 30, 100])
def test_equations_are_solved_as_by_lapack(n):
    rng = np.random.default_rng(n)
    some = rng.normal(size=(n + 3, n))
    matrix, right = some.T @ some + np.eye(n), rng.normal(size=n)
    x = right.copy()
    solve_positive(np.triu(matrix), x)
    assert x == pytest.approx(np.linalg.solve(matrix, right), abs=1e-9)


@pytest.mark.parametrize("water", [(0.0, 0.0, 0.0), (0.15, -0.1, 0.05)])
def test_it_follows_a_circle_to_centimetres_whatever_the_current(water):
    rov = make_vehicle("bluerov2", np.zeros(3), 0.3)
    angle = np.linspace(0, 2 * np.pi, 60)
    path = np.column_stack([np.cos(angle) - 1, np.sin(angle), 0.1 * angle])
    places = []
    for k in range(230):
        stops, passed = rov.go(path, 0.1, 0.5, np.array(water), k == 0)
        path = path[min(passed, len(path) - 1) :]
        places.append(stops[-1])
    places = np.array(places)
    off = np.hypot(places[:, 0] + 1, places[:, 1]) - 1
    assert np.abs(off[40:]).max() < 0.03
    assert np.linalg.norm(places[-1] - [0, 0, 0.2 * np.pi]) < 0.05
    assert wrapped_angle(rov.yaw - 0.5) == pytest.approx(0.0, abs=0.05)


def distance_to(path, place):
    """Distance, metres, of a place from the polyline (k, 3) of a path."""
    a, d = path[:-1], np.diff(path, axis=0)
    share = ((place - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-12)
    return float(np.linalg.norm(a + np.clip(share, 0, 1)[:, None] * d - place, axis=1).min())


def followed(path, speed, water, yaws, max_s):
    """Seconds until a BlueROV2 is at the end of a path (k, 3), infinite after `max_s`, and its
    largest distance from the path, metres. The wish for a heading changes every two seconds."""
    rov, rest, off = make_vehicle("bluerov2", path[0], speed), path[1:], 0.0
    for k in range(round(10 * max_s)):
        _, passed = rov.go(rest, 0.1, yaws[k // 20 % len(yaws)], water, k == 0)
        rest = rest[min(passed, len(rest) - 1) :]
        off = max(off, distance_to(path, rov.position))
        if len(rest) == 1 and np.linalg.norm(rov.position - path[-1]) < 0.05:
            return 0.1 * (k + 1), off
    return math.inf, off


@pytest.mark.parametrize("speed", [0.5, 0.8, 1.0, 1.5])
def test_it_passes_narrow_turns_at_any_speed(speed):
    """Over a plate and down behind it: the way ahead comes back past the vehicle, where the mean
    of the places to come is a place to stay for good."""
    path = np.array([[0, 0, 0], [0, 0, 1.5], [0.5, 0, 1.5], [0.5, 0, 0], [1, 0, 0], [1, 0, 1.5]])
    seconds, off = followed(path, speed, STILL, [0.0], 60.0)
    assert seconds < 7.0 / min(speed, 0.5) + 8.0
    assert off < VehiclePolicy().max_lead + 0.03


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    corners=st.lists(st.tuples(*[st.floats(-0.8, 0.8)] * 3), min_size=2, max_size=4),
    speed=st.sampled_from([0.5, 0.8, 1.0, 1.5]),
    current=st.tuples(*[st.floats(-0.17, 0.17)] * 3),
    yaws=st.lists(st.floats(-math.pi, math.pi), min_size=1, max_size=4),
)
def test_it_arrives_along_any_path_in_any_current_that_it_masters(corners, speed, current, yaws):
    path = np.vstack([np.zeros(3), np.cumsum(corners, axis=0)])
    seconds, off = followed(path, speed, np.array(current), yaws, 60.0)
    assert seconds < 60.0
    assert off < VehiclePolicy().max_lead + 0.05  # it does not know the current at first


def test_a_point_that_waits_is_come_to():
    """A vehicle that was carried off its path comes back to it before it goes on."""
    rov, path = make_vehicle("bluerov2", np.zeros(3), 1.0), np.array([[4.0, 0, 0]])
    rov.go(path, 0.1, 0.0, STILL, True)
    rov.state[:3] += [0.0, 0.6, 0.0]
    places = []
    for _ in range(80):
        rov.go(path, 0.1, 0.0, STILL, False)
        places.append(rov.position)
    back = next(k for k, p in enumerate(places) if abs(p[1]) < 0.2)
    assert places[back][0] < 0.4
    assert np.linalg.norm(places[-1] - path[-1]) < 0.05


@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(-50, 50), min_size=3, max_size=3))
def test_no_thruster_is_asked_for_more_than_it_gives(far):
    control = PredictiveControl()
    aims = np.tile(np.r_[far, np.zeros(5)], (len(control.thrusts), 1))
    for _ in range(3):
        force = control.force(np.zeros(8), aims, STILL)
        assert (np.abs(control.thrusts) <= MAX_THRUST).all()
        assert force == pytest.approx(ALLOCATION @ control.thrusts[0])


def test_a_stopped_vehicle_is_at_rest_where_it_was_put():
    for name in VEHICLES:
        vehicle = make_vehicle(name, np.zeros(3), 0.3)
        vehicle.go(np.array([[1.0, 0, 0]]), 0.5, 0.0, STILL, True)
        vehicle.stop_at(np.array([0.1, 0.2, 0.3]))
        assert vehicle.position == pytest.approx([0.1, 0.2, 0.3])


def test_a_kinematic_vehicle_turns_no_faster_than_it_can():
    vehicle = KinematicVehicle(np.zeros(3), 0.3)
    vehicle.go(np.array([[1.0, 0, 0]]), 0.1, math.pi, STILL, True)
    assert abs(vehicle.yaw) == pytest.approx(math.radians(6.0))


def test_unknown_vehicles_are_named():
    with pytest.raises(
        InputError, match="vehicle: unknown 'boat'; expected one of kinematic, bluerov2"
    ):
        make_vehicle("boat", np.zeros(3), 0.3)


def test_gusts_have_their_spread_and_are_the_same_for_the_same_seed():
    a, b = Water((0.1, 0, 0), 0.05, 7), Water((0.1, 0, 0), 0.05, 7)
    x = np.array([a(0.1 * k) for k in range(20000)])
    assert np.array_equal(x[500], b(50.0))
    assert x.mean(0) == pytest.approx([0.1, 0, 0], abs=0.01)
    assert x.std(0) == pytest.approx([0.05] * 3, rel=0.15)
    assert np.abs(np.diff(x, axis=0)).max() < 0.1
    assert Water((0.1, 0, 0), 0.0, 7)(3.0) == pytest.approx([0.1, 0, 0])


def test_thrusters_push_where_they_point():
    """Force and moment of each from its place and direction."""
    c = math.sqrt(0.5)
    places = [(0.156, -0.111), (0.156, 0.111), (-0.156, -0.111), (-0.156, 0.111)]
    for n, ((x, y), (dx, dy)) in enumerate(
        zip(places, [(c, c), (c, -c), (c, -c), (c, c)], strict=True)
    ):
        assert ALLOCATION[:, n] == pytest.approx([dx, dy, 0.0, x * dy - y * dx])


def fastest(direction, seconds=30.0):
    """Speed (m/s) that a BlueROV2 gets to when it is asked for 3 m/s."""
    rov = make_vehicle("bluerov2", np.zeros(3), 3.0)
    path = np.array([1000.0 * np.asarray(direction, float)])
    for k in range(round(10 * seconds)):
        rov.go(path, 0.1, 0.0, STILL, k == 0)
    before = rov.position
    rov.go(path, 0.1, 0.0, STILL, False)
    return float(np.linalg.norm(rov.position - before)) / 0.1


def test_top_speeds_are_those_that_the_thrusters_allow():
    """1.5 m/s ahead, as published; abeam and up what the drag leaves of four and two thrusters."""
    ahead = fastest((1, 0, 0))
    assert 1.35 < ahead <= 1.51
    across = math.sqrt(4 * MAX_THRUST * math.sqrt(0.5) / 217)
    assert fastest((0, 1, 0)) == pytest.approx(across, rel=0.1)
