"""Worlds whose obstacles are off, and a tour's tethers pulled taut in them by another method."""

from __future__ import annotations

import numpy as np
import shapely

from netsp import Circle, Problem, Solution
from netsp.judge.stringpull import StringPuller, reduce_sleeve
from netsp.model.problem import Polygon
from netsp.roadmap.paths import TautPaths


def perturbed(problem: Problem, by: float, rng: np.random.Generator) -> Problem:
    """Every obstacle moved by up to a distance, and circles grown by what of it is left."""
    obstacles: list[Circle | Polygon] = []
    for o in problem.obstacles:
        far, angle = by * rng.choice([rng.random(), 1.0]), rng.uniform(0.0, 2.0 * np.pi)
        dx, dy = far * np.cos(angle), far * np.sin(angle)
        if isinstance(o, Circle):
            more = (by - far) * rng.random()
            centre = (o.center[0] + dx, o.center[1] + dy)
            obstacles.append(Circle(center=centre, radius=o.radius + more, name=o.name))
        else:
            corners = tuple((x + dx, y + dy) for x, y in o.polygon)
            obstacles.append(Polygon(polygon=corners, name=o.name))
    return problem.model_copy(update={"obstacles": tuple(obstacles)})


def violations(problem: Problem, solution: Solution, margin: float, worlds: int, seed: int) -> int:
    """Of worlds that are off by a margin at most, those in which a tether of the tour does not fit,
    or is not free where the grown world has it."""
    rng = np.random.default_rng(seed)
    grown = TautPaths(problem.grown(margin))
    tethers = [grown.tether(v.goal, v.signature) for v in solution.tour]
    bad = 0
    for _ in range(worlds):
        world = perturbed(problem, margin, rng)
        shapes = [o.shape(problem.clearance * (1.0 - 1e-6)) for o in world.obstacles]
        solids = shapely.union_all(shapes)
        puller = StringPuller(world, problem.tether_length)
        wrong = False
        for tether in tethers:
            line = shapely.LineString(tether[:, :2])
            wrong |= line.intersection(solids).length > 1e-6 * problem.scale
            sleeve = reduce_sleeve([c for part in puller.crossings(tether) for c in part])
            planar = puller.pull(tether[0], tether[-1], sleeve).low
            length = float(np.hypot(planar, tether[-1, 2] - tether[0, 2]))
            wrong |= length > problem.tether_length * (1.0 + 1e-6)
        bad += wrong
    return bad
