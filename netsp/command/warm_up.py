"""`netsp warm-up`: compile all kernels ahead of their first use."""

from __future__ import annotations

import argparse
import contextlib
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial

Step = tuple[str, Callable[[], object]]
"""Name of a step, and the step."""

STEP_WORDS = {
    "simulate": "mission",
    "cover": "space",
    "execute": "carried out",
    "fly": "carried out",
    "guard": "guard",
}
"""Word in the names of the steps that a command needs, by command; other commands need `solver`."""


def run(args: argparse.Namespace) -> int:
    """Compile, and return the exit code."""
    from netsp.base.compiled.compile_policy import everything_compiled
    from netsp.command.background_warm_up import alone
    from netsp.command.compiling import CompileTimes

    times = CompileTimes()
    with everything_compiled(), times.measured():
        if args.after is None:
            with _other_processes(args.jobs) if not args.part else contextlib.nullcontext():
                _compile(_part_first(list(steps()), args.part, args.jobs), args.quiet)
        else:
            with alone() as is_alone:
                if is_alone:
                    _compile_likely(args.after)
    if args.list:
        _print_times(times.seconds)
    return 0


@contextlib.contextmanager
def _other_processes(jobs: int) -> Iterator[None]:
    """Have further processes compile while the body runs, and wait for them.

    These processes are silent, because the body runs all steps too and reports their errors.
    """
    command = [sys.executable, "-m", "netsp", "warm-up", "--quiet", "--jobs", str(jobs), "--part"]
    processes = [
        subprocess.Popen([*command, str(part)], stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for part in range(1, jobs)
    ]
    try:
        yield
        for process in processes:
            process.wait()
    finally:
        for process in processes:
            process.terminate()


def _part_first(all_steps: list[Step], part: int, jobs: int) -> list[Step]:
    """Return all steps, first the part of one of several processes.

    No kernel is compiled twice: a process waits for a kernel that another one is compiling.
    """
    return all_steps[part::jobs] + [step for k, step in enumerate(all_steps) if k % jobs != part]


def _compile(all_steps: list[Step], quiet: bool) -> None:
    """Run all steps and show their progress."""
    from netsp.command.compiling import PreparationPolicy
    from netsp.command.patience import span
    from netsp.command.status_line import status_line

    policy, begin = PreparationPolicy(), time.monotonic()
    printed_at = begin
    with contextlib.nullcontext() if quiet else status_line() as line:
        for done, (name, step) in enumerate(all_steps):
            now = time.monotonic()
            left = (
                f", about {span((now - begin) / done * (len(all_steps) - done))} left"
                if done
                else ""
            )
            text = f"preparing netsp: {name} ({done + 1} of {len(all_steps)}{left})"
            if line is not None:
                line.show(f"{policy.bar(done / len(all_steps), line.columns)} {text}")
            elif not quiet and (not done or now - printed_at >= policy.every_s):
                print(text, file=sys.stderr, flush=True)
                printed_at = now
            step()


def _compile_likely(command: str) -> None:
    """Run all steps in the order of `_likely_first`, until the disk is full."""
    from netsp.base.compiled.tiered import TieredDispatcher

    for _, step in _likely_first(list(steps()), command):
        if not TieredDispatcher.is_disk_full:
            step()


def _likely_first(all_steps: list[Step], command: str) -> list[Step]:
    """Return all steps, beginning with the likely needs of a user of the command."""
    words = STEP_WORDS.get(command, "solver")
    return sorted(all_steps, key=lambda step: words not in step[0])


def _print_times(seconds: dict[str, float]) -> None:
    """Print all kernels by compile time, longest first."""
    from netsp.base.compiled.kernel import all_kernels
    from netsp.command.compiling import kernel_name

    names = {kernel_name(kernel) for kernel in all_kernels()} | set(seconds)
    for name in sorted(names, key=lambda name: (-seconds.get(name, 0.0), name)):
        spent = f"{seconds[name]:7.2f}" if name in seconds else f"{'-':>7}"
        print(f"{spent}  {name}")
    print(f"{sum(seconds.values()):7.2f}  total, {len(names)} functions")


def steps() -> Iterator[Step]:
    """Yield named steps that together compile all kernels."""
    import numpy as np

    from netsp.base.errors import InputError, LimitReachedError
    from netsp.gtsp.limits import Limits
    from netsp.gtsp.sparse_costs import SparseCosts
    from netsp.judge import verify
    from netsp.mip.cover_costs import ClassCovers, PathCovers
    from netsp.mip.covers import refine_covers
    from netsp.mip.deadlegs import DeadLegs
    from netsp.mip.parity_cuts import odd_numbers
    from netsp.mip.prices import Prices
    from netsp.mip.program import Duals
    from netsp.online.fly.flight_rehearsal import rehearse
    from netsp.online.guard.guard_rehearsal import rehearse as rehearse_guard
    from netsp.plan.cover import cover
    from netsp.plan.cover.cover_policy import CoverPolicy, TourSearchPolicy
    from netsp.plan.random_worlds import random_world
    from netsp.plan.solve_problem import solve, solve_graph, travel_graph
    from netsp.plan.solver_table import SOLVERS
    from netsp.plan.space.mission_policy import MissionPolicy, PotentialPolicy
    from netsp.plan.space.mission_solver import solve_mission
    from netsp.roadmap.outline import build_outline
    from netsp.roadmap.roadmap_policy import SightPolicy
    from netsp.roadmap.tangents import tangent_rows
    from netsp.roadmap.travel_graph import TravelGraph
    from netsp.world import ReactTether, Scene
    from netsp.world.mission.equipment import TetherPhysics
    from netsp.world.mission.mission import Mission
    from netsp.world.scene import voxels
    from netsp.world.scene.field import DistanceField
    from netsp.world.simulator.mission_run import simulate
    from netsp.world.simulator.surprises import SceneSurprises

    problem = random_world(1, goals=9, tether_length=450.0)
    polygons = random_world(1, family="harbour", goals=4, tether_length=250.0)
    fewer, fewest = (problem.model_copy(update={"goals": problem.goals[:k]}) for k in (6, 3))
    for solver in SOLVERS:
        # the published program refuses the many legs of the larger problem
        world = fewest if solver == "mip-2017" else problem
        # with a time limit alone, a busy machine would not call all kernels
        yield (
            f"solver {solver}",
            partial(solve, world, solver, iteration_limit=2_000, time_limit=60.0),
        )
    for solver in ("dp", "mip"):
        yield f"solver {solver}, measured legs", partial(solve, fewer, solver, iteration_limit=4)
    yield (
        "solver dp, to the end",
        partial(solve, random_world(2, goals=12, tether_length=300.0), "dp", iteration_limit=30),
    )

    def compile_sparse_costs() -> None:
        graph = travel_graph(fewer)
        costs, clusters = graph.costs_rounded(np.arange(len(graph))), graph.goal_count + 1
        duals = Duals(np.zeros(clusters), np.zeros(len(costs)), np.zeros(0))
        none = np.zeros(len(graph), dtype=np.int64)
        rows = SparseCosts(
            len(graph), graph.costs_in_blocks(), none, np.full((1, 1), np.inf), none[:1]
        )
        rows.add_above(none, np.zeros((1, 1), dtype=bool))
        rows.nearest_legs(1)
        odd = odd_numbers(graph.labels)
        covers = ClassCovers(rows, graph.cluster, odd)
        cells = covers.cells(())
        covers.costs(cells)
        covers.costs_by_parity(cells, np.array([[0, 1]]))
        for held in DeadLegs.missing(costs), rows:
            prices = Prices(costs, held, graph.cluster, [], duals)
            prices.max_increases(1.0)
            prices.fix_out(1.0)
            prices.reduced_costs(prices.most_negative(-1.0)[0])
        rows.restrict(rows.with_legs())
        legs = rows.legs_left()
        rows.costs_of(legs[:, 0], legs[:, 1])

    yield "thousands of classes", compile_sparse_costs

    def compile_covers() -> None:
        graph = travel_graph(random_world(3, goals=4, tether_length=200.0))
        best = solve_graph(graph, "mip")
        assert best.length is not None
        assert graph.parity_oracle is not None
        odd, paths = odd_numbers(graph.labels), graph.parity_oracle(lambda: False)
        assert paths is not None
        visited = [(int(graph.cluster[v]), odd[v]) for v in best.tour or ()]
        for covers in ClassCovers(graph.costs, graph.cluster, odd), PathCovers(paths, np.inf):
            refine_covers(covers, visited, 1.02 * best.length, Limits())

    yield "covers", compile_covers

    def compile_cost_matrices() -> None:
        graph = travel_graph(fewer)
        for solver in ("dp", "mip"):
            solve_graph(TravelGraph.from_costs(graph.costs, graph.cluster), solver)

    yield "matrices of costs", compile_cost_matrices
    yield "polygons and the judge", lambda: verify(polygons, solve(polygons))

    def compile_horizons() -> None:
        outline = build_outline(polygons)
        policy = SightPolicy(min_pairs=0)
        tangent_rows(outline, outline.arcs, outline.full, np.inf, policy=policy)

    yield "thousands of corners", compile_horizons

    def compile_sampled_roadmap() -> None:
        # OMPL is an extra, and so few samples may miss a goal
        with contextlib.suppress(InputError, LimitReachedError):
            solve(polygons, roadmap="prm", roadmap_options={"samples": 300}, time_limit=5.0)

    yield "sampled roadmap", compile_sampled_roadmap
    yield "tours carried out", rehearse
    solids = [
        {"capsule": {"a": (0, 0, -3), "b": (0, 0, 3), "radius": 0.5}},
        {"box": {"center": (3, 0, 0), "size": (1, 1, 1)}},
    ]
    scene = Scene.model_validate({"schema_version": 1, "name": "warm-up", "solids": solids})
    angle = np.linspace(np.pi, np.pi + 5.0, 12)
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0.1 * angle])
    mission = Mission.model_validate(
        {
            "schema_version": 1,
            "scene": "-",
            "anchor": (-2, 0, 0),
            "start": (-1.9, 0, 0),
            "tether_length": 4.5,
            "waypoints": ring.tolist(),
            "camera": {"range": 2.0},
            "speed": 0.5,
            "tether": {"slack": 0.01, "diameter": 0.01, "pulls_vehicle": True},
            "current": (0.1, 0, 0),
        }
    )
    plain_mission = mission.model_copy(update={"tether": TetherPhysics()})
    for planner, vehicle in (("predictive", "kinematic"), ("react", "bluerov2")):
        yield (
            f"missions, {planner}, {vehicle}",
            partial(simulate, plain_mission, planner, vehicle=vehicle, scene=scene),
        )
    yield "a tether in a current", partial(simulate, mission, vehicle="bluerov2", scene=scene)

    yield (
        "tours in space",
        partial(
            solve_mission,
            plain_mission.model_copy(update={"waypoints": plain_mission.waypoints[:4]}),
            scene=scene,
            time_limit=None,
        ),
    )

    # a ring has a loop, and the box has edges that a leg goes around
    torus = {"center": (0, 0, 0), "axis": (1, 0, 0), "major_radius": 0.8, "minor_radius": 0.1}
    loop = {"torus": torus}
    box = {"box": {"center": (2.2, 0, 0), "size": (0.6, 1.6, 1.6)}}
    loops = Scene.model_validate({"solids": [loop, box], "bounds": [-4, -4, -4, 4, 4, 4]})
    around_loops = Mission.model_validate(
        {
            "scene": "-",
            "anchor": (-2.5, 0.3, 0.2),
            "start": (-2.5, 0.3, 0.2),
            "tether_length": 11.0,
            "waypoints": [(3.2, 0.1, 0.0), (0.3, 0.9, 0.6)],
            "clearance": 0.25,
            "cell": 0.3,
            "range_sensor": {},
        }
    )
    few_cells = MissionPolicy(potential=PotentialPolicy(max_cells=15_000))
    yield (
        "bounds in space",
        partial(solve_mission, around_loops, scene=loops, time_limit=None, policy=few_cells),
    )
    appears = {"time": 0, "appear": {"sphere": {"center": (1.5, 0, 0), "radius": 0.2}}}
    surprises = SceneSurprises.model_validate({"schema_version": 1, "events": [appears]})
    yield (
        "missions, range sensor",
        partial(simulate, around_loops, scene=loops, surprises=surprises),
    )

    few_rounds = CoverPolicy(max_candidates=300, tours=TourSearchPolicy(max_rounds=20))
    yield (
        "waypoints of a structure in space",
        partial(cover, scene, anchor=mission.anchor, camera=mission.camera, policy=few_rounds),
    )

    for in_space in (False, True):
        yield f"a guard in {'space' if in_space else 'a site'}", partial(rehearse_guard, in_space)

    def compile_voxels() -> None:
        corners = np.array(np.meshgrid((0, 12), (0, 0.5), (0, 0.5), indexing="ij"))
        triangles = "013 032 467 475 045 051 237 276 026 064 157 173"
        faces = [tuple(map(int, corners_of)) for corners_of in triangles.split()]
        # the bar lies along the diagonal of its box, most of which is empty: with little memory
        # the grid holds only voxels near surfaces, and uses other kernels
        turn = np.linalg.qr(np.ones((3, 1)), mode="complete")[0].T
        bar = corners.reshape(3, 8).T @ turn
        points = np.random.default_rng(1).uniform(size=(5000, 3)) * (12, 0.5, 0.5)
        points[:, 1] = np.where(points[:, 1] < 0.25, 0.0, 0.5)
        for scarce in (False, True):
            for grid in (
                voxels.grid_of_triangles(
                    bar, faces, voxel=0.1, memory_limit=0.01 if scarce else 1.0
                ),
                voxels.grid_of_cloud(
                    points @ turn, voxel=0.1, memory_limit=0.018 if scarce else 1.0
                ),
            ):
                assert (grid.table is not None) == scarce
                DistanceField.build([], [], np.empty((0, 4)), [], grid, 0.0).distance(bar)

    yield "meshes and clouds", compile_voxels

    def compile_react_tether() -> None:
        model = ReactTether(scene.field(), 0.1)
        model.update(model.start((-2, 0, 0), (-1, 0, 0)), (-1, -1, 0))

    yield "the paper's tether", compile_react_tether
