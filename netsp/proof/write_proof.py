"""Proofs of lower bounds: from a solved problem to a file that anyone can check."""

from __future__ import annotations

import json
import zlib
from typing import Any

import numpy as np

from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.proof.cover_instance import CoverInstance
from netsp.proof.dual_search import DualSearch, SearchPolicy
from netsp.proof.triangulate import grid_of, triangulate
from netsp.roadmap.travel_graph import TravelGraph
from netsp_check.dual_bound import Bound
from netsp_check.leg_bounds import LegBounds
from netsp_check.problem_file import read_problem
from netsp_check.proof_check import cover


def write_proof(problem: Problem, solution: Solution, graph: TravelGraph, corners: int = 16, time_limit: float = 60.0, verbose=print) -> bytes:
    """Return a proof that no tour is shorter than a solution's, less the tolerance."""
    import time
    t0=time.time()
    clock = Clock.from_limit(time_limit)
    text = problem.to_json()
    exact = read_problem(text, 0)
    grid = grid_of(float(exact.size))
    exact = read_problem(text, grid, solution.margin, solution.slack)
    target = int(np.floor(solution.length * (1.0 - 0.9e-6) * 2.0**grid))
    proof: dict[str, Any] = {"format": "netsp-proof 1", "grid": grid, "target": target}
    proof |= triangulate(exact, corners).to_fields()
    checked, tree = cover(text, proof)
    legs = LegBounds(tree)
    bound = Bound(tree, legs, target)
    verbose('cover',time.time()-t0)
    instance = CoverInstance(problem, graph, tree, legs, bound.reachable())
    verbose('instance',time.time()-t0,len(instance.cluster),(instance.at<0).sum())
    tour = instance.rows_of([0, *graph.vertices_of([v.goal+1 for v in solution.tour],[v.signature for v in solution.tour])])
    search = DualSearch(instance, tour, target, clock, on_round=lambda b: verbose('  bound',b*2.0**-grid, time.time()-t0))
    root = search.prove()
    verbose('proved',time.time()-t0,'leaves',root.leaves(),'known',len(legs.known))
    proof["classes"] = [len(tree.vertices), tree.digest()]
    proof["tree"] = root.to_json(instance.vertices, np.array(bound.cluster))
    return zlib.compress(json.dumps(proof, separators=(",", ":")).encode(), 9)
