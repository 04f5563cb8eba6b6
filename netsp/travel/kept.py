"""What is proven of all classes when a travel graph holds only some of them."""

from __future__ import annotations

import dataclasses

from netsp.lower_bound import LowerBound, Scope
from netsp.solution import Status
from netsp.travel.result import Result


def with_bound(result: Result, bound: LowerBound) -> Result:
    """Return a result with another bound, and the status that follows from it.

    Parameters
    ----------
    result : Result
        Of a solver.
    bound : LowerBound
        Bound that is stated instead of the result's own.

    Returns
    -------
    Result
        The same tour: optimal of the bound's scope if the bound proves it; if only the old bound
        did, optimal of the old scope.
    """
    if result.length is None:
        return dataclasses.replace(result, lower_bound=bound.length, lower_bound_of=bound.scope)
    bound, status = bound.at_most(result.length), result.status
    if bound.proves(result.length) and (status.is_optimal or status is Status.FEASIBLE):
        status = Status.optimal_of(bound.scope)
    elif status is Status.OPTIMAL:
        status = Status.optimal_of(result.lower_bound_of)
    return dataclasses.replace(
        result, status=status, lower_bound=bound.length, lower_bound_of=bound.scope
    )


def with_classes_left_out(result: Result, least: float, scope: Scope, because: str) -> Result:
    """Return a result over some classes as one about a scope that includes the others.

    Parameters
    ----------
    result : Result
        Over the classes kept.
    least : float
        No tour that uses a class left out is shorter.
    scope : Scope
        What the classes are together.
    because : str
        Reason why no such tour is shorter.

    Returns
    -------
    Result
        The same tour, with the bound and the status that hold for the scope.
    """
    if result.bound is None:
        return result
    return with_bound(result, result.bound.or_elsewhere(least, scope, because))
