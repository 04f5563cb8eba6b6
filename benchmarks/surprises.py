"""Random surprises of every kind while tours are carried out, and what must hold of each run.

    python benchmarks/surprises.py [--runs 300] [--kind appear_on_path]

Worlds: circles, polygons (`harbour`), and every file of `problems/`. A run is good when the robot
is home with its tether free, was never in an obstacle, never on a tether that was too long (but
while it shortens one whose limit was lowered), visited every goal that is not left out, and left
out exactly those that a judge of its own calls unreachable: a visibility graph of Shapely's, which
knows nothing of netsp's roadmap. Goals within three per mille of the tether are left to either.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import math
from dataclasses import replace

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from table import ROOT, head, heading, row

from netsp import Circle, Problem, Solution, solve
from netsp.base.errors import NetspError
from netsp.online.execute import ExecutionOptions, Surprises, execute
from netsp.online.execute.execution_log import Execution
from netsp.plan.random_worlds import random_world
from netsp.world.tether.resolution import suggested_delta

KINDS = (
    "none", "appear_on_path", "appear_on_tether", "appear_on_robot", "several", "vanish", "move",
    "goal_in_reach", "goal_out_of_reach", "cancel_goal", "shorter_tether", "push_across",
)  # fmt: skip

RESPONSES = "local", "replan", "home", "kept"

SIDES = 96
"""Of the polygon that stands in for a circle in the judge's visibility graph."""


