"""Wording of the measures of paths, for the command line and the page."""

from __future__ import annotations

from netsp.base.errors import counted
from netsp.model.problem import Problem
from netsp.study.compare.path_comparison import ComparedPath, PathComparison
from netsp.study.paths import PathMeasures
from netsp.study.paths.free_route import Stretch

MIN_PERCENT = 0.005
"""Tolerance of equal lengths, per cent: smaller differences come from the polylines that
circumscribe arcs."""


def path_rows(m: PathMeasures) -> list[tuple[str, str]]:
    """Return the names and values of the measures of a path.

    Returns
    -------
    list of (str, str)
        Name and value of each.
    """
    problem = m.problem
    u = problem.units
    names = " → ".join(problem.goal_name(g) for g in m.order)
    seen = f"{len(m.order)} of {problem.visits} within {m.radius:g} {u}"
    rows = [
        ("length", f"{m.length:.6g} {u}" + ("" if m.has_heights else ", heights of the goals")),
        ("time", _time(m)),
        ("goals visited", f"{seen}: {names}" if names else seen),
    ]
    if m.missing:
        missed = ", ".join(problem.goal_name(g) for g in m.missing)
        rows.append(("goals missed", missed))
    if m.revisits:
        again = [
            problem.goal_name(g) + (f" ({n}×)" if n > 1 else "") for g, n in m.revisits.items()
        ]
        rows.append(("goals revisited", ", ".join(again)))
    rows += [
        ("longest tether", _longest(m)),
        ("word", f"{list(m.word)}" if m.word else "empty"),
        ("entangled obstacles", _entangled(problem, m)),
        ("comes home", _home(m)),
    ]
    for kind, name in (
        ("obstacle", "runs through"),
        ("touching", "runs between"),
        ("bounds", "leaves the bounds"),
        ("clearance", "within the clearance"),
    ):
        found = [s for s in m.stretches if s.kind == kind]
        if found:
            rows.append((name, _stretches(problem, found)))
    return rows


def _time(m: PathMeasures) -> str:
    how = "by its time stamps, mean speed" if m.is_timed else "at"
    return f"{m.duration_s:.5g} s {how} {m.speed:.3g} {m.problem.units}/s"


def _longest(m: PathMeasures) -> str:
    limit, u = m.problem.tether_length, m.problem.units
    if m.longest_tether is None:
        return "unknown: obstacles enclose a part of the path"
    x, y = m.longest_place
    over = "" if m.fits else f", {m.longest_tether - limit:.4g} {u} too long"
    return (
        f"{m.longest_tether:.6g} of {limit:g} {u}{over}, at ({x:.4g}, {y:.4g}), "
        f"{m.longest_at:.5g} {u} along"
    )


def _home(m: PathMeasures) -> str:
    u = m.problem.units
    if not m.is_closed:
        which = f"ends {m.end_gap:.4g} {u} from the base"
        if m.start_gap > m.radius:
            which = f"begins {m.start_gap:.4g} {u} from the base" + (
                f" and {which}" if m.end_gap > m.radius else ""
            )
        held = "entangled" if m.entangled else "free"
        return f"no, {which}; going straight there it would be {held}"
    if m.word:
        return "yes, entangled"
    return "yes, free" if m.is_free else "yes"


def _stretches(problem: Problem, found: list[Stretch]) -> str:
    """Return in words where a path is in obstacles, within their clearance, or out of bounds."""
    u, out = problem.units, []
    for key in dict.fromkeys(s.obstacles for s in found):
        parts = [s for s in found if s.obstacles == key]
        names = " and ".join(problem.obstacle_name(k) for k in key)
        size = sum(s.end - s.start for s in parts)
        depth = max(s.depth for s in parts)
        times = f", {counted(len(parts), 'time')}" if len(parts) > 1 else ""
        x, y = parts[0].place
        if parts[0].kind == "touching":
            out.append(f"{names} at ({x:.4g}, {y:.4g}){times}")
            continue
        by = {"obstacle": "deep", "clearance": f"of {problem.clearance:g} short", "bounds": "out"}[
            parts[0].kind
        ]
        begin = f"{names} " if names else ""
        out.append(
            f"{begin}for {size:.3g} {u} from ({x:.4g}, {y:.4g}) on, {depth:.3g} {u} {by}{times}"
        )
    return "; ".join(out)


def _entangled(problem: Problem, m: PathMeasures) -> str:
    if not m.entangled:
        return "none"
    names = ", ".join(problem.obstacle_name(k) for k in m.entangled)
    return f"{len(m.entangled)}: {names}" + ("" if m.is_closed else ", going straight home")


def beside_tour(found: PathComparison, length: float | None) -> str:
    """Return in words how much longer than the tour a path is."""
    more, percent = found.longer_by(length), found.percent(length)
    if more is None or percent is None:
        return "no tour to compare with"
    if abs(percent) < MIN_PERCENT:
        return "as long"
    word = "longer" if more >= 0.0 else "shorter"
    return f"{abs(more):.4g} {found.problem.units} ({abs(percent):.3g} %) {word}"


def order_in_words(found: PathComparison, path: ComparedPath) -> str:
    """Return in words how long the shortest tour in the order of a path is."""
    if path.order_length is None:
        return path.order_note
    return (
        f"{path.order_length:.6g} {found.problem.units}, {path.order_note}; beside the planned "
        f"tour {beside_tour(found, path.order_length)}"
    )


def figures_of(found: PathComparison, path: ComparedPath) -> list[tuple[str, str]]:
    """Return the figures of a path and its comparison with the tour as text.

    Returns
    -------
    list of (str, str)
        Name and value of each.
    """
    rows = path_rows(path.measures)
    m, u = path.measures, found.problem.units
    beside = beside_tour(found, m.length)
    if m.missing and found.tour is not None:
        beside += f", but misses {counted(found.problem.visits - len(m.order), 'goal')}"
    rows[1:1] = [("beside the tour", beside)]
    rows.append(("this order", order_in_words(found, path)))
    if path.visited_length is not None:
        more = m.length - path.visited_length
        percent = 100.0 * more / path.visited_length if path.visited_length else 0.0
        rows.append(
            (
                "its goals alone",
                f"a tour of {path.visited_length:.6g} {u} visits them; the path is {more:.4g} {u} "
                f"({percent:.3g} %) longer",
            )
        )
    return rows
