"""Words and tours in space.

    python benchmarks/space.py [--only words|loops|prisms|prism-tours|prism-kinds|given|frames|
                               missions] [--missions jacket …] [--keep] [--cpu-limits]

Words: what groups scenes have, and what they take. Loops: random ones, beside a second invariant.
Prisms: tours in space of problems whose shortest tour is proven in the plane. Prism tours and prism
kinds: random scenes of posts, boxes and polygons, close together, many, near the surface, with
goals at different depths: the tour of the plane driven in space, and whole runs within some limits.
Given: missions in a good order, solved again within short limits. Frames: random ones, with the gap
to the bound of all tours. Missions: the shipped ones, and the sites of `benchmarks/sites.py`,
solved, and flown by `predictive` as they were planned and in the order that they were given.
"""

from __future__ import annotations

import argparse
import itertools
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from peak import highest
from sites import SITES, mission_of, shipped
from table import ROOT, head, heading, row

from netsp import Problem, solve
from netsp.base.clock import Clock
from netsp.base.geometry import polylines
from netsp.hsignature.rays import signature
from netsp.plan.random_worlds import reachable_world
from netsp.plan.solve_problem import solve_graph
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.mission_solver import (
    GOING_ON,
    SolvedMission,
    seconds_until_home,
    solve_mission,
)
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext, is_straight_clear
from netsp.plan.space.prisms import drive_plane_tours
from netsp.plan.space.space_plan import AS_GIVEN, OUT_AND_BACK, PLANE, SHORT_ORDER, prepare_context
from netsp.plan.space.space_signature import SpaceSignature
from netsp.plan.space.upright import bound_by_upright_solids
from netsp.plan.space.visit_order import order_by_going_on
from netsp.roadmap.explain_unreachable import shortest_tethers
from netsp.roadmap.travel_graph import TravelGraph
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import Run
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import scene_of
from netsp.world.simulator.mission_run import mission_grid, simulate

MISSIONS = ("basin", "pipes", "jacket")
LONGER_PEN = "net pen, 24 m of tether"
"""Where the tether leads round the pen to what is behind it."""

WAYS = {
    GOING_ON: "going straight on", AS_GIVEN: "the order given", PLANE: "the plane",
    OUT_AND_BACK: "out and back", SHORT_ORDER: "a short order",
}  # fmt: skip

LOW, HIGH, ANCHOR = [-5.0] * 3, [5.0] * 3, [4.0, 0.3, 3.0]
POSTS = np.array([[-2.0, -1.0], [0.5, 1.5], [2.0, -2.0]])


def torus(centre: list[float], axis: list[float], radius: float = 2.0, tube: float = 0.05) -> dict:
    return {"torus": {"center": centre, "axis": axis, "major_radius": radius,
                      "minor_radius": tube}}  # fmt: skip


def bar(a: list[float], b: list[float], radius: float = 0.15) -> dict:
    return {"capsule": {"a": list(a), "b": list(b), "radius": radius}}


def trefoil() -> list[dict]:
    t = np.linspace(0.0, 2.0 * np.pi, 61)
    p = np.c_[np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)]
    return [bar(a, b) for a, b in itertools.pairwise(p.tolist())]


def cube() -> list[dict]:
    corners = list(itertools.product((-2.0, 2.0), repeat=3))
    return [bar(a, b) for a, b in itertools.combinations(corners, 2)
            if sum(x != y for x, y in zip(a, b, strict=True)) == 1]  # fmt: skip


def shapes() -> dict[str, list[dict]]:
    up, along = [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]
    return {
        "ring": [torus([0, 0, 0], up)],
        "two rings": [torus([0, 0, -2], up), torus([0, 0, 2], up)],
        "two linked rings": [torus([0, 0, 0], up), torus([2, 0, 0], along)],
        "chain of three": [torus([-1.5, 0, 0], up, 1.2), torus([0, 0, 0], along, 1.2),
                           torus([1.5, 0, 0], up, 1.2)],
        "trefoil": trefoil(),
        "frame of a cube": cube(),
        "pipe above the floor": [bar([-20, 0, 0], [20, 0, 0]),
                                 {"half_space": {"point": [0, 0, -3], "normal": up}}],
    }  # fmt: skip


