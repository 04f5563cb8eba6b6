"""CP-SAT on a travel graph, in a process of its own: ortools and highspy both bring HiGHS, and the
two cannot be loaded together.

python benchmarks/cp_sat.py GRAPH.npz SECONDS     prints length and bound
"""

from __future__ import annotations

import sys

import numpy as np
from ortools.sat.python import cp_model


def main() -> None:
    """`AddCircuit` with optional vertices, exactly one of every cluster."""
    data = np.load(sys.argv[1])
    costs, cluster = data["costs"], data["cluster"]
    model = cp_model.CpModel()
    n = len(costs)
    scale = 1e6 / float(np.max(costs[np.isfinite(costs)]))
    visited = [model.NewBoolVar(f"x{v}") for v in range(n)]
    arcs = [(v, v, visited[v].Not()) for v in range(1, n)]
    terms = []
    for u, v in np.argwhere(np.isfinite(costs)).tolist():
        used = model.NewBoolVar(f"y{u}_{v}")
        arcs.append((u, v, used))
        terms.append(round(float(costs[u, v]) * scale) * used)
    model.AddCircuit(arcs)
    for c in range(int(cluster.max()) + 1):
        model.AddExactlyOne(visited[int(v)] for v in np.flatnonzero(cluster == c))
    model.Minimize(sum(terms))
    solver = cp_model.CpSolver()
    solver.parameters.max_time_in_seconds = float(sys.argv[2])
    solver.parameters.num_workers = 2
    found = solver.Solve(model) in (cp_model.OPTIMAL, cp_model.FEASIBLE)
    length = solver.ObjectiveValue() / scale if found else float("inf")
    print(length, solver.BestObjectiveBound() / scale)


if __name__ == "__main__":
    main()
