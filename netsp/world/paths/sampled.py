"""Short paths by the planners of OMPL, which the paper uses.

Source: Sucan, Moll and Kavraki, "The Open Motion Planning Library", IEEE RAM 19(4), 2012.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.world.paths.path_policy import PathPolicy
from netsp.world.paths.tree import Grid
from netsp.world.scene.sampling import Field, distance, lowest_along

OMPL_PLANNERS = {"rrtstar": "RRTstar", "bitstar": "BITstar", "prmstar": "PRMstar"}


class SampledPaths:
    """Paths from points (n, 3) to a target (3,) by a planner of OMPL; each is planned on demand.

    Raises
    ------
    InputError
        The name is not in `OMPL_PLANNERS`, or OMPL is not installed.
    """

    def __init__(
        self,
        name: str,
        grid: Grid,
        target: Floats,
        points: Floats,
        seed: int = 0,
        policy: PathPolicy = PathPolicy(),
    ) -> None:
        if name not in OMPL_PLANNERS:
            raise InputError(f"paths: expected tree, {', '.join(OMPL_PLANNERS)}, got {name!r}")
        self.name, self.grid, self.seed, self.policy = name, grid, seed, policy
        self.target = np.asarray(target, dtype=float)
        self.points = np.asarray(points, dtype=float).reshape(-1, 3)
        self._paths: dict[int, Floats | None] = {}

    def path(self, n: int) -> Floats | None:
        """Return the path (k, 3) from point n to the target; None if none was found."""
        if n not in self._paths:
            self._paths[n] = self._plan(self.points[n])
        return self._paths[n]

    def _plan(self, start: Floats) -> Floats | None:
        ob, og, ou = _ompl()
        ou.noOutputHandler()
        ou.RNG.setSeed(self.seed + 1)
        grid = self.grid
        # a path need not keep more distance than its ends
        ends = grid.field.distance(np.array([start, self.target]))
        room = max(0.0, min(grid.clearance, float(ends.min()) - 1e-3 * grid.cell))
        field = grid.field.grown(room).arrays
        space, info = self._space(ob, field, start)
        first, last = space.allocState(), space.allocState()
        for k in range(3):
            first[k], last[k] = float(start[k]), float(self.target[k])
        query = ob.ProblemDefinition(info)
        query.setStartAndGoalStates(first, last)
        query.setOptimizationObjective(ob.PathLengthOptimizationObjective(info))
        planner = getattr(og, OMPL_PLANNERS[self.name])(info)
        planner.setProblemDefinition(query)
        planner.setup()
        if self.name == "prmstar":
            # not `solve`, whose own thread would wait for the global interpreter lock
            grow = getattr(planner, "growRoadmapPtc", planner.growRoadmap)
            milestones = self.policy.prmstar_milestones
            grow(ob.PlannerTerminationCondition(lambda: planner.milestoneCount() >= milestones))
            ends = np.array([start, self.target])
            path = _through_roadmap(ob, info, planner, ends, self.policy.prmstar_neighbours)
        else:
            is_rrt = self.name == "rrtstar"
            left = [self.policy.rrtstar_iterations if is_rrt else self.policy.bitstar_iterations]

            def is_over() -> bool:
                left[0] -= 1
                return left[0] < 0

            planner.solve(ob.PlannerTerminationCondition(is_over))
            path = None
            if query.hasExactSolution():
                states = query.getSolutionPath().getStates()
                path = np.array([[s[0], s[1], s[2]] for s in states])
        if path is None:
            return None
        free = all(
            lowest_along(field, a[0], a[1], a[2], b[0], b[1], b[2], 0.1 * grid.cell)[0]
            > -0.25 * grid.cell
            for a, b in pairwise(path)
        )
        return path if free else None

    def _space(self, ob: Any, field: Field, start: Floats) -> tuple[Any, Any]:
        """Return OMPL's space, and its information with the solids."""
        grid = self.grid
        space = ob.RealVectorStateSpace(3)
        bounds = ob.RealVectorBounds(3)
        high = grid.low + np.array(grid.free.shape) * grid.cell
        for k in range(3):
            bounds.setLow(k, float(min(grid.low[k], start[k], self.target[k])))
            bounds.setHigh(k, float(max(high[k], start[k], self.target[k])))
        space.setBounds(bounds)
        info = ob.SpaceInformation(space)
        info.setStateValidityChecker(lambda s: bool(distance(field, s[0], s[1], s[2]) >= 0.0))
        info.setStateValidityCheckingResolution(0.25 * grid.cell / space.getMaximumExtent())
        info.setup()
        return space, info


def _through_roadmap(
    ob: Any, info: Any, planner: Any, ends: Floats, neighbours: int
) -> Floats | None:
    """Return the shortest path over the milestones of PRM* between two places (2, 3), each joined
    to its nearest milestones."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra

    data = ob.PlannerData(info)
    planner.getPlannerData(data)
    states = [data.getVertex(i).getState() for i in range(data.numVertices())]
    points = np.vstack([[[s[0], s[1], s[2]] for s in states], ends])
    pairs = [(i, int(j)) for i in range(len(states)) for j in data.getEdges(i)]
    state = info.allocState(), info.allocState()
    for end in (len(states), len(states) + 1):
        near = np.argsort(np.linalg.norm(points[: len(states)] - points[end], axis=1))[:neighbours]
        for j in near:
            for k in range(3):
                state[0][k], state[1][k] = float(points[end, k]), float(points[j, k])
            if info.checkMotion(*state):
                pairs.append((end, int(j)))
    i, j = np.array(pairs).T
    lengths = np.linalg.norm(points[i] - points[j], axis=1)
    graph = coo_matrix((lengths, (i, j)), shape=(len(points), len(points))).tocsr()
    far, before = dijkstra(graph, directed=False, indices=len(states) + 1, return_predecessors=True)
    if not np.isfinite(far[len(states)]):
        return None
    path = [len(states)]
    while path[-1] != len(states) + 1:
        path.append(int(before[path[-1]]))
    return np.asarray(points[path])


def _ompl() -> Any:
    try:
        from ompl import base, geometric, util
    except ImportError:
        raise InputError("OMPL is not installed: pip install 'netsp[prm]'") from None
    return base, geometric, util