def shown(rank: int, relators: tuple) -> str:
    letters = [
        " ".join(f"{'abcdefghij'[abs(x) - 1]}{'⁻¹' if x < 0 else ''}" for x in r) for r in relators
    ]
    return f"F{rank}" if not relators else f"{rank} generators, {'; '.join(letters)}"


def words() -> None:
    """Groups of scenes, each in a process of its own."""
    head("scene", "cells", "group", "exact", "s", "MiB", name="space-words")
    for name in (*shapes(), *MISSIONS, "jacket, five million cells"):
        line = subprocess.run(
            [sys.executable, __file__, "--group", name], capture_output=True, text=True, check=True
        ).stdout.splitlines()[-1]
        row(*json.loads(line))
    print()


def group(name: str) -> list[str]:
    """One row of `words`."""

    warm = SpaceSignature.in_box(Scene(solids=shapes()["ring"]).field(), LOW, HIGH, 0.5, ANCHOR)
    assert warm.exact
    if name in shapes():
        field, box, cell, anchor = Scene(solids=shapes()[name]).field(), (LOW, HIGH), 0.2, ANCHOR
    else:
        mission = Mission.load(ROOT / "missions" / f"{name.split(',')[0]}.json")
        scene = mission.load_scene()
        field = scene.field()
        grid = mission_grid(mission, scene, field)
        box = (grid.low, grid.low + grid.cell * np.array(grid.free.shape))
        cell, anchor = grid.cell, mission.anchor
        if "," in name:
            cell *= (grid.free.size / 5e6) ** (1 / 3)
    before = highest()
    begin = time.perf_counter()
    made = SpaceSignature.in_box(field, *box, cell, anchor)
    took = time.perf_counter() - begin
    more = 1024 * (highest() - before)
    return [name, f"{made.cells.flags.size:,}", shown(made.group.rank, made.group.relators),
            "yes" if made.exact else "no", f"{took:.1f}", f"{more:.0f}"]  # fmt: skip


def random_loops(count: int, field: DistanceField, seed: int = 0) -> Iterator[np.ndarray]:
    """Closed polylines at least 5 cm from all solids."""
    rng = np.random.default_rng(seed)
    clear = field.grown(0.05)
    while count:
        points = rng.uniform(-4.7, 4.7, (rng.integers(3, 9), 3))
        closed = np.vstack([points, points[:1]])
        if (clear.distance(points) > 0).all() and all(
            clear.line_of_sight(a, b) for a, b in itertools.pairwise(closed)
        ):
            count -= 1
            yield points


def linking(points: np.ndarray, z: float) -> int:
    """Passages of a loop through the disc of a ring of radius 2 about the z axis, with signs."""
    total = 0
    for a, b in itertools.pairwise(np.vstack([points, points[:1]])):
        if (a[2] < z) != (b[2] < z):
            at = a + (z - a[2]) / (b[2] - a[2]) * (b - a)
            total += (1 if b[2] > a[2] else -1) * int(np.hypot(*at[:2]) < 2.0)
    return total


def loops(count: int) -> None:
    """Disagreements of words with a second invariant."""
    head("loops", "beside", "classes met", "disagree", "no word", name="space-loops")
    row(*beside_linking(count))
    row(*beside_rays(count))
    row(*beside_cells(count))
    print()


def beside_linking(count: int) -> tuple[int, str, int, int, int]:
    field = Scene(solids=shapes()["two rings"]).field()
    made = SpaceSignature.in_box(field, LOW, HIGH, 0.25, ANCHOR)
    seen: dict[tuple, tuple] = {}
    wrong = without = 0
    for points in random_loops(count, field):
        word, broken = made.try_word(points, closed=True)
        without += broken is not None
        number = linking(points, -2.0), linking(points, 2.0)
        wrong += seen.setdefault(number, made.windings(word)) != made.windings(word)
    wrong += len(seen) - len(set(seen.values()))
    return count, "linking numbers of two rings", len(seen), wrong, without


