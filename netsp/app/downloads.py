"""Files that the page offers: the problem, the tour, the report and exports."""

from __future__ import annotations

from urllib.parse import quote

from starlette.responses import PlainTextResponse, Response

from netsp.app.drawn_path import drawn_file
from netsp.app.page_session import Session
from netsp.app.served_files import EXPORTS, exported, without_options
from netsp.base.errors import InputError
from netsp.model.solution import Solution


def download(session: Session, name: str) -> Response:
    """Return a file of what is shown: problem.json, solution.json or report.html."""
    notes: list[str] = []
    try:
        if session.shown is not None and session.shown.solution is None:
            return PlainTextResponse("netsp: a run has no such file", status_code=404)
        problem = session.document.problem() if session.shown is None else session.shown.problem()
        if name == "problem.json":
            text, kind = problem.to_json(), "application/json"
        elif name == "drawn.geojson":
            text, kind = drawn_file(problem, session.drawn), "application/geo+json"
        elif session.solution is None:
            return PlainTextResponse("netsp: there is no tour yet", status_code=409)
        elif name == "solution.json":
            text, kind = session.solution, "application/json"
        elif name == "report.html":
            from netsp.view.report.opened import Opened
            from netsp.view.report.tour_page import page

            solution = Solution.from_json(session.solution)
            text, kind = page(Opened(problem, solution)), "text/html"
        elif name in EXPORTS:
            name, text, notes = exported(problem, Solution.from_json(session.solution), name)
            kind = "application/octet-stream"
        else:
            return PlainTextResponse("netsp: no such file", status_code=404)
    except InputError as error:
        return PlainTextResponse(f"netsp: {without_options(str(error))}", status_code=409)
    return Response(
        text,
        media_type=kind,
        headers={
            "content-disposition": f'attachment; filename="{name}"',
            "x-notes": quote("\n".join(map(without_options, notes))),
        },
    )