@functools.cache
def world(index: int) -> tuple[Problem, Solution]:
    """A world and its tour: circles, polygons and the shipped problems in turn."""
    shipped = sorted((ROOT / "problems").glob("*.json"))
    shipped += [p for p in sorted((ROOT / "problems" / "known").glob("*.json"))
                if p.name != "optima.json"]  # fmt: skip
    if index % 3 == 2:
        problem = Problem.load(shipped[index // 3 % len(shipped)])
    else:
        family = "icra2017" if index % 3 == 0 else "harbour"
        problem = random_world(index, family=family, goals=8, tether_length=300.0)
    return problem, solve(problem)


def surprise(problem: Problem, solution: Solution, kind: str, seed: int) -> Surprises | None:
    """Something of a kind that happens on the way, at a speed of one unit of length a second of a
    hundredth of the tour; None where the world offers none."""
    rng = np.random.default_rng(seed)
    path = np.array(solution.path)
    s = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    size = float(np.ptp(path[:, :2], axis=0).max()) or problem.tether_length
    speed = speed_of(solution)
    share = rng.uniform(0.1, 0.8)

    def at(u: float) -> np.ndarray:
        return np.array([np.interp(u * s[-1], s, path[:, k]) for k in range(3)])

    def circle(centre: np.ndarray) -> dict[str, object]:
        return {"center": centre[:2].tolist(), "radius": float(rng.uniform(0.01, 0.06)) * size}

    base = np.array(problem.base[:2])
    when = share * s[-1] / speed
    out: list[dict[str, object]]
    for _ in range(60):
        off = rng.normal(size=3) * 0.01 * size
        if kind == "none":
            out = []
        elif kind == "appear_on_path":
            there = at(rng.uniform(share, 1.0)) + off
            out = [{"time": when, "appear": circle(there)}]
        elif kind == "appear_on_robot":
            out = [{"time": when, "appear": circle(at(share))}]
        elif kind == "appear_on_tether":
            there = base + rng.uniform(0.2, 0.8) * (at(share)[:2] - base)
            out = [{"time": when, "appear": circle(there)}]
        elif kind == "several":
            out = [
                {"time": when, "appear": circle(at(rng.uniform(0, 1)) + 3 * off)} for _ in range(3)
            ]
        elif kind == "vanish":
            if not problem.obstacles:
                return None
            out = [{"time": when, "vanish": int(rng.integers(len(problem.obstacles)))}]
        elif kind == "move":
            if not problem.obstacles:
                return None
            by = (rng.normal(size=2) * 0.08 * size).tolist()
            which = int(rng.integers(len(problem.obstacles)))
            out = [{"time": when, "move": {"obstacle": which, "by": by}}]
        elif kind in ("goal_in_reach", "goal_out_of_reach"):
            far = rng.uniform(0.1, 0.8) if kind == "goal_in_reach" else rng.uniform(1.2, 3.0)
            angle = rng.uniform(0, 2 * math.pi)
            there = base + far * problem.tether_length * np.array([np.cos(angle), np.sin(angle)])
            out = [{"time": when, "add_goal": {"position": there.tolist()}}]
        elif kind == "cancel_goal":
            out = [{"time": when, "cancel_goal": int(rng.integers(len(problem.goals)))}]
        elif kind == "shorter_tether":
            out = [{"time": when, "tether_length": problem.tether_length * rng.uniform(0.4, 0.9)}]
        else:
            angle = rng.uniform(0, 2 * math.pi)
            push = rng.uniform(0.05, 0.4) * size * np.array([np.cos(angle), np.sin(angle)])
            out = [{"time": when, "push": [*push.tolist(), 0.0]}]
        try:
            made = Surprises.model_validate({"schema_version": 1, "events": out})
            made.check(problem)
        except NetspError:
            continue  # upon the base, or no simple polygon any more
        if kind == "goal_in_reach" and problem.bounds is not None:
            x0, y0, x1, y1 = problem.bounds
            if not (x0 < there[0] < x1 and y0 < there[1] < y1):
                continue
        return made
    return None


def speed_of(solution: Solution) -> float:
    """A speed at which a tour takes some hundred steps, whatever the size of the world."""
    return max(float(solution.length or 0.0) / 400.0, 1e-3)


def shortest(problem: Problem) -> np.ndarray:
    """(goals,) length in space of the shortest path in any class from the base to each goal; inf
    where there is none, by a visibility graph of inscribed polygons."""
    shapes, corners = [], []
    for o in problem.obstacles:
        if isinstance(o, Circle):
            angle = 2 * np.pi * (np.arange(SIDES) + 0.31) / SIDES
            ring = np.column_stack([np.cos(angle), np.sin(angle)])
            ring = ring * (o.radius + problem.clearance) + o.center
        else:
            grown = shapely.Polygon(o.polygon).buffer(problem.clearance, quad_segs=SIDES // 4)
            ring = np.array(grown.exterior.coords)[:-1]
        shapes.append(shapely.Polygon(ring))
        corners.append(ring)
    tiny = 1e-6 * problem.scale
    solid = shapely.union_all([s.buffer(tiny, join_style="mitre") for s in shapes])
    solid = solid.buffer(-1.02 * tiny, join_style="mitre")
    points = np.vstack([problem.points[:, :2], *corners])
    free = ~shapely.contains_xy(solid, points)
    if problem.bounds is not None:
        box = shapely.box(*problem.bounds).buffer(tiny)
        free &= shapely.contains_xy(box, points)
    points = np.vstack([points[: len(problem.points)], points[len(problem.points) :][
        free[len(problem.points) :]]])  # fmt: skip
    # corners farther than the tether are of no use
    near = np.hypot(*(points - points[0]).T) <= 1.01 * problem.tether_length
    near[: len(problem.points)] = True
    points = points[near]
    i, j = np.array(list(itertools.combinations(range(len(points)), 2))).T
    shapely.prepare(solid)
    lines = shapely.linestrings(np.stack([points[i], points[j]], axis=1))
    seen = ~shapely.intersects(solid, lines)
    d = np.hypot(*(points[i] - points[j]).T)[seen]
    graph = coo_array((np.maximum(d, 1e-300), (i[seen], j[seen])), shape=(len(points),) * 2)
    planar = dijkstra(graph.tocsr(), directed=False, indices=0)[1 : len(problem.points)]
    inside = ~free[1 : len(problem.points)]
    planar[inside] = np.inf
    return np.hypot(planar, problem.points[1:, 2] - problem.points[0, 2])


def faults(done: Execution) -> list[str]:
    """What is wrong with a run."""
    s, problem = done.summary, done.problem
    out = []
    if s["defects"]:
        out.append("defect: " + next(e.reason for e in done.entries if e.response == "defect"))
    if not s["home"]:
        out.append("not home")
    elif not s["tether_free"]:
        out.append("tether not free")
    if s["exceedance_s"] > 0.0:
        out.append(f"too long for {s['exceedance_s']:.3g} s")
    if s["arrivals_as_planned"] != len(done.arrivals):
        out.append("not as planned")
    last = max((e.time for e in done.entries), default=0.0)
    xy = np.array([[r.x, r.y] for r in done.rows if r.time > last]).reshape(-1, 2)
    allowed = 0.25 * suggested_delta(problem)
    for i, o in enumerate(problem.obstacles):
        depth = problem.clearance - float(np.min(o.signed_distance(xy), initial=np.inf))
        if depth > allowed:
            out.append(f"in obstacle {i} by {depth:.3g}")
    named = {a.goal for a in done.arrivals} | set(done.left_out) | set(done.cancelled) | {-1}
    if len(named) != len(problem.goals) + 1:
        out.append("a goal forgotten")
    if done.left_out:
        needs, limit = shortest(problem), problem.tether_length
        tolerance = 3e-3 * limit
        for goal, why in done.left_out.items():
            if needs[goal] < limit - tolerance:
                out.append(f"left out goal {goal} ({why}), {needs[goal]:.6g} of {limit:g} away")
    return out


def run(index: int, kind: str, **options: float) -> tuple[Execution, list[str]] | None:
    """One run of a kind over a world, and its faults; None where the world offers no such
    surprise."""
    problem, solution = world(index)
    events = surprise(problem, solution, kind, index)
    if events is None or solution.length is None:
        return None
    how = replace(ExecutionOptions(speed=speed_of(solution)), **options)
    done = execute(problem, solution, how, surprises=events)
    return done, faults(done)


def main() -> None:
    """Fly, count, and name what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--kind", choices=KINDS)
    args = parser.parse_args()
    heading("Surprises")
    head("kind", "runs", "good", "goals visited", "goals left out", "local", "replan", "home",
         "kept", "planning s (median; worst)",
         name=None if args.kind else "surprises")  # fmt: skip
    kinds = [args.kind] if args.kind else list(KINDS)
    bad = []
    for kind in kinds:
        runs, index = [], 0
        while len(runs) < -(-args.runs // len(kinds)) and index < 10 * args.runs:
            flown = run(index, kind)
            if flown is not None:
                runs.append(flown)
                bad += [f"world {index}, {kind}: {fault}" for fault in flown[1]]
            index += 1
        entries = [e for done, _ in runs for e in done.entries]
        spent = [e.planning_s for e in entries if e.planning_s] or [0.0]
        row(
            kind, len(runs), sum(not f for _, f in runs),
            sum(d.summary["visited"] for d, _ in runs), sum(len(d.left_out) for d, _ in runs),
            *(sum(e.response == what for e in entries) for what in RESPONSES),
            f"{np.median(spent):.2f}; {max(spent):.2f}",
        )  # fmt: skip
    print()
    for line in bad:
        print(f"- {line}")


if __name__ == "__main__":
    main()
