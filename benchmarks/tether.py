"""Taut tethers against closed forms, the offline geometry and finer references; both models.

    python benchmarks/tether.py                     everything but the many drives: minutes
    python benchmarks/tether.py --drives 10000      thin poles: how many drives tunnel
    python benchmarks/tether.py --cloud cloud.npz   a cloud of points, too (unit: --scale metres)

`error` is (length - truth) / truth at its worst, `back` the length that is left after the robot has
gone the same way back to the anchor.
"""

from __future__ import annotations

import argparse
import itertools
import math
import time
from collections.abc import Callable, Sequence

import numpy as np
from table import ROOT, head, heading, row

from netsp import Problem
from netsp.hsignature import signature
from netsp.plan.random_worlds import random_world
from netsp.roadmap.paths import TautPaths
from netsp.world import GeodesicTether, ReactTether, Scene
from netsp.world.scene.field import DistanceField
from netsp.world.scene.readers import Placement, read_cloud_file
from netsp.world.scene.voxels import grid_of_cloud
from netsp.world.tether import TetherModel

SCENES = ROOT / "scenes"


def wander(rng, field, start, steps, step, low, high, flat=0.1):
    """A free path of straight steps."""
    here, path = np.array(start, dtype=float), []
    squash = np.array([1.0, 1.0, flat])
    heading_ = rng.normal(size=3) * squash
    while len(path) < steps:
        heading_ = heading_ / np.linalg.norm(heading_) + 0.5 * rng.normal(size=3) * squash
        there = here + step * rng.uniform(0.2, 1.0) * heading_ / np.linalg.norm(heading_)
        inside = (there >= low).all() and (there <= high).all()
        if inside and field.line_of_sight(here, there) and field.distance(there) > 1e-3:
            here = there
            path.append(here)
        else:
            heading_ = rng.normal(size=3) * squash
    return np.array(path)


def driven(model, path):
    """(final tether, lengths, microseconds of each update, length after the way back)."""
    tether, lengths, times = model.start(path[0], path[0]), [], []
    for point in path[1:]:
        begin = time.perf_counter()
        tether = model.update(tether, point)
        times.append(1e6 * (time.perf_counter() - begin))
        lengths.append(tether.length)
    back = tether
    for point in path[::-1][1:]:
        back = model.update(back, point)
    return tether, np.array(lengths), np.array(times[1:]), back.length


def models(field: DistanceField, delta: float) -> list[tuple[str, object]]:
    """Both models, the paper's in both readings."""
    return [
        ("geodesic", GeodesicTether(field, delta)),
        ("react, listing", ReactTether(field, delta)),
        ("react, text", ReactTether(field, delta, reading="text")),
    ]


BALL = {"sphere": {"center": [0, 0, 0], "radius": 1}}


def helix(radius: float, turns: float, rise: float, steps: int) -> np.ndarray:
    angle = np.linspace(0.0, 2 * np.pi * turns, steps)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), rise * angle])


def around(a, b, centre, radius, long_way=False):
    """Length of the taut path about a circle from a to b, both outside."""
    u, v = np.subtract(a, centre), np.subtract(b, centre)
    turn = abs(math.remainder(math.atan2(v[1], v[0]) - math.atan2(u[1], u[0]), 2 * math.pi))
    turn = 2 * math.pi - turn if long_way else turn
    p, q = np.hypot(*u), np.hypot(*v)
    arc = turn - math.acos(radius / p) - math.acos(radius / q)
    return math.sqrt(p * p - radius**2) + math.sqrt(q * q - radius**2) + radius * arc


def dense(points: Sequence[Sequence[float]], step: float = 0.03) -> np.ndarray:
    """A polyline with points every `step`."""
    p = np.array(points, dtype=float)
    out = [p[:1]]
    for a, b in itertools.pairwise(p):
        k = max(1, math.ceil(np.linalg.norm(b - a) / step))
        out.append(a + (b - a) * np.linspace(0, 1, k + 1)[1:, None])
    return np.vstack(out)


