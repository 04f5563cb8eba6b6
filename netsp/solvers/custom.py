"""Solvers third-party: any callable that takes a travel graph."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from inspect import Parameter
from types import MappingProxyType
from typing import Any

from netsp.errors import InputError
from netsp.solution import Status
from netsp.solving.limits import Limits
from netsp.solving.run import SolverRun
from netsp.travel.graph import TravelGraph
from netsp.travel.result import Result

VARIADIC = (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)


def call(
    solver: Callable[..., Any], name: str, graph: TravelGraph, params: Mapping[str, Any] | None,
    limits: Limits,
) -> Result:  # fmt: skip
    """Call a solver with the graph and whatever it asks for by name: `params` (a mapping),
    `limits`, or a field of `limits` such as `rng`.

    It returns a `Result`, or a tour as vertices from 0 on (then no bound is claimed), or None if it
    found none. A tour is checked against the graph, and its length is measured here. A bound cannot
    be checked: it is taken at its word, but never above the tour's length.

    Raises
    ------
    InputError
        Options for a solver that takes none; an argument asked for that there is not; something
        returned that is neither.
    """
    fields = {"params": dict(params or {}), "limits": limits}
    fields |= {k: getattr(limits, k) for k in ("time", "iterations", "rng", "warm_start")}
    try:
        asked = inspect.signature(solver).parameters
    except (TypeError, ValueError):  # compiled, and does not say what it takes
        asked = MappingProxyType({})
    for k in [*asked][1:]:
        optional = asked[k].default is not Parameter.empty or asked[k].kind in VARIADIC
        if k not in fields and not optional:
            raise InputError(
                f"solver {name!r}: asks for {k!r}; expected the graph, then {', '.join(fields)}"
            )
    if params and "params" not in asked:
        raise InputError(f"solver {name!r}: unknown option {next(iter(params))!r}; it takes none")
    found = solver(graph, **{k: v for k, v in fields.items() if k in asked})
    claimed = found if isinstance(found, Result) else None
    tour = claimed.tour if claimed else found
    run = SolverRun(graph, limits)
    if tour is not None:
        try:
            taken = run.update_incumbent([int(v) for v in tour])
        except (TypeError, ValueError):
            taken = False
        if not taken:
            raise InputError(
                f"solver {name!r}: returned {str(tour)[:80]}; expected vertices from 0 on, one of "
                "every cluster, or a Result"
            )
    if claimed is not None and claimed.lower_bound is not None:
        run.raise_bound(claimed.lower_bound)
    run.infeasible = claimed is not None and claimed.status is Status.INFEASIBLE
    return run.finish("done")