def beside_rays(count: int) -> tuple[int, str, int, int, int]:
    solids = [{"post": {"center": p.tolist(), "radius": 0.3}} for p in POSTS]
    field = Scene(solids=solids).field()
    made = SpaceSignature.in_box(field, LOW, HIGH, 0.25, ANCHOR)
    seen: dict[tuple, tuple] = {}
    wrong = without = done = 0
    clear = field.grown(0.05)
    for points in random_loops(20 * count, field, 1):
        if not clear.line_of_sight(points[0], ANCHOR):
            continue
        moored = np.vstack([ANCHOR, points, points[:1], ANCHOR])
        word, broken = made.try_word(moored)
        without += broken is not None
        rays = signature(moored, POSTS)
        wrong += seen.setdefault(rays, word) != word
        done += 1
        if done == count:
            break
    wrong += len(seen) - len(set(seen.values()))
    return done, "words of the rays of three posts", len(seen), wrong, without


def beside_cells(count: int) -> tuple[int, str, int, int, int]:
    field = Scene(solids=cube()).field()
    one, other = (SpaceSignature.in_box(field, LOW, HIGH, cell, ANCHOR) for cell in (0.25, 0.19))
    seen: dict[tuple, tuple] = {}
    wrong = without = 0
    for points in random_loops(count, field, 2):
        (a, x), (b, y) = (made.try_word(points, closed=True) for made in (one, other))
        without += x is not None or y is not None
        wrong += (a == ()) != (b == ())
        wrong += seen.setdefault(one.windings(a), other.windings(b)) != other.windings(b)
    return count, "cells of another size, frame of a cube", len(seen), wrong, without


def in_space(problem: Problem, folder: Path) -> Mission:
    """A problem of the plane as a mission; the tether's share for steering is given on top."""
    (folder / "scene.json").write_text(scene_of(problem).model_dump_json(exclude_none=True))
    (folder / "mission.json").write_text(json.dumps({
        "schema_version": 1, "scene": "scene.json", "anchor": problem.base, "start": problem.base,
        "waypoints": [g.position for g in problem.goals], "clearance": 0.0,
        "tether_length": problem.tether_length / MissionPolicy().tether_share,
    }))  # fmt: skip
    return Mission.load(folder / "mission.json")


def prism_worlds() -> Iterator[tuple[str, Problem]]:
    for name in ("pool", "wharf"):
        yield name, Problem.load(ROOT / "problems" / f"{name}.json")
    for seed in range(5):
        problem, _ = reachable_world(seed, goals=6, obstacles=5, tether_length=40.0)
        yield f"random {seed}", problem


def posts_world(seed: int) -> tuple[Problem, Mission, Scene]:
    """Return posts of any size with 5 to 8 goals about them: in the plane, and as a mission with
    the same clearance and the same tether, which is up to a third longer than the farthest goal
    needs."""
    rng = np.random.default_rng(seed)
    clearance, base = 0.05, (-9.0, 0.0, 0.0)
    posts: list[tuple[np.ndarray, float]] = []
    while len(posts) < 5 + seed % 4:
        centre, radius = rng.uniform(-8.0, 8.0, 2), float(rng.uniform(0.2, 1.6))
        if np.linalg.norm(centre - base[:2]) > radius + 0.5 and all(
            np.linalg.norm(centre - c) > r + radius + 0.6 for c, r in posts
        ):
            posts.append((centre, radius))
    goals: list[tuple[float, float, float]] = []
    while len(goals) < 5 + seed % 4:
        p = rng.uniform(-9.0, 9.0, 2)
        if all(np.linalg.norm(p - c) > r + 0.2 for c, r in posts):
            goals.append((float(p[0]), float(p[1]), 0.0))
    problem = Problem.model_validate({
        "base": base, "goals": goals, "clearance": clearance, "bounds": [-10, -10, 10, 10],
        "obstacles": [{"center": c.tolist(), "radius": r} for c, r in posts],
        "tether_length": 60.0,
    })  # fmt: skip
    needed = float(shortest_tethers(problem).max())
    problem = problem.model_copy(update={"tether_length": needed * rng.uniform(1.02, 1.33)})
    scene = Scene(
        solids=[{"post": {"center": c.tolist(), "radius": r}} for c, r in posts],
        bounds=[-10, -10, -1, 10, 10, 1],
    )
    mission = Mission(
        scene="-", anchor=base, start=base, waypoints=goals, clearance=clearance, cell=0.25,
        tether_length=problem.tether_length,
    )  # fmt: skip
    return problem, mission, scene


