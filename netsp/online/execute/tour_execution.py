"""Execution of a solution step by step: vehicle, tether, events and repairs, with a log of all."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.deprecated import renamed_parameters
from netsp.base.errors import InputError, is_interrupt
from netsp.base.field_types import LARGEST, checked_argument, checked_instance, index_of
from netsp.base.geometry import polylines
from netsp.judge import verify
from netsp.model.problem import Problem
from netsp.model.solution import Solution, Status
from netsp.online.execute.detour_around import pushed_aside
from netsp.online.execute.events import Event, Surprises, problem_after
from netsp.online.execute.execution_log import (
    Arrival,
    Entry,
    Execution,
    ExecutionOptions,
    ExecutionRow,
)
from netsp.online.execute.repair_rule import KEPT
from netsp.online.execute.repair_warm_up import should_warm_up_repair, warm_up_repair
from netsp.online.execute.run_record import LeftOut, ResumePoint, RunRecord, RunState
from netsp.online.execute.tether_limits import TETHER_TOLERANCE
from netsp.online.execute.tether_reserve import ReservedLimit
from netsp.online.execute.tour_repair import (
    Repair,
    RepairOptions,
    plan_fault,
    repair,
    reserved_limit,
    split_reachable,
)
from netsp.plan.tour_plan import HOME, Leg, legs_of
from netsp.roadmap.plane_world import PlaneWorld
from netsp.world.scene.field import pushed_out
from netsp.world.simulator.current import Water
from netsp.world.tether import Tether
from netsp.world.tether.resolution import coarsest_delta, suggested_delta
from netsp.world.vehicle import Vehicle, make_vehicle


class StopsFlightError(Exception):
    """Error of a vehicle whose run must not go on, with the reason."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class LiveVehicle(Vehicle, Protocol):
    """Vehicle with a clock of its own, which goes on during planning.

    Attributes
    ----------
    time : float
        Seconds since the run began.
    """

    @property
    def time(self) -> float:
        """Seconds since the run began."""

    def hold(self) -> None:
        """Stay in place until the next path."""


@dataclass(frozen=True)
class _Retreat:
    """Retreat along the tether, because more is out than allowed, and the plan afterwards.

    Attributes
    ----------
    length
        Length of tether at which the retreat ends.
    why, left, event
        Reason for a new plan, its goals, and what happened; see `_Run._replan`.
    """

    length: float
    why: str
    left: list[int]
    event: str


