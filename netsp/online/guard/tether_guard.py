"""The guardian of a tether: fixes in, reports out.

fix → track (noise, gaps, jumps) → belief (classes) → taut tethers → ahead → alarms → report
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import Point3, checked_argument
from netsp.hsignature import Word
from netsp.model.problem import Problem
from netsp.online.guard import reasons
from netsp.online.guard.alarms import Alarm, Alarms
from netsp.online.guard.belief import Belief
from netsp.online.guard.dead_reckoning import DeadReckoning
from netsp.online.guard.dropout import after_gap
from netsp.online.guard.guard_report import ClassNow, Report
from netsp.online.guard.lookahead import Ahead, Look
from netsp.online.guard.position_track import GAP, JUMPED, Motion, Track
from netsp.online.guard.site import Loop, Site
from netsp.online.guard.site_files import site_of
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_belief import Strand, Strands
from netsp.world.mission.mission import Mission
from netsp.world.tether import Tether

LEFT_OF_NOISE = 0.4
"""Share of an estimate's noise that is left when it is smoothed, about."""

LOOK_S = 0.3
"""Seconds between the beginnings of two looks ahead, at least."""

MOST_TETHERS = 8
"""Of the classes believed, the likeliest get a tether."""

PAID_OUT = 1.05
"""Times what the winch says it has let out; a class whose taut tether is longer is none."""


@dataclass(frozen=True)
class GuardOptions:
    """What is known of the vehicle.

    Parameters
    ----------
    noise : float
        Standard deviation of one position estimate, metres.
    drift : float
        Standard deviation of how far estimates are off for minutes, metres.
    speed : float
        Fastest speed, m/s.
    dead_reckoning : DeadReckoning
        Growth of the drift while no fixes correct the position.
    """

    noise: float = 0.3
    drift: float = 0.5
    speed: float = 0.5
    dead_reckoning: DeadReckoning = field(default_factory=DeadReckoning)


