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