PRISM_KINDS = ("circles", "boxes", "polygons", "close pairs", "many", "near the surface", "depths")
"""Kinds of random scenes of upright prisms."""


def prism_world(kind: str, seed: int) -> tuple[Problem, Mission, Scene]:
    """Return a random scene of upright prisms of a kind in `PRISM_KINDS`: in the plane, and as a
    mission with the same clearance and tether. The tether is up to a third longer than the farthest
    goal needs."""
    import shapely

    rng = np.random.default_rng([PRISM_KINDS.index(kind), seed])
    clearance, base = 0.1, (-9.0, 0.0, -0.5 if kind == "near the surface" else -3.0)
    count = 14 if kind == "many" else 6
    apart = 0.9 if kind == "many" else 1.2
    shapes: list[tuple[dict, dict, shapely.Geometry]] = []
    around = shapely.Point(base[:2])

    def add(centre: np.ndarray) -> bool:
        of = kind if kind in ("circles", "boxes", "polygons") else str(
            rng.choice(["circles", "boxes", "polygons"])
        )  # fmt: skip
        size = float(rng.uniform(0.3, 0.9 if kind in ("many", "close pairs") else 1.6))
        obstacle, solid, shape = upright(of, centre, size, rng)
        if shape.distance(around) < 0.8 or any(shape.distance(s) < apart for *_, s in shapes):
            return False
        shapes.append((obstacle, solid, shape))
        return True

    while len(shapes) < count:
        if add(rng.uniform(-7.5, 7.5, 2)) and kind == "close pairs":
            near, spare = shapes[-1][2], float(rng.uniform(0.3, 0.6))
            angle = rng.uniform(-np.pi, np.pi)
            way = np.array([np.cos(angle), np.sin(angle)])
            radius = float(rng.uniform(0.3, 0.9))
            start = np.array(near.centroid.coords[0])
            for far in np.arange(0.5, 6.0, 0.02):
                obstacle, solid, shape = upright("circles", start + far * way, radius, rng)
                if shape.distance(near) >= spare:
                    if all(shape.distance(s) >= spare for *_, s in shapes):
                        shapes.append((obstacle, solid, shape))
                    break
    goals: list[tuple[float, float, float]] = []
    while len(goals) < 6 + seed % 3:
        p = rng.uniform(-9.0, 9.0, 2)
        if all(shapely.Point(p).distance(s) > 0.25 for *_, s in shapes):
            z = {"depths": rng.uniform(-5.6, -0.4), "near the surface": rng.uniform(-0.5, -0.15)}
            goals.append((float(p[0]), float(p[1]), float(z.get(kind, base[2]))))
    problem = Problem.model_validate({
        "base": base, "goals": goals, "clearance": clearance, "bounds": [-10, -10, 10, 10],
        "obstacles": [obstacle for obstacle, *_ in shapes], "tether_length": 80.0,
    })  # fmt: skip
    needed = float(shortest_tethers(problem).max())
    problem = problem.model_copy(update={"tether_length": needed * rng.uniform(1.02, 1.33)})
    scene = Scene(solids=[solid for _, solid, _ in shapes], bounds=[-10, -10, -6, 10, 10, 0])
    mission = Mission(
        scene="-", anchor=base, start=base, waypoints=goals, clearance=clearance,
        tether_length=problem.tether_length,
    )  # fmt: skip
    return problem, mission, scene


