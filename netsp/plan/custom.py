"""Third-party solvers: any callable that takes a travel graph."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Iterable, Mapping, Set
from contextlib import suppress
from dataclasses import is_dataclass
from inspect import Parameter
from types import MappingProxyType
from typing import Any

import numpy as np

from netsp.base.errors import InputError
from netsp.base.validated import shown
from netsp.gtsp.instance import Instance
from netsp.gtsp.limits import Limits
from netsp.gtsp.params import read_params
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.result import Result
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE
from netsp.model.solution import Status

OFFERED = ("params", "limits", "time", "iterations", "rng", "warm_start")
"""Names of the parameters that a solver may have: options, limits, and each field of these."""

VARIADIC = (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)


def read_options(solver: Callable[..., Any], name: str, params: Mapping[str, Any] | None) -> Any:
    """Return the argument `params` of a solver.

    It is the dataclass that `params` is annotated with, with its values checked, or else the
    mapping as it is.

    Raises
    ------
    InputError
        Options for a solver that takes none; a required parameter that is not in `OFFERED`; with a
        dataclass, an option unknown or out of range.
    """
    accepted = _parameters_of(solver)
    for k in [*accepted][1:]:
        optional = accepted[k].default is not Parameter.empty or accepted[k].kind in VARIADIC
        if k not in OFFERED and not optional:
            raise InputError(
                f"solver {name!r}: asks for {k!r}; expected the graph, then {', '.join(OFFERED)}"
            )
    if params is not None and not isinstance(params, Mapping):
        raise InputError(f"solver {name!r}: params: expected names with values, got {params!r}")
    if params and "params" not in accepted:
        raise InputError(f"solver {name!r}: unknown option {next(iter(params))!r}; it takes none")
    kind = accepted["params"].annotation if "params" in accepted else None
    kinds = [kind, *typing.get_args(kind)]  # as `D | None`
    kind = next((k for k in kinds if isinstance(k, type) and is_dataclass(k)), None)
    if kind is not None:
        return read_params(kind, name, params)
    return dict(params or {})


def whole_numbers(values: Any) -> tuple[int, ...]:
    """Return a sequence of whole numbers as a tuple; an empty one for anything else."""
    if isinstance(values, str | bytes | Mapping | Set) or not isinstance(values, Iterable):
        return ()
    listed = list(values)
    good = all(isinstance(v, int | np.integer) and not isinstance(v, bool) for v in listed)
    return tuple(int(v) for v in listed) if good else ()


def _parameters_of(solver: Callable[..., Any]) -> Mapping[str, Parameter]:
    """Return the parameters of a solver by name; none if it is compiled and has no signature."""
    try:
        accepted = inspect.signature(solver).parameters
    except (TypeError, ValueError):
        return MappingProxyType({})
    with suppress(Exception):  # annotations that only a type checker can read
        accepted = inspect.signature(solver, eval_str=True).parameters
    first = next(iter(accepted.values()), None)
    if first is None or first.kind in (Parameter.KEYWORD_ONLY, Parameter.VAR_KEYWORD):
        raise InputError(f"solver: {shown(solver)} takes no argument; expected the travel graph")
    for k, p in [*accepted.items()][1:]:
        if p.kind is Parameter.POSITIONAL_ONLY:
            raise InputError(f"solver: {shown(solver)} takes {k!r} by position; expected by name")
    return accepted


def call(
    solver: Callable[..., Any], name: str, graph: Instance, params: Mapping[str, Any] | None,
    limits: Limits,
) -> Result:  # fmt: skip
    """Call a solver with the graph and whatever it asks for by name: `params` (a mapping, or the
    dataclass it is annotated with), `limits`, or a field of `limits` such as `rng`.

    It returns a `Result`, or a tour as vertices from 0 on (then no bound is claimed), or None if it
    found none. A tour is checked against the graph, and its length is measured here. A bound cannot
    be checked except against the length of its tour, so it is trusted, and used only with a tour.

    Raises
    ------
    InputError
        As in `read_options`; a return value that is neither a `Result` nor a tour; a bound above
        the tour's length.
    """
    fields = {"params": read_options(solver, name, params), "limits": limits}
    fields |= {k: getattr(limits, k) for k in OFFERED[2:]}
    accepted = _parameters_of(solver)
    found = solver(graph, **{k: v for k, v in fields.items() if k in [*accepted][1:]})
    claimed = found if isinstance(found, Result) else None
    tour = claimed.tour if claimed else found
    run = SolverRun(graph, limits)
    if tour is not None:
        vertices = whole_numbers(tour)
        if not vertices or not run.update_incumbent(vertices):
            why = graph.why_no_tour(vertices) if vertices else "not a sequence of whole numbers"
            raise InputError(
                f"solver {name!r}: returned {shown(tour)}: {why}; expected vertices from 0 on, one "
                "of every cluster, or a Result"
            )
    if claimed is not None and claimed.lower_bound is not None and tour is not None:
        bound = claimed.lower_bound
        if isinstance(bound, bool) or not isinstance(bound, int | float | np.number):
            raise InputError(f"solver {name!r}: lower_bound: expected a number, got {shown(bound)}")
        if bound > run.length * (1.0 + OPTIMALITY_TOLERANCE):
            raise InputError(
                f"solver {name!r}: lower_bound: {bound:.9g} is more than its own tour's length, "
                f"{run.length:.9g}"
            )
        run.raise_bound(float(bound))
    if claimed is not None and claimed.status is Status.INFEASIBLE:
        run.ensure_tour()
        if run.tour is not None:
            raise InputError(f"solver {name!r}: calls the graph infeasible, but it has a tour")
        run.is_infeasible = True
    return run.finish("done")
