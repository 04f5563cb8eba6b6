"""Sampled roadmap of the 2017 paper: PRM* (OMPL) with homotopy augmentation.

McCammon & Hollinger 2017, section IV-A: milestones are sampled uniformly in free space, joined by
the PRM* rule (Karaman & Frazzoli 2011), and augmented with the homotopy class of the path from the
base (Bhattacharya et al. 2012). Words come from the projection on the plane, lengths are 3D.

OMPL would check motions at sampled points. Here it checks their ends only, and each edge is then
checked exactly. Base and goals join the milestones by the same k-nearest rule.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock, TimeLimit
from netsp.base.compiled.kernel import kernel
from netsp.base.errors import InputError, LimitReachedError, counted, warn_left_out
from netsp.base.geometry.kernels import Blockers, depth_in_obstacle, segment_blocked
from netsp.gtsp.cost_oracle import Estimate
from netsp.hsignature import Word
from netsp.model.problem import Circle, Problem
from netsp.roadmap.any_class_paths import sub_goals, tabulate_detours
from netsp.roadmap.augmented import AugmentedGraph, augment
from netsp.roadmap.explain_unreachable import find_unreached_error
from netsp.roadmap.leg_provider import Legs
from netsp.roadmap.letters import segment_letters
from netsp.roadmap.outline import Outline
from netsp.roadmap.paths import TautPaths, UnknownPathError
from netsp.roadmap.roadmap_policy import RoadmapPolicy
from netsp.roadmap.shortest import MilestoneGraph
from netsp.roadmap.taut_legs import TautLegs
from netsp.roadmap.tether_blind_legs import Detours
from netsp.roadmap.travel_graph import TravelGraph


class PrmRoadmap(Legs):
    """PRM* and its homotopy-augmented graph, whose shortest paths are legs.

    Parameters
    ----------
    samples
        Number of milestones; by default that of the policy.
    seed
        Seed of the sampling. The same seed gives the same roadmap.
    shortcut
        Whether every leg is pulled taut within its class, so that only the set of classes is
        sampled.
    max_augmented
        Maximum number of vertices of the augmented graph; by default that of the policy.

    Attributes
    ----------
    milestones
        (n, 3) base, goals, then samples.
    edges
        (k, 2) pairs of milestones.
    augmented
        Graph over (milestone, word).
    complete
        Whether sampling and augmenting were complete before the time was up.

    Raises
    ------
    InputError
        Bad options, OMPL not installed, or too many augmented vertices.
    InfeasibleError
        A goal that no tether within the limit reaches, which is proven exactly.
    LimitReachedError
        A goal that this roadmap does not reach, though a tether would.
    """

    def __init__(
        self,
        problem: Problem,
        policy: RoadmapPolicy | None = None,
        *,
        samples: int | None = None,
        seed: int = 0,
        shortcut: bool = False,
        max_augmented: int | None = None,
        time_limit: TimeLimit = None,
    ) -> None:
        self.policy = policy or RoadmapPolicy()
        prm = self.policy.prm
        samples = prm.samples if samples is None else samples
        if not isinstance(samples, (int, np.integer)) or samples < 1:
            raise InputError(
                f"roadmap 'prm': samples: expected a positive whole number, got {samples!r}"
            )
        self.problem = problem
        clock = Clock.from_limit(time_limit)
        self.paths = TautPaths(problem, clock=clock, policy=self.policy)
        outline = self.paths.outline
        fixed = problem.points.copy()
        fixed[:, :2] = outline.points
        self.clock = clock
        sampled = _sample(
            problem, outline, samples, seed, Clock(prm.max_time_share * clock.left, within=clock)
        )
        self.complete = len(sampled[0]) >= samples
        local = np.vstack([fixed, sampled[0]])
        self.milestones: Floats = local + np.append(outline.origin, 0.0)
        sampled_edges = np.asarray(sampled[1], dtype=np.int64).reshape(-1, 2) + len(fixed)
        self.edges: Ints = _exactly_free(
            np.unique(np.vstack([sampled_edges, _nearest_edges(local, len(fixed))]), axis=0),
            local,
            outline,
        )
        exact = np.vstack([np.column_stack([outline.places, fixed[:, 2]]), sampled[0]])
        self.augmented: AugmentedGraph = augment(
            self.milestones,
            self.edges,
            _edge_letters(self.edges, exact, outline.rays),
            problem.tether_length,
            prm.max_augmented if max_augmented is None else max_augmented,
            clock.flag,
        )
        self.complete &= self.augmented.complete
        self.cluster, self.signatures, self._vertex = self._classes()
        planar = self._taut_lengths(clock)
        z = problem.points[:, 2]
        self.tethers: Floats = np.hypot(planar, z[self.cluster] - z[0])
        self.shortcut = shortcut
        self._taut = TautLegs(self.paths, self.cluster, self.signatures, planar)

    def to_travel_graph(self) -> TravelGraph:
        """Return the travel graph over this roadmap. Tethers are the taut ones of their classes.
        Whether they fit is decided by the length along the roadmap, which is no shorter."""
        return TravelGraph(
            self.cluster,
            self.signatures,
            self.tethers,
            self,
            roadmap="prm",
            detours=self._detours,
            between=self.paths.bounds_in_any_class,
            classes="non-looping" if self.complete else "shortest",
            min_tether_left_out=math.inf if self.complete else 0.0,
        )

    def _taut_lengths(self, clock: Clock) -> Floats:
        """Return the planar length of the taut tether of every class.

        When the time is up, only the shortest class of every goal stays. Classes whose taut path is
        not found are left out, with a warning.
        """
        planar = np.zeros(len(self.cluster))
        for v in range(1, len(planar)):
            if clock.is_up:
                first = np.unique(self.cluster, return_index=True)[1]
                keep = np.union1d(np.arange(v), first)
                self._keep_classes(keep)
                rest = [self._taut_length(k) for k in range(v, len(keep))]
                planar = np.concatenate([planar[:v], rest])
                break
            planar[v] = self._taut_length(v)
        found = np.isfinite(planar)
        if found.all():
            return planar
        tethers = counted(int((~found).sum()), "state")
        warn_left_out(f"{tethers} of the tether left out: the taut path was not found")
        lost = sorted(set(self.cluster.tolist()) - set(self.cluster[found].tolist()))
        if lost:
            raise LimitReachedError(
                f"no taut tether was found in any class that reaches "
                f"{self.problem.goal_label(lost[0] - 1)}"
            )
        self._keep_classes(np.flatnonzero(found))
        return planar[found]

    def _keep_classes(self, chosen: Ints) -> None:
        """Leave out all classes but the chosen ones."""
        self.complete = False
        self.cluster, self._vertex = self.cluster[chosen], self._vertex[chosen]
        self.signatures = [self.signatures[k] for k in chosen]

    def _taut_length(self, v: int) -> float:
        """Return the planar length of the taut tether of a class; inf if its path is not found."""
        try:
            return self.paths.planar_length(0, int(self.cluster[v]), self.signatures[v])
        except UnknownPathError:
            return math.inf

    def _detours(
        self, with_sub_goals: bool, check: Callable[[], None], clock: Clock | None = None
    ) -> Detours:
        """Return the detours in any class along the milestones. Sub-goals are joined as base and
        goals are."""
        del clock  # nothing compiled takes long here
        places, side = sub_goals(self.problem, with_sub_goals, self.policy.detours)
        outline = self.paths.outline
        fixed = len(self.problem.points)
        local = self.milestones - np.append(outline.origin, 0.0)
        level = np.full((len(places), 1), local[0, 2])
        points = np.vstack([np.hstack([places, level]), local])
        new = _exactly_free(np.unique(_nearest_edges(points, len(places)), axis=0), points, outline)
        edges = np.vstack([new, self.edges + len(places)])
        points[len(places) : len(places) + fixed, :2] = outline.places
        graph = MilestoneGraph(points[:, :2], edges)
        terminals = np.concatenate([len(places) + np.arange(fixed), np.arange(len(places))])
        return tabulate_detours(self.problem, outline, graph, terminals, places, side, check)

    def _classes(self) -> tuple[Ints, list[Word], Ints]:
        """Return the augmented vertices that are at goals, base first: goals, words and
        vertices."""
        g = self.augmented
        goals = len(self.problem.goals)
        rows = np.flatnonzero((g.milestone >= 1) & (g.milestone <= goals))
        missing = sorted(set(range(1, goals + 1)) - set(g.milestone[rows].tolist()))
        if missing:
            # sampling proves nothing about reach, but the exact shortest tether does
            reach = self.paths.contacts.lengths([0])[0]
            points = self.problem.points
            needs = np.hypot(reach, points[:, 2] - points[0, 2])[: len(points)]
            beyond = [k for k in missing if needs[k] > self.problem.tether_length]
            if beyond:
                raise find_unreached_error(
                    self.problem, self.paths.outline, beyond, policy=self.policy
                )
            k = missing[0]
            more = f" and {len(missing) - 1} more goals" if len(missing) > 1 else ""
            raise LimitReachedError(
                f"no path over the prm roadmap reaches {self.problem.goal_label(k - 1)}{more} "
                f"within the tether ({needs[k]:.6g} of {self.problem.tether_length:g} would do); "
                "try more samples, or roadmap 'taut'"
            )
        rows = rows[np.lexsort((g.length[rows], g.milestone[rows]))]
        cluster = np.concatenate([[0], g.milestone[rows]]).astype(np.int64)
        words: list[Word] = [(), *(g.word(int(v)) for v in rows)]
        return cluster, words, np.concatenate([[0], rows]).astype(np.int64)

    def lengths(
        self, vertices: Ints, wanted: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return the (k, k) leg lengths along the augmented graph; inf within a cluster.

        Raises LimitReachedError when the clock is up before many are measured.
        """
        vertices = np.asarray(vertices, dtype=np.int64)
        if self.shortcut:
            return self._taut.lengths(vertices, wanted, clock)
        rows = self._vertex[vertices]
        check = partial(
            (clock or Clock()).check, f"measuring legs over {len(self.augmented)} states"
        )
        is_untimed = len(rows) <= self.policy.legs.untimed_vertices
        out = self.augmented.distances(rows, rows, (lambda: None) if is_untimed else check)
        out = np.minimum(out, out.T)  # equal but for the order of summation
        cluster = self.cluster[vertices]
        out[cluster[:, None] == cluster[None, :]] = np.inf
        return np.asarray(out)

    def to_base(self) -> Floats:
        """Return the (V,) lengths of the legs from the base."""
        if self.shortcut:
            return self._taut.to_base()
        return np.asarray(self.augmented.length[self._vertex])

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return (k, k) lower bounds on leg lengths: those of `TautLegs.lower_bounds`, as a leg
        along the roadmap is no shorter than the taut leg."""
        return self._taut.lower_bounds(vertices, rows, clock)

    def estimate(self, k: int) -> Estimate:
        """Return the estimate for all legs among k vertices: a search of the whole graph from each,
        or legs pulled taut one by one."""
        if self.shortcut:
            return super().estimate(k)
        prm = self.policy.prm
        return Estimate(
            k * (prm.s_per_search + prm.s_per_searched_state * len(self.augmented)), 8.0 * k * k
        )

    @cached_property
    def _before(self) -> Ints:
        """Return the (n,) predecessors of the augmented vertices on their shortest paths from the
        base."""
        return self.augmented.tree(int(self._vertex[0]))

    def _from_base(self, row: int) -> list[int]:
        out = [row]
        while out[-1] != self._vertex[0]:
            out.append(int(self._before[out[-1]]))
        return out[::-1]

    def path(self, u: int, v: int) -> Floats:
        """Return the (n, 3) polyline of the leg from vertex u to vertex v."""
        if self.shortcut:
            return self._taut.path(u, v)
        a, b = int(self._vertex[u]), int(self._vertex[v])
        if self._vertex[0] in (a, b):
            rows = self._from_base(b if a == self._vertex[0] else a)
            rows = rows if a == self._vertex[0] else rows[::-1]
        else:
            rows = self.augmented.path(a, b)
        out = self.milestones[self.augmented.milestone[rows]].copy()
        out[0] = self.problem.points[self.cluster[u]]
        out[-1] = self.problem.points[self.cluster[v]]
        return out


def _import_ompl() -> Any:
    try:
        from ompl import base, geometric, util
    except ImportError:
        raise InputError(
            "roadmap: 'prm' needs OMPL; install it with: pip install 'netsp[prm]'"
        ) from None
    return base, geometric, util


def sampling_box(problem: Problem) -> tuple[Floats, Floats]:
    """Return the lower and upper corner (3,) of the box in which milestones are drawn: the bounds,
    or what holds base, goals and obstacles with a tenth to spare, within reach of the tether."""
    points = problem.points
    if problem.bounds is not None:
        low2, high2 = np.array(problem.bounds[:2]), np.array(problem.bounds[2:])
    else:
        xy = [points[:, :2]]
        for o in problem.obstacles:
            if isinstance(o, Circle):
                xy.append(np.array(o.center) + np.array([[-1.0], [1.0]]) * o.radius)
            else:
                xy.append(np.array(o.polygon))
        corners = np.vstack(xy)
        low2, high2 = corners.min(axis=0), corners.max(axis=0)
        spare = 0.1 * float((high2 - low2).max()) + 2.0 * problem.clearance
        low2, high2 = low2 - spare, high2 + spare
    reach = problem.tether_length
    low2 = np.maximum(low2, points[0, :2] - reach)
    high2 = np.minimum(high2, points[0, :2] + reach)
    return np.append(low2, points[:, 2].min()), np.append(high2, points[:, 2].max())


def _sample(
    problem: Problem, outline: Outline, samples: int, seed: int, clock: Clock
) -> tuple[Floats, list[tuple[int, int]]]:
    """Return the milestones (n, 3) and edges of OMPL's PRM*."""
    ob, og, ou = _import_ompl()
    ou.noOutputHandler()
    # the generator is the process's own, but each planner's is seeded from it when made
    ou.RNG.setSeed(int(seed) % (2**32 - 2) + 1)
    low, high = sampling_box(problem)
    low, high = low - np.append(outline.origin, 0.0), high - np.append(outline.origin, 0.0)
    flat = bool(low[2] == high[2])
    size = 2 if flat else 3
    space = ob.RealVectorStateSpace(size)
    bounds = ob.RealVectorBounds(size)
    for k in range(size):
        bounds.setLow(k, float(low[k]))
        bounds.setHigh(k, float(high[k]))
    space.setBounds(bounds)
    info = ob.SpaceInformation(space)
    blockers = outline.blockers

    def is_valid(state: Any) -> bool:
        return bool(_point_free(state[0], state[1], blockers))

    info.setStateValidityChecker(is_valid)
    info.setStateValidityCheckingResolution(0.99)  # ends only: `_exactly_free` checks the rest
    info.setup()
    planner = og.PRMstar(info)
    query = ob.ProblemDefinition(info)
    planner.setProblemDefinition(query)
    planner.setup()
    if hasattr(planner, "growRoadmapPtc"):
        grow = planner.growRoadmapPtc
    else:  # pragma: no cover - other releases of OMPL overload one name
        grow = planner.growRoadmap
    grow(ob.PlannerTerminationCondition(lambda: planner.milestoneCount() >= samples or clock.is_up))
    data = ob.PlannerData(info)
    planner.getPlannerData(data)
    count = data.numVertices()
    points = np.full((count, 3), low[2])
    edges = []
    for i in range(count):
        state = data.getVertex(i).getState()
        for k in range(size):
            points[i, k] = state[k]
        edges += [(min(i, int(j)), max(i, int(j))) for j in data.getEdges(i)]
    return points, edges