def upright(
    kind: str, centre: np.ndarray, size: float, rng: np.random.Generator
) -> tuple[dict, dict, Any]:
    """Return a random upright prism as an obstacle, a solid and a shape."""
    import shapely

    x, y = (float(v) for v in centre)
    if kind == "circles":
        return (
            {"center": [x, y], "radius": size}, {"post": {"center": [x, y], "radius": size}},
            shapely.Point(x, y).buffer(size, quad_segs=32),
        )  # fmt: skip
    turn = float(rng.uniform(0.0, 90.0))
    if kind == "boxes":
        a, b = size, float(size * rng.uniform(0.3, 1.0))
        c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        corners = [
            [x + c * u - s * v, y + s * u + c * v] for u, v in ((-a, -b), (a, -b), (a, b), (-a, b))
        ]
        solid = {"box": {
            "center": [x, y, -3.0], "size": [2 * a, 2 * b, 8.0], "rotation": [0, 0, turn]
        }}  # fmt: skip
        return {"polygon": corners}, solid, shapely.Polygon(corners)
    angles = np.radians(turn + np.linspace(0.0, 360.0, 7)[:-1])
    radii = size * rng.uniform(0.4, 1.0, 6)
    corners = (centre + np.c_[radii * np.cos(angles), radii * np.sin(angles)]).tolist()
    return {"polygon": corners}, {"prism": {"polygon": corners}}, shapely.Polygon(corners)


def prism_kinds(worlds: int, limits: list[float]) -> None:
    """Solve random scenes of upright prisms of each kind, within each limit."""
    head("kind", "world", "solids", "goals", "in the plane m", "status there",
         *(f"longer by %, {limit:g} s" for limit in limits),
         *(f"gap to all tours %, {limit:g} s" for limit in limits), "CPU s",
         name="space-prism-kinds")  # fmt: skip
    for seed, kind in itertools.product(range(worlds), PRISM_KINDS):
        problem, mission, scene = prism_world(kind, seed)
        begin, longer, gaps = time.process_time(), [], []
        for limit in limits:
            length, bound, best, status, _ = beside_plane(problem, mission, scene, limit)
            longer.append(f"{100 * (length / best - 1) + 0.0:.2f}")
            gaps.append(f"{100 * max(0.0, 1 - bound / length):.1f}")
        row(kind, seed, len(scene.solids), len(problem.goals), f"{best:.3f}", status, *longer,
            *gaps, f"{time.process_time() - begin:.0f}")  # fmt: skip
    print()


def prism_tours(worlds: int) -> None:
    """Drive the tour of the plane in random scenes of each kind, and bound all tours, without the
    rest of a run."""
    head("kind", "world", "solids", "goals", "in the plane m", "status there", "in space m",
         "longer by %", "bound of all tours m", "gap %", "CPU s",
         name="space-prism-tours")  # fmt: skip
    for seed, kind in itertools.product(range(worlds), PRISM_KINDS):
        problem, mission, scene = prism_world(kind, seed)
        best = solve(problem, time_limit=60.0)
        context = prepare_context(mission, Clock(), scene=scene)
        places = Places.for_mission(context.mission, context.field)
        begin = time.process_time()
        lengths = [
            tour.length for tour in drive_plane_tours(
                context, scene, places, Clock(60.0), whole_tether=True
            )
        ]  # fmt: skip
        every = list(range(len(places)))
        bound = bound_by_upright_solids(context.mission, context, every, places, Clock(60.0)) or 0.0
        took, length = time.process_time() - begin, min(lengths, default=np.inf)
        assert best.length is not None
        row(kind, seed, len(scene.solids), len(problem.goals), f"{best.length:.3f}",
            best.status.value, f"{length:.3f}", f"{100 * (length / best.length - 1) + 0.0:.2f}",
            f"{bound:.3f}", f"{100 * max(0.0, 1 - bound / length):.2f}", f"{took:.1f}")  # fmt: skip
    print()


