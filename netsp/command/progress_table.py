"""The progress table and the closing summary that people read."""

from __future__ import annotations

import threading
import time
from typing import Protocol, TextIO

from netsp.base.errors import counted
from netsp.command.command_policy import CommandPolicy
from netsp.gtsp.travel.result import Progress
from netsp.model.problem import Problem
from netsp.model.solution import EXACT_ROADMAPS, Solution, Status

_HEADER = (
    f"{'time':>7}  {'stage':<10} {'tour':>12} {'bound':>12} {'gap':>9} {'of':>11} {'cuts':>6} "
    f"{'vertices':>8} {'legs':>9} {'iteration':>11}"
)


class Named(Protocol):
    """Problem or mission that is solved."""

    @property
    def name(self) -> str:
        """Name in the first line of the table."""

    @property
    def summary(self) -> str:
        """Description in one line."""


class ProgressTable:
    """Table with a row for every better tour and new stage, and at intervals for the bound."""

    def __init__(self, stream: TextIO, policy: CommandPolicy = CommandPolicy()) -> None:
        self.stream, self._policy = stream, policy
        self._header = False
        self._last: Progress | None = None
        self._shown = 0.0
        self._held: tuple[float, Progress] | None = None
        self._begin = time.monotonic()
        self._slow = ""
        self._subject: tuple[str, str] | None = None
        self._patience = threading.Timer(policy.silence_s, self._explain)
        self._patience.daemon = True

    def begin(self, problem: Named, slow: str = "building the roadmap …") -> None:
        """Announce the problem.

        Parameters
        ----------
        slow
            Line to print if nothing else is printed for `silence_s` seconds.
        """
        self._slow = slow
        self._begin = time.monotonic()
        self._print(f"{problem.name}: {problem.summary}")
        self._patience.start()

    def _explain(self) -> None:
        self._print(self._slow)

    def __call__(self, row: Progress) -> None:
        """Print a row of progress if it is news or a row is due, else hold it back."""
        is_news = (
            self._last is None
            or row.stage != self._last.stage
            or row.incumbent != self._last.incumbent
        )
        # the solver's own time does not count the roadmap, which the summary does
        now = time.monotonic()
        if is_news or now - self._shown >= self._policy.row_interval_s:
            self._show(now - self._begin, row)
        else:
            self._held = now - self._begin, row

    def tell(self, stage: str, text: str) -> None:
        """Print a line about work that has no tour and bound of its own, such as a proof.

        A line that begins with the same word as the last one is left out until a row is due.
        """
        self.end()
        now, subject = time.monotonic(), (stage, text.partition(" ")[0])
        if subject != self._subject or now - self._shown >= self._policy.row_interval_s:
            self._print(f"{now - self._begin:>6.1f}s  {stage:<10} {text}")
            self._subject, self._shown = subject, now

    def __enter__(self) -> ProgressTable:
        return self

    def __exit__(self, *_: object) -> None:
        self._patience.cancel()

    def end(self) -> None:
        """Print the last row if it was held back."""
        if self._held is not None:
            self._show(*self._held)

    def _show(self, seconds: float, row: Progress) -> None:
        self._patience.cancel()
        if not self._header:
            self._print(_HEADER)
            self._header = True
        tour = "-" if row.incumbent is None else f"{row.incumbent:.6g}"
        bound = gap = scope = "-"
        if row.bound is not None and row.bound.length > 0.0:  # no tour is shorter than 0 anyway
            bound, scope = f"{row.bound.length:.6g}", row.bound.scope.column
            if row.incumbent is not None:
                gap = row.bound.percent(row.incumbent, 3)
        self._print(
            f"{seconds:>6.1f}s  {row.stage:<10} {tour:>12} {bound:>12} {gap:>9} {scope:>11} "
            f"{row.cuts or '-':>6} {row.vertices or '-':>8} {row.legs or '-':>9} "
            f"{row.iteration:>11}"
        )
        self._last, self._held, self._shown = row, None, time.monotonic()

    def _print(self, text: str) -> None:
        print(text, file=self.stream, flush=True)


