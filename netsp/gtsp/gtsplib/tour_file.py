"""A tour as a file of TSPLIB's format."""

from __future__ import annotations

from netsp.gtsp.gtsplib.gtsp_file import GtsplibInstance
from netsp.gtsp.travel.result import Result


def tour_text(instance: GtsplibInstance, result: Result) -> str:
    """Return a tour as the text of a file, with length, bound and status in its comment.

    Parameters
    ----------
    instance : GtsplibInstance
        Problem of the tour.
    result : Result
        Result with a tour.
    """
    vertices = result.tour or ()
    bound = "no bound" if result.bound is None else result.bound.says(digits=12)
    lines = [
        f"NAME : {instance.name}.tour",
        f"COMMENT : length {result.length:.12g}, {bound}, {result.status.value}",
        "TYPE : TOUR",
        f"DIMENSION : {len(vertices)}",
        "TOUR_SECTION",
        *(str(v + 1) for v in vertices),  # vertices count from 1
        "-1",
        "EOF",
        "",
    ]
    return "\n".join(lines)
