"""Self-contained page about a planned mission or a flight.

It has pictures, the waypoints in order with the tether at each, the judge's checks, and the events
of a flight.
"""

from __future__ import annotations

import base64
import html
import io
import json
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import counted
from netsp.base.files import read_text
from netsp.base.geometry import polylines
from netsp.base.validated import parse_json_object
from netsp.model.bound_scope import LowerBound, Scope, above_shortest
from netsp.model.solution import Status
from netsp.plan.space.judge import verify_mission
from netsp.view.pictures import style
from netsp.view.pictures.scene_picture import figure_of
from netsp.view.pictures.waypoint_marks import WaypointMarks
from netsp.view.report import briefing, run_page
from netsp.view.report.html_document import document
from netsp.view.report.opened import OpenedMission
from netsp.world.mission.mission import Mission
from netsp.world.mission.planned_tour import PlannedTour
from netsp.world.scene.scene import Scene


def page(what: OpenedMission) -> str:
    """Return the page as HTML.

    Raises
    ------
    InputError, KeyError, IndexError, ValueError, TypeError
        A file of the flight is damaged.
    """
    mission, scene, run = what.mission, what.scene, what.run
    title = f"{mission.name}: {'a planned mission' if run is None else 'a flight'}"
    summary: dict[str, Any] = {}
    rows: list[dict[str, str]] = []
    if run is not None:
        summary = parse_json_object(read_text(run / "summary.json"), str(run / "summary.json"))
        rows = run_page.rows_of(run / "log.csv")
    parts = [f"<h1>{html.escape(title)}</h1>", _summary(mission, scene, summary)]
    line = _line(mission, rows)
    left = tuple(int(w["waypoint"]) for w in summary.get("left_out", ()))
    left = left or tuple(range(_stops(mission), len(mission.waypoints))) * (run is None)
    stops = WaypointMarks(mission.places, left, mission.anchor, visited=run is not None)
    parts += ["<h2>Pictures</h2>", _picture(scene, line, mission.name, stops)]
    if run is not None and (run / "run.html").exists():
        parts.append(
            '<p class="note">In space, with a slider for the time: <code>run.html</code> in the '
            "folder of the run.</p>"
        )
    parts += ["<h2>Waypoints in their order</h2>", _waypoints(mission, summary)]
    if mission.tour is not None and summary.get("surprises") is None:
        verdict = verify_mission(mission, scene=scene)
        parts += ["<h2>Checks</h2>", briefing.checks(verdict)]
    if rows:
        lengths = np.array([float(r["payout"]) for r in rows])
        times = np.array([float(r["time"]) for r in rows])
        limit = np.array([float(r.get("limit", mission.tether_length)) for r in rows])
        parts += [
            "<h2>Tether over time</h2>",
            run_page.over_time(times, lengths, limit, scene.units),
        ]
        parts += ["<h2>What happened</h2>", _repairs(summary)]
    return document(title, briefing.STYLE, "\n".join(parts))


def _stops(mission: Mission) -> int:
    return len(mission.waypoints) if mission.tour is None else len(mission.tour.stops)


def _line(mission: Mission, rows: list[dict[str, str]]) -> Floats:
    """Return the flown or planned path (k, 3)."""
    if rows:
        return np.array([[float(r[k]) for k in "xyz"] for r in rows])
    assert mission.tour is not None
    return mission.tour.line


def _summary(mission: Mission, scene: Scene, summary: dict[str, Any]) -> str:
    unit, tour = html.escape(scene.units), mission.tour
    lines = [
        f"{counted(len(mission.waypoints), 'waypoint')} in <i>{html.escape(scene.name)}</i>, "
        f"tether {mission.tether_length:g} {unit}, clearance {mission.clearance:g} {unit}, "
        f"{mission.speed:g} m/s."
    ]
    if tour is not None:
        lines.append(_planned(tour, mission, unit))
    if summary:
        home = summary["home"]
        lines.append(
            f"Flown by <i>{html.escape(str(summary['planner']))}</i> in "
            f"{summary['inspection_s'] + home['seconds']:.1f} s over {summary['path']:.5g} {unit} "
            f"of inspection: {summary['visited']} of "
            f"{counted(summary['waypoints'], 'waypoint')} visited, longest tether "
            f"{summary['longest_tether']:.4g} {unit}, over the limit for "
            f"{summary['exceedance_s']:.3g} s, home "
            f"{'reached, the tether free' if home['tether_free'] else 'not reached free'}."
        )
    return "".join(f"<p>{line}</p>" for line in lines)


