"""Record of a run that is written during the run, so that it outlives the process.

Rows are appended to the log as they come; the state from which the run can be resumed is replaced
at intervals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import Integer, NonNegative, Point3
from netsp.base.files import FileModel, make_folder, write_text
from netsp.base.validated import Model
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.online.execute.execute_policy import ExecutePolicy
from netsp.online.execute.execution_log import ExecutionRow

LOG, STATE, PROBLEM, SOLUTION = "log.csv", "state.json", "problem.json", "solution.json"
"""Names of the files of a run that are written during the run."""


GoalIndex = Annotated[Integer, Field(ge=0)]
"""Number of a goal of the problem, from 0."""


class LeftOut(Model):
    """A goal that was left out."""

    goal: Annotated[GoalIndex, Field(description="index of the goal from 0")]
    reason: Annotated[str, Field(description="reason in words")]


class RunState(FileModel):
    """State of a run (`state.json` of `netsp fly -o RUN`), from which it can be resumed.

    Problem and plan are beside it, in `problem.json` and `solution.json`. Goals of the problem that
    are not named in it were visited.
    """

    file_kind: ClassVar[str] = "run state"

    model_config = ConfigDict(title="netsp run state")

    schema_version: Annotated[Literal[1], Field(description="version of the file format")] = 1
    time: Annotated[NonNegative, Field(description="seconds after the start of the run")]
    tether: Annotated[
        tuple[Point3, ...],
        Field(
            description="(x, y, z) along the taut tether, from the base to the robot, in the "
            "problem's units",
            min_length=2,
            max_length=100_000,
        ),
    ]
    left: Annotated[
        tuple[GoalIndex, ...],
        Field(description="indices from 0 of the goals still to be visited, in the planned order"),
    ]
    left_out: Annotated[
        tuple[LeftOut, ...], Field(description="goals that were left out, each with the reason")
    ] = ()
    cancelled: Annotated[
        tuple[GoalIndex, ...], Field(description="indices from 0 of the goals that were cancelled")
    ] = ()
    reserve: Annotated[
        NonNegative,
        Field(description="length of tether that repairs keep in reserve, in the problem's units"),
    ] = 0.0
    problem_sha256: Annotated[
        tuple[str, ...],
        Field(
            description="hashes of the problem beside it, which must not be edited: one, or two "
            "while the problem is replaced; none in states of earlier versions",
            max_length=2,
        ),
    ] = ()

    def check(self, problem: Problem, source: str) -> None:
        """Raise InputError for the state of another problem.

        Parameters
        ----------
        source : str
            Name of the state in messages.
        """
        if self.problem_sha256 and problem.sha256 not in self.problem_sha256:
            raise InputError(
                f"{source}: problem_sha256: is of another problem; expected the {PROBLEM} that the "
                "run wrote, unchanged"
            )
        left_out = tuple(g.goal for g in self.left_out)
        goals_by_field = {"left": self.left, "left_out": left_out, "cancelled": self.cancelled}
        for field_name, goals in goals_by_field.items():
            for goal in goals:
                if goal >= len(problem.goals):
                    raise InputError(
                        f"{source}: {field_name}: expected goals below {len(problem.goals)}, got "
                        f"{goal}"
                    )
        for goal in self.left:
            if self.left.count(goal) > 1 or goal in (*left_out, *self.cancelled):
                raise InputError(
                    f"{source}: left: expected every goal once in left, left_out and cancelled, "
                    f"got {goal} twice"
                )
        distance = float(np.linalg.norm(np.array(self.tether[0]) - np.array(problem.base)))
        if distance > 1e-6 * problem.scale:
            raise InputError(f"{source}: tether: expected to begin at the base of the problem")


@dataclass(frozen=True)
class ResumePoint:
    """Beginning of a run elsewhere than at the start of its plan.

    Attributes
    ----------
    tether
        (k, 3) the tether from the base to the robot, in its class.
    left
        Goals still to be visited, in order.
    why
        Reason for a new plan, for the log.
    left_out
        Goals that were left out before, with the reason.
    cancelled
        Goals that were cancelled before.
    reserve
        Length of tether that repairs keep, in the problem's units.
    """

    tether: Floats
    left: list[int]
    why: str
    left_out: dict[int, str] = field(default_factory=dict)
    cancelled: tuple[int, ...] = ()
    reserve: float = 0.0


class RunRecord:
    """Writer of log and state of a run into a folder; its log is replaced at the first row.

    Parameters
    ----------
    solution : Solution
        The plan at the start.
    """

    def __init__(
        self, folder: str | Path, solution: Solution, policy: ExecutePolicy = ExecutePolicy()
    ) -> None:
        self.folder, self.solution, self.policy = Path(folder), solution, policy
        self._problem: Problem | None = None
        self._sha256 = ""
        self._state: RunState | None = None
        self._due = -np.inf

    def write_row(self, row: ExecutionRow, problem: Problem, state: Callable[[], RunState]) -> None:
        """Write a row, and the state if it is due.

        Parameters
        ----------
        problem : Problem
            The problem as it is now.
        state : callable
            Returns the present state.
        """
        cells = [round(v, 6) if isinstance(v, float) else v for v in asdict(row).values()]
        if self._problem is None:
            write_text(make_folder(self.folder) / LOG, ",".join(asdict(row)) + "\n")
            write_text(self.folder / SOLUTION, self.solution.to_json())
        with (self.folder / LOG).open("a") as log_file:
            log_file.write(",".join(map(str, cells)) + "\n")
        changed = problem is not self._problem
        if changed or row.time >= self._due:
            self._due = row.time + self.policy.state_interval_s
            self.write_state(problem, state())

    def write_state(self, problem: Problem, state: RunState) -> None:
        """Write the state now, regardless of when the last one was written."""
        if problem is not self._problem:
            before, self._sha256 = self._sha256, problem.sha256
            if self._state is not None:  # in case the run is killed before the new state is written
                self._write(self._state, before, self._sha256)
            write_text(self.folder / PROBLEM, problem.to_json())
            self._problem = problem
        self._state = state
        self._write(state, self._sha256)

    def _write(self, state: RunState, *hashes: str) -> None:
        state = state.model_copy(update={"problem_sha256": hashes})
        write_text(self.folder / STATE, state.to_json())
