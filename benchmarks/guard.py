"""A guard beside robots that are driven, with noise: what it misses, how early it warns, how often
it is wrong, and how long an update takes; and a counter of turns on the same tracks.

    python benchmarks/guard.py [--only plane|space|hour] [--tracks 100] [--loops 15]
                               [--jobs 2] [--outcomes FILE] [--keep]

Tracks are tours of the shipped problems and of random worlds, flown by our vehicles, the recorded
flights in `tests/data/ardusub`, and random pilots' drives, none of which closes a loop. Into each,
loops are put at random moments: from there the robot drives round some obstacle in sight until its
own tether has closed a loop. Positions get white noise (0.3 m) and a drift (0.5 m, forgotten in
100 s). That takes hours: with `--outcomes` each track's are kept in a file as soon as they are
known, and tracks that are in it are not driven again.
"""

from __future__ import annotations

import argparse
import copy
import csv
import gzip
import json
import math
import multiprocessing
import resource
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from resumed import outcomes
from sites import SITES, mission_of, shipped
from space import reachable_world
from table import ROOT, head, heading, row

from netsp import solve
from netsp.execute.log import ExecutionOptions
from netsp.execute.run import execute
from netsp.guard.alarms import Level
from netsp.guard.fix import Fix
from netsp.guard.guard import Guard, GuardOptions
from netsp.guard.loops import loops_in
from netsp.guard.plane import PlaneSite
from netsp.guard.report import Report
from netsp.guard.space import SpaceSite
from netsp.guard.tethers import Strands
from netsp.online import Scene
from netsp.online.log import LogRow
from netsp.online.mission import Mission
from netsp.online.simulate import simulate
from netsp.problem import Circle, Problem
from netsp.space.solve import solve_mission

NOISE, DRIFT, DRIFT_S, SPEED, DT = 0.3, 0.5, 100.0, 0.5, 0.1
RECORDED = ROOT / "tests" / "data" / "ardusub"
SHIPPED = ("wharf", "pool", "oc4-jacket")
LEAD, LONGER = 10.0, 12.0
MOST_S = 90.0
AT_ONCE = 20
"""Updates before and after which a guard that knows the position may see what is warned of: it
tells a turn from noise sooner, and later where the noise happens to turn, too."""


@dataclass
class Outcome:
    """Of one track, and the loops put into it."""

    kind: str
    seconds: float = 0.0
    warned: int = 0
    wrong: int = 0
    cautioned: int = 0
    turned: int = 0
    loops: int = 0
    silent: int = 0
    possible: int = 0
    missed_by_turns: int = 0
    leads: list[float] = field(default_factory=list)
    allowed: list[tuple[float, float, float]] = field(default_factory=list)
    """Of loops that can be foreseen in time: leads of the warning, of the first word, and of a
    guard that knows the position."""
    updates_ms: list[float] = field(default_factory=list)
    home_ms: list[float] = field(default_factory=list)


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
        problem, _ = reachable_world(seed, goals=6, obstacles=7, tether_length=40.0)
    if kind == "pilot":
        return problem, driven(problem, seed)
    return problem, toured(problem, kind, seed)


def drifted(true: np.ndarray, rng: np.random.Generator, begin: np.ndarray) -> np.ndarray:
    """(n, 3) what the vehicle says of it; the drift begins at `begin`."""
    drift, out = begin.copy(), np.empty_like(true)
    keep = math.exp(-DT / DRIFT_S)
    kick = DRIFT * math.sqrt(1.0 - keep**2)
    for k, place in enumerate(true):
        drift = keep * drift + kick * rng.normal(size=2)
        out[k] = place + rng.normal(0.0, NOISE, 3) * (1.0, 1.0, 0.3)
        out[k, :2] += drift
    begin[:] = drift
    return out


class TurnCounter:
    """What ground stations have: full turns of the heading since the start."""

    def __init__(self) -> None:
        self.turned, self._before = 0.0, None

    def take(self, step: np.ndarray) -> bool:
        """Whether it says that there is a turn."""
        if float(np.hypot(*step[:2])) > 0.5 * SPEED * DT:
            course = math.atan2(step[1], step[0])
            if self._before is not None:
                self.turned += (course - self._before + math.pi) % (2.0 * math.pi) - math.pi
            self._before = course
        return abs(self.turned) >= 2.0 * math.pi


