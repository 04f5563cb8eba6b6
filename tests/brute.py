"""Independent brute force: a fine polygonal visibility graph, searched with words.

Circles become inscribed polygons, visibility is Shapely's, words come from the rays. Shares no code
with the roadmap. Slow and simple on purpose.
"""

from __future__ import annotations

import heapq
import itertools
import math

import numpy as np
import shapely

from netsp import Circle, Problem
from netsp.hsignature import Word, concatenate, crossings, invert


class BruteForce:
    """Shortest lengths by class, from any point to any point (0 is the base)."""

    def __init__(self, problem: Problem, sides: int = 32) -> None:
        self.problem = problem
        shapes, corners = [], []
        for o in problem.obstacles:
            if isinstance(o, Circle):
                angle = 2 * np.pi * (np.arange(sides) + 0.123) / sides
                ring = np.column_stack([np.cos(angle), np.sin(angle)])
                ring = ring * (o.radius + problem.clearance) + o.center
            else:
                grown = shapely.Polygon(o.polygon)
                if problem.clearance:
                    grown = grown.buffer(problem.clearance, quad_segs=sides // 4)
                ring = np.array(grown.exterior.coords)[:-1]
            shapes.append(shapely.Polygon(ring))
            corners.append(ring)
        # what touches is closed (the rule of the roadmap), what is merely hugged is free
        joined = shapely.union_all([s.buffer(1e-5, join_style="mitre") for s in shapes])
        solid = joined.buffer(-1.02e-5, join_style="mitre")
        union = shapely.union_all(shapes)
        box = shapely.box(*problem.bounds).buffer(1e-7) if problem.bounds else None
        goals = problem.points[:, :2]
        verts = np.vstack([goals, *corners])
        inside = shapely.contains_xy(union.buffer(-1e-6, join_style="mitre"), verts)
        if box is not None:
            inside |= ~shapely.contains_xy(box, verts)
        self.points = verts[~inside | (np.arange(len(verts)) < len(goals))]
        n = len(self.points)
        pairs = np.array(list(itertools.combinations(range(n), 2)))
        lines = shapely.linestrings(self.points[pairs])
        shapely.prepare(solid)
        free = ~shapely.intersects(solid, lines)
        if box is not None:
            free &= shapely.covers(box, lines)
        rays = problem.representative_points
        self.near: list[list[tuple[int, float, Word]]] = [[] for _ in range(n)]
        for a, b in pairs[free]:
            word = crossings(self.points[[a, b]], rays)
            d = float(np.hypot(*(self.points[a] - self.points[b])))
            self.near[a].append((int(b), d, word))
            self.near[b].append((int(a), d, invert(word)))

    def lengths(self, source: int, limit: float, repeats: int = 8) -> dict[tuple[int, Word], float]:
        """Shortest planar length of every class from a point to every point, up to the limit; words
        that repeat a signed letter more than `repeats` times are not followed."""
        goals = len(self.problem.points)
        best: dict[tuple[int, Word], float] = {(source, ()): 0.0}
        queue = [(0.0, source, ())]
        while queue:
            d, v, word = heapq.heappop(queue)
            if d > best[v, word]:
                continue
            for w, step, letters in self.near[v]:
                if d + step > limit:
                    continue
                onward = concatenate(word, letters) if letters else word
                if d + step >= best.get((w, onward), math.inf) - 1e-12:
                    continue
                if any(onward.count(a) > repeats for a in set(letters)):
                    continue
                best[w, onward] = d + step
                heapq.heappush(queue, (d + step, w, onward))
        return {k: d for k, d in best.items() if k[0] < goals}

    def optimum(self) -> float:
        """Length of the shortest non-entangling tour, by trying every order and every class whose
        tether fits."""
        p = self.problem
        z = p.points[:, 2]
        limit = p.tether_length
        tethers = {
            k: d
            for k, d in self.lengths(0, limit).items()
            if k[0] > 0 and math.hypot(d, z[k[0]] - z[0]) <= limit
        }
        goals = len(p.goals)
        classes = [[w for g, w in tethers if g == k + 1] for k in range(goals)]
        legs = [self.lengths(k + 1, 2 * limit) for k in range(goals)]
        best = math.inf
        for order in itertools.permutations(range(goals)):
            g = order[0] + 1
            reach = {w: math.hypot(tethers[g, w], z[g] - z[0]) for w in classes[order[0]]}
            for a, b in itertools.pairwise(order):
                onward: dict[Word, float] = {}
                for w, d in reach.items():
                    for v in classes[b]:
                        planar = legs[a].get((b + 1, concatenate(invert(w), v)), math.inf)
                        leg = math.hypot(planar, z[b + 1] - z[a + 1])
                        onward[v] = min(onward.get(v, math.inf), d + leg)
                reach = onward
            g = order[-1] + 1
            for w, d in reach.items():
                best = min(best, d + math.hypot(tethers[g, w], z[g] - z[0]))
        return best


def brute_tour(graph) -> float:
    """Optimum of a travel graph over every order, classes by dynamic programming."""
    best = math.inf
    members = [graph.members(c) for c in range(graph.goal_count + 1)]
    for order in itertools.permutations(range(1, graph.goal_count + 1)):
        if order[0] > order[-1]:
            continue
        reach = graph.costs[0, members[order[0]]]
        for a, b in itertools.pairwise(order):
            reach = (reach[:, None] + graph.costs[np.ix_(members[a], members[b])]).min(axis=0)
        best = min(best, float((reach + graph.costs[members[order[-1]], 0]).min()))
    return best