class _Run:
    """Run in progress."""

    def __init__(
        self,
        problem: Problem,
        solution: Solution,
        options: ExecutionOptions,
        live: LiveVehicle | None = None,
        resume_point: ResumePoint | None = None,
    ) -> None:
        self.out = Execution(problem, solution, options)
        self.problem, self.options = problem, options
        self.legs: list[Leg] = [] if resume_point is not None else legs_of(problem, solution)
        self.delta = options.delta or suggested_delta(problem)
        self.now = 0.0
        self._enter_problem(problem, solution.start_tether)
        start = self.world.start if resume_point is None else resume_point.tether[-1]
        if resume_point is None:
            self.tether = self.world.present_tether
        else:
            self.tether = self._tether_along(resume_point.tether)
        self.live = live
        self.vehicle = live or make_vehicle(options.vehicle, start, options.speed)
        self.policy = options.policy
        self.step = self._step_s()
        self.water = Water(options.current, options.gusts, options.seed)
        self.mode, self.is_new_path, self.time_on_leg_s = "tour", True, 0.0
        self.is_shortening = False
        self.retreat: _Retreat | None = None
        if resume_point is None or options.reserve_policy.reserve is not None:
            self.reserve = options.reserve_policy.of_plan(problem, solution)
        else:
            self.reserve = resume_point.reserve
        self.out.reserve = self.reserve
        self.unreachable: set[int] = set()
        self.path = self.legs[0].path if self.legs else np.array([self.vehicle.position])

    def _tether_along(self, line: Floats) -> Tether:
        """Return the tether that a robot has pulled along a line (k, 3) from the anchor."""
        model = self.world.model
        return model.refine(model.drive(model.start(line[0], line[0]), line[1:])[0])

    def _step_s(self) -> float:
        """Return the time of a step; a kinematic vehicle travels the tether's resolution in it."""
        if self.live is not None:
            return self.policy.live_step_s
        if self.options.vehicle != "kinematic":
            return self.policy.dynamic_step_s
        return self.delta / self.options.speed

    def _enter_problem(self, problem: Problem, start_tether: npt.ArrayLike | None = None) -> None:
        """Enter the world of a problem."""
        self.problem = self.out.problem = problem
        self.out.maps.append((round(self.now, 6), problem))
        self.world = PlaneWorld(problem, self.delta, start_tether)

    def resume(self, resume_point: ResumePoint) -> None:
        """Plan the rest of a run from where the robot is."""
        self.out.left_out |= resume_point.left_out
        self.out.cancelled |= dict.fromkeys(resume_point.cancelled, 0.0)
        self._replan_within_limit(resume_point.why, list(resume_point.left), "resumed")

    @property
    def state(self) -> RunState:
        """State that the run can be resumed from."""
        return RunState(
            time=max(self.now, 0.0),
            tether=tuple(map(tuple, self.tether.nodes.tolist())),
            left=tuple(self.left),
            cancelled=tuple(sorted(self.out.cancelled)),
            left_out=tuple(LeftOut(goal=g, reason=why) for g, why in self.out.left_out.items()),
            reserve=self.reserve,
        )

    # a step

    def log_state(self) -> ExecutionRow:
        """Log the present state."""
        x, y, z = (float(v) for v in self.vehicle.position)
        goal = self.left[0] if self.left else HOME
        limit = self.problem.tether_length
        if self.is_shortening and self.tether.length <= limit:
            self.is_shortening = False
        goes_back = self.is_shortening or self.retreat is not None
        mode = "shorten" if goes_back and self.mode != "hold" else self.mode
        row = ExecutionRow(
            round(self.now, 6),
            x,
            y,
            z,
            goal,
            mode,
            self.tether.length,
            limit,
            self.is_shortening,
            self._is_over_limit,
        )
        if len(self.out.rows) % self.policy.tether_rows == 0:
            self.out.tethers.append((row.time, self.tether.nodes.copy()))
        self.out.rows.append(row)
        return row

    def go(self) -> None:
        """Take one step along the path; arrive where the leg ends."""
        points, passed = self.vehicle.go(
            self.path, self.step, self.vehicle.yaw, self.water(self.now), self.is_new_path
        )
        self.is_new_path = False
        step_s = self.step if self.live is None else self.live.time - self.now
        self.now += step_s
        self.time_on_leg_s += step_s
        self._follow(points)
        end = self.path[-1]
        self.path = self.path[min(passed, len(self.path) - 1) :]
        max_distance = (
            1e-9 * self.problem.scale if self.options.vehicle == "kinematic" else self.options.reach
        )
        has_arrived = (
            len(self.path) == 1
            and float(np.linalg.norm(self.vehicle.position - end)) <= max_distance
        )
        policy, leg_s = self.policy, self.legs[0].length / self.options.speed
        is_late = self.time_on_leg_s > policy.leg_grace_s + policy.max_leg_time_ratio * leg_s
        if self.retreat is not None:
            if has_arrived or is_late or self.tether.length <= self.retreat.length:
                retreat, self.retreat = self.retreat, None
                self._replan(retreat.why, retreat.left, retreat.event)
        elif has_arrived:
            self._arrive()
        elif is_late:
            self._leave_out(self.legs[0].goal, "not reached in time")

    def _follow(self, points: Iterable[Floats]) -> None:
        """Move the tether along the points that the robot has passed."""
        for point in points:
            if float(self.world.field.distance(point)) < -0.2 * self.delta:
                point = pushed_out(self.world.field, point, 0.0)[0]
                self.vehicle.stop_at(point)
            self.out.walked += float(np.linalg.norm(point - self.tether.robot))
            self.tether = self.world.model.update(self.tether, point)

    def _arrive(self) -> None:
        leg = self.legs.pop(0)
        # the class at the goal itself counts, although a vehicle with dynamics stops near it
        line = np.vstack([self.tether.nodes, leg.path[-1]])
        word = self.world.word_of(line)
        self.out.arrivals.append(
            Arrival(round(self.now, 6), leg.goal, word, leg.word, self.tether.length, leg.tether)
        )
        self._next()

    def _next(self) -> None:
        self.time_on_leg_s = 0.0
        if self.legs:
            self.path, self.is_new_path = self.legs[0].path, True

    def _leave_out(self, goal: int, why: str) -> None:
        if goal == HOME:
            self.legs = []
            self._log_event("left out", "ignored", f"the base was {why}", 0.0)
            return
        self.out.left_out[goal] = why
        if not self.options.repair:
            self.legs.pop(0)
            first = self.legs[0]
            path = np.vstack([self.vehicle.position, first.path[1:]])
            self.legs[0] = Leg(first.goal, path, first.word, first.tether)
            self._log_event("left out", "ignored", f"{self.problem.goal_label(goal)} {why}", 0.0)
            self._next()
            return
        self._replan(f"{self.problem.goal_label(goal)} {why}", [g for g in self.left if g != goal])

    @property
    def left(self) -> list[int]:
        """Goals that are planned, in order."""
        if self.retreat is not None:
            return list(self.retreat.left)
        return [leg.goal for leg in self.legs if leg.goal != HOME]

    # events

    def on_event(self, event: Event) -> None:
        """Let an event happen, and repair what it breaks."""
        left, reason = self._apply(event)
        restored = self._reachable_again() if self.options.repair else []
        if restored:
            names = ", ".join(map(self.problem.goal_label, restored))
            left, reason = [*left, *restored], f"within reach again: {names}"
            for goal in restored:
                del self.out.left_out[goal]
        if self._is_over_limit and self.options.repair:
            reason = reason or (
                f"{self.tether.length:.4g} of {self.problem.tether_length:g} {self.problem.units} "
                "of tether were out"
            )
        if reason is None:
            limit = self._reserved(left) if self.options.repair else None
            reason, legs = plan_fault(
                self.problem, self.tether.nodes, self._legs_from_here(), limit
            )
            if reason is None:
                self.legs = legs
                self.path, self.time_on_leg_s = self.legs[0].path[1:], 0.0
        if reason is None:
            self._log_event(event.kind, KEPT, "the rest of the plan still holds", 0.0)
        elif not self.options.repair:
            self._log_event(event.kind, "ignored", reason, 0.0)
            for goal in set(left) - set(self.left):
                self.out.left_out[goal] = "was added, and plans are not repaired"
        else:
            self._replan_within_limit(reason, left, event.kind)

    def _apply(self, event: Event) -> tuple[list[int], str | None]:
        """Change the world as an event says; return the goals to be visited, and the reason for a
        new plan if there is one already."""
        left, reason = self.left, None if self.retreat is None else self.retreat.why
        if event.push is not None:
            self._push(np.array(event.push))
            return left, "pushed off its path"
        old_problem = self.problem
        self._enter_problem_after(event)
        if event.add_goal is not None:
            added = len(old_problem.goals)
            left, reason = [*left, added], f"{self.problem.goal_label(added)} was added"
        elif event.cancel_goal is not None:
            cancelled = index_of(event.cancel_goal, list(old_problem.goals), "cancel_goal")
            if cancelled in left:
                left = [g for g in left if g != cancelled]
                reason = f"{old_problem.goal_label(cancelled)} was cancelled"
            if self.options.repair and (cancelled in self.left or cancelled in self.out.left_out):
                self.out.left_out.pop(cancelled, None)
                self.out.cancelled[cancelled] = self.now
        if event.tether_length is not None and self.tether.length > event.tether_length:
            self.is_shortening = True
        return left, reason

    def on_request(self, event: Event) -> None:
        """Let an event happen that nobody could check before."""
        try:
            if event.kind == "push" and self.live is not None:
                raise InputError("push: a real vehicle reports its own position; expected none")
            problem_after(self.problem, event, self.policy)
        except InputError as error:
            self._log_event(event.kind, "ignored", f"cannot be: {error}", 0.0)
            return
        if self.legs:
            self.on_event(event)

    def _reachable_again(self) -> list[int]:
        """Return the goals that no tether reached, and one does now."""
        unreached = [g for g in self.unreachable if g in self.out.left_out]
        restored = split_reachable(self.problem, unreached)[0] if unreached else []
        self.unreachable -= set(restored)
        return restored

    def on_late_event(self, event: Event) -> None:
        """Log an event after the end."""
        self._log_event(event.kind, "ignored", f"came at {event.time:g} s, after the end", 0.0)
        if event.add_goal is not None:
            problem = problem_after(self.problem, event, self.policy)
            self.problem = self.out.problem = problem
            self.out.left_out[len(problem.goals) - 1] = "was added after the end"

    def _legs_from_here(self) -> list[Leg]:
        """Return the legs that are left, the first from the position of the vehicle."""
        first = self.legs[0]
        path = np.vstack([self.vehicle.position, self.path])
        return [Leg(first.goal, path, first.word, first.tether), *self.legs[1:]]

    def _enter_problem_after(self, event: Event) -> None:
        """Enter the world after an event.

        An obstacle that appears on the tether or the robot pushes them aside, to the nearer side;
        one that vanishes lets the tether go.
        """
        problem = problem_after(self.problem, event, self.policy)
        self._enter_problem(problem)
        if event.kind not in ("appear", "vanish", "move"):
            return
        line = pushed_aside(problem, self.tether.nodes, 1e-2 * self.delta)
        if not np.array_equal(line[-1], self.vehicle.position):
            self.vehicle.stop_at(line[-1])
        self.tether = self._tether_along(line)
        if self.tether.length > problem.tether_length:
            self.is_shortening = True  # the event has made it longer

    def _push(self, by: Floats) -> None:
        """Carry the robot off, as far as there is water."""
        start = self.vehicle.position
        # longer pushes than twice the tether have no effect
        max_distance = 2.0 * max(self.problem.tether_length, self.tether.length) + self.delta
        by = by * min(1.0, max_distance / max(float(np.linalg.norm(by)), 1e-300))
        points = polylines.dense(np.array([start, start + by]), 0.5 * self.delta)
        for point in points:
            if float(self.world.field.distance(point)) < 0.0:
                break
            tether = self.world.model.update(self.tether, point)
            if tether.length > max(self.problem.tether_length, self.tether.length):
                break  # held by its tether
            self.tether = tether
            self.vehicle.stop_at(point)

    @property
    def _is_over_limit(self) -> bool:
        return self.tether.length > self.problem.tether_length * (1.0 + TETHER_TOLERANCE)

    def _reserved(self, goals: list[int]) -> ReservedLimit:
        """Return the length of tether that a plan through goals may use."""
        return reserved_limit(self.problem, goals, self.reserve)

    def _replan_within_limit(self, why: str, left: list[int], event: str) -> None:
        """Plan again, after going back along the tether if too much of it is out.

        The tether gets shorter nowhere faster than along itself. While the limit is kept, only one
        that was lowered below what is out and the reserve is a reason to go back: towards goals
        that leave the reserve, tethers get shorter by themselves.
        """
        if self.live is not None and self._is_over_limit:
            self.live.hold()  # otherwise it goes on outward during planning
        limit = self._reserved(left).length
        has_room = self.tether.length <= (limit if event == "tether_length" else np.inf)
        if has_room and not self._is_over_limit:
            self.retreat = None
            self._replan(why, left, event)
            return
        tether_out = self.tether.length
        # a vehicle with dynamics stops anywhere within its reach of a target
        reach = 0.0 if self.options.vehicle == "kinematic" else self.options.reach
        retreat_length = max(min(limit, self.problem.tether_length - reach), 0.0)
        retreat_path = np.ascontiguousarray(self.tether.nodes[::-1])
        self.retreat = _Retreat(retreat_length, why, left, event)
        # lead to the base and stop on the way: a vehicle slows down before the end of its path
        self.legs = [Leg(HOME, retreat_path, (), 0.0)]
        self.path, self.is_new_path, self.time_on_leg_s = retreat_path[1:], True, 0.0
        units = self.problem.units
        self._log_event(
            event,
            "shorten",
            f"{tether_out:.4g} of {self.problem.tether_length:g} {units} of tether are out: back "
            f"along it to {retreat_length:.4g} {units}",
            0.0,
        )

    def _replan(self, why: str, left: list[int], event: str = "left out") -> None:
        if self.live is not None:
            # it has gone on since the last update of its tether, perhaps past an obstacle
            self.live.hold()
            line = np.array([self.tether.robot, self.vehicle.position])
            self._follow(polylines.dense(line, 0.5 * self.delta)[1:])
        repaired = self._repair_or_return(why, left)
        self._log_event(event, repaired.kind, repaired.reason, repaired.planning_s)
        self._hold(self.options.planning_limit)
        self.legs = repaired.legs
        for goal, reason in repaired.left_out:
            self.out.left_out[goal] = reason
        if repaired.kind != "defect":
            self.unreachable |= {goal for goal, _ in repaired.left_out}
        self._next()

    def _repair_or_return(self, why: str, left: list[int]) -> Repair:
        """Return a repaired plan; after an error in planning, one back along the tether.

        The robot must come home whatever is wrong with netsp. The error is logged and counted, and
        sets the exit code of the command.
        """
        begin, options = time.perf_counter(), self.options
        policy = replace(self.policy.repair, time_limit_s=options.planning_limit)
        repair_options = RepairOptions(options.speed, options.seed, self.reserve, policy)
        try:
            return repair(
                self.problem, self.vehicle.position, self.tether.nodes, left, why, repair_options
            )
        except Exception as error:
            if is_interrupt(error):
                raise KeyboardInterrupt from error
            home = Leg(HOME, np.ascontiguousarray(self.tether.nodes[::-1]), (), 0.0)
            cause = f"{type(error).__name__}: {error}"
            left_out = tuple((g, f"a defect of netsp ended planning ({cause})") for g in left)
            reason = f"{why}; a defect of netsp ended planning ({cause})"
            spent = time.perf_counter() - begin
            return Repair("defect", reason, [home], left_out, home.length, spent)

    def _hold(self, seconds: float) -> None:
        """Stay in place until a plan is due, however soon it was ready, so that a seed determines
        the run."""
        if self.live is not None:
            self.now = max(self.now, self.live.time)  # it has held its place during planning
            return
        mode, self.mode = self.mode, "hold"
        until = self.now + seconds
        while self.now < until:
            self.log_state()
            self.now = min(self.now + self.policy.hold_step_s, until)
        self.mode = mode

    def finish(self) -> None:
        """Log the last tether, and whether it is free."""
        self.out.tethers.append((round(self.now, 6), self.tether.nodes.copy()))
        # the few rounds of an update may have left the tether at a corner
        self.out.free = tether_is_free(self.world.model.refine(self.tether), self.delta)

    def _log_event(self, event: str, response: str, reason: str, spent: float) -> None:
        self.out.entries.append(Entry(round(self.now, 6), event, response, reason, spent))


