"""Self-contained HTML page that compares paths with the planned tour."""

from __future__ import annotations

import html

from netsp.study.compare.path_comparison import ComparedPath, PathComparison
from netsp.view.pictures import style
from netsp.view.pictures.path_picture import draw_path_map, draw_tether_along
from netsp.view.report import briefing
from netsp.view.report.html_document import document
from netsp.view.report.path_wording import figures_of

PAGE_STYLE = """
.pair { display: flex; flex-wrap: wrap; gap: .5em 1.5em } .pair figure { flex: 1 1 26em; margin: 0;
  min-width: 0 } .figures td:nth-child(n+2), .figures th:nth-child(n+2) { text-align: right }
@page { size: A4; margin: 12mm }
@media print { body { margin: 0; max-width: none; font-size: 11px } .pair figure { flex-basis: 40% }
  h2 { break-after: avoid } tr, figure { break-inside: avoid } table { font-size: 9px } }
"""


def page(found: PathComparison) -> str:
    """Return the page as HTML.

    Returns
    -------
    str
        A page that needs no other file.
    """
    problem = found.problem
    title = f"{problem.name}: paths beside the planned tour"
    parts = [
        f"<h1>{html.escape(title)}</h1>",
        f"<p>{html.escape(_introduction(found))}</p>",
        _figures(found),
    ]
    for path in found.paths:
        parts += [f"<h2>{html.escape(path.name)}</h2>", *_path(found, path)]
    return document(title, briefing.STYLE + PAGE_STYLE, "\n".join(parts))


def _introduction(found: PathComparison) -> str:
    problem = found.problem
    tour = (
        f"There is no planned tour: {found.tour_note}."
        if found.tour_length is None
        else f"The planned tour is {found.tour_length:.6g} {problem.units} long ({found.proof})."
    )
    return (
        f"{problem.summary}. {tour} A goal counts as visited within "
        f'{found.paths[0].measures.radius:g} {problem.units}. "Order" is the shortest tour that '
        "visits the goals in the order of the path. The tether is the longest that is out at any "
        "place of the path, pulled taut."
    )


def _figures(found: PathComparison) -> str:
    u = found.problem.units
    head = [
        "path",
        f"length ({u})",
        "more (%)",
        "time (s)",
        "goals",
        f"tether ({u})",
        "home",
        f"order ({u})",
        "more (%)",
    ]
    rows = []
    for row in found.rows():
        home = "free" if row["free"] else ("entangled" if row["comes_home"] else "no")
        rows.append(
            [
                row["path"],
                _number(row["length"], ".4f"),
                _number(row["longer_by_percent"], "+.1f"),
                _number(row["time_s"], ".0f"),
                f"{row['goals_visited']} of {row['goals']}",
                _number(row["longest_tether"], ".2f"),
                home,
                _number(row["order_length"], ".4f"),
                _number(row["order_longer_by_percent"], "+.1f"),
            ]
        )
    return briefing.table(head, rows, (0,))


def _number(value: float | None, form: str) -> str:
    if value is None:
        return "–"
    text = format(value, form)
    return text.rstrip("0").rstrip(".") if form == ".4f" else text.replace("-0.0", "+0.0")


def _path(found: PathComparison, path: ComparedPath) -> list[str]:
    from matplotlib.figure import Figure

    pictures = []
    for is_map in (True, False):
        figure = Figure(figsize=(6.5, 4.6), layout="constrained")
        ax = figure.subplots()
        if is_map:
            draw_path_map(found, path, ax=ax)
        else:
            draw_tether_along(path.measures, ax=ax)
        pictures.append(f"<figure>{style.svg(figure)}</figure>")
    m, problem = path.measures, found.problem
    u = problem.units
    visits = briefing.table(
        [
            "visit",
            "goal",
            f"path so far ({u})",
            "time (s)",
            f"off by ({u})",
            f"tether ({u})",
            f"slack ({u})",
            "word",
        ],
        [
            [
                str(k),
                problem.goal_name(v.goal) + ("" if v.is_first else " again"),
                f"{v.along:.2f}",
                f"{v.time_s:.1f}",
                f"{v.miss:.2f}",
                "unknown" if v.tether is None else f"{v.tether:.2f}",
                "–" if v.tether is None else f"{problem.tether_length - v.tether:.2f}",
                str(list(v.word)) if v.word else "empty",
            ]
            for k, v in enumerate(m.visits, 1)
        ],
        (1, 7),
    )
    return [
        '<div class="pair">' + "".join(pictures) + "</div>",
        briefing.table(["figure", "value"], [list(r) for r in figures_of(found, path)], (0, 1)),
        visits if m.visits else "<p>No goal is visited.</p>",
    ]