class Guard:
    """Keeps the class, the taut tether, and what the present motion leads to.

    Parameters
    ----------
    problem : Problem, Mission or Site
        The site: where the tether is fixed, its length and what is in the way count.
    options : GuardOptions, optional
        What is known of the vehicle.

    Raises
    ------
    InputError
        Options out of range.

    Examples
    --------
    >>> from netsp import Circle, Problem
    >>> from netsp.online.guard.telemetry import Fix
    >>> site = Problem(base=(0, 0), goals=[(5.5, 2)], tether_length=9,
    ...                obstacles=[Circle(center=(5, 0), radius=1)])
    >>> guard = Guard(site, GuardOptions(noise=0.0, drift=0.0))
    >>> for t in range(21):
    ...     report = guard.take(Fix(float(t), (0.3 * t, 0.1 * t, 0.0), estimate=True))
    >>> report.classes[0].word, round(report.classes[0].slack, 2), report.loops
    ((1,), 2.68, ())
    """

    def __init__(
        self, problem: Problem | Mission | Site, options: GuardOptions | None = None
    ) -> None:
        self.site, self.options = site_of(problem), options or GuardOptions()
        for name in ("noise", "drift"):
            checked_argument(name, getattr(self.options, name), 0.0)
        if not checked_argument("speed", self.options.speed, 0.0):
            raise InputError("speed: expected a positive number, got 0")
        o = self.options
        self.track = Track(o.noise, o.speed)
        self.belief = Belief(self.site.letters, o.drift, LEFT_OF_NOISE * o.noise)
        self.strands = Strands(self.site)
        self.alarms = Alarms()
        self._vouched: bool | None = None
        self._uncorrected_since: float | None = None
        self._corrected_at: float | None = None
        self._jumped_m: float | None = None
        self._last = Fix(0.0)
        self._seen, self._looked = -np.inf, -np.inf
        self._heard_since: float | None = None
        self._is_beyond = False
        self._looks: list[tuple[float, Look]] = []
        self._ahead, self._sure = Ahead(), 1.0
        self._on_plan = False
        self._motion: Motion | None = None
        self._restored: tuple[dict[Word, float], Floats, float] | None = None
        self._previous: Motion | None = None
        self.report: Report | None = None

    def remember(
        self, words: dict[Word, float], position: Floats, seconds: float,
        tethers: dict[Word, Tether] | None = None,
    ) -> None:  # fmt: skip
        """Begin with the classes of an earlier run.

        Parameters
        ----------
        words : dict of Word to float
            Classes, and their costs.
        position : ndarray, shape (3,)
            Where the robot was, metres.
        seconds : float
            Since then.
        tethers : dict of Word to Tether, optional
            How they hung.
        """
        self._restored = words, position, seconds
        self.strands.all = [Strand(w, 1.0, t) for w, t in (tethers or {}).items()]

    def correct(self, side: str, obstacle: int | str) -> Report | None:
        """The operator says on which side of an obstacle the tether passes.

        Classes that are believed and pass on that side are kept; where there are none, those that
        differ least from one that was believed take their place.

        Parameters
        ----------
        side : str
            One of the site's `sides`, or an axis where north is not known.
        obstacle : int or str
            Its index or name.

        Returns
        -------
        Report or None
            As it is now; None before the first fix.

        Raises
        ------
        InputError
            As of `netsp.online.guard.correct.corrected`; nothing is known of where the robot is.
        """
        if self.track.time is None or not self.strands.all:
            raise InputError("side: nothing is known yet of where the robot is")
        strands = self.strands.all
        agree = [s for s in strands if self.site.agrees(s.tether.nodes, side, obstacle)]
        if agree:
            total = sum(s.likely for s in agree)
            self.strands.all = [replace(s, likely=s.likely / total) for s in agree]
            self.belief.drop(self.belief.words - {s.believed for s in agree})
        else:
            self._begin_with_others(side, obstacle)
        # what was ahead, or closed, was so in classes that are none
        self._looks, self._looked, self._ahead, self._sure = [], -np.inf, Ahead(), 1.0
        self.alarms = Alarms()
        return self._told(self._last)

    def _begin_with_others(self, side: str, obstacle: int | str) -> None:
        """Of all classes that the tether reaches the robot in, where it most likely is."""
        here = self.strands.all[0].tether.robot
        known = {s.word for s in self.strands.all}
        others = [
            Strand(word, 1.0, tether, word)
            for word, tether in self.site.corrected(known, here, side, obstacle).items()
        ]
        self.strands.all = [replace(s, likely=1.0 / len(others)) for s in others]
        assert self._motion is not None
        estimate = self._motion.after
        (step,) = self.site.letters.written(here[None], estimate[None])
        join = self.site.letters.join
        self.belief.begin({join(s.word, step or ()): 0.0 for s in others})
        hanging = self.strands.all
        if not self.strands.follow(self.belief.classes(), estimate, MOST_TETHERS):
            self.strands.all = hanging

    def take(self, fix: Fix) -> Report:
        """Something that the vehicle says.

        Parameters
        ----------
        fix : Fix
            What it says; what it does not, is as before.

        Returns
        -------
        Report
            As it is now.
        """
        self._last = replace(
            fix,
            heading=self._last.heading if fix.heading is None else fix.heading,
            armed=self._last.armed if fix.armed is None else fix.armed,
            mode=self._last.mode if fix.mode is None else fix.mode,
            paid_out=self._last.paid_out if fix.paid_out is None else fix.paid_out,
            aiding_fault=(
                self._last.aiding_fault if fix.aiding_fault is None else fix.aiding_fault
            ),
        )
        self._seen = max(self._seen, fix.time)
        self._note_aiding()
        if self._heard_since is None:
            self._heard_since = fix.time
        if fix.estimate is not None:
            self._vouched = fix.estimate
            if not fix.estimate:
                self.track.lose(fix.time)
        if fix.position is not None:
            self._is_beyond = self._beyond(fix.position)
        if fix.position is not None and self._is_beyond:
            self.track.lose(fix.time)  # no robot on this tether is there
        elif fix.position is not None and self._vouched is not False:
            motion = self.track.take(fix)
            if motion is not None:
                self._moved(motion)
            elif self.track.frozen:
                self._widen()
        return self._told(self._last)

    def _note_aiding(self) -> None:
        """Note the time at which fixes were lost, or taken again."""
        now = self._seen
        if self._last.aiding_fault:
            self._corrected_at = None
            if self._uncorrected_since is None:
                self._uncorrected_since = now
        elif self._uncorrected_since is not None:
            if self._corrected_at is None:
                self._corrected_at = now
            if now - self._corrected_at > self.options.dead_reckoning.settle_s:
                self._uncorrected_since = self._corrected_at = self._jumped_m = None

    @property
    def drift(self) -> float:
        """Standard deviation of the position's error now, metres."""
        o, since, error = self.options, self._uncorrected_since, 0.0
        if since is not None:
            until = self._seen if self._corrected_at is None else self._corrected_at
            error = o.dead_reckoning.error(until - since)
        if self.track.frozen:  # the robot may go on in any direction
            gone = o.speed * max(0.0, self._seen - self.track.freeze.since)
            error = min(max(error, gone), o.dead_reckoning.max_error)
        return o.drift + error

    def _fit_drift(self, place: Floats) -> None:
        """Update the belief if the drift has changed enough."""
        drift, known = self.drift, self.belief.drift
        is_growing = self._uncorrected_since is not None or self.track.frozen
        least = self.options.dead_reckoning.growth if is_growing else 1.0
        if drift > least * known or (not is_growing and drift < 0.999 * known):
            self.belief = self.belief.with_drift(drift, place)

    def _widen(self) -> None:
        """Widen the set of classes while the position is frozen and the guard still claims one."""
        if self._motion is None or self.track.silence(self._seen) > GAP:
            return
        place = self._motion.after
        known = self.belief
        self._fit_drift(place)
        if self.belief is not known:
            self.strands.follow(self.belief.classes(), place, MOST_TETHERS)

    def _beyond(self, place: Point3) -> bool:
        """Whether a place is farther from the base than twice the tether."""
        far = float(np.linalg.norm(np.array(place) - self.site.anchor))
        return not far <= 2.0 * self.site.tether_length + 4.0 * self.drift

    def wait(self, now: float) -> Report:
        """Nothing has come for a while.

        Parameters
        ----------
        now : float
            Seconds, of the vehicle's clock as far as that goes on.

        Returns
        -------
        Report
            As it is now.
        """
        return self.take(Fix(max(now, self._seen)))

    def restarted(self, fix: Fix) -> Report:
        """The vehicle has started anew: its clock counts from 0 again, and its estimate begins
        where it is now.

        Parameters
        ----------
        fix : Fix
            The first since.

        Returns
        -------
        Report
            As it is now.
        """
        shift = self._seen - fix.time
        if self.track.time is not None:
            self.track.shift(-shift)
        if self._previous is not None:
            self._previous = replace(self._previous, time=self._previous.time - shift)
        self.alarms = Alarms()
        self._seen = self._looked = -np.inf
        self._heard_since = fix.time
        self._uncorrected_since = self._corrected_at = self._jumped_m = None
        self.track.lose(fix.time if self.track.time is None else self.track.time)
        self._vouched = None
        return self.take(fix)

    def _moved(self, motion: Motion) -> None:
        o = self.options
        first = self._motion is None
        if not first:
            self._fit_drift(motion.before if self._previous is None else self._previous.after)
        reach = 2.0 * (max(self.drift, self.belief.drift) + LEFT_OF_NOISE * o.noise)
        self._motion = motion
        if first:
            self._begin(motion, reach)
        elif motion.lost_s:
            lost_s = motion.lost_s
            if self._uncorrected_since is not None:  # where it has been since then is a guess
                lost_s = max(lost_s, motion.time - self._uncorrected_since)
                if motion.reason == JUMPED:
                    self._jumped_m = float(np.linalg.norm(motion.after - motion.before))
            words = {h.word: -float(np.log(h.likely)) for h in self.belief.classes()}
            self.belief.begin(
                after_gap(self.site, words, motion.before, motion.after, lost_s, o.speed, reach)
            )
        else:
            before = motion.before if self._previous is None else self._previous.after
            dt = motion.time - (self._previous.time if self._previous else motion.time)
            if not self.belief.move(before, motion.after, dt):
                # no robot can have gone so: it went somehow
                words = {h.word: -float(np.log(h.likely)) for h in self.belief.classes()}
                self.belief.begin(
                    after_gap(self.site, words, before, motion.after, dt, o.speed, reach)
                )
        self._previous = motion
        strands = self.strands.follow(self.belief.classes(), motion.after, MOST_TETHERS)
        out = self._last.paid_out
        there_is = self.site.tether_length
        most = there_is if out is None else min(there_is, PAID_OUT * out)
        self._not_longer_than(most + reach, strands)

    def _begin(self, motion: Motion, reach: float) -> None:
        """With what is remembered, or a tether that is as short as can be."""
        words = {self.site.start_word(): 0.0}
        before, seconds = self.site.start, 0.0
        if self._restored is not None:
            words, before, seconds = self._restored
        self.belief.begin(
            after_gap(self.site, words, before, motion.after, seconds, self.options.speed, reach)
        )

    def _not_longer_than(self, most: float, strands: list[Strand]) -> None:
        """There is less tether, or the winch has let out less, than some classes need."""
        short = [s for s in strands if s.tether.length <= most]
        if short and len(short) < len(strands):
            total = sum(s.likely for s in short)
            self.strands.all = [replace(s, likely=s.likely / total) for s in short]
            self.belief.drop({s.believed for s in strands} - {s.believed for s in short})

    def _told(self, fix: Fix) -> Report:
        """The report as things are."""
        silent = self.track.silence(self._seen)
        claims = self._motion is not None and self._vouched is not False and silent <= GAP
        motion = self._motion
        strands = self.strands.all if claims else []
        classes = tuple(self._class(s) for s in strands)
        closed = [self.site.loops_in(s.tether.nodes) for s in strands]
        if strands and motion is not None:
            self._look(strands, closed, motion)
        else:
            self._looks, self._ahead, self._sure = [], Ahead(), 1.0
        wound = sum(s.likely for s, found in zip(strands, closed, strict=True) if found)
        loops = next((found for found in closed if found), []) if wound >= reasons.LOOPED else []
        raised = self.alarms.take(
            self._seen, self._reasons(claims, silent, classes, (wound, closed), strands)
        )
        names = self.site.name_of
        ahead = self._ahead
        place = None if not strands else strands[0].tether.robot
        if place is None and motion is not None:
            place = motion.after
        self.report = Report(
            time=self._seen if np.isfinite(self._seen) else fix.time,
            position=None if place is None else (float(place[0]), float(place[1]), float(place[2])),
            heading=fix.heading,
            speed=0.0 if motion is None else float(np.linalg.norm(motion.velocity)),
            armed=fix.armed, mode=fix.mode, claims=claims, classes=classes,
            home_s=classes[0].taut / self.options.speed if classes else None,
            loop_s=ahead.loop_s,
            loop_around=() if ahead.loop is None else tuple(map(names, ahead.loop.around)),
            short_s=ahead.short_s,
            loops=tuple(tuple(map(names, loop.around)) for loop in loops),
            alarms=tuple(sorted(self.alarms.on.values(), key=lambda a: -a.level)),
            raised=tuple(raised), paid_out=fix.paid_out,
            as_planned=self._as_planned(strands), drift=self.drift,
        )  # fmt: skip
        return self.report

    def _reasons(
        self, claims: bool, silent: float, classes: Sequence[ClassNow],
        wound: tuple[float, Sequence[Sequence[Loop]]], strands: Sequence[Strand],
    ) -> list[Alarm]:  # fmt: skip
        if self._motion is None:
            return self._never_placed()
        if not claims:
            why = (
                "the vehicle does not vouch for its position" if self._vouched is False
                else reasons.FROZEN if self.track.frozen
                else "no position has come"
            )  # fmt: skip
            return [reasons.estimate_lost(silent, why)]
        if not classes:
            return self._uncorrected()
        robot, site = strands[0].tether.robot, self.site
        share, found = wound
        loops = next((loops for loops in found if loops), [])
        as_planned = self._as_planned(strands)
        if as_planned is not None:
            self._on_plan = as_planned
        on_plan = self._on_plan
        ahead = self._ahead
        return [
            *self._uncorrected(),
            *reasons.in_doubt(classes),
            *reasons.otherwise(as_planned, classes[0]),
            *reasons.little_left(site, classes[0]),
            *reasons.soon_short(site, ahead),
            *reasons.soon_looped(
                site, ahead, robot, self._sure, on_plan, classes[0].likely, self.options.noise,
                reasons.OF_VELOCITIES if self.track.velocities.believed else reasons.OF_PLACES,
            ),
            *reasons.looped(site, loops, robot, share, on_plan),
        ]  # fmt: skip

    def _uncorrected(self) -> list[Alarm]:
        """Return the alarm that the position is frozen, or that no fixes correct it, if so."""
        since, why = self._uncorrected_since, self._last.aiding_fault
        if self.track.frozen:
            since, why = self.track.freeze.since, reasons.FROZEN
            return [reasons.uncorrected(self._seen - since, why, self.drift, self.site.units)]
        if self._jumped_m is not None:
            return [reasons.set_anew(self._jumped_m, self.site.units)]
        if since is None or not why:
            return []
        return [reasons.uncorrected(self._seen - since, why, self.drift, self.site.units)]

    def _never_placed(self) -> list[Alarm]:
        """Return the alarm that nothing was ever claimed; silence counts after `GAP` seconds."""
        assert self._heard_since is not None
        silent = self._seen - self._heard_since
        if self._vouched is False:
            return [reasons.never_claimed("the vehicle has never vouched for its position", silent)]
        if self._is_beyond:
            far = 2.0 * self.site.tether_length
            why = f"all positions are more than {far:g} {self.site.units} from the base"
            return [reasons.never_claimed(why, silent)]
        if silent > GAP:
            return [reasons.never_claimed("no position has come", silent)]
        return []

    def _as_planned(self, strands: Sequence[Strand]) -> bool | None:
        if not strands:
            return None
        now = strands[0]
        off = self.drift + LEFT_OF_NOISE * self.options.noise
        return self.site.as_planned(now.tether.robot, now.word, off)

    def _look(
        self, strands: Sequence[Strand], closed: Sequence[Sequence[Loop]], motion: Motion
    ) -> None:
        """Ahead, in each class that is worth it: the first loop, of those that are not closed there
        already, and in how likely classes one closes, or this one is closed."""
        if not self._looks:
            if 0.0 <= motion.time - self._looked < LOOK_S:
                return
            self._looked = motion.time
            wound = [{loop.around for loop in loops} for loops in closed]
            self._looks = [
                (s.likely, Look(self.site, s.tether, motion, self.options.speed, around))
                for k, (s, around) in enumerate(zip(strands, wound, strict=True))
                if k == 0 or s.likely >= reasons.DOUBT
            ]
        steps = self.site.look_steps
        for _, look in self._looks:
            steps = look.go_on(steps)
        if not all(look.done for _, look in self._looks):
            return
        looks, self._looks = self._looks, []
        closing = [(likely, look.ahead) for likely, look in looks if look.ahead.loop is not None]
        first = max(closing, key=lambda pair: pair[0], default=(0.0, looks[0][1].ahead))[1]
        self._ahead = replace(first, short_s=looks[0][1].ahead.short_s)
        # where it is closed already it is there as well
        there = sum(
            likely for likely, look in looks
            if look.ahead.loop is not None
            or (first.loop is not None and first.loop.around in look.closed)
        )  # fmt: skip
        self._sure = there / sum(likely for likely, _ in looks)

    def _class(self, strand: Strand) -> ClassNow:
        site, nodes = self.site, strand.tether.nodes
        return ClassNow(
            strand.word, strand.likely, site.passes(nodes, strand.word), strand.tether.length,
            site.tether_length - strand.tether.length, site.turning(nodes), nodes,
        )  # fmt: skip


__all__ = ["Guard", "GuardOptions"]