def beside_plane(
    problem: Problem, mission: Mission | None = None, scene: Scene | None = None,
    limit: float = 60.0,
) -> tuple[float, float, float, str, float]:  # fmt: skip
    """Tour in space, its bound, tour in the plane, status of that, and seconds of the first."""
    with tempfile.TemporaryDirectory() as folder:
        mission = mission or in_space(problem, Path(folder))
        scene = scene or mission.load_scene()
        begin = time.perf_counter()
        found = solve_mission(mission, scene=scene, time_limit=limit)
        took = time.perf_counter() - begin
    if len(found.tour.stops) < len(mission.waypoints):
        return float("nan"), 0.0, 1.0, "left out", took
    best = solve(problem, time_limit=60.0)
    assert best.length is not None
    bound = found.tour.bound_of_all or 0.0
    return found.tour.length, bound, best.length, best.status.value, took


def prisms(worlds: int) -> None:
    head("problem", "goals", "in space m", "in the plane m", "status there", "longer by %",
         "bound of all tours m", "gap %", "s", name="space-prisms")  # fmt: skip
    posts = ((f"posts {seed}", *posts_world(seed)) for seed in range(worlds))
    others = ((name, problem, None, None) for name, problem in prism_worlds())
    for name, problem, mission, scene in itertools.chain(others, posts):
        length, bound, best, status, took = beside_plane(problem, mission, scene)
        row(name, len(problem.goals), f"{length:.3f}", f"{best:.3f}", status,
            f"{100 * (length / best - 1):.2f}", f"{bound:.3f}",
            f"{100 * max(0.0, 1 - bound / length):.1f}", f"{took:.0f}")  # fmt: skip
    print()


def beside_given(names: list[str], limits: list[float]) -> None:
    """Solve missions given in a good order within short limits, and print both tours."""
    head("mission", "waypoints", "limit s", "as given m", "as given, home after s", "solved m",
         "home after s", "found by", "verified", "CPU s", name="space-given")  # fmt: skip
    for name in names:
        mission, scene = mission_of(name) if name in SITES else shipped(name)
        ordered = solve_mission(mission, scene=scene).mission
        mission = ordered.model_copy(update={"tour": None})
        given = seconds_until_home(simulate(mission, scene=scene))
        for limit in limits:
            begin = time.process_time()
            found = solve_mission(mission, scene=scene, time_limit=limit)
            took = time.process_time() - begin
            run = simulate(found.mission, scene=scene)
            verdict = verify_mission(found.mission, scene=scene)
            row(name, len(mission.waypoints), f"{limit:g}", f"{ordered.tour.length:.1f}",
                f"{given:.1f}", f"{found.tour.length:.1f}", f"{seconds_until_home(run):.1f}",
                WAYS.get(found.tour.solver, "states and legs"), "yes" if verdict else "no",
                f"{took:.0f}")  # fmt: skip
    print()


def random_frame(seed: int) -> tuple[Mission, Scene]:
    """4 to 12 members between random joints, each new one from a joint that is there, and twelve
    waypoints beside them."""
    rng = np.random.default_rng(seed)
    joints = [rng.uniform(-3.0, 3.0, 3)]
    members = []
    for k in range(int(rng.integers(4, 13))):
        a = joints[int(rng.integers(len(joints)))]
        far = [j for j in joints if np.linalg.norm(j - a) > 1.0]
        # every third member closes a loop, where it can
        closes = k % 3 == 2 and far
        b = far[int(rng.integers(len(far)))] if closes else rng.uniform(-3.0, 3.0, 3)
        members.append(bar(a.tolist(), b.tolist(), 0.15))
        joints.append(b)
    scene = Scene(name=f"frame {seed}", solids=members)
    field, waypoints = scene.field(), []
    while len(waypoints) < 12:
        p = rng.uniform(-3.5, 3.5, 3)
        if 0.4 <= float(field.distance(p)) <= 1.0:
            waypoints.append(p.round(2).tolist())
    mission = Mission(
        scene="-", name=scene.name, anchor=(5, 5, 5), start=(4.8, 4.8, 4.8), waypoints=waypoints,
        tether_length=20.0, clearance=0.2,
    )  # fmt: skip
    return mission, scene


