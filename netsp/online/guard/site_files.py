"""Site of a guard from a problem or a mission."""

from __future__ import annotations

from netsp.base.errors import InputError
from netsp.model.problem import Problem
from netsp.online.guard.guard_policy import SitePolicy
from netsp.online.guard.plane import PlaneSite
from netsp.online.guard.site import Site
from netsp.world.mission.mission import Mission


def site_of(given: Problem | Mission | Site, policy: SitePolicy = SitePolicy()) -> Site:
    """Return a problem or mission as a site; a site itself is returned as it is.

    Raises
    ------
    InputError
        The object is none of these, or the mission has no site (`SpaceSite`).
    """
    if isinstance(given, Problem):
        return PlaneSite(given, policy)
    if isinstance(given, Mission):
        from netsp.online.guard.space_site import SpaceSite

        return SpaceSite(given, policy=policy)
    if not hasattr(given, "letters"):
        raise InputError(f"problem: expected a Problem or a Mission, got {type(given).__name__}")
    return given
