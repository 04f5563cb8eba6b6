"""One self-contained page about a solution or a run: a map with a slider that moves the robot and
its taut tether, the goals in their order, the checks, measures of entanglement, a run's log."""

from __future__ import annotations

import csv
import html
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.arrays import Floats
from netsp.errors import InputError, counted
from netsp.execute.plan import HOME, legs_of
from netsp.files import read_text, write_text
from netsp.geometry import polylines
from netsp.hsignature.measures import measure
from netsp.judge import verify
from netsp.online.scene.scene import scene_of
from netsp.online.tether import GeodesicTether
from netsp.online.tether.resolution import suggested_delta
from netsp.pictures import style
from netsp.problem import Circle, Problem
from netsp.report.page import STYLE
from netsp.solution import Solution, Status

FRAMES = 240
WIDTH = 900.0

TOUR_STYLE = """
#map { border: 1px solid #d5dbe1; background: #f7fbff; width: 100%; max-width: 900px }
#slider { width: 100%; max-width: 900px } .chart { max-width: 900px; width: 100% }
.ok { color: #2b8a3e } .bad { color: #c92a2a } @media print { #slider, .noprint { display: none } }
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
slider.addEventListener("input", () => show(Number(slider.value)));
slider.value = Math.floor(data.length / 3);
show(Number(slider.value));
"""


def report_tour(source: str | Path, problem_file: str | Path | None, output: str | Path) -> None:
    """Write the page about a solution file (its problem is named, or lies in a run's folder) or the
    folder of a run.

    Raises
    ------
    InputError
        Files that cannot be read, or do not belong together.
    """
    place = Path(source)
    run = place if place.is_dir() else None
    if run is not None:
        if (run / "mission.json").exists() and not (run / "solution.json").exists():
            raise InputError(
                f"{source}: is a run of `netsp simulate`; its page is {source}/run.html"
            )
        problem_file = problem_file or run / "problem.json"
        place = run / "solution.json"
    solution = Solution.load(place)
    if problem_file is None:
        raise InputError(f"{source}: does not hold its problem; expected that file, too")
    problem = Problem.load(problem_file)
    if run is None and problem.sha256 != solution.problem.sha256:
        raise InputError(f"{source}: solves another problem than {problem_file} (sha256 differs)")
    if solution.length is None:
        raise InputError(f"{source}: has no tour (status {solution.status.value})")
    if len(solution.path) < 2:
        raise InputError(f"{source}: path: expected at least 2 points, got {len(solution.path)}")
    beyond = [v.goal for v in solution.tour if v.goal >= len(problem.goals)]
    if beyond:
        raise InputError(
            f"{source}: tour: no goal #{beyond[0]}; expected #0 to #{len(problem.goals) - 1}"
        )
    drawn = polylines.length(np.array(solution.path))
    if abs(drawn - solution.length) > 0.05 * max(drawn, solution.length):
        raise InputError(
            f"{source}: path: is {drawn:.4g} long; expected about length, {solution.length:.4g}"
        )
    rows = _table(run / "log.csv") if run else []
    if run is not None and not rows:
        raise InputError(f"{run / 'log.csv'}: holds no row")
    tethers = _json(run / "tethers.json") if run else None
    try:
        text = page(problem, solution, rows, tethers, run)
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise InputError(
            f"{source}: a file of the run is damaged: {type(error).__name__}: {error}"
        ) from None
    write_text(output, text)