def _nearest_edges(milestones: Floats, fixed: int) -> Ints:
    """Return edges from base and goals to their k nearest milestones, with k by the PRM* rule in d
    dimensions, k = e (1 + 1/d) ln n (Karaman & Frazzoli 2011, section 3.3)."""
    from scipy.spatial import KDTree

    n = len(milestones)
    d = 2 if np.ptp(milestones[:, 2]) == 0.0 else 3
    k = min(n, 1 + math.ceil(math.e * (1.0 + 1.0 / d) * math.log(max(n, 2))))
    _, near = KDTree(milestones).query(milestones[:fixed], k=k)
    near = np.asarray(near).reshape(fixed, k)
    pairs = np.column_stack([np.repeat(np.arange(fixed), near.shape[1]), near.ravel()])
    return np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1)


def _exactly_free(edges: Ints, milestones: Floats, outline: Outline) -> Ints:
    """Return the edges whose segment enters no grown obstacle."""
    return np.asarray(edges[_free_edges(edges, milestones, outline.blockers)])


@kernel
def _point_free(x: float, y: float, blockers: Blockers) -> bool:
    box = blockers.box
    for o in range(len(box)):
        if (
            box[o, 0] <= x <= box[o, 2]
            and box[o, 1] <= y <= box[o, 3]
            and depth_in_obstacle(x, y, o, blockers) > 0.0
        ):
            return False
    return True