def loop_paths(
    problem: Problem, here: np.ndarray, strands: Strands, rng: np.random.Generator
) -> Iterator[np.ndarray]:
    """Straight to obstacles in sight, one after the other, and around each, once and a bit."""
    for i in rng.permutation(len(problem.obstacles)):
        o = problem.obstacles[int(i)]
        if not isinstance(o, Circle) or math.dist(o.center, here[:2]) > 25.0:
            continue
        radius = o.radius + problem.clearance + float(rng.uniform(0.6, 2.0))
        way = 1.0 if rng.random() < 0.5 else -1.0
        away = here[:2] - np.array(o.center)
        far = float(np.hypot(*away))
        if far < radius:
            radius = max(far, o.radius + problem.clearance + 0.3)
        begin = math.atan2(away[1], away[0])
        turn = begin + way * math.acos(min(radius / max(far, 1e-9), 1.0)) * 1.0
        angles = turn + way * np.arange(0.0, 2.6 * math.pi, SPEED * DT / radius)
        ring = np.column_stack([
            o.center[0] + radius * np.cos(angles), o.center[1] + radius * np.sin(angles),
            np.full(len(angles), here[2]),
        ])  # fmt: skip
        if strands.site.field.distance(ring).min() < 0.1:
            continue
        if not strands.site.field.line_of_sight(here, ring[0], 0.0):
            continue
        steps = int(math.dist(here, ring[0]) / (SPEED * DT)) + 1
        line = here + np.linspace(0.0, 1.0, steps + 1)[1:, None] * (ring[0] - here)
        yield np.vstack([line, ring])


def closes(problem: Problem, tether: object, path: np.ndarray, strands: Strands) -> int | None:
    """At which point of a path the true tether has a loop, if it is soon enough."""
    at = tether
    for k, place in enumerate(path[: int(MOST_S / DT)]):
        at = strands.site.model.update(at, place)
        if loops_in(problem, at.nodes[:, :2]):
            return k
    return None


def warned(report: Report, least: Level) -> bool:
    return any(a.kind in ("loop", "loop-ahead") and a.level >= least for a in report.alarms)


def one(job: tuple[str, int, int]) -> Outcome:
    kind, seed, loops = job
    problem, true = track_of(kind, seed)
    out = Outcome(kind)
    if len(true) < 50:
        return out
    rng = np.random.default_rng([seed, len(kind)])
    drift = rng.normal(0.0, DRIFT, 2) * 0.3
    told = drifted(true, rng, drift)
    guard = Guard(problem, GuardOptions(NOISE, DRIFT, SPEED))
    clear = Guard(problem, GuardOptions(0.01, 0.01, SPEED))
    counter = TurnCounter()
    moments = sorted(rng.integers(30, len(true) - 10, loops).tolist())
    turned = False
    near: list[bool] = []
    said: dict[Level, list[bool]] = {Level.WARNING: [], Level.CAUTION: []}
    for k in range(len(true)):
        begin = time.perf_counter()
        report = guard.take(Fix(k * DT, tuple(told[k]), estimate=True))
        out.updates_ms.append(1e3 * (time.perf_counter() - begin))
        exact = clear.take(Fix(k * DT, tuple(true[k]), estimate=True))
        near.append(exact.loop_s is not None or bool(exact.loops))
        for level, on in said.items():
            on.append(warned(report, level))
        if k and counter.take(true[k] - true[k - 1]) and not turned:
            turned = True
            out.turned += 1
            counter.turned = 0.0
            turned = False
        while moments and moments[0] == k:
            moments.pop(0)
            put_in(out, problem, guard, clear, counter, true[k], k * DT, drift, rng)
    out.warned = len(raised(said[Level.WARNING]))
    out.wrong, out.cautioned = (
        sum(not any(near[max(0, k - AT_ONCE) : k + AT_ONCE + 1]) for k in raised(on))
        for on in said.values()
    )
    out.seconds = len(true) * DT
    return out


def raised(on: list[bool]) -> list[int]:
    """Updates at which something is said that was not just before."""
    return [k for k, now in enumerate(on) if now and not (k and on[k - 1])]


