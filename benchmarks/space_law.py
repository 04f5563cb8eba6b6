"""The law of bounds in space: no bound on all tours is above a tour that exists.

    python benchmarks/space_law.py [--scenes 200] [--seed 0] [--kinds posts rings …] [--part 0/1]
                                   [--folder build/space-law] [--plans-every 3] [--times 1]
                                   [--no-pyvrp] [--keep] [--cpu-limits]

Random scenes of many kinds (`random_scenes`). In each, paths between waypoints are found and
certified without netsp (`free_paths`), and the following are compared:

- the bound of each leg with the path of that leg;
- the bound that ignores the tether with the tour that PyVRP finds on the lengths of the paths, and
  with the shortest one by dynamic programming;
- the bound on all tours with tours along trees of paths, which need neither tether model nor judge,
  with tours that the tether model drives and the judge accepts, and with the tours of netsp.

Each scene is a file in the folder, so that a run can be continued. Several processes share the
scenes with `--part 0/2` and `--part 1/2`.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import traceback
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from free_paths import Box, FreePaths, length_of
from random_scenes import KINDS, random_scene
from solid_distances import Water, rooms_at, water_of
from table import ROOT, head, row, source
from tethered_tours import driven_tours, judged, order_by_pyvrp, shortest_order, tree_tour

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.base.errors import InputError, LimitReachedError
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_policy import StatePolicy
from netsp.plan.space.path_bound import LegBounds, _bound_without_tether, bound_all_tours
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.prisms import drive_plane_tours
from netsp.plan.space.space_legs import RobotPaths
from netsp.plan.space.space_plan import candidate_plans, prepare_context
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene

ROUNDING = 1e-7
"""Tolerance for the rounding of lengths: relative excess of a bound that counts as a violation."""


@dataclass(frozen=True)
class Effort:
    """Seconds and counts of one scene.

    Attributes
    ----------
    legs_s, bound_s, plan_s, drive_s
        Seconds for the bound that ignores the tether, for the bound on all tours, for the tours of
        netsp (0 for none), and for other tours with the tether model.
    plane_s
        Seconds for the tours of the plane among upright solids.
    points
        Number of random points of each kind in the visibility graph.
    variants
        Maximum number of paths between two places.
    """

    legs_s: float = 0.8
    bound_s: float = 1.5
    plan_s: float = 1.5
    drive_s: float = 1.0
    plane_s: float = 3.0
    points: int = 150
    variants: int = 3


@dataclass
class Outcome:
    """Comparisons in one scene.

    Attributes
    ----------
    kind, seed
        Scene.
    waypoints, legs
        Numbers of waypoints, and of legs that were compared.
    legs_above, tours_above
        Numbers of bounds of legs, and of bounds on all tours, above a path or tour that exists.
    leg_gaps
        Relative gaps of legs that are not straight.
    tsp, exact, without
        PyVRP's tour and the shortest one on the same lengths, and the bound that ignores the
        tether, metres; None if there is none.
    bound, tours
        Bound on all tours, and tours with a tether by their origin, metres.
    violations
        One line for each bound that is above.
    """

    kind: str
    seed: int
    waypoints: int = 0
    legs: int = 0
    legs_above: int = 0
    tours_above: int = 0
    leg_gaps: list[float] = field(default_factory=list)
    tsp: float | None = None
    exact: float | None = None
    without: float | None = None
    bound: float | None = None
    tours: dict[str, float] = field(default_factory=dict)
    violations: list[str] = field(default_factory=list)
    error: str = ""
    cpu_s: float = 0.0

    @property
    def shortest(self) -> float | None:
        """Return the shortest tour with a tether, metres."""
        return min(self.tours.values(), default=None)

    def note(self, what: str, bound: float | None, length: float | None) -> bool:
        """Note a bound that is above a length; return whether it is."""
        if bound is None or length is None or not bound > length * (1.0 + ROUNDING) + 1e-9:
            return False
        self.violations.append(f"{what}: bound {bound:.6f} above {length:.6f} m")
        return True


@dataclass
class Setting:
    """Mission of a random scene with the paths that were found.

    Attributes
    ----------
    mission, scene, water
        Mission with the length of its tether, its scene and solids.
    names
        Waypoint and alternative of each vertex; (-1, 0) for the start.
    cluster
        (v,) 0 for the start, else one more than the number of the waypoint.
    lengths
        (v, v) lengths of the paths, metres.
    paths
        The paths.
    left_s
        Length of tether that is left at the start, metres.
    """

    mission: Mission
    scene: Scene
    water: Water
    names: list[tuple[int, int]]
    cluster: Ints
    lengths: Floats
    paths: FreePaths
    tether_left: float


def setting_of(kind: str, seed: int, folder: Path, effort: Effort) -> Setting | None:
    """Return a random scene with paths between its waypoints; None if fewer than three waypoints
    can be reached."""
    drawn = random_scene(kind, seed, folder)
    scene, mission, water = drawn.scene, drawn.mission, water_of(drawn.scene)
    rng = np.random.default_rng([seed, 7])
    low, high = np.array([-np.inf] * 3), np.array([np.inf] * 3)
    if scene.bounds is not None:
        low, high = np.array(scene.bounds[:3]), np.array(scene.bounds[3:])
    box = Box(low, high, np.array(mission.anchor), np.inf)

    def search(mission: Mission, variants: int) -> tuple[FreePaths, Floats, list[tuple[int, int]]]:
        points, names = [mission.start], [(-1, 0)]
        for k, w in enumerate(mission.waypoints):
            for c, p in enumerate([w.position, *(v.position for v in w.alternatives)]):
                points.append(p)
                names.append((k, c))
        places = np.array(points, dtype=float)
        near = np.minimum(mission.clearance, rooms_at(water, places))
        rooms = np.minimum(near[:, None], near[None]) - 0.25 * mission.delta
        # few different values: a little more than the judge asks for, and less than the ends have
        step = 0.2 * mission.delta
        full = mission.clearance - 0.25 * mission.delta
        rooms = np.where(rooms < full - 1e-12, np.ceil(rooms / step) * step, full)
        rooms = np.maximum(0.0, np.minimum(rooms, full))
        paths = FreePaths(water, box, places, rooms, drawn.hints, rng, effort.points)
        return paths, paths.find(variants), names

    paths, lengths, names = search(mission, 1)
    reached = sorted({k for n, (k, _) in enumerate(names) if n and np.isfinite(lengths[0, n])})
    if len(reached) < 3:
        return None
    mission = mission.model_copy(update={"waypoints": tuple(mission.waypoints[k] for k in reached)})
    laid, anchor = 0.0, np.array(mission.anchor)
    if mission.anchor != mission.start:
        ends = np.array([mission.anchor, mission.start])
        laid = float(FreePaths(water, box, ends, np.zeros((2, 2)), drawn.hints, rng).find()[0, 1])
        if not np.isfinite(laid):
            return None
    paths, lengths, names = search(mission, effort.variants)
    cluster = np.array([k + 1 for k, _ in names])
    needed = max(
        min(lengths[0, n] for n in range(1, len(names)) if cluster[n] == c)
        for c in range(1, len(reached) + 1)
    )
    if not np.isfinite(needed):
        return None
    tether = laid + drawn.tether_ratio * needed + 2.0 * mission.delta
    for (i, j), lines in paths.paths.items():  # no path leads farther than the tether reaches
        paths.paths[i, j] = [p for p in lines if np.linalg.norm(p - anchor, axis=1).max() <= tether]
        lengths[i, j] = min((length_of(p) for p in paths.paths[i, j]), default=np.inf)
    np.fill_diagonal(lengths, 0.0)
    mission = mission.model_copy(update={"tether_length": tether})
    return Setting(mission, scene, water, names, cluster, lengths, paths, tether - laid)


def examine(
    kind: str, seed: int, folder: Path, effort: Effort, with_pyvrp: bool = True
) -> Outcome | None:
    """Compare all bounds of a random scene; None if its waypoints cannot be reached."""
    begin = time.process_time()
    setting = setting_of(kind, seed, folder, effort)
    if setting is None:
        return None
    found = Outcome(kind, seed, len(setting.mission.waypoints))
    (folder / f"{kind.replace(' ', '-')}-{seed}.mission.json").write_text(
        setting.mission.model_dump_json(exclude_none=True, indent=1), encoding="utf-8"
    )
    try:
        field_ = setting.scene.field()
        context = prepare_context(setting.mission, Clock(), scene=setting.scene, field=field_)
        _compare(found, setting, context, effort, with_pyvrp)
    except (InputError, LimitReachedError) as error:
        found.error = str(error)
    found.cpu_s = time.process_time() - begin
    return found


def _compare(
    found: Outcome, setting: Setting, context: PlanningContext, effort: Effort, with_pyvrp: bool
) -> None:
    """Compare legs, tours without a tether, and tours with one."""
    places = Places.for_mission(context.mission, context.field)
    known = RobotPaths(context, places, StatePolicy().effort(len(places)))
    laid = context.start_tether.nodes
    for n in range(len(places)):
        known.tethers[n] = [np.vstack([laid, p[1:]]) for p in setting.paths.paths[0, n + 1][:1]]
    every = list(range(len(context.mission.waypoints)))
    _compare_legs(found, setting, known, Clock(effort.legs_s), with_pyvrp)
    for origin, length in _tours(setting, context, known, effort):
        found.tours[origin] = min(length, found.tours.get(origin, np.inf))
    found.bound = bound_all_tours(known, every, Clock(effort.bound_s))
    for origin, length in found.tours.items():
        found.tours_above += found.note(f"tour ({origin})", found.bound, length)


def _compare_legs(
    found: Outcome, setting: Setting, known: RobotPaths, clock: Clock, with_pyvrp: bool
) -> None:
    """Compare what ignores the tether."""
    legs = LegBounds(known, list(range(len(known.places))), known.context.policy.potential)
    found.without = _bound_without_tether(legs, clock, 0)
    for u, v in zip(*np.triu_indices(len(legs.points), 1), strict=True):
        length = float(setting.lengths[u, v])
        if not np.isfinite(length):
            continue
        found.legs += 1
        straight = float(np.linalg.norm(legs.points[u] - legs.points[v]))
        if length > (1.0 + 1e-6) * straight + 1e-9:
            found.leg_gaps.append(1.0 - float(legs.costs[u, v]) / length)
        found.legs_above += found.note(f"leg {u} to {v}", float(legs.costs[u, v]), length)
    exact, _ = shortest_order(setting.lengths, setting.cluster)
    found.exact = exact if np.isfinite(exact) else None
    found.tours_above += found.note("dynamic programming", found.without, found.exact)
    if with_pyvrp:
        tsp, _ = order_by_pyvrp(setting.lengths, setting.cluster)
        found.tsp = tsp if np.isfinite(tsp) else None
        found.tours_above += found.note("PyVRP", found.without, found.tsp)


def _tours(
    setting: Setting, context: PlanningContext, known: RobotPaths, effort: Effort
) -> Iterator[tuple[str, float]]:
    """Yield the origins and lengths of tours with a tether."""
    tree = tree_tour(setting.paths, setting.lengths, setting.cluster, setting.tether_left)
    if np.isfinite(tree):
        yield "tree", tree
    deadline = time.process_time() + effort.drive_s
    orders = _orders(setting)
    shortest, _ = shortest_order(setting.lengths, setting.cluster)
    for driven in driven_tours(
        context, setting.paths, setting.names, orders, lambda: time.process_time() > deadline
    ):
        if judged(driven, context, setting.scene) is not None:
            yield "driven", driven.length
            if driven.length <= shortest * (1.0 + 1e-9):
                break  # no tour along these paths is shorter
    in_plane = drive_plane_tours(
        context, setting.scene, known.places, Clock(effort.plane_s), whole_tether=True
    )
    for driven in in_plane:
        if judged(driven, context, setting.scene) is not None:
            yield "netsp, plane", driven.length
            break
    if effort.plan_s <= 0.0:
        return
    try:
        for plan in candidate_plans(
            context.mission, scene=setting.scene, context=context, clock=Clock(effort.plan_s),
            whole_tether=True,
        ):  # fmt: skip
            known._known.update(plan.paths._known)
            is_whole = len(plan.order) == len(context.mission.waypoints)
            if is_whole and verify_mission(plan.to_mission(), scene=setting.scene, context=context):
                yield f"netsp, {plan.kind}", plan.length
    except (InputError, LimitReachedError):
        return


def _orders(setting: Setting) -> Iterator[list[int]]:
    """Yield orders of vertices: the shortest, in both directions, and others that are short by
    lengths which are off by up to a third."""
    rng = np.random.default_rng(0)
    for k in range(6):
        noise = rng.uniform(1.0, 1.0 + 0.12 * k * (k > 0), setting.lengths.shape)
        lengths = setting.lengths * np.sqrt(noise * noise.T)
        length, order = shortest_order(lengths, setting.cluster)
        if not np.isfinite(length):
            return
        yield order
        yield order[::-1]


def outcome_of(kind: str, seed: int, folder: Path, effort: Effort, with_pyvrp: bool) -> Outcome:
    """Return the outcome of the scene of a seed, or of the next seed that has waypoints in reach;
    read it from its file if there is one."""
    file = folder / f"{kind.replace(' ', '-')}-{seed}.outcome.json"
    if file.exists():
        return Outcome(**json.loads(file.read_text(encoding="utf-8")))
    found = None
    for further in range(20):
        found = examine(kind, seed + 1000 * further, folder, effort, with_pyvrp)
        if found is not None:
            break
    assert found is not None, f"{kind} {seed}: no waypoints in reach"
    found.seed = seed + 1000 * further
    file.write_text(json.dumps(asdict(found), indent=1), encoding="utf-8")
    return found


def _shown(values: list[float], scale: float = 100.0) -> tuple[str, str]:
    """Return median and maximum."""
    if not values:
        return "", ""
    return f"{scale * float(np.median(values)):.1f}", f"{scale * max(values):.1f}"


def table(outcomes: list[Outcome], name: str | None) -> None:
    """Print a row for each kind, and one for all."""
    head("kind", "scenes", "waypoints", "legs", "bounds of legs above", "TSP tours",
         "bounds above", "tours with a tether", "bounds above", "gap %, median", "gap %, most",
         "CPU s", name=name)  # fmt: skip
    for kind in [*KINDS, "all"]:
        rows = [o for o in outcomes if kind in (o.kind, "all")]
        if not rows:
            continue
        gaps = [max(0.0, 1.0 - (o.bound or 0.0) / o.shortest) for o in rows if o.shortest]
        without = [v for o in rows for v in o.violations if v.startswith(("PyVRP", "dynamic"))]
        tethered = sum(o.tours_above for o in rows) - len(without)
        row(kind, len(rows), sum(o.waypoints for o in rows), sum(o.legs for o in rows),
            sum(o.legs_above for o in rows), sum((o.tsp or o.exact) is not None for o in rows),
            len(without), sum(len(o.tours) for o in rows), tethered, *_shown(gaps),
            f"{sum(o.cpu_s for o in rows):.0f}")  # fmt: skip


def main() -> int:
    """Compare, print, and return 1 if a bound is above."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--part", default="0/1", help="K/N: every N-th scene, from the K-th on")
    parser.add_argument("--folder", type=Path)
    parser.add_argument(
        "--plans-every",
        type=int,
        default=3,
        metavar="N",
        help="judge tours of netsp in every N-th scene of a kind; 0 for none",
    )
    parser.add_argument("--times", type=float, default=1.0, help="factor of all seconds")
    parser.add_argument("--no-pyvrp", action="store_true")
    args = parser.parse_args()
    part, parts = (int(v) for v in args.part.split("/"))
    folder = args.folder or ROOT / "build" / "space-law" / source()["commit"]
    folder.mkdir(parents=True, exist_ok=True)
    full = Effort()
    effort = Effort(
        *(args.times * s for s in (full.legs_s, full.bound_s, full.plan_s, full.drive_s))
    )
    without_plans = replace(effort, plan_s=0.0)
    outcomes: list[Outcome] = []
    for n in range(args.scenes):
        if n % parts != part:
            continue
        kind, seed = args.kinds[n % len(args.kinds)], args.seed + n // len(args.kinds)
        has_plans = args.plans_every and (n // len(args.kinds)) % args.plans_every == 0
        try:
            found = outcome_of(
                kind, seed, folder, effort if has_plans else without_plans, not args.no_pyvrp
            )
        except Exception:
            print(f"{kind} {seed}: {traceback.format_exc()}", file=sys.stderr, flush=True)
            continue
        outcomes.append(found)
        shortest = "none" if found.shortest is None else f"{found.shortest:.3f}"
        bound = "none" if found.bound is None else f"{found.bound:.3f}"
        print(
            f"{found.kind} {found.seed}: bound {bound}, tour {shortest} m {found.error}"
            f" {found.cpu_s:.1f} s {'; '.join(found.violations)}",
            file=sys.stderr, flush=True,
        )  # fmt: skip
    table(outcomes, "space-law" if parts == 1 else None)
    above = sum(o.legs_above + o.tours_above for o in outcomes)
    print(f"\nbounds above a path or tour that exists: {above}")
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main())
