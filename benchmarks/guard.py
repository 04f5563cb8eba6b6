"""A guard beside robots that are driven, with noise: what it misses, how early it warns, how often
it is wrong, and how long an update takes; and a counter of turns on the same tracks.

    python benchmarks/guard.py [--tracks 100] [--loops 15] [--places] [--jobs 2]
                               [--outcomes FILE] [--keep]

Into each track (`guard_tracks`) loops are put at random moments: from there the robot drives round
some obstacle in sight until its own tether has closed a loop. Positions get white noise (0.3 m) and
a drift (0.5 m, forgotten in 100 s), velocities white noise (0.1 m/s); with `--places` the vehicle
tells no velocities. That takes an hour: with `--outcomes` each track's are kept in a file as soon
as they are known, and tracks that are in it are not driven again.
"""

from __future__ import annotations

import argparse
import copy
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import shapely
from guard_tracks import DRIFT, DT, NOISE, SPEED, told_of, track_of, tracks
from resumed import outcomes
from table import head, heading, row

from netsp.model.problem import Circle, Polygon, Problem
from netsp.online.guard.alarms import Level
from netsp.online.guard.guard_report import Report
from netsp.online.guard.loops import loops_in
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_belief import Strands
from netsp.online.guard.tether_guard import Guard, GuardOptions