def closed_cases() -> list[tuple[str, dict, np.ndarray, float]]:
    """(name, solid, path, length) of truths that can be written down."""
    long = {"capsule": {"a": [0, 0, -30], "b": [0, 0, 30], "radius": 0.5}}
    cases: list[tuple[str, dict, np.ndarray, float]] = []
    for turns in (1, 3, 6):
        angle = 2 * math.pi * turns
        planar = 2 * math.sqrt(3.75) + 0.5 * (angle - 2 * math.acos(0.25))
        path = dense(helix(2.0, turns, 0.1, 200 * turns))
        cases.append((f"helix, {turns} turns", long, path, math.hypot(planar, 0.1 * angle)))
    ball = BALL
    over = dense([(-2, 0, 0.5), (-2, 0, 3), (2, 0.3, 3), (2, 0, 0.5)])
    cases.append(("sphere", ball, over, around((-2, 0.5), (2, 0.5), (0, 0), 1)))
    ring = {"torus": {"center": [0, 0, 0], "major_radius": 1, "minor_radius": 0.3}}
    through = dense([(2, 0, 0.1), (0, 0, 1), (0, 0, -1), (1.8, 0, -1)])
    exact = around((2, 0.1), (1.8, -1), (1, 0), 0.3, long_way=True)
    cases.append(("torus, through its hole", ring, through, exact))
    box = {"box": {"center": [0, 0, 0], "size": [2, 40, 2]}}
    edges = dense([(-2, 0, 0), (-2, 0, 3), (2, 5, 3), (2, 5, 0)])
    cases.append(("two edges of a box", box, edges, math.hypot(2 + 2 * math.sqrt(2), 5)))
    return cases


def closed_forms() -> None:
    """Both models against them."""
    print("### Closed forms (delta 0.1; steps of 3 cm)\n")
    head("what", "model", "nodes", "error %", "back m", "median us", "worst us",
         name="tether-closed")  # fmt: skip
    for name, solid, path, truth in closed_cases():
        for label, model in models(Scene(solids=[solid]).field(), 0.1):
            tether, _, times, back = driven(model, path)
            row(name, label, len(tether.nodes), f"{100 * (tether.length / truth - 1):.4f}",
                f"{back:.4f}", f"{np.median(times):.0f}", f"{times.max():.0f}")  # fmt: skip
    print()


def prism_world(
    family: str, seed: int, make: Callable[[DistanceField], TetherModel] | None = None
) -> tuple[list[float], int, float, list[float]]:
    """Errors in per cent at every 20th of 400 updates, wrong classes, what is left on the way back,
    and microseconds of each update, in a world whose truth the offline geometry knows."""
    problem = random_world(seed, family=family, goals=3, tether_length=300.0)
    field = Scene.from_problem(problem).field()
    model = make(field) if make else GeodesicTether(field, 2.0)
    rng, base = np.random.default_rng(seed), np.array(problem.base)
    path = wander(rng, field, base, 400, 9.0, [0, 0, -40], [500, 500, 40])
    stops = list(range(19, 400, 20))
    there = Problem(
        base=problem.base, goals=[tuple(path[k]) for k in stops], tether_length=10_000,
        obstacles=problem.obstacles, clearance=problem.clearance,
    )  # fmt: skip
    exact, reps = TautPaths(there, 20_000.0), problem.representative_points
    words = [signature(np.vstack([base, path[: k + 1]])[:, :2], reps) for k in stops]
    truth = [exact.length(0, g + 1, w) for g, w in enumerate(words)]
    times, errors, wrong = [], [], 0
    tether = model.start(base, base)
    for k, point in enumerate(path):
        begin = time.perf_counter()
        tether = model.update(tether, point)
        times.append(1e6 * (time.perf_counter() - begin))
        if k in stops:
            g = stops.index(k)
            errors.append(100 * (tether.length / truth[g] - 1))
            wrong += signature(tether.nodes[:, :2], reps) != words[g]
    for point in [*path[::-1][1:], base]:
        tether = model.update(tether, point)
    return errors, wrong, tether.length, times[2:]


