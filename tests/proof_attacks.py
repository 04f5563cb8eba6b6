"""Attacks on proofs: mutations that stay well-formed, and forgeries made by hand.

A false proof is one that is accepted although its bound is above the length of a tour. Mutations
compute the number and hash of the classes again, because these guard against accidents only: a
wrong hash would refuse the proof before the rest of the checker sees it.
"""

from __future__ import annotations

import contextlib
import copy
import functools
import itertools
import json
import math
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from netsp import Problem, Solution, solve
from netsp.base.errors import InfeasibleError, NetspError
from netsp.model.solution import Status
from netsp.plan.proof.certify import certify
from netsp_check import Refused, check
from netsp_check.covering_tree import CoveringTree
from netsp_check.dual_bound import Bound
from netsp_check.leg_bounds import LegBounds
from netsp_check.problem_file import read_problem
from netsp_check.proof_check import cover, read_proof

Json = dict[str, Any]
Mutation = Callable[[random.Random, Json, Json], None]

ROUNDING = 1e-9
"""Tolerance, as a share of the length, for the rounding of netsp's tours."""


@dataclass(frozen=True)
class Proven:
    """Problem with a proof of its optimum."""

    problem: Problem
    solution: Solution
    proof: Json


def honest(problem: Problem) -> Proven:
    """Return a problem with its proof; raise ValueError if it is not certified."""
    solution = solve(problem)
    certificate = certify(problem, solution)
    if certificate.level != "optimal" or certificate.proof is None:
        raise ValueError(f"not certified: {certificate.reason}")
    return Proven(problem, solution, read_proof(certificate.proof))


def rehash(text: str, proof: Json) -> CoveringTree:
    """Write number and hash of the classes of a changed proof, and return its cover."""
    tree = cover(text, proof)
    proof["classes"] = [len(tree.vertices), tree.digest()]
    return tree


def to_bytes(proof: Json) -> bytes:
    """Return the content of a proof file."""
    return json.dumps(proof).encode()


def relaxed_optimum(text: str, proof: Json, limit: float) -> float:
    """Return the length of the shortest tour over a proof's cover and the checker's legs, but at
    most a limit, by brute force: no duals over this cover can prove more."""
    grid = read_problem(text).grid
    target = int(limit * 2.0**grid)
    tree = cover(text, {**proof, "target": target})
    legs = LegBounds(tree)
    bound = Bound(tree, legs, target)
    members: list[list[int]] = [[] for _ in range(bound.clusters)]
    for v in sorted(bound.reachable()):
        members[bound.cluster[v]].append(v)
    best = math.inf
    for order in itertools.permutations(range(1, bound.clusters)):
        if order[0] > order[-1]:
            continue
        lengths = {0: 0}
        for c in (*order, 0):
            lengths = {
                v: min(d + legs.bound(u, v, 2) for u, d in lengths.items()) for v in members[c]
            }
            if not lengths:
                break
        best = min([best, *lengths.values()])
    return min(best * 2.0**-grid, limit)


# mutations: each changes a problem or a proof in place


def _stages(node: Json) -> Iterator[Json]:
    yield from node.get("stages", ())
    for name in ("apart", "next", "without", "at"):
        if name in node:
            yield from _stages(node[name])


def _nodes(node: Json) -> Iterator[Json]:
    yield node
    for name in ("apart", "next", "without", "at"):
        if name in node:
            yield from _nodes(node[name])


def _stage(rng: random.Random, proof: Json) -> Json:
    stages = list(_stages(proof["tree"]))
    return rng.choice(stages) if stages else {"a": [0], "cuts": []}


def _unit(proof: Json) -> int:
    return abs(proof["target"] or 1 << 36)


def _amount(rng: random.Random, proof: Json) -> int:
    """Return a number of grid units of any size and sign."""
    sizes = [1, 16, 1000, 1e-6 * _unit(proof), 1e-3 * _unit(proof), 0.3 * _unit(proof), 2.0**60]
    return rng.choice([-1, 1]) * int(rng.choice(sizes) * (1.0 + rng.random()))


def change_price(rng: random.Random, problem: Json, proof: Json) -> None:
    prices = _stage(rng, proof)["a"]
    prices[rng.randrange(len(prices))] += _amount(rng, proof)


def change_all_prices(rng: random.Random, problem: Json, proof: Json) -> None:
    """Add a number to all prices, and twice as much to the reach: the bound stays as it is."""
    stage, more = _stage(rng, proof), rng.choice([1, -1]) << rng.choice([40, 52, 60, 90, 120])
    stage["a"] = [a + more for a in stage["a"]]
    if "reach" in stage:
        stage["reach"] -= 2 * more
    if rng.random() < 0.5:
        stage["reach"] = stage.get("reach", 0) + _unit(proof)


def change_reach(rng: random.Random, problem: Json, proof: Json) -> None:
    stage = _stage(rng, proof)
    stage["reach"] = rng.choice([0, stage.get("reach", 0) + _amount(rng, proof), -_unit(proof)])


