"""One self-contained page about a solution or a run, to print and take along: a map with a slider
that moves the robot and its taut tether, the goals in their order, how the tether runs, margins,
the checks, measures of entanglement, a run's log."""

from __future__ import annotations

import html
import json
from pathlib import Path
from typing import Any

import numpy as np

from netsp.errors import InputError, counted
from netsp.execute.passing import Maps
from netsp.files import write_text
from netsp.hsignature.measures import measure
from netsp.judge import verify
from netsp.pictures.moments import moments_of_plan, moments_of_run
from netsp.problem import Problem
from netsp.report import briefing, chart, log
from netsp.report.opened import json_of, opened
from netsp.report.page import STYLE
from netsp.solution import Solution, Status, above_shortest

FRAMES = 240

TOUR_STYLE = """
#map { background: #fff; width: 100%; max-width: 900px } #map text { font-size: 12px }
#map .name { font-size: 11px; fill: #1b2631; paint-order: stroke; stroke: #fff; stroke-width: 3px }
#map .visit { font-size: 10.5px } #map .grid { stroke: #e8edf1; fill: none }
#slider { width: 100%; max-width: 900px } .chart { max-width: 900px; width: 100% }
.legend { list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: .2em 1.2em;
  font-size: 13px } .legend svg { vertical-align: -3px }
@media (max-width: 600px) {
  body { margin: .6em auto; padding: 0 .6em } #map text, .chart text { font-size: 20px }
  #map .visit { font-size: 14px } #map .name { font-size: 18px } th, td { padding: .2em .45em }
  td.words { min-width: 11em } td:nth-child(2) { min-width: 0 }
}
@page { size: A4; margin: 12mm }
@media print {
  body { margin: 0; padding: 0; max-width: none; font-size: 11px }
  .noprint, #robot, #tether, #done { display: none } .wide { overflow: visible }
  table { font-size: 9px; width: 100% } th, td { padding: .15em .35em } h1 { font-size: 16px }
  h2 { font-size: 12px; margin: .9em 0 .3em; break-after: avoid } tr, svg { break-inside: avoid }
  #map { max-height: 130mm }
}
"""

SCRIPT = """
const data = JSON.parse(document.getElementById("frames").textContent);
const slider = document.getElementById("slider");
function show(k) {
  const f = data[k];
  document.getElementById("tether").setAttribute("points", f.t);
  document.getElementById("robot").setAttribute("cx", f.r[0]);
  document.getElementById("robot").setAttribute("cy", f.r[1]);
  document.getElementById("done").setAttribute("points", f.p);
  document.getElementById("state").textContent = f.s;
}
slider.max = data.length - 1;
let fresh = true;
slider.addEventListener("input", () => { fresh = false; stop(); show(Number(slider.value)); });
slider.value = Math.floor(data.length / 3);
show(Number(slider.value));
const button = document.getElementById("play");
let timer = null;
function stop() {
  clearInterval(timer);
  timer = null;
  button.textContent = "▶ play";
}
button.addEventListener("click", () => {
  if (timer !== null) return stop();
  if (fresh || Number(slider.value) >= data.length - 1) slider.value = 0;
  fresh = false;
  button.textContent = "❚❚ pause";
  timer = setInterval(() => {
    slider.value = Number(slider.value) + 1;
    show(Number(slider.value));
    if (Number(slider.value) >= data.length - 1) stop();
  }, 60);
});
"""


def report_tour(source: str | Path, problem_file: str | Path | None, output: str | Path) -> None:
    """Write the page about a solution file (its problem is named, or lies in a run's folder) or the
    folder of a run.

    Raises
    ------
    InputError
        Files that cannot be read, or do not belong together.
    """
    what = opened(source, problem_file)
    try:
        text = page(what.problem, what.solution, what.rows, what.tethers, what.run, what.maps)
    except (KeyError, IndexError, ValueError, TypeError, OverflowError) as error:
        raise InputError(
            f"{source}: a file of the run is damaged: {type(error).__name__}: {error}"
        ) from None
    write_text(output, text)


