"""Warm-up of repairs: compiles what they need, which would otherwise take planning time."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from netsp.base.compiled.compile_policy import compiles, everything_compiled
from netsp.base.compiled.kernel import runs_compiled
from netsp.base.interrupt_signals import remembered_interrupts
from netsp.gtsp.dp.label_kernels import extend
from netsp.model.problem import Circle, Goal, Problem, State
from netsp.online.execute.execute_policy import RepairPolicy
from netsp.online.execute.tour_repair import RepairOptions, repair
from netsp.plan.random_worlds import random_world
from netsp.plan.solve_problem import solve_graph
from netsp.roadmap.from_state import graph_from_state

_SOLVERS = (("dp", None), ("mip", None), ("lns", 200), ("auto", 30))
"""Solvers with iteration limits, which together call everything that a new order may need."""


def should_warm_up_repair() -> bool:
    """Return whether to warm up before a simulated tour: only where kernels are on disk.

    On a machine that has compiled nothing yet, `warm_up_repair` would take a minute, so a simulated
    tour runs interpreted until compiling pays. Flights always call `warm_up_repair`.
    """
    return runs_compiled(extend)


@cache
def warm_up_repair() -> None:
    """Load everything that a repair needs, and compile it on a machine that never did.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C, which solvers alone would take for the wish to have what there is.
    """
    if not compiles():
        return
    tiny = Problem(
        base=(0.0, 0.0, 0.0),
        goals=(Goal(position=(4.0, 0.0, 0.0)), Goal(position=(4.0, 3.0, 0.0))),
        tether_length=9.0,
        obstacles=(Circle(center=(2.0, 1.0), radius=0.5), Circle(center=(3.0, 2.0), radius=0.5)),
    )
    world = random_world(1, goals=9, tether_length=450.0)
    begun = State(position=world.goals[0].position, signature=())
    with remembered_interrupts() as check, everything_compiled():
        repair(
            tiny,
            np.array([4.0, 0.0, 0.0]),
            np.array([[0.0, 0, 0], [4, 0, 0]]),
            [0, 1],
            "",
            RepairOptions(1.0, policy=RepairPolicy(time_limit_s=math.inf)),
        )
        graph = graph_from_state(world.model_copy(update={"state": begun}))
        for solver, iterations in _SOLVERS:
            check()
            solve_graph(graph, solver, iteration_limit=iterations)