def change_multiplier(rng: random.Random, problem: Json, proof: Json) -> None:
    cuts = _stage(rng, proof)["cuts"]
    if cuts:
        k = rng.randrange(len(cuts))
        cuts[k] = [cuts[k][0], cuts[k][1] + _amount(rng, proof)]


def _clusters(proof: Json) -> int:
    return len(_stage(random.Random(0), proof)["a"])


def _set(rng: random.Random, proof: Json) -> int:
    return rng.getrandbits(max(proof["classes"][0], 1))


def add_cut(rng: random.Random, problem: Json, proof: Json) -> None:
    """Add a cut of any kind, with a set, pairs or teeth at random, to a stage."""
    clusters, mask = max(_clusters(proof), 2), f"{_set(rng, proof):x}"
    kind = rng.choice(["subtour", "parity", "comb"])
    more: Any = rng.randrange(clusters + 1)
    if kind == "parity":
        pairs = list(itertools.combinations(range(clusters), 2))
        more = [list(p) for p in rng.sample(pairs, min(len(pairs), rng.choice([1, 2, 3])))]
    elif kind == "comb":
        named = [*range(clusters), *range(90, 93)]
        rng.shuffle(named)
        more = [named[2 * k : 2 * k + 2] for k in range(min(3, len(named) // 2))]
        if rng.random() < 0.3:
            more[0].append(more[1][0])
    proof.setdefault("cuts", []).append([kind, mask, more])
    _stage(rng, proof)["cuts"].append([len(proof["cuts"]) - 1, abs(_amount(rng, proof))])


def change_cut(rng: random.Random, problem: Json, proof: Json) -> None:
    if not proof.get("cuts"):
        return add_cut(rng, problem, proof)
    cut = rng.choice(proof["cuts"])
    part = rng.choice(["set", "set", "more", "kind"])
    if part == "set":
        cut[1] = f"{int(cut[1], 16) ^ 1 << rng.randrange(proof['classes'][0]):x}"
    elif part == "kind":
        cut[0] = rng.choice(["subtour", "parity", "comb"])
    elif cut[0] == "subtour":
        cut[2] = rng.randrange(-1, _clusters(proof) + 1)
    elif cut[2]:
        cut[2] = cut[2][:-1] if rng.random() < 0.5 else [*cut[2], cut[2][0]]
    return None


def change_stages(rng: random.Random, problem: Json, proof: Json) -> None:
    """Drop, double or swap stages of a node."""
    stages = rng.choice(list(_nodes(proof["tree"]))).get("stages", [])
    if stages:
        k = rng.randrange(len(stages))
        if rng.random() < 0.5:
            del stages[k]
        else:
            stages.insert(rng.randrange(len(stages) + 1), copy.deepcopy(stages[k]))


def change_tree(rng: random.Random, problem: Json, proof: Json) -> None:
    """Drop, swap or replace branches, or branch on something else."""
    node = rng.choice(list(_nodes(proof["tree"])))
    names = next((p for p in (("apart", "next"), ("without", "at")) if p[0] in node), None)
    if names is None:
        stage = copy.deepcopy(_stage(rng, proof))
        clusters = max(_clusters(proof), 3)
        if rng.random() < 0.5:
            pair = sorted(rng.sample(range(clusters), 2))
            dear = {**stage, "p": [[*pair, abs(_amount(rng, proof))]]}
            other = rng.choice([{"stages": [stage]}, {"stages": []}, {}])
            node |= {"pair": pair, "apart": other, "next": {"stages": [dear]}}
        else:
            vertex = rng.randrange(-2, proof["classes"][0] + 2)
            node |= {"vertex": vertex, "without": {}, "at": {"stages": [stage]}}
        return
    a, b = names
    kind = rng.randrange(4)
    if kind == 0:
        node[a], node[b] = node[b], node[a]
    elif kind == 1:
        node[rng.choice(names)] = {}
    elif kind == 2:
        node[a] = copy.deepcopy(node[b])
    elif "pair" in node:
        node["pair"] = rng.sample(range(_clusters(proof)), 2)
    else:
        node["vertex"] = rng.randrange(proof["classes"][0])


def price_pair(rng: random.Random, problem: Json, proof: Json) -> None:
    """Give a pair of clusters a price where nothing makes them adjacent."""
    pair = rng.sample(range(max(_clusters(proof), 2)), 2)
    _stage(rng, proof).setdefault("p", []).append([*pair, abs(_amount(rng, proof))])


def move_point(rng: random.Random, problem: Json, proof: Json) -> None:
    points = proof["points"]
    for _ in range(rng.choice([1, 1, 3])):
        points[rng.randrange(len(points))] += _amount(rng, proof)


def _triangles(proof: Json) -> list[list[int]]:
    flat = proof["triangles"]
    return [flat[k : k + 3] for k in range(0, len(flat), 3)]


def change_triangles(rng: random.Random, problem: Json, proof: Json) -> None:
    """Drop, turn, reorder or rename triangles."""
    triangles = _triangles(proof)
    kind, k = rng.randrange(5), rng.randrange(len(triangles))
    if kind == 0:
        del triangles[k]
    elif kind == 1:
        triangles[k] = triangles[k][::-1]
    elif kind == 2:
        rng.shuffle(triangles)
    elif kind == 3:
        triangles[k][rng.randrange(3)] = rng.randrange(len(proof["points"]) // 2)
    else:
        triangles.insert(rng.randrange(len(triangles)), triangles[k])
    proof["triangles"] = [v for t in triangles for v in t]


def add_sheet(rng: random.Random, problem: Json, proof: Json) -> None:
    """Lay a copy of some or all triangles, with corners of its own, over the others."""
    count, triangles = len(proof["points"]) // 2, _triangles(proof)
    proof["points"] = proof["points"] * 2
    over = [[v + count for v in t] for t in triangles]
    if rng.random() < 0.3:
        over = rng.sample(over, rng.randint(1, len(over)))
    both = triangles + over
    rng.shuffle(both)
    proof["triangles"] = [v for t in both for v in t]


def split_point(rng: random.Random, problem: Json, proof: Json) -> None:
    """Give one triangle a corner of its own, which cuts it from a neighbour."""
    points, flat = proof["points"], proof["triangles"]
    k = rng.randrange(len(flat))
    points += points[2 * flat[k] : 2 * flat[k] + 2]
    flat[k] = len(points) // 2 - 1


def change_box(rng: random.Random, problem: Json, proof: Json) -> None:
    """Move a side of the box, to an obstacle or anywhere; or move all points outside with it."""
    box = proof.get("box")
    if box is None:
        xs, ys = proof["points"][::2], proof["points"][1::2]
        proof["box"] = [min(xs), min(ys), max(xs), max(ys)]
        return
    i, old = rng.randrange(4), list(box)
    sides = [v for k, v in enumerate(proof["points"]) if k % 2 == i % 2]
    box[i] = rng.choice([rng.choice(sides), box[i] + _amount(rng, proof)])
    if rng.random() < 0.7:
        low = i < 2
        for k in range(i % 2, len(proof["points"]), 2):
            p = proof["points"][k]
            if p == old[i] or (p < box[i] if low else p > box[i]):
                proof["points"][k] = box[i]
    if rng.random() < 0.1:
        del proof["box"]


def add_bridges(rng: random.Random, problem: Json, proof: Json) -> None:
    """Add bridges at or between corners, or a row of them from a corner."""
    points, bridges = proof["points"], proof.setdefault("bridges", [])
    delta = int(_unit(proof) / 2**30) or 1
    k = 2 * rng.randrange(len(points) // 2)
    x, y = points[k : k + 2]
    kind = rng.randrange(3)
    if kind == 0:
        bridges.append([x, y, x, y])
    elif kind == 1:
        j = 2 * rng.randrange(len(points) // 2)
        bridges.append([x, y, *points[j : j + 2]])
    else:
        dx, dy = rng.choice([(1, 0), (0, 1), (-1, 0), (0, -1)])
        for n in range(20):
            at = [x + n * dx * delta, y + n * dy * delta]
            bridges.append([*at, *at])
        points[k : k + 2] = bridges[-1][:2]


def scale_cover(rng: random.Random, problem: Json, proof: Json) -> None:
    """Shrink or stretch the triangulation, and perhaps its box with it."""
    bits = rng.choice([-30, -3, -1, 1, 8, 80])
    for name in ("points", "box") if rng.random() < 0.7 else ("points",):
        if name in proof:
            proof[name] = [v << bits if bits > 0 else v >> -bits for v in proof[name]]


def raise_target(rng: random.Random, problem: Json, proof: Json) -> None:
    target = proof["target"]
    if target is None:
        return
    share = rng.choice([2e-6, 1e-5, 1e-3, 0.1, 1.0, 1e6])
    proof["target"] = rng.choice([int(target * (1.0 + share)), int(target * (1.0 + share)), None])


def change_kinds(rng: random.Random, problem: Json, proof: Json) -> None:
    """Put a number of another kind, or something else, where a whole number belongs."""
    odd = rng.choice([True, None, 1.5, math.inf, -math.inf, math.nan, "7", [], {}, 1 << 5000, -1])
    where = rng.choice(["target", "points", "triangles", "box", "a", "b", "reach", "set",
                        "classes", "tree", "margin", "slack", "bridges", "p", "pair"])  # fmt: skip
    stage = _stage(rng, proof)
    if where in ("points", "triangles", "box", "classes") and proof.get(where):
        proof[where][rng.randrange(len(proof[where]))] = odd
    elif where == "a":
        stage["a"][rng.randrange(len(stage["a"]))] = odd
    elif where == "b" and stage["cuts"]:
        stage["cuts"][0] = [stage["cuts"][0][0], odd]
    elif where in ("reach", "p"):
        stage[where] = odd
    elif where == "set" and proof.get("cuts"):
        proof["cuts"][0][1] = odd
    elif where == "pair":
        proof["tree"] |= {"pair": odd, "apart": {}, "next": {}}
    else:
        proof[where] = odd


def grow_obstacles(rng: random.Random, problem: Json, proof: Json) -> None:
    """Claim a margin or a reserve of tether: the proof is then about the problem with these."""
    if rng.random() < 0.5:
        proof["margin"] = rng.choice([1e-3, 1.0, 10.0])
    else:
        proof["slack"] = rng.choice([1e-3, 0.1, 0.5])


def move_goal(rng: random.Random, problem: Json, proof: Json) -> None:
    position = rng.choice(problem["goals"])["position"]
    position[rng.randrange(len(position))] += _length(rng)


def move_obstacle(rng: random.Random, problem: Json, proof: Json) -> None:
    if problem["obstacles"]:
        o = rng.choice(problem["obstacles"])
        dx, dy = _length(rng), _length(rng)
        if "center" in o:
            o["center"] = [o["center"][0] + dx, o["center"][1] + dy]
        else:
            o["polygon"] = [[x + dx, y + dy] for x, y in o["polygon"]]


def change_size(rng: random.Random, problem: Json, proof: Json) -> None:
    """Change a radius, the clearance or the bounds, or drop an obstacle."""
    circles = [o for o in problem["obstacles"] if "radius" in o]
    kind = rng.randrange(4)
    if kind == 0 and circles:
        rng.choice(circles)["radius"] *= rng.choice([0.5, 0.99, 0.999999, 1.000001, 1.01])
    elif kind == 1:
        problem["clearance"] = max(0.0, problem.get("clearance") or 0.0) + rng.choice([1e-6, 0.1])
    elif kind == 2 and problem["obstacles"]:
        del problem["obstacles"][rng.randrange(len(problem["obstacles"]))]
    else:
        problem["bounds"] = rng.choice([None, [-1e3, -1e3, 1e3, 1e3], [-5.0, -5.0, 505.0, 505.0]])


def change_tether(rng: random.Random, problem: Json, proof: Json) -> None:
    problem["tether_length"] *= rng.choice([0.9, 0.999999, 1.000001, 1.1, 1.3])


def change_goals(rng: random.Random, problem: Json, proof: Json) -> None:
    """Drop, swap or rename goals, make two of them alternatives, or change their order."""
    goals = problem["goals"]
    kind = rng.randrange(6)
    if kind == 4:
        for goal in goals:
            goal["after"] = []
    elif kind == 5 and len(goals) > 1:
        first, second = rng.sample(range(len(goals)), 2)
        goals[first]["name"] = "the first one"
        goals[second]["after"] = ["the first one"]
    elif kind == 0 and len(goals) > 1:
        del goals[rng.randrange(len(goals))]
    elif kind == 1:
        rng.shuffle(goals)
    elif kind == 2 and len(goals) > 1:
        for goal in rng.sample(goals, 2):
            goal["choice"] = "one of two"
    else:
        rng.choice(goals)["name"] = "another name"


def _length(rng: random.Random) -> float:
    return rng.choice([-1.0, 1.0]) * rng.choice([1e-7, 1e-4, 0.1, 5.0, 50.0])


OF_DUALS: tuple[Mutation, ...] = (
    change_price, change_all_prices, change_reach, change_multiplier, add_cut, change_cut,
    change_stages, change_tree, price_pair,
)  # fmt: skip
"""Mutations of the duals, the cuts and the branching tree."""

OF_COVER: tuple[Mutation, ...] = (
    move_point, change_triangles, add_sheet, split_point, change_box, add_bridges, scale_cover,
    grow_obstacles,
)  # fmt: skip
"""Mutations of the triangulation."""

OF_PROBLEM: tuple[Mutation, ...] = (
    move_goal, move_obstacle, change_size, change_tether, change_goals,
)  # fmt: skip
"""Mutations of the problem that the proof is held against."""

OF_KINDS: tuple[Mutation, ...] = (raise_target, change_kinds)
"""Mutations of the target, and of the kinds of values."""

MUTATIONS = (*OF_DUALS, *OF_COVER, *OF_PROBLEM, *OF_KINDS)


@dataclass(frozen=True)
class Outcome:
    """Outcome of a mutation.

    Attributes
    ----------
    kind
        "refused", "true" for a proof that is accepted and does not claim too much, "false" for one
        that does, "open" if a cover was accepted over which duals could prove too much, "crash" if
        the checker raised another error, and "void" if the problem is none.
    names, first
        Names of all mutations, and of the first one.
    detail
        What was said or claimed.
    """

    kind: str
    names: str
    first: str
    detail: str = ""
    text: str = ""
    proof: Json | None = None


def attack(proven: Proven, seed: int) -> Outcome:
    """Return what becomes of a proof after one to three mutations."""
    rng = random.Random(seed)
    problem, proof = json.loads(proven.problem.to_json()), copy.deepcopy(proven.proof)
    # every mutation is the first one equally often
    chosen = [MUTATIONS[seed % len(MUTATIONS)], *rng.choices(MUTATIONS, k=rng.choice([0, 0, 1, 2]))]
    if rng.random() < 0.4 and chosen[0] is not raise_target:
        chosen.append(raise_target)
    for mutation in chosen:
        try:
            mutation(rng, problem, proof)
        except (TypeError, ValueError, AttributeError, KeyError, OverflowError, IndexError):
            break  # an earlier mutation has put another kind of value there
    names = " + ".join(m.__name__ for m in chosen)
    text = json.dumps(problem)
    kind, detail = _judge(text, proof, proven.solution.length if _is_geometric(chosen) else None)
    return Outcome(kind, names, chosen[0].__name__, detail, text, proof)


def save(outcome: Outcome, path: Path) -> None:
    """Write the problem and the proof of an outcome, to PATH.problem.json and PATH.proof."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.with_suffix(".problem.json").write_text(outcome.text, encoding="utf-8")
    path.with_suffix(".proof").write_bytes(to_bytes(outcome.proof or {}))


def _is_geometric(chosen: list[Mutation]) -> bool:
    return any(m in OF_COVER or m in OF_PROBLEM for m in chosen)


def _judge(text: str, proof: Json, length: float | None) -> tuple[str, str]:
    kind, detail, bound = _checked(text, proof)
    if kind == "crash":
        return kind, detail
    relaxed = -math.inf
    if length is not None:
        with contextlib.suppress(Exception):  # no cover, which `check` reports
            relaxed = relaxed_optimum(text, proof, 1.2 * length)
    if max(bound, relaxed) == -math.inf:
        return kind, detail
    optimum = _optimum(text, proof)
    if optimum is None:
        return "void", ""
    if bound > optimum * (1.0 + ROUNDING):
        return "false", f"bound {bound!r}, optimum {optimum!r}"
    if relaxed > optimum * (1.0 + ROUNDING):
        return "open", f"relaxation {relaxed!r}, optimum {optimum!r}"
    return kind, detail


def _checked(text: str, proof: Json) -> tuple[str, str, float]:
    with contextlib.suppress(Exception):  # what is wrong here is wrong in `check`, too
        rehash(text, proof)
    try:
        return "true", "", check(text, to_bytes(proof)).bound
    except Refused as error:
        return "refused", str(error), -math.inf
    except Exception as error:
        return "crash", f"{type(error).__name__}: {error}", -math.inf


def _optimum(text: str, proof: Json) -> float | None:
    """Return the length of the best tour that netsp finds, inf if there is none, and None if the
    problem is not valid."""
    try:
        problem = Problem.from_json(text)
        problem = problem.grown(proof.get("margin", 0.0), proof.get("slack", 0.0))
        found = solve(problem)
    except InfeasibleError:
        return math.inf
    except NetspError:
        return None
    if found.length is None:
        return math.inf if found.status is Status.INFEASIBLE else None
    return found.length


# forgeries: each says what it claims, and what it tries to get past


@functools.cache
def _forged_from() -> Proven:
    post = {"center": [5, 0], "radius": 2}
    goals = [[10, 0], [8, 3], [3, -4]]
    return honest(Problem(base=(0, 0), goals=goals, obstacles=[post], tether_length=40))


def _start() -> tuple[str, Json, float]:
    """Return the text of a problem, its proof, and its optimum."""
    proven = _forged_from()
    assert proven.solution.length is not None
    return proven.problem.to_json(), copy.deepcopy(proven.proof), proven.solution.length


def _raised() -> tuple[str, Json]:
    """Return the text of a problem, and a proof whose target is half as much again."""
    text, proof, _ = _start()
    proof["target"] = proof["target"] * 3 // 2
    rehash(text, proof)
    return text, proof


def _finished(text: str | Json, proof: Json) -> tuple[str, bytes]:
    """Return problem and proof with the hash of the proof's own classes."""
    text = text if isinstance(text, str) else json.dumps(text)
    with contextlib.suppress(Exception):  # `check` has to find out what is wrong
        rehash(text, proof)
    return text, to_bytes(proof)


def _mesh(triangles: Iterator[Any]) -> Json:
    """Return points and triangles of a proof, from corners in any order."""
    index: dict[tuple[int, int], int] = {}
    corners: list[int] = []
    for a, b, c in triangles:
        is_clockwise = (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0])
        ordered = (a, c, b) if is_clockwise else (a, b, c)
        corners += [index.setdefault(p, len(index)) for p in ordered]
    return {"points": [v for p in index for v in p], "triangles": corners}


def _walled(
    problem: Json, wall: list[tuple[int, int]], half: int, share: float, **more: Any
) -> tuple[str, bytes]:
    """Return a proof whose triangles surround a wall of obstacles, from its lower to its upper end.

    Parameters
    ----------
    wall
        Grid points from one end to the other, at least five.
    half
        Half the side of the box.
    share
        Target, as a share of the optimum.
    """
    (s, *_, e), turned = wall, wall[2:-2]
    sw, se, ne, nw = (-half, -half), (half, -half), (half, half), (-half, half)
    sides = [(s, sw, se), (e, se, ne), (s, nw, sw), (e, ne, nw)]
    # the corners of both sides differ, so that they are not glued
    right, left = [s, *wall[2:-2:2], e], [s, wall[1], *turned[1::2], wall[-2], e]
    sides += [(a, b, se) for a, b in itertools.pairwise(right)]
    sides += [(a, b, nw) for a, b in itertools.pairwise(left)]
    text = json.dumps(problem)
    length = solve(Problem.from_json(text)).length
    assert length is not None
    proof = {
        "format": "netsp-proof 1", "target": int(share * length * _unit_of(text)),
        "box": [*sw, *ne], "tree": {}, **_mesh(iter(sides)), **more,
    }  # fmt: skip
    return _finished(text, proof)


def _unit_of(text: str) -> int:
    """Return the number of grid units in a unit of a problem."""
    return 1 << read_problem(text).grid


def closed_passage() -> tuple[str, bytes]:
    """A passage between two posts is closed by an edge."""
    u = 1 << 32  # the size is 10
    posts = [{"center": [5, y], "radius": 2} for y in (-3, 3)]
    problem = {"base": [0, 0], "goals": [[10, 0]], "obstacles": posts, "tether_length": 40}
    wall = [(5 * u, y * u // 8) for y in (-39, -38, -30, -8, 0, 8, 30, 38, 39)]
    return _walled({"schema_version": 1, **problem}, wall, 12 * u, 1.05)


def box_at_obstacle() -> tuple[str, bytes]:
    """The box ends where the post does, which cuts off both ways around it."""
    text, proof, _ = _start()
    u = _unit_of(text)
    left, right = (5 * u - 3, 5 * u + 3)
    rim, far = 2 * u - 1, 11 * u
    cells = [[(-u, -5 * u), (left, -rim), (left, rim), (-u, 4 * u)],
             [(right, -rim), (far, -5 * u), (far, 4 * u), (right, rim)]]  # fmt: skip
    box = [-u, -2 * u, far, 2 * u]
    problem = {**json.loads(text), "goals": [[10, 0], [9, 1]]}
    mesh = _mesh(iter([t for a, b, c, d in cells for t in ((a, b, c), (a, c, d))]))
    return _finished(problem, {**proof, **mesh, "box": box, "target": None, "tree": {}, "cuts": []})


def second_sheet() -> tuple[str, bytes]:
    """Goals lie in a copy of the triangles that the base is not connected with."""
    text, proof, _ = _start()
    count, triangles = len(proof["points"]) // 2, _triangles(proof)
    points = [(proof["points"][2 * k], proof["points"][2 * k + 1]) for k in range(count)]
    base = [t for t in triangles if _holds([points[v] for v in t], (0, 0))]
    copies = [[v + count for v in t] for t in triangles]
    order = base + copies + [t for t in triangles if t not in base]
    proof |= {"points": proof["points"] * 2, "triangles": [v for t in order for v in t]}
    return _finished(text, {**proof, "target": None, "tree": {}, "cuts": []})


def _holds(corners: list[tuple[int, int]], p: tuple[int, int]) -> bool:
    sides = zip(corners, [*corners[1:], corners[0]], strict=True)
    return all((b[0] - a[0]) * (p[1] - a[1]) >= (b[1] - a[1]) * (p[0] - a[0]) for a, b in sides)


def huge_prices() -> tuple[str, bytes]:
    """Prices of 2^90, a reach that takes them back: legs are lost in the rounding."""
    text, proof = _raised()
    huge = 1 << 90
    stage = {"a": [huge] * 4, "cuts": [], "reach": proof["target"] // 4 + 10 - 2 * huge}
    return _finished(text, {**proof, "cuts": [], "tree": {"stages": [stage]}})


def far_points() -> tuple[str, bytes]:
    """Points so far away that floating-point numbers do not resolve a grid unit."""
    text, proof, _ = _start()
    scaled = {k: [v << 30 for v in proof[k]] for k in ("points", "box")}
    return _finished(text, {**proof, **scaled, "target": None, "tree": {}, "cuts": []})


def deep_goals() -> tuple[str, bytes]:
    """Goals so deep for their distances that every tether exceeds the number for no limit."""
    goals = [[1e-10, 0, -5e14], [0, 1e-10, -5e14]]
    problem = {"schema_version": 1, "base": [0, 0], "goals": goals, "tether_length": 9e14}
    far = 1 << 37
    corners = [(-far, -far), (far, -far), (far, far), (-far, far)]
    mesh = _mesh(iter([tuple(corners[:3]), (corners[0], *corners[2:])]))
    proof = {"format": "netsp-proof 1", "target": None, "box": [-far, -far, far, far], **mesh}
    return _finished(problem, {**proof, "tree": {}})


def goal_at_edge() -> tuple[str, bytes]:
    """An edge so near to a goal that rounding may put the goal beyond it."""
    text, proof, _ = _start()
    corners = zip(proof["points"][::2], proof["points"][1::2], strict=True)
    u = _unit_of(text)
    x, y = min(corners, key=lambda p: abs(math.hypot(p[0] - 5 * u, p[1]) - 2 * u))
    problem = json.loads(text)
    problem["goals"][2] = [(x + 5 * (x > 5 * u)) / u, y / u]
    return _finished(problem, {**proof, "target": None, "tree": {}, "cuts": []})


def order_left_out() -> tuple[str, bytes]:
    """The proof of a problem in which one goal comes after another, without that order."""
    goals = [{"name": "a", "position": [1, 0]}, {"position": [8, 0], "after": ["c"]},
             {"name": "c", "position": [9, 3], "after": ["a"]}, {"position": [4, 4]}]  # fmt: skip
    fields = {"schema_version": 1, "base": [0, 0], "tether_length": 60}
    ordered = json.dumps({**fields, "goals": [{**goals[0], "after": ["d"]}, *goals[1:3],
                                              {**goals[3], "name": "d"}]})  # fmt: skip
    proven = honest(Problem.from_json(ordered))
    problem = {**fields, "goals": [g["position"] for g in goals]}
    return _finished(problem, copy.deepcopy(proven.proof))


def bridges_in_a_row() -> tuple[str, bytes]:
    """A gap of 79 billionths of the size is closed by bridges from one to the next."""
    u, delta = 1 << 32, 40  # the size is 10, so δ is 10 u / 2^30
    gap = 79 * delta
    posts = [{"center": [5, s * (2.0 + gap / u / 2)], "radius": 2.0} for s in (1, -1)]
    problem = {"base": [0, 0], "goals": [[10, 0]], "obstacles": posts, "tether_length": 40}
    edge = gap // 2 + 2
    bridges = [[5 * u, y, 5 * u, y] for y in range(edge, -edge - delta, 1 - delta)]
    top = [10 * delta + edge, 11 * delta + edge, u // 2, 39 * u // 10 - 5, 39 * u // 10]
    middle = range(-edge, edge, delta // 4)
    wall = [(5 * u, y) for y in (*(-y for y in top[::-1]), *middle, *top)]
    return _walled({"schema_version": 1, **problem}, wall, 12 * u, 1.05, bridges=bridges)


def negative_multiplier() -> tuple[str, bytes]:
    """A cut that all tours fulfil with room, times a negative number."""
    text, proof = _raised()
    proof["cuts"] = [["parity", "0", [[0, 1], [1, 2], [2, 3]]]]
    stage = {"a": [0] * 4, "cuts": [[0, -proof["target"]]], "reach": proof["target"]}
    return _finished(text, {**proof, "tree": {"stages": [stage]}})


def negative_reach() -> tuple[str, bytes]:
    """A reach that leaves no leg to look at."""
    text, proof = _raised()
    stage = {"a": [proof["target"]] * 4, "cuts": [], "reach": -proof["target"]}
    return _finished(text, {**proof, "tree": {"stages": [stage]}})


def fractions_for_numbers() -> tuple[str, bytes]:
    """Prices that are no whole numbers, among them one that is not a number."""
    text, proof = _raised()
    stage = {"a": [math.nan, math.inf, 0.5, True], "cuts": [], "reach": math.inf}
    return _finished(text, {**proof, "tree": {"stages": [stage]}})


def infinite_target() -> tuple[str, bytes]:
    """A target that is infinite."""
    text, proof, _ = _start()
    return _finished(text, {**proof, "target": math.inf})


def fraction_for_target() -> tuple[str, bytes]:
    """A target that is no whole number, so that more is claimed than is checked."""
    text, proof, _ = _start()
    return _finished(text, {**proof, "target": proof["target"] + 0.5})


def price_of_any_pair() -> tuple[str, bytes]:
    """A price that is paid by tours between two goals, and counted for all."""
    text, proof = _raised()
    stage = {**proof["tree"]["stages"][0], "p": [[1, 2, proof["target"]]]}
    return _finished(text, {**proof, "tree": {"stages": [stage]}})


def pair_without_the_other() -> tuple[str, bytes]:
    """A branch in which a pair is adjacent, without the one in which it is not."""
    text, proof = _raised()
    first = {**proof["tree"]["stages"][0], "reach": 1 << 60}
    dear = {**first, "p": [[1, 2, 4 * proof["target"]]]}
    node = {"stages": [first], "pair": [1, 2], "apart": {}, "next": {"stages": [dear]}}
    return _finished(text, {**proof, "tree": node})


def vertex_without_the_other() -> tuple[str, bytes]:
    """A branch that drops a class, and another that drops all classes of the goal but none."""
    text, proof = _raised()
    first = {**proof["tree"]["stages"][0], "reach": 1 << 60}
    node = {"stages": [first], "vertex": -1, "without": {}, "at": {}}
    return _finished(text, {**proof, "tree": node})


def set_with_base() -> tuple[str, bytes]:
    """A subtour cut about all vertices: no leg leaves them, and one goal's legs become dear."""
    text, proof = _raised()
    proof["cuts"] = [["subtour", f"{(1 << proof['classes'][0]) - 1:x}", 1]]
    stage = {"a": [0] * 4, "cuts": [[0, proof["target"]]], "reach": proof["target"]}
    return _finished(text, {**proof, "tree": {"stages": [stage]}})


def teeth_that_meet() -> tuple[str, bytes]:
    """A comb whose teeth overlap."""
    text, proof = _raised()
    every = (1 << proof["classes"][0]) - 1
    proof["cuts"] = [["comb", f"{every:x}", [[0, 90], [0, 91], [1, 90]]]]
    stage = {"a": [0] * 4, "cuts": [[0, proof["target"]]], "reach": proof["target"]}
    return _finished(text, {**proof, "tree": {"stages": [stage]}})


def fewer_clusters() -> tuple[str, bytes]:
    """A stage with the prices of fewer goals, and one with those of more."""
    text, proof = _raised()
    stages = [{"a": [proof["target"]] * n, "cuts": [], "reach": 1 << 60} for n in (3, 5)]
    return _finished(text, {**proof, "tree": {"stages": stages}})


def other_problem() -> tuple[str, bytes]:
    """The proof of a problem with more goals."""
    text, proof, _ = _start()
    problem = json.loads(text)
    del problem["goals"][1]
    return json.dumps(problem), to_bytes(proof)


def choice_by_default_name() -> tuple[str, bytes]:
    """A choice without a name, and goals of a choice of the name that it then gets: one cluster."""
    goals = [
        {"position": [2, 0], "choice": "choice 1"}, {"any_of": [[20, 0], [20, 1]]}, [3, -4],
    ]  # fmt: skip
    fields = {"base": [0, 0], "goals": goals, "tether_length": 60}
    split = json.loads(json.dumps(fields))
    split["goals"] = [[2, 0], {"any_of": [[20, 0], [20, 1]]}, [3, -4]]
    proven = honest(Problem.from_json(json.dumps({"schema_version": 1, **split})))
    return _finished({"schema_version": 1, **fields}, copy.deepcopy(proven.proof))


def two_targets() -> tuple[str, bytes]:
    """A file that states its target twice."""
    text, proof, _ = _start()
    more = {**proof, "target": 2 * proof["target"]}
    rehash(text, more)
    return text, f'{{"target": {proof["target"]}, {json.dumps(more)[1:]}'.encode()


def margin_below_zero() -> tuple[str, bytes]:
    """A margin that is not a number; a negative one would shrink obstacles."""
    text, proof, _ = _start()
    return _finished(text, {**proof, "margin": math.nan, "slack": -0.5})


def endless_tree() -> tuple[str, bytes]:
    """A tree with more levels than Python's limit of recursion."""
    text, proof = _raised()
    first = json.dumps(proof["tree"]["stages"][0])
    levels = 20_000
    deep = f'{{"stages": [{first}], "vertex": 1, "without": ' * levels + "{}" + "}" * levels
    return text, json.dumps({**proof, "tree": 0}).replace('"tree": 0', f'"tree": {deep}').encode()


def goal_free() -> tuple[str, bytes]:
    """A problem without goals: nothing takes a leg away from the bound."""
    far = 1 << 37
    corners = [(-far, -far), (far, -far), (far, far), (-far, far)]
    mesh = _mesh(iter([tuple(corners[:3]), (corners[0], *corners[2:])]))
    stage = {"a": [0], "cuts": []}
    proof = {"format": "netsp-proof 1", "target": far, "box": [-far, -far, far, far], **mesh}
    problem = {"schema_version": 1, "base": [0, 0], "goals": [], "tether_length": 10}
    return _finished(problem, {**proof, "tree": {"stages": [stage]}})


FORGERIES: dict[str, Callable[[], tuple[str, bytes]]] = {
    f.__name__: f
    for f in (
        closed_passage, box_at_obstacle, second_sheet, huge_prices, far_points, deep_goals,
        goal_at_edge, order_left_out, bridges_in_a_row, negative_multiplier, negative_reach,
        fractions_for_numbers, infinite_target, fraction_for_target, price_of_any_pair,
        pair_without_the_other, vertex_without_the_other, set_with_base, teeth_that_meet,
        fewer_clusters, other_problem, choice_by_default_name, two_targets, margin_below_zero,
        endless_tree, goal_free,
    )
}  # fmt: skip
"""Forged proofs by name: functions that return the text of a problem and the proof."""