def page(
    problem: Problem, solution: Solution, rows: list[dict[str, str]],
    tethers: list[dict[str, Any]] | None, run: Path | None,
) -> str:  # fmt: skip
    """The page as HTML.

    Parameters
    ----------
    rows, tethers
        Of a run, else empty.
    """
    frames = (
        _frames_of_run(problem, rows, tethers) if tethers else _frames_of_plan(problem, solution)
    )
    view = _View(problem, np.vstack([f["nodes"] for f in frames]))
    title = f"{problem.name}: {'a run' if run else 'a tour'}"
    fates = _fates(run)
    parts = [
        f"<h1>{html.escape(title)}</h1>",
        _summary(problem, solution, run),
        '<h2>Map</h2><p class="note">The dashed line is the tour. Move the slider: the thick line '
        "is the tether, pulled taut round the obstacles as it is when the robot is there.</p>",
        _map(problem, solution, view, fates),
        '<input id="slider" type="range" min="0" value="0" aria-label="position along the tour">',
        '<p id="state" class="note"></p>',
        "<h2>Goals in their order</h2>", _goals(problem, solution, run, fates),
    ]  # fmt: skip
    if run is None or problem.sha256 == solution.problem.sha256:
        parts += ["<h2>Checks</h2>", _checks(problem, solution)]
    if problem.state is None and problem.sha256 == solution.problem.sha256:
        parts += ["<h2>Measures of entanglement</h2>", _measures(problem, solution)]
    if rows:
        parts += ["<h2>Log</h2>", _charts(rows, problem.units), _events(run)]
    shown = [
        {
            "t": view.points(f["nodes"]), "r": view.point(f["nodes"][-1]),
            "p": view.points(f["path"]), "s": f["text"],
        }
        for f in frames
    ]  # fmt: skip
    data = json.dumps(shown, allow_nan=False).replace("<", "\\u003c")
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}'
        f'</title><link rel="icon" href="data:,"><style>{STYLE}{TOUR_STYLE}</style></head><body>'
        + "\n".join(parts)
        + f'<script type="application/json" id="frames">{data}</script>'
        + f"<script>{SCRIPT}</script></body></html>\n"
    )


class _View:
    """From the plan to the picture."""

    def __init__(self, problem: Problem, more: Floats) -> None:
        xy = [problem.points[:, :2], more[:, :2]]
        for o in problem.obstacles:
            c = np.array([o.center]) if isinstance(o, Circle) else np.array(o.polygon)
            r = o.radius if isinstance(o, Circle) else 0.0
            xy += [c - r, c + r]
        every = np.vstack(xy)
        low, high = every.min(axis=0), every.max(axis=0)
        room = 0.04 * float((high - low).max()) + 1e-9
        self.low, self.high = low - room, high + room
        self.scale = WIDTH / float(self.high[0] - self.low[0])
        self.height = float(self.high[1] - self.low[1]) * self.scale

    def point(self, p: npt.ArrayLike) -> list[float]:
        x, y = np.asarray(p, dtype=float)[:2]
        return [
            round(float(x - self.low[0]) * self.scale, 2),
            round(float(self.high[1] - y) * self.scale, 2),
        ]

    def points(self, line: Floats) -> str:
        return " ".join(f"{x},{y}" for x, y in (self.point(p) for p in line))


def _frames_of_plan(problem: Problem, solution: Solution) -> list[dict[str, Any]]:
    """The tether at even steps along the tour, by the model that watches it online."""
    model = GeodesicTether(scene_of(problem).field(), suggested_delta(problem))
    path = np.array(solution.path)
    s = polylines.along(path)
    if problem.state is None:
        state = model.start(problem.base, problem.base)
    else:
        state = model.lay(np.array(solution.start_tether))
    frames, at = [], 0
    for u in np.linspace(0.0, s[-1], FRAMES + 1):
        here = np.array([np.interp(u, s, path[:, k]) for k in range(3)])
        passed = int(np.searchsorted(s, u))
        state = model.drive(state, np.vstack([path[at:passed], here]))[0]
        at = max(at, passed)
        text = (
            f"{u:.4g} of {s[-1]:.4g} {problem.units}; tether {state.length:.4g} of "
            f"{problem.tether_length:g} {problem.units}"
        )
        frames.append(
            {"nodes": state.nodes, "path": np.vstack([path[:passed], here]), "text": text}
        )
    return frames