def page(
    problem: Problem, solution: Solution, rows: list[dict[str, str]],
    tethers: list[dict[str, Any]] | None, run: Path | None, maps: Maps = (),
) -> str:  # fmt: skip
    """The page as HTML.

    Parameters
    ----------
    rows, tethers
        Of a run, else empty.
    maps : sequence of (float, Problem)
        The site as it was from some seconds on; by default, as it is.
    """
    moments = (
        moments_of_run(maps or [(0.0, problem)], rows, tethers, FRAMES) if tethers
        else moments_of_plan(problem, solution, FRAMES)
    )  # fmt: skip
    view = chart.View(problem, np.vstack([m.nodes for m in moments]))
    title = f"{problem.name}: {'a run' if run else 'a tour'}"
    fates = _fates(run)
    own = problem.sha256 == solution.problem.sha256
    found = briefing.of_tour(problem, solution) if run is None else None
    parts = [
        f"<h1>{html.escape(title)}</h1>",
        _summary(problem, solution, run),
        "<h2>Map</h2>", chart.draw(problem, solution, view, fates, maps), chart.legend(),
        '<div class="noprint"><button id="play" type="button">▶ play</button>'
        '<input id="slider" type="range" min="0" value="0" '
        'aria-label="position along the tour"><p class="note">Move the slider: the thick line is '
        "the tether, pulled taut round the obstacles as it is when the robot is there.</p>"
        '<p id="state" class="note"></p></div>',
        "<h2>Goals in their order</h2>",
        briefing.stops(problem, solution, found) if run is None
        else _reached(problem, solution, run, fates),
    ]  # fmt: skip
    if own and problem.state is None and solution.status is not Status.INVALID:
        parts += ["<h2>How the tether runs</h2>", briefing.tethers(problem, solution)]
    if found is not None:
        parts += ["<h2>Margins</h2>", briefing.margin_list(problem, found)]
    if run is None or own:
        parts += ["<h2>Checks</h2>", briefing.checks(verify(problem, solution))]
    if problem.state is None and own:
        parts += ["<h2>Measures of entanglement</h2>", _measures(problem, solution)]
    if rows:
        parts += ["<h2>Log</h2>", _over_time(rows, problem.units), _events(run)]
    shown = [
        {
            "t": view.points(m.nodes), "r": view.point(m.nodes[-1]),
            "p": view.points(m.path), "s": m.text,
        }
        for m in moments
    ]  # fmt: skip
    data = json.dumps(shown, allow_nan=False).replace("<", "\\u003c")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}"
        f'</title><link rel="icon" href="data:,"><style>{STYLE}{briefing.STYLE}{TOUR_STYLE}'
        "</style></head><body>"
        + "\n".join(parts)
        + f'<script type="application/json" id="frames">{data}</script>'
        + f"<script>{SCRIPT}</script></body></html>\n"
    )


def _summary(problem: Problem, solution: Solution, run: Path | None) -> str:
    units = html.escape(problem.units)
    proof = solution.status.value
    if solution.status is Status.OPTIMAL:
        proof = "proven optimal"
    elif solution.gap is not None:
        proof += f", {above_shortest(solution.gap)}"
    lines = [
        f"{html.escape(problem.summary)}. The plan is {solution.length:.6g} "
        f"{units} long ({proof}; solver {html.escape(solution.solver)}). "
        f"{html.escape(briefing.first_words(problem, solution))}"
    ]
    if planned := briefing.planned_with(solution):
        lines.append(html.escape(planned))
    if run is not None:
        s = json_of(run / "summary.json")
        lines.append(
            f"Carried out in {s['time_s']:.5g} s over {s['path']:.6g} {units}: "
            f"{counted(s['visited'], 'goal')} visited, longest tether "
            f"{s['longest_tether']:.5g} {units}, over the limit for {s['exceedance_s']:.3g} s, "
            f"{'recovered free' if s['tether_free'] else 'not recovered free'} at the end."
        )
    return "".join(f"<p>{line}</p>" for line in lines)


def _fates(run: Path | None) -> dict[int, str]:
    """Goals that were not visited, and why not in two words."""
    if run is None:
        return {}
    s = json_of(run / "summary.json")
    left_out = {int(x["goal"]): "left out" for x in s["left_out"]}
    return left_out | {int(g): "cancelled" for g in s["cancelled"]}


def _reached(problem: Problem, solution: Solution, run: Path, fates: dict[int, str]) -> str:
    """The visits of a plan that was carried out."""
    arrived = {int(r["goal"]): r for r in log.rows_of(run / "visits.csv")}
    u = problem.units
    head = ["visit", "goal", f"tether ({u})", f"slack ({u})", "reached at (s)",
            f"tether when reached ({u})", "word"]  # fmt: skip
    rows = []
    for n, v in enumerate(solution.tour):
        row = arrived.get(v.goal)
        rows.append([
            str(n + 1), problem.goal_name(v.goal), f"{v.tether_length:.5g}",
            f"{problem.tether_length - v.tether_length:.5g}",
            f"{float(row['time']):.1f}" if row else fates.get(v.goal, "–"),
            f"{float(row['tether']):.5g}" if row else "–", str(list(v.signature)),
        ])  # fmt: skip
    return briefing.table(head, rows, (1, 6))


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


def _over_time(rows: list[dict[str, str]], units: str) -> str:
    times, lengths, limits = (
        np.array([float(r[k]) for r in rows]) for k in ("time", "tether", "limit")
    )
    return log.over_time(times, lengths, limits, units)


def _events(run: Path | None) -> str:
    events = log.rows_of(run / "events.csv") if run else []
    if not events:
        return "<p>Nothing unforeseen happened.</p>"
    columns = {
        "time": "time (s)", "event": "event", "response": "response", "reason": "reason",
        "planning_s": "planning (s)",
    }  # fmt: skip
    top = "<tr>" + "".join(f"<th>{n}</th>" for n in columns.values()) + "</tr>"
    body = "".join(
        f"<tr><td>{float(e['time']):.1f}</td><td>{html.escape(e['event'])}</td>"
        f"<td>{html.escape(e['response'])}</td>"
        f'<td style="text-align:left">{html.escape(e["reason"])}</td>'
        f"<td>{float(e['planning_s']):.2f}</td></tr>"
        for e in events
    )
    return f"<table>{top}{body}</table>"
