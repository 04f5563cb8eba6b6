"""Judgement of the claim that no tour is shorter, by a proof file that `netsp_check` checks.

The other checks of a solution measure its tour. A lower bound cannot be measured: without a proof
it is only stated, and the judge says so.
"""

from __future__ import annotations

import math

from netsp.base.errors import counted
from netsp.judge.tour_checks import Check, Verification
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE, LowerBound, Scope
from netsp.model.problem import Problem
from netsp.model.solution import EXACT_ROADMAPS, Solution, Status
from netsp_check import Checked, Refused, check

NAME = "no tour is shorter"
"""Name of the check of a lower bound, as a verdict prints it."""


def with_claim(verdict: Verification, solution: Solution) -> Verification:
    """Return a verdict with a line for what a solution states of all tours, which is not checked.

    Examples
    --------
    >>> from netsp import Problem, solve
    >>> from netsp.judge import verify
    >>> problem = Problem.load("problems/pool.json")
    >>> solution = solve(problem)
    >>> print(with_claim(verify(problem, solution), solution).checks[-1].detail)
    says optimal; not checked: give its proof (netsp verify --proof FILE)
    """
    claim = _claim(solution)
    if claim is None:
        return verdict
    advice = "give its proof (netsp verify --proof FILE)"
    if solution.roadmap not in EXACT_ROADMAPS:
        advice = f"proofs are of all tours, and roadmap {solution.roadmap} knows only some"
    detail = f"says {claim}; not checked: {advice}"
    return _added(verdict, Check(NAME, True, detail, was_made=False))


def with_proof(
    verdict: Verification, problem: Problem, solution: Solution | None, proof: bytes
) -> Verification:
    """Return a verdict with the check of a proof file, compared with the tour if that passed.

    Parameters
    ----------
    verdict : Verification
        Verdict on the solution; empty without one.
    solution : Solution or None
        None to check the proof alone.
    proof : bytes
        Content of the proof file.
    """
    try:
        shown = check(problem.to_json(), proof)
    except Refused as error:
        return _added(verdict, Check(NAME, False, f"the proof does not hold: {error}"))
    fault, relation, is_shown = None, "", True
    if solution is not None:
        fault = _difference(shown, solution)
        if verdict and fault is None:
            fault, relation, is_shown = _compared(shown, problem, solution)
    if fault is not None:
        return _added(verdict, Check(NAME, False, fault))
    detail = f"{proven_words(shown, problem.units)}{relation}"
    return _added(verdict, Check(NAME, True, detail, was_made=is_shown))


def proven_words(shown: Checked, units: str) -> str:
    """Return in words what a proof shows, with what it takes for granted."""
    classes = f"{shown.vertices} {'class' if shown.vertices == 1 else 'classes'}"
    leaves = f"{shown.leaves} {'leaf' if shown.leaves == 1 else 'leaves'}"
    size = f"{classes}, {counted(shown.legs, 'leg')}, {leaves}"
    bound = "there is no tour" if math.isinf(shown.bound) else f"than {shown.bound:.8g} {units}"
    parts = [f"{bound} ({size})"]
    if shown.margin:
        parts.append(f"obstacles grown by {shown.margin:g} {units}")
    if shown.slack:
        parts.append(f"{100.0 * shown.slack:g} % slack")
    if shown.closed_gaps:
        gaps = counted(shown.closed_gaps, "gap")
        parts.append(f"{gaps} narrower than two billionths of the problem's size count as closed")
    return ", ".join(parts)


def _added(verdict: Verification, one: Check) -> Verification:
    return Verification((*verdict.checks, one))


def _claim(solution: Solution) -> str | None:
    """Return what a solution states of all tours, or None if it states nothing."""
    if solution.certified != "none":
        return f"certified: {solution.certified}"
    if solution.status.is_optimal or solution.status is Status.INFEASIBLE:
        return solution.status.value
    return solution.bound.says() if solution.bound is not None and solution.lower_bound else None


def _difference(shown: Checked, solution: Solution) -> str | None:
    """Return how the plan's margin or slack differs from the proof's, or None."""
    by_name = {"margin": (shown.margin, solution.margin), "slack": (shown.slack, solution.slack)}
    for name, (proven, planned) in by_name.items():
        if proven != planned:
            return f"the proof is for {name} {proven:g}, and the tour was planned with {planned:g}"
    return None


def _compared(shown: Checked, problem: Problem, solution: Solution) -> tuple[str | None, str, bool]:
    """Compare a tour that passes its checks with a proof that holds.

    Returns
    -------
    str or None
        Fault of the tour's file; None if there is none.
    str
        Words that compare both.
    bool
        True if the proof shows all that the file states.
    """
    length, units = solution.length, problem.units
    if length is None:
        return None, "", True
    tour = f"this tour is {length:.8g} {units}"
    if shown.bound > length * (1.0 + OPTIMALITY_TOLERANCE):
        return f"the proof says {proven_words(shown, units)}, yet {tour}", "", False
    bound = LowerBound(shown.bound, Scope.ALL_TOURS)
    if bound.proves(length):
        return None, f"; {tour}: certified shortest", True
    above = f"{tour}, {bound.above(length)}"
    stated = solution.certified_bound
    if solution.certified == "optimal" or (stated or 0.0) > shown.bound * (1.0 + 1e-9):
        what = "optimal" if solution.certified == "optimal" else f"bound {stated:.8g} {units}"
        return f"the file says certified: {what}, but this proof shows less: {above}", "", False
    stands = solution.status is Status.OPTIMAL and not solution.kept_order
    words = f"; {above}" + "; optimal, as its file says, is not shown" * stands
    return None, words, not stands
