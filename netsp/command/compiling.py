"""Says what is being compiled, and compiles everything ahead.

numba compiles a kernel the first time that it is called on a machine, and keeps the result beside
the source or in `NUMBA_CACHE_DIR`. Without a word that looks like a program that hangs.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, TextIO

EVERY = 2.0
"""Seconds between two lines."""


@contextmanager
def compile_messages(stream: TextIO) -> Iterator[None]:
    """While the body runs, lines on a stream that name what is being compiled."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        def __init__(self) -> None:
            self.last = -EVERY

        def on_start(self, record: Any) -> None:
            now = time.monotonic()
            if now - self.last < EVERY:
                return
            kernel = record.data["dispatcher"].py_func
            if kernel.__module__.startswith("netsp."):
                once = " (once per machine; `netsp warm-up` does it ahead of time)"
                name = kernel.__module__.removeprefix("netsp.")
                print(
                    f"compiling {name}.{kernel.__name__} …{once if self.last < 0.0 else ''}",
                    file=stream, flush=True,
                )  # fmt: skip
                self.last = now

        def on_end(self, record: Any) -> None:
            pass

    listener = Listener()
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)


def steps() -> Iterator[tuple[str, Callable[[], object]]]:
    """What to run so that all kernels are compiled, with names."""
    import numpy as np

    from netsp.errors import InputError, LimitReachedError
    from netsp.fly.rehearsal import rehearse
    from netsp.guard.rehearsal import rehearse as watched
    from netsp.judge import verify
    from netsp.mip.prices import Prices
    from netsp.mip.program import Duals
    from netsp.online import ReactTether, Scene
    from netsp.online.equipment import TetherPhysics
    from netsp.online.mission import Mission
    from netsp.online.simulate import simulate
    from netsp.solvers.solve import solve, travel_graph
    from netsp.solvers.table import SOLVERS
    from netsp.space.solve import solve_mission
    from netsp.worlds import random_world

    problem = random_world(1, goals=9, tether_length=450.0)
    polygons = random_world(1, family="harbour", goals=4, tether_length=250.0)
    for solver in SOLVERS:
        # on a busy machine a time limit alone would leave kernels out
        yield (
            f"solver {solver}",
            partial(solve, problem, solver, iteration_limit=20_000, time_limit=60.0),
        )
    fewer = problem.model_copy(update={"goals": problem.goals[:6]})
    for solver in ("dp", "mip"):
        yield f"solver {solver}, measured legs", partial(solve, fewer, solver, iteration_limit=4)
    yield (
        "solver dp, to the end",
        partial(solve, random_world(2, goals=12, tether_length=300.0), "dp", iteration_limit=30),
    )

    def rounded() -> None:
        graph = travel_graph(fewer)
        costs, clusters = graph.costs_rounded(np.arange(len(graph))), graph.goal_count + 1
        duals = Duals(np.zeros(clusters), np.zeros(len(costs)), np.zeros(0))
        prices = Prices(costs, np.isinf(costs), graph.cluster, [], duals)
        prices.rule_out(1.0)
        prices.of(prices.cheapest(-1.0)[0])

    yield "thousands of classes", rounded
    yield "polygons and the judge", lambda: verify(polygons, solve(polygons))

    def sampled() -> None:
        # OMPL is an extra, and so few samples may miss a goal
        with suppress(InputError, LimitReachedError):
            solve(polygons, roadmap="prm", roadmap_options={"samples": 300}, time_limit=5.0)

    yield "sampled roadmap", sampled
    yield "tours carried out", rehearse
    solids = [{"capsule": {"a": (0, 0, -3), "b": (0, 0, 3), "radius": 0.5}},
              {"box": {"center": (3, 0, 0), "size": (1, 1, 1)}}]  # fmt: skip
    scene = Scene.model_validate({"schema_version": 1, "name": "warm-up", "solids": solids})
    angle = np.linspace(np.pi, np.pi + 5.0, 12)
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0.1 * angle])
    mission = Mission.model_validate(
        {"schema_version": 1, "scene": "-", "anchor": (-2, 0, 0), "start": (-1.9, 0, 0),
         "tether_length": 4.5, "waypoints": ring.tolist(), "camera": {"range": 2.0}, "speed": 0.5,
         "tether": {"slack": 0.01, "diameter": 0.01, "pulls_vehicle": True},
         "current": (0.1, 0, 0)}
    )  # fmt: skip
    plain = mission.model_copy(update={"tether": TetherPhysics()})
    for planner, vehicle in (("predictive", "kinematic"), ("react", "bluerov2")):
        yield (
            f"missions, {planner}, {vehicle}",
            partial(simulate, plain, planner, vehicle=vehicle, scene=scene),
        )
    yield "a tether in a current", partial(simulate, mission, vehicle="bluerov2", scene=scene)

    yield (
        "tours in space",
        partial(solve_mission, plain.model_copy(update={"waypoints": plain.waypoints[:4]}),
                scene=scene, time_limit=20.0),
    )  # fmt: skip

    for in_space in (False, True):
        yield f"a guard in {'space' if in_space else 'a site'}", partial(watched, in_space)

    def paper() -> None:
        model = ReactTether(scene.field(), 0.1)
        model.update(model.start((-2, 0, 0), (-1, 0, 0)), (-1, -1, 0))

    yield "the paper's tether", paper
