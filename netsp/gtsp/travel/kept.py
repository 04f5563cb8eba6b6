"""Extend bounds over the classes of a travel graph to the classes that were left out."""

from __future__ import annotations

import dataclasses

from netsp.gtsp.travel.result import Result
from netsp.model.bound_scope import LowerBound, Scope
from netsp.model.solution import Status


def with_bound(result: Result, bound: LowerBound) -> Result:
    """Return a result with another bound, and the status that follows from it.

    Parameters
    ----------
    result : Result
        Result of a solver.
    bound : LowerBound
        Bound that replaces the bound of the result.

    Returns
    -------
    Result
        The same tour. It is optimal in the scope of the new bound if that proves it, or in the old
        scope if only the old bound proves it.
    """
    if result.length is None:
        return dataclasses.replace(result, lower_bound=bound.length, lower_bound_of=bound.scope)
    bound, status = bound.capped_at(result.length), result.status
    if bound.proves(result.length) and (status.is_optimal or status is Status.FEASIBLE):
        status = Status.optimal_of(bound.scope)
    elif status is Status.OPTIMAL:
        status = Status.optimal_of(result.lower_bound_of)
    return dataclasses.replace(
        result, status=status, lower_bound=bound.length, lower_bound_of=bound.scope
    )


def with_classes_left_out(result: Result, min_length: float, scope: Scope, because: str) -> Result:
    """Return a result over some classes with a bound for a scope that includes the others.

    Parameters
    ----------
    result : Result
        Result over the classes kept.
    min_length : float
        Lower bound on tours that use a class left out.
    scope : Scope
        Scope of all classes together.
    because : str
        Reason why no such tour is shorter.

    Returns
    -------
    Result
        The same tour, with the bound and the status that hold for the scope.
    """
    if result.bound is None:
        return result
    return with_bound(result, result.bound.or_elsewhere(min_length, scope, because))