def prisms(worlds: int, *, paper: bool) -> None:
    """The offline geometry as truth: length and word at every 20th of 400 updates."""
    print(f"### Vertical prisms, {worlds} worlds a family, 400 updates of up to 9 (delta 2)\n")
    head("worlds", "model", "worst error %", "mean absolute error %", "wrong classes", "worst back",
         "median us", "worst us", name="tether-prisms")  # fmt: skip
    for family in ("icra2017", "harbour"):
        found: dict[str, list[list[float]]] = {}
        for seed in range(worlds):
            for k in range(3 if seed == 0 and paper else 1):
                label = models(Scene(solids=[BALL]).field(), 2.0)[k][0]
                row_ = prism_world(family, seed, lambda f, k=k: models(f, 2.0)[k][1])
                found.setdefault(label, []).append(list(row_))
        for label, rows in found.items():
            errors = np.concatenate([r[0] for r in rows])
            times = np.concatenate([r[3] for r in rows])
            row(family, label, f"{errors[np.abs(errors).argmax()]:.4f}",
                f"{np.abs(errors).mean():.4f}", f"{sum(r[1] for r in rows)} of {len(errors)}",
                f"{max(r[2] for r in rows):.4f}", f"{np.median(times):.0f}",
                f"{times.max():.0f}")  # fmt: skip
    print()


