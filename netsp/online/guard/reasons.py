"""Reasons for alarms, and their texts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.online.guard.alarms import Alarm, Level
from netsp.online.guard.guard_policy import AlarmPolicy
from netsp.online.guard.guard_report import ClassReport
from netsp.online.guard.lookahead import LookaheadResult
from netsp.online.guard.site import Loop, Site
from netsp.world.side_names import beside

FROZEN = "the position stands still to the last digit while the vehicle moves"
"""Reason not to believe a frozen position."""


@dataclass(frozen=True)
class Situation:
    """Place of the robot and knowledge of its course, for the reasons of alarms about loops.

    Attributes
    ----------
    site
        The site.
    robot
        Place of the robot in the likeliest class, shape (3,), m.
    likeliest_share
        Share of the likeliest class.
    noise
        Standard deviation of one position, m.
    has_velocities
        Whether the course is known from velocities, too.
    is_on_plan
        Whether the tether was as planned at the last visit of a tour. The robot will then more
        likely follow the plan than go straight on, and a tour undoes the loops that it closes.
    policy
        Thresholds of alarms.
    """

    site: Site
    robot: Floats
    likeliest_share: float = 1.0
    noise: float = 0.0
    has_velocities: bool = False
    is_on_plan: bool = False
    policy: AlarmPolicy = AlarmPolicy()


def names_of(site: Site, around: Sequence[int], max_names: int = AlarmPolicy.max_names) -> str:
    """Return the names of obstacles as a phrase, and the number of those beyond `max_names`."""
    names = [site.name_of(i) for i in around[:max_names]]
    if len(around) > max_names:
        names[-1:] = [names[-1], f"{len(around) - max_names} more"]
    if len(names) == 1:
        return names[0]
    return f"{', '.join(names[:-1])} and {names[-1]}"


def estimate_lost(seconds: float, why: str) -> Alarm:
    """Return the alarm that nothing is claimed any more."""
    text = f"{why} for {seconds:.0f} s: nothing is claimed about the tether until a position comes"
    return Alarm("estimate", Level.ALARM, text)


def never_claimed(why: str, seconds: float) -> Alarm:
    """Return the alarm that nothing was claimed since the vehicle was first heard."""
    ago = f", {seconds:.0f} s ago" if seconds >= 1.0 else ""
    text = f"{why} since the vehicle was first heard{ago}: nothing is claimed about the tether"
    return Alarm("estimate", Level.ALARM, text, is_immediate=True)


def uncorrected(seconds: float, why: str, error: float, units: str) -> Alarm:
    """Return the alarm that the position may be wrong by more and more."""
    lasted = f", for {seconds:.0f} s" if seconds >= 1.0 else ""
    text = (
        f"{why}{lasted}: the position may be off by {error:.1f} {units} and more; stop "
        "and hold until fixes come, or go back along the tether"
    )
    return Alarm("position", Level.WARNING, text, is_immediate=True)


def position_reset(far: float, units: str) -> Alarm:
    """Return the alarm that the filter reset the position when it took fixes again."""
    text = (
        f"the position was reset to a place {far:.1f} {units} away: it was off, or the fixes "
        "are; say on which side of obstacles the tether passes, or go back along it"
    )
    return Alarm("position", Level.WARNING, text, is_immediate=True)


def in_doubt(classes: Sequence[ClassReport], policy: AlarmPolicy = AlarmPolicy()) -> list[Alarm]:
    """Return the notice that there are several classes, if there are."""
    if len(classes) < 2 or classes[1].likely < policy.doubt_share:
        return []
    paths = "; or ".join(f"{c.passes} ({100 * c.likely:.0f} %)" for c in classes[:3])
    return [Alarm("class", Level.NOTICE, f"the tether runs {paths}")]


def off_plan(
    as_planned: bool | None, now: ClassReport, policy: AlarmPolicy = AlarmPolicy()
) -> list[Alarm]:
    """Return the caution that the tether is in another class than planned at this visit, if so."""
    if as_planned is not False or now.likely < policy.likely_share:
        return []
    text = f"the tether is not as planned at this visit: it runs {now.passes}"
    return [Alarm("plan", Level.CAUTION, text)]


def little_slack(site: Site, now: ClassReport, policy: AlarmPolicy = AlarmPolicy()) -> list[Alarm]:
    """Return the alarm that little or no tether is left, if so."""
    share = now.slack / site.tether_length
    limits = {
        Level.CAUTION: policy.slack_caution,
        Level.WARNING: policy.slack_warning,
        Level.ALARM: 0.0,
    }
    level = max((v for v, s in limits.items() if share < s), default=None)
    if level is None:
        return []
    text = (
        f"the taut tether is {now.taut:.1f} of {site.tether_length:g} {site.units}"
        if now.slack >= 0.0
        else f"the taut tether is {-now.slack:.1f} {site.units} longer than the tether: it is in "
        "another class, or under load; go back along it"
    )
    return [Alarm("slack", level, text)]


def soon_short(
    site: Site, ahead: LookaheadResult, policy: AlarmPolicy = AlarmPolicy()
) -> list[Alarm]:
    """Return the alarm that the present motion soon needs more tether than there is, if so."""
    if ahead.short_s is None:
        return []
    limits = {Level.CAUTION: policy.short_caution_s, Level.WARNING: policy.short_warning_s}
    level = _level(limits, ahead.short_s)
    if level is None:
        return []
    text = (
        f"going on needs more than {site.tether_length:g} {site.units} of tether in "
        f"{ahead.short_s:.0f} s"
    )
    return [Alarm("short", level, text)]


def loop_ahead(ahead: LookaheadResult, situation: Situation, share: float = 1.0) -> list[Alarm]:
    """Return the alarm that the present motion closes a loop in a share of the classes, if so."""
    policy, site, robot = situation.policy, situation.site, situation.robot
    if ahead.loop_s is None or ahead.loop is None or share < policy.possible_share:
        return []
    level = _loop_ahead_level(ahead.loop_s, ahead.is_turning, situation, share)
    if level is None:
        return []
    near = site.nearest(ahead.loop.around, robot)
    keep = site.side_of(near, robot)
    names = names_of(site, ahead.loop.around, policy.max_names)
    text = (
        f"keep {beside(keep, site.name_of(near))}: going on closes a loop around {names} in "
        f"{ahead.loop_s:.0f} s{_likelihood(share, policy)}; {_undo(site, ahead.loop, near)}"
    )
    return [Alarm("loop-ahead", level, text, around=ahead.loop.around)]


def _loop_ahead_level(
    loop_s: float, is_turning: bool, situation: Situation, share: float
) -> Level | None:
    """Return how urgent a loop is that closes in some seconds."""
    policy = situation.policy
    straight = {Level.CAUTION: policy.loop_caution_s, Level.WARNING: policy.loop_warning_s}
    turning = {Level.CAUTION: policy.turn_caution_s, Level.WARNING: policy.turn_warning_s}
    limits = turning if is_turning else straight
    course = policy.course_of_velocities if situation.has_velocities else policy.course_of_positions
    longer = 1.0 + course.delay_per_noise * situation.noise
    level = _level({v: limit_s * longer for v, limit_s in limits.items()}, loop_s)
    is_unclear = (
        situation.likeliest_share < course.min_likeliest_share and share < policy.nearly_all_share
    )
    if level is not None and (share < course.min_share or is_unclear or situation.is_on_plan):
        return Level.CAUTION
    return level


def loop_closed(loops: Sequence[Loop], situation: Situation, share: float = 1.0) -> list[Alarm]:
    """Return the alarm that a loop is closed in a share of the classes, if so."""
    policy, site = situation.policy, situation.site
    if not loops or share < policy.possible_share:
        return []
    loop = loops[0]
    near = site.nearest(loop.around, situation.robot)
    names, likelihood = names_of(site, loop.around, policy.max_names), _likelihood(share, policy)
    text = f"a loop around {names} is closed{likelihood}"
    if situation.is_on_plan:
        text += "; the tether was as planned at the last visit"
        return [Alarm("loop", Level.NOTICE, text, around=loop.around)]
    level = Level.ALARM if share >= policy.loop_alarm_share else Level.CAUTION
    undo = _undo(site, loop, near)
    return [Alarm("loop", level, f"{text}; {undo}", around=loop.around)]


def _likelihood(share: float, policy: AlarmPolicy = AlarmPolicy()) -> str:
    return "" if share >= policy.likely_share else f" ({100.0 * share:.0f} % likely)"


def _undo(site: Site, loop: Loop, near: int) -> str:
    """Return how to undo a loop: back along the tether, past the middle of the loop."""
    length = polylines.length(loop.line)
    half = polylines.points_along(loop.line, 0.5 * length + 1e-9)[1] if length else loop.line[0]
    side = site.side_of(near, half)
    return f"to undo it go back {beside(side, site.name_of(near))}"


def _level(limits: dict[Level, float], seconds: float) -> Level | None:
    """Return the highest level whose limit is not below the seconds left."""
    return max((v for v, s in limits.items() if seconds <= s), default=None)