@renamed_parameters(begun="resume_point")
def execute(
    problem: Problem,
    solution: Solution,
    options: ExecutionOptions | None = None,
    *,
    surprises: Surprises | None = None,
    on_step: Callable[[ExecutionRow], None] | None = None,
    vehicle: LiveVehicle | None = None,
    incoming: Callable[[], list[Event]] | None = None,
    record: RunRecord | None = None,
    resume_point: ResumePoint | None = None,
) -> Execution:
    """Carry out a solution in the scene of its problem.

    The obstacles stand from the sea floor to the surface; the tether is anchored at the base.

    Parameters
    ----------
    surprises : Surprises, optional
        Events on the way.
    on_step : callable, optional
        Called with every row. A KeyboardInterrupt in it ends the run, which is returned as far as
        it came.
    vehicle : LiveVehicle, optional
        Vehicle that is not simulated; its `StopsFlightError` ends the run, too.
    incoming : callable, optional
        Called at every step; returns the events that have come since.
    record : RunRecord, optional
        Record of rows and state during the run.
    resume_point : ResumePoint, optional
        Beginning elsewhere than at the start of the solution; the rest is planned from there.

    Raises
    ------
    InputError
        The solution does not belong to the problem, fails its checks or is a baseline's that
        entangles; or bad options or surprises.
    """
    options = options or ExecutionOptions()
    surprises = surprises or Surprises(events=())
    _check(problem, solution, options, surprises, resume_point is not None)
    is_live = incoming is not None or resume_point is not None
    if options.repair and (is_live or (surprises.events and should_warm_up_repair())):
        warm_up_repair()
    begin = time.perf_counter()
    run = _Run(problem, solution, options, vehicle, resume_point)

    def log_row() -> ExecutionRow:
        row = run.log_state()
        if record is not None:
            record.write_row(row, run.problem, lambda: run.state)
        return row

    coming = sorted(surprises.events, key=lambda e: e.time)
    try:
        if resume_point is not None:
            run.resume(resume_point)
        while run.legs:
            while coming and coming[0].time <= run.now:
                run.on_event(coming.pop(0))
            for event in incoming() if incoming is not None else ():
                run.on_request(event)
            row = log_row()
            if on_step is not None:
                on_step(row)
            run.go()
        log_row()
        for event in coming:
            run.on_late_event(event)
    except KeyboardInterrupt:
        run.out.interrupted = True
    except StopsFlightError as stop:
        run.out.stopped = stop.reason
        log_row()
    except Exception:
        if record is not None and run.out.rows:
            with contextlib.suppress(Exception):  # raise the first exception, not a second one
                record.write_state(run.problem, run.state)
        raise
    run.finish()
    run.out.wall_s = time.perf_counter() - begin
    return run.out


