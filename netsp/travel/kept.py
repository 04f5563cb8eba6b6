"""What is proven of all classes when a roadmap kept only some of them."""

from __future__ import annotations

import dataclasses

from netsp.solution import Status
from netsp.travel.result import Result, proven


def within_kept(result: Result, otherwise: float) -> Result:
    """A result over the classes kept as one about all classes.

    Parameters
    ----------
    result : Result
        Over the classes kept.
    otherwise : float
        No tour that uses a class left out is shorter.

    Returns
    -------
    Result
        The same tour, with the bound and the status that hold for all classes.
    """
    bound, length = result.lower_bound, result.length
    if bound is None or otherwise >= bound:
        return result
    status = result.status
    if status is Status.OPTIMAL and length is not None and not proven(length, otherwise):
        status = Status.OPTIMAL_OF_KEPT
    return dataclasses.replace(result, lower_bound=otherwise, status=status)


def with_bound(result: Result, bound: float) -> Result:
    """A result with a bound that holds for all classes, if it is better than its own.

    Parameters
    ----------
    result : Result
        Of a solver.
    bound : float
        No tour is shorter.

    Returns
    -------
    Result
        The same tour; optimal if the bound proves it.
    """
    if result.tour is None or result.length is None or bound <= (result.lower_bound or 0.0):
        return result
    bound = min(bound, result.length)
    status = Status.OPTIMAL if proven(result.length, bound) else result.status
    return dataclasses.replace(result, lower_bound=bound, status=status)
