"""Statistics of a comparison's rows: groups, medians with intervals, profiles."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.number_ranges import check_positive, check_shares
from netsp.model.bound_scope import LowerBound, Scope
from netsp.model.solution import Status, solution_scope
from netsp.study.compare.rows import FAILED, TrialRow

SAME_RESULT_TOLERANCE = 1e-6
"""Tolerance, per cent, for the length of one tour when it is summed in another order."""

MAX_CLOSED_GAP = 1e-5
"""Tolerance of the gap of a proven tour; the least accurate proofs are those of paths from a
robot's state."""


@dataclass(frozen=True)
class Cell:
    """Cell of a table: method, number of goals and tether length."""

    method: str
    goals: int
    tether: float


@dataclass(frozen=True)
class Summary:
    """Median of a number over the trials of a cell, with its interval, mean and count."""

    median: float
    low: float
    high: float
    mean: float
    count: int


def methods(rows: Iterable[TrialRow]) -> dict[str, list[TrialRow]]:
    """Return rows by method: the label of the solver, and of the roadmap if there are several."""
    rows = list(rows)
    several = len({r["roadmap"]["label"] for r in rows}) > 1
    out: dict[str, list[TrialRow]] = defaultdict(list)
    for row in rows:
        name = row["solver"]["label"]
        out[f"{name}, {row['roadmap']['label']}" if several else name].append(row)
    return {name: out[name] for name in sorted(out)}


def cells(by_method: dict[str, list[TrialRow]]) -> dict[Cell, list[TrialRow]]:
    """Return rows by method, number of goals and tether length."""
    out: dict[Cell, list[TrialRow]] = defaultdict(list)
    for method, rows in by_method.items():
        for row in rows:
            world = row["world"]
            out[Cell(method, world["goals"], world["tether_length"])].append(row)
    return dict(out)


def best_lengths(rows: Iterable[TrialRow]) -> dict[str, float]:
    """Return the length of the best known valid tour of each problem, by its sha256."""
    out: dict[str, float] = {}
    for row in rows:
        if row.get("length") is not None and row["status"] != "invalid":
            key = row["problem_sha256"]
            out[key] = min(out.get(key, np.inf), row["length"])
    return out


@dataclass(frozen=True)
class ReportPolicy:
    """Policy of the numbers in reports about comparisons.

    Attributes
    ----------
    confidence
        Confidence level of the intervals around medians, 0 to 1.
    min_axis_range
        Minimum range of a linear axis: 1 %, or one obstacle, the smallest difference worth showing.
    """

    confidence: float = 0.95
    min_axis_range: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "confidence")


def over_best(row: TrialRow, best: dict[str, float]) -> float | None:
    """Return the excess of a row's tour over the best of its problem, per cent."""
    key = row.get("problem_sha256")
    if row.get("length") is None or key not in best:
        return None
    over = float(100.0 * (row["length"] / best[key] - 1.0))
    return over if abs(over) > SAME_RESULT_TOLERANCE else 0.0


def summary(values: Sequence[float], policy: ReportPolicy = ReportPolicy()) -> Summary | None:
    """Return the median with a distribution-free confidence interval.

    Its ends are order statistics by the binomial distribution; with few trials, they are the
    minimum and the maximum.
    """
    if not values:
        return None
    x = np.sort(np.asarray(values, dtype=float))
    n = len(x)
    from scipy.stats import binom

    k = int(binom.ppf(0.5 * (1.0 - policy.confidence), n, 0.5))
    k = max(0, min(k - 1, (n - 1) // 2)) if k > 0 else 0
    return Summary(float(np.median(x)), float(x[k]), float(x[n - 1 - k]), float(x.mean()), n)


def failures(rows: Iterable[TrialRow]) -> list[TrialRow]:
    """Return the rows without a result."""
    return [r for r in rows if r["status"] in FAILED or r["status"] == "no_solution_found"]


def is_proven(row: TrialRow) -> bool:
    """Return whether a row's tour is proven to be the shortest of the scope of its bound."""
    try:
        status = Status(row["status"])
    except ValueError:  # the trial failed
        return False
    return status.is_optimal and (row.get("gap") or 0.0) <= MAX_CLOSED_GAP


def bound_of(row: TrialRow) -> LowerBound | None:
    """Return the lower bound of a row with its scope, or None.

    Parameters
    ----------
    row : dict
        Row of a trial. Rows of older versions have no scope; it follows from their roadmap.

    Returns
    -------
    LowerBound or None
        None without a bound.
    """
    if row.get("lower_bound") is None:
        return None
    named = row.get("lower_bound_of")
    if named in set(Scope):
        return LowerBound(row["lower_bound"], Scope(named))
    rule = row["roadmap"].get("options", {}).get("classes")
    scope = solution_scope(row["roadmap"]["name"], "non-looping" if rule == "non-looping" else None)
    return LowerBound(row["lower_bound"], scope)


def profile(by_method: dict[str, list[TrialRow]]) -> dict[str, Floats]:
    """Return the performance profile of each method (Dolan & Moré 2002).

    It consists of the sorted ratios of its time to proof to that of the fastest method, over the
    problems that any method proved; inf if the method did not prove the problem. Methods without a
    proof are left out.
    """
    times: dict[str, dict[tuple[str, int], float]] = {}
    for method, rows in by_method.items():
        proven = {(r["problem_sha256"], r["seed"]): r["total_s"] for r in rows if is_proven(r)}
        if proven:
            times[method] = proven
    problems = sorted(set().union(*times.values())) if times else []
    fastest = {p: min(t[p] for t in times.values() if p in t) for p in problems}
    return {
        method: np.sort([t.get(p, np.inf) / max(fastest[p], 1e-9) for p in problems])
        for method, t in times.items()
    }


def gap_over_time(rows: Iterable[TrialRow], best: dict[str, float], times: Floats) -> Floats | None:
    """Return the median excess over the best known length at given times, per cent.

    It is inf before the first tour. Return None if no row has a history.
    """
    curves = []
    for row in rows:
        history = row.get("history") or []
        known = best.get(row.get("problem_sha256", ""))
        if not history or known is None or row["status"] == "invalid":
            continue
        at = np.array([h[0] for h in history])
        length = np.array([np.inf if h[1] is None else h[1] for h in history])
        index = np.searchsorted(at, times, side="right") - 1
        value = np.where(index >= 0, length[np.maximum(index, 0)], np.inf)
        curves.append(100.0 * (np.maximum(value, known) / known - 1.0))
    return np.asarray(np.median(curves, axis=0)) if curves else None