def _planned(tour: PlannedTour, mission: Mission, unit: str) -> str:
    """Return in words what is proven about a tour, and for which scope."""
    proof = "found"
    if tour.status is Status.OPTIMAL:
        proof = f"{tour.status.verdict} among {Scope.ALL_TOURS.tours} to its waypoints"
    elif tour.lower_bound is not None:
        searched = f"{counted(tour.legs, 'leg')}, {counted(tour.states, 'state')} of the tether"
        of_states = LowerBound(tour.lower_bound, Scope.STATES)
        optimal = tour.status.is_optimal
        proof = (
            f"{of_states.scope.shortest if optimal else above_shortest(tour.length, of_states)} "
            f"({searched})"
        )
    all_of = ""
    if tour.bound_of_all is not None and tour.status is not Status.OPTIMAL:
        of_all = LowerBound(tour.bound_of_all, Scope.ALL_TOURS)
        all_of = f", and {above_shortest(tour.length, of_all)}"
    if tour.unresolved_gaps:
        named = "; ".join(str(gap) for gap in tour.unresolved_gaps)
        all_of += (
            f". The robot may fit through gaps that the grid does not show, and no tour through "
            f"them was considered; a finer cell may show them: {html.escape(named)}"
        )
    elif tour.unresolved_gaps is None:
        all_of += (
            ". Gaps that the robot fits through but the grid does not show were not searched for"
        )
    return (
        f"The tour is {tour.length:.5g} {unit} long: {proof} (solver {html.escape(tour.solver)})"
        f"{all_of}. At {mission.speed:g} m/s it takes {tour.length / mission.speed:.0f} s, stops "
        f"not included. The longest tether on the way is {tour.longest_tether:.4g} {unit}."
    )


def _picture(scene: Scene, line: Floats, name: str, stops: WaypointMarks) -> str:
    """Return a figure as an SVG image of lines; the triangles of a mesh would take megabytes."""
    out = io.BytesIO()
    style.literal(figure_of(scene, line, name, stops)).savefig(out, format="png", dpi=110)
    data = base64.b64encode(out.getvalue()).decode()
    return (
        f'<figure><img src="data:image/png;base64,{data}" style="max-width: 100%" '
        'alt="the way of the robot in space, from above and from two sides"></figure>'
    )


def _waypoints(mission: Mission, summary: dict[str, Any]) -> str:
    """Return the table of waypoints."""
    tour = mission.tour
    flown = {int(s["waypoint"]): s for s in summary.get("stops", ())}
    words = {int(s["waypoint"]): s for s in (summary.get("words") or {}).get("stops", ())}
    reasons = {int(w["waypoint"]): w["reason"] for w in summary.get("left_out", ())}
    head = [
        "#",
        "given as",
        "position (m)",
        "heading (°)",
        "stay (s)",
        "leg (m)",
        "tether planned (m)",
        "most on the way (m)",
    ]
    hanging = {int(b["waypoint"]): b for b in (summary.get("bracket") or {}).get("stops", ())}
    head += ["tether flown (m)", "as planned"] if summary else []
    head += ["at least – at most (m)"] if hanging else []
    head.append("word")
    rows = []
    for k, w in enumerate(mission.waypoints):
        stop = tour.stops[k] if tour is not None and k < len(tour.stops) else None
        row = [
            str(k),
            "–" if stop is None or stop.given_as is None else f"#{stop.given_as}",
            ", ".join(f"{v:.4g}" for v in w.position),
            "–" if w.heading is None else f"{w.heading:g}",
            f"{w.dwell:g}",
            "–" if stop is None else f"{polylines.length(np.array(stop.path)):.4g}",
            "–" if stop is None else f"{stop.tether_length:.4g}",
            "–" if stop is None else f"{stop.longest_tether:.4g}",
        ]
        stated = None if stop is None else stop.signature
        word = None if stated is None else list(stated)
        if summary:
            row.append(f"{flown[k]['tether']:.4g}" if k in flown else reasons.get(k, "–"))
            same = words.get(k, {}).get("as_planned")
            row.append("–" if same is None else "yes" if same else "no")
            word = words[k]["signature"] if k in words else word
        if hanging:
            b = hanging.get(k)
            row.append("–" if b is None else f"{b['at_least']:.4g} – {b['at_most']:.4g}")
        row.append("–" if word is None else json.dumps(word))
        rows.append(row)
    last = len(head) - 1
    note = (
        '<p class="note">A word tells the class of the tether in the letters of this mission; '
        "[] is the class of the shortest way from the anchor.</p>"
    )
    if hanging:
        note += (
            '<p class="note">At least – at most: where the tether hangs on the end of something, '
            "it may slip off earlier or later. The column shows its length if it slips at once, "
            f"and if friction of {summary['bracket']['hold_friction']:g} holds it.</p>"
        )
    return briefing.table(head, rows, (2, last)) + note


def _repairs(summary: dict[str, Any]) -> str:
    """Return the table of surprises and repairs."""
    surprises, repairs = summary.get("surprises"), summary.get("repairs") or ()
    if not surprises:
        return "<p>Nothing unforeseen happened.</p>"
    text = f"<p>{counted(surprises['happened'], 'event')} happened.</p>"
    if not repairs:
        return text
    rows = [
        [
            f"{r['time']:.1f}",
            f"#{r['waypoint']}",
            r["response"],
            r["reason"],
            f"{r['length']:.4g}",
            f"{r['planning_s']:.2f}",
        ]
        for r in repairs
    ]
    head = ["time (s)", "before waypoint", "response", "reason", "to go (m)", "planning (s)"]
    return text + briefing.table(head, rows, (2, 3))
