"""Page of tours or runs side by side, with one slider for all."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path

from netsp.base.files import write_text
from netsp.view.pictures.picture_layout import PageLayout
from netsp.view.report import chart, moving
from netsp.view.report.html_document import document
from netsp.view.report.opened import Opened

BESIDE = """
body { max-width: none } .beside { display: flex; flex-wrap: wrap; gap: 1em 2em }
.beside > section { flex: 1 1 22em; min-width: 0 } .beside h2 { margin: .2em 0 }
"""


def save_beside(opened: Sequence[Opened], output: str | Path) -> None:
    """Write a page of tours or runs side by side.

    Parameters
    ----------
    opened : sequence of Opened
        Tours or runs from left to right.
    output : str or Path
        File to write; an existing one is replaced.

    Raises
    ------
    InputError
        A file of a run is damaged, or the page cannot be written.
    """
    films = [one.film(PageLayout.plane_frames) for one in opened]
    views = [chart.View.of_film(one.problem, film) for one, film in zip(opened, films, strict=True)]
    names = list(dict.fromkeys(one.problem.name for one in opened))
    title = f"{' and '.join(names)}: {len(opened)} side by side"
    sections = "".join(
        f"<section><h2>{html.escape(film.title)}</h2>"
        f"{chart.draw(one.problem, one.solution, view, one.fates, one.maps, one.driven, one.order)}"
        f"{moving.STATE}"
        "</section>"
        for one, film, view in zip(opened, films, views, strict=True)
    )
    body = (
        f"<h1>{html.escape(title)}</h1>{moving.CONTROLS}"
        f'<div class="beside">{sections}</div>'
        f"{chart.legend(run=any(one.run for one in opened))}"
        f"{moving.script(films, views)}"
    )
    write_text(output, document(title, moving.STYLE + BESIDE, body))
