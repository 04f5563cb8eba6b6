"""Why the operator should be told something, and in which words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.online.guard.alarms import Alarm, Level
from netsp.online.guard.guard_report import ClassNow
from netsp.online.guard.lookahead import Ahead
from netsp.online.guard.site import Loop, Site, beside

LOOP_S = {Level.CAUTION: 30.0, Level.WARNING: 20.0}
TURN_S = {Level.CAUTION: 20.0, Level.WARNING: 14.0}
SHORT_S = {Level.CAUTION: 10.0, Level.WARNING: 4.0}
"""Seconds ahead from which on something is that urgent; a robot that works at the end of its tether
drives towards it all the time."""

SLACK = {Level.CAUTION: 0.1, Level.WARNING: 0.03, Level.ALARM: 0.0}
"""Shares of the tether that are left."""

LIKELY, LOOPED, POSSIBLE = 0.8, 0.5, 0.05
"""Shares of the classes in which a loop will close, or has closed: above the first, or second, it
is spoken of as such, above the third as a possibility, and below not at all."""

ALL = 0.95
"""Share of the classes that is all of them, but for a rest."""


@dataclass(frozen=True)
class Course:
    """How well it is known where the robot is heading.

    Parameters
    ----------
    later : float
        For each metre of a position's noise, the share by which a loop is seen to close later than
        it does: a course with noise goes round in a wider circle.
    likely : float
        Share of the classes in which a loop will close for a warning.
    clear : float
        Share that the likeliest class must have for a warning: where it is anybody's guess how the
        tether runs, so is what closes a loop; unless one closes in `ALL` of them.
    """

    later: float
    likely: float
    clear: float


OF_PLACES, OF_VELOCITIES = Course(1.3, LIKELY, 0.6), Course(0.6, 0.75, 0.0)
"""From where the robot has been alone, and where it tells its velocity, too
(benchmarks/guard.py)."""

FROZEN = "the position stands still to the last digit while the vehicle moves"
"""Reason not to believe a frozen position."""

DOUBT = 0.05
"""Share that a second class must have to be worth a word."""

MOST_NAMES = 3


def names_of(site: Site, around: Sequence[int]) -> str:
    """Obstacles in a phrase: the first few by name."""
    names = [site.name_of(i) for i in around[:MOST_NAMES]]
    if len(around) > MOST_NAMES:
        names[-1:] = [names[-1], f"{len(around) - MOST_NAMES} more"]
    if len(names) == 1:
        return names[0]
    return f"{', '.join(names[:-1])} and {names[-1]}"


def estimate_lost(seconds: float, why: str) -> Alarm:
    """Nothing is claimed any more."""
    return Alarm(
        "estimate", Level.ALARM,
        f"{why} for {seconds:.0f} s: nothing is claimed about the tether until a position comes",
    )  # fmt: skip


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


def set_anew(far: float, units: str) -> Alarm:
    """Return the alarm that the filter reset the position when it took fixes again."""
    text = (
        f"the position was set anew, {far:.1f} {units} from where it was: it was off, or the fixes "
        "are; say on which side of obstacles the tether passes, or go back along it"
    )
    return Alarm("position", Level.WARNING, text, is_immediate=True)


def in_doubt(classes: Sequence[ClassNow]) -> list[Alarm]:
    """The class is one of several."""
    if len(classes) < 2 or classes[1].likely < DOUBT:
        return []
    told = "; or ".join(f"{c.passes} ({100 * c.likely:.0f} %)" for c in classes[:3])
    return [Alarm("class", Level.NOTICE, f"the tether runs {told}")]


def otherwise(as_planned: bool | None, now: ClassNow) -> list[Alarm]:
    """The tether is in another class than the tour means it to be in here."""
    if as_planned is not False or now.likely < LIKELY:
        return []
    text = f"the tether is not as planned at this stop: it runs {now.passes}"
    return [Alarm("plan", Level.CAUTION, text)]


def little_left(site: Site, now: ClassNow) -> list[Alarm]:
    """The tether is nearly used up, or too short."""
    share = now.slack / site.tether_length
    level = max((v for v, s in SLACK.items() if share < s), default=None)
    if level is None:
        return []
    text = (
        f"the taut tether is {now.taut:.1f} of {site.tether_length:g} {site.units}"
        if now.slack >= 0.0
        else f"the taut tether is {-now.slack:.1f} {site.units} longer than there is: the class "
        "is another, or the tether is under load; go back along it"
    )
    return [Alarm("slack", level, text)]


def soon_short(site: Site, ahead: Ahead) -> list[Alarm]:
    """Going on needs more tether than there is."""
    if ahead.short_s is None:
        return []
    level = _level(SHORT_S, ahead.short_s)
    if level is None:
        return []
    text = (
        f"going on needs more than {site.tether_length:g} {site.units} of tether in "
        f"{ahead.short_s:.0f} s"
    )
    return [Alarm("short", level, text)]


def soon_looped(
    site: Site, ahead: Ahead, robot: Floats, share: float = 1.0, on_plan: bool = False,
    clear: float = 1.0, noise: float = 0.0, course: Course = OF_PLACES,
) -> list[Alarm]:  # fmt: skip
    """Going on closes a loop, in that share of the classes, the likeliest of which is so clear.
    Where the tether was as planned at the last stop of a tour, the way on is more likely that of
    the plan than straight on."""
    if ahead.loop_s is None or ahead.loop is None or share < POSSIBLE:
        return []
    limits = TURN_S if ahead.turning else LOOP_S
    longer = 1.0 + course.later * noise
    level = _level({v: most * longer for v, most in limits.items()}, ahead.loop_s)
    if level is None:
        return []
    if share < course.likely or (clear < course.clear and share < ALL) or on_plan:
        level = Level.CAUTION
    near = site.nearest(ahead.loop.around, robot)
    keep = site.side_of(near, robot)
    names = names_of(site, ahead.loop.around)
    text = (
        f"keep {beside(keep, site.name_of(near))}: going on closes a loop around {names} in "
        f"{ahead.loop_s:.0f} s{_unsure(share)}; {_undo(site, ahead.loop, near)}"
    )
    return [Alarm("loop-ahead", level, text)]


def looped(
    site: Site, loops: Sequence[Loop], robot: Floats, share: float = 1.0, on_plan: bool = False
) -> list[Alarm]:
    """A loop is closed, in that share of the classes. Tours close some that they undo later."""
    if not loops or share < POSSIBLE:
        return []
    loop = loops[0]
    near = site.nearest(loop.around, robot)
    names, sure = names_of(site, loop.around), _unsure(share)
    if on_plan:
        text = f"a loop around {names} is closed{sure}; the tether was as planned at the last stop"
        return [Alarm("loop", Level.NOTICE, text)]
    text = f"a loop around {names} is closed{sure}; {_undo(site, loop, near)}"
    return [Alarm("loop", Level.ALARM if share >= LOOPED else Level.CAUTION, text)]


def _unsure(share: float) -> str:
    return "" if share >= LIKELY else f" ({100.0 * share:.0f} % likely)"


def _undo(site: Site, loop: Loop, near: int) -> str:
    """Back along the tether: past the middle of the loop."""
    length = polylines.length(loop.line)
    half = polylines.points_along(loop.line, 0.5 * length + 1e-9)[1] if length else loop.line[0]
    back = site.side_of(near, half)
    return f"to undo it go back {beside(back, site.name_of(near))}"


def _level(limits: dict[Level, float], seconds: float) -> Level | None:
    return max((v for v, s in limits.items() if seconds <= s), default=None)