def round_the_pipes() -> np.ndarray:
    """A helix of six turns about a run, the elbow and the other run of scenes/pipes.json."""
    bend = np.linspace(0, np.pi / 2, 10)[1:]
    line = [(-0.3, 0, 0), (1, 0, 0)]
    line += [(1 + 0.6 * math.sin(a), 0.6 - 0.6 * math.cos(a), 0) for a in bend]
    line = np.array([*line, (1.6, 3.6, 0)])
    way = np.r_[0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
    u = np.linspace(0, way[-1], 1500)
    centre = np.column_stack([np.interp(u, way, line[:, k]) for k in range(3)])
    ahead = np.gradient(centre, axis=0)
    side = np.cross([0, 0, 1], ahead)
    side /= np.linalg.norm(side, axis=1)[:, None]
    turn = 12 * np.pi * u / way[-1]
    out = centre + 0.62 * (np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * [0, 0, 1])
    return dense([(-0.5, 4, 1), *out])


def lattice() -> np.ndarray:
    """Two turns about the OC4 jacket, rising, and once between its legs."""
    angle = np.linspace(0, 4 * np.pi, 400)
    out = np.column_stack([14 * np.cos(angle), 14 * np.sin(angle), -40 + 1.8 * angle])
    return dense([*out, (14, 0.5, -14), (0, 0.7, -14), (-14, 0.9, -14)], 0.1)


def finer(
    name: str, scene: Scene, path: Callable[[], np.ndarray], deltas: list[float], *, paper: bool
) -> None:
    """A scene at several resolutions; the last is the reference."""
    field, way = scene.field(), path()
    lengths = {}
    for delta in deltas:
        tether, lengths[delta], times, back = driven(GeodesicTether(field, delta), way)
        row(name, "geodesic", delta, len(tether.nodes), f"{tether.length:.4f}", f"{back:.4f}",
            f"{np.median(times):.0f}", f"{np.quantile(times, 0.99):.0f}",
            f"{times.max():.0f}")  # fmt: skip
    for label, model in models(field, deltas[0])[1:] if paper else []:
        tether, _, times, back = driven(model, way[::4])
        row(name, label, deltas[0], len(tether.nodes), f"{tether.length:.4f}", f"{back:.4f}",
            f"{np.median(times):.0f}", f"{np.quantile(times, 0.99):.0f}",
            f"{times.max():.0f}")  # fmt: skip


def tour(field: DistanceField, file: str, scale: float) -> None:
    """A tether dragged along the waypoints of a file (CSV, x,y,z first), at two resolutions."""
    points = np.loadtxt(file, delimiter=",", skiprows=1)[:, :3] * scale
    way = dense(points)
    head("delta", "final m", "longest m", "back m", "median us", "99 % us", "differs by > 1 %",
         name="tether-tour")  # fmt: skip
    before = None
    for delta in (0.1, 0.05, 0.025):
        tether, lengths, times, back = driven(GeodesicTether(field, delta), way)
        differs = (
            ""
            if before is None
            else f"{100 * (np.abs(lengths / before - 1) > 0.01).mean():.0f} % of the path"
        )
        before = np.maximum(lengths, 1e-9)
        row(delta, f"{tether.length:.3f}", f"{lengths.max():.3f}", f"{back:.3f}",
            f"{np.median(times):.0f}", f"{np.quantile(times, 0.99):.0f}", differs)  # fmt: skip
    print()


def driven_past_poles(count: int) -> tuple[int, float, float]:
    """Poles of radius delta, steps of up to 10 delta, 20 steps out and back: how many drives went
    through a pole, the worst difference on the way back (of the length, or of 10 m), seconds."""
    tunnelled, worst, spent = 0, 0.0, 0.0
    field, model = None, None
    for seed in range(count):
        rng = np.random.default_rng(seed)
        if seed % 20 == 0 or field is None:
            poles = np.random.default_rng(seed).uniform(0, 8, (25, 2))
            solids = [{"post": {"center": list(c), "radius": 0.1}} for c in poles]
            field = Scene(solids=solids).field()
            model = GeodesicTether(field, 0.1)
        start = np.array([-0.5, -0.5, 0.0])
        path = wander(rng, field, start, 20, 1.0, [-1, -1, -3], [9, 9, 3])
        begin = time.perf_counter()
        tether, out = model.drive(model.start(start, start), path)
        _, back = model.drive(tether, path[::-1])
        spent += time.perf_counter() - begin
        walked = np.vstack([start, path])[:, :2]
        tunnelled += signature(tether.nodes[:, :2], poles) != signature(walked, poles)
        worst = max(worst, float((np.abs(back[::-1] - out) / np.maximum(out, 10.0)).max()))
    return tunnelled, worst, spent


def drives(count: int) -> None:
    """As a table."""
    print("### Thin poles: radius 0.1, delta 0.1, steps of 0.2 to 1 m\n")
    head("drives", "updates", "tunnelled", "worst difference on the way back", "us per update",
         name="tether-drives")  # fmt: skip
    tunnelled, worst, spent = driven_past_poles(count)
    row(count, 40 * count, tunnelled, f"{100 * worst:.3f} % (or of 10 m)",
        f"{1e6 * spent / (40 * count):.0f}")  # fmt: skip
    print()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=10)
    parser.add_argument("--drives", type=int, default=0)
    parser.add_argument(
        "--no-paper", dest="paper", action="store_false",
        help="neither the paper's model, which is slow, nor the closed forms",
    )  # fmt: skip
    parser.add_argument("--cloud")
    parser.add_argument("--tour", help="with --cloud: waypoints (CSV) to drag a tether along")
    parser.add_argument("--scale", type=float, default=0.1)
    args = parser.parse_args()
    heading("Taut tethers")
    if args.drives:
        drives(args.drives)
        return
    if args.paper:
        closed_forms()
    prisms(args.worlds, paper=args.paper)
    print("### Finer and finer (steps of 3 cm; the jacket 10 cm)\n")
    head("scene", "model", "delta", "nodes", "length m", "back m", "median us", "99 % us",
         "worst us", name="tether-finer")  # fmt: skip
    finer("pipes", Scene.load(SCENES / "pipes.json"), round_the_pipes, [0.1, 0.05, 0.025],
          paper=args.paper)  # fmt: skip
    finer(
        "jacket",
        Scene.load(SCENES / "oc4-jacket.json"),
        lattice,
        [0.4, 0.2, 0.05],
        paper=args.paper,
    )
    print()
    if args.cloud:
        print("### A cloud of points\n")
        head("voxel", "grid", "build s", "notes", name="tether-cloud")
        for voxel in (0.1, 0.05):
            begin = time.perf_counter()
            cloud = read_cloud_file(args.cloud, Placement(args.scale))
            points, notes = cloud.points, cloud.notes
            grid = grid_of_cloud(points, voxel=voxel, source=args.cloud)
            row(voxel, "x".join(map(str, grid.counts)), f"{time.perf_counter() - begin:.2f}",
                "; ".join((*notes, *grid.notes)))  # fmt: skip
        print()
        if args.tour:
            tour(DistanceField.build([], [], [], [], grid, 0.0), args.tour, args.scale)


if __name__ == "__main__":
    main()
