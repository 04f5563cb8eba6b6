"""Briefing for the operator.

It has each visit in numbers, the course of the tether there in words, what to do if the tether
snags, and by how much the world may differ from the map.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

import numpy as np

from netsp.base.errors import counted
from netsp.judge import Verification
from netsp.model.import_record import Site
from netsp.model.problem import Problem
from netsp.model.solution import Solution, Status
from netsp.plan.sizing.tether_margins import Margins, margins
from netsp.plan.tour_plan import legs_of
from netsp.roadmap.paths import TautPaths
from netsp.world.side_names import Passage, back_from, bearing, listed, passages

STYLE = """
.ok { color: #2b8a3e } .bad { color: #c92a2a } .wide { overflow-x: auto }
th.words, td.words { text-align: left } td { vertical-align: top }
"""
"""Style sheet of tables and checks."""


def table(head: Sequence[str], rows: Sequence[Sequence[str]], words: Sequence[int] = ()) -> str:
    """Return a table that scrolls sideways on a narrow screen.

    Parameters
    ----------
    head : sequence of str
        Names of the columns.
    rows : sequence of sequence of str
        Cells, as plain text.
    words : sequence of int
        Indices of the columns of text, which are aligned to the left.
    """
    kind = [' class="words"' if k in words else "" for k in range(len(head))]
    top = "".join(f"<th{kind[k]}>{html.escape(h)}</th>" for k, h in enumerate(head))
    body = "".join(
        "<tr>" + "".join(f"<td{kind[k]}>{html.escape(c)}</td>" for k, c in enumerate(row)) + "</tr>"
        for row in rows
    )
    return f'<div class="wide"><table><tr>{top}</tr>{body}</table></div>'


def imported(site: Site) -> str:
    """Return the table of an import: what each feature of the map became."""
    head, *rows = site.table()
    import_text = f"Imported from {site.file}. What was left out is not in the plan."
    if site.edited:
        import_text += " The problem was edited after the import; the table shows the import."
    if site.cropped is not None:
        x, y = site.cropped.center
        import_text += (
            f" Obstacles farther than {site.cropped.radius:.4g} from ({x:.4g}, {y:.4g}) were left "
            "out: no tether of the length given at the import reaches them."
        )
    words = (0, len(head) - 1)
    return f'<p class="note">{html.escape(import_text)}</p>' + table(head, rows, words)


def checks(verdict: Verification) -> str:
    """Return the list of the judge's checks.

    Parameters
    ----------
    verdict : Verification
        Verdict on a solution or a mission.
    """
    rows = "".join(
        f'<tr><td class="{"ok" if c.passed else "bad"}">{c.mark}</td>'
        f'<td style="text-align:left">{html.escape(c.name)}</td>'
        f'<td style="text-align:left">{html.escape(c.detail)}</td></tr>'
        for c in verdict.checks
    )
    return f"<table>{rows}</table>"


def planned_with(solution: Solution, units: str) -> str:
    """Return the margins that a tour was planned with as a sentence, or an empty string."""
    parts = []
    if solution.margin:
        parts.append(f"obstacles that may be off by {solution.margin:g} {units}")
    if solution.slack:
        parts.append(f"{100.0 * solution.slack:g} % of slack")
    if solution.max_tension_ratio is not None:
        parts.append(
            f"friction {solution.friction:g} that multiplies the tension by at most "
            f"{solution.max_tension_ratio:g}"
        )
    if solution.kept_order:
        parts.append("the order given")
    return f"Planned with {', '.join(parts)}." if parts else ""


def stops(problem: Problem, solution: Solution, found: Margins | None) -> str:
    """Return the table of visits in numbers.

    Parameters
    ----------
    problem : Problem
        Problem of the solution.
    solution : Solution
        Solution with a tour.
    found : Margins, optional
        Margins of the tour, if it has any.
    """
    u = problem.units
    north = "from north" if problem.origin else "from y"
    head = [
        "visit",
        "goal",
        f"x ({u})",
        f"y ({u})",
        f"depth ({u})",
        f"course (° {north})",
        f"leg ({u})",
        f"path so far ({u})",
        f"tether ({u})",
        f"slack ({u})",
    ]
    if found is not None:
        head += ["turning (°)", f"clearance ({u})"]
    rows, total = [], 0.0
    for n, (v, leg) in enumerate(zip(solution.tour, legs_of(problem, solution), strict=False)):
        x, y, z = problem.goals[v.goal].position
        total += leg.length
        row = [
            str(n + 1),
            problem.goal_name(v.goal),
            f"{x:.6g}",
            f"{y:.6g}",
            f"{0.0 - z:g}",
            _course(problem, leg.path),
            f"{leg.length:.5g}",
            f"{total:.6g}",
            f"{v.tether_length:.5g}",
            f"{problem.tether_length - v.tether_length:.5g}",
        ]
        if found is not None:
            s = found.visits[n]
            row += [
                f"{math.degrees(s.turning):.0f}",
                "–" if math.isinf(s.clearance) else f"{s.clearance:.4g}",
            ]
        rows.append(row)
    note = (
        f'<p class="note">Course: on arrival, clockwise {north}'
        f"{'' if problem.origin else ' (the problem has no origin, so north is not known)'}. "
        "Slack: tether that is left. Turning: sum of the angles by which the tether bends. "
        "Clearance: from tether or goal to the nearest obstacle.</p>"
    )
    return table(head, rows, (1,)) + note


def _course(problem: Problem, path: np.ndarray) -> str:
    steps = np.diff(path[:, :2], axis=0)
    long = np.flatnonzero(np.hypot(*steps.T) > 1e-9 * problem.scale)
    return f"{bearing(problem, steps[long[-1]]):.0f}" if len(long) else "–"


def tethers(problem: Problem, solution: Solution) -> str:
    """Return the course of the tether at each visit, and what to do if it snags from there on.

    Parameters
    ----------
    problem : Problem
        Problem of the solution.
    solution : Solution
        Solution whose tour is not entangled.
    """
    longest = max(v.tether_length for v in solution.tour)
    paths = TautPaths(problem, 2.0 * max(problem.tether_length, longest))
    runs: list[list[Passage]] = []
    names: list[str] = []
    rows = []
    for k, v in enumerate(solution.tour):
        tether, name = paths.tether_if_found(v.goal, v.signature), problem.goal_name(v.goal)
        passed = homeward = "unknown: the taut tether was not found"
        if tether is not None:
            runs.append(passages(problem, tether, v.signature))
            names.append(name)
            passed, homeward = (
                listed(problem, runs[-1]),
                back_from(problem, runs, names, len(runs) - 1),
            )
        rows.append([str(k + 1), name, passed, homeward, str(list(v.signature))])
    return table(
        ["visit", "goal", "the tether passes", "if it snags here, or on the way on", "word"],
        rows,
        (1, 2, 3, 4),
    )


def of_tour(problem: Problem, solution: Solution) -> Margins | None:
    """Return the margins of a tour from the base within the tether's length; None for other
    tours."""
    if problem.state is not None or solution.status is Status.INVALID:
        return None
    return margins(problem, solution, solution.friction)


def margin_list(problem: Problem, found: Margins) -> str:
    """Return the margins as a list: by how much the world may differ from the map."""
    u = problem.units
    lines = [
        "every obstacle may be elsewhere or larger, as long as it is all open water now"
        if math.isinf(found.obstacles)
        else f"every obstacle may be off by {found.obstacles:.4g} {u}, moved or grown; then "
        f"{found.limited_by}",
        f"the tether may shrink by {found.tether:.4g} {u} before a goal is out of reach",
        f"the robot may be {found.cross_track:.4g} {u} off its path",
    ]
    if found.friction:
        worst = max(found.visits, key=lambda s: s.tension_ratio)
        lines.append(
            f"friction multiplies the tension by at most {worst.tension_ratio:.3g}, at {worst.name}"
        )
    return "<ul>" + "".join(f"<li>{html.escape(t)}</li>" for t in lines) + "</ul>"


def first_words(problem: Problem, solution: Solution) -> str:
    """Return the tour in one sentence for the head of the sheet."""
    longest = max(solution.tour, key=lambda v: v.tether_length)
    return (
        f"{counted(len(solution.tour), 'visit')}; "
        f"longest tether {longest.tether_length:.5g} of {problem.tether_length:g} "
        f"{problem.units}, at {problem.goal_name(longest.goal)}."
    )