def put_in(
    out: Outcome, problem: Problem, guard: Guard, clear: Guard, counter: TurnCounter,
    here: np.ndarray, now: float, drift: np.ndarray, rng: np.random.Generator,
) -> None:  # fmt: skip
    """A loop that begins here, with copies of the guards."""
    if not clear.strands.all or clear.report is None or clear.report.loops:
        return
    tether = clear.strands.all[0].tether
    for path in loop_paths(problem, tether.robot, clear.strands, rng):
        end = closes(problem, tether, path, clear.strands)
        if end is not None:
            break
    else:
        return
    path = path[: end + int(5.0 / DT)]
    watching, seeing, turns = copy.deepcopy(guard), copy.deepcopy(clear), copy.deepcopy(counter)
    turns.turned = 0.0
    told = drifted(path, rng, drift.copy())
    first = spoken = foreseen = by_turns = None
    before = here
    for k, place in enumerate(path):
        t = now + (k + 1) * DT
        report = watching.take(Fix(t, tuple(told[k]), estimate=True))
        exact = seeing.take(Fix(t, tuple(place), estimate=True))
        if warned(report, Level.WARNING) and first is None:
            first = k
        if warned(report, Level.CAUTION) and spoken is None:
            spoken = k
        if exact.loop_s is not None and exact.loop_s <= 16.0 and foreseen is None:
            foreseen = k
        if turns.take(place - before) and by_turns is None:
            by_turns = k
        before = place
    out.loops += 1
    out.silent += spoken is None
    out.possible += spoken is not None and first is None
    out.missed_by_turns += by_turns is None or by_turns > end
    lead, word = (-math.inf if k is None else (end - k) * DT for k in (first, spoken))
    out.leads.append(lead)
    # where even a guard that knows the position saw it coming ten seconds before
    if foreseen is not None and (end - foreseen) * DT >= LEAD:
        out.allowed.append((lead, word, (end - foreseen) * DT))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tracks", type=int, default=100)
    parser.add_argument("--loops", type=int, default=15)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--outcomes", type=Path, help="JSON lines, one a track")
    parser.add_argument("--only", choices=("plane", "space", "hour"))
    args = parser.parse_args()
    heading("A guard beside robots that are driven")
    if args.only in (None, "space"):
        missions()
    if args.only in (None, "hour"):
        hour(args.jobs)
    if args.only in ("space", "hour"):
        return
    head("tracks", "hours", "loops put in", "nothing said", "only as possible",
         "missed by turns", "lead of the warning s, p5 / median",
         "warned / told 10 s before where foreseeable %", "where foreseeable 12 s before %",
         "warnings an hour", "false an hour",
         "false as possible an hour",
         "turn counter's an hour", "update ms, median / p99", name="guard")  # fmt: skip
    jobs = [(kind, seed, args.loops) for kind, seed in tracks(args.tracks)]
    found = outcomes(jobs, one, Outcome, workers=args.jobs, file=args.outcomes)
    for kind in (*dict.fromkeys(o.kind for o in found), None):
        some = [o for o in found if kind in (None, o.kind)]
        told(kind or "all", some)
    print()


def beside_flight(
    mission: Mission, scene: Scene, log: Sequence[LogRow], noise: float, drift: float
) -> tuple[list[int], float, list[float], bool]:
    """Stops told as planned, otherwise and not at all, longest tether (m), updates (ms), and
    whether the end is free."""
    guard = Guard(
        SpaceSite(mission, scene), GuardOptions(max(noise, 0.02), max(drift, 0.02), SPEED)
    )
    rng, off, longest, updates = np.random.default_rng(0), np.zeros(3), 0.0, []
    ends = np.array([stop.path[-1] for stop in guard.site.mission.tour.stops])
    said: dict[int, set[bool | None]] = {}
    last = -math.inf
    for r in log:
        step = min(r.time - last, DRIFT_S)
        if step < 0.95 * DT:
            continue
        last, true = r.time, np.array([r.x, r.y, r.z])
        off[:2] += (
            drift * math.sqrt(2 * step / DRIFT_S) * rng.normal(size=2) - off[:2] * step / DRIFT_S
        )
        place = true + off + noise * rng.normal(size=3) * (1, 1, 0.2)
        begin = time.perf_counter()
        report = guard.take(Fix(r.time, tuple(place), estimate=True))
        updates.append(1e3 * (time.perf_counter() - begin))
        if report.classes:
            longest = max(longest, report.classes[0].taut)
        for k in np.flatnonzero(np.linalg.norm(ends - true, axis=1) <= mission.reach):
            said.setdefault(int(k), set()).add(report.as_planned)
    counts = [0, 0, 0]
    for k in range(len(ends)):
        answers = said.get(k, {None})
        counts[0 if True in answers else 1 if False in answers else 2] += 1
    free = report.classes[0].word == guard.site.start_word() and not report.loops
    return counts, longest, updates, free