def shortest_way(context: PlanningContext, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Straight, or the shortest that a search finds."""
    if is_straight_clear(context.field, a, b, context.mission.clearance):
        return np.array([a, b])
    begin, end = context.words.visible_cell(a), context.words.visible_cell(b)
    assert begin is not None
    assert end is not None
    found = context.search_words(True, begin, 4, {end: 2.0 * float(np.linalg.norm(a - b))})
    lines = [context.pull_taut(np.vstack([a, way, b])) for _, way in context.paths_to(found, end)]
    return min(lines, key=polylines.length)


def without_tether(found: SolvedMission) -> tuple[float, str]:
    """Metres of the shortest tour along the shortest paths that are known, tether or not, and what
    becomes of the tether on it."""
    assert found.plan is not None
    ways, context = found.plan.paths, found.plan.context
    points, start = ways.points, context.start_tether.robot
    ends = [start, *points]
    paths: dict[tuple[int, int], np.ndarray] = {}
    costs = np.zeros((len(ends), len(ends)))
    for a, b in itertools.permutations(range(len(ends)), 2):
        known = [way for _, way in ways.between(a - 1, b - 1)] if a and b else []
        paths[a, b] = known[0] if known else shortest_way(context, ends[a], ends[b])
        costs[a, b] = polylines.length(paths[a, b])
    costs = np.minimum(costs, costs.T)  # the one way is the other, but for how it was found
    graph = TravelGraph.from_costs(costs, list(range(len(ends))))
    result = solve_graph(graph, "auto", time_limit=20.0)
    assert result.tour is not None
    tether, longest = context.present_tether, 0.0
    for a, b in itertools.pairwise((*result.tour, 0)):
        tether, most = context.drive(tether, paths[a, b])
        longest = max(longest, most)
    path = np.vstack([paths[a, b] for a, b in itertools.pairwise((*result.tour, 0))])
    word, broken = context.words.try_word(path, closed=True)
    hangs = "wound up, by its word" if word or broken is not None else "hangs on a bar"
    free = abs(tether.length - context.start_tether.length) < context.mission.delta
    told = "free" if free else f"{hangs}, {tether.length:.1f} m"
    if longest > context.mission.tether_length:
        told += f"; too long ({longest:.1f} m)"
    return float(result.length or 0.0), told


def frames(count: int) -> None:
    head("frame", "members", "group", "tour m", "status", "bound of all tours m", "gap %",
         "without a tether m", "tether left at the end of that", "solved in s", "home after s",
         "as given s", "over s", "visited",
         name="space-frames")  # fmt: skip
    for seed in range(count):
        mission, scene = random_frame(seed)
        begin = time.perf_counter()
        found = solve_mission(mission, scene=scene)
        took = time.perf_counter() - begin
        run = found.run or simulate(found.mission, scene=scene)
        given = found.given or simulate(mission, scene=scene)
        words = found.plan.context.words.group if found.plan is not None else None
        tour, flown = found.tour, run.summary
        row(seed, len(scene.solids), "–" if words is None else shown(words.rank, words.relators),
            f"{tour.length:.1f}", tour.status.value, f"{tour.bound_of_all or 0.0:.1f}",
            f"{100 * (tour.gap_to_all or 0.0):.1f}",
            *(lambda far, told: (f"{far:.1f}", told))(*without_tether(found)), f"{took:.0f}",
            f"{seconds_until_home(run):.1f}", f"{seconds_until_home(given):.1f}",
            f"{flown['exceedance_s']:.1f}", f"{flown['visited']} of {len(mission.waypoints)}",
            )  # fmt: skip
    print()


def flown_metres(run: Run) -> float:
    return polylines.length(np.array([[r.x, r.y, r.z] for r in run.log]))


def by_going_on(mission: Mission, scene: Scene) -> str:
    """Metres flown in the order by going straight on, in the better direction of those that come
    home free and never exceed the tether."""
    field = scene.field()
    mission = mission.checked_waypoints(field)
    order = order_by_going_on(
        mission, field, mission_grid(mission, scene, field), clock=Clock(60.0), seed=0
    )
    lengths = []
    for there in (order, order[::-1]):
        run = simulate(
            mission.model_copy(update={"waypoints": tuple(mission.waypoints[n] for n in there)}),
            scene=scene,
        )
        if run.summary["home"]["tether_free"] and run.summary["exceedance_s"] == 0.0:
            lengths.append(flown_metres(run))
    return f"{min(lengths):.1f}" if lengths else "–"


def missions(names: list[str]) -> None:
    head("mission", "waypoints", "found by", "tour m", "flown m", "by going straight on, flown m",
         "status", "bound of all tours m", "gap %",
         "longest tether m", "solved in s", "home after s", "as given s", "over s", "visited",
         name="space-missions")  # fmt: skip
    for name in names:
        site = "net pen" if name == LONGER_PEN else name
        mission, scene = mission_of(site) if site in SITES else shipped(site)
        if name == LONGER_PEN:
            mission = mission.model_copy(update={"tether_length": 24.0})
        begin = time.perf_counter()
        found = solve_mission(mission, scene=scene)
        took = time.perf_counter() - begin
        run = found.run or simulate(found.mission, scene=scene)
        given = found.given or simulate(mission, scene=scene)
        older = by_going_on(mission, scene)
        tour, flown = found.tour, run.summary
        row(name, len(mission.waypoints), WAYS.get(tour.solver, "states and legs"),
            f"{tour.length:.1f}", f"{flown_metres(run):.1f}", older, tour.status.value,
            f"{tour.bound_of_all or 0.0:.1f}",
            f"{100 * (1.0 if tour.gap_to_all is None else tour.gap_to_all):.1f}",
            f"{tour.longest_tether:.2f} of {mission.tether_length:g}", f"{took:.0f}",
            f"{seconds_until_home(run):.1f}", f"{seconds_until_home(given):.1f}",
            f"{flown['exceedance_s']:.1f}", f"{flown['visited']} of {len(mission.waypoints)}",
            )  # fmt: skip
    print()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument(
        "--only",
        choices=(
            "words",
            "loops",
            "prisms",
            "prism-tours",
            "prism-kinds",
            "frames",
            "missions",
            "given",
        ),
    )
    parser.add_argument(
        "--missions",
        nargs="*",
        default=[*MISSIONS, *SITES, LONGER_PEN],
        help="names of missions and sites",
    )
    parser.add_argument("--worlds", type=int, default=10, help="random worlds of posts")
    parser.add_argument("--kinds-worlds", type=int, default=3, help="random worlds of each kind")
    parser.add_argument("--limits", type=float, nargs="*", default=[20.0, 60.0], help="seconds")
    parser.add_argument("--given", nargs="*", default=["basin", "ring", "jacket"])
    parser.add_argument("--frames", type=int, default=10, help="random frames")
    parser.add_argument("--loops", type=int, default=10_000)
    parser.add_argument("--group", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.group:
        print(json.dumps(group(args.group)))
        return
    heading("In space")
    for name, measure in (
        ("words", words), ("loops", lambda: loops(args.loops)),
        ("prisms", lambda: prisms(args.worlds)),
        ("prism-tours", lambda: prism_tours(args.kinds_worlds)),
        ("prism-kinds", lambda: prism_kinds(args.kinds_worlds, args.limits)),
        ("given", lambda: beside_given(args.given, [2.0, 30.0])),
        ("frames", lambda: frames(args.frames)), ("missions", lambda: missions(args.missions)),
    ):  # fmt: skip
        if args.only in (None, name):
            measure()


if __name__ == "__main__":
    main()