def _check(
    problem: Problem,
    solution: Solution,
    options: ExecutionOptions,
    surprises: Surprises,
    is_resumed: bool,
) -> None:
    """Raise InputError for bad options or surprises, or a solution that does not fit the problem;
    the solution of a run that is resumed need not."""
    checked_instance("problem", problem, Problem)
    checked_instance("solution", solution, Solution)
    checked_instance("options", options, ExecutionOptions)
    checked_instance("surprises", surprises, Surprises)
    _check_numbers(options)
    if solution.status is Status.INVALID or solution.length is None:
        raise InputError(f"solution: has status {solution.status.value}; expected a tour that fits")
    verdict = None if is_resumed else verify(problem, solution)
    if verdict is not None and not verdict:
        failed = next(c for c in verdict.checks if not c.passed)
        raise InputError(f"solution: fails its check {failed.name!r}: {failed.detail}")
    surprises.check(problem)
    coarsest = coarsest_delta(problem)
    if (
        options.delta is not None
        and not 0.0 < checked_argument("delta", options.delta, 0.0) <= coarsest
    ):
        raise InputError(
            f"delta: expected at most {coarsest:.4g}, or the tether would slip through the "
            f"thinnest obstacle, got {options.delta!r}"
        )


def _check_numbers(options: ExecutionOptions) -> None:
    for name in ("planning_limit", "speed", "reach"):
        if not checked_argument(name, getattr(options, name), 0.0):
            raise InputError(f"{name}: expected a positive number, got 0")
    checked_argument("gusts", options.gusts, 0.0)
    if not isinstance(options.current, Sequence | np.ndarray) or len(options.current) != 3:
        raise InputError(f"current: expected three numbers, got {options.current!r}"[:200])
    for value in options.current:
        checked_argument("current", value, -LARGEST)
    if not isinstance(options.seed, int | np.integer) or options.seed < 0:
        raise InputError(f"seed: expected a whole number from 0 on, got {options.seed!r}")


def tether_is_free(tether: Tether, delta: float) -> bool:
    """Return whether a tether can be recovered: straight to the robot, resting on nothing."""
    straight = float(np.linalg.norm(tether.robot - tether.anchor))
    return len(tether.nodes) == 2 and tether.length - straight <= 1e-6 * delta
