"""Tracks of robots beside which a guard is measured, and what their vehicles say of them.

Tours of the shipped problems and of random worlds, flown by our vehicles, the recorded flights in
`tests/data/ardusub`, and random pilots' drives, none of which closes a loop.
"""

from __future__ import annotations

import contextlib
import csv
import gzip
import json
import math
from collections.abc import Iterator

import numpy as np
from table import ROOT

from netsp import solve
from netsp.model.problem import Problem
from netsp.online.execute.execution_log import ExecutionOptions
from netsp.online.execute.tour_execution import execute
from netsp.online.guard.loops import loops_in
from netsp.online.guard.plane import PlaneSite
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_belief import Strands
from netsp.plan.random_worlds import reachable_world

NOISE, DRIFT, DRIFT_S, SPEED, DT = 0.3, 0.5, 100.0, 0.5, 0.1
VELOCITY_NOISE = 0.1
RECORDED = ROOT / "tests" / "data" / "ardusub"
SHIPPED = ("wharf", "pool", "oc4-jacket")
FAMILIES = ("icra2017", "clustered", "array", "harbour")


def problem_of(name: str) -> Problem:
    if name in ("r1", "r4"):
        return Problem.load(RECORDED / f"problem-{name}.json")
    return Problem.load(ROOT / "problems" / f"{name}.json")


def evenly(times: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(n, 3) at ten a second."""
    grid = np.arange(times[0], times[-1], DT)
    return np.column_stack([np.interp(grid, times, places[:, k]) for k in range(3)])


def recorded(name: str) -> tuple[Problem, np.ndarray]:
    with gzip.open(RECORDED / f"ardusub-{name}.csv.gz", "rt") as text:
        rows = list(csv.DictReader(text))
    times = np.array([float(r["t"]) for r in rows])
    return problem_of(name), evenly(
        times, np.array([[float(r[k]) for k in "xyz"] for r in rows])
    )  # fmt: skip


def toured(problem: Problem, vehicle: str, seed: int) -> np.ndarray:
    solution = solve(problem, time_limit=10.0, seed=seed)
    done = execute(problem, solution, ExecutionOptions(speed=SPEED, vehicle=vehicle, seed=seed))
    times = np.array([r.time for r in done.rows])
    return evenly(times, np.array([[r.x, r.y, r.z] for r in done.rows]))


def driven(problem: Problem, seed: int, seconds: float = 240.0) -> np.ndarray:
    """A random pilot: straight to some place in sight, a pause, and on; never past the tether, and
    no loop closed."""
    rng = np.random.default_rng(seed)
    strands = Strands(PlaneSite(problem))
    model, field_ = strands.site.model, strands.site.field
    tether = model.start(problem.base, problem.base)
    here, out = np.array(problem.base, dtype=float), []
    spread = 0.6 * problem.tether_length
    tries = 0
    while len(out) * DT < seconds and tries < 2000:
        tries += 1
        there = here + np.array([*rng.normal(0.0, 0.35 * spread, 2), 0.0])
        there[2] = problem.base[2] - rng.uniform(0.0, 3.0)
        far = float(np.linalg.norm(there - here))
        if far < 1.0 or not field_.line_of_sight(here, there, 0.0):
            continue
        steps = here + np.linspace(0.0, 1.0, int(far / (SPEED * DT)) + 2)[1:, None] * (there - here)
        moved, lengths = model.drive(tether, steps)
        looped = False
        at = tether
        for k in range(0, len(steps), 5):
            at = model.update(at, steps[k])
            looped = looped or bool(loops_in(problem, at.nodes[:, :2]))
        # a pilot does not drive straight at the tether either: ten seconds more would close none
        on = there + np.linspace(0, 1, 11)[1:, None] * (there - here) / far * 5.0
        for place in on:
            if not field_.line_of_sight(at.robot, place, 0.0):
                break
            at = model.update(at, place)
            looped = looped or bool(loops_in(problem, at.nodes[:, :2]))
        if looped or lengths.max() > 0.97 * problem.tether_length:
            continue
        out += list(steps) + [there] * int(rng.integers(0, 60))
        here, tether = there, moved
    return np.array(out)


def small_world(seed: int) -> Problem:
    """A random one in which a tether can go round what there is, of each family in turn."""
    family = FAMILIES[seed // 2 % len(FAMILIES)]
    for further in range(100):
        problem, _ = reachable_world(
            seed + 1000 * further, family=family, goals=6, obstacles=9, side=45.0,
            radii=(0.8, 2.5), tether_length=45.0,
        )  # fmt: skip
        with contextlib.suppress(ValueError):  # a goal or the base is too near to an obstacle
            return Problem.model_validate({**json.loads(problem.to_json()), "clearance": 0.4})
    raise RuntimeError(f"no world of {family} keeps its clearance")


def tracks(count: int) -> Iterator[tuple[str, int]]:
    """Kinds and seeds of tracks, no two alike."""
    kinds = ["recorded", "kinematic", "bluerov2", "pilot", "pilot"]
    seeds = dict.fromkeys(kinds, 0)
    for k in range(count):
        kind = kinds[k % len(kinds)]
        yield kind, seeds[kind]
        seeds[kind] += 1


def track_of(kind: str, seed: int) -> tuple[Problem, np.ndarray]:
    names = (*SHIPPED, "r1", "r4")
    if kind == "recorded":
        if seed < len(names):
            return recorded(names[seed])
        kind = "kinematic"
    if seed % 2:
        problem = problem_of(names[seed % len(names)])
    else:
        problem = small_world(seed)
    if kind == "pilot":
        return problem, driven(problem, seed)
    return problem, toured(problem, kind, seed)


def told_of(
    true: np.ndarray, rng: np.random.Generator, begin: np.ndarray, start: float,
    velocities: bool, before: np.ndarray | None = None,
) -> list[Fix]:  # fmt: skip
    """What the vehicle says of where it is, and of its velocity if it does; the drift begins at
    `begin`, the time at `start`, and it was `before` at a place."""
    places = drifted(true, rng, begin)
    steps = np.diff(true, axis=0, prepend=(true[:1] if before is None else before[None]))
    # of its own, so that the places are those of vehicles that tell no velocities
    noise = np.random.default_rng(rng.bit_generator.state["state"]["state"] % 2**63)
    speeds = steps / DT + noise.normal(0.0, VELOCITY_NOISE, true.shape)
    return [
        Fix(start + k * DT, tuple(place), estimate=True, velocity=tuple(v) if velocities else None)
        for k, (place, v) in enumerate(zip(places, speeds, strict=True))
    ]


def drifted(true: np.ndarray, rng: np.random.Generator, begin: np.ndarray) -> np.ndarray:
    """(n, 3) where the vehicle says that it is."""
    drift, out = begin.copy(), np.empty_like(true)
    keep = math.exp(-DT / DRIFT_S)
    kick = DRIFT * math.sqrt(1.0 - keep**2)
    for k, place in enumerate(true):
        drift = keep * drift + kick * rng.normal(size=2)
        out[k] = place + rng.normal(0.0, NOISE, 3) * (1.0, 1.0, 0.3)
        out[k, :2] += drift
    begin[:] = drift
    return out