def _frames_of_run(
    problem: Problem, rows: list[dict[str, str]], tethers: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    times = np.array([float(r["time"]) for r in rows])
    path = np.array([[float(r[k]) for k in "xyz"] for r in rows])
    step = max(1, len(tethers) // FRAMES)
    chosen = tethers[::step] + ([tethers[-1]] if (len(tethers) - 1) % step else [])
    frames = []
    for frame in chosen:
        nodes = np.array(frame["nodes"], dtype=float)
        k = min(int(np.searchsorted(times, frame["time"])), len(rows) - 1)
        row = rows[k]
        thin = max(1, k // 400)
        text = (
            f"{frame['time']:.4g} s; tether {float(row['tether']):.4g} of {float(row['limit']):g} "
            f"{problem.units}; next: {_next(problem, int(row['goal']))}"
        )
        frames.append(
            {"nodes": nodes, "path": np.vstack([path[:k:thin], nodes[-1:]]), "text": text}
        )
    return frames


def _next(problem: Problem, goal: int) -> str:
    """What a run calls where it is going; goals that were added on the way have their number."""
    if goal == HOME:
        return "the base"
    return problem.goal_label(goal) if goal < len(problem.goals) else f"goal #{goal}"


def _summary(problem: Problem, solution: Solution, run: Path | None) -> str:
    units = html.escape(problem.units)
    proof = solution.status.value
    if solution.status is Status.OPTIMAL:
        proof = "proven optimal"
    elif solution.gap is not None:
        proof += f", at most {100 * solution.gap:.2g} % above the shortest"
    lines = [
        f"{html.escape(problem.summary)}. The plan is {solution.length:.6g} "
        f"{units} long ({proof}; solver {html.escape(solution.solver)})."
    ]
    if run is not None:
        s = _json(run / "summary.json")
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
    s = _json(run / "summary.json")
    left_out = {int(x["goal"]): "left out" for x in s["left_out"]}
    return left_out | {int(g): "cancelled" for g in s["cancelled"]}


def _map(problem: Problem, solution: Solution, view: _View, fates: dict[int, str]) -> str:
    shapes = []
    look = f'fill="{style.OBSTACLE}" stroke="{style.EDGE}"'
    for i, o in enumerate(problem.obstacles):
        title = f"<title>{html.escape(problem.obstacle_label(i))}</title>"
        if isinstance(o, Circle):
            x, y = view.point(o.center)
            shapes.append(f'<circle cx="{x}" cy="{y}" r="{o.radius * view.scale:.2f}" '
                          f'{look}>{title}</circle>')  # fmt: skip
            if len(problem.obstacles) <= 40:
                shapes.append(f'<text x="{x}" y="{y + 4}" font-size="10" text-anchor="middle" '
                              f'fill="{style.EDGE}">{html.escape(problem.obstacle_name(i))}'
                              "</text>")  # fmt: skip
        else:
            corners = view.points(np.array(o.polygon))
            shapes.append(f'<polygon points="{corners}" {look}>{title}</polygon>')
    shapes.append(f'<polyline points="{view.points(np.array(solution.path))}" fill="none" '
                  f'stroke="{style.PLAN}" stroke-dasharray="5 4"/>')  # fmt: skip
    shapes.append(f'<polyline id="done" fill="none" stroke="{style.PATH}" stroke-width="2"/>')
    shapes.append(f'<polyline id="tether" fill="none" stroke="{style.TETHER}" stroke-width="3"/>')
    visit = {v.goal: n + 1 for n, v in enumerate(solution.tour)}
    for k, goal in enumerate(problem.goals):
        x, y = view.point(goal.position)
        label = str(visit.get(k, "–"))
        colour = {"left out": style.LEFT_OUT, "cancelled": style.CANCELLED}.get(
            fates.get(k, ""), style.VISITED
        )
        fate = f" {fates[k]}" if k in fates else ""
        shapes.append(f'<circle cx="{x}" cy="{y}" r="5" fill="{colour}"><title>'
                      f"{html.escape(problem.goal_label(k))}{fate}</title></circle>"
                      f'<text x="{x + 7}" y="{y - 6}" font-size="12">{label}'
                      f'<tspan fill="{style.EDGE}"> {html.escape(goal.name or "")}{fate}</tspan>'
                      "</text>")  # fmt: skip
    x, y = view.point(problem.base)
    shapes.append(f'<polygon points="{_star(x, y)}" fill="{style.BASE}"><title>base</title>'
                  "</polygon>")  # fmt: skip
    shapes.append(f'<circle id="robot" r="6" fill="{style.ROBOT}" stroke="{style.BASE}"/>')
    return (f'<svg id="map" viewBox="0 0 {WIDTH:g} {view.height:.1f}" role="img" '
            f'aria-label="map">{"".join(shapes)}</svg>')  # fmt: skip


def _star(x: float, y: float) -> str:
    """Corners of a star, the mark of the base in all pictures."""
    angle = np.pi * (np.arange(10) / 5.0 - 0.5)
    radius = np.where(np.arange(10) % 2, 4.0, 10.0)
    corners = zip(x + radius * np.cos(angle), y + radius * np.sin(angle), strict=True)
    return " ".join(f"{a:.2f},{b:.2f}" for a, b in corners)


def _goals(problem: Problem, solution: Solution, run: Path | None, fates: dict[int, str]) -> str:
    legs = legs_of(problem, solution) if run is None else None
    arrived = {int(r["goal"]): r for r in _table(run / "visits.csv")} if run else {}
    units = html.escape(problem.units)
    head = ["visit", "goal", f"tether ({units})", f"slack ({units})", "word"]
    head += (
        [f"leg ({units})", f"path so far ({units})"]
        if legs
        else ["reached at (s)", f"tether when reached ({units})"]
    )
    body, total = [], 0.0
    for n, v in enumerate(solution.tour):
        cells = [
            str(n + 1), html.escape(problem.goal_name(v.goal)), f"{v.tether_length:.5g}",
            f"{problem.tether_length - v.tether_length:.5g}",
            str(list(v.signature)),
        ]  # fmt: skip
        if legs:
            total += legs[n].length
            cells += [f"{legs[n].length:.5g}", f"{total:.6g}"]
        else:
            row = arrived.get(v.goal)
            cells += (
                [f"{float(row['time']):.1f}", f"{float(row['tether']):.5g}"]
                if row
                else [fates.get(v.goal, "–"), "–"]
            )
        body.append("<tr>" + "".join(f"<td>{c}</td>" for c in cells) + "</tr>")
    top = "<tr>" + "".join(f"<th>{h}</th>" for h in head) + "</tr>"
    return f"<table>{top}{''.join(body)}</table>"


def _checks(problem: Problem, solution: Solution) -> str:
    rows = "".join(
        f'<tr><td class="{"ok" if c.passed else "bad"}">{"ok" if c.passed else "FAIL"}</td>'
        f'<td style="text-align:left">{html.escape(c.name)}</td>'
        f'<td style="text-align:left">{html.escape(c.detail)}</td></tr>'
        for c in verify(problem, solution).checks
    )
    return f"<table>{rows}</table>"


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


def _charts(rows: list[dict[str, str]], units: str) -> str:
    """The tether and its limit over time."""
    t = np.array([float(r["time"]) for r in rows])
    thin = slice(None, None, max(1, len(t) // 1200))
    length, limit = (np.array([float(r[k]) for r in rows]) for k in ("tether", "limit"))
    top = 1.05 * float(max(length.max(), limit.max()))
    span = float(t[-1]) or 1.0
    units = html.escape(units)

    def x(time: float) -> float:
        return 50 + 830 * time / span

    def y(value: float) -> float:
        return 180 - 165 * value / top

    def line(values: Floats) -> str:
        return " ".join(
            f"{x(a):.1f},{y(b):.1f}" for a, b in zip(t[thin], values[thin], strict=True)
        )

    grid = "".join(
        f'<line x1="50" y1="{y(v):.1f}" x2="880" y2="{y(v):.1f}" stroke="{style.OBSTACLE}"/>'
        f'<text x="44" y="{y(v) + 4:.1f}" font-size="12" text-anchor="end">{v:g}</text>'
        for v in _ticks(top)
    )
    times = "".join(
        f'<text x="{x(v):.1f}" y="198" font-size="12" text-anchor="middle">{v:g}</text>'
        for v in _ticks(span)
    )
    return (
        f'<svg class="chart" viewBox="0 0 900 222" role="img" aria-label="tether over time">{grid}'
        f'<polyline points="{line(limit)}" fill="none" stroke="{style.LIMIT}" '
        'stroke-dasharray="5 4"/>'
        f'<polyline points="{line(length)}" fill="none" stroke="{style.TETHER}" stroke-width="2"/>'
        f'<text x="465" y="216" font-size="12" text-anchor="middle">time (s)</text>{times}'
        f'<text x="12" y="98" font-size="12" text-anchor="middle" transform="rotate(-90 12 98)">'
        f"length ({units})</text></svg>"
        '<p class="note">Taut tether (solid) and its limit (dashed).</p>'
    )


def _ticks(top: float) -> list[float]:
    """Round numbers from 0 to at most `top`, four to eight of them."""
    step = 10.0 ** np.floor(np.log10(top / 4.0))
    step *= next(k for k in (10.0, 5.0, 2.0, 1.0) if k * step <= top / 3.0)
    return [float(v) for v in step * np.arange(int(top / step) + 1)]


def _events(run: Path | None) -> str:
    events = _table(run / "events.csv") if run else []
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


def _json(file: Path) -> Any:
    try:
        return json.loads(read_text(file))
    except json.JSONDecodeError as error:
        raise InputError(f"{file}: not JSON: {error.msg}") from None


def _table(file: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(read_text(file).splitlines()))