LEAD, LONGER = 10.0, 12.0
MOST_S = 90.0
HORIZON, BREAK = 16.0, 5
"""A loop is seen coming when it is so many seconds ahead, at most, and until it is not in so many
updates in a row."""
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
    guard that knows the position, since it sees it all the time and the robot goes so."""
    glimpsed: list[tuple[float, float]] = field(default_factory=list)
    """Of others that such a guard saw in time, but not all the time since, or by chance."""
    updates_ms: list[float] = field(default_factory=list)
    home_ms: list[float] = field(default_factory=list)


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


def circle_about(obstacle: Circle | Polygon) -> tuple[tuple[float, float], float]:
    """Its middle and radius."""
    if isinstance(obstacle, Circle):
        return obstacle.center, obstacle.radius
    shape = obstacle.shape()
    middle = shapely.minimum_bounding_circle(shape).centroid
    return (middle.x, middle.y), float(shapely.minimum_bounding_radius(shape))


def loop_paths(
    problem: Problem, here: np.ndarray, strands: Strands, rng: np.random.Generator
) -> Iterator[tuple[np.ndarray, int]]:
    """Straight to obstacles in sight, one after the other, and around each, once and a bit; with
    the place on the way where each circle begins."""
    for i in rng.permutation(len(problem.obstacles)):
        center, least = circle_about(problem.obstacles[int(i)])
        if math.dist(center, here[:2]) > 25.0:
            continue
        radius = least + problem.clearance + float(rng.uniform(0.6, 2.0))
        way = 1.0 if rng.random() < 0.5 else -1.0
        away = here[:2] - np.array(center)
        far = float(np.hypot(*away))
        if far < radius:
            radius = max(far, least + problem.clearance + 0.3)
        begin = math.atan2(away[1], away[0])
        turn = begin + way * math.acos(min(radius / max(far, 1e-9), 1.0)) * 1.0
        angles = turn + way * np.arange(0.0, 2.6 * math.pi, SPEED * DT / radius)
        ring = np.column_stack([
            center[0] + radius * np.cos(angles), center[1] + radius * np.sin(angles),
            np.full(len(angles), here[2]),
        ])  # fmt: skip
        if strands.site.field.distance(ring).min() < 0.1:
            continue
        if not strands.site.field.line_of_sight(here, ring[0], 0.0):
            continue
        steps = int(math.dist(here, ring[0]) / (SPEED * DT)) + 1
        line = here + np.linspace(0.0, 1.0, steps + 1)[1:, None] * (ring[0] - here)
        yield np.vstack([line, ring]), len(line)


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


def one(job: tuple[str, int, int, bool]) -> Outcome:
    """A track of a kind and seed, so many loops, and whether the vehicle tells its velocity."""
    kind, seed, loops, velocities = job
    problem, true = track_of(kind, seed)
    out = Outcome(kind)
    if len(true) < 50:
        return out
    rng = np.random.default_rng([seed, len(kind)])
    drift = rng.normal(0.0, DRIFT, 2) * 0.3
    told = told_of(true, rng, drift, 0.0, velocities)
    guard = Guard(problem, GuardOptions(NOISE, DRIFT, SPEED))
    clear = Guard(problem, GuardOptions(0.01, 0.01, SPEED))
    counter = TurnCounter()
    moments = sorted(rng.integers(30, len(true) - 10, loops).tolist())
    near: list[bool] = []
    said: dict[Level, list[bool]] = {Level.WARNING: [], Level.CAUTION: []}
    for k in range(len(true)):
        begin = time.perf_counter()
        report = guard.update(told[k])
        out.updates_ms.append(1e3 * (time.perf_counter() - begin))
        exact = clear.update(Fix(k * DT, tuple(true[k]), estimate=True))
        near.append(exact.loop_s is not None or bool(exact.loops))
        for level, on in said.items():
            on.append(warned(report, level))
        if k and counter.take(true[k] - true[k - 1]):
            out.turned += 1
            counter.turned = 0.0
        while moments and moments[0] == k:
            moments.pop(0)
            put_in(out, problem, guard, clear, counter, true[k], k * DT, drift, rng, velocities)
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
    here: np.ndarray, now: float, drift: np.ndarray, rng: np.random.Generator, velocities: bool,
) -> None:  # fmt: skip
    """A loop that begins here, with copies of the guards."""
    if not clear.strands.all or clear.report is None or clear.report.loops:
        return
    tether = clear.strands.all[0].tether
    for path, turns_at in loop_paths(problem, tether.robot, clear.strands, rng):
        end = closes(problem, tether, path, clear.strands)
        if end is not None:
            goes_so = turns_at if end >= turns_at else 0
            break
    else:
        return
    path = path[: end + int(5.0 / DT)]
    watching, seeing, turns = copy.deepcopy(guard), copy.deepcopy(clear), copy.deepcopy(counter)
    turns.turned = 0.0
    told = told_of(path, rng, drift.copy(), now + DT, velocities, here)
    first = spoken = by_turns = None
    coming: list[bool] = []
    before = here
    for k, place in enumerate(path):
        t = now + (k + 1) * DT
        report = watching.update(told[k])
        exact = seeing.update(Fix(t, tuple(place), estimate=True))
        if warned(report, Level.WARNING) and first is None:
            first = k
        if warned(report, Level.CAUTION) and spoken is None:
            spoken = k
        if k <= end:
            coming.append(exact.loop_s is not None and exact.loop_s <= HORIZON)
        if turns.take(place - before) and by_turns is None:
            by_turns = k
        before = place
    out.loops += 1
    out.silent += spoken is None
    out.possible += spoken is not None and first is None
    out.missed_by_turns += by_turns is None or by_turns > end
    lead, word = (-math.inf if k is None else (end - k) * DT for k in (first, spoken))
    out.leads.append(lead)
    # where a guard that knows the position sees it coming, and the robot goes as it does then: what
    # is seen on the straight piece of a loop that closes on the circle is there by chance
    seen = (end - max(seen_since(coming), goes_so)) * DT
    if seen >= LEAD:
        out.allowed.append((lead, word, seen))
    elif any(coming) and (end - coming.index(True)) * DT >= LEAD:
        out.glimpsed.append((lead, word))


def seen_since(coming: list[bool]) -> int:
    """Since which update a loop has been seen coming to the last one, but for short breaks."""
    since, gone = len(coming), 0
    for k in range(len(coming) - 1, -1, -1):
        gone = 0 if coming[k] else gone + 1
        if gone > BREAK:
            break
        since = k if coming[k] else since
    return since


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tracks", type=int, default=100)
    parser.add_argument("--loops", type=int, default=15)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--outcomes", type=Path, help="JSON lines, one a track")
    parser.add_argument("--places", action="store_true", help="vehicles that tell no velocities")
    args = parser.parse_args()
    heading("A guard beside robots that are driven")
    name = "guard-places" if args.places else "guard"
    head("tracks", "hours", "loops put in", "nothing said", "only as possible",
         "missed by turns", "lead of the warning s, p5 / median",
         "warned / told 10 s before where foreseeable %", "where foreseeable 12 s before %",
         "warnings an hour", "false an hour",
         "false as possible an hour",
         "turn counter's an hour", "update ms, median / p99", name=name)  # fmt: skip
    jobs = [(kind, seed, args.loops, not args.places) for kind, seed in tracks(args.tracks)]
    found = outcomes(jobs, one, Outcome, workers=args.jobs, file=args.outcomes)
    for kind in (*dict.fromkeys(o.kind for o in found), None):
        some = [o for o in found if kind in (None, o.kind)]
        told(kind or "all", some)
    glimpsed = np.array([v for o in found for v in o.glimpsed]).reshape(-1, 2)
    if len(glimpsed):
        print(f"\nSeen in time by chance: warned / told 10 s before {in_time(glimpsed)}")
    print()


if __name__ == "__main__":
    main()