def summary(
    problem: Problem,
    solution: Solution,
    output: str | None = None,
    picture: str | None = None,
    trace: str | None = None,
    policy: CommandPolicy = CommandPolicy(),
    proof: str | None = None,
) -> str:
    """Return the result in a few lines; `proof` is the name of the proof file."""
    t = solution.timings
    times = (
        f"roadmap {t.roadmap_s:.2f} s, legs {t.matrix_s:.2f} s, solver {t.solve_s:.2f} s, "
        f"total {t.total_s:.2f} s"
    )
    if solution.status is Status.INFEASIBLE:
        along = "" if solution.roadmap in EXACT_ROADMAPS else f" along roadmap {solution.roadmap}"
        return f"there is no tour{along} ({times})"
    if solution.length is None:
        return (
            f"no tour found by {solution.solver} ({times}); give it more time or more iterations, "
            "or choose another --solver"
        )
    verdict = solution.proof
    if solution.status is Status.INVALID:
        verdict = "INVALID: the solver is blind to the tether"
    elif solution.bound is not None and solution.lower_bound:
        if not solution.status.is_optimal:
            verdict = solution.bound.says(solution.length, problem.units)
        elif not solution.bound.proves(solution.length):
            bound_text = solution.bound.says(solution.length, problem.units)
            verdict = f"{solution.status.verdict}; {bound_text}"
    names = [problem.goal_name(v.goal) for v in solution.tour]
    if solution.classes == "shortest" and solution.status is not Status.OPTIMAL_OF_KEPT:
        verdict += "; not all classes were kept"
    longest = max((v.tether_length for v in solution.tour), default=0.0)
    wrapped = ", ".join(problem.obstacle_name(k) for k in solution.entangled)
    lines = [
        f"tour     {solution.length:.6f} {problem.units}, {verdict}",
        f"order    base → {' → '.join(names)} → base",
        f"tether   longest {longest:.6g} of {problem.tether_length:g} {problem.units}",
        f"time     {times}",
    ]
    if solution.entangled:
        lines.insert(1, f"wraps    {len(solution.entangled)} obstacles: {wrapped}")
    if solution.legs_left_out:
        lines.insert(1, _left_out(problem, solution, policy.max_named_legs))
    if about_proof := proof_line(problem, solution, proof):
        lines.insert(len(lines) - 1, about_proof)
    if output:
        lines.append(f"solution {output}")
    if picture:
        lines.append(f"picture  {picture}")
    if trace:
        lines.append(f"trace    {trace}")
    return "\n".join(lines)


def proof_line(problem: Problem, solution: Solution, file: str | None) -> str | None:
    """Return the line that says what a proof file shows, or what a claim rests on without one.

    Parameters
    ----------
    file : str or None
        Name of the proof file that was asked for.
    """
    if file is None:
        if solution.status is not Status.OPTIMAL or solution.kept_order:
            return None
        return "proof    none written; --proof FILE writes one that anyone can check"
    if solution.certified == "none":
        return None  # a warning has said why
    shown = solution.certified_lower_bound
    if solution.certified == "optimal" or shown is None:
        what = "there is no tour" if solution.length is None else "no tour is shorter"
        tour = "" if solution.length is None else "TOUR "
        command = f"netsp verify PROBLEM {tour}--proof {file}"
        return f"proof    {file}: {what}; anyone can check it ({command})"
    return (
        f"proof    {file}: no tour is shorter than {shown.length:.6f} {problem.units}; no more is "
        f"shown, because {solution.certified_reason}"
    )


def _left_out(problem: Problem, solution: Solution, limit: int) -> str:
    """Return the line that says which legs were left out."""
    legs = [f"{problem.goal_name(a)} to {problem.goal_name(b)}" for a, b in solution.legs_left_out]
    others = f" and {len(legs) - limit} more" if len(legs) > limit else ""
    named = ", ".join(legs[:limit]) + others
    return (
        f"left out {counted(len(legs), 'leg')} whose taut path was not found ({named}); the bound "
        "holds for tours along them, too"
    )