def missions() -> None:
    """Planned missions, flown, with a guard beside: exact positions, and noise with drift."""
    head("mission", "stops", "as planned, exact", "longest tether m, guard / flight",
         "free at home", "update ms, median / p99", "with noise: as planned", "otherwise",
         "not told",
         "update ms, median / p99 ", name="guard-space")  # fmt: skip
    for name in ("basin", "pipes", "jacket", "ring", "linked rings", "net pen"):
        mission, scene = mission_of(name) if name in SITES else shipped(name)
        found = solve_mission(mission, scene=scene)
        log = (found.run or simulate(found.mission, scene=scene)).log
        counts, longest, ms, free = beside_flight(found.mission, scene, log, 0.0, 0.0)
        noisy, _, slow, _ = beside_flight(found.mission, scene, log, 0.3, 0.5)
        row(name, str(sum(counts)), str(counts[0]),
            f"{longest:.2f} / {max(r.tether for r in log):.2f}", "yes" if free else "no",
            f"{np.median(ms):.1f} / {np.percentile(ms, 99):.1f}", *map(str, noisy),
            f"{np.median(slow):.1f} / {np.percentile(slow, 99):.1f}")  # fmt: skip
    print()


def resident() -> float:
    """MiB of this process."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20


def hour(jobs: int) -> None:
    """A recorded flight over and over for an hour at ten a second, with noise and drift, each
    update told as a line of JSON; every flight in a process of its own."""
    head("flight", "updates", "update ms, median / p99 / worst", "path home with it, ms",
         "MiB after 6 min", "after 60 min", name="guard-hour")  # fmt: skip
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, max_tasks_per_child=1, mp_context=spawn) as pool:
        for cells in pool.map(hour_of, SHIPPED):
            row(*cells)
    print()


def hour_of(name: str) -> list[str]:
    """The cells of one flight."""
    problem, true = recorded(name)
    guard, rng = Guard(problem, GuardOptions(NOISE, DRIFT, SPEED)), np.random.default_rng(0)
    begin, updates, home, early, count = np.zeros(2), [], [], 0.0, 0
    while count < 36_000:
        for place in drifted(true, rng, begin):
            began = time.perf_counter()
            report = guard.take(Fix(count * DT, tuple(place), estimate=True))
            updates.append(1e3 * (time.perf_counter() - began))
            began = time.perf_counter()
            json.dumps(report.as_row())
            home.append(1e3 * (time.perf_counter() - began))
            count += 1
            if count == 3_600:
                early = resident()
    ms = np.array(updates)
    return [
        name, str(count), f"{np.median(ms):.1f} / {np.percentile(ms, 99):.1f} / {ms.max():.0f}",
        f"{np.percentile(home, 99):.2f}", f"{early:.0f}", f"{resident():.0f}",
    ]  # fmt: skip


def in_time(leads: np.ndarray) -> str:
    """Per cent of loops warned of, and told of, ten seconds before."""
    if not len(leads):
        return ""
    share = " / ".join(f"{100.0 * v:.1f}" for v in (leads[:, :2] >= LEAD).mean(axis=0))
    return f"{share} of {len(leads)}"


def told(name: str, some: list[Outcome]) -> None:
    hours = sum(o.seconds for o in some) / 3600.0
    leads = [v for o in some for v in o.leads]
    allowed = np.array([v for o in some for v in o.allowed]).reshape(-1, 3)
    ms = [v for o in some for v in o.updates_ms]
    if not leads or not hours:
        return
    row(f"{len(some)} {name}", f"{hours:.2f}", str(len(leads)), str(sum(o.silent for o in some)),
        str(sum(o.possible for o in some)),
        str(sum(o.missed_by_turns for o in some)),
        f"{np.percentile(leads, 5, method='lower'):.1f} / {np.median(leads):.1f}",
        in_time(allowed), in_time(allowed[allowed[:, 2] >= LONGER]),
        f"{sum(o.warned for o in some) / hours:.1f}", f"{sum(o.wrong for o in some) / hours:.1f}",
        f"{sum(o.cautioned for o in some) / hours:.1f}",
        f"{sum(o.turned for o in some) / hours:.1f}",
        f"{np.median(ms):.1f} / {np.percentile(ms, 99):.1f}")  # fmt: skip


if __name__ == "__main__":
    main()
