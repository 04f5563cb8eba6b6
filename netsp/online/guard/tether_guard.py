"""Guard of a tether: fixes in, reports out.

fix → track (noise, dropouts, jumps) → belief (classes) → taut tethers → lookahead → alarms → report
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
from netsp.online.guard.dropout import classes_after_dropout
from netsp.online.guard.guard_policy import GuardPolicy
from netsp.online.guard.guard_report import ClassReport, Report
from netsp.online.guard.lookahead import Lookahead, LookaheadResult
from netsp.online.guard.position_track import JUMPED, Motion, Track
from netsp.online.guard.site import Loop, Site
from netsp.online.guard.site_files import site_of
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_belief import Strand, Strands
from netsp.world.mission.mission import Mission
from netsp.world.tether import Tether


@dataclass(frozen=True)
class GuardOptions:
    """Knowledge of the vehicle.

    Attributes
    ----------
    noise
        Standard deviation of one position estimate, m.
    drift
        Standard deviation of the error of estimates that lasts for minutes, m.
    speed
        Full speed, m/s.
    dead_reckoning
        Growth of the drift while no fixes correct the position.
    """

    noise: float = 0.3
    drift: float = 0.5
    speed: float = 0.5
    dead_reckoning: DeadReckoning = field(default_factory=DeadReckoning)


class Guard:
    """Guard of a tether: it follows its class and taut line, and looks ahead along the motion.

    Parameters
    ----------
    problem : Problem, Mission or Site
        Site, with base, tether length and obstacles.
    options : GuardOptions, optional
        Knowledge of the vehicle.
    policy : GuardPolicy
        Thresholds and limits. A `Site` has its own `SitePolicy`.

    Raises
    ------
    InputError
        An option is out of range.

    Examples
    --------
    >>> from netsp import Circle, Problem
    >>> from netsp.online.guard.telemetry import Fix
    >>> site = Problem(base=(0, 0), goals=[(5.5, 2)], tether_length=9,
    ...                obstacles=[Circle(center=(5, 0), radius=1)])
    >>> guard = Guard(site, GuardOptions(noise=0.0, drift=0.0))
    >>> for t in range(21):
    ...     report = guard.update(Fix(float(t), (0.3 * t, 0.1 * t, 0.0), estimate=True))
    >>> report.classes[0].word, round(report.classes[0].slack, 2), report.loops
    ((1,), 2.68, ())
    """

    def __init__(
        self,
        problem: Problem | Mission | Site,
        options: GuardOptions | None = None,
        policy: GuardPolicy = GuardPolicy(),
    ) -> None:
        self.site, self.options = site_of(problem, policy.site), options or GuardOptions()
        self.policy = policy
        for name in ("noise", "drift"):
            checked_argument(name, getattr(self.options, name), 0.0)
        if not checked_argument("speed", self.options.speed, 0.0):
            raise InputError("speed: expected a positive number, got 0")
        o = self.options
        self.track = Track(o.noise, o.speed, policy.track)
        self._noise_left = policy.noise_left * o.noise
        self.belief = Belief(self.site.letters, o.drift, self._noise_left, policy.belief)
        self.strands = Strands(self.site)
        self.alarms = Alarms(policy.alarms)
        self._is_vouched_for: bool | None = None
        self._uncorrected_since: float | None = None
        self._corrected_at: float | None = None
        self._jumped_m: float | None = None
        self._last = Fix(0.0)
        self._now, self._look_began = -np.inf, -np.inf
        self._heard_since: float | None = None
        self._is_out_of_reach = False
        self._reset_lookahead()
        self._is_on_plan = False
        self._motion: Motion | None = None
        self._restored: tuple[dict[Word, float], Floats, float] | None = None
        self._previous: Motion | None = None
        self.report: Report | None = None

    def _reset_lookahead(self) -> None:
        """Drop the lookahead and its result."""
        self._looks: list[tuple[float, Lookahead]] = []
        self._ahead, self._ahead_share = LookaheadResult(), 1.0

    def begin_with(
        self,
        words: dict[Word, float],
        position: Floats,
        age_s: float,
        tethers: dict[Word, Tether] | None = None,
    ) -> None:
        """Restore the classes of an earlier run.

        Parameters
        ----------
        words : dict of Word to float
            Classes, and their costs.
        position : ndarray, shape (3,)
            Position of the robot at that time, m.
        age_s : float
            Time since then, s.
        tethers : dict of Word to Tether, optional
            Tethers of the classes.
        """
        self._restored = words, position, age_s
        self.strands.all = [Strand(w, 1.0, t) for w, t in (tethers or {}).items()]

    def correct(self, side: str, obstacle: int | str) -> Report | None:
        """Keep the classes whose tether passes an obstacle on a side, as the operator says.

        If no believed class does, the classes that differ least from a believed one take
        their place.

        Parameters
        ----------
        side : str
            One of the site's `sides`, or an axis if north is unknown.
        obstacle : int or str
            Index or name of the obstacle.

        Returns
        -------
        Report or None
            Report of the guard; None before the first fix.

        Raises
        ------
        InputError
            The place of the robot is unknown, or there is no such side, obstacle or class.
        """
        if self.track.time is None or not self.strands.all:
            raise InputError("side: nothing is known yet of where the robot is")
        strands = self.strands.all
        agree = [s for s in strands if self.site.passes_on_side(s.tether.nodes, side, obstacle)]
        if agree:
            total = sum(s.likely for s in agree)
            self.strands.all = [replace(s, likely=s.likely / total) for s in agree]
            self.belief.drop(self.belief.words - {s.believed for s in agree})
        else:
            self._begin_with_others(side, obstacle)
        # loops ahead and closed loops were those of excluded classes
        self._reset_lookahead()
        self._look_began = -np.inf
        self.alarms = Alarms(self.policy.alarms)
        return self._make_report(self._last)

    def _begin_with_others(self, side: str, obstacle: int | str) -> None:
        """Begin with the classes that pass on a side, of all that reach the robot's likeliest
        place."""
        robot = self.strands.all[0].tether.robot
        known = {s.word for s in self.strands.all}
        found = self.site.classes_on_side(known, robot, side, obstacle)
        others = [Strand(word, 1.0, tether, word) for word, tether in found.items()]
        self.strands.all = [replace(s, likely=1.0 / len(others)) for s in others]
        assert self._motion is not None
        estimate = self._motion.after
        (step,) = self.site.letters.words_of_steps(robot[None], estimate[None])
        join = self.site.letters.join
        self.belief.begin({join(s.word, step or ()): 0.0 for s in others})
        found_strands = self.strands.all
        if not self._follow(estimate):
            self.strands.all = found_strands

    def _follow(self, estimate: Floats) -> list[Strand]:
        """Return the tethers of the likeliest classes, moved to the estimate of the position."""
        return self.strands.follow(self.belief.classes(), estimate, self.policy.max_tethers)

    def update(self, fix: Fix) -> Report:
        """Update the guard with what the vehicle reports, and return the report of the guard."""
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
        self._now = max(self._now, fix.time)
        self._note_aiding()
        if self._heard_since is None:
            self._heard_since = fix.time
        if fix.estimate is not None:
            self._is_vouched_for = fix.estimate
            if not fix.estimate:
                self.track.invalidate(fix.time)
        if fix.position is not None:
            self._update_position(fix, fix.position)
        return self._make_report(self._last)

    def _update_position(self, fix: Fix, position: Point3) -> None:
        """Follow the robot to the position of a fix, if the position can be believed."""
        self._is_out_of_reach = self._is_beyond_reach(position)
        if self._is_out_of_reach:
            self.track.invalidate(fix.time)
        elif self._is_vouched_for is not False:
            motion = self.track.observe(fix)
            if motion is not None:
                self._follow_motion(motion)
            elif self.track.is_frozen:
                self._widen()

    def _note_aiding(self) -> None:
        """Note the time at which fixes were lost, or accepted again."""
        now = self._now
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
        """Return the standard deviation of the position's error now, m."""
        o, since, error = self.options, self._uncorrected_since, 0.0
        if since is not None:
            until = self._now if self._corrected_at is None else self._corrected_at
            error = o.dead_reckoning.error(until - since)
        if self.track.is_frozen:  # the robot may go on in any direction
            travelled = o.speed * max(0.0, self._now - self.track.freeze.since)
            error = min(max(error, travelled), o.dead_reckoning.max_error)
        return o.drift + error

    def _fit_drift(self, place: Floats) -> None:
        """Update the belief if the drift has changed enough."""
        drift, known = self.drift, self.belief.drift
        is_growing = self._uncorrected_since is not None or self.track.is_frozen
        min_growth = self.options.dead_reckoning.growth if is_growing else 1.0
        if drift > min_growth * known or (not is_growing and drift < 0.999 * known):
            self.belief = self.belief.with_drift(drift, place)

    def _widen(self) -> None:
        """Widen the set of classes while the position is frozen and the guard still claims one."""
        if self._motion is None or self._is_silent:
            return
        place = self._motion.after
        known = self.belief
        self._fit_drift(place)
        if self.belief is not known:
            self._follow(place)

    @property
    def _is_silent(self) -> bool:
        """Return whether there was no believable position for too long."""
        return self.track.silence_s(self._now) > self.policy.track.dropout_s

    def _is_beyond_reach(self, place: Point3) -> bool:
        """Return whether a place is farther from the base than twice the tether."""
        far = float(np.linalg.norm(np.array(place) - self.site.anchor))
        return not far <= 2.0 * self.site.tether_length + 4.0 * self.drift

    def advance_to(self, now: float) -> Report:
        """Advance the time of the guard without a fix, and return the report of the guard."""
        return self.update(Fix(max(now, self._now)))

    def restart_vehicle(self, fix: Fix) -> Report:
        """Go on after a restart of the vehicle, and return the report of the guard.

        The vehicle's clock counts from 0 again, and its estimate begins where it is now; `fix` is
        the first one since.
        """
        shift = self._now - fix.time
        if self.track.time is not None:
            self.track.shift_clock(-shift)
        if self._previous is not None:
            self._previous = replace(self._previous, time=self._previous.time - shift)
        self.alarms = Alarms(self.policy.alarms)
        self._now = self._look_began = -np.inf
        self._heard_since = fix.time
        self._uncorrected_since = self._corrected_at = self._jumped_m = None
        self.track.invalidate(fix.time if self.track.time is None else self.track.time)
        self._is_vouched_for = None
        return self.update(fix)

    def _follow_motion(self, motion: Motion) -> None:
        """Update belief and tethers by a motion of the robot."""
        is_first = self._motion is None
        if not is_first:
            self._fit_drift(motion.before if self._previous is None else self._previous.after)
        reach = 2.0 * (max(self.drift, self.belief.drift) + self._noise_left)
        self._motion = motion
        if is_first:
            self._begin_belief(motion, reach)
        elif motion.lost_s:
            lost_s = motion.lost_s
            if self._uncorrected_since is not None:  # its place since then is a guess
                lost_s = max(lost_s, motion.time - self._uncorrected_since)
                if motion.reason == JUMPED:
                    self._jumped_m = float(np.linalg.norm(motion.after - motion.before))
            self._begin_after_dropout(motion.before, motion.after, lost_s, reach)
        else:
            before = motion.before if self._previous is None else self._previous.after
            dt = motion.time - (self._previous.time if self._previous else motion.time)
            if not self.belief.move(before, motion.after, dt):
                # no robot can move straight there: its path is unknown
                self._begin_after_dropout(before, motion.after, dt, reach)
        self._previous = motion
        strands = self._follow(motion.after)
        paid_out, max_length = self._last.paid_out, self.site.tether_length
        if paid_out is not None:
            max_length = min(max_length, self.policy.max_paid_out_factor * paid_out)
        self._drop_longer_than(max_length + reach, strands)

    def _begin_belief(self, motion: Motion, reach: float) -> None:
        """Begin with the restored classes, or with the tether at the start."""
        words = {self.site.start_word(): 0.0}
        before, age_s = self.site.start, 0.0
        if self._restored is not None:
            words, before, age_s = self._restored
        max_travel = self.options.speed * age_s
        self.belief.begin(
            classes_after_dropout(self.site, words, before, motion.after, max_travel, reach)
        )

    def _begin_after_dropout(
        self, before: Floats, after: Floats, lost_s: float, reach: float
    ) -> None:
        """Begin the belief again with the classes of all paths that the robot may have taken."""
        words = {h.word: -float(np.log(h.likely)) for h in self.belief.classes()}
        max_travel = self.options.speed * lost_s
        self.belief.begin(classes_after_dropout(self.site, words, before, after, max_travel, reach))

    def _drop_longer_than(self, max_length: float, strands: list[Strand]) -> None:
        """Drop the classes that need more tether than there is, or than the winch has let out."""
        short = [s for s in strands if s.tether.length <= max_length]
        if short and len(short) < len(strands):
            total = sum(s.likely for s in short)
            self.strands.all = [replace(s, likely=s.likely / total) for s in short]
            self.belief.drop({s.believed for s in strands} - {s.believed for s in short})

    def _make_report(self, fix: Fix) -> Report:
        """Update lookahead and alarms, and return the report."""
        is_vouched_for = self._is_vouched_for is not False
        claims = self._motion is not None and is_vouched_for and not self._is_silent
        motion = self._motion
        strands = self.strands.all if claims else []
        classes = tuple(self._class_report(s) for s in strands)
        closed = [self.site.loops_in(s.tether.nodes) for s in strands]
        if strands and motion is not None:
            self._look_ahead(strands, closed, motion)
        else:
            self._reset_lookahead()
        share = sum(s.likely for s, found in zip(strands, closed, strict=True) if found)
        loops = next((found for found in closed if found), [])
        raised = self.alarms.update(
            self._now, self._reasons(claims, classes, (share, loops), strands)
        )
        names = self.site.name_of
        ahead = self._ahead
        is_looped = share >= self.policy.alarms.loop_alarm_share
        self.report = Report(
            time=self._now if np.isfinite(self._now) else fix.time,
            position=self._reported_place(strands),
            heading=fix.heading,
            speed=0.0 if motion is None else float(np.linalg.norm(motion.velocity)),
            armed=fix.armed,
            mode=fix.mode,
            claims=claims,
            classes=classes,
            home_s=classes[0].taut / self.options.speed if classes else None,
            loop_s=ahead.loop_s,
            loop_around=() if ahead.loop is None else tuple(map(names, ahead.loop.around)),
            short_s=ahead.short_s,
            loops=tuple(tuple(map(names, loop.around)) for loop in loops if is_looped),
            alarms=tuple(sorted(self.alarms.active.values(), key=lambda a: -a.level)),
            raised=tuple(raised),
            paid_out=fix.paid_out,
            as_planned=self._as_planned(strands),
            drift=self.drift,
        )
        return self.report

    def _reported_place(self, strands: Sequence[Strand]) -> Point3 | None:
        """Return the place of the robot in the likeliest class, or else by the last motion."""
        if strands:
            place = strands[0].tether.robot
        elif self._motion is not None:
            place = self._motion.after
        else:
            return None
        return float(place[0]), float(place[1]), float(place[2])

    def _reasons(
        self,
        claims: bool,
        classes: Sequence[ClassReport],
        closed: tuple[float, Sequence[Loop]],
        strands: Sequence[Strand],
    ) -> list[Alarm]:
        """Return the reasons for alarms; `closed` is the share of looped classes, and the loops."""
        if self._motion is None:
            return self._never_placed()
        if not claims:
            why = "no position has come"
            if self._is_vouched_for is False:
                why = "the vehicle does not vouch for its position"
            elif self.track.is_frozen:
                why = reasons.FROZEN
            return [reasons.estimate_lost(self.track.silence_s(self._now), why)]
        if not classes:
            return self._uncorrected()
        site, policy, (share, loops) = self.site, self.policy.alarms, closed
        as_planned = self._as_planned(strands)
        if as_planned is not None:
            self._is_on_plan = as_planned
        situation = reasons.Situation(
            site,
            strands[0].tether.robot,
            classes[0].likely,
            self.options.noise,
            self.track.velocities.is_believed,
            self._is_on_plan,
            policy,
        )
        return [
            *self._uncorrected(),
            *reasons.in_doubt(classes, policy),
            *reasons.off_plan(as_planned, classes[0], policy),
            *reasons.little_slack(site, classes[0], policy),
            *reasons.soon_short(site, self._ahead, policy),
            *reasons.loop_ahead(self._ahead, situation, self._ahead_share),
            *reasons.loop_closed(loops, situation, share),
        ]

    def _uncorrected(self) -> list[Alarm]:
        """Return the alarm that the position is frozen, or that no fixes correct it, if so."""
        since, why = self._uncorrected_since, self._last.aiding_fault
        if self.track.is_frozen:
            since, why = self.track.freeze.since, reasons.FROZEN
        elif self._jumped_m is not None:
            return [reasons.position_reset(self._jumped_m, self.site.units)]
        if since is None or not why:
            return []
        return [reasons.uncorrected(self._now - since, why, self.drift, self.site.units)]

    def _never_placed(self) -> list[Alarm]:
        """Return the alarm that nothing was ever claimed, if there was time for a position."""
        assert self._heard_since is not None
        silent = self._now - self._heard_since
        if self._is_vouched_for is False:
            return [reasons.never_claimed("the vehicle has never vouched for its position", silent)]
        if self._is_out_of_reach:
            far = 2.0 * self.site.tether_length
            why = f"all positions are more than {far:g} {self.site.units} from the base"
            return [reasons.never_claimed(why, silent)]
        if silent > self.policy.track.dropout_s:
            return [reasons.never_claimed("no position has come", silent)]
        return []

    def _as_planned(self, strands: Sequence[Strand]) -> bool | None:
        if not strands:
            return None
        now = strands[0]
        return self.site.as_planned(now.tether.robot, now.word, self.drift + self._noise_left)

    def _look_ahead(
        self, strands: Sequence[Strand], closed: Sequence[Sequence[Loop]], motion: Motion
    ) -> None:
        """Look some steps farther ahead in each likely class; at the end, note the result.

        The result is the first loop of the likeliest class that has one ahead, and the share of the
        classes in which a loop is ahead, or this one is closed already.
        """
        if not self._looks:
            policy = self.policy.lookahead
            if 0.0 <= motion.time - self._look_began < policy.min_interval_s:
                return
            self._look_began = motion.time
            min_speed = self.policy.track.min_moving_share * self.options.speed
            around = [{loop.around for loop in loops} for loops in closed]
            self._looks = [
                (s.likely, Lookahead(self.site, s.tether, motion, min_speed, known, policy))
                for k, (s, known) in enumerate(zip(strands, around, strict=True))
                if k == 0 or s.likely >= self.policy.alarms.doubt_share
            ]
        steps = self.site.steps_per_update
        for _, look in self._looks:
            steps = look.advance(steps)
        if not all(look.is_done for _, look in self._looks):
            return
        results = [(likely, look.result, look.closed) for likely, look in self._looks]
        self._looks = []
        closing = [(likely, result) for likely, result, _ in results if result.loop is not None]
        first = max(closing, key=lambda pair: pair[0], default=(0.0, results[0][1]))[1]
        self._ahead = replace(first, short_s=results[0][1].short_s)
        looped = sum(
            likely
            for likely, result, known in results
            if result.loop is not None or (first.loop is not None and first.loop.around in known)
        )
        self._ahead_share = looped / sum(likely for likely, _, _ in results)

    def _class_report(self, strand: Strand) -> ClassReport:
        site, nodes = self.site, strand.tether.nodes
        return ClassReport(
            strand.word,
            strand.likely,
            site.describe_path(nodes, strand.word),
            strand.tether.length,
            site.tether_length - strand.tether.length,
            site.turning(nodes),
            nodes,
        )


__all__ = ["Guard", "GuardOptions"]
