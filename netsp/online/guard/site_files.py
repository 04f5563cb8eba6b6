"""The site of a file, or of what was loaded from one."""

from __future__ import annotations

from netsp.base.errors import InputError
from netsp.model.problem import Problem
from netsp.online.guard.plane import PlaneSite
from netsp.online.guard.site import Site
from netsp.world.mission.mission import Mission


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
        It is none of these; as of `netsp.online.guard.space_site.SpaceSite`.
    """
    if isinstance(given, Problem):
        return PlaneSite(given)
    if isinstance(given, Mission):
        from netsp.online.guard.space_site import SpaceSite

        return SpaceSite(given)
    if not hasattr(given, "letters"):
        raise InputError(f"problem: expected a Problem or a Mission, got {type(given).__name__}")
    return given
