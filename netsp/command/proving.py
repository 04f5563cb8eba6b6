"""Proofs in `netsp solve --proof`: from a solution to the proof file and what it shows."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from typing import TYPE_CHECKING

from netsp.base.errors import InputError, LimitReachedError
from netsp.command import messages

if TYPE_CHECKING:
    from netsp.base.clock import Clock
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution
    from netsp.plan.proof.certify import Certificate


def check_provable(args: argparse.Namespace, problem: Problem) -> None:
    """Raise InputError if `--proof` is given where no proof is possible."""
    from netsp.base.files import STANDARD
    from netsp.model.solution import EXACT_ROADMAPS

    if args.proof_vipr and args.proof is None:
        raise InputError(
            "--proof-vipr: derives only the last part of a proof; expected --proof FILE beside it"
        )
    if args.proof is None:
        return
    if args.proof in (STANDARD, ""):
        got = "- (standard output)" if args.proof else "an empty one"
        raise InputError(f"--proof: expected the name of a file, got {got}")
    if args.roadmap not in EXACT_ROADMAPS:
        raise InputError(
            f"--proof: proofs are of all tours, and --roadmap {args.roadmap} knows only some; "
            "expected --roadmap taut"
        )
    if args.keep_order:
        raise InputError(
            "--proof: proofs are of tours in any order, and --keep-order gives one; expected only "
            "one of both"
        )
    if problem.state is not None:
        raise InputError(
            "--proof: the problem starts from a state, and proofs are of tours that start at the "
            "base; expected a problem without state"
        )


def with_proof(
    file: str,
    problem: Problem,
    solution: Solution,
    clock: Clock,
    tell: Callable[[str], None],
    vipr_file: str | None = None,
) -> Solution:
    """Write a proof for a solution, and return the solution with what the proof shows.

    Without a proof, a warning says why, and no file is written. Ctrl-C and the end of the time end
    the search for a proof, not the command.

    Parameters
    ----------
    file : str
        Name of the proof file.
    clock : Clock
        Clock of the command.
    tell : callable
        Called with a line of progress.
    vipr_file : str, optional
        Name of the file for VIPR, which derives the bound from the integer program of the proof.
    """
    from netsp.base.files import write_bytes
    from netsp.base.interrupt_signals import deferred_interrupts

    certificate = _certificate(problem, solution, clock, tell)
    reason = certificate.reason
    if certificate.proof is not None:
        try:
            with deferred_interrupts():
                write_bytes(file, certificate.proof)
            if vipr_file:
                _write_for_vipr(vipr_file, problem, certificate.proof, clock)
            return solution.with_certificate(certificate.level, certificate.bound, reason)
        except InputError as error:
            reason = str(error)
        except KeyboardInterrupt:  # came while the file was written, which is there now
            return solution.with_certificate(certificate.level, certificate.bound, reason)
    old = "; the file of that name is an older one" if os.path.exists(file) else ""
    messages.warning(f"no proof: {reason}; {file} was not written{old}")
    return solution.with_certificate("none", reason=reason)


def _write_for_vipr(file: str, problem: Problem, proof: bytes, clock: Clock) -> None:
    """Write the file for VIPR; if there is none, a warning says why."""
    from netsp.base.files import write_text
    from netsp.plan.proof.vipr_export import vipr

    try:
        text = clock.bounded("exporting for VIPR", lambda: vipr(problem.to_json(), proof))
        write_text(file, text)
    except (InputError, LimitReachedError) as error:
        messages.warning(f"no file for VIPR: {error}; {file} was not written")


def _certificate(
    problem: Problem, solution: Solution, clock: Clock, tell: Callable[[str], None]
) -> Certificate:
    """Return the certificate of a solution, or one of level "none" if time was up."""
    from netsp.base.interrupt_signals import until_interrupt
    from netsp.plan.proof.certify import Certificate, certify

    stopped, aim = "interrupted", _aim(solution)
    if clock.is_up:
        reason = stopped if clock.is_stopped else "no time was left after the solve"
        return Certificate("none", reason)
    try:
        with until_interrupt(clock) as rest:
            try:
                found = rest.bounded(
                    "proving", lambda: certify(problem, aim, time_limit=rest, on_progress=tell)
                )
            except LimitReachedError:
                found = Certificate("none", "time limit reached")
            except MemoryError:
                found = Certificate("none", "out of memory")
            is_stopped = rest.is_stopped
    except KeyboardInterrupt:
        return Certificate("none", stopped)
    if is_stopped and found.level == "none":
        return Certificate("none", stopped)
    if aim is not solution and found.level == "optimal":
        return Certificate("bound", "the solver proved no more", found.bound, found.proof)
    return found


def _aim(solution: Solution) -> Solution:
    """Return the solution with the length to prove: the solver's bound on all tours if its tour is
    longer, because the search for a proof of the tour's length may fail after a long time."""
    from netsp.model.bound_scope import Scope

    bound, length = solution.bound, solution.length
    if bound is None or length is None or bound.scope is not Scope.ALL_TOURS:
        return solution
    if bound.proves(length) or bound.length <= 0.0:
        return solution
    return solution.model_copy(update={"length": bound.length})


def infeasible_solution(problem: Problem, args: argparse.Namespace) -> Solution:
    """Return a solution that says that there is no tour, for a proof of it."""
    from netsp.model.solution import ProblemReference, Solution, Status
    from netsp.plan.answer import versions

    return Solution(
        problem=ProblemReference(name=problem.name, sha256=problem.sha256),
        solver=args.solver,
        roadmap=args.roadmap,
        margin=args.margin,
        slack=args.slack,
        status=Status.INFEASIBLE,
        length=None,
        lower_bound=None,
        gap=None,
        versions=versions(),
    )
