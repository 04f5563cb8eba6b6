"""A tour as a file of TSPLIB's format."""

from __future__ import annotations

from netsp.gtsp.gtsplib.gtsp_file import Instance
from netsp.gtsp.travel.result import Result


def tour_text(instance: Instance, result: Result) -> str:
    """The file.

    Parameters
    ----------
    instance : Instance
        Its problem.
    result : Result
        With a tour.

    Returns
    -------
    str
        Vertices count from 1; length, bound and status are in the comment.
    """
    vertices = result.tour or ()
    bound = "no bound" if result.bound is None else result.bound.says(digits=12)
    return "\n".join([
        f"NAME : {instance.name}.tour",
        f"COMMENT : length {result.length:.12g}, {bound}, {result.status.value}",
        "TYPE : TOUR",
        f"DIMENSION : {len(vertices)}",
        "TOUR_SECTION",
        *(str(v + 1) for v in vertices),
        "-1",
        "EOF",
        "",
    ])  # fmt: skip