@kernel
def _free_edges(pairs: Ints, points: Floats, blockers: Blockers) -> Bools:
    out = np.empty(len(pairs), dtype=np.bool_)
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        out[k] = not segment_blocked(
            points[a, 0], points[a, 1], points[b, 0], points[b, 1], blockers
        )
    return out


def _edge_letters(edges: Ints, milestones: Floats, rays: Floats) -> tuple[Ints, Ints]:
    """Return the letters of all edges in one array, and the row starts into it."""
    order = np.argsort(rays[:, 0], kind="stable")
    out, start = _all_letters(edges, milestones, rays, order)
    return out, start


@kernel
def _all_letters(edges: Ints, points: Floats, rays: Floats, order: Ints) -> tuple[Ints, Ints]:
    start = np.zeros(len(edges) + 1, dtype=np.int64)
    scratch = np.empty(len(rays) + 1, dtype=np.int64)
    for k in range(len(edges)):
        a, b = edges[k, 0], edges[k, 1]
        start[k + 1] = start[k] + segment_letters(
            points[a, 0], points[a, 1], points[b, 0], points[b, 1], rays, order, scratch, 0
        )
    out = np.empty(start[-1], dtype=np.int64)
    for k in range(len(edges)):
        a, b = edges[k, 0], edges[k, 1]
        segment_letters(
            points[a, 0], points[a, 1], points[b, 0], points[b, 1], rays, order, out, start[k]
        )
    return out, start
