"""The site of a file, or of what was loaded from one."""

from __future__ import annotations

from netsp.errors import InputError
from netsp.guard.plane import PlaneSite
from netsp.guard.site import Site
from netsp.online.mission import Mission
from netsp.problem import Problem


def site_of(given: Problem | Mission | Site) -> Site:
    """What a guard watches.

    Parameters
    ----------
    given : Problem, Mission or Site
        Where.

    Returns
    -------
    Site
        The same as a site.

    Raises
    ------
    InputError
        It is none of these; as of `netsp.guard.space.SpaceSite`.
    """
    if isinstance(given, Problem):
        return PlaneSite(given)
    if isinstance(given, Mission):
        from netsp.guard.space import SpaceSite

        return SpaceSite(given)
    if not hasattr(given, "letters"):
        raise InputError(f"problem: expected a Problem or a Mission, got {type(given).__name__}")
    return given
