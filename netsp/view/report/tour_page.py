"""Self-contained page about a solution or a run, which can be printed.

It has a map with a slider that moves the robot and its taut tether, the goals in order, the course
of the tether, margins, the judge's checks, measures of entanglement, and the log of a run.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.base.errors import counted
from netsp.hsignature.signature_measures import measure
from netsp.judge import verify
from netsp.judge.proof_judgement import with_claim
from netsp.model.problem import Problem
from netsp.model.solution import Solution, Status
from netsp.online.execute.tether_limits import describe_limits, limit_periods, overruns
from netsp.plan.tour_plan import HOME
from netsp.view.pictures.picture_layout import PageLayout
from netsp.view.report import briefing, chart, moving, run_page
from netsp.view.report.html_document import document
from netsp.view.report.opened import Opened, json_of

TOUR_STYLE = """
.chart { max-width: 900px; width: 100% }
@media (max-width: 600px) {
  body { margin: .6em auto; padding: 0 .6em } .chart text { font-size: 20px }
  th, td { padding: .2em .45em }
  td.words { min-width: 11em } td:nth-child(2) { min-width: 0 }
}
@page { size: A4; margin: 12mm }
@media print {
  body { margin: 0; padding: 0; max-width: none; font-size: 11px }
  .wide { overflow: visible }
  table { font-size: 9px; width: 100% } th, td { padding: .15em .35em } h1 { font-size: 16px }
  h2 { font-size: 12px; margin: .9em 0 .3em; break-after: avoid } tr, svg { break-inside: avoid }
}
"""


def page(what: Opened) -> str:
    """Return the page as HTML.

    Raises
    ------
    InputError, KeyError, IndexError, ValueError, TypeError, OverflowError
        A file of the run is damaged.
    """
    problem, solution, run = what.problem, what.solution, what.run
    film, fates = what.film(PageLayout.plane_frames), what.fates
    view = chart.View.of_film(problem, film)
    title = f"{problem.name}: {'a run' if run else 'a tour'}"
    is_same_problem = problem.sha256 == solution.problem.sha256
    found = briefing.of_tour(problem, solution) if run is None else None
    parts = [
        f"<h1>{html.escape(title)}</h1>",
        _summary(problem, solution, what),
        "<h2>Map</h2>",
        chart.draw(problem, solution, view, fates, what.maps, what.driven, what.order),
        chart.legend(run=run is not None),
        moving.CONTROLS,
        moving.STATE,
        "<h2>Goals in their order</h2>",
        briefing.stops(problem, solution, found)
        if run is None
        else _reached(problem, solution, run, fates, what.rows),
    ]
    if is_same_problem and problem.state is None and solution.status is not Status.INVALID:
        parts += ["<h2>How the tether runs</h2>", briefing.tethers(problem, solution)]
    if found is not None:
        parts += ["<h2>Margins</h2>", briefing.margin_list(problem, found)]
    if run is None or is_same_problem:
        verdict = with_claim(verify(problem, solution), solution)
        parts += ["<h2>Checks</h2>", briefing.checks(verdict)]
    if problem.state is None and is_same_problem:
        parts += [
            "<h2>Measures of entanglement</h2>",
            '<p class="note">Stricter notions from the literature, for comparison: the tour is '
            "none the worse for failing them.</p>",
            _measures(problem, solution),
        ]
    if problem.site is not None:
        parts += ["<h2>The map</h2>", briefing.imported(problem.site)]
    if what.rows:
        parts += ["<h2>Log</h2>", _over_time(what.rows, problem.units), _events(run)]
    style = briefing.STYLE + moving.STYLE + TOUR_STYLE
    return document(title, style, "\n".join(parts) + moving.script([film], [view]))


def _proof(solution: Solution) -> str:
    """Return in words what is proven about a tour, after the status unless that says it."""
    status, words = solution.status, solution.proof
    if solution.certified != "none":
        words += ", as its file says; netsp verify checks that by the proof file"
    return words if status.is_optimal else f"{status.value}, {words}"


def _summary(problem: Problem, solution: Solution, what: Opened) -> str:
    units = html.escape(problem.units)
    lines = [
        f"{html.escape(problem.summary)}. The plan is {solution.length:.6g} "
        f"{units} long ({html.escape(_proof(solution))}; solver {html.escape(solution.solver)}). "
        f"{html.escape(briefing.first_words(problem, solution))}"
    ]
    if planned := briefing.planned_with(solution, problem.units):
        lines.append(html.escape(planned))
    if what.run is not None:
        s = json_of(what.run / "summary.json")
        lengths = lengths_of(what.rows)
        visit_words = describe_limits(limit_periods(*lengths[:3]), overruns(*lengths), units)
        lines.append(
            f"Carried out in {s['time_s']:.5g} s over {s['path']:.6g} {units}: "
            f"{counted(s['visited'], 'goal')} visited, tether {visit_words}; "
            f"{'recovered free' if s['tether_free'] else 'not recovered free'} at the end."
        )
    return "".join(f"<p>{line}</p>" for line in lines)


def lengths_of(rows: Sequence[dict[str, str]]) -> tuple[Floats, Floats, Floats, Bools]:
    """Return time (s), tether length, limit, and whether the tether is being shortened, by row."""
    t, tether, limit = (np.array([float(r[k]) for r in rows]) for k in ("time", "tether", "limit"))
    return t, tether, limit, np.array([r.get("shortening") == "True" for r in rows], dtype=bool)


def _reached(
    problem: Problem,
    solution: Solution,
    run: Path,
    fates: dict[int, str],
    rows_of_log: Sequence[dict[str, str]],
) -> str:
    """Return a table of the visits in order, and of the goals that were not visited."""
    times, _, limits, _ = lengths_of(rows_of_log)
    u, planned = problem.units, {v.goal: v for v in solution.tour}
    head = [
        "visit",
        "goal",
        "reached at (s)",
        f"tether out ({u})",
        f"slack ({u})",
        "word",
        f"planned at the start ({u})",
        "word then",
    ]
    rows: list[list[str]] = []
    missed = list(planned)

    def visit_words(goal: int) -> list[str]:
        v = planned.get(goal)
        return ["–", "–"] if v is None else [f"{v.tether_length:.5g}", str(list(v.signature))]

    for row in run_page.rows_of(run / "visits.csv"):
        goal = int(row["goal"])
        if goal == HOME:
            continue
        missed = [g for g in missed if g != goal]
        out = float(row["tether"])
        then = int(np.searchsorted(times, float(row["time"]), "right"))
        limit = float(limits[max(then - 1, 0)])
        rows.append(
            [
                str(len(rows) + 1),
                problem.goal_name(goal),
                f"{float(row['time']):.1f}",
                f"{out:.5g}",
                f"{limit - out:.5g}",
                str([int(a) for a in row["word"].split()]),
                *visit_words(goal),
            ]
        )
    for goal in missed:
        fate = fates.get(goal, "not reached")
        rows.append(["–", problem.goal_name(goal), fate, "–", "–", "–", *visit_words(goal)])
    return briefing.table(head, rows, (1, 5, 7))


def _measures(problem: Problem, solution: Solution) -> str:
    m = measure(problem, np.array(solution.path))

    def names(which: tuple[int, ...] | None) -> str:
        return ", ".join(problem.obstacle_name(i) for i in which or ()) or "none"

    def verdict(broken: tuple[int, ...]) -> str:
        return f"fails at {names(broken)}" if broken else "holds"

    turns = "all zero" if not any(m.winding or ()) else str(m.winding)
    rows = [
        ("word", str(list(m.signature)) if m.signature else "empty"),
        ("entangled obstacles", names(m.entangled)),
        ("winding numbers", turns),
        ("self-crossings", str(m.self_crossings)),
        ("obstacle-free convex hull", verdict(m.convex_hull)),
        ("obstacle-free linear homotopy", verdict(m.linear_homotopy)),
        ("local visibility homotopy", verdict(m.local_visibility)),
    ]
    body = "".join(
        f'<tr><td>{k}</td><td style="text-align:left">{html.escape(v)}</td></tr>' for k, v in rows
    )
    return f"<table>{body}</table>"


def _over_time(rows: Sequence[dict[str, str]], units: str) -> str:
    return run_page.over_time(*lengths_of(rows)[:3], units)


def _events(run: Path | None) -> str:
    events = run_page.rows_of(run / "events.csv") if run else []
    if not events:
        return "<p>Nothing unforeseen happened.</p>"
    columns = {
        "time": "time (s)",
        "event": "event",
        "response": "response",
        "reason": "reason",
        "planning_s": "planning (s)",
    }
    top = "<tr>" + "".join(f"<th>{n}</th>" for n in columns.values()) + "</tr>"
    body = "".join(
        f"<tr><td>{float(e['time']):.1f}</td><td>{html.escape(e['event'])}</td>"
        f"<td>{html.escape(e['response'])}</td>"
        f'<td style="text-align:left">{html.escape(e["reason"])}</td>'
        f"<td>{float(e['planning_s']):.2f}</td></tr>"
        for e in events
    )
    return f"<table>{top}{body}</table>"
