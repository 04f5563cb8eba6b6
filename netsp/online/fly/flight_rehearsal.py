"""Rehearsal: an example tour with all kinds of events is carried out before a flight.

On a machine that never flew, everything that a flight needs is compiled at its first use, a minute
or
two in all. A vehicle that waits for its next target drifts meanwhile, so `netsp fly` opens no link
until this is done.
"""

from __future__ import annotations

from functools import cache

from netsp.base.compiled.compile_policy import compiles, everything_compiled
from netsp.base.interrupt_signals import remembered_interrupts
from netsp.model.problem import Problem
from netsp.online.execute.events import Surprises
from netsp.online.execute.execution_log import ExecutionOptions
from netsp.online.execute.tour_execution import execute
from netsp.plan.solve_problem import solve

_SITE = {
    "schema_version": 1,
    "base": [0, 0],
    "tether_length": 14,
    "goals": [[4, 1, -1], [6, -2, -2], [9, 0, -1]],
    "obstacles": [
        {"name": "pile", "center": [2, 0], "radius": 0.5},
        {"name": "pier", "polygon": [[5, 0], [6, 0], [6, 1], [5, 1]]},
        *({"center": [x, 9], "radius": 0.3} for x in range(-3, 6)),
    ],
}
"""Problem with enough obstacles that they are looked up by place."""

_EVENTS = {
    "schema_version": 1,
    "events": [
        {"time": 1, "appear": {"center": [3, 0.8], "radius": 0.3}},
        {"time": 2, "add_goal": [8, 2, -1]},
        {"time": 3, "move": {"obstacle": "pier", "by": [0.2, 0.1]}},
        {"time": 4, "push": [0.1, 0.1, 0]},
        {"time": 5, "cancel_goal": 1},
        {"time": 6, "vanish": "pile"},
        {"time": 7, "tether_length": 12.5},
    ],
}


@cache
def rehearse() -> None:
    """Load everything that a flight needs, and compile it on a machine that never flew.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C was pressed; planning and flying would treat it as a request to end early.
    """
    if not compiles():
        return
    site = Problem.model_validate(_SITE)
    with remembered_interrupts() as check, everything_compiled():
        tour = solve(site)
        check()
        execute(
            site,
            tour,
            ExecutionOptions(speed=0.5, reach=0.3),
            surprises=Surprises.model_validate(_EVENTS),
            on_step=lambda _: check(),
        )
