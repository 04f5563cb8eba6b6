"""Measures of a path and of tethers as text, for `netsp verify --measures` and `compare-path`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from netsp.hsignature.signature_measures import Measures, measure
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.roadmap.paths import TautPaths
from netsp.study.paths import PathMeasures, measure_path
from netsp.view.report.path_wording import path_rows

DEFINITIONS = (
    ("obstacle-free convex hull", "convex_hull"),
    ("obstacle-free linear homotopy", "linear_homotopy"),
    ("local visibility homotopy", "local_visibility"),
)


def describe_path(problem: Problem, path: npt.ArrayLike, times: npt.ArrayLike | None = None) -> str:
    """Return all measures of one path, one line for each."""
    figures = measure_path(problem, path, times=times)
    m = measure(problem, figures.loop if figures.is_closed else _open_loop(figures))
    rows = [
        *path_rows(figures),
        ("winding numbers", _winding(problem, m)),
        ("self-crossings", str(m.self_crossings)),
    ]
    if not m.closed:
        rows += [(name, _verdict(problem, getattr(m, field))) for name, field in DEFINITIONS]
    return aligned(rows)


def aligned(rows: list[tuple[str, str]]) -> str:
    """Return names and values in two columns, one line for each pair."""
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)


def _open_loop(figures: PathMeasures) -> npt.NDArray[np.float64]:
    """Return the part of the loop up to the end of the path."""
    return figures.loop[: figures.loop_end + 1]


def visit_table(m: PathMeasures) -> str:
    """Return every visit of a path as a table.

    Parameters
    ----------
    m : PathMeasures
        Measures of the path.

    Returns
    -------
    str
        Head, and one line for each visit.
    """
    lines = [
        f"{'visit':>5}  {'goal':<12} {'along':>9} {'time s':>9} {'off by':>8} {'tether':>10}  word"
    ]
    for k, v in enumerate(m.visits, 1):
        name = m.problem.goal_name(v.goal) + ("" if v.is_first else " again")
        tether = "unknown" if v.tether is None else f"{v.tether:.6g}"
        lines.append(
            f"{k:>5}  {name:<12.12} {v.along:>9.5g} {v.time_s:>9.5g} {v.miss:>8.3g} "
            f"{tether:>10}  {list(v.word)}"
        )
    return "\n".join(lines)


def describe_tethers(problem: Problem, solution: Solution) -> str:
    """Compare the taut tether at every visit with the definitions of Battocletti et al. 2024."""
    path = np.array(solution.path)[:, :2]
    longest = float(np.hypot(*np.diff(path, axis=0).T).sum()) if len(path) > 1 else 0.0
    paths = TautPaths(problem, max(longest, problem.tether_length))
    head = f"{'visit':>5}  {'goal':<12} {'tether':>10}  {'hull':<5} {'linear':<6} {'sight':<5} word"
    lines = [head]
    for k, visit in enumerate(solution.tour):
        tether = paths.tether_if_found(visit.goal, visit.signature)
        free = ["unknown"] * len(DEFINITIONS)
        if tether is not None:
            m = measure(problem, tether)
            free = ["free" if not getattr(m, field) else "no" for _, field in DEFINITIONS]
        name = problem.goal_name(visit.goal)
        lines.append(
            f"{k + 1:>5}  {name:<12.12} {visit.tether_length:>10.6g}  {free[0]:<5} {free[1]:<6} "
            f"{free[2]:<5} {list(visit.signature)}"
        )
    lines.append(
        "hull, linear, sight: obstacle-free convex hull, obstacle-free linear homotopy and local "
        "visibility\nhomotopy of the taut tether from the base (Battocletti et al. 2024)"
    )
    return "\n".join(lines)


def _winding(problem: Problem, m: Measures) -> str:
    if m.winding is None:
        return "the path is not closed"
    turned = [(k, w) for k, w in enumerate(m.winding) if w]
    return ", ".join(f"{problem.obstacle_name(k)} {w:+d}" for k, w in turned) or "all zero"


def _verdict(problem: Problem, broken: tuple[int, ...]) -> str:
    if not broken:
        return "holds"
    return f"fails at {', '.join(problem.obstacle_name(k) for k in broken)}"


def entered(problem: Problem, path: npt.ArrayLike) -> list[str]:
    """Return the obstacles that a path passes through.

    Parameters
    ----------
    problem : Problem
        Problem with the obstacles, which are not grown by the clearance.
    path : array_like, shape (k, 2) or (k, 3)
        The path.

    Returns
    -------
    list of str
        Names of the obstacles, as in messages.
    """
    import shapely

    xy = np.asarray(path, dtype=float)[:, :2]
    if len(xy) < 2:
        return []
    line = shapely.LineString(xy)
    return [
        problem.obstacle_label(i)
        for i, o in enumerate(problem.obstacles)
        if line.intersection(o.shape(0.0)).length > 1e-6 * problem.scale
    ]
